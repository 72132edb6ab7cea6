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
What word range commands address: a place of a PLC-5 or of a PLC-3.

Equal bytes may be an address of both families. Where the rows do not tell the family, both count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from functools import partial
from typing import Any

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import AddressRefusal
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc3.address import SECTIONS
from abdf1_ros.pccc.plc3.commands import DATA_TABLE, read_levels
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.plc5.targets import file_target
from abdf1_ros.pccc.status import EXT_TOO_FEW_LEVELS, EXT_TOO_MANY_LEVELS
from abdf1_ros.pccc.targets import Partner, Reach, Target
from abdf1_ros.pccc.word_range.commands import WordBitWrite, WordRangeRead, WordRangeWrite

# The data table of a PLC-3 (1779-KFM B-5); other contexts and sections do not exist. Of sections
# 6, 10 and 12 (floats, high-order integers, pointers) the words are not described.
_CONTEXTS = range(1, 16)
_SECTIONS = {*SECTIONS.values(), 6, 10, 12}

# A PLC of the family refuses such an address, whatever the rest of the command is.
_IN_NO_FORM = (EXT_TOO_FEW_LEVELS, EXT_TOO_MANY_LEVELS)

_TEXT = b'\0$'  # begins an address of a PLC-5 in ASCII

_ReadAddress = Callable[[Reader], Any]
_Stretch = tuple[Any, int, int]
"""An address, the offset of the first word after it, and the number of words."""


def _read(reader: Reader, read_address: _ReadAddress) -> _Stretch:
    request = WordRangeRead.read(reader, read_address)
    return request.address, request.offset, (request.size + 1) // 2


def _write(reader: Reader, read_address: _ReadAddress) -> _Stretch:
    request = WordRangeWrite.read(reader, read_address)
    return request.address, request.offset, (len(request.data) + 1) // 2


def _bit_write(reader: Reader, read_address: _ReadAddress) -> _Stretch:
    return WordBitWrite.read(reader, read_address).address, 0, 1


def _size(reader: Reader, read_address: _ReadAddress) -> _Stretch:
    address = read_address(reader)
    reader.end()
    return address, 0, 0


def _plc3_levels(reader: Reader) -> list[int]:
    if copy(reader).take(len(_TEXT)) == _TEXT:
        raise FormatError('an address of a PLC-5 in ASCII')
    area, context, section, *rest = levels = read_levels(reader)
    if area == DATA_TABLE and (context not in _CONTEXTS or section not in _SECTIONS):
        raise FormatError('there is no such section')
    return levels


def _level_target(levels: list[int], offset: int, words: int, partner: Partner) -> Target:
    area, _, section, *_ = levels
    if area != DATA_TABLE:
        return Target.OTHER
    return Target.STATUS if section == SECTIONS[FileType.STATUS] else Target.DATA


def _targets(parameters: Callable[[Reader, _ReadAddress], _Stretch], reader: Reader,
             partner: Partner) -> Iterator[Target]:
    """Yield the target in each form that the address can have."""
    forms: list[tuple[_ReadAddress, Callable[..., Target]]] = []
    if partner.families != {PlcType.PLC3}:
        forms.append((SystemAddress.read, file_target))
    if partner.may_be(PlcType.PLC3):
        forms.append((_plc3_levels, _level_target))
    for read_address, target in forms:
        try:
            yield target(*parameters(copy(reader), read_address), partner)
        except AddressRefusal as error:
            if error.ext_sts not in _IN_NO_FORM:
                yield Target.OTHER
        except FormatError:
            continue


def _reach(parameters: Callable[[Reader, _ReadAddress], _Stretch]) -> Reach:
    return Reach('PLC-5, PLC-3', (Target.DATA, Target.CLOCK, Target.STATUS, Target.OTHER),
                 partial(_targets, parameters))


READ, WRITE, BIT_WRITE, SIZE = map(_reach, (_read, _write, _bit_write, _size))
