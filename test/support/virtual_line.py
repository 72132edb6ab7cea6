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

"""
A line in virtual time: machines, a baud rate and seeded noise.

What one machine sends reaches all the others, byte by byte, a character's time apart; each
direction is a wire of its own, so a half-duplex master with its slaves fits as well as two
full-duplex peers. Nothing waits: the clock jumps to the next arrival or deadline. A machine that
has time to spare hears nothing until it is over, and then all that has come.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import heapq
import math
from random import Random
from typing import Protocol

from abdf1_ros.df1.machine import Machine

BITS_PER_CHARACTER = 10
_A_BIT = 0.1  # of a character
_MOST_CALLS = 1000  # of machines at one moment
_BYTES = [bytes((byte,)) for byte in range(256)]


@dataclass(frozen=True, slots=True)
class Noise:
    """The probability, for each byte, of being lost, flipped in one bit, doubled, or led in."""

    lost: float = 0.0
    flipped: float = 0.0
    doubled: float = 0.0
    inserted: float = 0.0

    def bytes_for(self, byte: int, random: Random) -> bytes:
        """Return what arrives in place of ``byte``."""
        chance = random.random()
        if chance >= self.lost + self.flipped + self.doubled + self.inserted:
            return _BYTES[byte]
        if chance < self.lost:
            return b''
        chance -= self.lost
        if chance < self.flipped:
            return bytes((byte ^ 1 << random.randrange(8),))
        chance -= self.flipped
        if chance < self.doubled:
            return bytes((byte, byte))
        return bytes((random.randrange(256), byte))

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return what arrives in place of ``data``."""
        return b''.join([self.bytes_for(byte, random) for byte in data])


