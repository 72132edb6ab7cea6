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

"""One place where programs connect that speak EtherNet/IP: to them it is one PLC."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
import zlib

from abdf1_ros.cip.identity import CipIdentity
from abdf1_ros.cip.session import EipSession, PcccCommand
from abdf1_ros.cip.sessions import EipSessions, MOST_SESSIONS
from abdf1_ros.df1.frames import MAX_LINK_DATA
from abdf1_ros.df1.machine import MOST_LATE
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand, GuestListener, GuestQueue
from abdf1_ros.ports.clients import ClientsThread, GLANCE
from abdf1_ros.ports.clock import line_time
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import SharePlace
from abdf1_ros.text import counted

# Commands that are given to the link: one on the line, and the next one. The others wait here, so
# each session has its turn, and a session that ends takes its commands along.
_MOST_GIVEN = 2

_MOST_SHOWN = 16  # sessions in a text

_BAD_FORMAT = 0x10  # STS: illegal command or format (M 8-3)
_SOURCE = 0  # SRC of the clients: the PLC sees ours
_ADDRESSES = 2  # bytes: DST and SRC, which PCCC in EtherNet/IP does not have


class EthernetPlace:
    """
    Put the PCCC commands of the clients at ``place`` into ``queue``, for ``station``.

    All clients of a place are one guest. Each reply goes to the session and the connection that
    asked, or nowhere. ``wake``, ``listener`` and ``fault`` are as for ``GuestLine``.
    """

    def __init__(self, place: SharePlace, station: int, network: Network, queue: GuestQueue,
                 wake: Callable[[], None], listener: GuestListener,
                 fault: Callable[[Exception], None],
                 clock: Callable[[], float] = line_time) -> None:
        self.guest = Guest(place.text, ShareAccess(network.share_access), listener)
        self._station = station
        self._queue = queue
        self._wake = wake
        self._sessions = EipSessions(
            CipIdentity(zlib.crc32(place.line.encode())), network.cmd_timeout / 1000)
        self._given: set[PcccCommand] = set()
        self._replies: deque[tuple[PcccCommand, Packet]] = deque()
        self._shown: tuple[EipSession, ...] = ()
        self.link: ClientsThread[EipSession] = ClientsThread(
            place.host, place.port, self, fault, clock)

    @property
    def state(self) -> str:
        """Return the state of the place and its clients, as a text for users."""
        if not self._shown:
            return 'waiting for a client' if self.link.state.is_open else self.link.state.text
        shown = [_client_text(session) for session in self._shown[:_MOST_SHOWN]]
        more = len(self._shown) - len(shown)
        return f'{counted(len(self._shown), "client")}: {", ".join(shown)}' + (
            f' and {more} more' if more else '')

    @property
    def fault(self) -> str:
        """Return why no program can connect; empty if a program can."""
        return self.link.fault

    @property
    def waiting(self) -> int:
        """Return how many commands wait."""
        return self._sessions.waiting + len(self.guest.waiting)

    def start(self) -> None:
        """Wait for clients, and serve them; also after ``pause``."""
        self.link.begin()

    def pause(self) -> None:
        """Close the place and disconnect all clients until the next ``start``."""
        self.link.release()

    def stop(self) -> None:
        """End the place."""
        self.link.stop()

    def came(self, address: str, place: tuple[str, int], now: float) -> EipSession | None:
        """Take a client; None if there are too many."""
        session = self._sessions.came(address, place, now)
        if session is None:
            self.guest.listener.turned_away(
                self.guest, address, f'{MOST_SESSIONS} programs have the place')
        self._look()
        return session

    def gone(self, talk: EipSession) -> None:
        """Forget a client and its commands."""
        self._sessions.ended(talk)
        self._look()

    def receive(self, talk: EipSession, data: bytes, now: float, came: float) -> None:
        """Take bytes of a client; after a pause of this process they may be as old as it."""
        if now - came <= 2 * GLANCE + MOST_LATE:
            came = now
        for command in self._sessions.receive(talk, data, now, came):
            self._queue.refuse(self._guest_command(command))

    def turn(self, now: float) -> None:
        """Hand replies to the clients, and commands to the link."""
        for command in self._sessions.expire(now):
            self._queue.refuse(self._guest_command(command))
        self._hand_back(now)
        while len(self._given) < _MOST_GIVEN and (waiting := self._sessions.next()) is not None:
            self._given.add(waiting)
            self._give(waiting)
            self._hand_back(now)

    def _hand_back(self, now: float) -> None:
        while self._replies:
            command, reply = self._replies.popleft()
            self._given.discard(command)
            command.respond(reply.encode()[_ADDRESSES:], now)

    def _give(self, command: PcccCommand) -> None:
        """Give a command to the link."""
        given = self._guest_command(command)
        if len(command.pccc) + _ADDRESSES > MAX_LINK_DATA:
            given.answer(given.packet.reply(sts=_BAD_FORMAT))
            return
        self._queue.put(given)
        self._wake()

    def _guest_command(self, command: PcccCommand) -> GuestCommand:
        packet = Packet.decode(bytes((self._station, _SOURCE)) + command.pccc)
        return GuestCommand(self.guest, packet, command.came, partial(self._answer, command),
                            command.patience, lambda: not command.session.is_over)

    def _answer(self, command: PcccCommand, reply: Packet) -> None:
        """Take a reply, in any thread."""
        self._replies.append((command, reply))
        self.link.wake()

    def _look(self) -> None:
        self._shown = tuple(self._sessions.all)
        self.guest.is_connected = bool(self._shown)


def _client_text(session: EipSession) -> str:
    """Return the address of a client and, once it has asked, who it says it is."""
    if session.asker is None:
        return session.address
    vendor, serial_number = session.asker
    return (f'{session.address} (vendor {vendor}, serial number {serial_number:08X}, '
            f'{counted(session.commands, "command")})')
