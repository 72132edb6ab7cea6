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

"""Word range commands and bit write against printed and computed frames."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.word_range.commands import (
    WordBitWrite,
    WordRangeRead,
    WordRangeWrite,
)
import pytest
from support.vectors import vector, without_area


@pytest.mark.parametrize(('name', 'request_'), [
    ('516_fd_plc3_wrr_cmd1', WordRangeRead(ExtendedAddress(8, 10), 228, 0, 342)),
    ('516_fd_plc3_wrr_cmd2', WordRangeRead(ExtendedAddress(8, 10), 228, 114, 342)),
    ('516_fd_plc3_wrr_cmd3', WordRangeRead(ExtendedAddress(8, 10), 228, 228, 342)),
    ('plc5_wrr_F8_req_fd_crc', WordRangeRead(SystemAddress(8, 0), 4, 0, 2)),
    ('plc5_wrr_max_req_fd_crc', WordRangeRead(SystemAddress(7, 0), 244, 0, 122))])
def test_read_is_the_bytes_of_its_vector_and_back(
        name: str, request_: WordRangeRead[ExtendedAddress | SystemAddress]) -> None:
    data = vector(name).packet.data
    assert request_.encode() == without_area(data)
    reader = Reader(data)
    assert reader.byte() == 0x01
    assert WordRangeRead.read(reader, type(request_.address).read) == request_


def test_write_is_the_bytes_of_its_vector_and_back() -> None:
    data = vector('plc5_wrw_N7_req_fd_crc').packet.data
    request = WordRangeWrite(SystemAddress(7, 10), b'\x10\x10\x07\0', 0, 2)
    assert request.encode() == without_area(data)
    reader = Reader(data)
    assert reader.byte() == 0x00
    assert WordRangeWrite.read(reader, SystemAddress.read) == request


def test_file_read_has_the_parameters_of_a_word_range_read() -> None:
    reader = Reader(vector('plc3_file_read_req_fd_crc').packet.data)
    assert reader.byte() == 0x04
    assert WordRangeRead.read(reader, ExtendedAddress.read) == WordRangeRead(
        ExtendedAddress(8, 10), 8, 0, 4)


@pytest.mark.parametrize('data', ['', '2C 08 0A 05', '2C 08 0A 05 01 00 00', '2C 08 0A 05 01 00'
                                  ' 01 00', '2C 08 0A 05 01 00 02 00 07'])
def test_what_is_no_bit_write(data: str) -> None:
    with pytest.raises(FormatError):
        WordBitWrite.read(Reader(bytes.fromhex(data)), ExtendedAddress.read)
