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

"""The words of Serve rows: what the other end reads and writes, and what is refused to it."""

from collections.abc import Sequence
from dataclasses import replace

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.refused import RefusedCommands
from abdf1_ros.driver.served import Served
from abdf1_ros.pccc import families
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench
from support.mappings import cell_of, load_rows, make_mapping

STATION = 5
FAMILIES = ('PLC5', 'SLC')
# What each family says of words that are not there, of a file that is not, and of nonsense.
BAD_WORDS = {'PLC5': (0xF0, b'\x07'), 'SLC': (0x50, b'')}
BAD_FILE = {'PLC5': (0xF0, b'\x06'), 'SLC': (0x10, b'')}
ILLEGAL = (0x10, b'')


def row(text: str, plc: str = 'PLC5', length: int = 1, kind: str | None = None,
        word_order: str = 'Low') -> Mapping:
    """Return a Serve row."""
    return make_mapping(text, 'Serve', station=STATION, plc=plc, length=length, kind=kind,
                        word_order=word_order)


class Bench:
    """Served rows, what the other end does to them, and what is published of it."""

    def __init__(self, plc: str, *mappings: Mapping) -> None:
        self.plc = PlcType(plc)
        self.published: list[tuple[Mapping, bytes]] = []
        self.served = Served(
            self.plc, Rows(mappings),
            lambda mapping, words: self.published.append((mapping, words)))
        self._dialect = dialect_of(self.plc)
        self._tns = 0

    def place(self, text: str) -> Address:
        return parse_address(text, self.plc)

    def ask(self, cmd: int, data: bytes) -> tuple[int, bytes]:
        """Return STS and data of the reply to any command."""
        self._tns += 1
        reply = self.served.serve(Packet(STATION, 1, cmd, 0, self._tns, data))
        assert (reply.dst, reply.src, reply.cmd, reply.tns) == (1, STATION, cmd | 0x40, self._tns)
        return reply.sts, reply.data

    def read(self, text: str, words: int = 1) -> bytes:
        """Return words that the other end reads."""
        place = self.place(text)
        sts, data = self.ask(*self._dialect.read(place, words))
        assert sts == 0, (sts, data)
        return self._dialect.read_data(place, words, data)

    def refused_read(self, text: str, words: int = 1) -> tuple[int, bytes]:
        """Return what the other end is told that reads what it must not."""
        return self.ask(*self._dialect.read(self.place(text), words))

    def write(self, text: str, *words: int) -> tuple[int, bytes]:
        """Let the other end write words; return STS and data."""
        data = b''.join(word.to_bytes(2, 'little') for word in words)
        return self.ask(*self._dialect.write(self.place(text), data))

    def write_bits(self, text: str, mask: int, bits: int) -> tuple[int, bytes]:
        """Let the other end write bits of a word; return STS and data."""
        return self.ask(*self._dialect.write_bits(self.place(text), mask, bits))

    def heard(self) -> list[tuple[str, list[int]]]:
        """Return, once, name and values of all that was published."""
        said = [(mapping.name, list(mapping.codec.decode(words)))
                for mapping, words in self.published]
        self.published.clear()
        return said


@pytest.mark.parametrize('plc', FAMILIES)
def test_what_the_other_end_writes_is_published(plc: str) -> None:
    mapping = row('N7:50', plc, 4)
    bench = Bench(plc, mapping)
    assert bench.read('N7:50', 4) == bytes(8)
    assert bench.write('N7:50', 11, 22, 33, 44) == (0, b'')
    assert bench.published == [(mapping, b'\x0b\0\x16\0\x21\0\x2c\0')]
    assert bench.read('N7:50', 4) == b'\x0b\0\x16\0\x21\0\x2c\0'
    assert len(bench.published) == 1


@pytest.mark.parametrize('plc', FAMILIES)
def test_part_of_a_mapping_publishes_all_of_it(plc: str) -> None:
    bench = Bench(plc, row('N7:50', plc, 4))
    bench.write('N7:51', 1, 2)
    assert bench.heard() == [('N7:50_5_Serve_4', [0, 1, 2, 0])]
    assert bench.read('N7:52') == b'\x02\0'


