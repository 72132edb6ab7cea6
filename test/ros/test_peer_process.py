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

"""The simulator as a process on a full-duplex line, and a client made from the manual alone."""

from collections.abc import Iterator
import os
from pathlib import Path
import select
import tty

import pytest
from support.ros import PATIENCE, Process

US = 9

DATA = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,PLC5,N7:0,100,1200 4099 -2 16,,
1,PLC5,F8:0,4,1.5,,
"""

ACK, NAK, ENQ = b'\x10\x06', b'\x10\x15', b'\x10\x05'


def crc(data: bytes) -> bytes:
    """Return the check of M 5-6: every data byte and ETX, low byte first."""
    value = 0
    for byte in data + b'\x03':
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return bytes((value & 0xFF, value >> 8))


def bcc(data: bytes) -> bytes:
    """Return the check of M 5-2: two's complement of the sum of the data bytes."""
    return bytes((-sum(data) & 0xFF,))


class Client:
    """The other end of the line, which knows the manual and nothing of the package."""

    def __init__(self, line: int, check: str) -> None:
        self._line = line
        self._check = crc if check == 'CRC' else bcc
        self._tns = 0x0F0E
        self._heard = b''

    def say(self, data: bytes, is_slow: bool = False) -> None:
        """Put bytes on the line, at once or each by itself."""
        for part in ([data[at:at + 1] for at in range(len(data))] if is_slow else [data]):
            os.write(self._line, part)

    def frame(self, data: bytes) -> bytes:
        """Return the frame of a message."""
        return b'\x10\x02' + data.replace(b'\x10', b'\x10\x10') + b'\x10\x03' + self._check(data)

    def _byte(self) -> int:
        while not self._heard:
            assert select.select([self._line], [], [], PATIENCE)[0], 'nothing comes'
            self._heard = os.read(self._line, 1000)
        byte, self._heard = self._heard[0], self._heard[1:]
        return byte

    def hear(self) -> bytes:
        """Return the next symbol: a response as it is, of a message the data."""
        assert self._byte() == 0x10
        code = self._byte()
        if code != 0x02:
            return bytes((0x10, code))
        data = bytearray()
        while True:
            byte = self._byte()
            if byte == 0x10 and (byte := self._byte()) == 0x03:
                break
            data.append(byte)
        size = len(self._check(b''))
        assert bytes(self._byte() for _ in range(size)) == self._check(bytes(data))
        return bytes(data)

    def is_silent(self) -> bool:
        """Tell whether nothing has come so far."""
        return not self._heard and not select.select([self._line], [], [], 0)[0]

    def ask(self, station: int, cmd: int, data: bytes, is_slow: bool = False) -> bytes:
        """Return STS and data of the reply to a command."""
        self._tns += 1
        tns = self._tns.to_bytes(2, 'little')
        self.say(self.frame(bytes((station, US, cmd, 0)) + tns + data), is_slow)
        assert self.hear() == ACK
        reply = self.hear()
        self.say(ACK)
        assert reply[:3] + reply[4:6] == bytes((US, station, cmd | 0x40)) + tns
        return reply[3:4] + reply[6:]


def simulator(folder: Path, *args: str) -> Process:
    """Start a simulator with the data above."""
    data = folder / 'data.csv'
    data.write_text(DATA, encoding='utf-8')
    return Process('simulator', '--data', str(data), *args)


class Line:
    """A simulator and a client on one pseudo-terminal."""

    def __init__(self, folder: Path, check: str) -> None:
        name = folder / 'line'
        self.simulator = simulator(folder, '--full-duplex', '1', '--pty', str(name),
                                   '--check', check)
        self.simulator.wait_for('stations 1 ', f' on {name}, {check}')
        self._descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._descriptor)
        self.client = Client(self._descriptor, check)

    def close(self) -> None:
        """End all of it; nothing may be left unsaid."""
        assert self.client.is_silent()
        os.close(self._descriptor)
        self.simulator.end()


@pytest.fixture
def line(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Line]:
    """Return a line with CRC, or with the check that a test names."""
    made = Line(tmp_path, getattr(request, 'param', 'CRC'))
    yield made
    made.close()


# Typed read and write of words of N7 (M 7-28, 7-30): offset, total, system address 07 00 07 n.
def typed_read(element: int, words: int) -> bytes:
    """Return FNC and parameters."""
    return bytes((0x68, 0, 0, words, 0, 0x07, 0, 7, element, words, 0))


def typed_write(element: int, *values: int) -> bytes:
    """Return FNC and parameters: an array of integers."""
    words = b''.join(value.to_bytes(2, 'little', signed=True) for value in values)
    return bytes((0x67, 0, 0, len(values), 0, 0x07, 0, 7, element,
                  0x99, 0x09, 1 + len(words), 0x42)) + words


@pytest.mark.parametrize(('line', 'is_slow'), [('CRC', True), ('BCC', False)], indirect=['line'])
def test_commands_to_a_peer_are_executed_and_answered(line: Line, is_slow: bool) -> None:
    client = line.client
    for _ in range(3):
        assert client.ask(1, 0x0F, typed_read(0, 4), is_slow) == bytes.fromhex(
            '00 99 09 09 42 B0 04 03 10 FE FF 10 00')
    assert client.ask(1, 0x0F, typed_write(20, 5, -6, 0x1010, 0x0310), is_slow) == b'\0'
    assert client.ask(1, 0x0F, typed_read(20, 4), is_slow) == bytes.fromhex(
        '00 99 09 09 42 05 00 FA FF 10 10 10 03')
    assert client.ask(1, 0x0F, typed_read(200, 1), is_slow) == b'\xF0\x07'
    assert client.ask(1, 0x06, b'\0\x10\x10\x02', is_slow) == b'\0\x10\x10\x02'
    assert client.ask(1, 0x06, b'\3', is_slow)[:4] == b'\0\x06\xEB\x15'
    assert client.ask(0, 0x0F, typed_read(0, 1), is_slow)[-2:] == b'\xB0\x04'
    assert client.ask(1, 0x0B, b'\2', is_slow) == b'\x10'


def test_message_of_the_plc(line: Line) -> None:
    client = line.client
    line.simulator.type('msg 1 N7:50 11 22\n')
    command = client.hear()
    assert command[:4] == bytes((5, 1, 0x0F, 0))
    # Total 2, memory area 0, file 7, element 50, then an array of integers (M 7-30, 13-10).
    assert command[6:] == bytes.fromhex('67 00 00 02 00 06 07 32 95 09 42 0B 00 16 00')
    client.say(NAK)
    assert client.hear() == command
    client.say(ACK)
    reply = bytes((1, 5, 0x4F, 0)) + command[4:6]
    client.say(client.frame(reply))
    assert client.hear() == ACK
    line.simulator.wait_for('station 1: msg N7:50 confirmed')


def test_slow_port_is_given_the_time_that_a_message_takes(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    with simulator(tmp_path, '--full-duplex', '1', '--port', os.ttyname(theirs), '--baud',
                   '1200') as process:
        process.wait_for('stations 1')
        client = Client(ours, 'CRC')
        process.type('msg 1 N7:0 ' + ' '.join(map(str, range(100))) + '\n')
        command = client.hear()  # a pseudo-terminal is fast; a port would take almost 2 s for it
        assert not select.select([ours], [], [], 1.4)[0], 'an ENQ before the message has left'
        client.say(ACK + client.frame(bytes((1, 5, 0x4F, 0)) + command[4:6]))
        assert client.hear() == ACK
        process.end()
    os.close(ours)
    os.close(theirs)
