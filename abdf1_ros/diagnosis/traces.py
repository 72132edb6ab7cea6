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

"""What a line has shown: characters, symbols, messages, and the traces of other devices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
import re
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ENQ, SOH
from abdf1_ros.df1.master import MASTER
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
from abdf1_ros.text import counted, printable

# Number of polls and messages that show another master, if we poll as well. One is not enough:
# after DLE ENQ, one of 256 random byte pairs has a right BCC.
SURE = 2

MOST_FIRST = 256
"""Most of the first bytes that are kept, to know text and other protocols."""

_SHOWN_BYTES = 16
_LEAST_TEXT = 5  # characters; fewer may be noise
_TEXT = re.compile(rb'[\x02\x03\t\r\n -~]+')  # also in STX and ETX, as readers and scales send it

# Functions of Modbus that devices use, and the same as exceptions.
_MODBUS_FUNCTIONS = frozenset(one | bit for one in (1, 2, 3, 4, 5, 6, 15, 16) for bit in (0, 0x80))
_LEAST_MODBUS = 5  # bytes; an exception has no more
_MOST_SEARCHED = 64  # bytes in which a Modbus frame may begin and end

_ANSWERS_TO_POLL = Kind.EOT, Kind.COMMAND, Kind.REPLY, Kind.DAMAGED


@dataclass(frozen=True, slots=True)
class Traces:
    """
    What a line has shown while a station was asked; a number or text that is 0 or empty: nothing.

    - ``mode``, ``check``, ``own``: our settings; ``station``: who was asked, ``gateway``: through
      which station of the line, None for none.
    - ``characters``: received, without our own that came back; ``first``: the first of them;
      ``unasked``: those that came before we had sent anything.
    - ``polls``, ``polls_answered``: of our own.
    - ``acks``, ``naks``: answers to our messages; ``enquiries``: answers to our DLE ENQ;
      ``naks_to_polls``: DLE NAK in half duplex, which no slave sends.
    - ``replies``: whole replies to our commands; ``damaged``: messages with a wrong check, or
      broken off; ``late``: seconds until the slowest reply that came after its time.
    - ``masters``: stations that another master polls; ``foreign_polls``: how often.
    - ``foreign``: the number to which replies come that we have not asked for, None for none.
    - ``other_number``: the number to which our replies come in place of ours, None for ours.
    - ``other_source``: the number from which replies come in place of the station's, None for its.
    - ``strays``: whole replies of the station to commands that we have not sent.
    - ``asked_again``: DLE ENQ of the far end, in full duplex.
    - ``echoes``: our own bytes come back. ``polled``: the master has polled us.
    - ``settings``: number of settings of the line that ``plc detect`` has tried, 0 for other
      commands; ``noisy``: with how many of them characters came.
    - ``is_acknowledged``: commands had an ACK that is not the station's own, and no reply.
    - ``is_left_alone``: for this reason no further command goes to it by itself.
    - ``is_garbled``: replies of the station come, and none arrives whole.
    - ``was_heard``: the station has answered before.

    What a question has shown is None if it was not asked:

    - ``takes_other_check``: the station takes commands with BCC where we have CRC, or the reverse.
    - ``is_polled_port``: a full-duplex port answers polls of half duplex.
    - ``neighbour``: another station that was asked, ``neighbour_answers``: whether it answers.
    - ``swallowed``: bytes with which an echo does not come back, though it does without them.
    """

    mode: LineMode = MASTER
    check: Checksum = Checksum.CRC
    own: int = 5
    station: int = 1
    gateway: int | None = None
    characters: int = 0
    first: bytes = b''
    unasked: int = 0
    polls: int = 0
    polls_answered: int = 0
    acks: int = 0
    naks: int = 0
    enquiries: int = 0
    naks_to_polls: int = 0
    replies: int = 0
    damaged: int = 0
    late: float = 0.0
    masters: tuple[int, ...] = ()
    foreign_polls: int = 0
    foreign: int | None = None
    other_number: int | None = None
    other_source: int | None = None
    strays: int = 0
    asked_again: int = 0
    echoes: bool = False
    polled: bool = False
    settings: int = 0
    noisy: int = 0
    is_acknowledged: bool = False
    is_left_alone: bool = False
    is_garbled: bool = False
    was_heard: bool = False
    takes_other_check: bool | None = None
    is_polled_port: bool | None = None
    neighbour: int | None = None
    neighbour_answers: bool | None = None
    swallowed: bytes | None = None

    @property
    def on_line(self) -> int:
        """Return the station of this line that was asked: the gateway, if there is one."""
        return self.station if self.gateway is None else self.gateway

    @property
    def has_other_user(self) -> bool:
        """Return True if another program uses the line: a master, or a device on a splitter."""
        return bool(self.masters) or self.foreign is not None and self.mode.has_one_plc

    def is_of(self, station: int | None) -> bool:
        """Return True if a symbol to or from a station of the line belongs to the station."""
        return not self.mode.is_master or station in (None, self.on_line)

    @property
    def other_check(self) -> str:
        """Return the name of the check that we do not use: BCC for CRC, CRC for BCC."""
        return str(_other(self.check).value)

    @property
    def is_df1(self) -> bool:
        """Return True if the far end has answered with symbols of DF1."""
        return bool(self.neighbour_answers) or sum((
            self.replies, self.acks, self.naks, self.enquiries, self.polls_answered,
            self.naks_to_polls, self.foreign_polls, self.asked_again)) > 0

    @property
    def came(self) -> str:
        """Return how many characters were received, as text."""
        return f'{counted(self.characters, "character")} came'

    @property
    def is_text(self) -> bool:
        """Return True if all first bytes are printable text."""
        return len(self.first) >= _LEAST_TEXT and _TEXT.fullmatch(self.first) is not None

    @property
    def is_modbus(self) -> bool:
        """Return True if the first bytes have a message of Modbus RTU."""
        return has_modbus(self.first)

    @property
    def first_text(self) -> str:
        """Return the first bytes as hex and as text; empty if none came."""
        part = self.first[:_SHOWN_BYTES]
        more = ' ...' if len(self.first) > len(part) else ''
        text = printable(part.decode('latin-1'))
        return f'{part.hex(" ").upper()} "{text}"{more}' if part else ''

    @property
    def stations(self) -> str:
        """Return the stations that another master polls, as text."""
        listed = ', '.join(map(str, self.masters))
        return f'{"stations" if len(self.masters) > 1 else "station"} {listed}'


def has_modbus(data: bytes) -> bool:
    """Return True if bytes have a message of Modbus RTU with its right check."""
    for start, (address, function) in enumerate(zip(data, data[1:_MOST_SEARCHED], strict=False)):
        if not 0 < address < 248 or function not in _MODBUS_FUNCTIONS:
            continue
        check = 0xFFFF
        for at, byte in enumerate(data[start:start + _MOST_SEARCHED], start + 1):
            check ^= byte
            for _ in range(8):
                check = check >> 1 ^ 0xA001 * (check & 1)
            if not check and at - start >= _LEAST_MODBUS:  # so a message with its check ends
                return True
    return False


class _SymbolCount:
    """
    Count the symbols of a line in both directions; ``traces`` has the result.

    See ``traces_of`` for the arguments.
    """

    def __init__(self, chunks: Iterable[Chunk], asked: Traces, cmd_timeout: float, *,
                 echoes: bool) -> None:
        self._of = asked
        self._cmd_timeout = cmd_timeout
        self._counts: Counter[str] = Counter()
        self._masters: Counter[int] = Counter()
        self._asked: Kind | None = None  # what we have sent last
        self._asked_station: int | None = None
        self._has_polled = False
        self._foreign: int | None = None
        self._source: int | None = None
        self._late = 0.0
        decoder = TrafficDecoder(asked.check, asked.mode.duplex)
        first, unasked, characters, has_sent = b'', 0, 0, False
        for chunk in without_echo(chunks) if echoes else chunks:
            if chunk.direction is Direction.OUT:
                has_sent = True
            else:
                characters += len(chunk.data)
                unasked += 0 if has_sent else len(chunk.data)
                first += chunk.data[:MOST_FIRST - len(first)]
            for entry in decoder.feed(chunk):
                self._take(entry)
        for entry in decoder.finish():
            self._take(entry)
        counts: dict[str, Any] = self._counts
        has_masters = asked.mode.is_master and self._masters.total() >= (
            SURE if self._has_polled else 1)
        self.traces = replace(
            asked, characters=characters, first=first, unasked=unasked, late=self._late,
            foreign=self._foreign, other_source=self._source, echoes=echoes,
            polled=asked.mode.is_polled and asked.own in self._masters,
            masters=tuple(sorted(self._masters)) if has_masters else (),
            foreign_polls=self._masters.total(), **counts)

    def _take(self, entry: Entry) -> None:
        if entry.direction is Direction.OUT:
            if entry.kind in (Kind.POLL, Kind.COMMAND, Kind.REPLY, Kind.ENQ):
                self._asked, self._asked_station = entry.kind, entry.station
                self._has_polled |= entry.kind is Kind.POLL
                self._counts['polls'] += entry.kind is Kind.POLL and self._of.is_of(entry.station)
        elif entry.direction is Direction.IN:
            self._hear(entry)

    def _hear(self, entry: Entry) -> None:
        kind, counts = entry.kind, self._counts
        counts['damaged'] += kind is Kind.DAMAGED
        counts['asked_again'] += kind is Kind.ENQ and not self._of.mode.is_master
        is_masters = entry.wire.startswith((SOH, ENQ)) and entry.valid is True
        if is_masters and entry.station is not None:
            self._masters[entry.station] += 1
        elif kind is Kind.REPLY:
            self._take_reply(entry)
        if not self._of.is_of(self._asked_station):
            return
        if kind is Kind.ACK or kind is Kind.NAK:
            to_what = 'enquiries' if self._asked is Kind.ENQ else 'naks_to_polls' \
                if self._asked is Kind.POLL else 'acks' if kind is Kind.ACK else 'naks'
            counts[to_what] += 1
        elif not is_masters and kind in _ANSWERS_TO_POLL and (
                self._asked is Kind.POLL or kind is Kind.EOT and self._of.mode.is_master):
            counts['polls_answered'] += 1

    def _take_reply(self, entry: Entry) -> None:
        assert entry.packet is not None
        if Mark.STRAY in entry.marks:
            self._take_stray(entry.packet)
        is_its = entry.packet.src == self._of.station or not self._of.mode.is_master
        if entry.latency is not None and is_its:
            is_late = entry.latency > self._cmd_timeout
            self._counts['replies'] += not is_late
            self._late = max(self._late, entry.latency if is_late else 0.0)

    def _take_stray(self, reply: Packet) -> None:
        if reply.dst != self._of.own:
            self._foreign = reply.dst
        elif reply.src == self._of.station:
            self._counts['strays'] += 1
        elif self._of.is_of(self._asked_station):
            self._source = reply.src


def without_echo(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """Yield chunks without the bytes of our own that have come back, in their order."""
    sent = b''
    for chunk in chunks:
        if chunk.direction is Direction.OUT:
            sent += chunk.data
            yield chunk
            continue
        size = next((at for at, pair in enumerate(zip(sent, chunk.data, strict=False))
                     if pair[0] != pair[1]), min(len(sent), len(chunk.data)))
        sent = sent[size:] if size == len(chunk.data) else b''
        if rest := chunk.data[size:]:
            yield chunk._replace(data=rest)


def traces_of(chunks: Sequence[Chunk], asked: Traces, cmd_timeout: float, *,
              echoes: bool = False) -> Traces:
    """
    Return what the bytes of a line have shown.

    ``asked`` has our settings, the station that was asked, and what is known without the bytes.
    ``cmd_timeout`` is in s. With ``echoes`` the line gives back what we send.

    If messages are damaged with our check and right with ``other_check``, the far end uses that.
    """
    traces = _SymbolCount(chunks, asked, cmd_timeout, echoes=echoes).traces
    if traces.damaged and not traces.replies:
        other = replace(asked, check=_other(asked.check))
        again = _SymbolCount(chunks, other, cmd_timeout, echoes=echoes).traces
        if again.damaged < traces.damaged:
            return replace(traces, takes_other_check=True)
    return traces


def _other(check: Checksum) -> Checksum:
    return Checksum.BCC if check is Checksum.CRC else Checksum.CRC