@for_all('plc', FAMILIES)
@for_all(('start', 'words', 'names'), [
    (10, 1, ['a']), (10, 4, ['a', 'b']), (12, 2, ['b']), (13, 3, ['b', 'c']), (14, 2, ['c']),
    (14, 1, []), (10, 6, ['a', 'b', 'c']), (16, 1, [])])
def test_exactly_the_mappings_that_overlap_are_published(plc: str, start: int, words: int,
                                                         names: list[str]) -> None:
    rows = [
        make_mapping(text, command, station=STATION, plc=plc, length=length, tag=tag)
        for text, command, length, tag in (
            ('N7:10', 'Serve', 2, 'a'), ('N7:12', 'Serve', 2, 'b'), ('N7:15', 'Serve', 1, 'c'),
            ('N7:14', 'Serve', 1, 'gap'), ('N7:16', 'Serve', 1, 'd'), ('N9:10', 'Serve', 9, 'x'),
            ('N7:10', 'Read', 9, 'read'), ('B3:10', 'Serve', 9, 'y'))]
    bench = Bench(plc, *rows)
    bench.write(f'N7:{start}', *[1] * words)
    said = [name for name, _ in bench.heard()]
    assert said == [name for name in ('a', 'b', 'c', 'gap', 'd') if name in {
        'gap': names + ['gap'] if start <= 14 < start + words else names,
        'd': names + ['d'] if start == 16 else names}.get(name, names)]


@pytest.mark.parametrize('plc', FAMILIES)
def test_words_between_and_beside_the_mappings_are_not_there(plc: str) -> None:
    bench = Bench(plc, row('N7:2', plc, 2), row('N7:6', plc, 2))
    for text, words in (('N7:0', 1), ('N7:1', 2), ('N7:3', 2), ('N7:4', 1), ('N7:5', 2),
                        ('N7:2', 6), ('N7:7', 2), ('N7:8', 1), ('N7:200', 1)):
        assert bench.refused_read(text, words) == BAD_WORDS[plc]
        assert bench.write(text, *[7] * words) == BAD_WORDS[plc]
    assert bench.published == []
    assert bench.read('N7:2', 2) + bench.read('N7:6', 2) == bytes(8)


@for_all('plc', FAMILIES)
@for_all('text', ['N9:0', 'B3:0', 'T4:0', 'F8:0', 'S:0'])
def test_files_without_a_mapping_are_not_there(plc: str, text: str) -> None:
    bench = Bench(plc, row('N7:0', plc, 2))
    words = 2 if text == 'F8:0' else 3 if text == 'T4:0' else 1
    assert bench.refused_read(text, words) == BAD_FILE[plc]
    assert bench.write_bits(text, 1, 1)[0] != 0
    assert bench.published == []


@pytest.mark.parametrize('plc', FAMILIES)
def test_without_rows_only_diagnostics_are_served(plc: str) -> None:
    bench = Bench(plc)
    assert bench.refused_read('N7:0') == BAD_FILE[plc]
    assert bench.ask(0x06, b'\0hello') == (0, b'hello')
    assert bench.ask(0x06, b'\3') == (0, families.FAMILIES[PlcType(plc)].encode_identity(
        EmulatedProcessor()))


@for_all('plc', FAMILIES)
@for_all(('cmd', 'data'), [
    (0x0F, b''), (0x0F, b'\x80\x06'), (0x0F, b'\x3A\x06'), (0x0F, b'\x03'), (0x07, b'\0\1'),
    (0x03, b'\x11\0\2'), (0x06, b'\x07'), (0x06, b''), (0x2F, b'\xA2'),
    (0x0A, b'racom'), (0x0B, b'racom'), (0x3F, bytes(200))])
def test_other_commands_are_illegal(plc: str, cmd: int, data: bytes) -> None:
    bench = Bench(plc, row('N7:0', plc, 2))
    assert bench.ask(cmd, data) == ILLEGAL
    assert bench.published == []


