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

"""Which reply belongs to which command, and which messages are repetitions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from abdf1_ros.df1.packet import BROADCAST, Packet, REPLY_BIT
from abdf1_ros.sniffer.capture import Direction
from abdf1_ros.sniffer.entries import Mark

# Seconds after which no reply is expected any more. Cmd_Timeout is at most 5 s (S0). A master with
# standard polling may need another 5 s until it polls the station.
_PATIENCE = 10.0
_MOST_OPEN = 1000
_MOST_UNDER_WAY = 16  # newest commands, to which a reply to another number may belong

# By radio modem, a message that comes again within this time (s) is treated as forwarded by a
# node. The sender of a message waits longer before it repeats the message: for the time-out of the
# command.
_FORWARDED_WITHIN = 1.0
_MOST_RECENT = 20  # messages; a forwarding node remembers as many (1763-RM001C)

_Key = tuple[int, int, int]


@dataclass(slots=True)
class _Said:
    """The last message from one node to another node."""

    packet: Packet
    acknowledged: bool = False


@dataclass(slots=True)
class Transaction:
    """A command, the time of its first transmission, and whether its reply has come."""

    command: Packet
    time: float | None
    guest: str = ''
    answered: bool = False


class MessageFacts(NamedTuple):
    """Facts about a message that follow from the messages before it."""

    command: Packet | None = None
    latency: float | None = None
    marks: tuple[Mark, ...] = ()
    guest: str = ''


class Copies:
    """
    On radio modems, separate forwarded messages from messages that their sender repeats.

    ``recorder`` is the number of the recording node: the SRC of all messages that were new in
    direction ``>``. It is None if these messages have several SRC, or if there are none.
    """

    def __init__(self) -> None:
        self._recent: dict[Packet, tuple[float | None, Direction]] = {}
        self._recorders: set[int] = set()

    @property
    def recorder(self) -> int | None:
        return min(self._recorders) if len(self._recorders) == 1 else None

    def mark(self, packet: Packet, time: float | None, direction: Direction) -> Mark | None:
        """Return the mark of a message that has come before, None for a new message."""
        begun, side = self._recent.get(packet, (None, direction))
        age = None if time is None or begun is None else abs(time - begun)
        is_new = packet not in self._recent or (age or 0.0) > _PATIENCE
        is_own = direction is Direction.OUT and packet.src == self.recorder
        if not is_new and not is_own and (
                side is not direction or age is not None and age < _FORWARDED_WITHIN):
            return Mark.FORWARDED
        if is_new and direction is Direction.OUT:
            self._recorders.add(packet.src)
        self._recent.pop(packet, None)
        self._recent[packet] = time, direction
        if len(self._recent) > _MOST_RECENT:
            del self._recent[next(iter(self._recent))]
        return None if is_new else Mark.RETRANSMISSION


class Conversation:
    """
    Remember the messages of a line; call ``take`` with every good message.

    If the times go back far, another recording has begun; open commands then get no reply. If two
    ports are recorded, the times may go back a little.
    """

    def __init__(self) -> None:
        self._open: dict[_Key, Transaction] = {}
        self._said: dict[tuple[int, int, bool, bool], _Said] = {}
        self._last: dict[Direction, _Said] = {}
        self._given_up: list[Transaction] = []
        self._guest = ('', '')  # TNS and place
        self._askers: set[int] = set()  # nodes that have sent a command
        self._other: int | None = None  # DST of the last reply that came to another number
        self.copies = Copies()

    def take(self, packet: Packet, time: float | None, direction: Direction,
             from_master: bool, is_radio: bool = False) -> MessageFacts:
        """Return the facts about a message; ``from_master`` is set for frames with DLE SOH."""
        mark = self._repetition(packet, from_master)
        self._last[direction] = self._said[*_path(packet), from_master]
        copy = self.copies.mark(packet, time, direction)
        mark = copy if is_radio else mark
        marks = () if mark is None else (mark,)
        if not packet.is_reply:
            self._begin(packet, time, mark)
            known = self._open.get((packet.src, packet.dst, packet.tns))
            return MessageFacts(marks=marks, guest=known.guest if known else '')
        transaction = self._open.get((packet.dst, packet.src, packet.tns)) \
            or self._of_gateway(packet)
        if transaction is None:
            return MessageFacts(marks=(*marks, Mark.STRAY))
        command = transaction.command
        if packet.cmd != command.cmd | REPLY_BIT:
            return MessageFacts(marks=(*marks, Mark.WRONG_COMMAND))
        begun, latency = transaction.time, None
        if not transaction.answered and time is not None and begun is not None and begun <= time:
            latency = time - begun
        transaction.answered = True
        return MessageFacts(command, latency, marks, transaction.guest)

    def _of_gateway(self, reply: Packet) -> Transaction | None:
        """
        Return the command of a reply to another number; None if it answers none.

        A gateway may put its own number in place of the sender's into a command (M 6-4). As on our
        own line, that is believed if two replies in a row have the number. A node that has sent a
        command itself is not this gateway.
        """
        if reply.dst in self._askers:
            return None
        for transaction in islice(reversed(self._open.values()), _MOST_UNDER_WAY):
            command = transaction.command
            if not transaction.answered and reply._replace(dst=command.src).answers(command) \
                    and reply.cmd == command.cmd | REPLY_BIT:
                is_known, self._other = reply.dst == self._other, reply.dst
                return transaction if is_known else None
        return None

    def note_guest(self, note: str) -> None:
        """Record "TNS place": the next command with this TNS is from the guest at this place."""
        tns, _, place = note.partition(' ')
        self._guest = tns, place

    def acknowledge(self, direction: Direction) -> None:
        """Record an ACK in ``direction``: it is for the last message of the opposite direction."""
        said = self._last.get(direction.opposite)
        if said is not None:
            said.acknowledged = True

    def expired(self, now: float | None) -> Iterator[Transaction]:
        """Yield, once, the commands that have waited too long for their reply."""
        yield from self._given_up
        self._given_up.clear()
        while self._open:
            key, oldest = next(iter(self._open.items()))
            is_old = now is not None and oldest.time is not None and (
                abs(now - oldest.time) > _PATIENCE)
            if not is_old and len(self._open) <= _MOST_OPEN:
                return
            del self._open[key]
            if not oldest.answered:
                yield oldest

    def unanswered(self) -> list[Transaction]:
        """Return the commands whose reply may still come."""
        return [entry for entry in self._open.values() if not entry.answered]

    def _repetition(self, packet: Packet, from_master: bool) -> Mark | None:
        """Return how a message repeats an earlier message; record it as the last of its path."""
        path = _path(packet)
        last = self._said.get((*path, from_master))
        if last is not None and last.packet == packet:
            return Mark.DUPLICATE if last.acknowledged else Mark.RETRANSMISSION
        self._said[*path, from_master] = _Said(packet)
        other = self._said.get((*path, not from_master))
        if other is not None and other.packet == packet:
            return Mark.RELAYED
        return None

    def _begin(self, command: Packet, time: float | None, mark: Mark | None) -> None:
        self._askers.add(command.src)
        key = command.src, command.dst, command.tns
        known = self._open.get(key)
        if command.dst == BROADCAST or mark is Mark.FORWARDED:
            return  # no station replies, or the command is recorded already
        if known is not None and mark is not None and not (
                mark is Mark.DUPLICATE and known.answered):
            return
        if known is not None and not known.answered:
            self._given_up.append(known)  # its TNS is used for another command
        self._open.pop(key, None)  # the new command comes last
        tns, guest = self._guest
        is_guests = tns == f'{command.tns:04X}'
        if is_guests:
            self._guest = ('', '')
        self._open[key] = Transaction(command, time, guest if is_guests else '')


def _path(packet: Packet) -> tuple[int, int, bool]:
    return packet.src, packet.dst, packet.is_reply
