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

from collections.abc import Iterable
from functools import cached_property

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.settings.mapping import Mapping


class Rows(tuple[Mapping, ...]):
    """The rows of a map in their order; each group is in this order, too."""

    @cached_property
    def served(self) -> Rows:
        """Return the rows of our own data table."""
        return Rows(row for row in self if row.serves)

    @cached_property
    def of_plcs(self) -> Rows:
        """Return the rows of the PLCs."""
        return Rows(row for row in self if not row.serves)

    @cached_property
    def stations(self) -> tuple[int, ...]:
        """Return the stations of all PLCs, each once."""
        return tuple(dict.fromkeys(row.station for row in self.of_plcs
                                   if row.station != BROADCAST))

    @cached_property
    def published(self) -> Rows:
        """Return the rows whose values are published."""
        return Rows(row for row in self if row.reads)

    @cached_property
    def on_demand(self) -> Rows:
        """Return the rows that are read only when a call asks for them."""
        return Rows(row for row in self if row.is_on_demand)

    @cached_property
    def repeated(self) -> Rows:
        """Return the rows that are not read on demand."""
        return self.without(self.on_demand) if self.on_demand else self

    @cached_property
    def messages(self) -> Rows:
        """Return the rows that take messages."""
        return Rows(row for row in self if row.writes)

    @cached_property
    def written(self) -> Rows:
        """Return the rows that we write to a PLC, for messages or by ourselves."""
        return Rows(row for row in self.of_plcs if row.changes)

    @cached_property
    def own(self) -> Rows:
        """Return the rows that we write to a PLC by ourselves."""
        return Rows(row for row in self if row.is_own)

    @cached_property
    def heartbeats(self) -> Rows:
        """Return the Heartbeat rows."""
        return Rows(row for row in self if row.is_heartbeat)

    @cached_property
    def fallbacks(self) -> Rows:
        """Return the rows with a Fallback."""
        return Rows(row for row in self if row.fallback)

    @cached_property
    def guarded(self) -> Rows:
        """Return the rows whose values are published only while a condition holds."""
        return Rows(row for row in self if row.is_guarded)

    def without(self, others: Iterable[Mapping]) -> Rows:
        """Return the rows that are not among ``others``."""
        left_out = {*others}
        return Rows(row for row in self if row not in left_out)
