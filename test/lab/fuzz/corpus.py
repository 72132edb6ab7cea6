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

"""
Inputs to begin with: those made of vectors and real files, and the stored finds.

A stored corpus is a text file, one input a line in hexadecimal.
"""

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from abdf1_ros.df1.frames import ACK
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.settings.columns import COLUMNS
from abdf1_ros.settings.network import FIELDS
from abdf1_ros.simulator import simulated_plc
from abdf1_ros.sniffer.capture import Chunk, Direction
from support.ethernet_ip import (
    execute,
    forward_close,
    forward_open,
    message,
    recorded,
    REGISTER,
    routed,
)
from support.vectors import CAPTURED, commands, MESSAGES, VECTORS

TARGETS = ('frames', 'addresses', 'net_csv', 'map_csv', 'simulator_csv', 'typed_data', 'server',
           'links', 'captures', 'ethernet_ip')

_FOLDER = Path(__file__).resolve().parent / 'corpus'
_CONFIG = Path(__file__).resolve().parents[3] / 'config'

_ADDRESSES = (
    'N7:0', 'N7:0/3', 'n100:255', 'O:017/12', 'I:003', 'O:2.0', 'I:1.0/3', 'I:30.255', 'S:1',
    'S2:1/15', 'B3:1/5', 'B3/21', 'B3;1', 'T4:0.ACC', 'T4:0/DN', 'T4:0.2', 'C5:0.PRE', 'C5:0/CU',
    'R6:0.POS', 'R6:0/IN', 'F8:0', 'A10:0', 'D11:0', 'ST9:0', 'L10:0', '#N7:0', '$N7:0',
    'ST999:779', 'N999:999', 'N256:0', 'T4:0.3', 'F8:0/1', 'I:088')

# One script for each mode: time, polls, a reply, a command for us, a write, the loss of the port.
_SCRIPT = bytes.fromhex(
    '0405 0700 0205 0001020304 0405 0701 0204 F0060000 0500 0405 0701 0203 000000 0702 0704'
    '0309 68000001000702 0515 0405 0600 0420')

# Commands of a guest: a read, what nobody knows, none at all, with time, a reply and a lost port.
_GUESTS = bytes.fromhex(
    '0405 8307 0FA20207890000 830A 0FAA02078900003412 0405 0701 0203 001234 8302 0C00 8300 0440'
    '8307 0FA20207890000 0600 8307 0FA20207890000 04FF')

# Bytes as xxd prints them and as hexdump -C does, which leaves out lines that repeat.
_DUMPS = (
    b'00000000: 1005 01ff 1004 1002                      ........\n',
    b'00000000  10 05 01 ff 10 04 10 02  00 00 00 00 00 00 00 00  |................|\n'
    b'00000010  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  |................|\n'
    b'*\n00000040\n',
    b'# a poll\n0x10, 0x05, 0x01, 0xFF\n1004\n')

_CAPTURE = b'# abdf1_ros capture 1'
# A command and its reply, full duplex.
_EXCHANGE = (b'10 02 01 02 06 00 07 00 00 10 03 a3 1f', b'10 02 02 01 46 00 07 00 10 03 5a 1e')

# What was found once, and is no more.
_FOUND = {
    # A served PLC-3 word range write to a word inside a structure that has no name.
    'server': (bytes.fromhex('0F0000002102240423FF') + 55 * b'\xb6',),
    # A file that is longer than its PLC can have.
    'simulator_csv': (b'Station,PLC_Type,Address,Length\n1,PLC5,N7:999,1000\n',),
    # A line shown in full; a latency without end; a reply that comes in an earlier recording;
    # noise whose last byte looks like the beginning of what follows.
    'captures': (
        _CAPTURE + 600 * b'x',
        _CAPTURE + b'\n-1e308 > %b\n1e308 < %b\n' % _EXCHANGE,
        _CAPTURE + b'\n# baud: 9600\n5 > %b\n1 < %b\n' % _EXCHANGE,
        bytes.fromhex('10 10 02 10 02 10 0A'))}


def seeds(target: str) -> list[bytes]:
    """Return the inputs made for a target."""
    return [*_SEEDS[target](), *_FOUND.get(target, ())]


def stored(target: str) -> list[bytes]:
    """Return the stored inputs of a target."""
    path = _FOLDER / f'{target}.hex'
    return [bytes.fromhex(line) for line in path.read_text(encoding='ascii').splitlines()]


def store(target: str, inputs: Iterable[bytes]) -> None:
    """Replace the stored inputs of a target."""
    lines = sorted((data.hex() for data in set(inputs)), key=lambda line: (len(line), line))
    (_FOLDER / f'{target}.hex').write_text(
        ''.join(f'{line}\n' for line in lines), encoding='ascii')


def _frames() -> Iterable[bytes]:
    yield from (entry.frame for entry in VECTORS)
    yield from (entry.frame for entry in CAPTURED)


def _addresses() -> Iterable[bytes]:
    return (text.encode() for text in _ADDRESSES)


