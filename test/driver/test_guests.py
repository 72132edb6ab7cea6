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

"""Commands of guests: one true reply each, in time, and our own values stay as they were."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.driver.foreign_words import written_extents
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand, GuestListener
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.kernel.heartbeat import BeatState
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, outcome_of
from abdf1_ros.errors import CommandExpired, CommandTimeout, LinkError, PortLost, RemoteError
from abdf1_ros.messages import Message
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.plan.bounds import OURS_BESIDE_GUESTS
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench, Program, READ_N7, store, stored
from support.mappings import make_mapping
from support.odd_device import Answer, OddDevice, Wiring

WRITE_N7 = bytes.fromhex('AA 02 07 89 00 00 34 12')


class Told(GuestListener):
    """The stations and words of commands that may have written; None for any words."""

    def __init__(self) -> None:
        self.words: list[tuple[int, Sequence[Extent] | None]] = []

    def wrote(self, guest: Guest, command: Packet, flight: Flight) -> None:
        self.words.append((flight.station, flight.extents))


def bench_of(mode: str = 'Master', rows: int = 3, period: int = 50) -> DriverBench:
    """Return a driver that reads rows of an SLC all the time."""
    mappings = [make_mapping(f'N{7 + row}:0', station=1, plc='SLC', period=period)
                for row in range(rows)]
    bench = DriverBench(mappings, network=Network(mode=mode, baud=19200, timeout=200))
    store(bench.plc(1, 'SLC', *((f'N{7 + row}:0', 20) for row in range(rows))), 'N7:0', [4112])
    bench.run(1.0)
    return bench


def run(bench: DriverBench, seconds: float) -> None:
    """Let time pass in steps so short that a program asks again at once."""
    for _ in range(round(seconds / 0.005)):
        bench.run(0.005)


@pytest.mark.parametrize(('mode', 'dst'), [('Master', 1), ('Peer', 77)])  # a peer has one PLC
def test_reply_of_the_plc_comes_back_with_the_numbers_of_the_guest(mode: str, dst: int) -> None:
    bench = bench_of(mode)
    bench.open()
    program = Program(bench)
    for slowest in (9.0, 0.0):
        program.guest.slowest = slowest
        command = program.ask(READ_N7, dst)
        bench.run(1.0)
        assert program.replies.pop()[1] == command.reply(b'\x10\x10')
        assert slowest <= program.guest.slowest < slowest + 0.3 * (not slowest) + 0.001
    assert program.guest.slowest > 0.0


@pytest.mark.parametrize(('stations', 'meant'), [((1,), 1), ((1, 3), 2), ((1, 2), 2)])
def test_only_a_peer_with_rows_of_one_plc_takes_any_dst(
        stations: tuple[int, ...], meant: int) -> None:
    rows = [make_mapping('N7:0', station=station, plc='SLC') for station in stations]
    driver = DriverBench(rows, network=Network(mode='Peer')).driver
    guests, driver.stations[1].has_gateway = driver.guests, True  # by an STS of a gateway
    guest = Guest('hmi', ShareAccess.ALL)
    guests.put(GuestCommand(guest, Packet(2, 9, 0x0F, 0, 1, WRITE_N7), 0.0, print))
    job = guests.next(0.0, ())
    assert job is not None and job.flight and job.station == meant
    assert bool(job.flight.extents) is (meant in stations)  # the words of rows of this PLC


def test_guest_waits_on_an_idle_line_no_longer_than_its_last_failure_asks_for() -> None:
    bench = DriverBench(
        [make_mapping('N7:0', station=station, plc='SLC', period=20_000) for station in (1, 2)],
        network=Network(baud=19200, timeout=100, cmd_timeout=5000))
    for station in (1, 2):
        bench.plc(station, 'SLC', ('N7:0', 20))
    bench.run(1.0)
    program = Program(bench)
    bench.far.say = lambda data: b''
    asked = bench.clock()
    program.ask(READ_N7, dst=2)
    while not program.statuses:
        bench.run(0.005)
    took = bench.clock() - asked
    bench.far.say = lambda data: data
    program.ask(READ_N7)
    bench.run(OURS_BESIDE_GUESTS * took - 0.1)
    assert len(program.statuses) == 1
    bench.run(0.3)
    assert program.statuses[1:] == [0]


def test_command_that_has_become_too_old_after_it_was_taken_is_not_sent() -> None:
    bench = bench_of()
    bench.driver.stations.heard(2, bench.clock())
    program = Program(bench, ShareAccess.WRITE)
    program.ask(WRITE_N7, dst=2)
    guests = bench.driver.guests
    later: list[Packet] = []
    guests.put(GuestCommand(
        program.guest, Packet(1, 9, 0x0F, 0, 1, READ_N7), 1.5, later.append))
    guests.expire(bench.clock())
    first = guests.next_expiry  # of two that wait
    job = guests.next(bench.clock(), ())
    assert job is not None
    assert bench.clock() < job.expires == first <= bench.clock() + DriverSettings().write_timeout
    program.guest.listener = told = Told()
    job.ended(CommandExpired(sent=False))
    assert (program.statuses, told.words) == ([0x01], [])
    assert bench.driver.stations[2].active  # it was not even asked
    job = guests.next(bench.clock(), ())
    assert job is not None
    job.ended(PortLost('unplugged', sent=False))
    assert [reply.sts for reply in later] == [0x04]


def test_command_of_a_program_that_has_left_is_not_sent_nor_one_that_it_no_longer_waits_for(
        ) -> None:
    bench = bench_of()
    guest, told = Guest('eip', ShareAccess.WRITE), list[tuple[int, int]]()
    sent = bench.driver.counters.commands_sent
    is_there = True

    def ask(tns: int, patience: float, is_wanted: Callable[[], bool]) -> None:
        bench.driver.guests.put(GuestCommand(
            guest, Packet(1, 9, 0x0F, 0, tns, WRITE_N7), bench.clock(),
            lambda reply: told.append((tns, reply.sts)), patience, is_wanted))

    ask(1, 9.0, lambda: is_there)
    job = bench.driver.guests.next(bench.clock(), ())
    assert job is not None and job.expires < bench.clock() + 9.0
    job.ended(CommandExpired(sent=False))
    ask(2, 9.0, lambda: is_there)
    ask(3, 0.2, lambda: True)
    is_there = False
    job = bench.driver.guests.next(bench.clock(), ())
    assert job is not None and job.asked.packet.tns == 3
    assert job.expires == pytest.approx(bench.clock() + 0.2)
    job.ended(CommandExpired(sent=False))
    ask(4, 0.2, lambda: True)
    bench.driver.guests.expire(bench.clock() + 0.2)
    assert told == [(number, 0x01) for number in (1, 2, 3, 4)]
    bench.driver.guests.refuse(GuestCommand(
        guest, Packet(1, 9, 0x0F, 0, 5, WRITE_N7), bench.clock(),
        lambda reply: told.append((5, reply.sts))))
    assert told[4:] == [(5, 0x01)]
    assert (guest.commands, guest.unanswered) == (5, 5)
    assert bench.driver.counters.commands_sent == sent


def test_what_is_not_allowed_is_refused_at_once_and_changes_nothing() -> None:
    bench = bench_of()
    program = Program(bench)
    sent = bench.driver.counters.commands_sent
    program.ask(WRITE_N7)
    assert program.statuses == [0x60]
    assert program.guest.refused == 1
    assert bench.driver.counters.commands_sent == sent


WRITE_N20 = bytes.fromhex('67 00 00 01 00 06 14 00 93 09 42 34 12')


@pytest.mark.parametrize(('kind', 'address', 'write'), [
    ('SLC', 'N7:0', WRITE_N7), ('PLC5', 'N20:0', WRITE_N20)])
def test_a_write_of_a_guest_is_read_again_at_once(kind: str, address: str, write: bytes) -> None:
    mapping = make_mapping(address, station=1, plc=kind, period=10000)
    bench = DriverBench([mapping])
    plc = bench.plc(1, kind, (address, 20))
    bench.run(1.0)
    program = Program(bench, ShareAccess.WRITE)
    program.guest.listener = told = Told()
    program.ask(write)
    bench.run(0.5)
    assert stored(plc, address) == b'\x34\x12'
    assert bench.listener.values(mapping)[-1] == [0x1234]
    assert told.words == [(1, [mapping.extent])]


@for_all('entry', [
    ('SLC', '0F AA 04 07 89 05 00 34 12 00 00', 'N7:5', 2),
    ('SLC', '0F AA 04 08 8A 02 00 00 00 80 3F', 'F8:2', 1),
    ('SLC', '0F AB 02 03 85 01 00 01 00 01 00', 'B3:1', 1),
    ('SLC', '0F AA 04 09 89 05 00 34 12 00 00', '', 0),  # no row is in N9
    ('SLC', '0F A2 02 07 89 00 00', '', 0), ('SLC', '06 00 12', '', 0),
    ('SLC', '0F AA 02 04 86 00 02 34 12', '', 1),  # file 4 is T, whatever number EII has
    # Typed writes: the third word of a transaction of 3; file 20, whose type no address tells.
    ('PLC5', '0F 67 02 00 03 00 06 07 05 93 09 42 34 12', 'N7:7', 1),
    ('PLC5', '0F 67 00 00 02 00 06 14 03 95 09 42 01 00 02 00', 'N20:3', 2),
    ('PLC5', '0F 67 00 00 01 00 06 08 02 96 09 94 08 00 00 80 3F', 'F8:2', 1),
    ('PLC5', '0F 26 06 14 03 FE FF 01 00', 'N20:3', 1),
    # And a word of a file of no row, before and after it.
    ('PLC5', '0F 26 06 15 00 FE FF 01 00 06 14 03 FE FF 01 00', 'N20:3', 1),
    ('PLC5', '0F 26 06 14 03 FE FF 01 00 06 15 00 FE FF 01 00', 'N20:3', 1),
    ('PLC5', '0F 00 00 00 02 00 06 14 03 01 00 02 00', 'N20:3', 2),
    ('PLC5', '08 06 00 34 12', 'N9:3', 1)])
def test_words_of_a_write_are_known_by_its_address(entry: tuple[str, str, str, int]) -> None:
    plc, text, address, length = entry
    data = bytes.fromhex(text)
    rows = [make_mapping(text, plc=plc, station=1, period=50) for text in (
        'N7:0', 'F8:0', 'B3:0', *(('N20:0', 'N9:0') if plc == 'PLC5' else ('EII:0.IS',)))]
    found = written_extents(Packet(1, 9, data[0], 0, 1, data[1:]), 1, Rows(rows))
    expected = [make_mapping(address, plc=plc, length=length).extent] if address else []
    assert found == expected


@pytest.mark.parametrize('text', ['08 02 00 34 12', '00 02 00 34 12', '05 02 00 01 00'])
def test_words_of_a_write_to_the_common_interface_file_are_all_of_the_file(text: str) -> None:
    """File 9 of an SLC, 7 of a MicroLogix 1000; S:2/8 decides whether a command counts bytes."""
    rows = [make_mapping(address, plc='SLC') for address in ('N7:9', 'N9:30', 'B3:1', 'N10:0')]
    data = bytes.fromhex(text)
    found = written_extents(Packet(1, 9, data[0], 0, 1, data[1:]), 1, Rows(rows))
    assert found == [row.extent for row in rows[:2]]
    rows = [make_mapping('005', plc='PLC2', access='CIF')]
    found = written_extents(Packet(1, 9, data[0], 0, 1, data[1:]), 1, Rows(rows))
    assert found == [rows[0].extent]


@pytest.mark.parametrize(('file', 'met'), [(7, (0, 2)), (9, (2,)), (10, (1,)), (11, ())])
def test_words_of_a_write_beside_rows_of_that_file_are_known(
        file: int, met: tuple[int, ...]) -> None:
    rows = [make_mapping(address, plc='SLC') for address in ('N7:0', 'N10:0')]
    rows.append(make_mapping('005', plc='PLC2', access='CIF'))  # a family without this command
    data = WRITE_N7[:2] + bytes((file,)) + WRITE_N7[3:]
    assert written_extents(Packet(1, 9, 0x0F, 0, 1, data), 1, Rows(rows)) == [
        rows[row].extent for row in met]


@pytest.mark.parametrize('text', ['0F 80 01', '0F 57 00', '0F'])
def test_words_of_a_command_that_nobody_knows_may_be_any(text: str) -> None:
    data, rows = bytes.fromhex(text), [make_mapping('N7:0', plc='SLC')]
    assert written_extents(Packet(1, 9, data[0], 0, 1, data[1:]), 1, Rows(rows)) is None


@for_all('entry', [
    ('06 02 03 03', False), ('06 04 10', False), ('06 07', False), ('0F 53', False),
    ('0F A2 50 02 22 00 00', False), ('0F 17 00 00 00 00 02', False), ('04 00 00 02', False),
    ('0F 80 01', True), ('0F 50', True), ('0F 57', True), ('06 08 00 01', True), ('0F 99', True)])
def test_reads_of_programs_and_settings_of_the_port_are_no_writes_of_words(
        entry: tuple[str, bool]) -> None:
    text, may_write = entry
    data = bytes.fromhex(text)
    bench = bench_of(rows=1)
    program = Program(bench, ShareAccess.ALL)
    program.guest.listener = told = Told()
    program.ask(data[1:], cmd=data[0])
    bench.run(1.0)
    assert told.words == [(1, None)] * may_write  # the PLC refuses each of them


def test_words_of_a_plc2_write_to_a_plc5_are_in_the_file_of_our_number_not_the_guests() -> None:
    bench = DriverBench([make_mapping('N5:0')], network=Network(baud=19200, timeout=200))
    bench.plc(1, 'PLC5', ('N5:0', 20))
    program = Program(bench, ShareAccess.WRITE, src=9)
    program.guest.listener = told = Told()
    program.ask(b'\6\0\x34\x12', cmd=0x08)
    bench.run(1.0)
    assert told.words == [(1, [make_mapping('N5:3').extent])]


def test_words_of_a_broadcast_are_those_of_every_station() -> None:
    rows = [make_mapping('N7:0', plc='SLC', station=number) for number in (1, 2)]
    rows += make_mapping('N7:0', 'Serve', plc='SLC', station=0), make_mapping(station=3)
    found = written_extents(Packet(255, 9, 0x0F, 0, 1, WRITE_N7), 255, Rows(rows))
    assert found == [row.extent for row in rows[:2]]


def test_guests_get_a_quarter_and_never_two_between_two_of_ours() -> None:
    bench = bench_of(rows=12, period=1)  # more than the line can carry
    guests = [Program(bench, src=20 + number) for number in range(3)]
    for program in guests:
        program.keep_asking(READ_N7)
    before = bench.driver.tasks.transactions
    run(bench, 20.0)
    total = bench.driver.tasks.transactions - before
    counts = [len(program.replies) for program in guests]
    assert sum(counts) == pytest.approx(total / 4, rel=0.05)
    assert max(counts) - min(counts) <= 1


def test_guest_that_had_an_idle_line_has_its_share_of_the_next_reads() -> None:
    bench = bench_of(rows=12, period=2000)
    program = Program(bench)
    program.keep_asking(READ_N7)
    run(bench, 1.0)
    before = len(program.replies)
    run(bench, 0.3)
    assert before > 20 and len(program.replies) - before in (3, 4)


@for_all('entry', [('Master', 'hear'), ('Master', 'say'), ('Peer', 'hear'), ('Peer', 'say')])
def test_failing_commands_get_no_more_time_where_the_line_rests(entry: tuple[str, str]) -> None:
    """What becomes due while one of them waits for its end would be late each time."""
    mode, where = entry
    bench = beating_bench(mode)
    setattr(bench.far, where, lost)
    before = len(bench.listener.reads)
    program = Program(bench)
    program.go_on(lambda: program.ask(b'\0' + MARK, cmd=0x06))
    run(bench, 20.0)
    assert len(program.replies) > 5
    assert len(bench.listener.reads) - before > 0.7 * 200


def test_guests_of_polled_stations_get_no_more_than_a_quarter() -> None:
    """The commands of several stations are under way at a time, of guests never two."""
    stations = range(1, 5)
    bench = DriverBench(
        [make_mapping(f'N{file}:0', station=station, plc='SLC', period=1)
         for station in stations for file in (7, 8)],
        network=Network(polling='Standard', baud=19200, timeout=200))
    for station in stations:
        bench.plc(station, 'SLC', ('N7:0', 20), ('N8:0', 20))
    bench.run(1.0)
    guests = [Program(bench, src=20 + station) for station in stations]
    for station, program in zip(stations, guests, strict=True):
        program.keep_asking(READ_N7, dst=station)
    before = bench.driver.tasks.transactions
    run(bench, 10.0)
    total = bench.driver.tasks.transactions - before
    assert 0.1 * total < sum(len(program.replies) for program in guests) < 0.26 * total


@pytest.mark.parametrize('how_many', [18, 50])
def test_a_flood_gets_a_reply_to_each_command(how_many: int) -> None:
    bench = bench_of(rows=1, period=10000)
    program = Program(bench)
    for _ in range(how_many):
        program.ask(READ_N7)
    other = Program(bench, src=9)
    other.ask(READ_N7)
    bench.run(3.0)
    assert other.replies[0][0] < program.replies[-12][0]  # the guests take turns
    # One is sent at once, 16 wait.
    assert program.statuses.count(0x00) == 17
    assert program.statuses.count(0x01) == how_many - 17
    assert len(program.guest.waiting) == 0


def test_silent_station_is_told_at_once_and_costs_others_little() -> None:
    bench = bench_of()
    bench.plc(2, 'SLC', ('N7:0', 20))
    program, other = Program(bench), Program(bench, src=8)
    other.go_on(lambda: other.ask(READ_N7, dst=2), pause=1.0)  # only guests ask this station
    program.keep_asking(READ_N7, dst=77)
    before = bench.driver.tasks.transactions
    run(bench, 10.0)
    assert set(program.statuses) <= {0x02, 0x07} and set(other.statuses) == {0x00}
    assert program.guest.unanswered == len(program.statuses)
    assert bench.listener.numbers() == {Message.NTC_REPLY_MSG_RCVD.number}
    # The probes of silent stations have an eighth of the line.
    assert bench.driver.tasks.transactions - before > 200


def test_read_of_all_stations_is_not_sent_and_has_no_success() -> None:
    bench = bench_of()
    program = Program(bench, ShareAccess.ALL)
    for data in (READ_N7, WRITE_N7, WRITE_N7, WRITE_N7):
        program.ask(data, dst=255)
    bench.run(1.0)
    assert program.statuses == [0x07, 0x05, 0x05, 0x05]  # nobody has confirmed a write


def test_every_command_has_one_reply_in_time_when_replies_are_lost() -> None:
    bench = bench_of()
    program = Program(bench, ShareAccess.WRITE)
    program.guest.listener = told = Told()
    bench.far.say = lambda data: b'' if data.startswith(b'\x10\x02') else data
    for number in range(10):
        program.ask(READ_N7 if number % 2 else WRITE_N7)
        bench.run(2.0)
    bench.run(10.0)
    assert len(program.replies) == 10
    assert set(program.statuses) <= {0x01, 0x02, 0x05, 0x07}
    assert program.statuses[0] in (0x02, 0x05)  # it was sent
    assert len(told.words) == sum(sts in (0x02, 0x05) for sts in program.statuses[::2])


def beating_bench(mode: str, polling: str = 'Message') -> DriverBench:
    """Return a driver that reads ten times a second and counts a heartbeat."""
    rows = [make_mapping('N7:0', station=1, plc='SLC', period=100), make_mapping(
        'N10:0', 'Heartbeat', station=1, plc='SLC', period=500)]
    bench = DriverBench(rows, network=Network(
        mode=mode, polling=polling, baud=19200, timeout=100, cmd_timeout=1500))
    bench.plc(1, 'SLC', ('N7:0', 20), ('N10:0', 4))
    if mode == 'Peer':
        bench.open()
    bench.breathe()
    bench.run(3.0)
    return bench


@for_all(('station', 'error', 'outcome'), [
    (1, None, Outcome.WRITTEN), (BROADCAST, None, Outcome.BROADCAST),
    (1, RemoteError(0x10, None, ''), Outcome.FAILED),
    (1, RemoteError(0x02, None, ''), Outcome.UNKNOWN),
    (1, CommandTimeout(), Outcome.UNKNOWN), (1, CommandTimeout(sent=False), Outcome.NOT_SENT)])
def test_what_has_come_of_a_command_that_writes(
        station: int, error: LinkError | RemoteError | None, outcome: Outcome) -> None:
    assert outcome_of(station, error) is outcome


MARK = b'GUEST'  # what is easily known in a command and in its reply


def lost(data: bytes) -> bytes:
    return b'' if MARK in data else data


def damaged(data: bytes) -> bytes:
    return data.replace(MARK, b'FEAST')


@for_all('entry', [
    (*line, *way) for line in [('Master', 'Message'), ('Master', 'Standard'), ('Peer', 'Message')]
    for way in [('hear', lost), ('hear', damaged), ('say', lost), ('say', damaged)]])
def test_failure_of_a_guest_says_nothing_about_the_station(
        entry: tuple[str, str, str, Callable[[bytes], bytes]]) -> None:
    """No ACK, NAK, no answer to polls, no reply: the PLC answers all of ours meanwhile."""
    mode, polling, where, filtered = entry
    bench = beating_bench(mode, polling)
    setattr(bench.far, where, filtered)
    program = Program(bench)
    beats, reads = set(), len(bench.listener.reads)
    for _ in range(4):
        program.ask(b'\0' + MARK, cmd=0x06)
        for _ in range(20):
            bench.run(0.1)
            beats.add(bench.driver.kernel.rows.heartbeats[0].state)
    station = bench.driver.stations[1]
    never_whole = where == 'say' and filtered is damaged  # it is polled for up to Cmd_Timeout
    assert program.statuses[0] in (
        (0x02, 0x05) if mode == 'Peer' else (0x05,) if never_whole else (0x02,))
    assert set(program.statuses) <= {0x01, 0x02, 0x05} and len(program.statuses) >= 3
    assert bench.listener.changes == []
    assert (station.active, station.overdue, station.unanswered, station.returns) == (
        True, 0, 0, 0)
    assert beats == {BeatState.COUNTS}
    assert not bench.listener.numbers() & {Message.ERR_INACTIVE_STATION.number}
    assert len(bench.listener.reads) - reads > 16


@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_command_that_is_never_answered_gets_less_and_less_of_the_line(mode: str) -> None:
    """The PLC acknowledges it each time; all other commands are answered, also of this guest."""
    device = OddDevice(Wiring.HALF if mode == 'Master' else Wiring.FULL)
    bad, good = bytes.fromhex('A2 02 63 89 00 00'), READ_N7
    device.takes = lambda data: Answer.LOSES if data[6:] == bad else Answer.ACK
    bench = DriverBench(
        [make_mapping('N7:0', station=1, plc='SLC', period=100)], far=device,
        network=Network(mode=mode, baud=19200, timeout=200, cmd_timeout=1000))
    bench.run(2.0)
    before = len(bench.listener.reads)
    program, other = Program(bench), Program(bench)
    other.guest = program.guest
    tries = list[float]()

    def hear(data: bytes) -> bytes:
        if bad in data:
            tries.append(bench.clock())
        return data

    device.hear = hear
    program.go_on(lambda: program.ask(bad), pause=0.1)
    other.go_on(lambda: other.ask(good), pause=0.1)
    run(bench, 120.0)
    gaps = [later - sooner for sooner, later in pairwise(tries)]
    assert gaps == sorted(gaps) and 30.0 < gaps[-1] < 65.0
    assert len(tries) < 7
    assert program.statuses.count(0x05) == len(tries)
    assert set(program.statuses) == {0x05, 0x01} and set(other.statuses) == {0x00, 0x01}
    assert other.statuses.count(0x01) < 0.05 * len(other.statuses)  # just after each try
    device.takes = lambda data: Answer.ACK
    run(bench, 62.0)
    assert program.statuses[-10:] == 10 * [0x00]
    assert len(bench.listener.reads) - before > 0.9 * 1820


def test_lost_port_is_told_and_what_waits_is_not_sent_later() -> None:
    bench = bench_of()
    program = Program(bench)
    for _ in range(3):
        program.ask(READ_N7)
    bench.run_until(lambda: len(program.guest.waiting) == 2)
    fresh: list[Packet] = []
    bench.driver.guests.put(GuestCommand(
        program.guest, Packet(1, 9, 0x0F, 0, 1, READ_N7), bench.clock(), fresh.append))
    bench.lose_port()
    assert [reply.sts for reply in fresh] == [0x04]
    early = Program(DriverBench([], start=False))
    for each in (program, early):
        each.ask(READ_N7)
    assert (len(program.replies), early.statuses, early.guest.unanswered) == (4, [0x04], 1)
    assert set(program.statuses) <= {0x04, 0x05}
    bench.run(3600.0)  # the outage is no time that the guest has had
    bench.open(run=2.0)
    program.ask(READ_N7)
    bench.run(1.0)
    assert program.statuses[4:] == [0x00]


def test_message_of_a_peer_to_the_number_of_a_guest_is_one_to_us() -> None:
    served = make_mapping('N20:0', 'Serve', station=5, plc='SLC')
    bench = DriverBench([make_mapping('N7:0', station=1, plc='SLC'), served],
                        network=Network(mode='Peer', plc_type='SLC', baud=19200, timeout=200))
    plc = bench.plc(1, 'SLC', ('N7:0', 20))
    bench.open()
    program = Program(bench, src=9)
    program.ask(READ_N7)
    bench.run(1.0)
    said: list[str] = []
    for address in ('N7:5', 'N20:0'):
        plc.send(make_mapping(address, plc='SLC').address, [7], 9, said.append)
    bench.line.wake(bench.far)
    bench.run(2.0)
    assert program.statuses == [0]
    assert [text[:6] for text in said] == ['STS 10', 'confir']
    assert bench.listener.values(served)[-1] == [7]
    assert bench.driver.counters.invalid_messages == 2
