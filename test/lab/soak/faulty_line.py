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
A driver on a line on which everything goes wrong, in turns, and what it keeps in memory.

Both ends, the line and the faults are those of one seed, so a run can be repeated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.driver import Driver, Listener
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import WriteResult
from abdf1_ros.errors import PortLost
from abdf1_ros.messages import Event
from abdf1_ros.pccc.values import Values
from abdf1_ros.ros.diagnostics.log import EventLog, LimitedLog
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.ros.diagnostics.statuses import Diagnostics
from abdf1_ros.ros.diagnostics.writes import WriteLog
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from soak.hostile import DEAD, hostile_message, LIAR, Liar, OTHER, PLC, SLC, US
from soak.memory import container_lengths
from support.driver_bench import FarEnd, simulated_plc
from support.mappings import make_mapping
from support.virtual_line import Noise, QUIET, VirtualLine

MODES = ('Message', 'Standard', 'Peer', 'Slave', 'Radio')
BAUD = 9600
FLOOD = 1500  # to each mapping, which is more than are kept


class Sink:
    """A logger that counts its lines."""

    def __init__(self) -> None:
        self.lines: Counter[str] = Counter()

    def is_enabled_for(self, level: object) -> bool:
        """Tell that debug lines are not wanted."""
        return False

    def __getattr__(self, level: str) -> Callable[[str], None]:
        """Return what takes the lines of a level."""
        def take(text: str) -> None:
            assert text.isprintable()
            self.lines[level] += 1
        return take


class Ear(Listener):
    """Who listens to a driver: what the node has, without ROS."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.log = Sink()
        self.reads = 0
        self.results = 0
        self.events: Counter[str] = Counter()
        self.seen = Seen()
        self.writes = WriteLog('line')
        self._clock = clock
        self._event_log = EventLog(self.log, clock)  # type: ignore[arg-type]
        self._lines = LimitedLog(self.log, clock)  # type: ignore[arg-type]

    def read(self, mapping: Mapping, values: Values) -> None:
        """Count a value."""
        self.reads += 1

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Log why there is no value."""
        self._lines.error(mapping.tag, reason)

    def written(self, result: WriteResult) -> None:
        """Count the result of a write."""
        self.results += 1
        self.writes.add(result, self._clock())
        self._lines.warning(f'writes to {result.mapping.tag}', f'{result.value}: {result}')

    def happened(self, event: Event) -> None:
        """Take a numbered event."""
        self.events[event.message.name] += 1
        self.seen.last_events[event.station] = event, self._clock()
        self._event_log.add(event)

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Log that a row is published again."""
        self._lines.info(mapping.tag, 'published again')

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Log that a heartbeat has a value that is not ours."""
        self._lines.warning(mapping.tag, text)

    def station_changed(self, station: Station) -> None:
        """Log that a station has come or gone."""
        self._event_log.forget(station.number)
        self._lines.info(f'station {station.number}', 'changed')


