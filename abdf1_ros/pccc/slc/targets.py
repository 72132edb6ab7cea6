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
What the commands of an SLC 500 or MicroLogix address: only known file types differ.

A type that is in no list here may be anything: the ladder (22), the configuration of the channels
(49), forces (A1, A2), an online edit (65), or an unknown type. These names, and the function files
that ``address`` lacks, are in Wireshark (epan/dissectors/packet-cip.h).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import ADDRESSING, BY_CODE, CLOCK
from abdf1_ros.pccc.slc.commands import LogicalAddress
from abdf1_ros.pccc.slc.file_search import list_codes
from abdf1_ros.pccc.targets import in_status_file, Partner, Reach, Target

# CS, ES, IOS, RTC, BHI, MMI, LCD: function files whose words we do not know.
_OTHER_FUNCTIONS = (0x48, 0x4A, 0x6A, 0xE4, 0xE5, 0xE6, 0xEC)

# The files whose number has one type (M 13-13). A PLC may look at the number alone.
_FIXED = {kind.default_file: kind
          for kind in (FileType.OUTPUT, FileType.INPUT, FileType.STATUS)}

_Place = tuple[LogicalAddress, int]
"""An address and the bytes of data from there on."""


def logical_target(address: LogicalAddress, size: int, partner: Partner) -> Target:
    """Return the target of ``size`` bytes at an address."""
    code, file = address.type_code, address.file
    if code in _OTHER_FUNCTIONS:
        return Target.FUNCTION
    if file == 0 and code in list_codes(partner.processor):
        return Target.FILE_LIST
    kind = BY_CODE.get(code) or slc.BY_FLAT_CODE.get(code)
    if kind is None or file > ADDRESSING.last_file:
        return Target.OTHER
    if kind.is_function:
        return Target.FUNCTION
    if _FIXED.get(file, kind) is not kind or kind in _FIXED.values() and file not in _FIXED:
        return Target.OTHER
    if kind is not FileType.STATUS:
        return Target.DATA
    first = address.element + (address.sub_element or 0)
    return in_status_file(first, (size + 1) // 2, [CLOCK])


def _read(is_short: bool, reader: Reader) -> _Place:
    request = slc.LogicalRead.read(reader, is_short)
    return request.address, request.size


def _write(is_short: bool, reader: Reader) -> _Place:
    request = slc.LogicalWrite.read(reader, is_short)
    return request.address, len(request.data)


def _masked_write(reader: Reader) -> _Place:
    request = slc.MaskedWrite.read(reader)
    return request.address, len(request.data)


_READABLE = (Target.DATA, Target.CLOCK, Target.STATUS, Target.FUNCTION, Target.FILE_LIST,
             Target.OTHER)


def _reach(place: Callable[[Reader], _Place]) -> Reach:
    return Reach('SLC, MicroLogix', _READABLE, lambda reader, partner: (
        logical_target(*place(reader), partner),))


SHORT_READ, LOGICAL_READ = (_reach(partial(_read, is_short)) for is_short in (True, False))
SHORT_WRITE, LOGICAL_WRITE = (_reach(partial(_write, is_short)) for is_short in (True, False))
MASKED_WRITE = _reach(_masked_write)