@pytest.mark.parametrize(('plc', 'text', 'next_text', 'beyond'), [
    ('PLC2', '050', '052', '054'), ('PLC3', 'N7:50', 'N7:52', 'N7:54'),
    ('PLC3', 'E3.1.8.10.0.5', 'B10:7', 'B10:9')])
def test_words_of_a_plc2_and_a_plc3(plc: str, text: str, next_text: str, beyond: str) -> None:
    mapping = row(text, plc, 4)
    bench = Bench(plc, mapping)
    bench.served.store(mapping, [1, 2, 3, 4])
    assert bench.read(text, 4) == b'\1\0\2\0\3\0\4\0'
    assert bench.write(next_text, 0x1010) == (0, b'')
    assert bench.heard() == [(mapping.name, [1, 2, 0x1010, 4])]
    assert bench.write_bits(text, 0x8001, 0x8000) == (0, b'')
    assert bench.published == [(mapping, b'\0\x80\2\0\x10\x10\4\0')]
    missing, past_end = {'PLC2': ((0x50, b''), (0x50, b'')),
                         'PLC3': ((0xF0, b'\x06'), (0xF0, b'\x07'))}[plc]
    assert bench.refused_read(beyond) == missing
    assert bench.write(next_text, 1, 2, 3) == past_end


def test_bits_of_a_plc2() -> None:
    mapping = row('050/07', 'PLC2', 4)
    bench = Bench('PLC2', mapping)
    bench.served.store(mapping, [1, 0, 1, 1])
    assert bench.read('050') == b'\x80\x06'
    assert bench.write_bits('050', 0x0100, 0x0100) == (0, b'')
    assert bench.heard() == [(mapping.name, [1, 1, 1, 1])]


@pytest.mark.parametrize(('plc', 'file', 'place'), [
    ('PLC5', 'N7:0', b'\2\0'), ('SLC', 'N9:0', b'\1\0')])  # a byte address, and a word's
def test_plc2_commands_reach_the_compatibility_file(plc: str, file: str, place: bytes) -> None:
    published: list[bytes] = []
    served = Served(PlcType(plc), Rows([row(file, plc, 4)]),
                    lambda mapping, words: published.append(words))
    reply = served.serve(Packet(STATION, 7, 0x08, 0, 1, place + b'\x34\x12'))
    assert (reply.sts, published) == (0, [b'\0\0\x34\x12\0\0\0\0'])


@pytest.mark.parametrize('plc', FAMILIES)
def test_what_ros_stores_is_read(plc: str) -> None:
    integers, floats = row('N7:50', plc, 3), row('F8:0', plc, 2)
    bench = Bench(plc, integers, floats)
    bench.served.store(integers, [-1, 0x1002, 3])
    bench.served.store(floats, [1.5, -2.0])
    assert bench.read('N7:50', 3) == b'\xff\xff\x02\x10\3\0'
    assert bench.read('F8:0', 4) == b'\0\0\xc0\x3f\0\0\0\xc0'
    assert bench.served.words_of(integers) == b'\xff\xff\x02\x10\3\0'
    assert bench.published == []  # what we have said ourselves is no news


@pytest.mark.parametrize('plc', FAMILIES)
def test_member_of_a_structure(plc: str) -> None:
    mapping = row('T4:1.ACC', plc)
    bench = Bench(plc, mapping)
    bench.served.store(mapping, [77])
    assert bench.read('T4:1.ACC') == b'\x4d\0'
    assert bench.write('T4:1.ACC', 78) == (0, b'')
    assert bench.heard() == [('T4:1.ACC_5_Serve_1', [78])]
    assert bench.refused_read('T4:1.PRE') == BAD_WORDS[plc]
    assert bench.refused_read('T4:0.ACC') == BAD_WORDS[plc]


@pytest.mark.parametrize(('plc', 'access'), [
    ('SLC', 'Slot'), ('PLC5', 'Typed'), ('PLC5', 'WordRange')])
