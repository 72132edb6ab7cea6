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

"""The rows of a map, in the groups that the rest of the package asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.problems import Problem
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.names import sanitise
from abdf1_ros.text import shown


def _group(belongs: Callable[[Mapping], object]) -> cached_property[Rows]:
    """Return a group of a map: the rows that belong to it."""
    return cached_property(lambda rows: Rows(filter(belongs, rows)))


class Rows(tuple[Mapping, ...]):
    """The rows of a map in their order; each group is in this order, too."""

    served = _group(lambda row: row.serves)
    """The rows of our own data table."""

    of_plcs = _group(lambda row: not row.serves)
    """The rows of the PLCs."""

    published = _group(lambda row: row.reads)
    """The rows whose values are published."""

    on_demand = _group(lambda row: row.is_on_demand)
    """The rows that are read only when a call asks for them."""

    messages = _group(lambda row: row.writes)
    """The rows that take messages."""

    written = _group(lambda row: row.changes and not row.serves)
    """The rows that we write to a PLC, for messages or by ourselves."""

    own = _group(lambda row: row.is_own)
    """The rows that we write to a PLC by ourselves."""

    heartbeats = _group(lambda row: row.is_heartbeat)
    """The Heartbeat rows."""

    fallbacks = _group(lambda row: row.fallback)
    """The rows with a Fallback."""

    guarded = _group(lambda row: row.is_guarded)
    """The rows whose values are published only while a condition holds."""

    @cached_property
    def repeated(self) -> Rows:
        """Return the rows that are not read on demand."""
        return self.without(self.on_demand) if self.on_demand else self

    @cached_property
    def stations(self) -> tuple[int, ...]:
        """Return the stations of all PLCs, each once."""
        return tuple(dict.fromkeys(row.station for row in self.of_plcs
                                   if row.station != BROADCAST))

    @cached_property
    def asked(self) -> frozenset[int]:
        """Return the stations that we send to, gateways included."""
        return frozenset(self.stations) | {
            row.via for row in self.of_plcs if row.via is not None}

    def without(self, others: Iterable[Mapping]) -> Rows:
        """Return the rows that are not among ``others``."""
        left_out = {*others}
        return Rows(row for row in self if row not in left_out)

    def with_bit_names(self) -> Rows:
        """
        Return these rows with the names of bits as they are shown.

        A bit that is a row of its own is named by the tag of that row. If the column Bits, or the
        Bits of two rows, give one bit another name, the row has a remark.
        """
        if not any(row.bits for row in self):
            return self
        named = {_bit(row, 0): (row.tag, row) for row in self
                 if row.type is ValueType.BOOL and row.length == 1}
        return Rows(_named(row, named) if row.bits else row for row in self)


_Bit = tuple[int, str]


def _bit(row: Mapping, number: int) -> _Bit:
    return row.extent.station, str(row.place_of(number))


def _named(row: Mapping, known: dict[_Bit, tuple[str, Mapping]]) -> Mapping:
    """Return a row with the names of its bits; ``known`` has the names so far, with their rows."""
    bits, remarks = [], []
    for number, name in enumerate(row.bits):
        other, owner = known.get(_bit(row, number), ('', row))
        if name and other and sanitise(name).lower() != sanitise(other).lower():
            whose = ', the Tag of its own row, which is shown' if owner.length == 1 else \
                f' in the row {shown(owner.tag)}'
            remarks.append(Problem(replace(row.place, column='Bits'), (
                f'{row.place_of(number)} has two names: "{shown(name)}", and "{shown(other)}"'
                f'{whose}')))
        bits.append(other if other and owner.length == 1 else name)
        if name:
            known.setdefault(_bit(row, number), (name, row))
    return replace(row, bits=tuple(bits), remarks=(*row.remarks, *remarks))
