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

"""df1py3, a DF1 client in Python: full duplex, CRC, 0F A2, AA and AB."""

from __future__ import annotations

import re
import struct
import sys

from df1.commands.commands import Command0FA2, Command0FAA, Command0FABSingleBit
from df1.file_type import FileType
from df1.models import df1_serial_plc
from df1.models.df1_base import COUNTER, TIMER
from df1.models.df1_serial_client import Df1SerialClient
from df1.replies import Reply4f
from player import Cannot, play

TYPES = {'N': FileType.INTEGER, 'B': FileType.BIT, 'F': FileType.FLOAT, 'S': FileType.STATUS,
         'T': FileType.TIMER, 'C': FileType.COUNTER, 'R': FileType.CONTROL}
# Its 10 us are over before the first byte has gone where the machine has anything else to do.
df1_serial_plc.WRITE_TIMEOUT = None
WRITABLE = ('N', 'B', 'F', 'R')


def main() -> None:
    """Play on the port of the first argument, towards station 1."""
    client = Df1SerialClient(plc_type='SLC 5/03', src=0, dst=1, port=sys.argv[1], baudrate=19200)
    client.connect()

    def send(kind: type, **fields: object) -> Reply4f:
        reply = client.send_command(client.create_command(kind, **fields))
        if reply.buffer[5] != 0:
            raise ValueError(f'STS {reply.buffer[5]:02X}')
        return reply

    def read(address: str, count: int) -> object:
        letter, table, start, member, bit = parts(address)
        if bit:
            value, = send(Command0FA2, bytes_to_read=2, table=table, file_type=TYPES[letter],
                          start=start).get_data(FileType.INTEGER)
            return [value >> int(bit) & 1]
        if member == 'ACC' and letter == 'T':
            return client.read_timer(table, start, TIMER.ACC)
        if member == 'PRE' and letter == 'C':
            return client.read_counter(table, start, COUNTER.PRE)
        if member:
            raise Cannot('no such part')
        size = 2 * count if letter != 'F' else 4 * count
        reply = send(Command0FA2, bytes_to_read=size, table=table, file_type=TYPES[letter],
                     start=start)
        if letter == 'F':
            return reply.get_data(FileType.FLOAT)
        return reply.get_data(FileType.INTEGER)

    def write(address: str, values: object) -> None:
        letter, table, start, member, bit = parts(address)
        if bit:
            send(Command0FABSingleBit, table=table, file_type=TYPES[letter], start=start,
                 bit_position=int(bit), bit_value=values[0])
            return
        if member or letter not in WRITABLE:
            raise Cannot('Command0FAA takes N, O, B, R and F')
        data = struct.pack(f'<{len(values)}f', *values) if letter == 'F' else [
            value & 0xFFFF for value in values]
        send(Command0FAA, table=table, file_type=TYPES[letter], start=start, data_to_write=data)

    play(read, write)


def parts(address: str) -> tuple[str, int, int, str, str]:
    """Return letter, file, element, member and bit."""
    match = re.fullmatch(r'([A-Z]+)(\d*):(\d+)(?:\.(\w+))?(?:/(\d+))?', address)
    assert match, address
    letter, table, start, member, bit = match.groups()
    if letter not in TYPES:
        raise Cannot(f'there is no file type {letter} that it can read')
    return letter, int(table or 2), int(start), member or '', bit or ''


main()
