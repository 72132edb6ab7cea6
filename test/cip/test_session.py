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

"""Sessions of EtherNet/IP, byte by byte: what clients send, and what nobody should."""

from __future__ import annotations

from itertools import count
import math
import random

from abdf1_ros.cip.identity import CipIdentity
from abdf1_ros.cip.session import EipSession, PcccCommand
import pytest
from support.cases import for_all
from support.ethernet_ip import (
    connected,
    CONTEXT,
    execute,
    forward_close,
    forward_open,
    Heard,
    heard,
    KEY,
    MANAGER,
    message,
    REGISTER,
    REQUESTOR,
    routed,
    TO_PCCC,
    unconnected,
)

READ = bytes.fromhex('0F 00 34 12 A2 02 07 89 00 00')
REPLY = bytes.fromhex('4F 00 34 12 2A 00')
HANDLE = 7
PLACE = '192.168.1.5', 44818


class End:
    """The end of a client, and the session that it talks to."""

    def __init__(self, *, is_registered: bool = True) -> None:
        self.now = 100.0
        self.numbers = count(1000)
        self.session = EipSession(
            '10.0.0.9:5000', PLACE, HANDLE, CipIdentity(0x12345678), self.numbers, self.now)
        if is_registered:
            told, = self.say(REGISTER)
            assert (told.session, told.status, told.data) == (HANDLE, 0, bytes((1, 0, 0, 0)))

    def say(self, data: bytes) -> list[Heard]:
        """Send bytes; return the replies."""
        self.asked = list(self.session.receive(data, self.now, self.now - 0.5))
        return self.replies()

    def replies(self) -> list[Heard]:
        told = bytes(self.session.outgoing)
        self.session.outgoing.clear()
        return heard(told)

    def request(self, cip: bytes) -> bytes:
        """Send a request that is answered at once; return the response."""
        told, = self.say(unconnected(cip, HANDLE))
        assert told[:4] == (0x6F, HANDLE, 0, CONTEXT)
        assert told.data[:12] == bytes.fromhex('00000000 0000 0200 0000 0000')
        assert self.asked == []
        return told.cip

    def command(self, data: bytes) -> PcccCommand:
        """Send what has one PCCC command in it."""
        assert self.say(data) == []
        asked, = self.asked
        return asked

    def answer(self, asked: PcccCommand, reply: bytes = REPLY) -> Heard:
        """Answer a command; return what the client hears."""
        asked.respond(reply, self.now)
        told, = self.replies()
        return told

    def open(self, **how: object) -> int:  # noqa: A003
        """Open a connection; return our number of it."""
        told = self.request(forward_open(**how))  # type: ignore[arg-type]
        assert told[1:4] == bytes(3), told.hex(' ')
        return int.from_bytes(told[4:8], 'little')


@for_all(('wrap', 'patience'), [
    (lambda cip: unconnected(cip, HANDLE), math.inf),
    (lambda cip: unconnected(cip, HANDLE, 5), 5.0),
    (lambda cip: unconnected(routed(cip), HANDLE), 9.216),
    (lambda cip: unconnected(routed(cip, bytes((1, 0)), b'\x00\x00'), HANDLE), math.inf),
    (lambda cip: unconnected(routed(cip, ticks=b'\xF3\x07'), HANDLE, 5), 0.056)])
def test_command_and_its_reply(wrap: object, patience: float) -> None:
    end = End()
    for requestor in (REQUESTOR, b'\1', bytes((255,)) + bytes(range(254))):
        asked = end.command(wrap(execute(READ, requestor)))  # type: ignore[operator]
        assert (asked.pccc, asked.came, asked.patience) == (READ, 99.5, patience)
        told = end.answer(asked)
        assert told.cip == bytes.fromhex('CB 00 00 00') + requestor + REPLY
    assert end.session.asker == (0x0100, 0x05040302)
    assert end.session.commands == 3


@for_all('path', [bytes.fromhex('02 20 67 24 01'), bytes.fromhex('04 21 00 67 00 25 00 01 00')])
def test_both_ways_to_write_a_path(path: bytes) -> None:
    assert End().command(unconnected(b'\x4B' + path + REQUESTOR + READ, HANDLE)).pccc == READ


