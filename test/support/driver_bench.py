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

"""A driver and simulated PLCs on a virtual line; a driver that only listens."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
import heapq
from itertools import count
from typing import Any

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.radio import RadioNode
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import multidrop, Responder
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.driver.driver import Driver, Listener
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.errors import PortLost
from abdf1_ros.messages import Event, Message
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import Codec, types_of, Values, ValueType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from abdf1_ros.sniffer.capture import Chunk, Direction
from support.virtual_line import VirtualLine

READ_N7 = bytes.fromhex('A2 02 07 89 00 00')

_WHOLE_FRAMES = 1000
READ_AGAIN = 'the files have been read again'

Kept = str | list[float]


class Recorder:
    """A listener that keeps everything, with the time it came."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.reads: list[tuple[float, Mapping, Kept]] = []
        self.results: list[WriteResult] = []
        self.reasons: list[tuple[str, str]] = []
        self.ends: list[tuple[str, float]] = []
        self.foreign: list[tuple[float, str, bool]] = []
        self.events: list[Event] = []
        self.changes: list[tuple[int, bool]] = []

    def read(self, mapping: Mapping, values: Values) -> None:
        """Keep a value."""
        kept = values if isinstance(values, str) else list(values)
        self.reads.append((self._clock(), mapping, kept))

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Keep why a mapping has no value."""
        self.reasons.append((str(mapping.address), reason))

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Keep when a withholding ended."""
        self.ends.append((mapping.tag, seconds))

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Keep that somebody else has written a heartbeat."""
        self.foreign.append((self._clock(), text, is_conflict))

    def written(self, result: WriteResult) -> None:
        """Keep the result of a write."""
        self.results.append(result)

    def happened(self, event: Event) -> None:
        """Keep a numbered event."""
        self.events.append(event)

    def station_changed(self, station: Station) -> None:
        """Keep that a station has come or gone."""
        self.changes.append((station.number, station.active))

    def values(self, mapping: Mapping) -> list[Kept]:
        """Return all that was published of a mapping."""
        return [values for _, which, values in self.reads if which is mapping]

    def times(self, mapping: Mapping) -> list[float]:
        """Return when a mapping was published."""
        return [when for when, which, _ in self.reads if which is mapping]

    def numbers(self) -> set[int]:
        return {event.message.number for event in self.events}

    def wrong_messages(self) -> list[tuple[object, ...]]:
        """Return SRC and DST of all messages that were refused as 2510."""
        return [event.args[:2] for event in self.events
                if event.message is Message.ERR_WRONG_MESSAGE]

    def outcomes(self) -> list[Outcome]:
        """Return how the writes ended, in the order of their results."""
        return [result.outcome for result in self.results]


def simulated_plc(station: int, plc: str, clock: Callable[[], float],
                  *areas: tuple[str, int], checksum: str = 'CRC') -> SimulatedPlc:
    """Return a PLC whose files are (address, words)."""
    kind = PlcType(plc)
    table = DataTable(kind)
    for text, words in areas:
        table.create(parse_address(text, kind), words)
    return SimulatedPlc(station, table, Network(error_code=checksum).checksum, clock)


def store(plc: SimulatedPlc, text: str, values: Sequence[float] | str) -> None:
    """Put values of the natural type into a PLC's table."""
    address = parse_address(text, plc.table.plc_type)
    if address.bit is None:
        codec = Codec(types_of(address)[0], len(values))
        plc.table.write(address, codec.encode(values))
        return
    assert not isinstance(values, str)
    codec = Codec(ValueType.BOOL, len(values), address.bit)
    for change in codec.bit_changes(address, values):
        plc.table.write_bits(*change)


def stored(plc: SimulatedPlc, text: str, words: int = 1) -> bytes:
    """Return words of a PLC's table."""
    return plc.table.read(parse_address(text, plc.table.plc_type), words)