def test_whole_element_of_which_a_word_is_served(plc: str, access: str) -> None:
    mapping = row('T4:1.ACC', plc)
    bench, place = Bench(plc, mapping), parse_address('T4:1', PlcType(plc))
    bench.served.store(mapping, [77])
    dialect = dialect_of(PlcType(plc), Access(access))

    def element() -> bytes:
        sts, data = bench.ask(*dialect.read(place, 3))
        assert sts == 0
        return dialect.read_data(place, 3, data)

    assert element() == b'\0\0\0\0\x4d\0'
    if access != 'Typed':  # a typed write of a timer has two words more
        assert bench.ask(*dialect.write(place, b'\0\x20\5\0\6\0')) == (0, b'')
        assert bench.heard() == [(mapping.name, [6])]
        assert element() == b'\0\x20\5\0\6\0'
    assert bench.ask(*dialect.read(parse_address('T4:0', PlcType(plc)), 6))[0] != 0
    assert bench.ask(*dialect.read(parse_address('T4:2', PlcType(plc)), 3))[0] != 0


@pytest.mark.parametrize(('text', 'words'), [('T4:0.PRE', 3), ('T4:0', 5), ('T4:1', 9)])
def test_words_that_are_no_whole_elements_are_all_mapped_or_refused(text: str, words: int) -> None:
    bench = Bench('SLC', *(
        row(address, 'SLC') for address in ('T4:0.ACC', 'T4:1.PRE', 'T4:3.PRE')))
    dialect = dialect_of(PlcType.SLC)
    assert bench.ask(*dialect.read(parse_address(text, PlcType.SLC), words))[0] != 0
    assert bench.ask(*dialect.read(parse_address('T4:0', PlcType.SLC), 6))[0] == 0


@pytest.mark.parametrize('plc', FAMILIES)
def test_bits_leave_the_others_of_their_word(plc: str) -> None:
    low, high = row('B3:5/2', plc, 3), row('B3:5/8', plc, 10)
    bench = Bench(plc, low, high)
    bench.served.store(low, [1, 0, 1])
    bench.served.store(high, [1, 1, 0, 0, 0, 0, 0, 1, 0, 1])
    assert bench.read('B3:5', 2) == bytes((0b00010100, 0b10000011, 0b10, 0))
    bench.served.store(low, [0, 1, 0])
    assert bench.read('B3:5', 2) == bytes((0b00001000, 0b10000011, 0b10, 0))
    assert bench.published == []


@pytest.mark.parametrize('plc', FAMILIES)
def test_bits_that_the_other_end_writes(plc: str) -> None:
    low, high, next_word = row('B3:5/2', plc, 3), row('B3:5/8', plc, 10), row('B3:7', plc)
    bench = Bench(plc, low, high, next_word)
    assert bench.write_bits('B3:5', 0x0004, 0x0004) == (0, b'')
    # Both rows have bits in that word.
    assert bench.heard() == [('B3:5/2_5_Serve_3', [1, 0, 0]), ('B3:5/8_5_Serve_10', [0] * 10)]
    assert bench.write_bits('B3:6', 0x0003, 0x0003) == (0, b'')
    assert bench.heard() == [('B3:5/8_5_Serve_10', [0] * 8 + [1, 1])]
    assert bench.write_bits('B3:8', 1, 1) == BAD_WORDS[plc]
    assert bench.write_bits('B3:4', 1, 1) == BAD_WORDS[plc]
    assert bench.heard() == []


def test_command_for_several_words_is_published_once_and_all_or_nothing() -> None:
    slc = Bench('SLC', row('B3:0', 'SLC', 2))
    assert slc.ask(0x0F, bytes.fromhex('AB 04 03 85 00 00 0F 00 FF 00 FF 00')) == (0, b'')
    assert slc.heard() == [('B3:0_5_Serve_2', [0x0F, 0x0F])]
    assert slc.ask(0x0F, bytes.fromhex('AB 04 03 85 01 00 0F 00 00 00 00 00')) == BAD_WORDS['SLC']
    assert slc.heard() == []
    plc5 = Bench('PLC5', row('B3:0', length=2), row('B3:1'))
    sets = '07 00 03 {:02X} FF FF 01 00'
    both = bytes.fromhex('26' + sets.format(0) + sets.format(1))
    assert plc5.ask(0x0F, both) == (0, b'')
    assert plc5.heard() == [('B3:0_5_Serve_2', [1, 1]), ('B3:1_5_Serve_1', [1])]
    beyond = bytes.fromhex('26' + sets.format(1) + sets.format(2))
    assert plc5.ask(0x0F, beyond) == BAD_WORDS['PLC5']
    assert plc5.heard() == []
    guarded = Bench('PLC5', row('B3:0'), replace(row('B3:1'), is_read_only=True))
    assert guarded.ask(0x0F, both[:9] + both[1:]) == PROTECTED['PLC5']  # B3:0 twice, then B3:1
    assert (guarded.read('B3:0', 2), guarded.heard()) == (bytes(4), [])


