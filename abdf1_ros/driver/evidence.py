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
from abdf1_ros.df1.stations import ActiveStationList, MOST_IN_VAIN
from abdf1_ros.errors import NoWholeReply
from abdf1_ros.messages import Message


@dataclass(frozen=True, slots=True)
class Evidence:
    """
    What a line has shown of a station; as text: the cause and the cure, empty for none.

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

    def __str__(self) -> str:
        """Return the cause and the cure."""
        other = self.other_number
        if other is not None and self.gateway is None:
            return (f'replies come to number {other}, not to ours: a gateway such as the 1770-KF2 '
                    f'and KF3 replies to its own number. Make it our Station: {other} in net.csv, '
                    f'or --own-station {other} of "plc"')
        if self.fault is not None:
            return (f'station {self.station} replies, but {NoWholeReply(cause=self.fault)}: does '
                    'something on the way change bytes (flow control, a telnet port)?')
        if not self.is_only_acknowledged:
            return ''
        if self.gateway is not None:
            return (f'gateway {self.gateway} acknowledges commands to station {self.station}, and '
                    f'no reply comes: is the number right? "plc scan 0-63 --via {self.gateway}" '
                    'shows which stations reply')
        if self.is_left_alone:
            return (f'station {self.station} is not asked any more: {MOST_IN_VAIN} commands in a '
                    'row were acknowledged and had no reply. Each may cost an SLC with passthru '
                    'one of 30 buffers until it is switched off. A write, ~/read_now or a new '
                    'start of the node asks again; is the number right?')
        return (f'commands to station {self.station} are acknowledged, and no reply comes: is the '
                'number right? An SLC with passthru, or a gateway, acknowledges commands for all '
                'stations; "plc scan 0-63" shows which stations reply')


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
