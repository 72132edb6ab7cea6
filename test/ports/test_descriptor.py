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

"""Reading from and writing to descriptors."""

import os
import socket
import threading

from abdf1_ros.ports.descriptor import DescriptorPort
import pytest
from support.ptys import PATIENCE

Sockets = tuple[DescriptorPort, socket.socket]


def test_read_returns_what_is_there(sockets: Sockets, wake: int) -> None:
    port, other = sockets
    other.send(b'abc')
    assert port.read(None, wake) == b'abc'
    assert port.read(0.0, wake) == b''
    assert port.read(0.001, wake) == b''


def test_read_ends_when_woken(sockets: Sockets, pipe: tuple[int, int]) -> None:
    os.write(pipe[1], b'w')
    assert sockets[0].read(None, pipe[0]) == b''


def test_read_from_a_closed_line(sockets: Sockets, wake: int) -> None:
    port, other = sockets
    other.close()
    with pytest.raises(OSError, match='the other end has closed the connection'):
        port.read(None, wake)


def test_write_to_a_closed_line(sockets: Sockets) -> None:
    port, other = sockets
    other.close()
    with pytest.raises(BrokenPipeError):
        port.write(b'abc')


def test_write_to_a_line_that_takes_no_more_does_not_hang(
        sockets: Sockets, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.descriptor.WRITE_TIMEOUT', 0.05)
    with pytest.raises(OSError, match='the line takes no data; is Handshake right'):
        sockets[0].write(bytes(10_000_000))


def test_write_waits_for_a_line_that_is_slow(sockets: Sockets) -> None:
    port, other = sockets
    received = bytearray()

    def read_all() -> None:
        while len(received) < 1_000_000:
            received.extend(other.recv(65536))

    reader = threading.Thread(target=read_all)
    reader.start()
    port.write(bytes(1_000_000))
    reader.join(PATIENCE)
    assert len(received) == 1_000_000


def test_port_tells_that_bytes_have_still_to_leave(sockets: Sockets) -> None:
    port, other = sockets
    assert port.unsent() == 0
    port.write(bytes(300))
    assert port.unsent() >= 300
    other.recv(300)
    assert port.unsent() == 0


def test_port_that_cannot_tell_what_has_still_to_leave_says_none(pipe: tuple[int, int]) -> None:
    assert DescriptorPort(pipe[1], lambda: None).unsent() == 0
