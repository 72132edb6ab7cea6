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

"""What a line has shown of a station whose replies do not come, for all who tell it."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.odd import DAMAGED
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.messages import Message


@dataclass(frozen=True, slots=True)
class Evidence:
    """
    What a line has shown of a station; ``diagnosis`` finds the cause.

    - ``gateway``: the number of its gateway, None if the station is on the line itself.
    - ``has_own_ack``: an ACK shows that the station is there. Otherwise a gateway sends it, or the
      far end of a full-duplex line.
    - ``other_number``: the number to which its replies come in place of ours, None for ours.
    - ``fault``: what is wrong with its replies, None if none of them has come.
    - ``is_left_alone``: nothing asks it by itself any more.
    - ``is_only_acknowledged``: its commands have had an ACK that is not its own, and no reply.
    """

    station: int
    gateway: int | None
    has_own_ack: bool
    other_number: int | None
    fault: Message | None
    is_left_alone: bool
    is_only_acknowledged: bool


def evidence_of(mode: LineMode, stations: ActiveStationList, number: int) -> Evidence:
    """Return what the line has shown of a station."""
    station, via = stations.records[number], stations.via(number)
    gateway = None if via == number else via
    has_own_ack = mode.is_master and gateway is None
    fault = station.unanswered_by if station.unanswered_by in DAMAGED else None
    is_alone = station.is_left_alone
    is_unanswered = is_alone or fault is None and station.unanswered > 0 and not station.replies
    return Evidence(
        number, gateway, has_own_ack, stations.other_number(number), fault,
        is_alone, mode.waits_for_acks and not has_own_ack and is_unanswered)
