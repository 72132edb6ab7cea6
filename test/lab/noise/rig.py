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
A driver in each mode, what it talks to, and a line with noise between them.

Every write has values that no other has. The far ends change what they hold all the time.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from random import Random

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.radio import RADIO
from abdf1_ros.df1.tasks import Task
from abdf1_ros.driver.driver import Driver, Listener
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, show, WriteResult
from abdf1_ros.errors import LinkError
from abdf1_ros.messages import Event
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import Codec, Values, ValueType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from noise.judge import content_of, Ear, Judge
from noise.wire import Kind, LISTED, Wire
from support.driver_bench import FarEnd
from support.mappings import make_mapping
from support.virtual_line import VirtualLine

# Slow lines and long hours: each byte costs the same processor time, and each gap none.
BAUD = 1200
US, FAR = 5, 1
WORDS = 6
_MANY = {1: PlcType.PLC5, 2: PlcType.SLC, 16: PlcType.PLC5}
# The PLCs of each mode; in Slave there is a master instead.
_STATIONS = {'Message': _MANY, 'Standard': _MANY, 'Peer': {FAR: PlcType.SLC}, 'Slave': {},
             'Radio': {1: PlcType.SLC, 2: PlcType.SLC}}
MODES = tuple(_STATIONS)
_CODEC = Codec(ValueType.INT16, WORDS)
_POLL_TIMEOUT = 60.0
_RETRIES = 3
_LONGEST_MESSAGE = 1.5  # s, stuffed, with the pause that is allowed in it
_SETTLE = 200.0


class _WatchedTask:
    """A task that remembers when it began."""

    def __init__(self, task: Task, end: DriverEnd) -> None:
        self.command = task.command
        self.reply_size = task.reply_size
        self.expires = task.expires
        self.blames = task.blames
        self.is_own = task.is_own
        self.answer_within = task.answer_within
        self.begun = end.driver.machine.now
        self._task = task
        self._end = end

    @property
    def sent(self) -> bool:
        """Tell whether the command has been on the line."""
        return self._task.sent

    @sent.setter
    def sent(self, sent: bool) -> None:
        self._task.sent = sent

    def reply(self, packet: Packet) -> None:
        """Take the reply."""
        self._end.finishes(self)
        self._task.reply(packet)
        self._end.reading = None

    def fail(self, error: LinkError) -> None:
        """Take note that there will be no reply."""
        self._end.finishes(self)
        self._task.fail(error)
        self._end.reading = None


class _WatchedDriver(Driver):
    """A driver whose commands are timed."""

    end: DriverEnd

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the next task, watched."""
        task = super().next_task(now, busy)
        return None if task is None else _WatchedTask(task, self.end)


class DriverEnd(Listener):
    """A driver, its listener, and what the judge is told of it."""

    def __init__(self, rig: Rig, network: Network, mappings: Sequence[Mapping]) -> None:
        self.longest = 0.0
        self.reading: _WatchedTask | None = None
        self.last_reads: dict[Mapping, float] = {}
        self._rig = rig
        self._texts: dict[str, bytes] = {}
        self.mappings = mappings
        settings = DriverSettings(
            default_period=0.0, max_outstanding=2, write_timeout=60.0,
            poll_timeout=_POLL_TIMEOUT, first_tns=rig.random.randrange(65536))
        self.driver = _WatchedDriver(network, mappings, settings, self)
        self.driver.end = self
        self.ear = rig.listen(self.driver.machine, network.duplex)

    def finishes(self, task: _WatchedTask) -> None:
        """Take note that a task ends."""
        self.reading = task
        self.longest = max(self.longest, self._rig.clock() - task.begun)

    def ask(self, mapping: Mapping) -> None:
        """Ask for a write of values that no other write has."""
        values = self._rig.unique_values()
        content = _CODEC.encode(values)
        self._texts[show(values)] = content
        self._rig.judge.asked(content)
        self.driver.write([mapping], values, self._rig.clock())
        self._rig.line.wake(self.driver.machine)

    def read(self, mapping: Mapping, values: Values) -> None:
        """Judge a value."""
        now = self._rig.clock()
        if not mapping.serves:
            assert self.reading is not None
            self.last_reads[mapping] = self.reading.begun
            self._rig.judge.published(
                mapping, content_of(values), self.reading.begun, self.ear)
            return
        self._rig.judge.counts['served'] += 1
        self._rig.judge.written(content_of(values), self.ear)
        self._rig.judge.holds(mapping, content_of(values), now)

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Count reads without a value."""
        self._rig.judge.counts['unreadable'] += 1

    def written(self, result: WriteResult) -> None:
        """Hand on a result."""
        content = self._texts.pop(result.value)
        if result.mapping.serves and result.outcome is Outcome.WRITTEN:
            self._rig.judge.written(content, self.ear)
            self._rig.judge.holds(result.mapping, content, self._rig.clock())
        self._rig.judge.resulted(content, result.outcome, result.detail)

    def happened(self, event: Event) -> None:
        """Count events."""
        self._rig.judge.counts[event.message.name] += 1

    def is_fresh(self, since: float) -> bool:
        """Tell whether everything has been read since then, and all stations are active."""
        reads = [mapping for mapping in self.mappings if mapping.polls]
        return all(station.active for station in self.driver.stations) and all(
            self.last_reads.get(mapping, -1.0) >= since for mapping in reads)


