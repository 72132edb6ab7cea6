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

"""Frames and processors of vectors/, with types, and tables of the driver's specification."""

from collections.abc import Iterator
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import Packet

ROOT = Path(__file__).resolve().parents[2]
VECTOR_FOLDER = ROOT / 'vectors'


@dataclass(frozen=True, slots=True)
class Vector:
    """
    One frame of vectors/frames.json.

    ``station`` is the STN of a master frame or poll. ``header`` is DST, SRC, CMD, STS, TNS,
    None where the message has less; ``fnc`` the function code of a command. ``valid`` tells
    whether the check is right, ``expected`` is the right one of a frame with a wrong one.
    Frames of one ``pair`` are a command and its reply.
    """

    name: str
    kind: str
    duplex: Duplex
    checksum: Checksum
    valid: bool
    frame: bytes
    link_data: bytes
    station: int | None
    header: tuple[int, int, int, int, int] | None
    fnc: int | None
    expected: int | None
    pair: str | None

    @property
    def is_message(self) -> bool:
        """Tell a message frame from a poll or a control symbol."""
        return self.kind == 'message'

    @property
    def has_embedded_response(self) -> bool:
        """Tell whether a response of the other direction stands inside the frame."""
        return self.name.startswith('embedded_')

    @property
    def packet(self) -> Packet:
        """Return the message inside."""
        return Packet.decode(self.link_data)


def _vector(entry: dict[str, Any]) -> Vector:
    decoded = entry['decoded']
    header = None
    if 'tns' in decoded:
        header = (decoded['dst'], decoded['src'], int(decoded['cmd'], 16),
                  int(decoded['sts'], 16), decoded['tns'])
    expected = decoded.get('right_check')
    return Vector(
        name=entry['name'], kind=entry['kind'], duplex=Duplex(entry['discipline']),
        checksum=Checksum.CRC if entry['check'] == 'CRC' else Checksum.BCC,
        valid=entry['verdict'] != 'wrong check', frame=bytes.fromhex(entry['bytes']),
        link_data=bytes.fromhex(decoded.get('link_data', '')), station=decoded.get('station'),
        header=header, fnc=int(decoded['fnc'], 16) if 'fnc' in decoded else None,
        expected=None if expected is None else int.from_bytes(bytes.fromhex(expected), 'little'),
        pair=entry.get('pair'))


def load_json(name: str) -> Any:
    """Return the content of a file of vectors/."""
    return json.loads((VECTOR_FOLDER / name).read_text(encoding='utf-8'))


def load_tables() -> Any:
    """Return the counters and messages of the driver's specification."""
    return json.loads((ROOT / 'test/vectors/driver_tables.json').read_text(encoding='utf-8'))


_ENTRIES = load_json('frames.json')['frames']
VECTORS = tuple(_vector(entry) for entry in _ENTRIES if 'time' not in entry)
MESSAGES = tuple(vector for vector in VECTORS if vector.is_message)


def vector(name: str) -> Vector:
    """Return the vector of that name."""
    return next(entry for entry in VECTORS if entry.name == name)


def without_area(data: bytes) -> bytes:
    """
    Return a PLC-5 command of a vector as we send it, with the shorter of two equal addresses.

    The vectors spell the memory area out: 07 00, or 0F 00 with a sub-element (M 13-12).
    """
    at = 1 if data[0] in (0x02, 0x26) else 5
    if data[at:at + 2] not in (b'\x07\0', b'\x0F\0'):
        return data
    return data[:at] + bytes((data[at] & 0x0E,)) + data[at + 2:]


def commands(*functions: int) -> list[Vector]:
    """Return the good CMD 0F command vectors with one of the function codes."""
    return [entry for entry in MESSAGES
            if entry.valid and entry.header is not None and entry.header[2] == 0x0F
            and entry.fnc in functions and len(entry.link_data) > 7]


def pair(name: str) -> tuple[Packet, Packet]:
    """Return command and reply of a pair, as full-duplex CRC frames carry them."""
    request = vector(f'{name}_req_fd_crc').packet
    return request, vector(f'{name}_rep_fd_crc').packet


@dataclass(frozen=True, slots=True)
class Captured:
    """
    One frame of the trace at a radio modem, whose messages have a CRC.

    ``time`` is the wall-clock time of the capture, ``direction`` is seen from the modem.
    """

    time: str
    direction: str
    checksum: Checksum
    frame: bytes


def _captured() -> Iterator[Captured]:
    """Yield the frames; a symbol belongs to a trace with the check of the message before it."""
    check = 'none'
    for entry in _ENTRIES:
        if 'time' in entry:
            check = check if entry['check'] == 'none' else entry['check']
            yield Captured(entry['time'], 'tx' if entry['direction'] == 'from the modem' else 'rx',
                           Checksum(check), bytes.fromhex(entry['bytes']))


CAPTURED = tuple(_captured())

PROCESSORS: list[dict[str, Any]] = load_json('processors.json')['processors']


@dataclass(frozen=True, slots=True)
class Exchange:
    """A command and its reply, without link header."""

    meaning: str
    command: Packet
    reply: Packet


def exchanges(name: str) -> list[Exchange]:
    """Return what a processor has been asked, and has answered."""
    entry = next(processor for processor in PROCESSORS if processor['name'] == name)
    found = []
    for exchange in entry['exchanges']:
        raw = bytes.fromhex(exchange['command'])
        command = Packet(1, 0, raw[0], 0, 7, raw[1:])
        reply = command.reply(bytes.fromhex(exchange['data']), int(exchange['sts'], 16))
        found.append(Exchange(exchange['meaning'], command, reply))
    return found


ML1400 = exchanges('micrologix_1400')
