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

"""The Active Station List: the state of each station on the line (S0)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
import math

from abdf1_ros.df1.odd import OddCommands
from abdf1_ros.df1.packet import DIAGNOSTIC_REPLY, is_local_status, Packet
from abdf1_ros.df1.probes import Asker, Probes
from abdf1_ros.messages import Message

MAX_STATION = 254

# Number of commands in a row without a reply in time after which a station is treated as silent.
MOST_OVERDUE = 2

# Number of commands in a row that were acknowledged without a reply after which nothing asks a
# station by itself. Each may cost an SLC with passthru one of its 30 buffers until it is switched
# off (1747-RM001G 14-5), so no slower rate would do.
MOST_IN_VAIN = 5

# Number of times that a station may become active again without a reply to a command. After that,
# a return does not end its outage.
_MOST_RETURNS = 2


@dataclass(slots=True)
class Station:
    """
    One station: its place in the list and the last transaction received from it.

    - ``last_heard``: clock value (s) of the last answer of any kind, None before the first.
    - ``last_key``: DST and duplicate key of the last message accepted. DST is part of it because
      replies to two nodes that we pass on may have the same TNS.
    - ``last_refused``: link data of the last message that was refused because of its addresses.
    - ``overdue``: number of commands in a row that were delivered, not answered within
      Cmd_Timeout, and kept other commands waiting.
    - ``unanswered``: the same number, but it also counts commands that kept no others waiting.
    - ``in_vain``: number of commands in a row, guests' ones included, that a full-duplex far end
      has acknowledged without a reply of the station.
    - ``local_status``: STS of the last reply if a gateway sent it for the station; 0 if the
      station replied itself.
    - ``has_gateway``: it is or was behind a gateway, which may hold commands; False if unknown.
    - ``replies_to_us``: it has replied to our number, and no gateway did so for it.
    - ``returns``: how often the station has become active again since its last reply to a command.
    - ``unanswered_by``: what was wrong with its answer to the last command without a reply.
    """

    number: int
    active: bool = True
    last_heard: float | None = None
    last_key: tuple[int, int, int, int] | None = None
    last_refused: bytes | None = None
    last_tns: int | None = None
    replies: int = 0
    failures: int = 0
    remote_errors: int = 0
    silent_since: float | None = None
    overdue: int = 0
    unanswered: int = 0
    in_vain: int = 0
    local_status: int = 0
    has_gateway: bool = False
    replies_to_us: bool = False
    returns: int = 0
    unanswered_by: Message | None = None

    @property
    def replies_in_time(self) -> bool:
        """Tell whether this station is likely to reply to a command in time."""
        return self.active and self.overdue < MOST_OVERDUE

    @property
    def has_no_replies(self) -> bool:
        """Tell whether the last commands to it have had no reply in time."""
        return self.unanswered >= MOST_OVERDUE

    @property
    def is_left_alone(self) -> bool:
        """Tell whether only writes and calls ask this station, which may be behind an SLC."""
        return self.in_vain >= MOST_IN_VAIN and (self.has_gateway or not self.replies)

    @property
    def takes_no_commands(self) -> bool:
        """Tell whether the station becomes active repeatedly, but never replies to a command."""
        return self.returns >= _MOST_RETURNS

    def note_new(self, packet: Packet) -> bool:
        """Remember ``packet``; return False when it repeats the last message (M 3-7, 3-15)."""
        key = packet.dst, packet.src, packet.cmd, packet.tns  # with ``duplicate_key``
        if key == self.last_key:
            return False
        self.last_key = key
        return True

    def forget_last(self) -> None:
        """Treat the next message as new, whatever its numbers."""
        self.last_key = self.last_refused = None

    def repeats(self, packet: Packet) -> bool:
        """Tell whether ``packet`` is a repetition of the last message."""
        return (packet.dst, *packet.duplicate_key) == self.last_key


class _Records(dict[int, Station]):
    """The records of stations; a record is made when it is first used."""

    def __missing__(self, number: int) -> Station:
        """Return a new record."""
        return self.setdefault(number, Station(number))


class ActiveStationList:
    """
    All stations to which we send commands.

    Every station counts as active at start (S0). ``on_change`` is called with a station of the
    list whenever it becomes active or inactive. A station that is not in the list also gets a
    record if a slave sends it a message. A message never adds a station to the list.

    ``records`` has the record of every station by number, whether it is in the list or not.
    ``routes`` gives the gateway to a station, by number: the gateway is polled in place of the
    station (M 3-7). While the gateway is inactive, all its stations are inactive. ``probes``
    decides when silent stations may be asked, ``odd`` when commands that fail while their station
    replies to others. A probe takes ``probe_time`` seconds; if no station
    answers, ``rest`` seconds pass between two probes. ``took`` returns for how much of the time
    between two clock values (s) this process has run. ``on_gateway`` is called with the number of
    a station when a gateway has first replied for it.
    """

    def __init__(self, numbers: Iterable[int] = (),
                 on_change: Callable[[Station], None] = lambda station: None,
                 routes: Mapping[int, int] | None = None, probe_time: float = 0.0,
                 took: Callable[[float, float], float] = lambda begun, now: now - begun,
                 rest: float = 0.0,
                 on_gateway: Callable[[int], None] = lambda number: None) -> None:
        self._polled: set[int] = set()
        self.probes = Probes(probe_time, rest)
        self.odd = OddCommands(lambda number: self.records[number].replies)
        self._took = took
        self.records = _Records()
        self._stations: dict[int, Station] = {}
        # By gateway: DST of the last reply that came neither to our number nor to the gateway's.
        self._others: dict[int | None, int] = {}
        self._on_change, self._on_gateway = on_change, on_gateway
        self.routes = {station: gateway for station, gateway in (routes or {}).items()
                       if station != gateway}
        numbers = frozenset(numbers)
        self._only_gateways = frozenset(self.routes.values()) - numbers
        self.add((*numbers, *self._only_gateways))

    def add(self, numbers: Iterable[int], *, are_polled: bool = False) -> None:
        """
        Add stations to the list.

        If the link polls them all the time, they need no probes.
        """
        numbers = list(numbers)
        self._polled.update(numbers if are_polled else ())
        for number in numbers:
            self._stations[number] = self.records[number]
        self._stations = dict(sorted(self._stations.items()))

    def __iter__(self) -> Iterator[Station]:
        return iter(self._stations.values())

    def __contains__(self, number: object) -> bool:
        return number in self._stations

    def __getitem__(self, number: int) -> Station:
        """Return the record of a station (0-254), whether it is in the list or not."""
        return self.records[number]

    @property
    def all_reply_in_time(self) -> bool:
        """Tell whether no station is silent."""
        return all(station.replies_in_time for station in self.records.values())

    def via(self, number: int) -> int:
        """Return the station of this line that is polled for a station: its gateway, or itself."""
        return self.routes.get(number, number)

    def behind(self, number: int) -> list[int]:
        """Return a station of this line, and the stations to which it is the gateway."""
        return [number, *(station for station, via in self.routes.items() if via == number)]

    def heard(self, number: int, now: float) -> None:
        """Record any answer: the station is active; if its gateway was not, all behind it are."""
        station = self.records[number]
        station.last_heard, station.in_vain = now, 0
        if station.active:
            return
        gateway = self.via(number)
        # The gateway answered all the time, so only this station was silent.
        back = [number] if self.records[gateway].active else self.behind(gateway)
        for station in map(self.__getitem__, back):
            if not station.active:
                station.active, station.silent_since = True, None
                station.returns += 1
                self._tell(station)

    def answers(self, reply: Packet, command: Packet, gateway: int | None) -> bool:
        """
        Tell whether a message is the reply to a ``command`` that may have passed a ``gateway``.

        A gateway may put its own number in place of ours into a command. Then the reply comes to
        that number (M 6-4). Usually this is the number of the gateway on our line. None stands for
        the far end of a full-duplex line, which has no such number. We accept another number if
        two replies in a row have it. The exceptions are a number in our list, and any number if
        the station has replied to ours. The gateway itself may reply to ours at any time.
        """
        station = self.records[command.dst]
        if reply.answers(command):
            station.replies_to_us |= not (
                reply.cmd == DIAGNOSTIC_REPLY or is_local_status(reply.sts))
            return True
        if not reply._replace(dst=command.src).answers(command):
            return False
        if station.replies_to_us or reply.dst == gateway:
            return reply.dst == gateway
        self.gateway_replied(reply.src)
        is_known = reply.dst == self._others.get(gateway)
        self._others[gateway] = reply.dst
        return is_known and reply.dst not in self

    def other_number(self, number: int) -> int | None:
        """Return to which number the replies of a station come if not to ours, otherwise None."""
        is_other = not self.records[number].replies_to_us
        return self._others.get(self.routes.get(number)) if is_other else None

    def gateway_replied(self, number: int) -> None:
        """Record that a gateway has replied for a station."""
        station = self.records[number]
        was_known, station.has_gateway = station.has_gateway, True
        if not was_known:
            self._on_gateway(number)

    def lost(self, number: int, now: float) -> None:
        """Make a station inactive; if it is a gateway, also all stations behind it."""
        for station in map(self.__getitem__, self.behind(number)):
            if station.active:
                station.active, station.silent_since = False, now
                self._tell(station)

    def is_polled(self, number: int) -> bool:
        """Tell whether the link polls a station all the time, so that its return is seen."""
        gateway = self.via(number)
        return gateway in self._polled and (gateway == number or not self.records[gateway].active)

    def may_be_asked(self, number: int) -> bool:
        """Tell whether a read may ask a silent station whether it answers again."""
        return not self.is_polled(number) and not self.records[number].is_left_alone

    def ask_again(self, number: int) -> None:
        """Let one more command ask a station that is left alone."""
        station = self.records[number]
        station.in_vain = min(station.in_vain, MOST_IN_VAIN - 1)

    def claim_message(self, number: int, now: float) -> bool:
        """Tell whether to send a message to a station; a silent station gets it as a due probe."""
        return self[number].replies_in_time or (
            not self.is_polled(number) and self.probes.claim_message(now))

    def next_own(self, number: int) -> float:
        """Return from when on (clock value, s) a 0 or a fallback may be written again."""
        return -math.inf if self[number].replies_in_time else self.probes.next_own

    def tried(self, number: int, begun: float, now: float, *, was_silent: bool,
              asker: Asker = Asker.IN_TURN) -> None:
        """
        Record that a station had the line from ``begun`` until now (clock values, s).

        If the station ``was_silent``, the time counts as time of probes.
        """
        if self[number].replies_in_time or self.is_polled(number) and asker is not Asker.OWN:
            return
        if not self._someone_waits:
            self.probes.keep_none_waiting(now, asker)
        elif was_silent:
            self.probes.spent(self._took(begun, now), now, asker)
        else:
            self.probes.died(self._took(begun, now), now)

    def polled_silent(self, begun: float, now: float) -> None:
        """Record that the link has asked a silent station from ``begun`` until now."""
        if self._someone_waits:
            self.probes.spent(self._took(begun, now), now)
        else:
            self.probes.keep_none_waiting(now)

    def is_new(self, number: int) -> bool:
        """
        Tell whether a station has never replied to a command, but another station has.

        The station may be absent. So it gets one try at a time, because the other stations would
        have to wait for all retries.
        """
        return not self.records[number].replies and any(station.replies for station in self)

    @property
    def _someone_waits(self) -> bool:
        return any(station.replies_in_time for station in self
                   if station.number not in self._only_gateways)

    def _tell(self, station: Station) -> None:
        if station.number in self._stations:
            self._on_change(station)

    def words(self) -> list[int]:
        """Return the Active Node Table: 16 words, bit n % 16 of word n // 16 = station n."""
        table = [0] * 16
        for station in self:
            table[station.number // 16] |= station.active << station.number % 16
        return table
