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

"""The exchanges of our programs with others that were recorded: vectors/captures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.sniffer.capture import Chunk, read_capture
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.traffic import TrafficDecoder
from support.vectors import load_json, VECTOR_FOLDER

FOLDER = VECTOR_FOLDER / 'captures'
HALF_DUPLEX = ('baud: 9600', 'check: CRC', 'duplex: half')


@dataclass(frozen=True, slots=True)
class Exchange:
    """A command and its reply, as one of the ends is somebody else's program."""

    command: Packet
    reply: Packet
    text: str


@dataclass(frozen=True)
class Capture:
    """
    One file, and what ``index.json`` tells of it.

    ``client`` and ``server`` are "product version", or "ours: what of ours". ``words`` are
    the words that the server had, by address: how many, all 0, or their bytes in hexadecimal.
    ``replies`` says what our server has to give for the same commands: the same "bytes", or as
    many values in any "form", where the other's words are not known.
    """

    name: str
    client: str
    server: str
    family: PlcType
    check: Checksum
    words: dict[str, int | str]
    replies: str

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """Return all that was on the line."""
        path = FOLDER / f'{self.name}.cap'
        return tuple(read_capture(path.name, path.read_text('ascii').splitlines(), {}))

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Return what the sniffer makes of it."""
        session = TrafficDecoder(self.check)
        seen = [entry for chunk in self.chunks for entry in session.feed(chunk)]
        return (*seen, *session.finish())

    def exchanges(self) -> Iterator[Exchange]:
        """Yield the commands that got a reply, in the order of the commands."""
        replies = {}
        for entry in reversed(self.entries):
            packet = entry.packet
            if packet is None or entry.marks or entry.kind not in (Kind.COMMAND, Kind.REPLY):
                continue
            if packet.is_reply:
                replies[packet.key_of_command] = packet
        for entry in self.entries:
            if entry.kind is Kind.COMMAND and entry.packet is not None and not entry.marks:
                command = entry.packet
                reply = replies.pop(command.duplicate_key, None)
                if reply is not None:
                    yield Exchange(command, reply, entry.text)

    def table(self) -> DataTable:
        """Return the words of the server as they were at the beginning."""
        table = DataTable(self.family)
        for text, content in self.words.items():
            address = parse_address(text, self.family)
            data = bytes(2 * content) if isinstance(content, int) else bytes.fromhex(content)
            table.create(address, len(data) // 2)
            table.write(address, data)
        return table


CAPTURES = tuple(
    Capture(name, entry['client'], entry['server'], PlcType(entry['family']),
            Checksum(entry['check']), entry['words'], entry['replies'])
    for name, entry in load_json('captures/index.json').items())


def write_capture(path: Path, said: Iterable[tuple[str, bytes]], step: float = 0.01,
                  head: Iterable[str] = HALF_DUPLEX) -> str:
    """Make a recording, of what was said each so many seconds; return its path."""
    lines = ['abdf1_ros capture 1', *head]
    path.write_text(''.join(f'# {line}\n' for line in lines) + ''.join(
        f'{count * step:.6f} {way} {data.hex(" ")}\n'
        for count, (way, data) in enumerate(said)), encoding='ascii')
    return str(path)
