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

"""Fuzz target: the sessions of an EtherNet/IP place, with several clients and time."""

from __future__ import annotations

from abdf1_ros.cip.encapsulation import HEADER_SIZE, MOST_DATA
from abdf1_ros.cip.identity import CipIdentity
from abdf1_ros.cip.session import EipSession, PcccCommand
from abdf1_ros.cip.sessions import EipSessions, MOST_OF_SESSION, MOST_SESSIONS
from support.ethernet_ip import connected, Heard, heard, REGISTER, unconnected

_CLIENTS = 4
_LONGEST = 512  # bytes of one read, as of a port
_LARGEST_REPLY = 900  # bytes


class _Place:

    def __init__(self) -> None:
        self.now = 100.0
        self.sessions = EipSessions(CipIdentity(1), patience=5.0)
        self.clients: dict[int, EipSession] = {}
        self.connection = 0
        self.count = 0
        self.taken: list[PcccCommand] = []
        self._asked = 0

    def say(self, who: int, data: bytes) -> None:
        """Let a client say something."""
        session = self.clients.get(who)
        if session is None or session.is_over:
            session = self.sessions.came('10.0.0.1:1', ('127.0.0.1', 44818), self.now)
            assert session is not None
            self.clients[who] = session
        before = session.commands
        for command in self.sessions.receive(session, data, self.now, self.now):
            command.respond(command.pccc[:4], self.now)
        assert session.commands - before <= len(data) // HEADER_SIZE + 1
        self._check(session, data)

    def _check(self, session: EipSession, data: bytes) -> None:
        """Read what it hears: whole messages, of bounded length."""
        assert len(session.outgoing) <= (len(data) // HEADER_SIZE + 1) * _LARGEST_REPLY
        for told in heard(bytes(session.outgoing)):
            self._look(session, told)
        session.outgoing.clear()
        assert len(session.waiting) <= MOST_OF_SESSION
        assert len(self.sessions.all) <= MOST_SESSIONS

    def _look(self, session: EipSession, told: Heard) -> None:
        assert told.status in (0, 1, 3, 0x64, 0x65, 0x69)
        assert not told.status or len(told.data) in (0, 4)
        if told.command in (0x6F, 0x70) and not told.status:
            assert told.session == session.handle
            cip = told.cip[2 * (told.command == 0x70):]
            assert cip[0] & 0x80 and len(cip) >= 4 + 2 * cip[3]
            if cip[0] in (0xD4, 0xDB) and not cip[2]:
                self.connection = int.from_bytes(cip[4:8], 'little')

    def answer(self, data: bytes) -> None:
        """Take the next command, and answer it and those before it."""
        for command in self.sessions.expire(self.now):
            assert command.session in self.sessions.all
        while (command := self.sessions.next()) is not None:
            assert not command.session.is_over and len(command.pccc) >= 4
            self.taken.append(command)
        for command in self.taken:
            before = len(command.session.outgoing)
            command.respond(bytes((command.pccc[0] | 0x40, 0)) + command.pccc[2:4] + data,
                            self.now)
            assert not (command.session.is_over and len(command.session.outgoing) > before)
            self._check(command.session, bytes(MOST_DATA))
        self.taken.clear()


def one_input(data: bytes) -> None:
    """Play a script: how, a length, and bytes."""
    place, at = _Place(), 0
    while at + 2 <= len(data):
        how, size = data[at], data[at + 1]
        said = data[at + 2:at + 2 + size]
        at += 2 + size
        who, kind = how % _CLIENTS, how // _CLIENTS % 8
        session = place.clients.get(who)
        handle = session.handle if session is not None else 0
        if kind == 0:
            place.say(who, REGISTER)
        elif kind == 1:
            place.say(who, unconnected(said, handle, how >> 7))
        elif kind == 2:
            place.count += 1
            place.say(who, connected(said, handle, place.connection, place.count - (how >> 7)))
        elif kind == 3:
            place.now += size
        elif kind == 4:
            place.answer(said)
        elif kind == 5 and session is not None:
            place.sessions.ended(session)
        else:
            place.say(who, said[:_LONGEST])
    place.answer(b'')
    assert not place.sessions.waiting
