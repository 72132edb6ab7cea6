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

"""Others on the line that are broken, or mean harm."""

from __future__ import annotations

from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Poll, Symbol
from abdf1_ros.df1.packet import Packet

# Stations that are there, and some that are not.
US, OTHER, PLC, SLC, LIAR, DEAD = 5, 6, 1, 2, 3, 4
_STRANGERS = range(0, 256, 15)


class Liar:
    """A slave that answers its polls with whatever a broken or hostile one may."""

    def __init__(self, seed: int) -> None:
        self.is_lying = False
        self._random = Random(seed)

    def handle(self, symbol: Symbol) -> bytes:
        """Answer polls only; nothing acknowledges what it is sent."""
        if not isinstance(symbol, Poll) or symbol.station != LIAR or not self.is_lying:
            return b''
        if self._random.random() < 0.1:
            return self._random.randbytes(self._random.randrange(400))
        return frames.message_frame(hostile_message(self._random), Checksum.CRC)


def hostile_message(random: Random) -> bytes:
    """Return a message with a good header, from and to anybody, about anything."""
    body = random.randbytes(random.choice((0, 1, 4, 12, 200)))
    if random.random() < 0.3:
        body = b'\xa2' + body
    return Packet(
        random.choice((US, OTHER, PLC, LIAR, random.choice(_STRANGERS))),
        random.choice((LIAR, PLC, OTHER, random.choice(_STRANGERS))),
        random.choice((0x0F, 0x4F, 0x06, 0x46, random.randrange(256))),
        random.choice((0, 0, 0x10, 0xF0)), random.randrange(0x10000), body).encode()
