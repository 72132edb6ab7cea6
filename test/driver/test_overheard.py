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

"""Mode Listen: rows that are filled from what other nodes say, byte by byte."""

from __future__ import annotations

from typing import NamedTuple

from abdf1_ros.df1.frames import Damaged
from abdf1_ros.driver.reads.demands import ReadAnswer
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.errors import PortLost
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
import pytest
from support.captures import Capture, CAPTURES
from support.cases import for_all, long_unless
from support.driver_bench import ListeningBench
from support.mappings import make_mapping
from support.odd_device import frame

ACK, EOT = b'\x10\x06', b'\x10\x04'


def poll(station: int) -> bytes:
    return bytes((0x10, 0x05, station, -station & 0xFF))


def command(tns: int, rest: str, *, station: int = 1, cmd: int = 0x0F, src: int = 0) -> bytes:
    return bytes((station, src, cmd, 0)) + tns.to_bytes(2, 'little') + bytes.fromhex(rest)


def reply(tns: int, rest: str, *, station: int = 1, cmd: int = 0x4F, sts: int = 0,
          src: int = 0) -> bytes:
    return bytes((src, station, cmd, sts)) + tns.to_bytes(2, 'little') + bytes.fromhex(rest)


def exchange(bench: ListeningBench, tns: int, asked: str, answered: str, *, sts: int = 0,
             station: int = 1, cmd: int = 0x0F) -> None:
    """Let a master and a slave have a transaction in half duplex."""
    bench.hear(frame(command(tns, asked, station=station, cmd=cmd), station))
    bench.hear(ACK)
    bench.hear(poll(station), after=0.01)
    bench.hear(frame(reply(tns, answered, station=station, cmd=cmd | 0x40, sts=sts)))
    bench.hear(ACK)


READ_N7_0 = 'A2 08 07 89 00 00'  # four words
WRITE_N7_1 = 'AA 02 07 89 01 00 2A 00'
VALUES = '01 00 02 00 03 00 04 00'


def row(text: str = 'N7:0', length: int = 2, **cells: object) -> Mapping:
    return make_mapping(text, plc='SLC', length=length, period=500, **cells)  # type: ignore


def listening(**settings: int) -> tuple[ListeningBench, Mapping]:
    """Return a bench with a row of four words, and the row."""
    mapping = row(length=4)
    return ListeningBench([mapping], **settings), mapping


def point_of(bench: ListeningBench, mapping: Mapping) -> Freshness:
    return bench.driver.points[mapping].freshness(bench.now)


def test_row_is_filled_from_a_reply_that_has_more_words() -> None:
    whole, inside, longer = row(length=4), row('N7:2', 2), row('N7:3', 2)
    bench = ListeningBench([whole, inside, longer])
    exchange(bench, 7, READ_N7_0, VALUES)
    assert bench.values(whole) == [[1, 2, 3, 4]]
    assert bench.values(inside) == [[3, 4]]
    assert bench.values(longer) == []  # never from two replies
    exchange(bench, 8, 'A2 02 07 89 04 00', '05 00')
    assert bench.values(longer) == []
    assert point_of(bench, whole) is Freshness.FRESH
    assert bench.driver.points[whole].stale_time == 3 * 0.5  # no read of ours waits for the line


@for_all(('plc', 'text', 'cmd', 'asked', 'answered', 'values'), [
    ('SLC', 'N7:1', 0x0F, 'A1 04 07 89 01', '05 00 06 00', [5, 6]),
    ('SLC', 'F8:0', 0x0F, 'A2 08 08 8A 00 00', '00 00 80 3F 00 00 00 C0', [1.0, -2.0]),
    ('PLC5', 'N7:0', 0x0F, '68 00 00 02 00 06 07 00 02 00', '99 09 05 42 05 00 06 00', [5, 6]),
    # The same in a longer form of the descriptors, as some answer (M 7-29).
    ('PLC5', 'N7:0', 0x0F, '68 00 00 02 00 06 07 00 02 00', '9A 09 05 00 42 05 00 06 00', [5, 6]),
    ('PLC5', 'N7:0', 0x0F, '01 00 00 02 00 06 07 00 04', '05 00 06 00', [5, 6]),
    # A float's high word comes first there (M 13-17).
    ('PLC5', 'F8:0', 0x0F, '01 00 00 04 00 06 08 00 08', '80 3F 00 00 00 C0 00 00', [1.0, -2.0]),
    ('PLC5', 'N7:3', 0x0F, '01 01 00 03 00 00 24 4E 37 3A 32 00 04', '05 00 06 00', [5, 6]),
    ('PLC2', '020', 0x01, '20 00 04', '05 00 06 00', [5, 6])])
