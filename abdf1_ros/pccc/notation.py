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

"""Commands in words: the part that all families share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
import struct
from typing import Any, TypeAlias

from abdf1_ros.pccc.address import Address, Addressing
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.targets import Reach, UNKNOWN
from abdf1_ros.text import counted, value_text

CommandCode = tuple[int, int | None]
"""CMD and FNC; None for a command without FNC."""

Fields: TypeAlias = Any
"""What the reader of a command returns; only the texts of the same command know its class."""


class Effect(Enum):
    """
    The effect of a command on the words of a PLC.

    ``KEEPS``: it does more than read, but changes no words: it sets the port, or uploads.
    """

    READS = 'reads'
    WRITES = 'writes data'
    KEEPS = 'changes no words'
    OTHER = ''

    @property
    def may_change_words(self) -> bool:
        """Tell whether words may have changed after a command with this effect."""
        return self in (Effect.WRITES, Effect.OTHER)


def hexadecimal(data: bytes) -> str:
    """Return bytes in hexadecimal, in the order of the line."""
    return data.hex(' ').upper()


@dataclass(frozen=True, slots=True)
class KnownCommand:
    """A command: its effect, reader and text, the text of its reply, and what it can address."""

    name: str
    effect: Effect = Effect.OTHER
    read: Callable[[Reader], Fields] = Reader.rest
    words: Callable[[Fields], str] = hexadecimal
    values: Callable[[Fields, bytes], str] = lambda request, data: hexadecimal(data)
    reach: Reach = UNKNOWN


def part_of(offset: int, size: int, total: int) -> str:
    """Return the place of a packet in its transaction, empty if the packet is the whole."""
    return '' if (offset, size) == (0, total) else f' (from {offset} of {total})'


def place_text(addressing: Addressing, kind: FileType, file: int, element: int, word: int) -> str:
    """Return an address; a word after the end of its element is shown as `` + n words``."""
    start = Address(addressing, kind, file, element)
    is_inside = kind.is_structure and word < start.layout.words
    extra = 0 if addressing.slot_of(start) is not None or is_inside else word
    return str(replace(start, word=word - extra)) + beyond(extra)


def beyond(words: int) -> str:
    """Return `` + n words`` for a place n words further on, an empty text for 0."""
    return f' + {counted(words, "word")}' if words else ''


def words_text(data: bytes) -> str:
    """Return words as hexadecimal numbers, their high byte first."""
    return _listed(data, 'H', '{:04X}'.format)


def integers_text(data: bytes) -> str:
    """Return words as signed numbers."""
    return _listed(data, 'h')


def floats_text(data: bytes) -> str:
    """Return pairs of words as float32."""
    return _listed(data, 'f', value_text)


def _listed(data: bytes, code: str, show: Callable[[float], str] = str) -> str:
    """Return values by a code of ``struct``, or bytes if they are not a whole number of values."""
    if len(data) % struct.calcsize(code):
        return hexadecimal(data)
    return ' '.join(show(value) for value, in struct.iter_unpack(f'<{code}', data))


# Types whose values are numbers; all others are shown as words.
NUMBERS: dict[FileType, Callable[[bytes], str]] = {
    FileType.INTEGER: integers_text, FileType.TIMER: integers_text,
    FileType.COUNTER: integers_text, FileType.CONTROL: integers_text,
    FileType.LONG: partial(_listed, code='i'), FileType.FLOAT: floats_text}
