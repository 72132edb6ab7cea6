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

"""The driver in Mode Slave: served words, and reads and writes by way of the master."""

from collections.abc import Sequence

from abdf1_ros.df1.machine import LineTiming, Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import Recorder, simulated_plc, store, stored
from support.mappings import make_mapping
from support.multidrop import MasterNode
from support.peers import CommandTask
from support.virtual_line import char_time, Noise, QUIET, VirtualLine

MASTER, US, PLC = 9, 3, 1
SLC = PlcType.SLC
DIALECT = dialect_of(SLC)
BAUD = 19200


class Bench:
    """A master that polls our driver and a PLC; each of the three is a node of its own."""

    def __init__(self, mappings: Sequence[Mapping], settings: DriverSettings | None = None,
                 polled: tuple[int, ...] = (US, PLC), check: str = 'CRC') -> None:
        self.network = Network(mode='Slave', plc_type='SLC', station=US, baud=BAUD,
                               error_code=check, cmd_timeout=500)
        self.listener = Recorder(self.clock)
        self.driver = Driver(self.network, mappings, settings or DriverSettings(), self.listener)
        self.plc = simulated_plc(PLC, 'SLC', self.clock, ('N7:0', 100), checksum=check)
        self.master = MasterNode(
            LinkSettings(station=MASTER, checksum=self.network.checksum, timeout=0.1), self.clock,
            PollingSettings(polled), numbers=polled, timing=LineTiming(char_time(BAUD)))
        self.far = Machine(multidrop([self.plc]), checksum=self.network.checksum)
        self.line = VirtualLine(self.driver.machine, self.master.machine, self.far, baud=BAUD)
        self.line.start()
        self._tns = 0

    def clock(self) -> float:
        return self.line.now

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.line.run_for(seconds)

    def write(self, mapping: Mapping, values: Sequence[float] | str, run: float = 0.0) -> None:
        """Ask for a write, as the node does; let so many seconds pass."""
        self.driver.write([mapping], values, self.line.now)
        self.line.wake(self.driver.machine)
        if run:
            self.run(run)

    def ask(self, request: Request, station: int = US) -> CommandTask:
        """Let the master send a command."""
        self._tns += 1
        cmd, body = request
        return self.master.add(Packet(station, MASTER, cmd, 0, self._tns, body))

    def master_reads(self, text: str, words: int) -> bytes:
        place = parse_address(text, SLC)
        task = self.ask(DIALECT.read(place, words))
        self.line.run(lambda: task.result is not None, 5.0)
        assert isinstance(task.result, Packet)
        assert task.result.sts == 0
        return DIALECT.read_data(place, words, task.result.data)


def serve_row(text: str, length: int = 1) -> Mapping:
    return make_mapping(text, 'Serve', station=US, plc='SLC', length=length)


@pytest.mark.parametrize('check', ['CRC', 'BCC'])
def test_words_are_served_in_both_directions(check: str) -> None:
    words = serve_row('N7:50', 3)
    bench = Bench([words], check=check)
    bench.write(words, [1, -2, 0x1010], run=0.1)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.master_reads('N7:50', 3) == b'\1\0\xfe\xff\x10\x10'
    bench.ask(DIALECT.write(parse_address('N7:51', SLC), b'\7\0'))
    bench.run(0.2)
    assert bench.listener.values(words)[-1] == [1, 7, 0x1010]
    assert bench.driver.counters.commands_received == 2
    assert bench.driver.counters.replies_sent == 2
    assert [station.number for station in bench.driver.stations] == []


def test_reads_and_writes_go_by_way_of_the_master() -> None:
    read = make_mapping('N7:0', station=PLC, plc='SLC', length=4)
    write = make_mapping('N7:10', 'Write', station=PLC, plc='SLC', length=2)
    bench = Bench([read, write, serve_row('N7:50')])
    store(bench.plc, 'N7:0', [1, -2, 3, 0x1010])
    bench.run(1.0)
    assert bench.listener.values(read)[-1] == [1, -2, 3, 0x1010]
    assert len(bench.listener.values(read)) > 4
    bench.write(write, [7, 8], run=0.5)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert stored(bench.plc, 'N7:10', 2) == b'\7\0\x08\0'
    assert bench.listener.numbers() == {2523}
    assert bench.driver.stations[PLC].active
    counters = bench.driver.counters
    assert 0 <= counters.commands_sent - counters.replies_received <= 1
    assert counters.nak_retries == counters.stale_messages == 0


def test_write_that_is_never_polled_for_expires() -> None:
    write = make_mapping('N7:10', 'Write', station=PLC, plc='SLC')
    bench = Bench([write], DriverSettings(write_timeout=1.0, may_store=True), polled=(PLC,))
    bench.write(write, [7], run=0.9)
    assert bench.listener.outcomes() == []
    bench.run(0.5)
    assert bench.listener.outcomes() == [Outcome.NOT_SENT]
    assert stored(bench.plc, 'N7:10') == b'\0\0'


@pytest.mark.parametrize('period', [0, 100])
def test_reads_fail_when_the_polls_stay_away_and_come_back_with_them(period: int) -> None:
    read = make_mapping('N7:0', station=PLC, plc='SLC', period=period)
    write = make_mapping('N7:10', 'Write', station=PLC, plc='SLC')
    bench = Bench([read, write], DriverSettings(poll_timeout=2.0, write_timeout=10.0))
    bench.run(1.0)
    before = len(bench.listener.values(read))
    assert before > 5
    bench.line.noise = Noise(lost=1.0)
    bench.run(0.1)
    bench.write(write, [7], run=3.0)
    assert bench.driver.points[read].error is not None
    assert bench.listener.outcomes() == [Outcome.NOT_SENT]
    bench.line.noise = QUIET
    bench.run(3.0)
    assert len(bench.listener.values(read)) > before + 5
    assert stored(bench.plc, 'N7:10') == b'\0\0'  # no old command comes out of a drawer


