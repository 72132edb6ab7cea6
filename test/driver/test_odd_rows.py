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
Rows whose packets never pass take nothing from the other rows of their station (rule 29).

The far end shares no code with the package. What stands in the line damages what the reports name:
a device server that doubles FF or swallows 11 and 13, a modem with a small buffer.
"""

from collections.abc import Callable
from enum import Enum
from itertools import pairwise, zip_longest
from typing import Any

from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.messages import Message
from abdf1_ros.ros.diagnostics.line import LineView
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import Answer, frame, NAK, OddDevice, Wiring

NETWORKS: dict[str, dict[str, Any]] = {
    'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
    'Radio': {'mode': 'Radio'}}
WIRINGS = {'Message': Wiring.HALF, 'Standard': Wiring.HALF, 'Peer': Wiring.FULL,
           'Radio': Wiring.RADIO}
ALL_MODES = pytest.mark.parametrize('mode', NETWORKS)
# For minutes of the line: a master that polls all the time takes long to play.
LONG_MODES = pytest.mark.parametrize('mode', long_unless(
    lambda mode: mode != 'Standard', zip(NETWORKS)))

Filter = Callable[[bytes], bytes]


def doubles_ff(data: bytes) -> bytes:
    """Return what comes out of a telnet port that doubles FF."""
    return data.replace(b'\xff', b'\xff\xff')


def swallows_xon(data: bytes) -> bytes:
    """Return what comes out of a port with XON and XOFF."""
    return bytes(byte for byte in data if byte not in (0x11, 0x13))


def damages_long(data: bytes) -> bytes:
    """Return what comes out of a modem with a small buffer."""
    return data[:40] + bytes((data[40] ^ 1,)) + data[41:] if len(data) > 80 else data


WIRES: dict[str, tuple[Filter, int, list[int]]] = {
    'FF doubled': (doubles_ff, 4, [0xFFFF, 0xFFFF, 3, 4]),
    '11 and 13 swallowed': (swallows_xon, 4, [0x1100, 17, 19, 20]),
    'long replies damaged': (damages_long, 100, [])}


class Fate(Enum):
    """What becomes of a command and its reply on the way."""

    PASSES = 'passes'
    UNHEARD = 'the command never arrives whole'
    LOST = 'nothing comes of the reply'
    DAMAGED = 'the reply never arrives whole'


class Plc(OddDevice):
    """
    An SLC that sends a reply ``tries`` times at most, by default as SLC and MicroLogix do.

    ``wire`` changes all bytes, ``fate`` tells what becomes of a command by its link data.
    """

    def __init__(self, mode: str, wire: Filter = bytes, tries: int = 4,
                 fate: Callable[[bytes], Fate] = lambda data: Fate.PASSES) -> None:
        super().__init__(WIRINGS[mode])
        self.hear = self.say = wire
        self.takes = self._takes
        self.fate = fate
        self.tried: list[tuple[float, bytes]] = []
        self._tries, self._said, self._sent, self._broken = tries, 0, b'', b''

    def _takes(self, data: bytes) -> Answer:
        fate = self.fate(data)
        self.tried.append((self._now, data))
        if fate is Fate.UNHEARD:
            return Answer.NAK if self.wiring is Wiring.FULL else Answer.NOTHING
        return Answer.LOSES if fate is Fate.LOST else Answer.ACK

    def _polled(self, station: int) -> None:
        replies = self._replies[station]
        if replies and replies[0] == self._sent and self._said >= self._tries:
            replies.popleft()
        if replies:
            self._said = 1 + (self._said if replies[0] == self._sent else 0)
            self._sent = replies[0]
        super()._polled(station)

    def _send(self, reply: bytes) -> None:
        if self.wiring is Wiring.FULL:
            self._sent, self._said = reply, 1
        if self.fate(self._last) is Fate.DAMAGED:
            self._broken = reply
        super()._send(reply)

    def data_to_send(self) -> bytes:
        whole = frame(self._broken) if self._broken else b''
        if whole and whole in self._out:
            self._out = self._out.replace(whole, whole[:-1] + bytes((whole[-1] ^ 1,)))
        return super().data_to_send()

    def _take_symbol(self) -> bool:
        if self.wiring is Wiring.FULL and self._buffer.startswith(NAK) \
                and self._said < self._tries:
            self._said += 1
            self._out += frame(self._sent)
        return super()._take_symbol()


def network(mode: str) -> Network:
    retries, cmd_timeout = (1, 500) if mode == 'Radio' else (3, 1000)
    return Network(baud=19200, timeout=200, cmd_timeout=cmd_timeout, nak_retries=retries,
                   **NETWORKS[mode])


GOOD = (make_mapping('N7:0', plc='SLC', length=8, period=200),
        make_mapping('N10:0', plc='SLC', period=200))
COMMAND = make_mapping('N7:20', 'Write', plc='SLC')


def file_of(data: bytes) -> int:
    """Return the file of a typed read or write, 0 of all else."""
    return data[8] if data[2] == 0x0F and data[6] in (0xA2, 0xAA) else 0


def of_files(fate: Fate, *files: int) -> Callable[[bytes], Fate]:
    """Let the commands for some files have a fate."""
    return lambda data: fate if file_of(data) in files else Fate.PASSES


def run(mode: str, plc: Plc, *rows: Mapping, settle: float = 30.0, seconds: float = 60.0,
        **others: Any) -> tuple[DriverBench, list[int]]:
    """Return how often the good rows have values, once the line has found out what is odd."""
    bench = DriverBench([*GOOD, *rows], network=network(mode), far=plc, **others)
    bench.run(settle)
    return bench, values_within(bench, seconds)


def values_within(bench: DriverBench, seconds: float) -> list[int]:
    """Let time pass; return how often the good rows have values, and keep only what came then."""
    before = [len(bench.listener.times(row)) for row in GOOD]
    bench.listener.results.clear()
    bench.listener.changes.clear()
    bench.run(seconds)
    return [len(bench.listener.times(row)) - count
            for row, count in zip(GOOD, before, strict=True)]


def write_each_second(bench: DriverBench, *rows: Mapping) -> None:
    """Write to rows now and each second from then on: how many results there are."""
    for row in rows:
        bench.write(row, [len(bench.listener.results) % 1000])
    bench.at(bench.clock() + 1.0, lambda: write_each_second(bench, *rows))


@LONG_MODES
@pytest.mark.parametrize('wire', WIRES)
def test_good_rows_of_a_bad_wire_come_nearly_as_often_as_without_an_odd_row(
        mode: str, wire: str) -> None:
    """Their own checks and numbers have such bytes now and then."""
    filtered, length, words = WIRES[wire]
    _, usual = run(mode, Plc(mode, filtered))
    plc = Plc(mode, filtered)
    plc.words |= {(1, 9, at): word for at, word in enumerate(words)}
    _, found = run(mode, plc, make_mapping('N9:0', plc='SLC', length=length, period=200))
    assert all(count > 0.7 * most for count, most in zip(found, usual, strict=True)), (
        found, usual)


REASONS = {
    Fate.UNHEARD: {'Peer': 'NAK to each command', 'Radio': 'no reply',
                   '': 'no command is acknowledged'},
    Fate.LOST: {'Radio': 'no reply', '': 'no reply though acknowledged'},
    Fate.DAMAGED: {'': 'each reply has a wrong check'}}


@ALL_MODES
@pytest.mark.parametrize('fate', REASONS)
def test_odd_rows_take_an_eighth_of_the_line_and_are_named(mode: str, fate: Fate) -> None:
    odd = [make_mapping(f'N{file}:0', plc='SLC', period=200) for file in (20, 21)]
    plc = Plc(mode, fate=of_files(fate, 20, 21))
    bench, found = run(mode, plc, *odd, settle=20.0, seconds=40.0)
    assert min(found) >= 0.85 * 200
    assert bench.listener.changes == []
    told = REASONS[fate].get(mode) or REASONS[fate]['']
    assert sorted(bench.listener.reasons) == [('N20:0', told), ('N21:0', told)]
    assert {bench.driver.points[row].error for row in odd} == {told}
    assert {file_of(data) for when, data in plc.tried if when > 20.0} == {7, 10, 20, 21}


@LONG_MODES
def test_ten_odd_rows_have_the_eighth_together_in_turns(mode: str) -> None:
    files, fates = range(20, 30), [*REASONS]
    odd = [make_mapping(f'N{file}:0', plc='SLC', period=200) for file in files]
    plc = Plc(mode, fate=lambda data: fates[file_of(data) % 3] if file_of(data) in files
              else Fate.PASSES)
    bench, found = run(mode, plc, *odd, settle=60.0, seconds=150.0)
    assert min(found) >= 0.85 * 750
    assert bench.listener.changes == []
    tries = [file_of(data) for when, data in plc.tried
             if when > 60.0 and file_of(data) in files]
    assert {*tries} == {*files}
    assert len(bench.listener.reasons) == 10


def longest_tries(mode: str) -> float:
    """Return the longest time (s) of a command that gets no whole reply, and a message."""
    return 1.4 if mode == 'Radio' else 1.2


@LONG_MODES
@pytest.mark.parametrize('fate', REASONS)
@pytest.mark.parametrize('count', [1, 2, 10])
def test_good_rows_wait_for_one_failed_try_while_the_odd_of_twenty_are_found(
        mode: str, fate: Fate, count: int) -> None:
    """Until its first good read a row may have to wait for the first try of each odd one."""
    files, a_try = range(60, 60 + count), longest_tries(mode)
    good = [make_mapping(f'N{file}:0', plc='SLC', length=8, period=500)
            for file in range(20, 40 - count)]
    odd = [make_mapping(f'N{file}:0', plc='SLC', length=4, period=500) for file in files]
    plc = Plc(mode)
    rows = [row for pair in zip_longest(good, odd) for row in pair if row] + [COMMAND]
    bench = DriverBench(rows, network=network(mode), far=plc)

    bench.run(10.0)
    write_each_second(bench, COMMAND)
    plc.fate = of_files(fate, *files)
    bench.run(80.0)
    first = [min(when for when, data in plc.tried if file_of(data) == file and when > 10.0)
             for file in files]
    # When each odd row has failed once, each good row has passed since or is about to.
    for row in good:
        times = [when for when in bench.listener.times(row) if when > min(first) + a_try]
        most = 8 / 7 * bench.driver.points[row].stale_time + a_try
        gaps = [after - before for before, after in pairwise([*times, 90.0])]
        assert times[0] < max(first) + a_try + most
        assert max(gaps) < most, row.tag
    assert len(bench.listener.reasons) == count
    assert len(bench.listener.changes) <= 2
    outcomes = [result.outcome for result in bench.listener.results]
    assert len(outcomes) >= 75 and outcomes.count(Outcome.WRITTEN) >= len(outcomes) - 1


@LONG_MODES
def test_short_rows_are_tried_first_where_ten_long_ones_never_pass(mode: str) -> None:
    """Where the map begins with them, and no row was read before."""
    a_try = longest_tries(mode)
    good = [make_mapping(f'N{file}:0', plc='SLC', length=8, period=500) for file in range(20, 30)]
    odd = [make_mapping(f'N{file}:0', plc='SLC', length=100, period=500)
           for file in range(60, 70)]
    bench = DriverBench([*odd, *good], network=network(mode), far=Plc(mode, damages_long))
    view, told = LineView(bench.driver), set[str]()
    begun = 4 * a_try
    bench.run(begun)
    for _ in range(300):
        bench.run(0.2)
        told |= {*view.evidence(), *map(str, view.garbled_stations(bench.clock()))}
    for row in good:
        most = 8 / 7 * bench.driver.points[row].stale_time + a_try
        times = [0.0, *bench.listener.times(row), begun + 60.0]
        assert times[1] < begun and max(b - a for a, b in pairwise(times)) < most + a_try
    assert told == set()  # no fault of the station: its other rows are read
    assert len(bench.listener.changes) <= 2


@LONG_MODES
@pytest.mark.parametrize('count', [1, 2, 10])
def test_good_rows_wait_for_one_failed_try_while_odd_messages_are_found(
        mode: str, count: int) -> None:
    files, a_try = range(60, 60 + count), longest_tries(mode)
    good = [make_mapping(f'N{file}:0', plc='SLC', length=8, period=500) for file in range(20, 30)]
    odd = [make_mapping(f'N{file}:0', 'Write', plc='SLC') for file in files]
    plc = Plc(mode, fate=of_files(Fate.LOST, *files))
    bench = DriverBench([*good, *odd, COMMAND], network=network(mode), far=plc)

    bench.run(5.0)
    write_each_second(bench, *odd, COMMAND)
    bench.run(75.0)
    first = [min(when for when, data in plc.tried if file_of(data) == file) for file in files]
    for row in good:
        most = 8 / 7 * bench.driver.points[row].stale_time + a_try
        times = [when for when in bench.listener.times(row) if when > max(first) + 2 * a_try]
        times.append(80.0)
        assert max(after - before for before, after in pairwise(times)) < most, row.tag
    last = [result.outcome for result in bench.listener.results if result.mapping is COMMAND][-5:]
    assert last == 5 * [Outcome.WRITTEN]


@LONG_MODES
def test_good_rows_do_not_wait_for_an_odd_fallback_and_odd_reads_together(mode: str) -> None:
    """Otherwise the reads that fail take all the time that the fallback leaves."""
    files, a_try = range(60, 70), longest_tries(mode)
    good = [make_mapping(f'N{file}:0', plc='SLC', length=8, period=500) for file in range(20, 30)]
    odd = [make_mapping(f'N{file}:0', plc='SLC', length=4, period=500) for file in files]
    fallback = make_mapping('N40:0', 'Write', plc='SLC', fallback=Fallback((7,), 1000))
    plc = Plc(mode, fate=of_files(Fate.LOST, 40, *files))
    bench = DriverBench([*good, *odd, fallback, COMMAND], network=network(mode), far=plc)

    write_each_second(bench, COMMAND)
    bench.run(120.0)
    found = 10.0 + 6 * a_try
    for row in good:
        most = 8 / 7 * bench.driver.points[row].stale_time + a_try
        times = [when for when in (*bench.listener.times(row), 120.0) if when > found]
        assert max(after - before for before, after in pairwise(times)) < most, row.tag
    tries = [when for when, data in plc.tried if file_of(data) == 40]
    assert max(after - before for before, after in pairwise(tries)) < 1.0 + 4 * a_try
    assert len(bench.listener.reasons) == 10
    outcomes = [result.outcome for result in bench.listener.results]
    assert outcomes.count(Outcome.WRITTEN) >= 0.9 * len(outcomes) > 100


@ALL_MODES
def test_row_comes_again_at_once_when_its_reply_passes(mode: str) -> None:
    odd = make_mapping('N9:0', plc='SLC', period=200)
    plc = Plc(mode, fate=of_files(Fate.DAMAGED, 9))
    bench, _ = run(mode, plc, odd, seconds=0.0)
    plc.fate = lambda data: Fate.PASSES
    bench.run(10.0)
    assert bench.driver.points[odd].error is None
    assert len(bench.listener.times(odd)) > 5
    assert not bench.driver.stations.odd.failed


@LONG_MODES
def test_block_is_divided_until_only_the_odd_row_fails(mode: str) -> None:
    rows = [make_mapping(f'N9:{at}', plc='SLC', period=500) for at in range(8)]
    plc = Plc(mode, fate=lambda data: Fate.DAMAGED if file_of(data) == 9 and (
        data[10] <= 5 < data[10] + data[7] // 2) else Fate.PASSES)
    bench, found = run(mode, plc, *rows, settle=120.0)
    assert min(found) >= 0.85 * 300
    assert [row.tag for row in rows if bench.driver.points[row].error] == [rows[5].tag]
    assert all(len(bench.listener.times(row)) > 150 for row in rows if row is not rows[5])
    assert [address for address, _ in bench.listener.reasons] == ['N9:5']
    plc.fate = lambda data: Fate.PASSES
    bench.run(30.0)
    assert bench.driver.points[rows[5]].error is None
    assert len([block for block in bench.driver.readings.blocks
                if rows[0].address.area == block.start.area]) > 1
    bench.lose_port()
    bench.open(run=10.0)
    assert len(bench.driver.readings.blocks) == 3  # all together again
    assert {bench.driver.points[row].error for row in rows} == {None}


@LONG_MODES
def test_block_is_divided_although_a_station_has_no_other(mode: str) -> None:
    rows = [make_mapping(f'N9:{at}', plc='SLC', period=200) for at in range(4)]
    plc = Plc(mode, fate=lambda data: Fate.DAMAGED if file_of(data) == 9 and (
        data[10] <= 2 < data[10] + data[7] // 2) else Fate.PASSES)
    bench = DriverBench(rows, network=network(mode), far=plc, settings=DriverSettings(
        processor_period=10.0))
    bench.run(90.0)
    assert [bool(bench.driver.points[row].error) for row in rows] == [False, False, True, False]


@LONG_MODES
def test_long_row_is_read_in_packets_that_pass(mode: str) -> None:
    """A modem with a small buffer."""
    row = make_mapping('N9:0', plc='SLC', length=100, period=1000)
    plc = Plc(mode, lambda data: damages_long(data) if len(data) > 150 else data)
    bench, _ = run(mode, plc, row, settle=120.0, seconds=0.0)
    before = len(bench.listener.times(row))
    bench.run(10.0)
    assert len(bench.listener.times(row)) >= before + 5
    assert bench.driver.points[row].error is None


@ALL_MODES
@pytest.mark.parametrize('fate', REASONS)
def test_message_that_is_never_confirmed_takes_nothing_from_rows_and_messages(
        mode: str, fate: Fate) -> None:
    odd = make_mapping('N9:0', 'Write', plc='SLC')
    plc = Plc(mode, fate=of_files(fate, 9))
    bench = DriverBench([*GOOD, odd, COMMAND], network=network(mode), far=plc)

    def publish() -> None:
        for row in (odd, COMMAND):
            bench.write(row, [len(bench.listener.results) % 1000])
        bench.at(bench.clock() + 2.0, publish)

    publish()
    bench.run(20.0)
    found = values_within(bench, 40.0)
    assert min(found) >= 0.8 * 200
    assert bench.listener.changes == []
    results = {row: [result for result in bench.listener.results if result.mapping is row]
               for row in (odd, COMMAND)}
    assert {result.outcome for result in results[COMMAND]} == {Outcome.WRITTEN}
    assert len(results[COMMAND]) >= 19
    assert Outcome.UNKNOWN in {result.outcome for result in results[odd]} <= {
        Outcome.UNKNOWN, Outcome.NOT_SENT}
    assert len(results[odd]) >= 19
    told = REASONS[fate].get(mode) or REASONS[fate]['']
    assert all(told in str(result) for result in results[odd])
    tried = sum(file_of(data) == 9 for when, data in plc.tried if when > 20.0)
    assert tried >= 2


@ALL_MODES
def test_question_that_is_never_answered_takes_nothing_from_rows(mode: str) -> None:
    guarded = make_mapping('N11:0', plc='SLC', period=1000, condition=While(('RUN',)))
    plc = Plc(mode, fate=lambda data: Fate.DAMAGED if data[2] == 0x06 else Fate.PASSES)
    bench, found = run(mode, plc, guarded, settle=20.0, seconds=40.0)
    assert min(found) >= 0.85 * 200
    assert bench.listener.changes == []
    assert bench.driver.checks.known(1).processor == 'unknown (each reply has a wrong check)'
    assert bench.listener.times(guarded) == []


@ALL_MODES
@pytest.mark.parametrize('fate', [Fate.UNHEARD, Fate.DAMAGED])
def test_fallback_that_is_never_confirmed_leaves_the_line_to_others(
        mode: str, fate: Fate) -> None:
    odd = make_mapping('N9:0', 'Write', plc='SLC', fallback=Fallback((17,), 1000))
    other = make_mapping('N12:0', 'Write', plc='SLC', fallback=Fallback((18,), 4000))
    plc = Plc(mode, fate=of_files(fate, 9))
    bench = DriverBench([*GOOD, odd, other, COMMAND], network=network(mode), far=plc)

    def publish() -> None:
        for row in (other, COMMAND):
            bench.write(row, [7])
        bench.at(bench.clock() + 0.2, publish)

    publish()
    bench.run(20.0)
    found = values_within(bench, 40.0)
    tries = [when for when, data in plc.tried if when > 20.0 and file_of(data) == 9]
    assert bench.listener.changes == []
    assert tries and min(found) >= 40
    assert {result.outcome for result in bench.listener.results} == {Outcome.WRITTEN}
    assert len(bench.listener.results) >= 100


@pytest.mark.parametrize('mode', ['Message', 'Standard'])
@pytest.mark.parametrize('tries', [12, 40])
def test_slave_that_repeats_a_damaged_reply_more_often_than_we_poll(
        mode: str, tries: int) -> None:
    """It keeps the reply, and would send it to the polls for the next command."""
    odd = make_mapping('N9:0', plc='SLC', period=200)
    bench, found = run(mode, Plc(mode, tries=tries, fate=of_files(Fate.DAMAGED, 9)), odd,
                       settle=20.0, seconds=40.0)
    assert min(found) >= 0.85 * 200
    assert bench.listener.changes == []


@ALL_MODES
def test_device_server_gets_messages_while_other_rows_are_answered(mode: str) -> None:
    odd = make_mapping('N9:0', plc='SLC', period=200)
    plc = Plc(mode, fate=of_files(Fate.DAMAGED, 9))
    bench = DriverBench([*GOOD, odd, COMMAND], network=network(mode), far=plc,
                        settings=DriverSettings(may_store=True))
    bench.run(20.0)
    for value in range(10):
        bench.write(COMMAND, [value], run=2.0)
    assert bench.listener.outcomes() == 10 * [Outcome.WRITTEN]


@LONG_MODES
@pytest.mark.parametrize('period', [200, 5000])
def test_odd_row_is_no_matter_of_its_period(mode: str, period: int) -> None:
    """A queue that began again at its head would send it first each time."""
    odd = make_mapping('N9:0', plc='SLC', period=5200 - period)
    slow = [make_mapping(f'N1{at}:0', plc='SLC', period=period) for at in (1, 2)]
    bench = DriverBench([*slow, odd], network=network(mode), far=Plc(
        mode, fate=of_files(Fate.DAMAGED, 9)))
    bench.run(30.0)
    bench.listener.changes.clear()
    before = [len(bench.listener.times(row)) for row in slow]
    bench.run(50.0)
    assert all(len(bench.listener.times(row)) - count >= 0.85 * 50_000 / period - 1
               for row, count in zip(slow, before, strict=True))
    assert bench.listener.changes == []


@pytest.mark.parametrize('mode', ['Message', 'Standard', 'Peer'])
def test_station_whose_replies_are_all_damaged_is_told_so(mode: str) -> None:
    plc = Plc(mode, fate=lambda data: Fate.DAMAGED)
    bench = DriverBench(GOOD, network=network(mode), far=plc)
    bench.run(20.0)
    assert bench.driver.stations[1].unanswered_by is Message.ERR_BAD_CRC
    plc.fate = lambda data: Fate.PASSES
    bench.run(20.0)
    assert [bench.driver.points[row].error for row in GOOD] == [None, None]


@pytest.mark.parametrize('mode', ['Message', 'Peer'])
def test_heartbeat_that_is_never_confirmed_leaves_the_line_to_another_one(mode: str) -> None:
    odd, good = (make_mapping(text, 'Heartbeat', plc='SLC', period=500)
                 for text in ('N9:0', 'N12:0'))
    plc = Plc(mode)
    bench = DriverBench([*GOOD, odd, good], network=network(mode), far=plc)
    bench.breathe()
    bench.run(5.0)
    assert plc.words[1, 9, 0] and plc.words[1, 12, 0]  # both count
    plc.fate = of_files(Fate.DAMAGED, 9)
    bench.run(15.0)
    beats = plc.words[1, 12, 0]
    assert min(values_within(bench, 40.0)) >= 0.7 * 200
    assert plc.words[1, 12, 0] - beats >= 0.7 * 80
    plc.fate = lambda data: Fate.PASSES
    count = plc.words[1, 9, 0]
    bench.run(20.0)
    assert plc.words[1, 9, 0] > count
