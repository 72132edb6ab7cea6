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

"""The ways to the words of a PLC, for families that have more than one."""

from __future__ import annotations

from enum import Enum


class Access(Enum):
    """
    A way to the words of a data table; the value is its name in the map file.

    PLC-5: TYPED commands (M 7-28), or WORD_RANGE for processors and gateways without them
    (M 7-34). SLC and MicroLogix: O and I by SLOT and word (M 7-17), or FLAT, the word in the
    whole image. PLC-2: UNPROTECTED or PROTECTED writes (M 7-30..7-40), or CIF, the common
    interface file of an SLC (file 9) or MicroLogix 1000 (N7) that counts words, not bytes
    (S:2/8 is 0).
    """

    TYPED = 'Typed'
    WORD_RANGE = 'WordRange'
    SLOT = 'Slot'
    FLAT = 'Flat'
    UNPROTECTED = 'Unprotected'
    PROTECTED = 'Protected'
    CIF = 'CIF'
