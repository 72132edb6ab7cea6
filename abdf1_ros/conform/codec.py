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
Bytes of the line, made and read without the package's own link layer.

Everything here is the plainest form of its rule: checks are computed bit by bit, a frame is read
from the beginning of a buffer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

DLE = 0x10
ACK, NAK, ENQ, EOT = b'\x10\x06', b'\x10\x15', b'\x10\x05', b'\x10\x04'
_SOH, _STX, _ETX = 0x01, 0x02, 0x03

HEADER_SIZE = 6  # DST SRC CMD STS TNS TNS (M 6-3)
REPLY_BIT = 0x40  # of CMD


class BlockCheck(Enum):
    """The check of messages; a poll has a BCC on every line (M 5-3)."""

    BCC = 'BCC'
    CRC = 'CRC'


CHECK_SIZES = {BlockCheck.BCC: 1, BlockCheck.CRC: 2}


class SymbolKind(Enum):
    """The kind of a received symbol, in words."""

    ACK = 'DLE ACK'
    NAK = 'DLE NAK'
    ENQ = 'DLE ENQ'
    EOT = 'DLE EOT'
    POLL = 'a poll'
    MESSAGE = 'a message'
    MASTER_MESSAGE = 'a message of a master'
    NOISE = 'bytes outside of any symbol'


@dataclass(frozen=True, slots=True)
class Symbol:
    """
    One symbol: ``raw`` as received, ``data`` its link data without doubled DLE.

    ``is_good`` is False for a wrong check. ``embedded`` are the responses inside a message (M
    4-3). ``at`` is the time of its last byte, in seconds of the wire's clock.
    """

    kind: SymbolKind
    raw: bytes
    data: bytes = b''
    station: int | None = None
    is_good: bool = True
    embedded: tuple[SymbolKind, ...] = ()
    at: float = 0.0

    def __str__(self) -> str:
        check = '' if self.is_good else ' with a wrong check'
        return f'{self.kind.value}{check}'


def bcc(data: Iterable[int]) -> int:
    """Return the two's complement of the sum of ``data`` (M 5-2, 5-4)."""
    return -sum(data) & 0xFF


def crc(data: Iterable[int]) -> int:
    """Return the CRC-16 of ``data``: polynomial A001 reflected, begun with 0 (M 5-6, 5-7)."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder = remainder >> 1 ^ (0xA001 if remainder & 1 else 0)
    return remainder


def check_bytes(data: bytes, check: BlockCheck, station: int | None = None) -> bytes:
    """
    Return the check of a message, as it is sent after DLE ETX.

    ``station`` is given for a message of a master. The BCC covers it and the data (M 5-4); the CRC
    covers station and STX, the data and ETX (M 5-6, 5-7).
    """
    if check is BlockCheck.BCC:
        return bytes((bcc(data if station is None else bytes((station,)) + data),))
    before = b'' if station is None else bytes((station, _STX))
    return crc(before + data + bytes((_ETX,))).to_bytes(2, 'little')


def _stuffed(data: bytes) -> bytes:
    return b''.join(bytes((byte, byte)) if byte == DLE else bytes((byte,)) for byte in data)


def message(data: bytes, check: BlockCheck) -> bytes:
    """Return the frame for ``data`` from a slave or in full duplex (M 5-2)."""
    return b'\x10\x02' + _stuffed(data) + b'\x10\x03' + check_bytes(data, check)


def master_message(station: int, data: bytes, check: BlockCheck) -> bytes:
    """Return the frame of a half-duplex master's message (M 5-2)."""
    return (b'\x10\x01' + _stuffed(bytes((station,))) + b'\x10\x02' + _stuffed(data)
            + b'\x10\x03' + check_bytes(data, check, station))


def divided(frame: bytes) -> tuple[bytes, bytes]:
    """Return a message frame in two parts, divided after its first data symbol."""
    at = 4 if frame[2] == DLE else 3
    return frame[:at], frame[at:]


def poll(station: int) -> bytes:
    """Return a poll: DLE ENQ, station, BCC (M 5-3)."""
    return b'\x10\x05' + _stuffed(bytes((station,))) + bytes((bcc((station,)),))


def damaged(frame: bytes) -> bytes:
    """Return ``frame`` with one bit of its check turned over."""
    return frame[:-1] + bytes((frame[-1] ^ 0x01,))