def test_who_we_are() -> None:
    end = End(is_registered=False)
    whole = bytes.fromhex('0000 0C00 0100 0101 3000 78563412') + b'\x09abdf1_ros'
    listed, services, interfaces = end.say(message(0x63) + message(4) + message(0x64))
    assert listed.data == bytes.fromhex(
        '0100 0C00 2B00 0100 0002 AF12 C0A80105 0000000000000000') + whole + b'\x03'
    assert services.data == bytes.fromhex('0100 0001 1400 0100 2000') + b'Communications\0\0'
    assert interfaces.data == bytes(2)
    assert {told.context for told in (listed, services, interfaces)} == {CONTEXT}
    end = End()
    to_us = bytes.fromhex('02 20 01 24 01')
    assert end.request(b'\1' + to_us) == bytes.fromhex('81 00 00 00') + whole
    parts = [end.request(b'\x0E' + bytes.fromhex('03 20 01 24 01 30') + bytes((number,)))
             for number in range(1, 9)]
    assert b''.join(part[4:] for part in parts) == whole + b'\x03'
    assert {part[:4] for part in parts} == {bytes.fromhex('8E 00 00 00')}


def test_place_of_ipv6_tells_no_address_of_ipv4() -> None:
    listed = CipIdentity(1).listed('::1', 44818)
    assert listed[8:24] == bytes.fromhex('0002 AF12 00000000') + bytes(8)


@for_all(('cip', 'told'), [
    (b'\x05' + bytes.fromhex('02 20 01 24 01'), '85 00 08 00'),  # reset
    (b'\x10' + bytes.fromhex('03 20 01 24 01 30 07 41'), '90 00 08 00'),  # write an attribute
    (b'\x10' + bytes.fromhex('03 20 F5 24 01 30 05') + bytes(22), '90 00 05 00'),  # our address
    (b'\x0E' + bytes.fromhex('03 20 01 24 01 30 09'), '8E 00 14 00'),
    (b'\x0E' + bytes.fromhex('02 20 01 24 01'), '8E 00 14 00'),
    (b'\x0E' + bytes.fromhex('03 20 01 24 00 30 01'), '8E 00 05 00'),
    (b'\x4C' + TO_PCCC + REQUESTOR + READ, 'CC 00 08 00'),
    (b'\x4B' + bytes.fromhex('02 20 67 24 02') + REQUESTOR + READ, 'CB 00 05 00'),
    (b'\x4B' + bytes.fromhex('02 20 A6 24 01') + REQUESTOR + READ, 'CB 00 05 00'),  # DH+
    (b'\x0A' + bytes.fromhex('02 20 02 24 01'), '8A 00 08 00'),
    (b'\x07' + MANAGER, '87 00 08 00'),
    (b'\x4B\x00' + REQUESTOR + READ, 'CB 00 04 00'),  # no path
    (b'\x4B\x01\x67\x24' + REQUESTOR + READ, 'CB 00 04 00'),
    (b'\x4B\x01\x24\x01' + REQUESTOR + READ, 'CB 00 04 00'),
    (b'\x4B\xFF\x20\x67\x24\x01', 'CB 00 04 00'),  # the length of the path lies
    (b'\x4B\x01\x21\x00', 'CB 00 04 00'),
    (b'\x4B', 'CB 00 04 00'), (b'', '80 00 04 00'),
    (b'\x4B' + TO_PCCC, 'CB 00 13 00'),
    (b'\x4B' + TO_PCCC + b'\0' + READ, 'CB 00 20 00'),
    (b'\x4B' + TO_PCCC + b'\xFF' + READ, 'CB 00 13 00'),
    (execute(READ[:3]), 'CB 00 13 00'),
    (execute(b'\x4F' + READ[1:]), 'CB 00 20 00'),  # a reply
    (execute(b'\x0F\x10' + READ[2:]), 'CB 00 20 00'),  # a command with STS
    (routed(execute(READ), bytes((1, 5))), 'D2 00 01 01 12 03 01'),  # slot 5
    (routed(execute(READ), bytes((2, 0))), 'D2 00 01 01 11 03 01'),
    (routed(execute(READ), bytes((1, 0, 2, 7))), 'D2 00 01 01 12 03 02'),
    (routed(routed(execute(READ))), 'D2 00 08 00'), (routed(forward_open()), 'D4 00 08 00'),
    (routed(b'\x4B\x09'), 'CB 00 04 00'), (routed(b''), '80 00 04 00'),
    (routed(execute(READ))[:-1], 'D2 00 13 00'),
    (routed(execute(READ)) + b'\0', 'D2 00 15 00'),
    (b'\x52' + MANAGER + b'\x0A\x09\xFF\xFF' + execute(READ), 'D2 00 13 00')])
