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
Noise that is cheap where it is rare, and what it did to how many frames.

The line hands over whole transmissions, and all of both directions, so a ``Wire`` also knows
what was sent; that is what a judge compares with what was heard.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
import math
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Frame

_CONTROLS = (frames.ACK, frames.NAK, frames.ENQ)
_SOH = b'\x10\x01'
_REMEMBERED = 64
_SAMPLES = 400


class Kind(Enum):
    """What can happen to a byte."""

    LOST = 'lost'
    FLIPPED = 'flipped'
    DOUBLED = 'doubled'
    INSERTED = 'inserted'
    SWAPPED = 'swapped'


LISTED = (Kind.LOST, Kind.FLIPPED, Kind.DOUBLED, Kind.INSERTED)


def strike(data: bytes, at: int, kind: Kind, random: Random) -> bytes:
    """Return what is left of byte ``at`` (with SWAPPED: of it and the next one)."""
    byte = data[at:at + 1]
    if kind is Kind.LOST:
        return b''
    if kind is Kind.FLIPPED:
        return bytes((byte[0] ^ 1 << random.randrange(8),))
    if kind is Kind.DOUBLED:
        return byte + byte
    if kind is Kind.INSERTED:
        return bytes((random.randrange(256),)) + byte
    return data[at + 1:at + 2] + byte


class Wire:
    """
    A line on which each byte is struck with probability ``rate``, by one of ``kinds``.

    ``rate`` may be changed at any time. ``singles`` and ``several`` count the frames that were
    struck once and more often, ``characters`` all that was sent; ``samples`` are some frames.
    ``forged`` is for what a check has not seen: a master may pass it on with a right check.
    """

    def __init__(self, kinds: tuple[Kind, ...] = LISTED, rate: float = 0.0) -> None:
        self.kinds = kinds
        self.characters = self.frames = self.singles = self.several = 0
        self.samples: list[bytes] = []
        self.forged: deque[bytes] = deque(maxlen=_REMEMBERED)
        self._sent: deque[bytes] = deque(maxlen=_REMEMBERED)
        self._rate = rate
        self._gap: int | None = None  # bytes that get through before the next is struck

    @property
    def rate(self) -> float:
        """Return the probability for each byte."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._rate, self._gap = rate, None

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return what arrives in place of a transmission."""
        self.characters += len(data)
        is_frame = self._remember(data, random)
        if not self._rate:
            return data
        if self._gap is None:
            self._gap = self._draw(random)
        if self._gap >= len(data):
            self._gap -= len(data)
            return data
        arrives, strikes = self._strike(data, random)
        self.singles += is_frame and strikes == 1
        self.several += is_frame and strikes > 1
        return arrives

    def has_sent(self, frame: Frame) -> bool:
        """Tell whether somebody has sent this frame lately."""
        text = frames.STX + frames.stuff(frame.data) + frames.ETX
        if frame.station is not None:
            text = _SOH + frames.stuff(bytes((frame.station,))) + text
        return any(sent.startswith(text) for sent in self._sent)

    def _draw(self, random: Random) -> int:
        return int(math.log(1.0 - random.random()) / math.log1p(-self._rate))

    def _strike(self, data: bytes, random: Random) -> tuple[bytes, int]:
        """Return what is left, and how often it was struck."""
        arrives, begin, strikes = bytearray(), 0, 0
        assert self._gap is not None
        at = self._gap
        while at < len(data):
            kind = random.choice(self.kinds)
            arrives += data[begin:at] + strike(data, at, kind, random)
            begin = at + (2 if kind is Kind.SWAPPED else 1)
            strikes += 1
            at = begin + self._draw(random)
        self._gap = max(0, at - len(data))
        return bytes(arrives + data[begin:]), strikes

    def _remember(self, data: bytes, random: Random) -> bool:
        while data.startswith(_CONTROLS):
            data = data[2:]
        is_frame = data.startswith((frames.STX, _SOH))
        if is_frame:
            self.frames += 1
            self._sent.append(data)
            if len(self.samples) < _SAMPLES:
                self.samples.append(data)
            elif (place := random.randrange(self.frames)) < _SAMPLES:
                self.samples[place] = data
        return is_frame