def test_new_files_keep_the_words_of_their_rows() -> None:
    before = Bench('SLC', row('N7:50', 'SLC', 4), row('B3:5/0', 'SLC', 8), row('N9:0', 'SLC'))
    before.write('N7:50', 5, 6, 0x107, 8)
    before.write('B3:5', 0x8081)
    after = Bench('SLC', row('N7:52', 'SLC', 3), row('B3:5/4', 'SLC', 20), row('B3:5/0', 'SLC'))
    after.served.take_over(before.served)
    assert after.read('N7:52', 3) + after.read('B3:5') == b'\7\1\x08\0\0\0\x81\0'


def test_refused_command_is_undone_in_each_of_its_words() -> None:
    bench = Bench('SLC', words := row('B3:0', 'SLC', 3))
    bench.served.store(words, [1, 2, 3])
    table = bench.served.table
    table.write(bench.place('B3:0'), bytes.fromhex('04 00 05 00 06 00'))
    table.take_back()
    assert bench.read('B3:0', 3) == bytes.fromhex('01 00 02 00 03 00')
    assert bench.heard() == []


def test_rows_of_the_same_words_are_all_published() -> None:
    word, bits = row('N7:0'), row('N7:0/4', length=2)
    bench = Bench('PLC5', word, bits)
    bench.write('N7:0', 0x10)
    assert bench.heard() == [(word.name, [0x10]), (bits.name, [1, 0])]


@given(cmd=st.sampled_from((0x0F, 0x06, 0x2F, 0x01)), data=st.binary(max_size=60),
       plc=st.sampled_from(FAMILIES))
def test_any_bytes_are_answered(cmd: int, data: bytes, plc: str) -> None:
    sts, _ = Bench(plc, row('N7:0', plc, 20)).ask(cmd, data)
    assert sts in (0, 0x10, 0x50, 0xF0)


PROTECTED = {'PLC5': (0xF0, b'\x0B'), 'SLC': (0x50, b''), 'PLC3': (0xF0, b'\x1E'),
             'PLC2': (0x50, b'')}


@for_all('plc', PROTECTED)
def test_row_that_the_other_end_may_only_read(plc: str) -> None:
    first, second, third = [f'02{n}' if plc == 'PLC2' else f'N7:{n}' for n in range(3)]
    mine, other = (replace(row(text, plc), is_read_only=True) for text in (first, third))
    bench = Bench(plc, mine, row(second, plc), other)
    bench.served.store(mine, [5])
    assert bench.write(first, 9) == PROTECTED[plc]
    assert bench.write_bits(first, 0xFFFF, 1) == PROTECTED[plc]
    # All or nothing, in either order.
    assert bench.write(first, 9, 9) == PROTECTED[plc]
    assert bench.read(first, 2) == b'\5\0\0\0'
    assert bench.heard() == []
    assert bench.write(second, 7) == (0, b'')
    assert bench.heard() == [(row(second, plc).name, [7])]
    bench.served.store(mine, [6])
    assert bench.read(first, 2) == b'\6\0\7\0'
    inputs = Bench('PLC5', replace(row('I:000'), is_read_only=True))  # station 1 has file 1
    assert inputs.ask(0x08, bytes(4)) == (0x50, b'')