def test_reads_of_every_family(plc: str, text: str, cmd: int, asked: str, answered: str,
                               values: list[float]) -> None:
    mapping = make_mapping(text, plc=plc, length=2, period=500)
    bench = ListeningBench([mapping])
    exchange(bench, 3, asked, answered, cmd=cmd)
    assert bench.values(mapping) == [values]


def test_every_reply_of_long_traffic_fills_its_row() -> None:
    bench = ListeningBench([mapping := row(length=100)])
    for tns in range(42):
        exchange(bench, tns, 'A2 C8 07 89 00 00', 100 * '05 00 ')
    assert bench.values(mapping) == 42 * [100 * [5]]
    assert bench.driver.counters.chars_received == 10124


def test_two_ports_hear_full_duplex() -> None:
    mapping = row()
    bench = ListeningBench([mapping], has_two_ports=True)
    bench.hear(frame(command(7, READ_N7_0)))
    bench.hear(ACK, from_far=True)
    # The next command is under way before the reply to the first has come.
    first, second = frame(reply(7, VALUES)), frame(command(8, READ_N7_0))
    for at in range(max(len(first), len(second))):
        bench.hear(second[at:at + 1])
        bench.hear(first[at:at + 1], from_far=True)
    bench.hear(frame(reply(8, '09' + VALUES[2:])), from_far=True)
    assert bench.values(mapping) == [[1, 2], [9, 2]]


@pytest.mark.parametrize(('tns', 'before', 'values'), [
    (7, 5, []), (8, 5, [[99]]), (7, 0, [[99]])])  # the last is the same command once more
def test_on_two_ports_a_number_that_is_used_again_tells_nothing(
        tns: int, before: int, values: list[list[int]]) -> None:
    mapping = row('N7:0', 1)
    bench = ListeningBench([mapping], has_two_ports=True)
    # What is read after it may have been said before it: the reply is to the first command.
    bench.hear(frame(command(7, f'A2 02 07 89 0{before} 00')))
    bench.hear(frame(command(tns, 'A2 02 07 89 00 00')))
    bench.hear(frame(reply(tns, '63 00')), from_far=True)
    assert bench.values(mapping) == values


def test_numbers_that_tell_nothing_are_forgotten_with_their_commands() -> None:
    bench = ListeningBench([row()], has_two_ports=True)
    for tns in range(300):
        for asked in (READ_N7_0, 'A2 02 07 89 04 00'):
            bench.hear(frame(command(tns, asked)))
    assert bench.driver.overheard is not None
    assert 0 < len(bench.driver.overheard.ambiguous) <= 200


def test_reply_counts_only_with_its_command() -> None:
    bench, mapping = listening()
    asked, answered = frame(command(7, READ_N7_0), 1), frame(reply(7, VALUES))
    bench.hear(answered)  # the command was said before we listened
    bad = bytearray(asked)
    bad[8] ^= 1
    for number, said in enumerate((bytes(bad), frame(command(8, READ_N7_0), 1),
                                   frame(command(7, READ_N7_0, src=3), 1),
                                   frame(command(7, READ_N7_0, station=2), 2),
                                   frame(command(7, 'A2 06 07 89 00 00'), 1),
                                   frame(command(7, 'A2 08 09 89 00 00'), 1))):
        bench.hear(said)
        bench.hear(answered)
        assert bench.values(mapping) == [], number
    bench.hear(asked)
    bench.hear(answered)
    assert bench.values(mapping) == [[1, 2, 3, 4]]


@for_all('between', [
    b'\x10\x02\x01\x00\x0F\x00\x07\x00\xA2\x10\x03\x00\x00',  # a frame with a wrong check
    b'\xAA\x55\xAA', Damaged(b'A'), b'\x10\x02\x01\x05'])
