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

"""Requests to an SLC or MicroLogix, and its replies."""

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.dialect import SlcDialect
import pytest
from support.tables import replied

SLC = PlcType.SLC
DIALECT = SlcDialect()


def at(text: str) -> Address:
    """Return an address."""
    return parse_address(text, SLC)


@pytest.mark.parametrize(('letters', 'read', 'write'), [
    ('N', 118, 117), ('B', 118, 117), ('F', 118, 116), ('T', 117, 117), ('C', 117, 117),
    ('ST', 84, 84), ('PD', 115, 115), ('MG', 100, 100)])
def test_limits_are_whole_elements(letters: str, read: int, write: int) -> None:
    kind = FileType(letters)
    assert (DIALECT.max_read(kind), DIALECT.max_write(kind)) == (read, write)


@pytest.mark.parametrize('text', [
    'N7:0', 'F8:0', 'T4:0', 'C5:0', 'ST9:0', 'L10:0', 'I:1.0', 'S:1', 'PD9:0', 'MG9:0'])
def test_largest_transfers_of_an_slc(text: str) -> None:
    address, dialect = at(text), DIALECT
    table = DataTable(SLC)
    table.create(address, 200)
    words = dialect.max_write(address.file_type)
    data = bytes(range(1, 250))[:2 * words]
    assert replied(table, *dialect.write(address, data)) == b''
    assert table.read(address, words) == data
    words = dialect.max_read(address.file_type)
    reply = replied(table, *dialect.read(address, words))
    assert len(reply) == dialect.reply_size(address, words) == 2 * words <= slc.MAX_READ
    assert dialect.read_data(address, words, reply)[:len(data)] == data[:2 * words]


@pytest.mark.parametrize(('name', 'read', 'write'), [
    ('5/01', 82, 82), ('5/02', 82, 82), ('ML1000', 82, 82), ('5/03', 236, 234),
    ('5/04', 236, 234), ('5/05', 236, 234), ('ML1100', 206, 206), ('ML1200', 206, 206),
    ('ML1400', 206, 206), ('ML1500', 206, 206)])
def test_packets_are_as_long_as_the_processor_takes_them(name: str, read: int, write: int) -> None:
    dialect = SlcDialect(Processor(name))
    assert 2 * dialect.max_read(FileType.INTEGER) == read
    assert 2 * dialect.max_write(FileType.INTEGER) == write
    assert dialect.max_read(FileType.TIMER) == read // 6 * 3
    assert dialect.max_write(FileType.PID) == write // 46 * 23


def test_flat_io_of_the_whole_image() -> None:
    address = parse_address('I:300', SLC, Access.FLAT)
    assert DIALECT.read(address, 2) == (0x0F, bytes.fromhex('A2 04 01 83 FF 2C 01 00'))
    assert DIALECT.write(address, b'\1\2') == (
        0x0F, bytes.fromhex('AA 02 01 83 FF 2C 01 00 01 02'))
    assert DIALECT.write_bits(address, 0x0008, 0x0008) == (
        0x0F, bytes.fromhex('AB 02 01 83 FF 2C 01 00 08 00 08 00'))
