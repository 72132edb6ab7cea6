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
Values from the traffic of another master, on a line where we send nothing.

A reply counts only if its command was heard at most Cmd_Timeout before it. Both and the bytes in
between have to be undamaged. The reply fills each row of which it has all words. If another node
writes words of a row, these words are unknown until the reply to a later read.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
import math
from operator import attrgetter
from typing import NamedTuple

from abdf1_ros.df1.frames import Damaged
from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.df1.packet import BROADCAST, is_local_status, Packet
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.checks import Checks
from abdf1_ros.driver.foreign_words import ReplyWords, words_in_reply, written_extents
from abdf1_ros.driver.job_tasks import JobTasks
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.describe import describe, effect_of
from abdf1_ros.pccc.families import decode_identity
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.traffic import TrafficDecoder

# Seconds without a reply or an EOT of a station after which it counts as silent.
SILENT_AFTER = 10.0

# Least number of bytes outside of frames that are treated as a damaged frame; fewer come when a
# transmitter is switched on.
_REST_OF_FRAME = 3

_MOST_CARRIED = 200  # greatest number of different reads that are kept

_STATUS = bytes((diagnostics.STATUS,))


@dataclass(slots=True)
class Carried:
    """
    A read of another node, in words, and its last ``command``.

    ``count`` tells how often it was answered, from ``first`` to ``last`` (clock values, s).
    """

    station: int
    text: str
    command: Packet
    first: float
    last: float = -math.inf
    count: int = 0


class _Path(NamedTuple):
    """Sender, station and transaction number of a command."""

    src: int
    dst: int
    tns: int


