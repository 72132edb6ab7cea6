# Copyright 2026 abdf1_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What EXT STS mean that an SLC or MicroLogix sends: as on DH-485 (M 8-5)."""

from __future__ import annotations

from abdf1_ros.pccc.status import Meanings

MEANINGS = Meanings(ext_sts={
    0x07: 'memory module is too small',
    0x0B: 'access denied',
    0x0C: 'resource not available',
    0x12: 'bad parameter',
    0x14: 'failed while it was carried out'})