def test_damage_between_command_and_reply_makes_it_unsure(between: bytes) -> None:
    bench, mapping = listening()
    # A master that never changes its number: what was damaged may have been another command.
    bench.hear(frame(command(7, READ_N7_0), 1))
    bench.hear(ACK)
    bench.hear(between)
    bench.hear(frame(reply(7, VALUES)), after=0.3)
    assert bench.values(mapping) == []
    bench.hear(frame(command(7, READ_N7_0), 1))
    bench.hear(b'\x00\x00')  # a glitch of a transmitter, which does no harm
    bench.hear(frame(reply(7, VALUES)))
    assert bench.values(mapping) == [[1, 2, 3, 4]]


def test_repeated_reply_does_not_renew_the_age() -> None:
    bench, mapping = listening()
    exchange(bench, 7, READ_N7_0, VALUES)
    for _ in range(20):  # the master has not acknowledged it
        bench.hear(poll(1), after=0.05)
        bench.hear(frame(reply(7, VALUES)), after=0.05)
    assert bench.values(mapping) == [[1, 2, 3, 4]]
    assert bench.driver.points[mapping].age(bench.now) == pytest.approx(2.0, abs=0.1)
    assert point_of(bench, mapping) is Freshness.STALE


def test_master_that_never_changes_its_number_is_heard() -> None:
    bench, mapping = listening()
    for _ in range(3):
        exchange(bench, 7, READ_N7_0, VALUES)
        exchange(bench, 7, 'A2 08 09 89 00 00', '09 00 09 00 09 00 09 00')
    assert bench.values(mapping) == 3 * [[1, 2, 3, 4]]


def test_reply_that_comes_too_late_or_to_a_port_that_was_lost_is_not_new() -> None:
    bench, mapping = listening(cmd_timeout=500)
    for tns, after in ((7, 0.6), (8, 0.1)):
        bench.hear(frame(command(tns, READ_N7_0), 1))
        if tns == 8:
            bench.machine.start(bench.now)
        bench.hear(frame(reply(tns, VALUES)), after=after)
    assert bench.values(mapping) == []


def test_overheard_write_makes_a_value_unknown_until_the_next_read() -> None:
    mapping, other = row(length=4), row('N7:2')
    bench = ListeningBench([mapping, other])
    exchange(bench, 7, READ_N7_0, VALUES)
    bench.hear(frame(command(8, READ_N7_0), 1))  # it may be executed before the write
    bench.hear(frame(command(9, WRITE_N7_1), 1))
    assert (point_of(bench, mapping), point_of(bench, other)) == (
        Freshness.FAILED, Freshness.FRESH)
    assert bench.driver.points[mapping].error == (
        'not read since station 0 has sent "protected typed logical write N7:1"')
    bench.hear(frame(reply(8, VALUES)))
    bench.hear(frame(reply(9, '')))
    assert len(bench.values(mapping)) == 1
    exchange(bench, 10, READ_N7_0, '01 00 2A 00 03 00 04 00')
    assert bench.values(mapping) == [[1, 2, 3, 4], [1, 42, 3, 4]]
    assert point_of(bench, mapping) is Freshness.FRESH
    bench.hear(frame(command(11, WRITE_N7_1), 1))  # it may be executed after the read
    exchange(bench, 12, READ_N7_0, VALUES)
    bench.hear(frame(reply(11, '')))
    assert point_of(bench, mapping) is Freshness.FAILED


@for_all(('station', 'asked', 'cmd'), [
    (255, WRITE_N7_1, 0x0F), (1, 'AA 02 07 85 01 00', 0x0F), (1, '80 07', 0x0F),
    (1, '02 00 2A 00', 0x08)])
def test_commands_that_may_have_changed_a_value(station: int, asked: str, cmd: int) -> None:
    bench, mapping = listening()
    exchange(bench, 7, READ_N7_0, VALUES)
    bench.hear(frame(command(8, asked, station=station, cmd=cmd), station))
    assert point_of(bench, mapping) is Freshness.FAILED