class FarEnd(Machine):
    """
    All stations of the line; what they hear and say goes through two filters.

    In Mode Peer there is one PLC; in Mode Radio all PLCs are behind one modem.
    """

    def __init__(self, stations: Sequence[Responder], network: Network) -> None:
        is_radio = network.mode == 'Radio'

        def run_peer(machine: Machine) -> Procedure:
            plcs = {plc.station: plc for plc in stations if isinstance(plc, SimulatedPlc)}
            first = next(iter(plcs.values()))

            def serve(command: Packet) -> Packet | None:
                plc = plcs[command.dst] if is_radio else first
                # As it is then: a test may put its own.
                return None if is_radio and plc.faults.silent else plc.serve(command)

            if is_radio:
                settings = LinkSettings(
                    station=first.station, checksum=network.checksum, also=plcs, seed=1,
                    cmd_timeout=self.answers_again,
                    avoids_collisions=network.line.avoids_collisions)
                return RadioNode(machine, settings, ActiveStationList(), serve).run(first)
            settings = LinkSettings(station=None, checksum=network.checksum)
            return FullDuplexPeer(machine, settings, ActiveStationList(), serve).run(first)

        super().__init__(multidrop(stations) if network.duplex is Duplex.HALF else run_peer,
                         checksum=network.checksum, duplex=network.duplex,
                         timing=LineTiming(network.timing.char_time))
        self.answers_again = 1.0  # by radio: half of it after a command; never if infinite
        self.hear: Callable[[bytes], bytes] = bytes
        self.say: Callable[[bytes], bytes] = bytes

    def receive_data(self, data: bytes, now: float) -> None:
        """Take bytes, as far as they get through."""
        super().receive_data(self.hear(data), now)

    def data_to_send(self) -> bytes:
        """Give bytes, as far as they get through."""
        data = super().data_to_send()
        return self.say(data) if data else data


class DriverBench:
    """
    The driver on one end of a line, stations on the other, whole frames at a time.

    ``far.hear`` and ``far.say`` stand in the line: they return what comes through of a frame.
    ``chunk`` bytes are handed over together. ``far`` may be another end than simulated PLCs.
    """

    def __init__(self, mappings: Sequence[Mapping], *, network: Network | None = None,
                 settings: DriverSettings | None = None, start: bool = True,
                 listener: Listener | None = None, chunk: int = _WHOLE_FRAMES,
                 far: Any = None) -> None:
        # Not faster: a line that is read all the time has as much to show with fewer reads.
        self.network = network or Network(baud=19200, timeout=200)
        self.listener = Recorder(self.clock)
        self._settings = replace(settings or DriverSettings(), seed=1)
        self.driver = Driver(self.network, mappings, self._settings, listener or self.listener)
        self.far_stations: list[Responder] = []
        self.far = far or FarEnd(self.far_stations, self.network)
        self.line = VirtualLine(self.driver.machine, self.far, baud=self.network.baud, chunk=chunk)
        self._actions: list[tuple[float, int, Callable[[], object]]] = []
        self._count = count()
        self.mappings = mappings
        self.is_alive = True
        if self.network.duplex is Duplex.HALF:
            self.far.start(0.0)
        if start:
            self.open()

    def clock(self) -> float:
        return self.line.now

    def plc(self, station: int, plc: str, *areas: tuple[str, int]) -> SimulatedPlc:
        """Put a PLC on the line."""
        made = simulated_plc(station, plc, self.clock, *areas, checksum=self.network.error_code)
        if self.network.duplex is not Duplex.HALF:
            made.be_full_duplex()
        self.connect(made)
        return made

    def connect(self, station: Responder) -> None:
        """Put any station on the line."""
        self.far_stations.append(station)
        if self.network.duplex is not Duplex.HALF:
            self.far.start(self.line.now)

    def open(self, run: float = 0.0) -> None:  # noqa: A003
        """Open the port; let so many seconds pass."""
        self.driver.machine.start(self.line.now, self.line.outlet(self.driver.machine))
        self.line.wake(self.driver.machine)
        if run:
            self.run(run)

    def restart(self, first_tns: int = 0) -> None:
        """Kill the driver, and put a fresh one in its place."""
        settings = replace(self._settings, first_tns=first_tns)
        driver = Driver(self.network, self.mappings, settings, self.listener)
        self.line.exchange(self.driver.machine, driver.machine)
        self.driver = driver
        self.open()

    def hand_over(self, mappings: Sequence[Mapping], first_tns: int = 0) -> None:
        """Go on with a driver of new files that knows what the last one knows, like the link."""
        before, self.mappings = self.driver, mappings
        is_online = before.is_online
        settings = replace(self._settings, first_tns=first_tns)
        driver = Driver(self.network, mappings, settings, self.listener)
        before.machine.stop(PortLost(READ_AGAIN), self.line.now)
        driver.take_over(before)
        self.line.exchange(before.machine, driver.machine, keeps_port=True)
        self.driver = driver
        if is_online:
            self.open()

    def breathe(self) -> None:
        """Let the executor run ten times a second from now on, while it ``is_alive``."""
        if self.is_alive:
            self.driver.kernel.executor_ran(self.line.now)
        self.at(self.line.now + 0.1, self.breathe)

    def lose_port(self, reason: str = 'unplugged') -> None:
        self.driver.machine.stop(PortLost(reason), self.line.now)

    def at(self, when: float, action: Callable[[], object]) -> None:
        """Do something at a moment of the clock, while ``run`` lets time pass."""
        heapq.heappush(self._actions, (when, next(self._count), action))

    def write(self, mapping: Mapping, values: Sequence[float] | str, run: float = 0.0,
              age: float = 0.0) -> None:
        """Hand over a message of so many seconds, as the node does; let seconds pass."""
        self.driver.write([mapping], values, self.line.now - age)
        self.line.wake(self.driver.machine)
        if run:
            self.run(run)

    def run(self, seconds: float) -> None:
        """Let time pass; what is planned meanwhile happens in its time, too."""
        line, actions = self.line, self._actions
        end = line.now + seconds
        line.look()
        while True:
            due = min(end, actions[0][0] if actions else end)
            if line.advance(due):
                continue
            line.now = max(line.now, due)
            if not actions or actions[0][0] > end:
                return
            heapq.heappop(actions)[2]()
            line.look()

    def run_until(self, condition: Callable[[], bool], limit: float = 60.0) -> None:
        """Let time pass until something is so; it has to be before the limit."""
        self.line.run(condition, limit)


