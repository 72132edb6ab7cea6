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

"""A PLC-5: its commands, byte for byte, requests and replies, and an emulated one."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.plc5.commands import BitSet, element_of, ReadModifyWrite, SystemAddress
from abdf1_ros.pccc.plc5.dialect import Plc5Dialect
from abdf1_ros.pccc.plc5.file_search import Plc5FileSearch
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.typed_data import TypedData
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC5 = PlcType.PLC5
DIALECT = Plc5Dialect()


def parameters(data: str | bytes) -> Reader:
    """Return a reader of hexadecimal bytes."""
    return Reader(bytes.fromhex(data) if isinstance(data, str) else data)


@for_all(('address', 'encoded'), [
    (SystemAddress(7, 30), '06 07 1E'), (SystemAddress(3, 300), '06 03 FF 2C 01'),
    (SystemAddress(4, 2, 2), '0E 04 02 02'), (SystemAddress(12, 10, 2), '0E 0C 0A 02'),
    (SystemAddress(1, 10), '06 01 0A'), (SystemAddress(4, 2, 0), '0E 04 02 00'),
    (SystemAddress(999, 255), '06 FF E7 03 FF FF 00')])
def test_address_in_logical_binary(address: SystemAddress, encoded: str) -> None:
    assert address.encode() == bytes.fromhex(encoded)
    assert SystemAddress.read(parameters(encoded)) == address


@for_all(('encoded', 'address'), [
    ('07 00 07 1E', SystemAddress(7, 30)), ('07 00 03 FF 2C 01', SystemAddress(3, 300)),
    ('0F 00 04 02 02', SystemAddress(4, 2, 2)), ('02 07', SystemAddress(7, 0)),
    ('07 FF 00 00 FF 07 00 FF 1E 00', SystemAddress(7, 30)),
    ('00 24 4E 31 30 3A 33 36 30 00', SystemAddress(10, 360)),
    ('00 24 54 34 3A 32 2E 41 43 43 00', SystemAddress(4, 2, 2)),
    ('00 24 49 3A 30 31 37 00', SystemAddress(1, 0o17)),
    (b'\0$PD12:10.SP\0', SystemAddress(12, 10, 2)), (b'\0$PD12:10\0', SystemAddress(12, 10)),
    (b'\0$PD12:10.50\0', SystemAddress(12, 10, 50)), (b'\0$BT9:3.RGS\0', SystemAddress(9, 3, 5)),
    (b'\0$MG9:3.DLEN\0', SystemAddress(9, 3, 3)), (b'\0$SC9:3.TIM\0', SystemAddress(9, 3, 2)),
    (b'\0$ST9:3\0', SystemAddress(9, 3)), (b'\0$R6:3.POS\0', SystemAddress(6, 3, 2)),
    (b'\0$D9:3\0', SystemAddress(9, 3)), (b'\0$#N7:3\0', SystemAddress(7, 3)),
    # File 1 is meant where none is named (M 13-10..13-15); other drivers take it for 0.
    ('04 1E', SystemAddress(1, 30)), ('05 00 1E', SystemAddress(1, 30)),
    ('0D 00 02 01', SystemAddress(1, 2, 1)), ('01 00', SystemAddress(1, 0))])
def test_address_in_other_forms(encoded: str, address: SystemAddress) -> None:
    reader = parameters(encoded)
    assert SystemAddress.read(reader) == address
    assert reader.is_empty


@for_all('encoded', [
    '', '07', '07 00', '07 00 07', '07 00 07 FF 2C', '17 00 07 00', '80 07', '07 01 07 00',
    '00', '00 25 4E 00', '00 24 4E 37 3A 30', '00 24 00', '00 24 58 37 3A 30 00',
    '00 24 4E 37 3A 30 2F 30 00', '00 24 FF 37 3A 30 00'])
def test_what_is_no_address(encoded: str) -> None:
    with pytest.raises(FormatError):
        SystemAddress.read(parameters(encoded))


@for_all(('letters', 'descriptor', 'words', 'size'), [
    ('N', '42', 1, 2), ('B', '42', 1, 2), ('A', '31', 1, 2), ('D', '92 10', 1, 2),
    ('S', '42', 1, 2), ('I', '42', 1, 2), ('O', '42', 1, 2), ('T', '59 0A', 3, 10),
    ('C', '66', 3, 6), ('R', '76', 3, 6), ('F', '94 08', 2, 4), ('ST', '39 54', 42, 84),
    ('PD', '99 15 A4', 82, 164), ('MG', '99 16 70', 56, 112), ('SC', '96 1D', 3, 6),
    ('BT', '99 20 0C', 6, 12)])
def test_descriptors_and_element_sizes(letters: str, descriptor: str, words: int,
                                       size: int) -> None:
    element = element_of(Address(ADDRESSING, FileType(letters), 9, 0), is_value=False)
    assert (element.size, element.wire_size) == (2 * words, size)
    encoded = element.typed(bytes(4 * size)).encode()
    assert encoded.endswith(bytes.fromhex(descriptor) + bytes(4 * size))


def test_read_modify_write_takes_243_bytes() -> None:
    short, long = BitSet(SystemAddress(7, 0), 0, 0), BitSet(SystemAddress(300, 0, 0), 0, 0)
    fits = (*[short] * 33, long)
    assert len(ReadModifyWrite(fits).encode()) == 1 + 33 * 7 + 10
    with pytest.raises(FormatError, match='243'):
        ReadModifyWrite((*[short] * 32, long, long)).encode()
    body = b''.join(entry.encode() for entry in fits)
    assert ReadModifyWrite.read(Reader(body)).sets == fits
    with pytest.raises(FormatError, match='^244 bytes of words to modify, 243 are allowed$'):
        ReadModifyWrite.read(Reader(body + b'\0' * 3))


def at(text: str) -> Address:
    return parse_address(text, PLC5)


@for_all(('letters', 'read', 'written'), [
    ('N', 110, 110), ('B', 110, 110), ('F', 58, 57), ('T', 23, 22), ('C', 39, 38), ('R', 39, 38),
    ('ST', 2, 2), ('PD', 1, 1), ('MG', 2, 2), ('BT', 19, 18), ('SC', 39, 38)])
def test_limits_in_elements(letters: str, read: int, written: int) -> None:
    kind = FileType(letters)
    words = FAMILIES[PLC5].layout(kind).words
    assert DIALECT.max_read(kind) == read * words
    assert DIALECT.max_write(kind) == written * words


def test_internal_words_of_a_timer_are_left_out_and_six_bytes_are_taken_too() -> None:
    for size, expected in ((10, bytes(range(6)) + bytes(range(10, 16))), (6, bytes(range(12)))):
        timers = TypedData(5, size, bytes(range(2 * size))).encode()
        assert DIALECT.read_data(at('T4:0'), 6, timers) == expected


@for_all(('text', 'typed'), [
    ('B3:0', TypedData(2, 2, b'\1\2\3\4')), ('A9:0', TypedData(3, 1, b'\1\2\3\4')),
    ('D9:0', TypedData(0x10, 2, b'\1\2\3\4')), ('S:0', TypedData(4, 2, b'\1\2\3\4'))])
def test_words_may_come_as_bits_characters_or_bcd(text: str, typed: TypedData) -> None:
    assert DIALECT.read_data(at(text), 2, typed.encode()) == b'\1\2\3\4'


@for_all(('text', 'words', 'typed'), [
    ('PD9:0.SP', 2, TypedData(4, 2, bytes(4))), ('PD9:0.SP', 2, TypedData(0x15, 164, bytes(164))),
    ('PD9:0', 82, TypedData(8, 4, bytes(164))), ('PD9:0', 1, TypedData(8, 4, bytes(4))),
    ('MG9:0', 56, TypedData(0x16, 112, bytes(224))), ('A9:0', 2, TypedData(3, 1, bytes(3))),
    ('T4:0', 3, TypedData(5, 8, bytes(8)))])
def test_reply_that_is_no_part_of_a_structure(text: str, words: int, typed: TypedData) -> None:
    with pytest.raises(FormatError):
        DIALECT.read_data(at(text), words, typed.encode())


def test_plc5_timer_is_read_and_written_with_its_two_internal_words() -> None:
    words = table(PLC5, T4_0='00 E0 64 00 2A 00 01 00 02 00 03 00')
    assert ask(words, '68 00 00 02 00 07 00 04 00 02 00') == (
        0, '99 09 16 59 0A 00 E0 64 00 2A 00 00 00 00 00 01 00 02 00 03 00 00 00 00 00')
    words = table(PLC5, T4_0='00 00' * 9)
    assert ask(words, '67 00 00 02 00 07 00 04 01 99 09 16 59 0A 00 C2 0A 00 09 00 01 01 01 01 '
                      '00 C3 0B 00 08 00 01 01 01 01') == (0, '')
    assert words_at(words, 'T4:0', 9) == ('00 00 00 00 00 00 00 C2 0A 00 09 00 00 C3 0B 00 08 00')


def test_plc5_float_of_a_pid_is_a_float() -> None:
    words = table(PLC5, PD12_10='00 00' * 82)
    assert ask(words, '67 00 00 02 00 0F 00 0C 0A 02 99 09 0A 94 08 00 00 2A 42 00 00 80 3F') == (
        0, '')
    assert words_at(words, 'PD12:10.SP', 4) == '00 00 2A 42 00 00 80 3F'
    assert ask(words, '68 00 00 01 00 0F 00 0C 0A 02 01 00') == (0, '96 09 94 08 00 00 2A 42')
    assert ask(words, '68 01 00 02 00 0F 00 0C 0A 02 01 00') == (0, '96 09 94 08 00 00 80 3F')
    assert ask(words, '68 00 00 01 00 0F 00 0C 0A 00 01 00') == (0, '93 09 42 00 00')
    assert ask(words, '67 00 00 01 00 0F 00 0C 0A 02 93 09 42 01 00') == (0xF0, '17')


@for_all(('name', 'words', 'number', 'descriptor'), [
    ('PD9_0', 82, 1, '99 09 A7 99 15 A4'), ('MG9_0', 56, 2, '99 09 E3 99 16 70'),
    ('SC9_0', 3, 2, '99 09 0E 96 1D'), ('BT9_0', 6, 2, '99 09 1B 99 20 0C'),
    ('ST9_0', 42, 2, '99 09 AA 39 54')])
def test_plc5_structures_as_a_whole(name: str, words: int, number: int, descriptor: str) -> None:
    data = bytes.fromhex(counting(words * number)).hex(' ').upper()
    full = table(PLC5, **{name: data})
    assert ask(full, f'68 00 00 0{number} 00 07 00 09 00 0{number} 00') == (
        0, f'{descriptor} {data}')
    empty = table(PLC5, **{name: '00 00' * words * number})
    assert ask(empty, f'67 00 00 0{number} 00 07 00 09 00 {descriptor} {data}') == (0, '')
    assert words_at(empty, name.replace('_', ':'), words * number) == data


@for_all(('data', 'ext_sts'), [
    ('68 00 00 01 00 07 00 09 00 01 00', '06'), ('68 00 00 01 00 07 00 07 04 01 00', '07'),
    ('68 00 00 05 00 07 00 07 00 05 00', '07'), ('68 00 00 01 00 07 00 07 00 02 00', '01'),
    ('68 01 00 01 00 07 00 07 00 01 00', '01'), ('68 00 00 00 00 07 00 07 00 00 00', '01'),
    ('68 00 00 01 00 0F 00 07 00 01 01 00', '03'), ('68 00 00 01 00 0F 00 04 00 03 01 00', '03'),
    ('67 01 00 02 00 07 00 07 00 95 09 42 01 00 02 00', '01'),
    ('67 00 00 01 00 07 00 07 00 91 09 42', '01'),
    ('67 00 00 01 00 07 00 07 00 96 09 94 08 00 00 00 00', '17'),
    ('67 00 00 01 00 07 00 04 00 97 09 56 01 00 02 00 03 00', '17'),
    ('67 00 00 01 00 07 00 09 00 93 09 42 01 00', '06'),
    ('67 00 00 02 00 07 00 07 03 95 09 42 01 00 02 00', '07'),
    # More levels than there are, another memory area; symbols (M 8-4).
    ('68 00 00 01 00 17 00 07 00 00 01 00', '03'), ('68 00 00 01 00 07 01 07 00 01 00', '06'),
    ('68 00 00 01 00 00 4E 37 00 01 00', '04'),
    ('68 00 00 01 00 00 24 58 37 3A 30 00 01 00', '05'),
    ('68 00 00 01 00 00 24 4E 37 00 01 00', '05'),
    ('68 00 00 01 00 00 24 4E 37 3A 39 39 39 39 00 01 00', '06'),
    ('26 07 00 09 00 FF FF 01 00', '06'), ('26 07 00 07 04 FF FF 01 00', '07'),
    ('26 07 00 07 00 FF FF 01 00 07 00 07 04 FF FF 01 00', '07')])
def test_command_that_a_plc5_refuses_changes_nothing(data: str, ext_sts: str) -> None:
    words = table(PLC5, N7_0='00 00' * 4, T4_0='00 00' * 3)
    assert ask(words, data) == (0xF0, ext_sts)
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_bytes_after_a_command_are_padding_if_they_are_0() -> None:
    words = table(PLC5, N7_0='01 00')
    assert ask(words, '68 00 00 01 00 06 07 00 01 00 00 00') == (0, '93 09 42 01 00')
    assert ask(words, '68 00 00 01 00 06 07 00 01 00 01') == (0x10, '')
    assert ask(words, '26') == (0x10, '')


def test_plc5_reply_or_write_beyond_240_bytes_is_refused() -> None:
    words = table(PLC5, N7_0='00 00' * 200)
    assert ask(words, '68 00 00 76 00 07 00 07 00 76 00')[0] == 0
    assert ask(words, '68 00 00 77 00 07 00 07 00 77 00') == (0xF0, '0A')
    for size, answer in ((0xE9, (0, '')), (0xEB, (0xF0, '0A'))):  # with the address
        data = f'67 00 00 76 00 06 07 00 99 09 {size:X} 42' + (size - 1) * '00'
        assert ask(words, data) == answer


def test_plc5_read_modify_write_of_the_same_word_twice_runs_in_order() -> None:
    words = table(PLC5, B3_0='00 00')
    assert ask(words, '26 07 00 03 00 FF FF 03 00 07 00 03 00 FE FF 00 00') == (0, '')
    assert words_at(words, 'B3:0') == '02 00'


def test_files_of_a_plc5_have_their_type_and_are_counted_to_their_end() -> None:
    """The files of a PLC-5/40 to 5/80 may have 2,000 elements."""
    for text, count in (('N12:0', 1500), ('N8:0', 1500), ('F8:0', 3), ('F12:0', 3), ('A12:0', 5),
                        ('ST12:0', 2), ('D12:0', 4), ('B3:0', 2), ('T4:0', 6), ('C12:0', 7)):
        there = DataTable(PlcType.PLC5)
        there.create(at(text), count * at(text).layout.words)
        steps = Plc5FileSearch().look_for(at(text).file)
        request = next(steps)
        with pytest.raises(StopIteration) as done:
            while True:
                request = steps.send(Server(there).serve(Packet(1, 0, 0x0F, 0, 7, request[1])))
        assert done.value.value == DataFile(at(text).file_type, at(text).file, count)
    next(steps := Plc5FileSearch().look_for(12))
    with pytest.raises(RemoteError, match='STS 02'):  # a gateway that has lost the PLC
        steps.send(Packet(1, 0, 0x4F, 2, 7))


@for_all(('asked', 'kept', 'data', 'told'), [
    ('N8:0', 'F8:0', '00 00 80 3F', 'file 8 of this PLC holds floats: write F8:0'),
    ('F7:3', 'N7:3', '01 00', 'file 7 of this PLC holds no floats (type 4), so F7:3 is not there; '
                              '"plc files" lists the files')])
def test_wrong_file_letter_is_told_with_what_the_file_holds(
        asked: str, kept: str, data: str, told: str) -> None:
    element = element_of(parse_address(kept, PLC5), is_value=False)
    reply = element.typed(bytes.fromhex(data)).encode()
    with pytest.raises(FormatError) as caught:
        DIALECT.read_data(parse_address(asked, PLC5), 1 if asked == 'N8:0' else 2, reply)
    assert str(caught.value) == told
