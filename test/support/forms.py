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

"""What a packet on the line writes: the row, the value, and the words of it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from abdf1_ros.pccc.steps import write_requests
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.mapping import Mapping

SAFE = 32_000  # the fallback of every row of words

MASKED_SLC = b'\xAB'  # function of a masked write


class Meant(NamedTuple):
    """What a packet of a row writes: a value, from word ``at`` of the row on."""

    tag: str
    value: int
    at: int = 0


class _Form(NamedTuple):
    """
    How a packet of a row begins.

    After it come words, all with one value; a ``value`` of bits is part of it.
    """

    begin: bytes
    tag: str
    at: int
    value: int | None = None


def value_of_bit(row: Mapping, bit: int) -> int:
    """Return what is told of a bit: of a row with Fallback it is 1, or the fallback."""
    return 1 if bit else SAFE if row.fallback else 0


class Forms:
    """
    All packets that write ``rows`` of PLCs, which have words, or one bit each.

    A PLC that has no masked write gets a bit by a write of its whole word, right after the masked
    write that it has refused.
    """

    def __init__(self, rows: Iterable[Mapping]) -> None:
        self._forms: dict[int, list[_Form]] = {}
        self._whole: dict[bytes, dict[str, Mapping]] = {}  # rows by the begin of a whole word
        self._masked: dict[int, str] = {}  # the row that the last masked write meant, by station
        for row in rows:
            forms = self._forms.setdefault(row.station, [])
            if row.type is ValueType.BOOL:
                forms += self._of_bit(row)
            else:
                forms += _of_words(row)

    def _of_bit(self, row: Mapping) -> Iterable[_Form]:
        if row.may_rewrite:
            begin = row.dialect.write(row.address, b'\0\0')[1][:-2]
            self._whole.setdefault(begin, {})[row.tag] = row
        for bit in (0, 1):
            (_, data), = write_requests(row.address, row.codec, [bit], row.dialect)
            yield _Form(data, row.tag, 0, value_of_bit(row, bit))

    def packets(self, row: Mapping) -> int:
        """Return in how many packets a row is written."""
        return len({form.at for form in self._forms[row.station] if form.tag == row.tag})

    def meant(self, station: int, data: bytes) -> Meant | None:
        """Return what the data of a command write, None if it writes no row as we do."""
        for begin, tag, at, value in self._forms.get(station, ()):
            if data.startswith(begin):
                if value is None:
                    word = data[len(begin):][:2]
                    return Meant(tag, int.from_bytes(word, 'little'), at)
                self._masked[station] = tag
                return Meant(tag, value, at)
        for begin, rows in self._whole.items():
            row = rows.get(self._masked.get(station, ''))
            if row is not None and data.startswith(begin):
                whole = int.from_bytes(data[len(begin):][:2], 'little')
                return Meant(row.tag, value_of_bit(row, whole >> (row.address.bit or 0) & 1))
        return None


def _of_words(row: Mapping) -> Iterable[_Form]:
    zeros, others = (write_requests(row.address, row.codec, row.length * [value], row.dialect)
                     for value in (0, 0x0101))
    at = 0
    for (_, zero), (_, other) in zip(zeros, others, strict=True):
        values = sum(one != another for one, another in zip(zero, other, strict=True))  # bytes
        yield _Form(zero[:-values], row.tag, at)
        at += values // 2