def _net_csv() -> Iterable[bytes]:
    yield from ((_CONFIG / name).read_bytes() for name in ('net.csv', 'peer_net.csv'))
    for entry in FIELDS.values():
        for value in (entry.default, entry.kind.low, entry.kind.high, *entry.kind.choices):
            yield f'{entry.column}\n{value}\n'.encode()


def _map_csv() -> Iterable[bytes]:
    yield from ((_CONFIG / name).read_bytes() for name in ('map.csv', 'peer_map.csv'))
    yield (','.join(COLUMNS) + '\r\n').encode('utf-8-sig')
    for plc in ('PLC5', 'SLC'):
        for address in _ADDRESSES:
            yield ('Tag;Command;Address;Station;PLC_Type;Length\n'
                   f'a;ReadWrite;{address};1;{plc};2\nb;Serve;{address};5;{plc};1\n').encode()


def _simulator_csv() -> Iterable[bytes]:
    rows = (_CONFIG / 'simulator.csv').read_bytes().splitlines(keepends=True)
    head, *rows = (row for row in rows if not row.startswith(b'#'))
    yield from (b'# data\n' + head + row for row in rows)
    for plc in FAMILIES:
        for address in _ADDRESSES:
            yield (';'.join(simulated_plc.COLUMNS) + f'\n3;{plc.value};{address};2;1 -1.5;;\n'
                   f'3;{plc.value};{address};1;;Toggle;100\n').encode()


def _typed_data() -> Iterable[bytes]:
    for entry in commands(plc5.TYPED_WRITE, plc5.TYPED_READ, plc5.READ_MODIFY_WRITE):
        for start in (7, 11, 15, 16):
            yield entry.link_data[start:]
    yield from (bytes.fromhex(text) for text in ('9309430100', '93094A030001000000', '0024'))


def _server() -> Iterable[bytes]:
    known = commands(
        plc5.TYPED_WRITE, plc5.TYPED_READ, plc5.READ_MODIFY_WRITE, slc.LOGICAL_READ,
        slc.LOGICAL_WRITE, slc.MASKED_WRITE)
    yield from (b'\x0f' + entry.link_data[6:] for entry in known)
    for entry in MESSAGES:
        if entry.header is not None and not entry.header[2] & 0x40:
            yield entry.link_data[2:3] + entry.link_data[6:]


def _links() -> Iterable[bytes]:
    for mode in range(16):
        yield bytes((mode,)) + _SCRIPT
        yield bytes((mode,)) + _GUESTS + _SCRIPT


def _captures() -> Iterable[bytes]:
    yield from _DUMPS
    for command, reply in pairwise(entry for entry in VECTORS if entry.pair):
        if command.pair == reply.pair:
            lines = [f'# check: {command.checksum.value}', '# baud: 9600',
                     *(Chunk(time, direction, data) for time, direction, data in (
                         (0.0, Direction.OUT, command.frame), (0.01, Direction.IN, ACK),
                         (0.02, Direction.IN, reply.frame)))]
            yield '\n'.join([_CAPTURE.decode(), *map(str, lines), '']).encode()
            yield b''.join(bytes((how, 30, len(entry.link_data))) + entry.link_data
                           for how, entry in ((0, command), (1, reply)))


def _ethernet_ip() -> Iterable[bytes]:
    read = execute(bytes.fromhex('0F 00 34 12 A2 02 07 89 00 00'))
    whole = [message(0x63), message(0x04), message(0x64), REGISTER, message(0x66, session=1),
             message(0x00, b'any')]
    requests = [read, routed(read), routed(read, bytes((1, 0))), forward_open(), forward_close(),
                forward_open(bytes.fromhex('01 00 20 02 24 01'), is_large=True),
                bytes.fromhex('01 02 20 01 24 01'), bytes.fromhex('0E 03 20 01 24 01 30 07')]
    for data in whole:
        yield b'\0\0' + _step(24, data)
    for request in requests:
        yield b''.join((b'\0\0\1\0', _step(4, request), _step(16, b'\x2A\0'), b'\x0C\x03',
                        bytes(3), _step(5, request), b'\x14\0'))
    for connections in recorded().values():
        for segments in connections:
            # The second session is theirs.
            yield b'\x01\0' + b''.join(
                _step(24, segment) + _step(16, b'\x2A\0') for segment in segments)
    for pause in b'', b'\x0C\x0B' + bytes(11):
        yield b''.join((b'\0\0', _step(4, forward_open()), _step(8, read), pause,
                        _step(8 | 128, read), _step(16, b'\x2A\0'), _step(4, forward_close())))


def _step(how: int, data: bytes) -> bytes:
    return bytes((how, len(data))) + data


_SEEDS = {
    'frames': _frames, 'addresses': _addresses, 'net_csv': _net_csv, 'map_csv': _map_csv,
    'simulator_csv': _simulator_csv, 'typed_data': _typed_data, 'server': _server,
    'links': _links, 'captures': _captures, 'ethernet_ip': _ethernet_ip}
