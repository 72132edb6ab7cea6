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

"""A port for many clients, with real sockets and a clock that stands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, field
import socket
import time

from abdf1_ros.ports.clients import ClientsThread
from support.device_server import OWN_HOST


@dataclass
class Said:
    """What was said to a client, and what came from it."""

    address: str
    outgoing: bytearray = field(default_factory=bytearray)
    is_over: bool = False
    heard: bytearray = field(default_factory=bytearray)
    came: list[tuple[float, float]] = field(default_factory=list)


class Echo:
    """A server that says what it hears; it refuses clients from the third on."""

    def __init__(self) -> None:
        self.now = 100.0
        self.talks: list[Said] = []
        self.left: list[Said] = []
        self.turns = 0
        with socket.create_server((OWN_HOST, 0)) as free:
            self.port = free.getsockname()[1]
        self.thread = ClientsThread(OWN_HOST, self.port, self, self.fault, lambda: self.now)

    def fault(self, error: Exception) -> None:
        raise error

    def came(self, address: str, place: tuple[str, int], now: float) -> Said | None:
        assert place == (OWN_HOST, self.port)
        if len(self.talks) == 2:
            return None
        self.talks.append(Said(address))
        return self.talks[-1]

    def receive(self, talk: Said, data: bytes, now: float, came: float) -> None:
        talk.came.append((came, now))
        talk.heard += data
        talk.outgoing += data
        talk.is_over = data.endswith(b'!')

    def gone(self, talk: Said) -> None:
        self.left.append(talk)

    def turn(self, now: float) -> None:
        self.turns += 1


@contextmanager
def echo(clients: int) -> Iterator[tuple[Echo, list[socket.socket]]]:
    """Run a server with clients that it knows in this order."""
    server = Echo()
    server.thread.start()
    with ExitStack() as stack:
        stack.callback(server.thread.stop)
        wait_for(lambda: server.thread.state.is_open)
        ends = []
        for number in range(clients):
            ends.append(stack.enter_context(socket.create_connection(
                (OWN_HOST, server.port), 30.0)))
            wait_for(lambda: len(server.talks) > number)  # noqa: B023
            server.now += 1.0  # it rests after each
        yield server, ends


def wait_for(condition: object) -> None:
    give_up = time.monotonic() + 30.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < give_up
        time.sleep(0.01)


def test_each_client_hears_its_own_and_is_closed_when_all_is_said() -> None:
    with echo(2) as (server, (one, two)):
        one.sendall(b'one')
        two.sendall(b'two!')
        assert (one.recv(10), two.recv(10), two.recv(10)) == (b'one', b'two!', b'')
        wait_for(lambda: server.left == [server.talks[1]])
        assert server.talks[0].address == '{}:{}'.format(*one.getsockname())
        one.close()
        wait_for(lambda: len(server.left) == 2)


def test_client_that_is_refused_is_closed() -> None:
    with echo(2) as (server, _), socket.create_connection((OWN_HOST, server.port), 30.0) as late:
        assert late.recv(10) == b''
        assert server.left == []


def test_client_that_sends_faster_than_a_line_rests_and_the_others_do_not() -> None:
    with echo(2) as (server, (flood, calm)):
        flood.sendall(bytes(20_000))
        wait_for(lambda: len(server.talks[0].heard) >= 4096)
        for number in range(20):
            calm.sendall(bytes((number,)))
            assert calm.recv(10) == bytes((number,))
        assert 4096 <= len(server.talks[0].heard) <= 4096 + 512
        server.now += 0.5  # in which a line has sent all that
        wait_for(lambda: len(server.talks[0].heard) >= 2 * 4096)
        calm.sendall(b'x')
        calm.recv(10)
        assert len(server.talks[0].heard) <= 2 * (4096 + 512)


def test_bytes_of_a_client_that_rests_are_as_old_as_its_last_read() -> None:
    with echo(2) as (server, (flood, calm)):
        begun = server.now
        flood.sendall(bytes(6000))
        wait_for(lambda: len(server.talks[0].heard) >= 4096)
        server.now += 5.0
        wait_for(lambda: len(server.talks[0].heard) == 6000)
        turns = server.turns
        wait_for(lambda: server.turns > turns)
        server.now += 7.0
        wait_for(lambda: server.turns > turns + 3)
        calm.sendall(b'x')
        calm.recv(10)
        assert all(came <= begun for came, now in server.talks[0].came)
        assert {now for _, now in server.talks[0].came} == {begun, begun + 5.0}
        assert server.talks[1].came == [(begun + 12.0, begun + 12.0)]


def test_port_is_closed_while_it_is_released() -> None:
    with echo(1) as (server, (client,)):
        server.thread.release()
        assert client.recv(10) == b''
        with socket.create_server((OWN_HOST, server.port)):  # another may have it
            assert server.left == server.talks
            assert not server.thread.state.is_open
        server.thread.take()
        wait_for(lambda: server.thread.state.is_open)


def test_client_that_leaves_while_it_rests_is_gone_at_once() -> None:
    with echo(2) as (server, (flood, calm)):
        flood.sendall(bytes(200_000))
        wait_for(lambda: len(server.talks[0].heard) >= 4096)
        flood.close()
        wait_for(lambda: server.left == [server.talks[0]])
        assert len(server.talks[0].heard) <= 4096 + 512
        calm.sendall(b'x')
        assert calm.recv(10) == b'x'


def test_client_that_sends_without_end_is_closed_after_10_s() -> None:
    with echo(2) as (server, (flood, calm)):
        flood.sendall(bytes(200_000))
        begun, heard = server.now, 0
        while not server.left:
            wait_for(lambda: server.left or len(server.talks[0].heard) > heard)  # noqa: B023
            heard = len(server.talks[0].heard)
            server.now += 1.0
            calm.sendall(b'x')
            assert calm.recv(10) == b'x'
        assert server.left == [server.talks[0]]
        assert 10.0 < server.now - begun < 15.0