class _WatchedPlc(SimulatedPlc):
    """A PLC that tells the judge what it executes and holds."""

    def __init__(self, station: int, kind: PlcType, mappings: Sequence[Mapping],
                 rig: Rig) -> None:
        table = DataTable(kind)
        super().__init__(station, table, rig.network.checksum, rig.clock)
        self.ear: Ear | None = None
        self._mappings = [mapping for mapping in mappings if mapping.station == station]
        self._rig = rig
        for mapping in self._mappings:
            address = mapping.address
            table.create(address.at_offset(address.offset), mapping.codec.words)

    def serve(self, command: Packet) -> Packet:
        """Execute a command."""
        assert self.ear is not None
        reply = super().serve(command)
        self._rig.judge.executed(self.station, command, self.ear)
        if not reply.data and not reply.sts:  # a write
            self._rig.judge.written(command.data[-2 * WORDS:], self.ear)
            self.tell()
        return reply

    def tell(self) -> None:
        """Tell what is held."""
        for mapping in self._mappings:
            address = mapping.address
            words = self.table.read(address.at_offset(address.offset), mapping.codec.words)
            self._rig.judge.holds(
                mapping, content_of(mapping.codec.decode(words)), self._rig.clock())

    def work(self) -> None:
        """Change what only the program of the PLC writes."""
        for mapping in self._mappings:
            if not mapping.writes:
                start = mapping.address.at_offset(mapping.address.offset)
                self.table.write(start, self._rig.bytes_of(2 * mapping.codec.words))
        self.tell()


