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

"""Two logs with one side of a line each: the same minutes, merged by their times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from abdf1_ros.df1.frames import ACK
from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.entries import Kind
from abdf1_ros.sniffer.traffic import TrafficDecoder

_SAMPLE = 5000  # chunks of a file by which its side is judged

Heard = tuple[Recording, Chunk]


@dataclass(slots=True)
class _Half:
    """The first part of a file."""

    kinds: Counter[Kind]
    begun: float | None  # seconds, on the clock of the file
    seconds: float

    @property
    def asks(self) -> bool:
        """Return True if all messages are commands."""
        return self.kinds[Kind.COMMAND] > 0 and not self.kinds[Kind.REPLY]

    @property
    def answers(self) -> bool:
        """Return True if all messages are replies."""
        return self.kinds[Kind.REPLY] > 0 and not (
            self.kinds[Kind.COMMAND] or self.kinds[Kind.POLL])


def _side(recording: Recording) -> _Half:
    decoder, kinds, seconds = TrafficDecoder(), Counter[Kind](), 0.0
    for chunk in islice(recording.chunks(), _SAMPLE):
        kinds.update(entry.kind for entry in decoder.feed(chunk))
        seconds = max(seconds, chunk.time or 0.0)
    kinds.update(entry.kind for entry in decoder.finish())
    return _Half(kinds, recording.begun, seconds)


def two_sides(names: Sequence[str], opened: Callable[[str], Recording]) -> Sequence[str]:
    """
    Return two files of one side each, the side that asks first; nothing for all others.

    Raises Problem if they have no common time.
    """
    if len(names) != 2 or not all(Path(name).is_file() for name in names):
        return ()
    try:
        sides = {name: _side(opened(name)) for name in names}
    except (OSError, Problem):
        return ()  # told when the file is read
    pair = sorted(names, key=lambda name: not sides[name].asks)
    one, other = (sides[name] for name in pair)
    if not (one.asks and other.answers):
        return ()
    if one.begun is None or other.begun is None or not (
            one.begun <= other.begun + other.seconds and other.begun <= one.begun + one.seconds):
        raise Problem(f'{pair[0]} and {pair[1]}', (
            'one side of the line each, without a common time: give one of them alone, or record '
            'both sides into one file'))
    return pair


def merged(pair: Sequence[str], opened: Callable[[str], Recording]) -> Iterator[Heard]:
    """
    Yield what two sides have said, in the order of their times.

    At the same time an answer follows its question, and the side that asks follows all else.
    """
    sides = [_timed(opened(name), way)
             for name, way in zip(pair, (Direction.OUT, Direction.IN), strict=True)]
    waiting = [next(side, None) for side in sides]
    is_asked, begun = False, min(time for time, _ in filter(None, waiting))
    while any(waiting):
        _, _, at = min((each[0], (number == 1) != is_asked, number)
                       for number, each in enumerate(waiting) if each)
        found = waiting[at]
        assert found is not None
        time, (recording, chunk) = found
        yield recording, chunk._replace(time=time - begun)
        is_asked = at == 0 and chunk.data != ACK
        waiting[at] = next(sides[at], None)


def _timed(recording: Recording, way: Direction) -> Iterator[tuple[float, Heard]]:
    """Yield the chunks of a side, each with its time on the clock of the file."""
    time = 0.0
    for chunk in recording.chunks():
        time = max(time, (recording.begun or 0.0) + (chunk.time or 0.0))
        yield time, (recording, chunk._replace(direction=way))
