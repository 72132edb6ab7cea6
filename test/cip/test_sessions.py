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

"""The sessions of one place: limits, turns, and ends."""

from __future__ import annotations

from abdf1_ros.cip.identity import CipIdentity
from abdf1_ros.cip.session import EipSession, PcccCommand
from abdf1_ros.cip.sessions import EipSessions
import pytest
from support.ethernet_ip import execute, heard, message, recorded, REGISTER, unconnected

PLACE = '127.0.0.1', 44818


def command(number: int) -> bytes:
    return bytes((0x06, 0)) + number.to_bytes(2, 'little') + b'\0'


class Place:

    def __init__(self) -> None:
        self.now = 100.0
        self.sessions = EipSessions(CipIdentity(1), patience=5.0)

    def come(self, address: str = '10.0.0.1:1') -> EipSession | None:
        session = self.sessions.came(address, PLACE, self.now)
        if session is not None:
            self.say(session, REGISTER)
        return session

    def client(self) -> EipSession:
        session = self.come()
        assert session is not None
        return session

    def say(self, session: EipSession, data: bytes) -> list[PcccCommand]:
        return list(self.sessions.receive(session, data, self.now, self.now))

    def ask(self, session: EipSession, *numbers: int, seconds: int = 0) -> list[int]:
        """Let a client send commands; return those that find no room."""
        return numbers_of(self.say(session, b''.join(unconnected(
            execute(command(number)), session.handle, seconds) for number in numbers)))

    def taken(self, most: int = 1000) -> list[int]:
        found = []
        while len(found) < most and (asked := self.sessions.next()) is not None:
            found.append(asked)
        return numbers_of(found)


def numbers_of(commands: list[PcccCommand]) -> list[int]:
    return [int.from_bytes(asked.pccc[2:4], 'little') for asked in commands]


@pytest.mark.parametrize('client', recorded())
def test_what_clients_of_others_send_is_understood(client: str) -> None:
    place, asked = Place(), list[bytes]()
    place.client()
    for segments in recorded()[client]:
        session = place.sessions.came('10.0.0.1:1', PLACE, place.now)
        assert session is not None
        for segment in segments:
            assert place.say(session, segment) == []
            while (command := place.sessions.next()) is not None:
                asked.append(command.pccc)
                command.respond(
                    bytes((command.pccc[0] | 0x40, 0)) + command.pccc[2:4], place.now)
            for told in heard(bytes(session.outgoing)):
                assert told.status == 0
                if told.command in (0x6F, 0x70):
                    assert told.cip[2 * (told.command == 0x70):][1:4] == bytes(3)
            session.outgoing.clear()
    assert len(asked) >= 4 and {pccc[0] for pccc in asked} == {0x0F}


def test_sessions_take_turns() -> None:
    place = Place()
    busy, calm, late = (place.client() for _ in range(3))
    place.ask(busy, *range(10))
    place.ask(calm, 100, 101)
    assert place.taken(3) == [0, 100, 1]
    place.ask(late, 200)
    assert place.taken() == [101, 2, 200, *range(3, 10)]
    assert place.sessions.next() is None


def test_commands_that_wait_are_limited_for_each_client_alone() -> None:
    place = Place()
    clients = [place.client() for _ in range(32)]
    for client in clients[1:]:
        assert place.ask(client, *range(20)) == [16, 17, 18, 19]
    assert place.ask(clients[0], 100) == []
    assert 100 in place.taken(32)


def test_old_commands_wait_no_more() -> None:
    place = Place()
    patient, hasty = place.client(), place.client()
    place.ask(patient, 1)
    place.ask(hasty, 2)
    place.ask(hasty, 3, seconds=1)
    place.ask(hasty, 4)
    place.now += 0.9
    assert list(place.sessions.expire(place.now)) == []
    place.now += 0.2
    assert numbers_of(list(place.sessions.expire(place.now))) == [3]
    place.ask(patient, 5)
    place.now += 3.95
    assert numbers_of(list(place.sessions.expire(place.now))) == [1, 2, 4]
    assert place.taken() == [5]


def test_nothing_is_left_of_a_session_that_has_ended() -> None:
    place = Place()
    one, two = place.client(), place.client()
    place.ask(one, 1, 2)
    place.ask(two, 3)
    asked = place.sessions.next()
    assert asked is not None and asked.session is one
    place.sessions.ended(one)
    place.sessions.ended(one)
    one.outgoing.clear()
    asked.respond(bytes(4), place.now)
    assert (place.taken(), one.is_over, one.outgoing) == ([3], True, b'')
    place.ask(two, 4)
    place.say(two, message(0x66, session=two.handle))
    assert (place.taken(), place.sessions.all, two.is_over) == ([], [], True)


def test_another_client_may_not_use_a_session() -> None:
    place = Place()
    one, two = place.client(), place.client()
    two.outgoing.clear()
    assert one.handle != two.handle
    place.say(two, unconnected(execute(command(1)), one.handle))
    assert [told.status for told in heard(bytes(two.outgoing))] == [0x64]
    place.say(two, message(0x66, session=one.handle))
    assert not one.is_over and not two.is_over and place.taken() == []


def test_a_flood_of_clients_throws_out_nobody_who_speaks() -> None:
    place = Place()
    clients = [place.client() for _ in range(32)]
    assert place.come() is None
    place.now += 60.0
    for client in clients[1:]:
        place.ask(client, 1)
    place.now += 60.0
    assert place.come() is None  # the silent one has 120 s
    place.now += 0.1
    new = place.client()
    assert clients[0].is_over and not any(client.is_over for client in clients[1:])
    assert place.sessions.all == [*clients[1:], new]
    assert new.handle not in [client.handle for client in clients]
    assert place.come() is None