def all_damaged(frame: bytes, check: BlockCheck) -> list[bytes]:
    """Return ``frame`` with one bit turned over in each byte of its check."""
    return [frame[:at] + bytes((frame[at] ^ 0x01,)) + frame[at:][1:]
            for at in range(len(frame) - CHECK_SIZES[check], len(frame))]


def has_10_in_check(frame: bytes, check: BlockCheck) -> bool:
    """Tell whether the check has a byte 10; a byte of the check is never doubled (M 5-5)."""
    return DLE in frame[-CHECK_SIZES[check]:]


def is_command(symbol: Symbol) -> bool:
    """Tell whether a symbol is a good message with a command (M 6-3)."""
    return symbol.is_good and len(symbol.data) >= HEADER_SIZE and not symbol.data[2] & REPLY_BIT


def is_reply(symbol: Symbol) -> bool:
    """Tell whether a symbol is a good message with a reply (M 6-3)."""
    return symbol.kind is SymbolKind.MESSAGE and symbol.is_good \
        and len(symbol.data) >= HEADER_SIZE and bool(symbol.data[2] & REPLY_BIT)


def next_symbol(buffer: bytes, check: BlockCheck, is_half_duplex: bool) -> Symbol | None:
    """Return the symbol at the beginning of ``buffer``; None where more bytes are needed."""
    if not buffer:
        return None
    if buffer[0] != DLE:
        end = buffer.find(DLE)
        return Symbol(SymbolKind.NOISE, buffer if end < 0 else buffer[:end])
    if len(buffer) < 2:
        return None
    for kind, pair in ((SymbolKind.ACK, ACK), (SymbolKind.NAK, NAK), (SymbolKind.EOT, EOT)):
        if buffer[:2] == pair:
            return Symbol(kind, pair)
    if buffer[:2] == ENQ:
        return _poll(buffer) if is_half_duplex else Symbol(SymbolKind.ENQ, ENQ)
    if buffer[1] == _STX:
        return _message(buffer, 2, check, None)
    if buffer[1] == _SOH and is_half_duplex:
        return _master_message(buffer, check)
    return Symbol(SymbolKind.NOISE, buffer[:2])


def _station(buffer: bytes) -> tuple[int, int] | None:
    """Return the station after the first two bytes, and its end; None where bytes are missing."""
    if len(buffer) < 4:
        return None
    return (buffer[2], 4 if buffer[2:4] == b'\x10\x10' else 3)


def _poll(buffer: bytes) -> Symbol | None:
    found = _station(buffer)
    if found is None or len(buffer) <= found[1]:
        return None
    station, end = found
    raw = buffer[:end + 1]
    return Symbol(SymbolKind.POLL, raw, station=station, is_good=raw == poll(station))


def _master_message(buffer: bytes, check: BlockCheck) -> Symbol | None:
    found = _station(buffer)
    if found is None or len(buffer) < found[1] + 2:
        return None
    station, end = found
    if buffer[end:end + 2] != b'\x10\x02':
        return Symbol(SymbolKind.NOISE, buffer[:end])
    return _message(buffer, end + 2, check, station)


def _message(buffer: bytes, start: int, check: BlockCheck,
             station: int | None) -> Symbol | None:
    """Read a message whose data begin at ``start``."""
    data, embedded, at = bytearray(), [], start
    while at < len(buffer):
        pair = buffer[at:at + 2]
        if pair[0] != DLE:
            data.append(pair[0])
            at += 1
            continue
        if len(pair) < 2:
            return None
        if pair in (ACK, NAK):
            embedded.append(SymbolKind.ACK if pair == ACK else SymbolKind.NAK)
        elif pair[1] == DLE:
            data.append(DLE)
        elif pair[1] == _ETX:
            return _ended(buffer, at + 2, bytes(data), check, station, tuple(embedded))
        else:
            return Symbol(SymbolKind.NOISE, buffer[:at])
        at += 2
    return None


def _ended(buffer: bytes, at: int, data: bytes, check: BlockCheck, station: int | None,
           embedded: tuple[SymbolKind, ...]) -> Symbol | None:
    wanted = check_bytes(data, check, station)
    end = at + len(wanted)
    if len(buffer) < end:
        return None
    kind = SymbolKind.MESSAGE if station is None else SymbolKind.MASTER_MESSAGE
    return Symbol(kind, buffer[:end], data, station, buffer[at:end] == wanted, embedded)
