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

from enum import Enum

from abdf1_ros.counters import Counters
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.diagnostics import ReadCounters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc.identity import HALF_DUPLEX_PORT

_MODEM_LINES = 'modem lines'
_LINES = ('CTS', 'RTS', 'DSR', 'DCD', 'DTR')

_SENT, _RECEIVED, _UNDELIVERED = 'messages sent', 'messages received', 'messages undelivered'
_BAD, _NO_MEMORY = 'bad messages received', 'messages refused for lack of memory'
_DUPLICATES = 'duplicate messages received'
_ENQ_SENT, _ENQ_RECEIVED, _NAK_RECEIVED = 'ENQ sent', 'ENQ received', 'NAK received'
_RETRIES, _POLLS = 'messages sent again', 'polls received'
_DCD, _LOST = 'carrier recovered', 'modem lost'
_UNUSED = ''


class CounterLayout(Enum):
    """What each word counts; '' for a word that is not used."""

    SLC_FULL_DUPLEX = (
        _MODEM_LINES, _SENT, _RECEIVED, _UNDELIVERED, _ENQ_SENT, _NAK_RECEIVED, _ENQ_RECEIVED,
        _BAD, _NO_MEMORY, _DUPLICATES, _UNUSED, _DCD, _LOST)
    SLC_MASTER = (
        _MODEM_LINES, _SENT, _RECEIVED, _UNDELIVERED, _RETRIES, 'last normal scan (100 ms)',
        'longest normal scan (100 ms)', _BAD, _UNUSED, _DUPLICATES,
        'last priority scan (100 ms)', _DCD, _LOST, 'longest priority scan (100 ms)')
    SLC_SLAVE = (
        _MODEM_LINES, _SENT, _RECEIVED, _UNDELIVERED, _RETRIES, _UNUSED, _POLLS, _BAD,
        _NO_MEMORY, _DUPLICATES, _UNUSED, _DCD, _LOST)
    MICROLOGIX_1000 = (
        _UNUSED, _SENT, _RECEIVED, _UNDELIVERED, _ENQ_SENT, _NAK_RECEIVED, _ENQ_RECEIVED, _BAD,
        _NO_MEMORY, _DUPLICATES, 'framing errors')
    PLC5 = (
        _MODEM_LINES, _SENT, _RECEIVED, _UNDELIVERED, 'ENQ sent, or messages sent again',
        _NAK_RECEIVED, _ENQ_RECEIVED, _BAD, 'NAK sent', _DUPLICATES, 'receive errors', _DCD,
        _LOST)

    @property
    def size(self) -> int:
        """Return the bytes of the whole block."""
        return 2 * len(self.value)


def layout_of(identity: Identity | None) -> CounterLayout | None:
    """Return the layout of a processor that has identified itself, None for an unknown one."""
    if identity is None:
        return None
    if identity.family == 'PLC-5':
        return CounterLayout.PLC5
    if identity.family != 'SLC':
        return None
    if identity.processor is Processor.ML1000:
        return CounterLayout.MICROLOGIX_1000
    is_half_duplex = identity.interface == HALF_DUPLEX_PORT
    return CounterLayout.SLC_SLAVE if is_half_duplex else CounterLayout.SLC_FULL_DUPLEX


def counter_request(identity: Identity | None) -> ReadCounters:
    """Return the command that reads the counters of the port of that processor."""
    layout = layout_of(identity)
    if layout is not None:
        return ReadCounters(0, layout.size)
    known = identity or Identity('', '')
    return ReadCounters(known.counter_address, known.counter_size)


def decode_counters(data: bytes, layout: CounterLayout | None) -> dict[str, str]:
    """
    Return each counter by its name; without a layout the bytes, in hexadecimal.

    A reply may have fewer words than the layout, or more, which are numbered. Raises
    FormatError for an empty one, and for half a word.
    """
    if not data:
        raise FormatError('no counters in the reply')
    if layout is None:
        return {'bytes': data.hex(' ').upper()}
    if len(data) % 2:
        raise FormatError(f'counters of {len(data)} bytes; they are words')
    values = [int.from_bytes(data[at:at + 2], 'little') for at in range(0, len(data), 2)]
    names = [*layout.value, *(f'word {n}' for n in range(len(layout.value), len(values)))]
    return {name: _lines(value) if name == _MODEM_LINES else str(value)
            for name, value in zip(names, values, strict=False) if name}


def _lines(value: int) -> str:
    """Return the modem lines that are on."""
    on = [name for bit, name in enumerate(_LINES) if value >> bit & 1]
    return ' '.join(on) or 'none on'


class ServedCounters:
    """
    The counters of our own link, as the other end reads and resets them.

    A reset moves only their origin for the other end: the counters themselves are also shown
    elsewhere, and only the thread of the link changes them.
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
            for name in self._layout.value)

    def reset(self) -> None:
        """Begin again at 0."""
        self._origin = self._counts()

    def _counts(self) -> dict[str, int]:
        """Return those of the names that we count."""
        counters = self._counters
        return {
            _SENT: counters.messages_sent, _RECEIVED: counters.messages_received,
            _UNDELIVERED: counters.nak_limit_exceeded + counters.enq_limit_exceeded,
            _ENQ_SENT: counters.enq_retries, _RETRIES: counters.nak_retries,
            'ENQ sent, or messages sent again': counters.enq_retries + counters.nak_retries,
            _NAK_RECEIVED: counters.naks_received, _ENQ_RECEIVED: counters.enqs_received,
            _NO_MEMORY: counters.refused_for_memory, _POLLS: counters.polls_received,
            _BAD: (counters.bcc_errors + counters.crc_errors + counters.invalid_messages),
            'NAK sent': counters.naks_sent, _DUPLICATES: counters.duplicate_messages}


def served_counters(counters: Counters, plc_type: PlcType, *, is_full_duplex: bool,
                    is_master: bool = False) -> ServedCounters | None:
    """
    Return our counters as a PLC-5 shows its own, or an SLC in the same role.

    The modules in front of a PLC-2 or PLC-3 have blocks of their own (M 9-10), which are not
    emulated: None.
    """
    if plc_type is PlcType.PLC5:
        return ServedCounters(counters, CounterLayout.PLC5)
    if plc_type is not PlcType.SLC:
        return None
    if is_full_duplex:
        return ServedCounters(counters, CounterLayout.SLC_FULL_DUPLEX)
    layout = CounterLayout.SLC_MASTER if is_master else CounterLayout.SLC_SLAVE
    return ServedCounters(counters, layout)
