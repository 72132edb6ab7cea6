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

"""An SLC or MicroLogix: commands, byte for byte, requests, files, and an emulated one."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc.commands import (
    LogicalAddress,
    LogicalRead,
    LogicalWrite,
    MaskedWrite,
)
from abdf1_ros.pccc.slc.dialect import SlcDialect
from abdf1_ros.pccc.slc.file_search import SlcFileSearch
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at
from support.vectors import ML1400

Command = LogicalRead | LogicalWrite | MaskedWrite
_Found = TypeVar('_Found')

READERS: dict[int, Callable[[Reader], Command]] = {
    0xA1: partial(LogicalRead.read, is_short=True), 0xA2: LogicalRead.read,
    0xA9: partial(LogicalWrite.read, is_short=True), 0xAA: LogicalWrite.read,
    0xAB: MaskedWrite.read}

SLC = PlcType.SLC
DIALECT = SlcDialect()


@for_all(('command', 'encoded'), [
    (LogicalRead(LogicalAddress(7, 0x89, 0, 0), 20), 'A2 14 07 89 00 00'),
    (LogicalRead(LogicalAddress(10, 0x89, 300, 0), 2), 'A2 02 0A 89 FF 2C 01 00'),
    (LogicalRead(LogicalAddress(255, 0x89, 254, 255), 255), 'A2 FF FF FF 00 89 FE FF FF 00'),
    (LogicalRead(LogicalAddress(7, 0x89, 1, None), 2), 'A1 02 07 89 01'),
    (LogicalWrite(LogicalAddress(7, 0x89, 300, None), b'\x09\x00'),
     'A9 02 07 89 FF 2C 01 09 00'),
    (LogicalWrite(LogicalAddress(4, 0x86, 0, 1), b'\x2C\x01'), 'AA 02 04 86 00 01 2C 01'),
    (MaskedWrite(LogicalAddress(3, 0x85, 4, 0), 0x0108, b'\x00\x01'),
     'AB 02 03 85 04 00 08 01 00 01')])
def test_encode_and_read(command: Command, encoded: str) -> None:
    data = bytes.fromhex(encoded)
    assert command.encode() == data
    reader = Reader(data[1:])
    assert READERS[data[0]](reader) == command
    assert reader.is_empty


@pytest.mark.parametrize(('fnc', 'encoded'), [
    (0xA2, '02 07 89 00 00'), (0xAA, '02 07 89 00 00 01 02'),
    (0xAB, '02 07 89 00 00 08 00 08 00')])
def test_padding_behind_the_declared_size_is_passed_over(fnc: int, encoded: str) -> None:
    padded = READERS[fnc](Reader(bytes.fromhex(encoded + ' 00 00')))
    assert padded == READERS[fnc](Reader(bytes.fromhex(encoded)))


def at(text: str) -> Address:
    return parse_address(text, SLC)


@for_all(('letters', 'read', 'write'), [
    ('N', 118, 117), ('B', 118, 117), ('F', 118, 116), ('T', 117, 117), ('C', 117, 117),
    ('ST', 84, 84), ('PD', 115, 115), ('MG', 100, 100)])
def test_limits_are_whole_elements(letters: str, read: int, write: int) -> None:
    kind = FileType(letters)
    assert (DIALECT.max_read(kind), DIALECT.max_write(kind)) == (read, write)


@for_all(('name', 'read', 'write'), [
    ('5/01', 82, 82), ('5/02', 82, 82), ('ML1000', 82, 82), ('5/03', 236, 234),
    ('5/04', 236, 234), ('5/05', 236, 234), ('ML1100', 206, 206), ('ML1200', 206, 206),
    ('ML1400', 206, 206), ('ML1500', 206, 206)])
def test_packets_are_as_long_as_the_processor_takes_them(name: str, read: int, write: int) -> None:
    dialect = SlcDialect(Processor(name))
    assert 2 * dialect.max_read(FileType.INTEGER) == read
    assert 2 * dialect.max_write(FileType.INTEGER) == write
    assert dialect.max_read(FileType.TIMER) == read // 6 * 3
    assert dialect.max_write(FileType.PID) == write // 46 * 23


ALL_SLC = ('O:2.0', 2), ('I:1.0', 1), ('I:3.0', 4), ('S:0', 33), ('N12:0', 90), ('ST20:0', 84)


def steps_of(processor: Processor) -> Steps[list[DataFile]]:
    steps = SlcFileSearch().directory(processor)
    assert steps is not None
    return steps


def carried_out(steps: Steps[_Found], answer: Callable[[bytes], Packet]) -> _Found:
    """Answer each command."""
    request = next(steps)
    for _ in range(40):
        try:
            request = steps.send(answer(request[1]))
        except StopIteration as done:
            found: _Found = done.value
            return found
    raise AssertionError('the steps do not end')


def served(*places: tuple[str, int]) -> Callable[[bytes], Packet]:
    """Return what a server answers that has these words."""
    table = DataTable(PlcType.SLC)
    for text, words in places:
        table.create(parse_address(text, PlcType.SLC), words)
    server = Server(table)
    return lambda data: server.serve(Packet(1, 0, 0x0F, 0, 7, data))


def test_files_of_a_recorded_micrologix_1400() -> None:
    replies = {exchange.command.data: exchange.reply for exchange in ML1400}
    files = carried_out(steps_of(Processor.ML1400), replies.__getitem__)
    assert {str(entry): entry.elements for entry in files} == {
        'O0': 6, 'I1': 8, 'S2': 66, 'B3': 1, 'T4': 1, 'C5': 1, 'R6': 1, 'N7': 1, 'F8': 1,
        'HSC': 6, 'PTO': 3, 'PWM': 3, 'STI': 1, 'EII': 8}
    assert [entry.number for entry in files if entry.type.is_function] == [*range(5)]


def test_files_of_an_emulated_slc() -> None:
    answer = served(*ALL_SLC[:3], ('PTO:0', 15), *ALL_SLC[3:])
    # Type 1 at byte 69, the length after it, first file at 79: so pycomm3 reads that of a 5/05.
    for request in ('A1 0E 00 01 22', 'A2 0E 00 01 00 22', 'A2 0E 00 01 21 01'):
        assert answer(bytes.fromhex(request)).data == bytes.fromhex(
            '00 01 21 01 00 00 00 00 00 00 00 82 04 00')
    assert answer(bytes.fromhex('A1 50 00 01 80')).sts == 0x50  # it ends before
    files = carried_out(steps_of(Processor.SLC_5_03), answer)
    assert {str(entry): entry.elements for entry in files} == {
        'O0': 2, 'I1': 5, 'S2': 33, 'N12': 90, 'ST20': 2}
    files = carried_out(steps_of(Processor.SLC_5_03), served(('B3:0', 4)))
    assert files == [DataFile(FileType.BINARY, 3, 4)]


def test_files_that_reads_find() -> None:
    """Files 0 to 2 have fixed types; a file has at most 256 elements (M 13-13)."""
    answer = served(('I:7.0', 1), ('S:0', 33), ('N3:0', 2), ('N7:0', 256), ('B8:0', 255),
                    *((f'{kind}{number}:0', 84) for number, kind in enumerate(
                        ('F', 'T', 'C', 'R', 'L', 'ST', 'A', 'D', 'PD', 'MG'), 9)))
    found = [carried_out(SlcFileSearch().look_for(number), answer) for number in range(20)]
    assert [(str(entry), entry.elements) for entry in found if entry] == [
        ('I1', 0), ('S2', 33), ('N3', 2), ('N7', 256), ('B8', 255), ('F9', 42), ('T10', 28),
        ('C11', 28), ('R12', 28), ('L13', 42), ('ST14', 2), ('A15', 84), ('D16', 84),
        ('PD17', 4), ('MG18', 4)]


@for_all(('code', 'own_row', 'names'), [
    (1, 69, ('5/03', '5/04', '5/05')), (2, 103, ('ML1100', 'ML1200', 'ML1500'))])
def test_place_of_the_directory(code: int, own_row: int, names: tuple[str, ...]) -> None:
    """Type and place as pycomm3 reads them on a 5/05 and a MicroLogix 1100."""
    rows = f'{code:02X} {own_row + 30:02X}00 {14 * "0"} 82 0600 {14 * "0"} 83 {18 * "0"}'
    data = bytes(own_row) + bytes.fromhex(rows)
    for name in names:
        files = carried_out(steps_of(Processor(name)), lambda request: Packet(
            0, 1, 0x4F, 0, 7, data[2 * request[-1]:].ljust(80, b'\0')[:request[1]]
            if request[3] == code else b''))
        assert [(str(entry), entry.elements) for entry in files] == [('O0', 3)]


@for_all('processor', [None, *(Processor(name) for name in ('5/01', '5/02', 'ML1000'))])
def test_processors_without_a_known_directory(processor: Processor | None) -> None:
    assert SlcFileSearch().directory(processor) is None


@given(st.sampled_from([Processor.ML1400, Processor.SLC_5_05, Processor.ML1100]),
       st.lists(st.binary(max_size=90), min_size=1, max_size=8))
def test_strange_replies_are_files_or_a_format_error(processor: Processor,
                                                     parts: list[bytes]) -> None:
    steps = steps_of(processor)
    request = next(steps)
    for data in parts:
        size = request[1][1]
        try:
            request = steps.send(Packet(0, 1, 0x4F, 0, 7, data.ljust(size, b'\3')[:size]))
        except FormatError:
            return
        except StopIteration as done:
            assert all(isinstance(entry, DataFile) for entry in done.value)
            return


@for_all(('sts', 'data', 'error'), [
    (0x10, b'', RemoteError), (0, bytes(69) + b'\1\x59' + bytes(7), FormatError),
    *((0, bytes(69) + size.ljust(11, b'\0'), FormatError) for size in (b'\1\1\x20', b'\1\x45\0'))])
def test_directory_that_is_refused_or_odd(sts: int, data: bytes, error: type[Exception]) -> None:
    steps = steps_of(Processor.SLC_5_03)
    next(steps)
    with pytest.raises(error):
        steps.send(Packet(0, 1, 0x4F, sts, 7, data))


@for_all(('data', 'sts'), [
    ('A2 02 09 89 00 00', 0x10), ('A2 02 07 85 00 00', 0x10), ('A2 02 07 7F 00 00', 0x10),
    ('A2 02 07 89 04 00', 0x50), ('A2 0A 07 89 00 00', 0x50), ('A2 00 07 89 00 00', 0x10),
    ('A2 03 07 89 00 00', 0x10), ('A2 EE 07 89 00 00', 0x10), ('AA 00 07 89 00 00', 0x10),
    ('AA 01 07 89 00 00 01', 0x10), ('AA 04 07 89 03 00 01 00 02 00', 0x50),
    ('AA EC 07 89 00 00' + ' 00' * 236, 0x10), ('AB 00 07 89 00 00 FF FF', 0x10),
    ('AB 04 07 89 03 00 FF FF 01 00 02 00', 0x50), ('AB 02 09 89 00 00 FF FF 01 00', 0x10),
    ('A1 02 09 89 00', 0x10), ('A1 02 07 89 04', 0x50), ('A1 02 07 89 00 01', 0x10),
    ('A9 02 07 89 04 01 00', 0x50), ('A9 04 07 89 03 01 00 02 00', 0x50),
    ('A2 02 00 82 00 00', 0x50), ('A2 02 01 82 00 00', 0x10), ('A2 02 07 83 00 00', 0x10),
    # Sizes that do not add up.
    *((data, 0x10) for data in (
        'A1 02 07 89', 'A9 02 07 89 00 01', 'A9 02 07 89 00 01 02 03', 'A2', 'A2 02 07 89 00',
        'A2 02 07 89 00 00 01', 'A2 02 07 89 FF 2C', 'AA 02 07 89 00 00', 'AA 02 07 89 00 00 01',
        'AA 02 07 89 00 00 01 02 03', 'AB 02 07 89 00 00 08 00 08',
        'AB 04 07 89 00 00 08 00 08 00', 'AB 02 07 89 00 00 08'))])
def test_command_that_an_slc_refuses_changes_nothing(data: str, sts: int) -> None:
    words = table(SLC, N7_0='00 00' * 4)
    assert ask(words, data) == (sts, '')
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_commands_of_two_fields_begin_at_the_first_word() -> None:
    words = table(SLC, T4_0=counting(9))
    assert ask(words, 'A1 06 04 86 01') == (0, '03 00 04 00 05 00')
    assert ask(words, 'A9 02 04 86 02 FF 00') == (0, '')
    assert words_at(words, 'T4:2', 3) == 'FF 00 07 00 08 00'


def test_flat_image_is_slot_after_slot() -> None:
    words = table(SLC, I_3_0='31 00', I_1_0='11 00 12 00', O_2_0='22 00', I_10_0='A1 00')
    assert ask(words, 'A2 08 01 83 00 00') == (0, '11 00 12 00 31 00 A1 00')
    assert ask(words, 'A2 02 01 83 02 00') == (0, '31 00')
    assert ask(words, 'A2 02 01 83 01 01') == (0, '31 00')
    assert ask(words, 'A1 02 00 82 00') == (0, '22 00')
    assert ask(words, 'A2 04 01 83 03 00') == (0x50, '')


def test_flat_image_is_written_across_slots_or_not_at_all() -> None:
    words = table(SLC, O_0_0='00 00', O_5_0='00 00')
    assert ask(words, 'AA 04 00 82 00 00 01 00 02 00') == (0, '')
    assert (words_at(words, 'O:0'), words_at(words, 'O:5')) == ('01 00', '02 00')
    assert ask(words, 'AB 04 00 82 00 00 0F 00 FF 00 F0 00') == (0, '')
    assert (words_at(words, 'O:0'), words_at(words, 'O:5')) == ('0F 00', '00 00')
    assert ask(words, 'AA 04 00 82 01 00 07 00 07 00') == (0x50, '')
    assert words_at(words, 'O:5') == '00 00'


def test_slc_takes_typed_commands_on_files_that_a_plc5_has_too() -> None:
    """From operating system 303 on; the codes are those of a PLC-5."""
    words = table(SLC, N7_0='01 00 02 00', T4_0='00 20 0A 00 05 00', F8_0='00 00 7A 44',
                  L10_0='01 00 00 00', I_1_0='05 00', PD12_0=counting(23))
    assert ask(words, '68 00 00 02 00 06 07 00 02 00') == (0, '95 09 42 01 00 02 00')
    assert ask(words, '68 00 00 01 00 0E 04 00 02 01 00') == (0, '93 09 42 05 00')
    assert ask(words, '68 00 00 01 00 06 08 00 01 00') == (0, '96 09 94 08 00 00 7A 44')
    assert ask(words, '67 00 00 01 00 06 07 01 93 09 42 07 00') == (0, '')
    assert words_at(words, 'N7:1') == '07 00'
    for data, ext_sts in (('06 0A 00', '06'), ('06 01 01', '06'), ('06 63 00', '06'),
                          ('06 07 02', '07'), ('06 0C 00', '06')):
        for command in f'68 00 00 01 00 {data} 01 00', f'67 00 00 01 00 {data} 93 09 42 07 00':
            assert ask(words, command) == (0xF0, ext_sts), command
