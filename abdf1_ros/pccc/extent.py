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

"""Where words lie, and whether two places have words in common."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.address import Area

OUR_TABLE = -1
"""The station of the words of our own table, whatever number a PLC has."""


@dataclass(frozen=True, slots=True)
class Extent:
    """
    The words from ``first`` up to, not including, ``end`` of an area of a station.

    If the station is the broadcast address, the words are in every station, not in our own table.
    """

    station: int
    area: Area
    first: int
    end: int

    def meets(self, other: Extent) -> bool:
        """Tell whether both have a word in common."""
        return self.first < other.end and other.first < self.end and self.area == other.area \
            and self.may_be_in(other.station)

    def may_be_in(self, station: int) -> bool:
        """Tell whether the words may be in a station, or for the broadcast address in any."""
        stations = self.station, station
        return self.station == station or BROADCAST in stations and OUR_TABLE not in stations

    def holds(self, other: Extent) -> bool:
        """Tell whether all words of ``other`` are in this one."""
        return self.first <= other.first and other.end <= self.end \
            and self.station == other.station and self.area == other.area
