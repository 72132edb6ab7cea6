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

"""A decoder for foreign traffic, which finds out the check and the duplex by itself."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import (
    Control,
    Decoded,
    Duplex,
    ENQ,
    EOT,
    Frame,
    FrameDecoder,
    MORE,
    NOISE,
    Poll,
    SOH,
    STX,
    Symbol,
)

# One in 256 frames without a BCC seems to have a good BCC, so a single frame proves nothing.
_BCC_FRAMES = 2
# Number of frames in a row that are right with BCC only. They prove that the guess CRC was wrong.
_CONTRARY_FRAMES = 3
# Most bytes that are kept of noise, or of a message that does not end.
_MOST_KEPT = 2048


@dataclass(slots=True)
class LineKind:
    """
    Check and duplex of a line, None while unknown; one object serves both directions.

    With ``is_certain`` the check is given and never changed.
    """

    checksum: Checksum | None = None
    duplex: Duplex | None = None
    is_certain: bool = False


class ListeningDecoder(FrameDecoder):
    """
    A frame decoder that finds check and duplex by itself, if they are unknown in ``kind``.

    DLE SOH and DLE EOT exist in half duplex only (M 2-6). A message before the first of them
    counts as full duplex. After one frame with a right CRC the check is CRC; after two frames with
    a right BCC it is BCC. Until then the decoder waits for one byte after the BCC of a frame,
    because this byte may be the second byte of a CRC. The guess BCC is given up when a frame is
    right with CRC only. The guess CRC is given up when three frames in a row are right with BCC
    only.

    ``wire`` has the bytes of the last symbol, without noise before it.
    """

    def __init__(self, kind: LineKind) -> None:
        super().__init__(kind.checksum or Checksum.CRC, kind.duplex or Duplex.HALF)
        self._kind = kind
        self._duplex_given = kind.duplex is not None
        self._bcc_frames = 0
        self._contrary_frames = 0
        self.wire = b''
        self._heard = bytearray()  # since the last symbol

    @property
    def checksum(self) -> Checksum:
        """Return the check that the last frame was read with."""
        return self._checksum

    def feed(self, data: bytes) -> None:
        """Take bytes from the line."""
        before = len(self.waiting)
        super().feed(data)
        self._heard += data[:max(0, len(self.waiting) - before)]
        del self._heard[:-_MOST_KEPT - len(self.waiting)]

    def reset(self) -> None:
        super().reset()
        self._heard.clear()

    def next_symbol(self) -> Symbol | None:
        symbol = super().next_symbol()
        while symbol is NOISE:  # the decoder counts it in ``noise``
            symbol = super().next_symbol()
        if symbol is not None:
            self._keep(symbol)
        elif not self.in_message and self._step == self._idle:
            del self._heard[:len(self._heard) - len(self.waiting)]
        return symbol

    def _keep(self, symbol: Symbol) -> None:
        """Put the bytes of a symbol into ``wire``."""
        taken = len(self._heard) - len(self.waiting)
        heard = bytes(self._heard[:taken])
        del self._heard[:taken]
        if isinstance(symbol, Frame):
            starts = (SOH, STX) if symbol.station is not None else (STX,)
        elif isinstance(symbol, Poll):
            starts = (ENQ,)
        else:
            self.wire = heard[-2:]
            if isinstance(symbol, Control) and self.in_message:
                self._heard[:0] = heard[:-2]  # a response inside a message (M 4-3)
            return
        start = next((at for pair in starts if (at := heard.find(pair)) >= 0), 0)
        self.wire = heard[start:]

    def finish(self) -> Frame | None:
        """Return a frame that still waits for a second check byte, when no byte comes any more."""
        kind = self._kind
        waits = self._step == self._check and len(self.waiting) == 1
        if not waits or kind.is_certain or not self._matches(Checksum.BCC):
            return None
        if kind.checksum is None:
            self._find_checksum()
        else:
            self._reconsider()
        self._checksum = Checksum.BCC
        result = super()._check()
        assert isinstance(result, Frame)
        self._keep(result)
        return result

    def broken_off(self) -> Frame:
        frame = super().broken_off()
        self.waiting.clear()
        self.in_message = False
        self._keep(frame)
        return frame

    def _begin(self, pair: bytes) -> Decoded:
        # The bytes before the pair are noise. They are dropped, as their last byte may look like a
        # beginning.
        del self._heard[:max(0, len(self._heard) - len(self.waiting) - len(pair))]
        kind = self._kind
        if not self._duplex_given:
            if pair in (SOH, EOT) and kind.duplex is not Duplex.RADIO:
                kind.duplex = Duplex.HALF
            elif pair == STX and kind.duplex is None:
                kind.duplex = Duplex.FULL
        self._is_half_duplex = kind.duplex in (None, Duplex.HALF)
        self._has_responses = kind.duplex is Duplex.FULL
        return super()._begin(pair)

    def _poll_check(self) -> Poll:
        poll = super()._poll_check()
        if not self._duplex_given and poll.valid:
            self._kind.duplex = Duplex.HALF
        return poll

    def _check(self) -> Decoded:
        if self._kind.checksum is not None:
            self._checksum = self._kind.checksum
            if not self._kind.is_certain and len(self.waiting) >= self._checksum.size:
                if len(self.waiting) == 1 and not self._matches(self._checksum) and (
                        self._matches(Checksum.CRC, 1)):
                    return MORE  # the check may be a CRC
                self._reconsider()
                self._checksum = self._kind.checksum
        elif len(self.waiting) < Checksum.CRC.size:
            return MORE
        else:
            self._find_checksum()
        return super()._check()

    def _find_checksum(self) -> None:
        self._checksum = Checksum.CRC
        if self._matches(Checksum.CRC):
            self._kind.checksum = Checksum.CRC
        elif self._matches(Checksum.BCC):
            self._checksum = Checksum.BCC
            self._bcc_frames += 1
            if self._bcc_frames == _BCC_FRAMES:
                self._kind.checksum = Checksum.BCC

    def _reconsider(self) -> None:
        """Change to the other check if the last frames were right only with it."""
        other = Checksum.BCC if self._checksum is Checksum.CRC else Checksum.CRC
        if self._matches(self._checksum):
            self._contrary_frames = 0
        elif self._matches(other):
            self._contrary_frames += 1
        if self._contrary_frames == (1 if other is Checksum.CRC else _CONTRARY_FRAMES):
            self._contrary_frames = 0
            self._kind.checksum = other

    def _matches(self, checksum: Checksum, count: int = 2) -> bool:
        """Tell whether the first ``count`` bytes of the received check are right for this kind."""
        check = checksum.encode(checksum.of_message(self.link_data, self._station))
        return self.waiting.startswith(check[:count])
