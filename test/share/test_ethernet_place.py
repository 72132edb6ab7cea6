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

"""A place that speaks EtherNet/IP: real sockets and threads, many clients, good ones and bad."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import socket
import struct
import subprocess
import sys
import threading
import time

from abdf1_ros.driver.guests import GuestCommand, GuestListener, GuestQueue
from abdf1_ros.ports import clients
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.ethernet_place import EthernetPlace
from abdf1_ros.share.guest_line import guest_place, GuestLine
import pytest
from share.test_guest_line import free_port, shared, wait_for
from support.device_server import OWN_HOST
from support.driver_bench import stored
from support.ethernet_ip import (
    connected,
    EthernetClient,
    execute,
    forward_open,
    message,
    REGISTER,
    unconnected,
)


def read_words(first: int, count: int, tns: int) -> bytes:
    """Return a read of N7."""
    return struct.pack('<BBHBBBBBB', 0x0F, 0, tns, 0xA2, 2 * count, 7, 0x89, first, 0)


def write_word(file: int, element: int, value: int, tns: int) -> bytes:
    return struct.pack('<BBHBBBBBBh', 0x0F, 0, tns, 0xAA, 2, file, 0x89, element, 0, value)


@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_many_clients_read_and_write_and_each_gets_its_own_reply(
        mode: str, tmp_path: Path) -> None:
    """All have the same numbers of commands, as programs of one product have."""
    port, wrong = free_port(), list[object]()

    def work(number: int) -> None:
        with EthernetClient(OWN_HOST, port, is_connected=bool(number % 2)) as client:
            for tns in range(12):
                told = client.execute(read_words(number * 3, 3, tns))
                if told != b'\x4F\0' + struct.pack('<H3h', tns, *range(
                        number * 3, number * 3 + 3)):
                    wrong.append((number, told))
                if client.execute(write_word(10, number + 1, tns, tns))[:2] != b'\x4F\0':
                    wrong.append((number, tns))

    with shared(tmp_path, f'eip:{OWN_HOST}:{port}', 'Write', mode) as line:
        threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
        assert wrong == []
        assert [stored(line.plc, f'N10:{number + 1}') for number in range(8)] == 8 * [b'\x0B\0']
        guest = line.guests[0].guest
        assert (guest.commands, guest.unanswered, guest.refused) == (8 * 24, 0, 0)
        wait_for(lambda: line.guests[0].state == 'waiting for a client')


def test_replies_tell_rights_limits_and_what_is_too_long(tmp_path: Path) -> None:
    port = free_port()
    with shared(tmp_path, f'eip:{OWN_HOST}:{port}') as line, \
            EthernetClient(OWN_HOST, port) as client:
        assert client.execute(write_word(10, 1, 5, 9)) == bytes.fromhex('4F 60 0900')
        assert client.execute(read_words(1, 1, 10)) == bytes.fromhex('4F 00 0A00 0100')
        assert client.execute(bytes((0x0F, 0, 1, 0)) + bytes(400)) == bytes.fromhex('4F 10 0100')
        assert client.execute(bytes.fromhex('07 00 0100')) == bytes.fromhex('47 60 0100')
        assert line.guests[0].guest.refused == 2
        wait_for(lambda: line.guests[0].state.startswith('1 client: 127.0.0.1:'))
        assert line.guests[0].state.endswith(
            ' (vendor 77, serial number 12345678, 4 commands)')


class Queue(GuestQueue):
    """A queue that keeps what it gets."""

    def __init__(self) -> None:
        self.asked: list[GuestCommand] = []
        self.refused: list[GuestCommand] = []

    def put(self, command: GuestCommand) -> None:
        self.asked.append(command)

    def refuse(self, command: GuestCommand) -> None:
        self.refused.append(command)
        command.answer(command.packet.reply(sts=1))


class Served:
    """A place without a line."""

    def __init__(self, port: int = 0, **network: object) -> None:
        self.port = port or free_port()
        self.queue = Queue()
        self.faults: list[Exception] = []
        self.turned_away: list[str] = []
        listener = GuestListener()
        listener.turned_away = (  # type: ignore[method-assign]
            lambda guest, other, why: self.turned_away.append(why))
        text = f'eip:{OWN_HOST}:{self.port}'
        self.place = EthernetPlace(
            *share_places(text), 3, Network(share=text, **network), self.queue,  # type: ignore
            lambda: None, listener, self.faults.append)

    def client(self, **how: bool) -> EthernetClient:
        return EthernetClient(OWN_HOST, self.port, **how)

    def wait_for_asked(self, count: int) -> list[GuestCommand]:
        wait_for(lambda: len(self.queue.asked) >= count)
        return self.queue.asked


@contextmanager
def served(**network: object) -> Iterator[Served]:
    it = Served(**network)
    it.place.start()
    wait_for(lambda: it.place.state == 'waiting for a client')
    try:
        yield it
    finally:
        it.place.stop()
    assert it.faults == []


def test_commands_wait_here_in_turns_and_go_with_their_session() -> None:
    with served() as it, it.client() as one, it.client() as two:
        for tns in range(4):
            one.send(unconnected(execute(read_words(1, 1, tns)), one.session))
        first, second = it.wait_for_asked(2)
        assert first.packet == (3, 0, 0x0F, 0, 0, bytes.fromhex('A2 02 07 89 01 00'))
        two.send(unconnected(execute(read_words(1, 1, 100)), two.session))
        wait_for(lambda: it.place.waiting == 3)
        assert first.is_wanted() and len(it.queue.asked) == 2
        first.answer(first.packet.reply(b'\1\0'))
        assert one.hear().cip[-6:] == bytes.fromhex('4F 00 0000 0100')
        assert it.wait_for_asked(3)[2].packet.tns == 2
        one.close()
        wait_for(lambda: not second.is_wanted())
        assert it.place.waiting == 1
        second.answer(second.packet.reply(b'\1\0'))
        assert it.wait_for_asked(4)[3].packet.tns == 100
        it.queue.asked[3].answer(it.queue.asked[3].packet.reply(b'\2\0'))
        assert two.hear().cip[-6:] == bytes.fromhex('4F 00 6400 0200')


def test_outcome_of_a_write_whose_client_has_left_is_told_to_nobody() -> None:
    """The client comes again, with the same connection, count and bytes."""
    write = execute(write_word(7, 1, 5, 9))
    with served() as it:
        with it.client(is_connected=True) as gone:
            gone.send(connected(write, gone.session, gone.connection, 1))
            first, = it.wait_for_asked(1)
        with it.client(is_connected=True) as again, it.client() as other:
            again.send(connected(write, again.session, again.connection, 1))
            second = it.wait_for_asked(2)[1]
            assert second.packet == first.packet
            first.answer(first.packet.reply(sts=0x10))
            for client in again, other:
                assert client.ask(message(0x04)).command == 0x04
            second.answer(second.packet.reply())
            assert again.hear().cip[-4:] == bytes.fromhex('4F 00 0900')


def test_command_waits_no_longer_than_its_client_or_cmd_timeout() -> None:
    with served(cmd_timeout=600) as it, it.client() as client:
        for tns in range(3):
            client.send(unconnected(execute(read_words(1, 1, tns)), client.session, 20))
        assert client.hear().cip[-4:] == bytes.fromhex('4F 01 0200')
        assert [asked.patience for asked in it.queue.asked] == [20.0, 20.0]
        assert [asked.packet.tns for asked in it.queue.refused] == [2]


def test_client_that_reads_nothing_delays_nobody_and_is_dropped(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, 'STUCK', 0.5)
    monkeypatch.setattr(clients, 'BURST', 1e9)
    with served() as it, it.client() as good, socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.connect((OWN_HOST, it.port))
        deaf.setblocking(False)
        end = time.monotonic() + 30.0
        is_open = True
        while is_open and time.monotonic() < end:
            try:
                deaf.send(20 * message(0x63))
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:
                is_open = False
            assert good.ask(message(0x04)).status == 0
        assert not is_open
        wait_for(lambda: it.place.state.startswith('1 client'))


def test_one_client_too_many_is_refused_and_told() -> None:
    with served() as it:
        taken = [it.client() for _ in range(32)]
        with socket.create_connection((OWN_HOST, it.port), 30.0) as late:
            assert late.recv(1) == b''
        assert it.turned_away == ['32 programs have the place']
        for client in taken:
            assert client.ask(message(0x04)).status == 0
        assert it.place.state.startswith('32 clients: ')
        assert it.place.state.endswith(' and 16 more')
        for client in taken:
            client.close()


def test_session_is_worth_nothing_on_another_connection() -> None:
    with served() as it, it.client(is_connected=True) as one, it.client() as two:
        told = two.ask(unconnected(execute(read_words(1, 1, 1)), one.session))
        assert told.status == 0x64
        two.send(message(0x66, session=one.session))
        for number in range(8):
            two.send(connected(execute(read_words(1, 1, 1)), two.session, number, 1))
        assert two.ask(unconnected(forward_open(), two.session)).cip[0] == 0xD4
        assert one.ask(message(0x04)).status == 0
        assert it.queue.asked == []


def test_unregistered_session_is_closed_and_may_come_again() -> None:
    with served() as it, it.client() as client:
        client.send(message(0x66, session=client.session))
        with pytest.raises(EOFError):
            client.hear()
        with it.client() as again:
            assert again.session != client.session


def test_command_is_as_old_as_it_can_be_where_this_process_stood_still() -> None:
    now = [100.0]
    text = f'eip:{OWN_HOST}:44818'
    place = EthernetPlace(*share_places(text), 3, Network(share=text), queue := Queue(),
                          lambda: None, GuestListener(), lambda error: None)
    session = place.came('10.0.0.1:1', (OWN_HOST, 44818), now[0])
    assert session is not None
    place.receive(session, REGISTER, 100.0, 99.9)
    for came, at in (99.7, 100.0), (99.5, 100.0):
        place.receive(session, unconnected(
            execute(read_words(1, 1, 1)), session.handle), at, came)
        place.turn(at)
    assert [asked.requested for asked in queue.asked] == [100.0, 99.5]
    place.stop()


def test_place_that_cannot_listen_says_why_until_it_can_and_pauses() -> None:
    with socket.create_server((OWN_HOST, 0)) as other:
        it = Served(other.getsockname()[1])
        it.place.start()
        wait_for(lambda: it.place.fault)
        assert it.place.fault.startswith('cannot open the port: Address already in use')
    wait_for(lambda: not it.place.fault)
    for _ in range(2):
        with it.client() as client:
            it.place.pause()
            with pytest.raises(EOFError):
                client.hear()
        with pytest.raises(ConnectionRefusedError):
            it.client()
        it.place.start()
        wait_for(lambda: it.place.state == 'waiting for a client')
    it.place.stop()
    assert it.faults == []


def test_internal_error_costs_one_client_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    it = Served()
    it.place.start()
    wait_for(lambda: it.place.state == 'waiting for a client')
    with it.client() as good, it.client() as bad:
        monkeypatch.setattr('abdf1_ros.cip.sessions.EipSessions.receive', lambda *_: 1 / 0)
        bad.send(message(0))
        with pytest.raises(EOFError):
            bad.hear()
        monkeypatch.undo()
        assert good.ask(message(0x04)).status == 0
    it.place.stop()
    assert [*map(type, it.faults)] == [ZeroDivisionError]


def test_only_an_ethernet_place_has_this_thread() -> None:
    network = Network()
    made = [guest_place(*share_places(text), (3,), network, Queue(), lambda: None,
                        GuestListener(), lambda error: None)
            for text in ('tcp:4501', 'eip:4501')]
    assert [*map(type, made)] == [GuestLine, EthernetPlace]
    for place in made:
        place.stop()


def test_nothing_is_imported_for_places_that_are_not_set() -> None:
    code = ('import sys, abdf1_ros.share.guest_line, abdf1_ros.ports.link_thread\n'
            'print([name for name in sys.modules if name.startswith(("abdf1_ros.cip", '
            '"abdf1_ros.ports.clients", "abdf1_ros.share.ethernet"))])')
    assert subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True).stdout == '[]\n'