def test_what_is_refused_is_told(cip: bytes, told: str) -> None:
    assert End().request(cip) == bytes.fromhex(told)


@for_all(('data', 'status'), [
    (message(0x65, bytes((1, 0, 0, 0))), 1),  # it is registered already
    (message(0x72, session=HANDLE), 1), (message(0x1234), 1), (message(1), 1),
    (unconnected(execute(READ), HANDLE + 1), 0x64), (unconnected(execute(READ), 0), 0x64),
    (connected(execute(READ), HANDLE + 1, 1000, 1), 0x64),
    (message(0x6F, session=HANDLE), 3), (message(0x6F, bytes(8), HANDLE), 3),
    (message(0x6F, bytes.fromhex('01000000 0000 0200 0000 0000 B200 0200 0E00'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 FFFF 0000 0000 B200 0200 0E00'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 0200 0000 0000 B200 FF00 0E00'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 0200 0000 0100 00 B200 0000'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 0200 0000 0000 B100 0000'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 0100 0000 0000'), HANDLE), 3),
    (message(0x6F, bytes.fromhex('00000000 0000 0200 0000 0000 B200 0000 00'), HANDLE), 3),
    (message(0x70, bytes.fromhex('00000000 0000 0200 A100 0200 0100 B100 0200 0100'), HANDLE), 3),
    (message(0x70, bytes.fromhex('00000000 0000 0200 A100 0400 01000000 B100 0100 01'), HANDLE),
     3),
    (message(0x63, options=1), 3),
    (message(0x6F, bytes(1025), HANDLE), 0x65), (message(0x00FF, bytes(65535)), 0x65)])
def test_wrong_message_gets_a_status(data: bytes, status: int) -> None:
    end = End()
    told, = end.say(data)
    assert (told.status, told.context, told.data) == (status, CONTEXT, b'')
    assert end.asked == []
    assert end.request(b'\x0E' + bytes.fromhex('03 20 01 24 01 30 01'))[4:] == bytes(2)


def test_registration() -> None:
    for data, status, told_data in (
            (bytes((2, 0, 0, 0)), 0x69, bytes((1, 0, 0, 0))), (bytes((1, 0, 1, 0)), 0x69, bytes(
                (1, 0, 0, 0))), (b'', 0x65, b''), (bytes(5), 0x65, b'')):
        end = End(is_registered=False)
        told, = end.say(message(0x65, data))
        assert (told.status, told.data, told.session) == (status, told_data, 0)
        told, = end.say(unconnected(execute(READ), HANDLE))
        assert told.status == 0x64
        assert end.say(REGISTER)[0].status == 0


def test_what_has_no_reply() -> None:
    end = End()
    assert end.say(message(0) + message(0, b'any') + message(0x65, status=1)) == []
    assert end.say(message(0, bytes(65535))) == []
    assert end.say(connected(execute(READ), HANDLE, 999, 1)) == []
    assert end.say(message(0x66, session=HANDLE + 1)) == [] and not end.session.is_over
    asked = end.command(unconnected(execute(READ), HANDLE))
    assert end.say(message(0x66, session=HANDLE) + message(0x63)) == [] and end.session.is_over
    asked.respond(REPLY, 101.0)
    assert end.replies() == []


def test_bytes_come_in_any_pieces() -> None:
    data = b''.join((
        message(0x63), unconnected(execute(READ), HANDLE), message(0x6F, bytes(3000), HANDLE),
        unconnected(routed(execute(READ[:-1] + b'\1')), HANDLE), message(4)))
    for seed in range(50):
        chance, end, at = random.Random(seed), End(), 0
        commands, statuses = [], []
        while at < len(data):
            size = chance.choice((1, 7, 23, 24, 25, 400))
            statuses += [told.status for told in end.say(data[at:at + size])]
            commands += [asked.pccc[-1] for asked in end.asked]
            at += size
        assert (commands, statuses) == ([0, 1], [0, 0x65, 0])


@pytest.mark.parametrize('is_large', [False, True])
def test_connection_is_opened_used_and_closed(is_large: bool) -> None:
    end = End()
    told = end.request(forward_open(is_large=is_large, size=4000 if is_large else 500))
    assert told == bytes((0xDB if is_large else 0xD4, 0, 0, 0)) + bytes.fromhex(
        'E8030000 EFBEADDE') + KEY + bytes.fromhex('40420F00 40420F00 0000')
    several = [end.command(connected(execute(READ), HANDLE, 1000, number))
               for number in range(1, 4)]
    for asked in several:
        asked.respond(REPLY, 100.1)
    for number, answer in enumerate(end.replies(), 1):
        assert (answer.command, answer.session, answer.context) == (0x70, HANDLE, CONTEXT)
        assert answer.data[8:16] == bytes.fromhex('A1000400 EFBEADDE')
        assert answer.cip == bytes((number, 0, 0xCB, 0, 0, 0)) + REQUESTOR + REPLY
    assert end.say(connected(b'\x0E' + bytes.fromhex('03 20 01 24 01 30 03'), HANDLE, 1000, 9))[
        0].cip == bytes.fromhex('0900 8E000000 0100')
    assert end.request(forward_close()) == bytes.fromhex('CE 00 00 00') + KEY + bytes(2)
    assert end.say(connected(execute(READ), HANDLE, 1000, 10)) == []
    assert end.request(forward_close()) == bytes.fromhex('CE 00 01 01 07 01') + KEY + bytes(2)


@for_all(('how', 'extended'), [
    ({'transport': 0xA2}, 0x0103), ({'transport': 0x01}, 0x0103), ({'interval': 0}, 0x0111),
    ({'multiplier': 8}, 0x0111), ({'multiplier': 255}, 0x0111), ({'kind': 1}, 0x0123),
    ({'kind': 0}, 0x0123), ({'size': 0}, 0x0127),
    ({'path': b''}, 0x0315), ({'path': bytes.fromhex('20 04 24 01')}, 0x0315),
    ({'path': bytes.fromhex('01 00')}, 0x0315),
    ({'path': bytes.fromhex('01 02 20 02 24 01')}, 0x0312),
    ({'path': bytes.fromhex('02 00 20 02 24 01')}, 0x0311),
    ({'path': bytes.fromhex('01 02 20 A6 24 02 2C 01')}, 0x0312)])
def test_connection_that_we_do_not_have_is_refused(how: dict[str, object], extended: int) -> None:
    for is_large in (False, True):
        end = End()
        told = end.request(forward_open(is_large=is_large, **how))  # type: ignore[arg-type]
        assert told == bytes((0xDB if is_large else 0xD4, 0, 1, 1)) + extended.to_bytes(
            2, 'little') + KEY + bytes(2)
        assert not end.session.connections


def test_any_part_of_an_open_or_close_is_refused_and_opens_nothing() -> None:
    whole = {forward_open(): 0xD4, forward_open(is_large=True): 0xDB, forward_close(): 0xCE}
    for data, service in whole.items():
        end = End()
        for size in range(6, len(data)):
            assert end.request(data[:size]) == bytes((service, 0, 0x13, 0))
        assert end.request(data + b'\0') == bytes((service, 0, 0x15, 0))
        assert not end.session.connections


def test_number_of_connections_is_limited_and_none_is_thrown_out() -> None:
    end = End()
    keys = [bytes((number,)) + KEY[1:] for number in range(9)]
    numbers = [end.open(key=key, path=bytes.fromhex('01 00 20 02 24 01')) for key in keys[:8]]
    assert end.request(forward_open(key=keys[8]))[2:6] == bytes.fromhex('01 01 13 01')
    assert end.request(forward_open(key=keys[0]))[2:6] == bytes.fromhex('01 01 00 01')
    for number in numbers:
        end.command(connected(execute(READ), HANDLE, number, 1))
    end.request(forward_close(key=keys[3]))
    assert end.open(key=keys[8]) not in numbers  # a number never means another connection
    assert end.say(connected(execute(READ), HANDLE, numbers[3], 2)) == []


def test_connection_ends_when_its_client_is_silent() -> None:
    end = End()
    first = end.open(interval=100_000)  # with 4 times that; 10 s at first
    for wait, is_open in ((9.9, True), (0.39, True), (0.41, False)):
        end.now += wait
        end.say(connected(execute(READ), HANDLE, first, int(end.now * 100) & 0xFFFF))
        assert bool(end.asked) is is_open
        for asked in end.asked:
            end.answer(asked)
    second = end.open(interval=100_000)
    asked = end.command(connected(execute(READ), HANDLE, second, 1))
    end.now += 5.0  # the line is slow, and the client waits
    assert end.answer(asked).command == 0x70
    end.now += 0.39
    end.command(connected(execute(READ), HANDLE, second, 2))


def test_repeated_request_is_carried_out_once() -> None:
    end = End()
    number = end.open()
    asked = end.command(connected(execute(READ), HANDLE, number, 5))
    assert end.say(connected(execute(READ), HANDLE, number, 5)) == [] and end.asked == []
    first = end.answer(asked)
    assert end.say(connected(execute(READ), HANDLE, number, 5)) == [first]
    assert end.asked == []
    # the same count with other bytes is another request; a reply that comes late is not its own
    other = end.command(connected(execute(READ[:-1] + b'\1'), HANDLE, number, 5))
    assert end.say(connected(execute(READ[:-1] + b'\1'), HANDLE, number, 5)) == []
    assert end.answer(other, REPLY[:-2] + b'\x01\x00').cip.endswith(b'\x01\x00')
    for later in range(6, 22):  # 16 are known
        end.answer(end.command(connected(execute(READ), HANDLE, number, later)))
    assert len(end.say(connected(execute(READ), HANDLE, number, 6))) == 1 and not end.asked
    end.answer(end.command(connected(execute(READ), HANDLE, number, 22)))
    end.command(connected(execute(READ[:-1] + b'\1'), HANDLE, number, 5))


def test_late_reply_is_not_taken_for_the_reply_to_a_request_that_has_its_count() -> None:
    end = End()
    number = end.open()
    late = end.command(connected(execute(READ), HANDLE, number, 5))
    other = end.command(connected(execute(READ[:-1] + b'\1'), HANDLE, number, 5))
    late.respond(REPLY, end.now)
    assert end.replies() == []
    assert end.say(connected(execute(READ[:-1] + b'\1'), HANDLE, number, 5)) == []
    assert end.asked == []
    assert end.answer(other, REPLY[:-2] + b'\x01\x00').cip.endswith(b'\x01\x00')


def test_request_under_way_is_known_however_many_follow() -> None:
    end = End()
    number = end.open()
    first = end.command(connected(execute(READ), HANDLE, number, 1))
    for later in range(2, 60):
        end.answer(end.command(connected(execute(READ), HANDLE, number, later)))
    assert end.say(connected(execute(READ), HANDLE, number, 1)) == [] and end.asked == []
    assert end.answer(first).cip[:2] == bytes((1, 0))


def test_reply_is_for_the_connection_that_asked_or_for_nobody() -> None:
    end = End()
    number = end.open()
    asked = end.command(connected(execute(READ), HANDLE, number, 5))
    end.request(forward_close())
    assert end.open() != number
    asked.respond(REPLY, end.now)
    assert end.replies() == []


def test_reply_that_is_too_large_for_the_connection_is_an_error() -> None:
    end = End()
    number = end.open(size=2 + 4 + 7 + 6)
    good, bad = (end.answer(end.command(connected(execute(READ), HANDLE, number, at)), reply)
                 for at, reply in ((1, REPLY), (2, REPLY + b'\0')))
    assert good.cip == bytes.fromhex('0100 CB000000') + REQUESTOR + REPLY
    assert bad.cip == bytes.fromhex('0200 CB001100')


def test_services_of_the_connection_manager_are_not_carried_out_on_a_connection() -> None:
    end = End()
    number = end.open()
    for cip in forward_close(), forward_open(key=bytes(8)), routed(execute(READ)):
        told, = end.say(connected(cip, HANDLE, number, cip[0]))
        assert told.cip[2:] == bytes((cip[0] | 0x80, 0, 8, 0))
    assert len(end.session.connections) == 1
