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

"""Slow jobs on a virtual line: status, echo and counters beside reads and writes."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
import math

from abdf1_ros.df1.frames import Symbol
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.checks import CheckKind, ECHO_PERIOD
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import InjectedFaults, SimulatedPlc
import pytest
from support.driver_bench import DriverBench, simulated_plc
from support.mappings import make_mapping

ECHO, COUNTERS, STATUS = 0, 1, 3
FILES = (('N7:0', 300), ('N9:0', 20))
PERIOD = 5.0
# A line that is polled without a pause is a slow one: fewer polls a second show the same.
SLOW = Network(baud=9600, timeout=200)
NETWORKS = [Network(baud=115200, timeout=200), replace(SLOW, polling='Standard')]


class Ears:
    """
    A PLC on the line that keeps the commands it gets, as (time, CMD, first byte).

    ``answer`` may be replaced by something that answers otherwise than the PLC.
    """

    def __init__(self, bench: DriverBench, plc: SimulatedPlc) -> None:
        self.heard: list[tuple[float, int, int]] = []
        self.answer: Callable[[Packet], Packet] = plc.serve
        self._bench = bench
        self._plc = plc
        self._slave = HalfDuplexSlave(LinkSettings(station=plc.station), self._serve, plc.counters)

    def handle(self, symbol: Symbol) -> bytes:
        """Answer, unless the PLC is silent."""
        return b'' if self._plc.faults.silent else self._slave.handle(symbol)

    def _serve(self, command: Packet) -> Packet:
        self.heard.append((self._bench.clock(), command.cmd, command.data[0]))
        return self.answer(command)

    def answer_diagnostics(self, answer: Callable[[Packet], Packet]) -> None:
        """Answer diagnostic commands otherwise than the PLC does."""
        self.answer = lambda command: (
            answer(command) if command.cmd == 0x06 else self._plc.serve(command))

    def times(self, function: int) -> list[float]:
        """Return when a diagnostic command came."""
        return [when for when, cmd, first in self.heard if (cmd, first) == (0x06, function)]


def make_bench(*mappings: Mapping, network: Network | None = None, period: float = PERIOD,
               plc: str = 'SLC', run: float = 0.0,
               ) -> tuple[DriverBench, list[SimulatedPlc], list[Ears]]:
    """Return the driver and its stations, after so many seconds."""
    bench = DriverBench(mappings, network=network,
                        settings=DriverSettings(processor_period=period, write_timeout=10.0))
    plcs, ears = [], []
    for station in sorted({mapping.station for mapping in mappings}):
        plcs.append(simulated_plc(station, plc, bench.clock, *FILES))
        ears.append(Ears(bench, plcs[-1]))
        bench.connect(ears[-1])
    if run:
        bench.run(run)
    return bench, plcs, ears


def word(station: int = 1, command: str = 'Read', period: int | None = None,
         text: str = 'N7:0', plc: str = 'SLC') -> Mapping:
    return make_mapping(text, command, station=station, plc=plc, period=period)


# diagnostic status


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
@pytest.mark.parametrize(('plc', 'processor'), [
    ('SLC', 'SLC 5/03 series A revision 1, REM RUN'),
    ('PLC5', 'PLC-5/40 series A revision A, REM RUN')])
def test_status_at_the_start_and_every_period(network: Network, plc: str, processor: str) -> None:
    row = make_mapping('N7:0', plc=plc, period=60_000, condition=While(('RUN',)))  # asks seldom
    bench, _, (ears,) = make_bench(row, network=network, plc=plc)
    assert bench.driver.checks.known(1).processor == 'unknown (not asked yet)'
    bench.run(3.2 * PERIOD)
    first, *_, last = ears.times(STATUS)
    assert 0.0 <= last - first - 3 * PERIOD < 0.01 + 0.01 * (network is NETWORKS[1])
    known = bench.driver.checks.known(1)
    assert known.processor == processor
    assert known.told is not None and 0.0 < known.told - ears.times(STATUS)[-1] < 0.1
    assert bench.driver.stations[1].remote_errors == 0


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
def test_program_mode_and_fault_are_seen(network: Network) -> None:
    bench, (plc,), _ = make_bench(word(), network=network, run=1.0)
    plc.processor.setting = Setting.PROGRAM
    bench.run(PERIOD)
    assert (identity := bench.driver.checks.known(1).identity) is not None
    assert (identity.is_running, identity.mode_text) == (False, 'REM PROG')
    plc.processor.setting = Setting.FAULT
    bench.run(PERIOD)
    assert (identity := bench.driver.checks.known(1).identity) is not None
    assert identity.faults == (
        'major error 0x0020 (minor error at the end of a scan), processor halted',)
    assert bench.listener.changes == []


def test_check_without_a_reply_shows_that_the_rows_of_its_station_have_no_value() -> None:
    mapping = make_mapping('N7:0', station=1, plc='SLC', period=60_000)
    bench = DriverBench([mapping], settings=DriverSettings(processor_period=0.5))
    plc = bench.plc(1, 'SLC', ('N7:0', 20))
    bench.run(2.0)
    point = bench.driver.points[mapping]
    assert point.error is None
    plc.faults.silent = True
    bench.run(3.0)
    assert point.error is not None
    assert bench.driver.stations[1].failures > 0


def test_processor_that_nobody_asks_is_said_to_be_unasked_before_and_after_a_silence() -> None:
    bench, (plc,), _ = make_bench(word(1), period=0.0)
    never = 'unknown (not asked: processor_period is 0)'
    assert bench.driver.checks.known(1).processor == never
    plc.faults = InjectedFaults(silent=True)
    bench.run_until(lambda: (1, False) in bench.listener.changes)
    plc.faults = InjectedFaults()
    bench.run(10.0)
    assert bench.driver.stations[1].active
    assert bench.driver.checks.known(1).processor == never


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
def test_station_that_comes_back_is_asked_at_once(network: Network) -> None:
    bench, (plc, _), (ears, _) = make_bench(word(1), word(2), network=network, period=1000.0)
    bench.run(1.0)
    plc.faults = InjectedFaults(silent=True)
    bench.run_until(lambda: (1, False) in bench.listener.changes)
    known = bench.driver.checks.known(1)
    assert known.processor == 'unknown (the station does not answer)'
    assert (known.identity, known.told) == (None, None)
    assert [check.due == math.inf for check in bench.driver.checks.jobs] == [True, False]
    plc.processor.setting = Setting.RUN
    bench.run(10.0)
    assert len(ears.times(STATUS)) == 1
    plc.faults = InjectedFaults()
    bench.run_until(lambda: (1, True) in bench.listener.changes)
    bench.run(0.2)
    assert len(ears.times(STATUS)) == 2
    assert bench.driver.checks.known(1).processor == 'SLC 5/03 series A revision 1, RUN'


def test_refusal_or_reply_that_is_no_status_is_told_and_no_fault_of_the_station() -> None:
    bench, (plc,), (ears,) = make_bench(word())
    ears.answer_diagnostics(lambda command: command.reply(sts=0x10))
    bench.run(2.2 * PERIOD)
    assert len(ears.times(STATUS)) == 3
    assert bench.driver.checks.known(1).processor == \
        'unknown (STS 10: illegal command, format or length, or the file does not exist)'
    station = bench.driver.stations[1]
    assert (station.active, station.remote_errors, station.failures) == (True, 0, 0)
    assert bench.driver.points[bench.driver.mappings[0]].freshness(bench.clock()) \
        is Freshness.FRESH
    ears.answer_diagnostics(plc.serve)
    bench.driver.checks.request_counters(1)
    bench.run(PERIOD)
    assert bench.driver.checks.known(1).identity is not None
    ears.answer_diagnostics(lambda command: command.reply(b'\x06'))
    bench.run(PERIOD)
    known = bench.driver.checks.known(1)
    assert (known.processor, known.identity, known.told, bool(known.counters)) == (
        'unknown (a diagnostic status of 1 bytes)', None, None, True)


def test_station_that_never_answers_this_is_asked_rarely() -> None:
    bench, (plc,), (ears,) = make_bench(word(period=1000), period=2.0, network=Network(
        baud=115200, timeout=100, cmd_timeout=500))
    ears.answer_diagnostics(lambda command: command._replace(tns=0).reply())
    bench.run(70.0)
    first, second = ears.times(STATUS)
    assert 60.0 < second - first < 63.0 and bench.driver.checks.known(1).processor == \
        'unknown (2508 ERR_COMMAND_TIMEOUT: Command Timed Out)'
    ears.answer_diagnostics(plc.serve)
    bench.run(60.0)
    assert bench.driver.checks.known(1).identity is not None


def test_mode_that_a_row_needs_is_asked_again_soon_and_not_known_by_an_earlier_answer() -> None:
    guarded = make_mapping('N7:0', plc='SLC', period=1000, condition=While(('RUN',)))
    bench, (plc,), (ears,) = make_bench(
        guarded, network=Network(baud=115200, timeout=100, cmd_timeout=500))
    seen = []
    for answer in (lambda command: command._replace(tns=0).reply(), plc.serve) * 2:
        ears.answer_diagnostics(answer)
        bench.run(8.0)
        seen.append((bool(bench.driver.points[guarded].withheld),
                     bench.driver.checks.known(1).processor[:6], len(ears.times(STATUS)) > 2))
    assert seen == [(True, 'unknow', True), (False, 'SLC 5/', True),
                    (True, 'SLC 5/', True), (False, 'SLC 5/', True)]


# beside reads and writes


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
def test_reads_that_are_due_wait_for_one_check_at_most(network: Network) -> None:
    mappings = [word(station, period=0) for station in (1, 2, 3, 4)]
    waits = []
    for period in (0.0, 0.05):  # all are asked all the time
        bench, _, ears = make_bench(
            *mappings, network=replace(network, baud=115200), period=period)
        bench.run(2.5)
        waits.append(max(later - earlier for mapping in mappings
                         for earlier, later in pairwise(bench.listener.times(mapping))))
        counts = [len(heard.times(STATUS)) for heard in ears]
        assert bool(max(counts)) == bool(period) and max(counts) - min(counts) <= 1
    transaction = 0.012 if network.polling == 'Message' else 0.02
    assert waits[1] - waits[0] < transaction
    assert bench.driver.readings.reads.longest_poll_cycle == pytest.approx(waits[1], abs=1e-6)


def test_after_a_check_come_all_reads_that_were_due() -> None:
    mappings = [word(text=f'N{file}:0', period=0) for file in (7, 9)] + [word(2, period=0)]
    bench, _, all_ears = make_bench(*mappings, period=0.01, run=2.0)
    order = [(cmd, number) for _, cmd, number in sorted(
        (when, cmd, number) for number, ears in enumerate(all_ears)
        for when, cmd, _ in ears.heard)]
    checks = [at for at, (cmd, _) in enumerate(order) if cmd == 0x06]
    assert len(checks) > 20
    for first, second in pairwise(checks):
        assert sorted(order[first + 1:second]) == [(0x0F, 0), (0x0F, 0), (0x0F, 1)]


def test_writes_leave_a_read_its_turn_also_when_a_check_is_due() -> None:
    pulses = make_mapping('N9:0/0', 'Write', plc='SLC')
    bench, _, (ears,) = make_bench(word(period=0), pulses, period=0.01)
    for n in range(200):
        bench.write(pulses, [n % 2])
    bench.run(2.0)
    assert bench.listener.outcomes().count(Outcome.WRITTEN) > 20
    functions = [(cmd, first) for _, cmd, first in ears.heard]
    last_write = max(at for at, entry in enumerate(functions) if entry == (0x0F, 0xAB))
    since_read = 0
    for cmd, first in functions[:last_write]:
        since_read = 0 if (cmd, first) == (0x0F, 0xA2) else since_read + 1
        assert since_read <= 5  # four writes and a check


def test_checks_of_a_busy_line_are_not_starved_by_long_reads() -> None:
    long = make_mapping('N7:0', plc='SLC', length=300, period=0)
    bench, _, (ears,) = make_bench(long, period=1.0, run=10.0)
    assert len(ears.times(STATUS)) in (9, 10)


# echo


@pytest.mark.parametrize('network', NETWORKS[:1])
def test_write_only_station_is_watched_by_echoes(network: Network) -> None:
    lamp = word(2, 'Write')
    bench, (_, plc), (read_ears, ears) = make_bench(word(1), lamp, network=network, period=0)
    bench.run(10.5)
    assert len(ears.times(ECHO)) == 6
    assert read_ears.times(ECHO) == []
    plc.faults = InjectedFaults(silent=True)
    bench.run(3 * ECHO_PERIOD)
    assert bench.listener.changes == [(2, False)]
    plc.faults = InjectedFaults()
    bench.run(ECHO_PERIOD + 1.5)
    assert bench.listener.changes == [(2, False), (2, True)]


def test_station_that_is_heard_needs_no_echo() -> None:
    lamp = word(1, 'Write')
    bench, _, (ears,) = make_bench(lamp, period=0)
    for n in range(20):
        bench.at(1.0 + n, lambda: bench.write(lamp, [1]))
    bench.run(20.5)
    assert len(ears.times(ECHO)) == 1  # the first, before anything was heard
    bench.run(6.0)
    assert len(ears.times(ECHO)) in (3, 4) and bench.driver.spent[lamp] > 0.4  # s of 20 writes


def test_check_of_a_station_that_is_back_is_no_probe() -> None:
    bench, (plc,), _ = make_bench(word(1, 'Write'), period=0.0, run=2.0)

    def are_probes() -> list[bool]:
        return [check.is_probe for check in bench.driver.checks.jobs]

    plc.faults = InjectedFaults(silent=True)
    bench.run_until(lambda: are_probes() == [True])
    plc.faults = InjectedFaults()
    bench.run_until(lambda: bench.driver.stations[1].replies_in_time)
    bench.run(5.0)
    assert are_probes() == [False]


def test_dead_station_with_reads_is_not_forgotten_for_those_without() -> None:
    alive = word(1, period=0)
    dead = [word(2), *(word(station, 'Write') for station in range(3, 9))]
    bench, plcs, _ = make_bench(alive, *dead, period=0)
    for plc in plcs[1:]:
        plc.faults = InjectedFaults(silent=True)
    bench.run_until(lambda: len(bench.listener.changes) == len(dead))
    plcs[1].faults = InjectedFaults()
    bench.run(5.0)
    assert bench.listener.changes[len(dead):] == [(2, True)]


# packets


class OldSlc(Ears):
    """An SLC 5/01: no more than 82 bytes of data in a packet (M 7-17, 7-18)."""

    def __init__(self, bench: DriverBench, plc: SimulatedPlc) -> None:
        super().__init__(bench, plc)
        self.answer = self._answer
        self.refused = 0
        self.writes: list[int] = []

    def _answer(self, command: Packet) -> Packet:
        reply = self._plc.serve(command)
        if command.cmd == 0x06:  # type and name of M 10-4
            data = reply.data
            return reply._replace(
                data=data[:3] + b'\x18' + data[4:5] + b'5/01'.ljust(11) + data[16:])
        self.writes += [command.data[1]] if command.data[0] == 0xAA else []
        if command.data[1] <= 82:
            return reply
        self.refused += 1
        return command.reply(sts=0x10)


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
def test_packets_are_those_of_the_processor_that_a_station_says_to_be(network: Network) -> None:
    rows = [make_mapping('N7:0', 'ReadWrite', plc='SLC', length=100),
            *(word(text=f'N7:{number}') for number in range(100, 200))]
    bench = DriverBench(rows, network=network,
                        settings=DriverSettings(processor_period=PERIOD, write_timeout=10.0))
    old = OldSlc(bench, simulated_plc(1, 'SLC', bench.clock, *FILES))
    bench.connect(old)
    bench.run(1.0)
    planned = bench.driver.readings.blocks
    bench.write(rows[0], list(range(100)), run=2 * PERIOD)
    assert old.refused == 0
    assert all(bench.listener.values(row) for row in rows)
    assert old.writes == [82, 82, 36]
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(rows[0])[-1] == list(range(100))
    assert bench.driver.readings.blocks == planned  # once, not at each answer


# link counters


@pytest.mark.parametrize('network', NETWORKS, ids=['message', 'standard'])
def test_counters_are_read_once_for_each_request_and_never_else(network: Network) -> None:
    bench, (plc, _), (ears, other) = make_bench(word(), word(2), network=network, run=2.0)
    assert ears.times(COUNTERS) == []
    for station in (1, 1, 2):
        bench.driver.checks.request_counters(station)
    assert bench.driver.checks.counters_wanted == {1, 2}
    before = plc.counters.messages_received
    bench.run(0.5)
    assert bench.driver.checks.counters_wanted == set()
    assert len(ears.times(COUNTERS)) == len(other.times(COUNTERS)) == 1
    counters = bench.driver.checks.known(1).counters
    assert before <= int(counters['messages received']) <= plc.counters.messages_received
    assert int(counters['polls received']) > 10
    bench.run(10.0)
    assert len(ears.times(COUNTERS)) == 1
    assert bench.driver.checks.known(1).counters == counters
    bench.driver.checks.request_counters(1)
    bench.run(0.5)
    assert len(ears.times(COUNTERS)) == 2


def test_counters_that_a_station_refuses_and_those_of_an_absent_station() -> None:
    bench, (plc,), (ears,) = make_bench(word(), period=0.0)  # its type is not known
    for change, reason in (
            ({'sts': 0x10}, 'STS 10: illegal command, format or length, or the file does not '
             'exist'), ({}, ''), ({'tns': 0}, '2508 ERR_COMMAND_TIMEOUT: Command Timed Out')):
        ears.answer = lambda command, change=change: (  # type: ignore[misc]
            command.reply()._replace(**change) if change and command.data[0] == COUNTERS
            else plc.serve(command))
        bench.driver.checks.request_counters(1)
        bench.run(2.0)
        known = bench.driver.checks.known(1)
        assert (bool(known.counters), known.no_counters) == (not change, reason)
        assert bench.driver.checks.counters_wanted == set()
    bench.driver.checks.request_counters(1)
    bench.run_until(lambda: bool(bench.driver.tasks.under_way) and math.inf in (
        check.due for check in bench.driver.checks.jobs if check.kind is CheckKind.COUNTERS))
    plc.faults = InjectedFaults(silent=True)  # while the question is on the line
    bench.run(5.0)
    assert bench.driver.checks.known(1).no_counters.startswith('2509 ')
    bench.driver.checks.request_counters(1)
    bench.run(1.0)
    bench.lose_port()
    assert bench.driver.checks.known(1).no_counters == 'the station does not answer'
    assert bench.driver.checks.counters_wanted == set()


@pytest.mark.parametrize('is_taken', [True, False])
def test_lost_port_ends_a_request_that_waits_for_its_turn(is_taken: bool) -> None:
    bench, _, (ears, _) = make_bench(word(), word(2), run=1.0)
    health = bench.driver.checks
    bench.driver.checks.request_counters(1)
    if is_taken:
        health.take_requests(bench.clock())
        assert bench.clock() >= health.next_due  # it is among the checks, and not on the line yet
    bench.lose_port()
    begun = bench.clock()
    health.request_counters(1)
    assert health.known(1).no_counters == 'port lost: unplugged'
    assert health.counters_wanted == set()
    bench.open(run=2.0)
    assert ears.times(COUNTERS) == []  # nobody waits for them any more
    assert ears.times(STATUS)[-1] > begun
    for station in (1, 2):
        health.request_counters(station)
    health.take_requests(bench.clock())
    assert bench.clock() >= health.next_due
    bench.driver.stations.lost(1, bench.clock())
    assert health.counters_wanted == {2}
    bench.run(1.0)
    assert health.known(2).counters and not health.counters_wanted