class FaultyLine:
    """
    A line with a driver in one of ``MODES``, and its faults.

    Masters have two PLCs, a liar and a dead station, by radio two dead ones and no liar; a peer
    and a slave have another driver at the far end, as peer and as master. The line is quiet for
    ``pause`` s at most from one fault to the next, and none lasts longer than ``longest`` s.
    """

    def __init__(self, mode: str, seed: int = 1, pause: float = 20.0,
                 longest: float = 20.0) -> None:
        self._pause, self._longest = pause, longest
        self.asked = 0
        self.faults: Counter[str] = Counter()
        self._random = Random(seed)
        self._liar = Liar(seed)
        self.ear, self._far_ear = Ear(self.clock), Ear(self.clock)
        self._mappings = _mappings(mode)
        self.driver = Driver(
            _network(mode), self._mappings, DriverSettings(max_outstanding=3), self.ear)
        self._diagnostics = Diagnostics(
            'soak', self.driver, 'line', self.ear)  # type: ignore[arg-type]
        self._plcs = [
            simulated_plc(PLC, 'PLC5', self.clock, ('N7:0', 100)),
            simulated_plc(SLC, 'SLC', self.clock, ('N7:0', 100), ('B3:0', 20))]
        self.kinds = {
            'noise': self._noise, 'babble': self._babble, 'hostile frames': self._hostile,
            'lost port': self._unplug, 'flood of writes': self._flood}
        if mode not in ('Peer', 'Slave'):
            self.kinds |= {'stations that come and go': self._flap, 'error replies': self._refuse}
        if mode in ('Message', 'Standard'):
            self.kinds['lies'] = self._lie
        self.far = self._far_end(mode)
        self.line = VirtualLine(self.driver.machine, self.far, baud=BAUD, chunk=1000, seed=seed)
        self.line.start()
        self.run(30.0)

    def _far_end(self, mode: str) -> Machine:
        if mode not in ('Peer', 'Slave'):
            return FarEnd([*self._plcs, self._liar], self.driver.network)
        network = Network(mode='Peer' if mode == 'Peer' else 'Master', station=OTHER, baud=BAUD,
                          timeout=300)
        asks = [make_mapping('N20:0', 'Read', station=US, plc='PLC5', length=5, period=700),
                make_mapping('N7:0', 'Serve', station=OTHER, plc='PLC5', length=40, item=2)]
        self._far_driver = Driver(network, asks, DriverSettings(), self._far_ear)
        return self._far_driver.machine

    def clock(self) -> float:
        """Return the time."""
        return self.line.now

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.line.run_for(seconds)
        self._diagnostics.statuses(self.clock())

    def disturb(self) -> None:
        """Let every kind of fault happen once, in any order; then all is well again."""
        for name in self._random.sample([*self.kinds], len(self.kinds)):
            self.faults[name] += 1
            self.kinds[name]()
            self.run(self._random.uniform(0.0, self._pause))

    def settle(self) -> None:
        """Let all queues run empty; then every write has had its one result."""
        end = self.clock() + 60.0
        while self.ear.results < self.asked and self.clock() < end:
            self.run(5.0)
        self.run(5.0)
        assert self.ear.results == self.asked

    def _for_a_while(self) -> Iterator[None]:
        for _ in range(self._random.randrange(1, int(self._longest))):
            yield
            self.run(1.0)

    def _noise(self) -> None:
        share = self._random.choice((0.001, 0.01, 0.1))
        self.line.noise = Noise(lost=share, flipped=share, doubled=share, inserted=share)
        self.run(self._random.uniform(1.0, self._longest))
        self.line.noise = QUIET

    def _babble(self) -> None:
        for _ in self._for_a_while():
            self._hear(self._random.randbytes(self._random.randrange(2000)))

    def _hostile(self) -> None:
        for _ in self._for_a_while():
            for _ in range(self._random.randrange(20)):
                data = hostile_message(self._random)
                self._hear(frames.message_frame(data, self.driver.network.checksum))
                self._hear(frames.master_frame(US, data, self.driver.network.checksum))
                self._hear(self._random.choice((frames.ACK, frames.NAK, frames.EOT, frames.ENQ)))

    def _lie(self) -> None:
        self._liar.is_lying = True
        self.run(self._random.uniform(1.0, self._longest))
        self._liar.is_lying = False

    def _flap(self) -> None:
        for _ in self._for_a_while():
            for plc in self._plcs:
                plc.faults.silent = self._random.random() < 0.5
        for plc in self._plcs:
            plc.faults.silent = False

    def _refuse(self) -> None:
        for _ in self._for_a_while():
            for plc in self._plcs:
                plc.faults.status = self._random.choice(((), (0x10,), (0xF0, 0x0B), (0xF0,)))
        for plc in self._plcs:
            plc.faults.status = ()

    def _unplug(self) -> None:
        self.driver.machine.stop(PortLost('unplugged'), self.clock())
        self._write_all()
        self.run(self._random.uniform(0.1, 5.0))
        self.driver.machine.start(self.clock())
        self.line.wake(self.driver.machine)

    def _flood(self) -> None:
        """Ask for far more writes than the line can take, before it takes the first."""
        for _ in range(FLOOD):
            self._write_all()
        self.check_bounds()
        self.line.wake(self.driver.machine)

    def _write_all(self) -> None:
        for mapping in self._mappings:
            if mapping.writes:
                values = [self._random.randrange(2) for _ in range(mapping.length)]
                self.asked += 1
                self.driver.write([mapping], values, self.clock())

    def _hear(self, data: bytes) -> None:
        machine = self.driver.machine
        machine.receive_data(data, self.clock())
        self.line.wake(machine)

    def check_bounds(self) -> None:
        """Check that nothing the driver or its listener keeps is longer than its bound."""
        lengths = container_lengths(self.driver)
        assert max(lengths.values()) <= MOST_KEPT, lengths


# Waiting writes are the longest queue, 1000 to the PLCs and 1000 of Serve rows.
MOST_KEPT = 1100


def _network(mode: str) -> Network:
    modes = {'Message': ('Master', 'Message'), 'Standard': ('Master', 'Standard'),
             'Peer': ('Peer', 'Message'), 'Slave': ('Slave', 'Message'),
             'Radio': ('Radio', 'Message')}
    name, polling = modes[mode]
    return Network(mode=name, polling=polling, station=US, baud=BAUD, timeout=300)


def _mappings(mode: str) -> list[Mapping]:
    serve = make_mapping('N20:0', 'Serve', station=US, plc='PLC5', length=5, period=5000, tag='s')
    if mode in ('Peer', 'Slave'):
        return [serve, make_mapping('N7:0', 'ReadWrite', station=OTHER, length=8, period=600,
                                    item=2, tag='a')]
    return [
        serve,
        make_mapping('N7:0', 'ReadWrite', station=PLC, length=8, period=600, item=2, tag='a'),
        make_mapping('N7:20', 'ReadWrite', station=PLC, kind='bcd16', period=86_400_000, item=3,
                     tag='b'),
        make_mapping('N7:0', 'ReadWrite', station=SLC, plc='SLC', length=40, period=900, item=4,
                     tag='c'),
        make_mapping('B3:0/3', 'ReadWrite', station=SLC, plc='SLC', length=20, period=900,
                     item=5, tag='d'),
        make_mapping('N7:0', station=LIAR, plc='SLC', period=1000, item=6, tag='e'),
        make_mapping('N7:0', station=DEAD, plc='SLC', period=1000, item=7, tag='f')]
