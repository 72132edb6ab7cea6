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
The time of a transaction on the line: the model behind plans and forecasts.

It counts the characters of the real frames. It does not know the response time of a station. It
does not know the data of a reply either, of which one byte in 256 is doubled (M 2-7).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import HEADER_SIZE
from abdf1_ros.pccc.dialect import Dialect, Transfer


@dataclass(frozen=True, slots=True)
class LineModel:
    """
    A line with this check, discipline and timing.

    ``wait`` is the pause (s) before commands. Where stations take turns, ``idle_poll`` is the time
    (s) of a poll without a reply, elsewhere 0.
    """

    checksum: Checksum
    duplex: Duplex
    timing: LineTiming
    wait: float = 0.0
    idle_poll: float = 0.0

    def read_time(self, dialect: Dialect, request: Transfer, station: int = 0) -> float:
        """Return the seconds of a read from a station that answers at once."""
        _, body = dialect.read(request.start, request.words)
        stuffed = len(frames.stuff(body))
        return self.transaction_time(
            stuffed, dialect.reply_size(request.start, request.words), station)

    def transaction_time(self, command: int, reply: int, station: int = 0) -> float:
        """
        Return the seconds of a transaction with a station that answers at once.

        ``command`` and ``reply`` are the bytes of each after TNS.
        """
        characters = _overhead(self.duplex, self.checksum, station) + command + reply
        transmissions = 3 if self.duplex is Duplex.HALF else 2
        return self.wait + characters * self.timing.char_time \
            + transmissions * self.timing.tx_delay


@cache
def _overhead(duplex: Duplex, checksum: Checksum, station: int) -> int:
    """Return the characters of a transaction, without the bytes after TNS of both messages."""
    # Only the size of a frame counts here, so its checksum may be wrong.
    message = frames.message_frame(b'', checksum)
    sent = message if duplex is not Duplex.HALF else \
        frames.master_frame(station, b'', checksum) + frames.poll_frame(station)
    return len(sent) + len(message) + 2 * (HEADER_SIZE + len(frames.ACK))
