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
from functools import cached_property

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.settings.mapping import Mapping


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