def test_command_to_a_dead_station_is_known_by_the_masters_error_reply() -> None:
    write = make_mapping('N7:10', 'Write', station=PLC, plc='SLC')
    bench = Bench([write])
    bench.plc.faults.silent = True
    bench.write(write, [7], run=2.0)
    result, = bench.listener.results
    assert result.outcome is not Outcome.WRITTEN
    assert bench.driver.stations[PLC].remote_errors == 1


def test_settings_reach_the_slave() -> None:
    bench = Bench([], DriverSettings(eot_suppression=True))
    bench.run(1.0)
    assert bench.driver.counters.polls_received > 0
    assert bench.driver.counters.eots_sent == 0
    assert bench.master.changes == [(US, False)]


def test_master_reads_and_resets_the_counters_that_we_show() -> None:
    bench = Bench([serve_row('N7:50')])
    assert bench.master_reads('N7:50', 1) == b'\0\0'
    tasks = [bench.ask((0x06, data)) for data in (b'\x01\0\0\x1A', b'\x07', b'\x01\0\0\x1A')]
    bench.run(1.0)
    replies = [task.result for task in tasks]
    assert [reply.sts for reply in replies if isinstance(reply, Packet)] == [0, 0, 0]
    before, reset, after = (reply.data for reply in replies if isinstance(reply, Packet))
    assert (int.from_bytes(before[4:6], 'little'), reset) == (2, b'')  # messages received
    assert int.from_bytes(after[4:6], 'little') == 1  # the command that asks
    assert bench.driver.counters.messages_received == 4


def test_served_value_is_stored_before_a_command_that_came_after_it() -> None:
    words = serve_row('N7:50')
    bench = Bench([words])
    bench.run(0.1)
    bench.driver.write([words], [5], bench.clock())  # nobody wakes the machine
    assert bench.master_reads('N7:50', 1) == b'\5\0'
    assert bench.listener.outcomes() == [Outcome.WRITTEN]


def test_served_value_that_has_become_too_old_is_not_stored() -> None:
    words = serve_row('N7:50')
    bench = Bench([words])
    bench.write(words, [5], run=0.1)
    bench.driver.write([words], [6], bench.clock() - 2.1)
    assert bench.master_reads('N7:50', 1) == b'\5\0'
    assert [str(result) for result in bench.listener.results] == [
        'written', 'not written: not sent: waited longer than 2 s for the line']


# heartbeats and fallbacks; the rules have the numbers of docs/heartbeats.md


class Interlocked(Bench):
    """The PLC has a heartbeat and a command of ours; all that the master lets through is kept."""

    def __init__(self) -> None:
        self.speed = make_mapping('N7:10', 'Write', station=PLC, plc='SLC', tag='speed',
                                  fallback=Fallback((7,), 600))
        super().__init__([make_mapping('N7:20', 'Heartbeat', station=PLC, plc='SLC', tag='beat',
                                       period=300), self.speed])
        self.is_alive = True
        self.seen: list[tuple[str, int]] = []
        self.plc.slave = HalfDuplexSlave(
            LinkSettings(station=PLC, checksum=self.network.checksum), self._keep)

    def _keep(self, command: Packet) -> Packet:
        before = self._words()
        reply = self.plc.serve(command)
        self.seen += self._words() - before
        return reply

    def _words(self) -> set[tuple[str, int]]:
        return {(name, int.from_bytes(stored(self.plc, place), 'little'))
                for name, place in (('beat', 'N7:20'), ('speed', 'N7:10'))}

    def told(self, seconds: float) -> list[tuple[str, int]]:
        """Let time pass, the executor with it; return what the PLC was told."""
        self.seen.clear()
        end = self.clock() + seconds
        while self.clock() < end:
            if self.is_alive:
                self.driver.kernel.executor_ran(self.clock())
            self.run(0.1)
        return [*self.seen]


def test_rules_2_and_8_as_a_slave() -> None:
    bench = Interlocked()
    store(bench.plc, 'N7:20', [99])
    assert bench.told(1.0) == [('beat', 0), ('speed', 7), ('beat', 1), ('beat', 2)]
    bench.write(bench.speed, [5])
    told = bench.told(1.2)
    at = told.index(('beat', 0))
    assert ('speed', 5) in told[:at]
    assert told[at:at + 3] == [('beat', 0), ('speed', 7), ('beat', 1)]


def test_rules_3_and_9_nothing_old_goes_out_when_the_master_polls_again() -> None:
    bench = Interlocked()
    bench.told(1.0)
    bench.write(bench.speed, [5])
    bench.told(0.3)
    bench.line.pause(bench.master.machine, 3.0)
    bench.write(bench.speed, [6])
    assert bench.told(1.5) == []
    bench.is_alive = False
    told = bench.told(4.0)
    assert ('speed', 6) not in told
    assert told == [('beat', 0), ('speed', 7)]  # the executor does not run
    bench.is_alive = True
    assert bench.told(1.0)[:2] == [('beat', 1), ('beat', 2)]
