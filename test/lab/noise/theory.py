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

"""How many damaged frames a check should miss, without any driver."""

from __future__ import annotations

from collections.abc import Sequence
import math
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, Symbol
from noise.wire import Kind, strike


class Theory:
    """
    The share of damaged frames with a right check, of ``samples`` struck by ``kinds``.

    CRC: one in 65536 of those that come to be checked, and every frame without STN that gets
    a 00 in front of its first byte, which a CRC that begins at 0 cannot see. BCC: damage random
    frames, so many ``trials``, and count, for frames struck once and for those struck more often.
    """

    def __init__(self, samples: Sequence[bytes], checksum: Checksum, duplex: Duplex,
                 kinds: tuple[Kind, ...], rate: float, trials: int = 10_000) -> None:
        self._samples, self._checksum, self._duplex = samples, checksum, duplex
        self._kinds, self._rate, self._trials = kinds, rate, trials
        self._random = Random(1)
        self._originals = {frame: self._decoded(frame) for frame in samples}
        is_bcc = checksum is Checksum.BCC
        self._single = self._share(is_several=False) if is_bcc else self._zero_in_front()
        self._several = self._share(is_several=True) if is_bcc and rate else 0.0

    def expected(self, singles: int, several: int, checked: int) -> float:
        """Return how many to expect of frames struck once, more often, and come to be checked."""
        found = singles * self._single + several * self._several
        return found + (checked / 0x10000 if self._checksum is Checksum.CRC else 0.0)

    def _zero_in_front(self) -> float:
        if Kind.INSERTED not in self._kinds:
            return 0.0
        shares = [1 / len(frame) for frame in self._samples if frame.startswith(frames.STX)]
        return sum(shares) / len(self._samples) / len(self._kinds) / 256

    def _share(self, is_several: bool) -> float:
        missed = 0
        for _ in range(self._trials):
            frame = self._random.choice(self._samples)
            arrives = self._damage(frame, self._strikes(len(frame)) if is_several else 1)
            missed += self._is_missed(frame, arrives)
        return missed / self._trials

    def _strikes(self, length: int) -> int:
        """Return a random number of strikes, of those above one."""
        count, at = 1, self._gap()
        while at < length or count < 2:
            at += self._gap()
            count += 1
        return count

    def _gap(self) -> int:
        return 1 + int(math.log(1.0 - self._random.random()) / math.log1p(-self._rate))

    def _damage(self, frame: bytes, strikes: int) -> bytes:
        places = set(self._random.sample(range(len(frame)), min(strikes, len(frame))))
        arrives, begin = bytearray(), 0
        for at in sorted(places):
            if at < begin:
                continue
            kind = self._random.choice(self._kinds)
            arrives += frame[begin:at] + strike(frame, at, kind, self._random)
            begin = at + (2 if kind is Kind.SWAPPED else 1)
        return bytes(arrives + frame[begin:])

    def _is_missed(self, sent: bytes, arrives: bytes) -> bool:
        return any(isinstance(symbol, Frame) and symbol.fault is None
                   and [symbol] != self._originals[sent] for symbol in self._decoded(arrives))

    def _decoded(self, data: bytes) -> list[Symbol]:
        decoder = FrameDecoder(self._checksum, self._duplex)
        decoder.feed(data)
        return list(iter(decoder.next_symbol, None))