class Program:
    """A program at a place of its own, which asks with ``src`` as its station."""

    def __init__(self, bench: DriverBench, access: ShareAccess = ShareAccess.READ,
                 src: int = 9) -> None:
        self.guest = Guest(f'pty:/tmp/{src}', access)
        self.replies: list[tuple[float, Packet]] = []
        self._again: Callable[[], object] | None = None
        self._pause = 0.0
        self._bench, self._src, self._tns = bench, src, count(1)

    def ask(self, data: bytes, dst: int = 1, cmd: int = 0x0F) -> Packet:
        """Send a command."""
        command = Packet(dst, self._src, cmd, 0, next(self._tns), data)
        bench = self._bench
        bench.driver.guests.put(GuestCommand(self.guest, command, bench.clock(), self._answered))
        bench.line.wake(bench.driver.machine)
        return command

    def keep_asking(self, data: bytes, dst: int = 1) -> None:
        """Send the next command 1 ms after the last has its reply."""
        self.go_on(lambda: self.ask(data, dst))

    def go_on(self, ask: Callable[[], object], pause: float = 0.001) -> None:
        """Ask now, and again a pause (s) after each reply."""
        self._again, self._pause = ask, pause
        ask()

    def _answered(self, reply: Packet) -> None:
        self.replies.append((self._bench.clock(), reply))
        if self._again is not None:
            self._bench.at(self._bench.clock() + self._pause, self._again)

    @property
    def statuses(self) -> list[int]:
        """Return the STS of all replies."""
        return [reply.sts for _, reply in self.replies]


class ListeningBench:
    """A driver in Mode Listen and its clock; ``has_two_ports``: the far side has its own."""

    def __init__(self, mappings: Sequence[Mapping], *, has_two_ports: bool = False,
                 check: str = 'CRC', cmd_timeout: int = 1000) -> None:
        self.now = 0.0
        self.has_two_ports = has_two_ports
        self.listener = Recorder(lambda: self.now)
        self.driver = Driver(
            Network(mode='Listen', error_code=check, cmd_timeout=cmd_timeout,
                    listen_port='/dev/second' if has_two_ports else ''),
            mappings, DriverSettings(), self.listener)
        self.machine = self.driver.machine
        self.machine.start(0.0)

    def run(self, seconds: float) -> None:
        """Let time pass; nothing is ever sent."""
        end = self.now + seconds
        while (due := self.machine.next_call) is not None and due <= end:
            self.now = max(self.now, due)
            self.machine.handle_timeout(self.now)
            assert self.machine.data_to_send() == b''
        self.now = max(self.now, end)

    def hear(self, data: bytes, *, from_far: bool = False, after: float = 0.001) -> None:
        """Let bytes come."""
        self.run(after)
        self.machine.receive_data(
            SecondPort(data) if from_far and self.has_two_ports else data, self.now)
        assert self.machine.data_to_send() == b''

    def play(self, chunks: Iterable[Chunk]) -> None:
        """Let a recording come, each chunk at its time."""
        begun: float | None = None
        for chunk in chunks:
            assert chunk.time is not None
            begun = chunk.time if begun is None else begun
            wait = max(0.0, 1.0 + chunk.time - begun - self.now)
            self.hear(chunk.data, from_far=chunk.direction is Direction.IN, after=wait)

    def values(self, mapping: Mapping) -> list[object]:
        """Return all that was published of a row."""
        return [*self.listener.values(mapping)]
