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

"""Lines that lose frames, never more in a row than the settings repeat."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, KW_ONLY
import math
from random import Random

from abdf1_ros.df1.frames import ACK, Code, STX

_BEGINNINGS = tuple(bytes((Code.DLE, code)) for code in (
    Code.ENQ, Code.SOH, Code.STX, Code.ACK, Code.NAK, Code.EOT))


@dataclass(frozen=True, slots=True)
class Lost:
    """
    What gets lost: a share ``lost`` of all frames, of commands, of replies, or of both.

    ``travel`` is how long (s) each frame travels; then a poll is lost only when there is a reply.
    """

    mode: str
    _: KW_ONLY
    nak_retries: int = 1
    enq_retries: int = 1
    lost: float = 0.0
    lose_commands: bool = True
    lose_replies: bool = True
    travel: float = 0.0
    seed: int = 0


class Losses:
    """
    The line: it loses a frame of the driver, or the answer to it, but never too often in a row.

    A frame may come in pieces; it is lost as a whole. ``is_due`` says whether what goes wrong has
    begun.
    """

    def __init__(self, plant: Lost, clock: Callable[[], float]) -> None:
        self._plant = plant
        self.clock = clock
        self.ready = -math.inf  # from when (clock, s) there is a reply
        self._dice = Random(plant.seed)
        self._lost = {False: 0, True: 0}  # in a row: of messages, of polls
        self._takes_answer = False
        self._loses_rest = self._takes_rest = False  # of a frame that has begun
        self.is_due = False

    def hear(self, data: bytes) -> bytes:
        """Return what the stations hear of a frame, which may follow an ACK at once."""
        if not data.startswith(_BEGINNINGS):
            return b'' if self._loses_rest else data
        self._loses_rest = False
        if data[:2] == ACK and len(data) > 2:
            return ACK + self.hear(data[2:])
        is_poll = data[:2] == bytes((Code.DLE, Code.ENQ))
        is_message = data[:2] in (bytes((Code.DLE, Code.SOH)), bytes((Code.DLE, Code.STX)))
        if not self.is_due or not (is_poll or is_message):
            return data
        plant = self._plant
        limit = plant.enq_retries if is_poll else plant.nak_retries
        if is_poll and plant.travel and self.clock() < self.ready:
            return data
        is_peer = plant.mode == 'Peer'
        if is_peer:  # a lost message costs an ENQ and a NAK, and an ENQ proves nothing
            limit = min(plant.enq_retries, plant.nak_retries)
        is_lost = self._lost[is_poll and not is_peer] < limit and self._dice.random() < plant.lost
        if is_lost or not (is_peer and is_poll):
            count = self._lost[is_poll and not is_peer]
            self._lost[is_poll and not is_peer] = count + 1 if is_lost else 0
        both = plant.lose_commands and plant.lose_replies
        is_command = plant.lose_commands and (not both or self._dice.random() < 0.5)
        self._takes_answer = is_lost and not is_command
        if not is_lost or not is_command:
            return data
        # A full-duplex message that leaves no trace gets the ACK of the one before.
        if is_peer and is_message:
            return _damaged(data)
        self._loses_rest = True
        return b''

    def say(self, data: bytes) -> bytes:
        """Return what the driver hears."""
        if not data.startswith(_BEGINNINGS):
            return b'' if self._takes_rest else data
        self._takes_rest = self._takes_answer and not data.startswith(ACK)
        is_taken, self._takes_answer = self._takes_answer, False
        # A full-duplex reply that comes with the ACK has frames, and losses, of its own.
        return (data[len(ACK):] if data.startswith(ACK) else b'') if is_taken else data


def _damaged(data: bytes) -> bytes:
    """Return a part of a message with one wrong character, which belongs to no symbol."""
    at = next(at for at in reversed(range(len(data)))
              if Code.DLE not in (data[at - 1], data[at], data[at] ^ 1))
    return data[:at] + bytes((data[at] ^ 1,)) + data[at + 1:]


class AirLosses(Losses):
    """A radio network: it loses the commands of each station, or replies, but not too often."""

    def __init__(self, plant: Lost, clock: Callable[[], float]) -> None:
        super().__init__(plant, clock)
        self._lost_of: Counter[int] = Counter()
        self._loses_reply: set[int] = set()
        self._is_lost = self._is_reply_lost = False

    def hear(self, data: bytes) -> bytes:
        """Return what the stations hear of a frame."""
        if not data.startswith(STX):  # the rest of a frame
            return b'' if self._is_lost else data
        plant, station = self._plant, data[2]
        self._loses_reply.discard(station)
        is_lost = self.is_due and self._lost_of[station] < plant.nak_retries \
            and self._dice.random() < plant.lost and (plant.lose_commands or plant.lose_replies)
        self._lost_of[station] = self._lost_of[station] + 1 if is_lost else 0
        self._is_lost = False
        both = plant.lose_commands and plant.lose_replies
        if is_lost and (self._dice.random() < 0.5 if both else plant.lose_replies):
            self._loses_reply.add(station)
            return data
        self._is_lost = is_lost
        return b'' if is_lost else data

    def say(self, data: bytes) -> bytes:
        """Return what the driver hears."""
        if not data.startswith(STX):
            return b'' if self._is_reply_lost else data
        self._is_reply_lost = is_lost = data[3] in self._loses_reply
        self._loses_reply.discard(data[3])
        return b'' if is_lost else data