@pytest.mark.parametrize(('plc', 'text', 'cmd', 'asked', 'answered', 'sts'), [
    ('SLC', 'N7:0', 0x0F, READ_N7_0, '', 0x10),
    ('SLC', 'N7:0', 0x0F, READ_N7_0, VALUES + ' 00', 0),
    ('SLC', 'N9:0', 0x01, '00 00 04', '01 00 02 00', 0),  # S:2/8 decides which words these are
    ('SLC', 'N7:0', 0x0F, READ_N7_0, '', 0x02),  # a node on the way says that
    ('PLC5', 'N7:0', 0x0F, '68 00 00 02 00 06 07 00 02 00', '99', 0)])
def test_refused_read_and_reply_without_known_words_fill_nothing(
        plc: str, text: str, cmd: int, asked: str, answered: str, sts: int) -> None:
    mapping = make_mapping(text, plc=plc, length=2, period=500)
    bench = ListeningBench([mapping])
    exchange(bench, 7, asked, answered, cmd=cmd, sts=sts)
    assert bench.values(mapping) == []
    exchange(bench, 8, READ_N7_0, VALUES, station=2)  # of no row
    heard = int(sts != 0x02)
    assert (bench.driver.stations[1].replies, bench.driver.tasks.transactions) == (
        heard, heard + 1)


def test_rows_that_no_node_reads_are_named() -> None:
    read, partly, unread = row(length=4), row('N7:2', 4), row('N7:100')
    rare = make_mapping('N7:200', plc='SLC', period=10_000)  # named after 30 s
    bench = ListeningBench([read, partly, unread, rare])
    for tns in range(30):
        exchange(bench, tns, READ_N7_0, VALUES)
        bench.run(0.5)
    assert dict(bench.listener.reasons) == {
        'N7:2': 'no reply has all of its words; "protected typed logical read N7:0, 4 words" has '
        'a part of them', 'N7:100': 'no other node reads it'}
    assert len(bench.listener.reasons) == 2
    assert bench.driver.overheard is not None
    carried, = bench.driver.overheard.carried.values()
    assert (carried.station, carried.count, carried.text) == (
        1, 30, 'protected typed logical read N7:0, 4 words')


def test_the_200_reads_of_others_that_were_heard_last_are_kept() -> None:
    bench, _ = listening()
    for element in (*range(200), 0, 200):
        exchange(bench, element, f'A2 02 07 89 {element:02X} 00', '05 00')
    assert bench.driver.overheard is not None
    kept = [text.rpartition(' N7:')[2] for _, text in bench.driver.overheard.carried]
    assert sorted(kept) == sorted(f'{element}, 1 word' for element in (0, *range(2, 201)))


def test_run_holds_only_from_a_status_reply_that_was_heard() -> None:
    mapping = row(length=4, condition=While(('RUN',), 2000))
    bench = ListeningBench([mapping])
    exchange(bench, 7, READ_N7_0, VALUES)
    assert bench.values(mapping) == []
    exchange(bench, 6, '03', '00', cmd=0x06)  # no status
    for tns, mode in ((8, '11'), (9, '06'), (10, '06')):  # PROGRAM, then REMOTE RUN twice
        status = f'00 EE 34 49 25 {b"5/03       ".hex()} 00 00 {mode} 00 00 00 00 FC'
        bench.hear(frame(command(tns + 50, READ_N7_0), 1))  # perhaps executed before the status
        exchange(bench, tns, '03', status, cmd=0x06)
        bench.hear(frame(reply(tns + 50, VALUES)))
        assert len(bench.values(mapping)) == 2 * (tns == 10)
        exchange(bench, tns + 100, READ_N7_0, VALUES)
    assert len(bench.values(mapping)) == 3
    exchange(bench, 90, '00', status.replace('00 06', '00 11'), cmd=0x06)  # an echo
    identity = bench.driver.checks.known(1).identity
    assert identity is not None and identity.is_running
    for tns in range(200, 206):  # nobody asks any more
        bench.run(0.5)
        exchange(bench, tns, READ_N7_0, VALUES)
    assert len(bench.values(mapping)) in (6, 7)
    assert point_of(bench, mapping) is Freshness.WITHHELD


def test_counter_that_is_heard_to_change_guards_a_row() -> None:
    counter = row('N9:0', 1, tag='counter')
    mapping = row(length=4, condition=While(('counter',), 2000))
    bench = ListeningBench([counter, mapping, row('N9:1', 1)])
    for number in range(7):
        exchange(bench, number, 'A2 04 09 89 00 00', f'0{max(number, 3)} 00 0{number} 00')
        exchange(bench, 50 + number, READ_N7_0, VALUES)
        bench.run(0.5)
    assert (len(bench.values(counter)), len(bench.values(mapping))) == (7, 2)


