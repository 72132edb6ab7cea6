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
The diagnostic counters of a port, as read with 06/01 (M 9-6, 9-7, 9-31).

They are words, low byte first, in an order that depends on the processor and on the setting of its
port; the reply does not tell the order. A counter of 16 bits begins again at 0 after 65535.
"""

from __future__ import annotations

from abdf1_ros.counters import Counters
from abdf1_ros.errors import FormatError

MODEM_LINES = 'modem lines'
_LINES = ('CTS', 'RTS', 'DSR', 'DCD', 'DTR')

SENT, RECEIVED, UNDELIVERED = 'messages sent', 'messages received', 'messages undelivered'
BAD, NO_MEMORY = 'bad messages received', 'messages refused for lack of memory'
DUPLICATES = 'duplicate messages received'
ENQ_SENT, ENQ_RECEIVED, NAK_RECEIVED = 'ENQ sent', 'ENQ received', 'NAK received'
NAK_SENT, ENQ_OR_SENT_AGAIN = 'NAK sent', 'ENQ sent, or messages sent again'
UNSENT = 'messages undelivered for lack of handshake'
RETRIES, POLLS = 'messages sent again', 'polls received'
DCD, LOST = 'carrier recovered', 'modem lost'
UNUSED = ''


CounterLayout = tuple[str, ...]
"""The meaning of each word; '' for a word without a meaning."""


def decode_counters(data: bytes, layout: CounterLayout | None) -> dict[str, str]:
    """
    Return each counter by its name; without a layout the bytes, in hexadecimal.

    A reply may have fewer words than the layout. If it has further words, they get numbers as
    their names. Raises FormatError for an empty reply, and for an odd number of bytes.
    """
    if not data:
        raise FormatError('no counters in the reply')
    if layout is None:
        return {'bytes': data.hex(' ').upper()}
    if len(data) % 2:
        raise FormatError(f'counters of {len(data)} bytes; they are words')
    values = [int.from_bytes(data[at:at + 2], 'little') for at in range(0, len(data), 2)]
    names = [*layout, *(f'word {n}' for n in range(len(layout), len(values)))]
    return {name: _lines(value) if name == MODEM_LINES else str(value)
            for name, value in zip(names, values, strict=False) if name}


def _lines(value: int) -> str:
    """Return the modem lines that are on."""
    on = [name for bit, name in enumerate(_LINES) if value >> bit & 1]
    return ' '.join(on) or 'none on'


class ServedCounters:
    """
    The counters of our own link, as a PLC reads and resets them.

    A reset stores the present counts, which are then subtracted from the values that 06/01 reads.
    It does not change the counters, which are also shown elsewhere. Only the thread of the link
    changes them.
    """

    def __init__(self, counters: Counters, layout: CounterLayout) -> None:
        self._counters = counters
        self._layout = layout
        self._origin: dict[str, int] = {}

    def encode(self) -> bytes:
        """Return the block of words."""
        counts = self._counts()
        return b''.join(
            ((counts.get(name, 0) - self._origin.get(name, 0)) & 0xFFFF).to_bytes(2, 'little')
            for name in self._layout)

    def reset(self) -> bytes:
        """Begin again at 0; return the data of the reply, which are empty."""
        self._origin = self._counts()
        return b''

    def _counts(self) -> dict[str, int]:
        """Return the values of the names that we count."""
        counters = self._counters
        return {
            SENT: counters.messages_sent, RECEIVED: counters.messages_received,
            UNDELIVERED: counters.nak_limit_exceeded + counters.enq_limit_exceeded,
            UNSENT: counters.unsent_messages,
            ENQ_SENT: counters.enq_retries, RETRIES: counters.nak_retries,
            ENQ_OR_SENT_AGAIN: counters.enq_retries + counters.nak_retries,
            NAK_RECEIVED: counters.naks_received, ENQ_RECEIVED: counters.enqs_received,
            NO_MEMORY: counters.refused_for_memory, POLLS: counters.polls_received,
            BAD: (counters.bcc_errors + counters.crc_errors + counters.invalid_messages),
            NAK_SENT: counters.naks_sent, DUPLICATES: counters.duplicate_messages}
