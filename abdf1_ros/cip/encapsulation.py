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
The messages of EtherNet/IP on a TCP connection, and the items in them.

A message has a header of 24 bytes and data. The common packet format is a list of items, each
with its type and length.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
import struct

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader, word

PORT = 44818

MOST_DATA = 1024
"""Most bytes of data that we read. A PCCC command with all that is around it has 400."""

_HEADER = struct.Struct('<HHII8sI')
HEADER_SIZE = _HEADER.size


class EipCommand(IntEnum):
    """The commands of the encapsulation that we answer."""

    NOP = 0x00
    LIST_SERVICES = 0x04
    LIST_IDENTITY = 0x63
    LIST_INTERFACES = 0x64
    REGISTER_SESSION = 0x65
    UNREGISTER_SESSION = 0x66
    SEND_RR_DATA = 0x6F
    SEND_UNIT_DATA = 0x70


COMMANDS = frozenset((*EipCommand, 0x01, 0x72, 0x73))
"""All commands that a message may begin with."""


class EipStatus(IntEnum):
    """A status of the encapsulation."""

    UNSUPPORTED = 0x01
    MALFORMED = 0x03
    NO_SESSION = 0x64
    WRONG_LENGTH = 0x65
    WRONG_VERSION = 0x69


class EipItem(IntEnum):
    """The types of items."""

    NULL_ADDRESS = 0x00
    IDENTITY = 0x0C
    CONNECTED_ADDRESS = 0xA1
    CONNECTED_DATA = 0xB1
    UNCONNECTED_DATA = 0xB2
    SERVICES = 0x100


@dataclass(frozen=True, slots=True)
class EipMessage:
    """A message. ``is_cut``: it has more than MOST_DATA bytes, and ``data`` is empty."""

    command: int
    session: int = 0
    status: int = 0
    context: bytes = bytes(8)
    options: int = 0
    data: bytes = b''
    is_cut: bool = False

    def encode(self) -> bytes:
        """Return the bytes of this message."""
        return _HEADER.pack(self.command, len(self.data), self.session, self.status, self.context,
                            self.options) + self.data

    def reply(self, data: bytes = b'', status: int = 0) -> EipMessage:
        """Return the reply to this message, with its session and context."""
        return replace(self, status=status, options=0, data=data, is_cut=False)


class MessageReader:
    """Take bytes as they come; yield messages. At most one message waits for its last bytes."""

    def __init__(self) -> None:
        self._waiting = b''
        self._to_drop = 0  # bytes of a message that is too long

    def feed(self, data: bytes) -> Iterator[EipMessage]:
        """Take bytes; yield the messages that they complete, a too long one without its data."""
        dropped = min(self._to_drop, len(data))
        self._to_drop -= dropped
        self._waiting += data[dropped:]
        while len(self._waiting) >= HEADER_SIZE:
            command, length, session, status, context, options = _HEADER.unpack_from(self._waiting)
            end = HEADER_SIZE + length
            if length > MOST_DATA:
                self._to_drop = max(0, end - len(self._waiting))
                yield EipMessage(command, session, status, context, options, is_cut=True)
            elif len(self._waiting) < end:
                return
            else:
                yield EipMessage(command, session, status, context, options,
                                 self._waiting[HEADER_SIZE:end])
            self._waiting = self._waiting[end:]


def items_of(reader: Reader) -> list[tuple[int, bytes]]:
    """Return the items with their types; FormatError where count or a length lies."""
    items = []
    for _ in range(reader.word()):
        kind = reader.word()
        items.append((kind, reader.take(reader.word())))
    if not reader.is_empty:
        raise FormatError('bytes after the last item')
    return items


def encode_items(*items: tuple[int, bytes]) -> bytes:
    """Return a list of items."""
    return word(len(items)) + b''.join(_encoded(items))


def _encoded(items: Iterable[tuple[int, bytes]]) -> Iterator[bytes]:
    for kind, data in items:
        yield word(kind) + word(len(data)) + data
