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

"""The reads of another master: for ``check`` from a recording, for ``plc init`` from the line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
import re
from typing import cast

from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.df1.packet import PRIORITY_BIT
from abdf1_ros.driver.driver import Driver, Listener
from abdf1_ros.driver.overheard import Carried
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.plan.report import PERIOD_STEPS
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.traffic import TrafficDecoder
from abdf1_ros.text import counted

_SECOND = '<'  # bytes from the far side of a recording count as bytes of a second port
_STEP = 0.001  # s between chunks of a recording without times

# The end of a read in words, as written by ``describe``.
_READ = re.compile(r'(?P<address>[A-Z]{1,3}\d*:\S+), (?P<count>\d+) (?P<unit>word|element)s?\Z')
# The same in bytes, if they are whole words.
_BYTES = re.compile(r'(?P<address>[0-7]+) \(ADDR \d*[02468]\), (?P<count>\d*[02468]) bytes\Z')

HEAD = f"""\
# What another master reads on this line, one row a read. Each becomes a topic; the bridge sends
# nothing (Mode Listen). Period is at least twice the mean time between two such reads. A read that
# came once has {PERIOD_STEPS[-1]}: enter the longest time (ms) between two of them.
# A comment below was heard, too, and is not a row of numbers.
Tag,Command,Address,Station,PLC_Type,Length,Period
"""


class _Ignoring:
    """A listener that ignores all events."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        """Return a function that ignores its call."""
        return lambda *args: None


class Overhearing:
    """
    A driver that only listens to a recording or a port, with the reads that it heard.

    ``carried``: the answered reads; ``size``: bytes; ``has_messages``: commands or replies.
    """

    def __init__(self, network: Network, mappings: Rows = Rows()) -> None:  # noqa: B008
        self._driver = Driver(network, mappings, DriverSettings(), cast(Listener, _Ignoring()))
        self._driver.machine.start(-1.0)
        self._now = 0.0
        self._traffic = TrafficDecoder(network.checksum)
        self.size = 0
        self.has_messages = False

    def hear(self, chunk: Chunk) -> None:
        """Read a chunk of bytes; the caller gives chunks in the order of their times."""
        self._now = self._now + _STEP if chunk.time is None else chunk.time
        is_far = chunk.direction is Direction.IN
        self._driver.machine.receive_data(
            SecondPort(chunk.data) if is_far else chunk.data, self._now)
        self.size += len(chunk.data)
        self.has_messages = self.has_messages or any(
            entry.packet is not None and entry.valid is not False
            for entry in self._traffic.feed(chunk))

    @property
    def carried(self) -> list[Carried]:
        """Return the answered reads, by station and text."""
        assert self._driver.overheard is not None
        return [read for _, read in sorted(self._driver.overheard.carried.items())]

    def unread(self) -> dict[Mapping, str]:
        """Return the rows without values, with the reason."""
        overheard = self._driver.overheard
        assert overheard is not None
        return {mapping: overheard.why_unread(point)
                for mapping, point in self._driver.points.items() if point.last_good is None}


def overheard(network: Network, rows: Rows,
              files: Sequence[str]) -> tuple[list[str], dict[Mapping, str]]:
    """
    Return the reads in recordings as text, and the rows that stay empty, with the reason.

    Raises OSError, and Problem if a file is damaged.
    """
    heard = [_recording(network, rows, Path(file)) for file in files]
    if not any(each.has_messages for each in heard):
        size = sum(each.size for each in heard)
        return [], dict.fromkeys(rows, (
            f'no message in {counted(size, "byte")}: another Error_Code, baud rate or protocol'
            if size else 'nothing was recorded'))
    unread = [each.unread() for each in heard]
    return texts_of(read for each in heard for read in each.carried), {
        row: max((reasons[row] for reasons in unread), key=len)  # the longer one names a read
        for row in unread[0] if all(row in reasons for reasons in unread)}


def _recording(network: Network, rows: Rows, file: Path) -> Overhearing:
    """Return a driver of its own: neither bytes nor times continue those of another recording."""
    chunks = [*Recording(file).chunks()]
    has_two = any(chunk.direction is Direction.IN for chunk in chunks)
    heard = Overhearing(replace(
        network, mode='Listen', listen_port=_SECOND if has_two else ''), rows)
    for chunk in chunks:
        heard.hear(chunk)
    return heard


def texts_of(carried: Iterable[Carried]) -> list[str]:
    """Return a line of text for each read; the counts of equal reads are added."""
    counts: Counter[tuple[int, str]] = Counter()
    for read in carried:
        counts[read.station, read.text] += read.count
    return [f'station {station}: {text}: {counted(count, "time")}'
            for (station, text), count in sorted(counts.items())]


def map_of(carried: Iterable[Carried]) -> str:
    """Return a map CSV with a row for each of these reads."""
    tags: set[str] = set()
    return HEAD + ''.join(f'{_row(read, tags)}\n' for read in carried)


def _row(read: Carried, tags: set[str]) -> str:
    """Return the row of a read; a comment if its words have several types, or a row already."""
    place = _place(read)
    if place is None:
        return f'# station {read.station}: {read.text}: {counted(read.count, "time")}'
    plc_type, address, length = place
    tag = re.sub(r'\W+', '_', f'{address.lower()}_{length}_of_{read.station}')
    if tag in tags:  # the same words, read with another command
        return f'# station {read.station}: {read.text}: as {tag}'
    tags.add(tag)
    return f'{tag},Read,{address},{read.station},{plc_type},{length},{_period(read)}'


def _period(read: Carried) -> int:
    if read.count == 1:
        return PERIOD_STEPS[-1]
    interval = (read.last - read.first) / (read.count - 1)
    return next((step for step in PERIOD_STEPS if step >= 2000 * interval), PERIOD_STEPS[-1])


def _place(read: Carried) -> tuple[PlcType, str, int] | None:
    """Return PLC type, address and Length of a read of numbers; None for any other read."""
    cmd, data = read.command.cmd & ~PRIORITY_BIT, read.command.data
    plc_type = PlcType.PLC2 if cmd != 0x0F else \
        PlcType.SLC if data[:1] in (b'\xA1', b'\xA2') else PlcType.PLC5
    match = (_BYTES if plc_type == PlcType.PLC2 else _READ).search(read.text)
    if match is None:
        return None
    try:
        address = parse_address(match['address'].rpartition(' ')[2], plc_type)
    except FormatError:
        return None
    kind = FAMILIES[plc_type].layout(address.file_type)
    is_part = kind.words > 1 and match.groupdict().get('unit') == 'word'
    if is_part or address.file_type.is_structure or address.file_type is FileType.STRING:
        return None
    count = int(match['count'])
    return plc_type, match['address'], count // 2 if plc_type == PlcType.PLC2 else count