class Overheard:
    """
    Fill the points of ``readings`` from heard replies.

    ``carried`` are the reads of other nodes on the line, by station and text. Only the thread of
    the link changes anything; any thread may read.
    """

    def __init__(self, network: Network, mappings: Rows, readings: Readings,
                 stations: ActiveStationList, checks: Checks, tasks: JobTasks) -> None:
        self.carried: dict[tuple[int, str], Carried] = {}
        self._network = network
        self._readings = readings
        self._stations = stations
        self._checks = checks
        self._tasks = tasks
        self._rows = _by_type(mappings)
        self._mappings = mappings
        self._begun = math.inf
        self._parts: dict[ReadPoint, str] = {}
        self._unread: set[ReadPoint] = set()  # since the port was opened
        self._told: set[ReadPoint] = set()
        # A reply counts only if its read began after these moments (clock values, s): the last
        # damage, and for each point the last write of its words.
        self._damaged = -math.inf
        self._written_at: dict[ReadPoint, float] = {}
        self._last: dict[_Path, Packet] = {}
        self.ambiguous: set[_Path] = set()
        self._traffic = TrafficDecoder(network.checksum)

    def begin(self, now: float) -> None:
        """Begin on an opened port: earlier bytes are not continued."""
        self._begun = now
        self._unread, self._told = {*self._readings.points.values()}, set()
        self.forget(now)

    def forget(self, now: float) -> None:
        """Begin anew: bytes are missing."""
        self._traffic = TrafficDecoder(self._network.checksum)
        self._damaged = now

    def hear(self, data: bytes, now: float) -> None:
        """Take bytes, read at a clock value (s)."""
        if isinstance(data, Damaged):
            self.forget(now)
            return
        direction = Direction.UNKNOWN if not self._network.listen_port else (
            Direction.IN if isinstance(data, SecondPort) else Direction.OUT)
        for entry in self._traffic.feed(Chunk(now, direction, data)):
            self._take(entry, now)

    def look(self, now: float) -> None:
        """Find stations that are not heard any more, and rows that no node reads."""
        for station in self._stations:
            heard = self._begun if station.last_heard is None else station.last_heard
            if station.active and now - max(heard, self._begun) > SILENT_AFTER:
                self._stations.lost(station.number, now)
        for point in self._unread - self._told:
            if now - self._begun > max(SILENT_AFTER, point.stale_time):
                self._told.add(point)
                self._readings.unreadable(point, self.why_unread(point))

    def why_unread(self, point: ReadPoint) -> str:
        """Return why a row has no value although the line is heard."""
        if point not in self._unread and (reason := point.withheld or point.error):
            return reason
        part = self._parts.get(point)
        return 'no other node reads it' if part is None else (
            f'no reply has all of its words; "{part}" has a part of them')

    def _take(self, entry: Entry, now: float) -> None:
        is_rest = entry.kind is Kind.NOISE and entry.size >= _REST_OF_FRAME
        if is_rest or entry.valid is False or entry.kind in (Kind.DAMAGED, Kind.UNKNOWN):
            self._damaged = now
        elif entry.kind is Kind.EOT and entry.station is not None \
                and entry.station in self._stations:
            self._stations.heard(entry.station, now)  # it answers polls
        elif entry.packet is not None and entry.kind is Kind.COMMAND:
            self._command(entry.packet, now)
        elif entry.packet is not None and entry.kind is Kind.REPLY:
            self._reply(entry, entry.packet, now)

    def _command(self, command: Packet, now: float) -> None:
        """Record the words that a command changes, and whether its number is unique."""
        path = _Path(command.src, command.dst, command.tns)
        before = self._last.pop(path, command)
        self._last[path] = command
        if len(self._last) > _MOST_CARRIED:
            self.ambiguous.discard(oldest := next(iter(self._last)))
            del self._last[oldest]
        # On two ports a reply may be read after the command that follows it.
        if self._network.listen_port and before != command:
            self.ambiguous.add(path)
        self._written(command, now)

    def _reply(self, entry: Entry, reply: Packet, now: float) -> None:
        command = entry.request
        if command is None or not command.is_sound:
            return
        self._written(command, now)
        if entry.latency is None:
            return  # reported before
        if not is_local_status(reply.sts):
            self._heard(command.dst, now)
        asked = now - entry.latency
        path = _Path(command.src, command.dst, command.tns)
        if asked <= self._damaged or entry.latency > self._network.cmd_timeout / 1000 \
                or path in self.ambiguous or reply.sts:
            return
        if command.cmd == diagnostics.CMD and command.data == _STATUS:
            self._identity(command.dst, reply, asked)
        elif effect_of(command) is Effect.READS:
            self._values(command, reply, asked, now)

    def _heard(self, station: int, now: float) -> None:
        """Record a reply of a station."""
        if station in self._stations:
            self._stations.heard(station, now)
            self._stations[station].replies += 1
        self._tasks.transactions += 1

    def _identity(self, station: int, reply: Packet, asked: float) -> None:
        try:
            identity = decode_identity(reply.data)
        except FormatError:
            return
        if station in self._stations:
            self._checks.heard(station, identity, asked)

    def _values(self, command: Packet, reply: Packet, asked: float, now: float) -> None:
        """Fill each row of which a reply has all words."""
        text = describe(command)
        self._carry(command, text, now)
        found: dict[ReadPoint, bytes] = {}
        for rows in self._rows.get(command.dst, ()):
            words = words_in_reply(command, reply, rows)
            for mapping in rows if words else ():
                point = self._readings.points[mapping]
                here = _words_of(mapping, words)
                if len(here) == mapping.codec.words:
                    if asked > self._written_at.get(point, -math.inf):
                        found[point] = b''.join(here)
                elif here:
                    self._parts[point] = text
        self._unread.difference_update(found)
        self._readings.heard(found, asked)

    def _carry(self, command: Packet, text: str, now: float) -> None:
        known = self.carried.get((command.dst, text))
        if known is None:  # a new object each time: another thread may be reading the old one
            kept = sorted(self.carried.values(), key=attrgetter('last'))[1 - _MOST_CARRIED:]
            known = Carried(command.dst, text, command, now)
            self.carried = {(each.station, each.text): each for each in (*kept, known)}
        known.count, known.last = known.count + 1, now

    def _written(self, command: Packet, now: float) -> None:
        """Record that a command, or its execution, may have changed words of rows."""
        effect = effect_of(command)
        if not effect.may_change_words:
            return
        extents = written_extents(command, command.dst, self._mappings) \
            if effect is Effect.WRITES else None
        what = describe(command).partition(' = ')[0]
        for mapping, point in self._readings.points.items():
            is_there = command.dst in (mapping.station, BROADCAST)
            if is_there and (extents is None
                             or any(extent.meets(mapping.extent) for extent in extents)):
                self._written_at[point] = now
                point.fail(f'not read since station {command.src} has sent "{what}"')


def _words_of(mapping: Mapping, words: ReplyWords) -> list[bytes]:
    """Return those words of a row that are in ``words``, in their order."""
    extent = mapping.extent
    return [word for offset in range(extent.first, extent.end)
            if (word := words.get((extent.area, offset))) is not None]


def _by_type(mappings: Rows) -> dict[int, list[list[Mapping]]]:
    """Return the rows of each station, grouped by PLC type."""
    found: defaultdict[int, defaultdict[PlcType, list[Mapping]]] = defaultdict(
        lambda: defaultdict(list))
    for mapping in mappings:
        found[mapping.station][mapping.plc_type].append(mapping)
    return {station: [*types.values()] for station, types in found.items()}