class Rig:
    """A driver in one of ``MODES``, its far end, and their line."""

    def __init__(self, mode: str, error_code: str = 'CRC', kinds: tuple[Kind, ...] = LISTED,
                 seed: int = 1) -> None:
        self.mode = mode
        self.random = Random(seed)
        self.judge = Judge()
        self.wire = Wire(kinds)
        self.recoveries: list[float] = []
        self.network = Network(
            station=US, mode=mode if mode in ('Peer', 'Slave', 'Radio') else 'Master', baud=BAUD,
            polling='Standard' if mode == 'Standard' else 'Message', error_code=error_code,
            nak_retries=_RETRIES, enq_retries=_RETRIES,
            plc_type='SLC' if mode in ('Peer', 'Radio') else 'PLC5')
        self._serial = 0
        self._plcs: list[_WatchedPlc] = []
        self._ends: list[DriverEnd] = []
        self._actions: list[Callable[[], None]] = []
        far = self._slave_far() if mode == 'Slave' else self._plc_far()
        self.end = self._ends[0]
        self.line = VirtualLine(
            self.end.driver.machine, far, baud=BAUD, chunk=1000, noise=self.wire, seed=seed)
        for plc in self._plcs:
            plc.work()
        self.line.start()

    def clock(self) -> float:
        """Return the time."""
        return self.line.now if hasattr(self, 'line') else 0.0

    def listen(self, machine: Machine, duplex: Duplex) -> Ear:
        """Give a machine an ear that the judge knows."""
        ear = Ear.of(machine, self.network.checksum, duplex, self.wire)
        self.judge.ears.append(ear)
        return ear

    def bytes_of(self, count: int) -> bytes:
        """Return bytes as PLCs have them, with many zeros, and DLEs to be doubled."""
        return bytes(self.random.choice((0, 0, 0, 0x10, 0xFF, self.random.randrange(256)))
                     for _ in range(count))

    def unique_values(self) -> list[int]:
        """Return the values of the next write."""
        self._serial += 1
        head = self._serial.to_bytes(4, 'little')
        return list(_CODEC.decode(head + self.bytes_of(2 * WORDS - 4)))

    def _plc_far(self) -> Machine:
        """Return PLCs, from each of which a driver reads some words and writes others."""
        mappings: list[Mapping] = []
        for number, kind in _STATIONS[self.mode].items():
            cells = {'station': number, 'plc': kind.value}
            mappings += [
                make_mapping('N7:0', length=10, **cells), make_mapping('B3:2', **cells),
                make_mapping('N9:0', 'ReadWrite', length=WORDS, **cells)]
        if self.mode == 'Peer':
            mappings.append(make_mapping('N20:0', 'Serve', station=US, plc='SLC', length=WORDS))
        self._add_driver(self.network, mappings)
        self._plcs = [_WatchedPlc(number, kind, mappings, self)
                      for number, kind in _STATIONS[self.mode].items()]
        far = FarEnd(self._plcs, self.network)
        ear = self.listen(far, self.network.duplex)
        for plc in self._plcs:
            plc.ear = ear
            if self.mode == 'Peer':
                plc.be_full_duplex()
                self._actions.append(lambda plc=plc: self._push(plc, far))
        return far

    def _push(self, plc: SimulatedPlc, far: Machine) -> None:
        """Let the PLC write to us; what becomes of it, the judge sees at our end."""
        values = self.unique_values()
        content = _CODEC.encode(values)
        self.judge.asked(content)
        plc.send(parse_address('N20:0', PlcType.SLC), [*values], US,
                 lambda end: self.judge.resulted(
                     content, Outcome.WRITTEN if end == 'confirmed' else Outcome.UNKNOWN))
        self.line.wake(far)

    def _slave_far(self) -> Machine:
        """Return the master of our line, another driver."""
        self._add_driver(self.network, [
            make_mapping('N20:0', 'Serve', station=US, length=WORDS, tag='a'),
            make_mapping('N21:0', 'Serve', station=US, length=WORDS, tag='b'),
            make_mapping('N20:0', 'ReadWrite', station=FAR, length=WORDS, tag='c'),
            make_mapping('N21:0', station=FAR, length=WORDS, tag='d')])
        network = Network(
            station=FAR, mode='Master', polling='Standard', baud=BAUD, nak_retries=_RETRIES,
            error_code=self.network.error_code, enq_retries=_RETRIES)
        far = self._add_driver(network, [
            make_mapping('N20:0', 'Serve', station=FAR, length=WORDS, tag='a'),
            make_mapping('N21:0', 'Serve', station=FAR, length=WORDS, tag='b'),
            make_mapping('N20:0', 'ReadWrite', station=US, length=WORDS, tag='c'),
            make_mapping('N21:0', station=US, length=WORDS, tag='d')])
        for end in self._ends:
            for mapping in end.mappings:
                self.judge.holds(mapping, bytes(2 * WORDS), 0.0)
        return far.driver.machine

    def _add_driver(self, network: Network, mappings: Sequence[Mapping]) -> DriverEnd:
        end = DriverEnd(self, network, mappings)
        self._ends.append(end)
        # Our served words are written by the other end or by us (b), or no read could tell.
        written = [mapping for mapping in mappings
                   if mapping.topic == 'b' and mapping.serves
                   or mapping.writes and not mapping.serves]
        self._actions.append(lambda: end.ask(self.random.choice(written)))
        return end

    @property
    def bound(self) -> float:
        """Return the longest time (s) that a command may take."""
        network = self.network
        wait = network.timeout / 1000 + _LONGEST_MESSAGE
        tries, limit = 1 + _RETRIES, network.cmd_timeout / 1000
        one = 2 * tries * wait + limit + 2 * _LONGEST_MESSAGE
        if self.mode == 'Standard':  # while the other stations have their turns
            return 4 * one
        if self.mode == 'Radio':
            return RADIO.longest_transaction(network.line)
        if self.mode == 'Slave':
            return _POLL_TIMEOUT + one
        return one + (tries + 2) * wait

    def disturb(self, rate: float, seconds: float) -> None:
        """Let there be noise, and things to do, for a while."""
        self.wire.rate = rate
        end = self.clock() + seconds
        while self.clock() < end:
            self.line.run_for(self.random.uniform(0.0, 20.0))
            self.random.choice(self._actions)()
            if self._plcs:
                self.random.choice(self._plcs).work()

    def settle(self) -> None:
        """Stop the noise; see how long it takes until all is well, and judge the writes."""
        self.wire.rate = 0.0
        begun = self.clock()
        while not all(end.is_fresh(begun) for end in self._ends):
            self.line.run_for(0.1)
            assert self.clock() < begun + _SETTLE, 'it does not recover'
        self.recoveries.append(self.clock() - begun)
        self.line.run_for(self.bound)
        self.judge.settle()

    @property
    def longest(self) -> float:
        """Return the longest time (s) that a command took."""
        return max(end.longest for end in self._ends)
