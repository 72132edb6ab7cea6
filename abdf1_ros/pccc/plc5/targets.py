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
What the commands of a PLC-5 address; an SLC or MicroLogix may execute them, too.

Only level 1 = 0 is the data table (M 13-13). An address has the number of a file, not its type, so
the S file is known by its number. Symbols and all other areas may be anything.
"""

from __future__ import annotations

from collections.abc import Iterator

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.plc5.commands import ReadModifyWrite, SystemAddress, TypedRead, TypedWrite
from abdf1_ros.pccc.targets import in_status_file, Partner, Reach, Target

_KINDS = (Target.DATA, Target.CLOCK, Target.STATUS, Target.OTHER)
_FORM = 'PLC-5'


def file_target(address: SystemAddress, offset: int, words: int, partner: Partner) -> Target:
    """Return the target of ``words`` words from ``offset`` words after an address on."""
    if address.file > ADDRESSING.last_file:
        return Target.OTHER
    if address.file != FileType.STATUS.default_file:
        return Target.DATA
    first = address.element + (address.sub_element or 0) + offset
    return in_status_file(first, words, partner.clocks)


def _typed_read(reader: Reader, partner: Partner) -> Iterator[Target]:
    request = TypedRead.read(reader)
    yield file_target(request.address, request.offset, request.size, partner)


def _typed_write(reader: Reader, partner: Partner) -> Iterator[Target]:
    request = TypedWrite.read(reader)
    yield file_target(request.address, request.offset, request.values.count, partner)


def _read_modify_write(reader: Reader, partner: Partner) -> Iterator[Target]:
    for entry in ReadModifyWrite.read(reader).sets:
        yield file_target(entry.address, 0, 1, partner)


def _read_modify_write_n(reader: Reader, partner: Partner) -> Iterator[Target]:
    """Read the number of sets, and the sets: address, length of a mask, both masks (M 7-21)."""
    for _ in range(reader.byte()):
        address, size = SystemAddress.read(reader), reader.byte()
        if size not in (2, 4):
            raise FormatError(f'masks of {size} bytes')
        reader.take(2 * size)
        yield file_target(address, 0, size // 2, partner)
    reader.end()


TYPED_READ = Reach(_FORM, _KINDS, _typed_read)
TYPED_WRITE = Reach(_FORM, _KINDS, _typed_write)
READ_MODIFY_WRITE = Reach(_FORM, _KINDS, _read_modify_write)
READ_MODIFY_WRITE_N = Reach(_FORM, _KINDS, _read_modify_write_n)
