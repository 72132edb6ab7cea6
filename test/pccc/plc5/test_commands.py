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

"""The PLC-5 commands, byte for byte."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.plc5.commands import (
    BitSet,
    element_of,
    ReadModifyWrite,
    SystemAddress,
    TypedRead,
    TypedWrite,
)
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.vectors import commands, Vector, without_area

COMMANDS: dict[int, type[TypedRead | TypedWrite | ReadModifyWrite]] = {
    0x68: TypedRead, 0x67: TypedWrite, 0x26: ReadModifyWrite}

words = st.integers(0, 0xFFFF)


def parameters(data: str | bytes) -> Reader:
    """Return a reader of hexadecimal bytes."""
    return Reader(bytes.fromhex(data) if isinstance(data, str) else data)


@pytest.mark.parametrize(('address', 'encoded'), [
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
    (b'\0$D9:3\0', SystemAddress(9, 3)), (b'\0$#N7:3\0', SystemAddress(7, 3))])
def test_address_in_other_forms(encoded: str, address: SystemAddress) -> None:
    reader = parameters(encoded)
    assert SystemAddress.read(reader) == address
    assert reader.is_empty


@pytest.mark.parametrize('encoded', [
    '', '07', '07 00', '07 00 07', '07 00 07 FF 2C', '17 00 07 00', '80 07', '07 01 07 00',
    '00', '00 25 4E 00', '00 24 4E 37 3A 30', '00 24 00', '00 24 58 37 3A 30 00',
    '00 24 4E 37 3A 30 2F 31 00', '00 24 FF 37 3A 30 00'])
def test_what_is_no_address(encoded: str) -> None:
    with pytest.raises(FormatError):
        SystemAddress.read(parameters(encoded))


@pytest.mark.parametrize(('encoded', 'address'), [
    ('04 1E', SystemAddress(1, 30)), ('05 00 1E', SystemAddress(1, 30)),
    ('0D 00 02 01', SystemAddress(1, 2, 1)), ('01 00', SystemAddress(1, 0))])
def test_file_that_is_left_out_is_file_1(encoded: str, address: SystemAddress) -> None:
    """M 13-10..13-15; other drivers take it for 0."""
    assert SystemAddress.read(parameters(encoded)) == address


@pytest.mark.parametrize(('letters', 'descriptor', 'words', 'size'), [
    ('N', '42', 1, 2), ('B', '42', 1, 2), ('A', '31', 1, 2), ('D', '92 10', 1, 2),
    ('S', '42', 1, 2), ('I', '42', 1, 2), ('O', '42', 1, 2), ('T', '59 0A', 3, 10),
    ('C', '66', 3, 6), ('R', '76', 3, 6), ('F', '94 08', 2, 4), ('ST', '39 54', 42, 84),
    ('PD', '99 15 A4', 82, 164), ('MG', '99 16 70', 56, 112), ('SC', '96 1D', 3, 6),
    ('BT', '99 20 0C', 6, 12)])
def test_descriptors_and_element_sizes(letters: str, descriptor: str, words: int,
                                       size: int) -> None:
    address = Address(ADDRESSING, FileType(letters), 9, 0)
    element = element_of(address, is_value=False)
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


@pytest.mark.parametrize('entry', commands(*COMMANDS), ids=lambda entry: entry.name)
def test_command_of_every_vector(entry: Vector) -> None:
    data = entry.packet.data
    reader = Reader(data[1:])
    command = COMMANDS[data[0]].read(reader)
    assert reader.is_empty
    # Logical ASCII and the memory area are read, and written as logical binary without it.
    again = command.encode()
    assert COMMANDS[data[0]].read(Reader(again[1:])) == command
    assert again == without_area(data) or b'\0$' in data


def test_bytes_behind_a_typed_read_are_a_format_error() -> None:
    with pytest.raises(FormatError, match='too many'):
        TypedRead.read(parameters('00 00 01 00 07 00 07 00 01 00 01'))


def test_padding_behind_a_typed_read_is_passed_over() -> None:
    padded = TypedRead.read(parameters('00 00 01 00 07 00 07 00 01 00 00 00'))
    assert padded == TypedRead.read(parameters('00 00 01 00 07 00 07 00 01 00'))


def test_read_modify_write_of_nothing_is_a_format_error() -> None:
    with pytest.raises(FormatError):
        ReadModifyWrite.read(Reader(b''))
