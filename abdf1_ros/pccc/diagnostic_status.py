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

"""Which layout the reply to a diagnostic status command (06/03) has, and so who has answered."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import gateways
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.identity import Identity

_LAYOUTS = (*(family.decode_identity for family in FAMILIES.values()), gateways.decode)


def decode_identity(data: bytes) -> Identity:
    """
    Read the data of a reply to 06/03.

    Data of an unknown layout are shown in hexadecimal. Raises FormatError for a reply that is too
    short to tell.
    """
    if len(data) < 2:
        raise FormatError(f'a diagnostic status of {len(data)} bytes')
    for decode in _LAYOUTS:
        identity = decode(data)
        if identity is not None:
            return identity
    return Identity('', f'unknown processor ({data[:8].hex(" ").upper()})')