def test_read_now_is_refused() -> None:
    mapping = row()
    bench = ListeningBench([mapping])
    answers: list[ReadAnswer] = []
    bench.driver.read_now(mapping, answers.append)
    assert [answer.error for answer in answers] == ['Mode Listen: nothing is sent']


def test_stations_come_and_go_as_they_are_heard() -> None:
    one, two = row(), row(station=2)
    bench = ListeningBench([one, two])
    for tns in range(25):
        exchange(bench, tns, READ_N7_0, VALUES)
        bench.hear(poll(2), after=0.5)
    assert bench.listener.changes == [(2, False)]
    bench.hear(poll(2))
    bench.hear(EOT)
    bench.driver.ended(PortLost('unplugged'))
    bench.now += 60.0
    bench.machine.start(bench.now)
    bench.run(9.0)  # the silence counts from the opening
    assert bench.listener.changes == [(2, False), (2, True)]


def test_what_lay_in_a_buffer_while_the_process_stood_still_is_dropped() -> None:
    bench, mapping = listening(cmd_timeout=9000)
    bench.hear(frame(command(7, READ_N7_0), 1))
    bench.now += 5.0
    bench.machine.handle_timeout(bench.now)
    bench.machine.receive_data(frame(reply(7, VALUES)), bench.now)
    for said in (frame(command(8, READ_N7_0), 1), frame(reply(8, VALUES))):
        bench.hear(said, after=0.05)
    assert bench.values(mapping) == []
    bench.run(0.3)
    bench.machine.is_behind = True  # a device may keep more than is read in the 0.5 s
    exchange(bench, 6, READ_N7_0, VALUES)
    bench.machine.is_behind = False
    bench.run(0.3)
    exchange(bench, 6, READ_N7_0, VALUES)
    assert bench.values(mapping) == []
    bench.run(0.6)
    bench.hear(frame(reply(7, VALUES)))  # of before the pause, in which a command may be lost
    exchange(bench, 9, READ_N7_0, '05' + VALUES[2:])
    assert bench.values(mapping) == [[5, 2, 3, 4]]


def test_what_comes_faster_than_the_line_brings_it_is_old_until_half_a_second_without() -> None:
    bench, mapping = listening()  # 9600 baud: 512 bytes in 0.53 s
    for tns, (pause, count, heard) in enumerate((
            (0.0, 40, 1), (1.0, 300, 2), (1.0, 512, 2), (0.02, 512, 2), (0.4, 310, 2),
            (0.4, 150, 2), (0.2, 40, 3), (1.0, 180, 4), (0.02, 180, 4))):  # two are too many
        bench.run(pause)
        bench.machine.came(count, bench.now)
        bench.hear(said := frame(command(tns, READ_N7_0), 1) + frame(reply(tns, VALUES)))
        assert len(bench.values(mapping)) == heard, pause
    assert bench.driver.counters.chars_received == 9 * len(said)
    bench.hear(frame(command(9, READ_N7_0), 1), after=1.0)
    bench.machine.came(512, bench.now)
    bench.hear(frame(reply(9, VALUES)), after=0.6)  # perhaps to a command that is lost
    assert len(bench.values(mapping)) == 4


def test_row_that_no_node_reads_is_named_after_each_opening() -> None:
    mapping, read = row('N7:100'), row(length=4)
    bench = ListeningBench([mapping, read])
    exchange(bench, 7, READ_N7_0, VALUES)
    for failures in (1, 4):
        bench.run(9.9)
        assert bench.driver.points[mapping].error != 'no other node reads it'
        bench.run(20.1)
        assert bench.driver.points[mapping].error == 'no other node reads it'
        assert bench.driver.points[mapping].failures == failures
        assert (bench.driver.points[read].error or '').endswith('reads it') is (failures == 4)
        bench.driver.ended(PortLost('unplugged'))
        assert bench.driver.points[mapping].error == 'port lost: unplugged'
        bench.machine.start(bench.now)


