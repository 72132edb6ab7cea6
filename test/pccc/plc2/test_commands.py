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

"""The commands of a PLC-2 against printed and computed frames."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.plc2.commands import BasicBitWrite, BasicRead, BasicWrite, ByteChange
import pytest
from support.vectors import vector


@pytest.mark.parametrize(('name', 'cmd', 'request_'), [
    ('516_fd_plc2_read_cmd', 0x01, BasicRead(0x11, 2)),
    ('plc2_write_unprot_req_fd_crc', 0x08, BasicWrite(0o11 * 2, b'\xFF\xFF')),
    ('cif_read_word_req_fd_crc', 0x01, BasicRead(9, 2))])
def test_request_is_the_bytes_of_its_vector_and_back(
        name: str, cmd: int, request_: BasicRead | BasicWrite) -> None:
    packet = vector(name).packet
    assert packet.cmd == cmd
    assert packet.data == request_.encode()
    assert type(request_).read(Reader(packet.data)) == request_


@pytest.mark.parametrize('data', ['', '20 00', '20 00 01', '20 00 01 00 21', '20 00 03 01'])
def test_what_is_no_bit_write(data: str) -> None:
    with pytest.raises(FormatError):
        BasicBitWrite.read(Reader(bytes.fromhex(data)))


def test_more_than_60_bytes_are_no_bit_write() -> None:
    one = ByteChange(0, 1, 0).encode()
    assert len(BasicBitWrite.read(Reader(one * 60)).changes) == 60
    with pytest.raises(FormatError, match='^61 bytes to modify, 60 are allowed$'):
        BasicBitWrite.read(Reader(one * 61))


@pytest.mark.parametrize('data', ['', '20', '20 00', '20 00 02 01'])
def test_what_is_no_read(data: str) -> None:
    with pytest.raises(FormatError):
        BasicRead.read(Reader(bytes.fromhex(data)))