class Damage(Protocol):
    """Anything that does something to what is on the line."""

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return what arrives in place of ``data``."""


QUIET = Noise()


class Wire:
    """An outlet; a test may say what ``write`` does, and what is ``unsent``."""

    def __init__(self, machine: Machine, write: Callable[[bytes], object] | None = None,
                 unsent: Callable[[], int] = lambda: 0) -> None:
        self._sender = machine.sender
        self._write = write or self._keep
        self.unsent = unsent

    def attach(self, now: float) -> None:
        """Be the outlet of a machine that runs."""
        self._sender.begin(now, self)

    def write(self, data: bytes) -> None:
        """Take what is written at once."""
        self._write(data)

    def _keep(self, data: bytes) -> None:
        """Let what is written at once go out with what the machine has to send."""
        self._sender.waiting += data


class VirtualLine:
    """
    The line between ``machines``, and their clock.

    ``baud`` is bits per second, ``propagation`` seconds that a byte travels. ``chunk`` bytes are
    handed over together, when the last of them is here (1: as a bare UART does; more: as its FIFO
    or an adapter does); ``chunks`` has that for each machine. ``noise`` may be changed at any time
    and acts on what is sent from then on; so does ``echoes``, with which a sender hears itself.
    """

    def __init__(self, *machines: Machine, baud: float = 19200, propagation: float = 0.0,
                 chunk: int = 1, noise: Damage = QUIET, seed: int = 0) -> None:
        self.now = 0.0
        self.noise = noise
        self.echoes = False
        self.on_send: Callable[[bytes, float, int], None] = lambda data, start, receiver: None
        self.char_time = char_time(baud)
        self._machines = list(machines)
        self.propagation = propagation
        self.chunks = [chunk] * len(machines)
        self.random = Random(seed)
        self._free = [0.0] * len(machines)  # when each sender's last byte has left
        self._away = [0.0] * len(machines)  # until when
        self._calls = [math.inf] * len(machines)  # when each wants to be called next
        self._arrivals: list[tuple[float, int, int, bytes]] = []
        self._count = 0
        self._idle = 0  # calls in a row at one moment

    def start(self) -> None:
        """Start every machine."""
        for machine in self._machines:
            machine.start(self.now, self.outlet(machine))
        for sender in range(len(self._machines)):
            self._take(sender)

    def outlet(self, machine: Machine) -> Wire:
        """Return where a machine of this line puts its bytes."""
        return Wire(machine, unsent=partial(self._unsent, self._machines.index(machine)))

    def _unsent(self, sender: int) -> int:
        """Return how many bytes of a sender have still to leave."""
        left = max(0.0, self._free[sender] - self.now)
        return math.ceil(left / self.char_time - _A_BIT) if left else 0

    def wake(self, machine: Machine) -> None:
        """Wake a machine that rests."""
        machine.wake(self.now)
        self._take(self._machines.index(machine))

    def pause(self, machine: Machine, seconds: float) -> None:
        """Stop a machine's process; what comes waits for it, as its own deadlines do."""
        sender = self._machines.index(machine)
        self._away[sender] = self.now + seconds
        self._look_at(sender)

    def exchange(self, old: Machine, new: Machine, *, keeps_port: bool = False) -> None:
        """
        Put another machine in the place of one; it is started by who asks.

        With ``keeps_port`` it gets what is on the way to the other.
        """
        place = self._machines.index(old)
        self._machines[place] = new
        if keeps_port:
            return
        self._arrivals = [entry for entry in self._arrivals if entry[2] != place]
        heapq.heapify(self._arrivals)
        self._away[place] = 0.0

    def run(self, until: Callable[[], bool], limit: float) -> None:
        """Let time pass until ``until()``; fail after ``limit`` seconds, or when all is still."""
        end = self.now + limit
        self.look()
        while not until():
            if not self.advance():
                raise AssertionError(f'nothing will ever happen again, at {self.now}')
            assert self.now <= end, f'not done after {limit} s of line time'

    def run_for(self, seconds: float) -> None:
        end = self.now + seconds
        self.look()
        while self.advance(end):
            pass
        self.now = end

    def look(self) -> None:
        """Take in what a test has changed since time last passed."""
        for number in range(len(self._machines)):
            self._look_at(number)

    def _look_at(self, number: int) -> None:
        moment = self._machines[number].next_call
        self._calls[number] = math.inf if moment is None else max(moment, self._away[number])

    def advance(self, end: float = math.inf) -> bool:
        """Carry out the next event; return False when there is none up to ``end``."""
        arrivals, calls = self._arrivals, self._calls
        deadline = min(calls)
        if arrivals and arrivals[0][0] <= deadline:
            if arrivals[0][0] > end:
                return False
            self.now, number, first, data = heapq.heappop(arrivals)
            machine, away = self._machines[first], self._away[first]
            if self.now < away:
                heapq.heappush(arrivals, (away, number, first, data))
                return True
            if self.now == away:
                data += self._rest_for(first)
                machine.handle_timeout(self.now)  # in the order of LinkThread
            machine.receive_data(data, self.now)
            self._away[first] = self.now + machine.spare_time
        elif deadline > end or deadline == math.inf:
            return False
        else:
            first = calls.index(deadline)
            self._idle = self._idle + 1 if deadline <= self.now else 0
            assert self._idle < _MOST_CALLS, f'called for nothing, again and again, at {self.now}'
            self.now = max(self.now, deadline)
            self._machines[first].handle_timeout(self.now)
        self._take(first)
        return True

    def _rest_for(self, receiver: int) -> bytes:
        """Return what else has come for a machine that was away."""
        rest = b''
        while self._arrivals and self._arrivals[0][0:3:2] == (self.now, receiver):
            rest += heapq.heappop(self._arrivals)[3]
        return rest

    def _take(self, sender: int) -> None:
        """Put on the wire what a machine has to send, and see when it wants to go on."""
        data = self._machines[sender].data_to_send()
        self._look_at(sender)
        if not data:
            return
        start = max(self.now, self._free[sender])
        self._free[sender] = start + len(data) * self.char_time
        for receiver in range(len(self._machines)):
            if receiver != sender or self.echoes:
                self.send(data, start, receiver)

    def send(self, data: bytes, start: float, receiver: int) -> None:
        """Put bytes on the wire, and tell of them."""
        self.on_send(data, start, receiver)
        noise = None if self.noise is QUIET else self.noise
        chunk = self.chunks[receiver]
        for at in range(0, len(data), chunk):
            part = data[at:at + chunk]
            here = start + (at + len(part)) * self.char_time + self.propagation
            if noise is not None:
                part = noise.damage(part, self.random)
            if part:
                self._count += 1  # keeps the order of what arrives at one instant
                heapq.heappush(self._arrivals, (here, self._count, receiver, part))


def char_time(baud: float) -> float:
    """Return the seconds that a character takes."""
    return BITS_PER_CHARACTER / baud