# What stands in an address of a command, by hand: letters of a file type, and words of an element.
SLC_TYPES = {0x84: ('S', 1), 0x85: ('B', 1), 0x89: ('N', 1), 0x8A: ('F', 2), 0x91: ('L', 2)}
PLC5_FILES = {3: 'B', 7: 'N'}


class Place(NamedTuple):
    """Words of a file of a station, each element of which has ``size`` of them."""

    station: int
    file: str
    element: int
    words: int
    size: int = 1

    def part(self, other: Place, data: bytes) -> bytes:
        """Return the words of this place from those of another, nothing if it has not all."""
        at = self.size * (self.element - other.element)
        is_inside = self[:2] == other[:2] and 0 <= at <= other.words - self.words
        return data[2 * at:][:2 * self.words] if is_inside else b''


def number(data: list[int]) -> int:
    """Take a number of one byte, or of two after FF."""
    first = data.pop(0)
    return first if first != 0xFF else data.pop(0) + 256 * data.pop(0)


def place_of(packet: bytes, plc: str) -> Place | None:
    """Return what a read asks for, None where this is not known here."""
    station, cmd, data = packet[0], packet[2], [*packet[6:]]
    function = data.pop(0) if cmd == 0x0F and data else None
    if plc == 'SLC' and function in (0xA1, 0xA2):
        bytes_, file, code = data.pop(0), number(data), data.pop(0)
        element, sub = number(data), number(data) if function == 0xA2 else 0
        letters, size = SLC_TYPES.get(code, ('', 1))
        return Place(station, f'{letters}{file}', element, bytes_ // 2, size) \
            if letters and not sub else None
    if plc == 'PLC5' and function in (0x01, 0x68) and data[4] == 6:  # file and element
        offset = data[0] + 256 * data[1]
        del data[:5]
        file, element = number(data), number(data)
        words = data[0] // 2 if function == 0x01 else data[0] + 256 * data[1]
        return Place(station, f'{PLC5_FILES[file]}{file}', element + offset, words) \
            if file in PLC5_FILES else None
    return None


def reads_of(capture: Capture) -> list[tuple[Place, bytes]]:
    """Return the reads that had a good reply, and their words: the end of the reply."""
    found = ((place_of(exchange.command.encode(), capture.family.value), exchange.reply)
             for exchange in capture.exchanges())
    return [(place, answer.data[-2 * place.words:]) for place, answer in found
            if place is not None and place.words and not answer.sts]


@pytest.mark.parametrize('capture', long_unless(
    lambda capture: CAPTURES.index(capture) % 3 == 1, zip(CAPTURES)), ids=lambda case: case.name)
def test_rows_have_what_recorded_programs_have_read(capture: Capture) -> None:
    reads = reads_of(capture)
    rows = {place: make_mapping(
        f'{place.file}:{place.element}', station=place.station, plc=capture.family.value,
        period=1000, length=place.words // place.size, item=item)
        for item, place in enumerate(dict(reads), 1)}
    is_radio = capture.name.startswith('radio')  # replies come after damage there, or too late
    is_full = not capture.name.endswith('half_duplex') and not is_radio
    bench = ListeningBench([*rows.values()], has_two_ports=is_full, check=capture.check.value)
    bench.play(capture.chunks)
    for place, mapping in rows.items():
        parts = [place.part(other, data) for other, data in reads]
        heard = bench.values(mapping)
        read = [[*mapping.codec.decode(part)] for part in parts if part]
        assert heard == read or is_radio and all(values in read for values in heard), place
    assert bench.listener.reads or not rows


@pytest.mark.parametrize(('asks', 'values'), [(False, [[1, 2, 3, 4]]), (True, [])])
def test_reply_to_the_number_of_a_gateway_counts_from_the_second_on(
        asks: bool, values: list[list[int]]) -> None:
    """M 6-4. A node that asks is not the gateway: these replies are for its own commands."""
    bench, mapping = listening()
    if asks:
        bench.hear(frame(command(3, 'A2 02 07 89 09 00', src=8)))
    for tns in (7, 8):
        bench.hear(frame(command(tns, READ_N7_0)))
        bench.hear(frame(reply(tns, VALUES, src=8)))
    assert bench.values(mapping) == values