def test_access_of_a_serve_row() -> None:
    mappings, problems = loaded(
        'a,Serve,N7:50,5,PLC5,4,,,,,,,,,,read', 'b,Serve,N7:60,5,PLC5,4,,,,,,',
        'c,Serve,N7:70,5,PLC5,4,,,,,,,,,,Typed', 'd,Read,N7:0,1,PLC5,4,,,,,,,,,,Read')
    assert [mapping.is_read_only for mapping in mappings] == [True, False]
    assert [cell_of(mapping, 'Access') for mapping in mappings] == ['Read', 'Typed']
    assert problems == [
        'Item: 3, Access = "Typed" of a Serve row should be Read, for words that the other end '
        'cannot write, or empty',
        'Item: 4, Access = "Read" of a PLC5 should be one of Typed, WordRange']


def loaded(*rows: str) -> tuple[Sequence[Mapping], list[str]]:
    """Return the mappings of a file, and the texts of its problems."""
    mappings, problems = load_rows(*rows)
    return mappings, [problem.text for problem in problems]


def test_serve_row_of_a_file() -> None:
    (mapping,), problems = loaded('pushed,Serve,N7:50,5,PLC5,4,,,,,,')
    assert problems == []
    assert (mapping.serves, mapping.polls, mapping.reads, mapping.writes) == (
        True, False, True, True)
    assert (mapping.topic, mapping.period) == ('pushed', None)
    assert cell_of(mapping, 'Command') == 'Serve'


def test_topic_of_a_serve_row_has_no_other_reader_and_writers_of_its_length_only() -> None:
    _, problems = loaded('a,Serve,N7:50,5,PLC5,4,,x,,,,', 'b,Read,N7:0,1,PLC5,4,,x,,,,')
    assert problems == ['Item: 2, read topic "x" is the topic of item 1 (line 2, tag "a")']
    _, problems = loaded('a,Serve,N7:50,5,PLC5,4,,x,,,,', 'b,Write,N7:0,1,PLC5,3,,x,,,,')
    assert problems == [
        'Item: 2, write topic "x" needs the message type (int16) and Length (4) of item 1 '
        '(line 2, tag "a")']
    _, problems = loaded('a,Serve,N7:50,5,PLC5,4,,x,,,,', 'b,Write,N7:0,1,PLC5,4,,x,,,,')
    assert problems == []


def write(element: int, value: int = 1, src: int = 1) -> Packet:
    """Return a typed write of one word to N7."""
    return Packet(5, src, 0x0F, 0, 1, bytes((0xAA, 2, 7, 0x89, element, 0, value, 0)))


def test_other_values_and_later_times_are_the_same_command() -> None:
    refused = RefusedCommands(PlcType.SLC)
    for now in range(3):
        refused.add(write(0, now), write(0).reply(sts=0x10), float(now))
    refused.add(write(0), write(0).reply(), 3.0)  # is not refused
    (text, count), = refused.counted().items()
    assert (text.startswith('station 1: '), ' N7:0: STS 10: ' in text, count) == (True, True, 3)
    assert refused.lately(61.9) == [text]
    assert refused.lately(62.0) == []


def test_flood_of_different_commands_is_bounded() -> None:
    refused = RefusedCommands(PlcType.PLC5)
    for now, elements in ((0.0, range(200)), (5.0, [0]), (62.0, [99])):
        for element in elements:
            refused.add(write(element), write(element).reply(b'\x06', 0xF0), now)
        assert len(refused.counted()) == 8
    assert [*refused.counted().values()] == [*6 * [1], 2, 1]
    assert 'STS F0 EXT STS 06' in refused.lately(0.0)[0]
    assert [text.split(':')[2] for text in refused.lately(62.0)] == ['0', '99']


def test_driver_keeps_what_it_refuses() -> None:
    bench = DriverBench([make_mapping('N7:0', 'Serve', station=5, plc='SLC')],
                        network=Network(plc_type='SLC'))
    assert [bench.driver.serve(write(element)).sts for element in (0, 9)] == [0, 0x50]
    text, = bench.driver.refused.counted()
    assert ' N7:9: STS 50: ' in text
