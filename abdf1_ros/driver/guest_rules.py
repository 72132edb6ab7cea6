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
What guests may do: the right that a command needs, by what it addresses at its station.

The list here is what less than All allows. A command that cannot be decided needs All.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from enum import Enum

from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.driver.foreign_words import written_words, WrittenWords
from abdf1_ros.driver.guest_limits import check_floats, check_values, limited
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.describe import effect_of, targets_of
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.targets import Partner, Target
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import first


class ShareAccess(Enum):
    """The rights of guests (column Share_Access), each with the rights before it."""

    READ = 'Read'
    WRITE = 'Write'
    ALL = 'All'

    def includes(self, needed: ShareAccess) -> bool:
        """Tell whether a guest with this right has the right that is ``needed``."""
        rights = list(ShareAccess)
        return rights.index(needed) <= rights.index(self)


# The list of what is allowed: an effect on a target, and the right that it needs.
_ALLOWED: dict[tuple[Effect, Target], ShareAccess] = {
    (Effect.READS, Target.DATA): ShareAccess.READ,
    (Effect.READS, Target.CLOCK): ShareAccess.READ,
    (Effect.READS, Target.STATUS): ShareAccess.READ,
    (Effect.READS, Target.FUNCTION): ShareAccess.READ,
    (Effect.READS, Target.FILE_LIST): ShareAccess.READ,
    (Effect.READS, Target.PORT): ShareAccess.READ,
    (Effect.WRITES, Target.DATA): ShareAccess.WRITE,
    (Effect.WRITES, Target.CLOCK): ShareAccess.WRITE}


def right_for(effect: Effect, target: Target) -> ShareAccess:
    """Return the right that a command with this effect needs for a target."""
    return _ALLOWED.get((effect, target), ShareAccess.ALL)


class GuestRules:
    """
    What guests may do at the stations of a map.

    ``processor_of`` returns the processor that a station reports, None if unknown. The methods
    may be called from any thread.
    """

    def __init__(self, network: Network, mappings: Rows,
                 processor_of: Callable[[int], Processor | None]) -> None:
        self._network = network
        self._mappings = mappings
        self._processor_of = processor_of

    def station_of(self, dst: int) -> int:
        """
        Return the station that a guest means.

        In Mode Peer with rows of one station this is the one PLC, whatever the DST. Only the map
        decides this: a guest's writes must not go elsewhere after a gateway has reported a fault.
        """
        stations = self._mappings.stations
        is_only = self._network.line_mode.has_one_plc and len(stations) == 1
        return stations[0] if is_only else dst

    def right_needed(self, command: Packet) -> ShareAccess:
        """Return the right that a command needs; a command to all stations needs All."""
        station = self.station_of(command.dst)
        if station == BROADCAST:
            return ShareAccess.ALL
        effect = effect_of(command)
        rights = [right_for(effect, target)
                  for target in targets_of(command, self._partner(station))]
        return max(rights, key=list(ShareAccess).index)

    def limit_broken(self, command: Packet, access: ShareAccess) -> str:
        """
        Return which limit the values of a command break, empty if none.

        A guest with All may write words that are not known.
        """
        if effect_of(command) is not Effect.WRITES:
            return ''
        station, has_all = self.station_of(command.dst), access is ShareAccess.ALL
        rows = limited(self._mappings, station)
        try:
            words = self._written(command, station) if rows else []
            if words is not None:
                check_values(rows, [each for each in words if each.is_certain or not has_all])
            elif not has_all:
                raise FormatError(f'{first([row.tag for row in rows])}: limits hold there, and '
                                  'the words of the command are unknown')
            check_floats(command)
        except FormatError as error:
            return str(error)
        return ''

    def words_of(self, command: Packet, station: int) -> list[Extent] | None:
        """Return the words of rows that a command to a station writes, None if unknown."""
        words = self._written(command, station)
        return None if words is None else [written.extent for written in words]

    def _written(self, command: Packet, station: int) -> list[WrittenWords] | None:
        # A PLC-5 has separate words for each station number that sends it PLC-2 writes. On the
        # line this number is ours.
        return written_words(command._replace(src=self._network.station), station, self._mappings)

    def _partner(self, station: int) -> Partner:
        rows = [row for row in self._mappings.of_plcs if row.station == station]
        families = frozenset(row.plc_type for row in rows)
        in_map = {row.processor for row in rows if row.processor is not None}
        return Partner(
            families, _clocks(families),
            self._processor_of(station) or (in_map.pop() if len(in_map) == 1 else None),
            self._network.station)


def _clocks(families: Collection[PlcType]) -> tuple[Address, ...]:
    """Return the clocks that PLCs of some families have; without a family of all."""
    return tuple(family.addressing.parse(family.clock) for family in FAMILIES.values()
                 if family.clock and (not families or family.plc_type in families))
