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

"""
Writes of the bridge itself: heartbeats and fallback values (docs/heartbeats.md).

- ``queue``: at each turn of the line it returns the write that is due.
- ``plc``: the rows of one station, and which of them goes first.
- ``heartbeat``, ``fallback``: one row each, with its rules; ``own``: what they share.
"""
