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

"""Data tables of emulated PLCs, written and asked in hexadecimal."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.status import check_status


def table(family: PlcType, **files: str) -> DataTable:
    """Return a table; each keyword is an address with "_" for ":", its value the words."""
    result = DataTable(family)
    for name, words in files.items():
        address = parse_address(name.replace('_', ':', 1).replace('_', '.'), family)
        data = bytes.fromhex(words)
        result.create(address, len(data) // 2)
        result.write(address, data)
    return result


def counting(words: int) -> str:
    """Return words 0, 1, 2..."""
    return b''.join(number.to_bytes(2, 'little') for number in range(words)).hex()


def words_at(words: DataTable, text: str, count: int = 1) -> str:
    """Return words of a table in hexadecimal."""
    return words.read(parse_address(text, words.plc_type), count).hex(' ').upper()


def ask(words: DataTable, data: str, cmd: int = 0x0F) -> tuple[int, str]:
    """Return STS and data of the reply to a command."""
    reply = Server(words).serve(Packet(1, 5, cmd, 0, 7, bytes.fromhex(data)))
    assert (reply.dst, reply.src, reply.cmd, reply.tns) == (5, 1, cmd | 0x40, 7)
    return reply.sts, reply.data.hex(' ').upper()


def replied(words: DataTable, cmd: int, data: bytes) -> bytes:
    """Return the data of the good reply to a request; RemoteError for any other."""
    return check_status(Server(words).serve(Packet(1, 5, cmd, 0, 1, data)))
