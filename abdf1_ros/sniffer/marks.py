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
Times and directions in a text of another program.

Directions are learnt from the text: known words and arrows, or two kinds of marks that alternate.
A mark is the text before the bytes of a line, a line before them, or their indent.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations
import math
import re

from abdf1_ros.sniffer.capture import Direction
from abdf1_ros.sniffer.layouts import ADDRESS, Piece, SECONDS, TIME_OF_DAY

_FEW = 6  # kinds of marks; of more, those are taken together that differ in a number
_DEPTH = 3  # lines before bytes of which one may be a mark

_UNITS = {'s': 1.0, 'ms': 1e-3, 'ns': 1e-9}  # s; all others are microseconds
_DAY = 86400.0
_SET_BACK = 3600.0  # s; a time of day that is earlier by more than this is of the next day

_OUT = ('tx txd sent send sends sending written write wrote writing irp_mj_write out output '
        'transmit transmitted request req cmd command query master host gesendet senden sende '
        'envoyé enviado inviato отправлено 发 发送 > >> >>> -> --> => → ▶ »')
_IN = ('rx rxd received receive receives recv rcvd receiving read reading irp_mj_read in input '
       'reply response resp answer slave empfangen empfange reçu recibido ricevuto получено '
       '收 接收 < << <<< <- <-- <= ← ◀ «')
_WAYS = {**dict.fromkeys(_OUT.split(), Direction.OUT), **dict.fromkeys(_IN.split(), Direction.IN)}
_ARROW = r'(?:[-=]*>+|<+[-=]*|[→←▶◀»«])'
WORD = re.compile(rf'[^\W\d_]+(?:_[^\W\d_]+)*|{_ARROW}')
# An arrow between two names says nothing alone: the names do.
_BETWEEN = re.compile(rf'\w\S*\s*{_ARROW}\s*\w')
_NUMBER = re.compile(rf'({ADDRESS})|(?<!\w)(?:0[xX])?[0-9A-Fa-f]*\d[0-9A-Fa-f]*(?!\w)')
_NUMBERED = re.compile(r'(?<=[^\W\d])\d+(?!\w)|(?<=_)\d+')
GLUED = re.compile(r'(?<![A-Za-z])(?:[TR]X)(?:[0-9A-Fa-f]{2})+(?!\w)', re.IGNORECASE)
# A kind of text that may be a mark.
MARK = re.compile(rf'{WORD.pattern}|{ADDRESS}')


def kind_of(text: str) -> str:
    """Return a text without times, and with "#" for numbers: it is the same for equal marks."""
    text = SECONDS.sub('', TIME_OF_DAY.sub('', text))
    return ' '.join(_NUMBER.sub(lambda match: match[1] or '#', text).split())


def way_of(kind: str, common: frozenset[str] = frozenset()) -> Direction | None:
    """Return the only direction that a text names by known words; None if it names none."""
    words = {word for word in map(str.lower, WORD.findall(kind)) if word not in common}
    ways = {_WAYS[word] for word in words if word in _WAYS}
    if _BETWEEN.search(kind):
        ways = {_WAYS[word] for word in words if word in _WAYS and word[0].isalpha()}
    return ways.pop() if len(ways) == 1 else Direction.UNKNOWN if ways else None


@dataclass(slots=True)
class TextClock:
    """Times of a text as seconds since its first time."""

    begun: float | None = None
    now: float | None = None

    def read(self, text: str) -> float | None:
        """Return the time in a text; None if it has none."""
        match = TIME_OF_DAY.search(text)
        is_of_day = match is not None
        if match:
            hours = int(match['hours'])
            if match['half']:
                hours = hours % 12 + 12 * (match['half'] in 'pP')
            seconds = re.sub('[,:]', '.', match['seconds'])
            time = 3600.0 * hours + 60 * int(match['minutes']) + float(seconds)
        elif match := SECONDS.search(text):
            time = float(match['number']) * _UNITS.get(match['unit'] or 's', 1e-6)
        else:
            return None
        if self.begun is None or not is_of_day and time < self.begun:
            self.begun = time  # a clock that has begun again: another recording
        later = time - self.begun
        if self.now is not None and is_of_day:  # a time of day starts again at midnight
            later += _DAY * max(0, math.ceil((self.now - _SET_BACK - later) / _DAY))
        self.now = later
        return later


@dataclass(slots=True)
class Marks:
    """
    The directions of a text.

    ``ways`` has the kinds of text before the bytes of a line, ``lines`` the kinds of whole lines
    before bytes. ``is_indent`` tells that the indent is the mark. ``has_line_times`` tells
    that lines without bytes give the times.
    """

    ways: dict[str, Direction] = field(default_factory=dict)
    lines: dict[str, Direction] = field(default_factory=dict)
    plain: str | None = None  # the only text before bytes: not a mark
    is_indent: bool = False
    has_line_times: bool = True
    is_guess: bool = False
    is_coarse: bool = False  # numbers at the end of a word are no part of a mark

    def kind(self, text: str) -> str:
        """Return a text as it counts as a mark."""
        return _NUMBERED.sub('#', kind_of(text)) if self.is_coarse else kind_of(text)

    @property
    def has_both(self) -> bool:
        """Return True if both directions are known."""
        return {Direction.OUT, Direction.IN} <= {*self.ways.values(), *self.lines.values()}

    def of_line(self, kind: str) -> Direction | None:
        """Return the direction that a line without bytes sets."""
        return self.lines[kind] if kind in self.lines else way_of(kind)

    def of_bytes(self, kind: str) -> Direction:
        """Return the direction of bytes with a text of their own."""
        known = self.ways.get(kind)
        return known if known is not None else way_of(kind) or Direction.UNKNOWN

    def swap(self) -> None:
        for ways in (self.ways, self.lines):
            for kind, way in ways.items():
                ways[kind] = way.opposite


def _learn(kinds: Sequence[str]) -> tuple[dict[str, Direction], bool]:
    """Return the directions of kinds of marks, and whether they are a guess."""
    words = {kind: frozenset(map(str.lower, WORD.findall(kind))) for kind in kinds}
    common = frozenset.intersection(*words.values()) if len(kinds) > 1 else frozenset()
    ways = {kind: way_of(kind, common) for kind in kinds}
    known = {kind: way for kind, way in ways.items() if way}
    if len(kinds) > 1 and set(known.values()) != {Direction.OUT, Direction.IN}:
        ones = _pair(kinds, words)
        named = {way if kind in (ones or ()) else way.opposite
                 for kind, way in known.items() if way is not Direction.UNKNOWN}
        is_told = any(map(way_of, kinds)) and not all(words[kind] - common for kind in kinds)
        if ones is not None and len(named) < 2 and not is_told and (
                Direction.UNKNOWN not in known.values()):
            way = named.pop() if named else Direction.OUT
            return {kind: way if kind in ones else way.opposite for kind in kinds}, not known
    return {kind: way or way_of(kind) or Direction.UNKNOWN for kind, way in ways.items()}, False


def _pair(kinds: Sequence[str], words: dict[str, frozenset[str]]) -> set[str] | None:
    """Return the kinds with the first of two words, one of which is in each kind."""
    if len(kinds) == 2:
        return {kinds[0]}
    counts = Counter(chain.from_iterable(words.values()))
    often = [word for word, count in counts.most_common(30) if count < len(kinds)]
    for one, other in combinations(often, 2):
        if all((one in words[kind]) != (other in words[kind]) for kind in kinds):
            return {kind for kind in kinds if (one in words[kind]) == (one in words[kinds[0]])}
    return None


def marks_of(pieces: Sequence[Piece]) -> Marks:
    """Return the directions that the pieces of a text have."""
    marks = Marks(has_line_times=_line_times(pieces) > 1)
    kinds = {kind_of(piece.text) for piece in pieces}
    marks.is_coarse = len(kinds) > _FEW and len(kinds) > 2 * len(
        {_NUMBERED.sub('#', kind) for kind in kinds})
    own = [kind for kind in dict.fromkeys(marks.kind(piece.text) for piece in pieces if piece.data)
           if MARK.search(kind)]
    marks.ways, marks.is_guess = _learn(own)
    if len(own) > 1 or marks.has_both:
        return marks
    marks.plain = own[0] if own and way_of(own[0]) is None else None
    groups = _texts_before(pieces, marks)
    for depth in range(_DEPTH):
        before = [*dict.fromkeys(group[depth] for group in groups if len(group) > depth)]
        lines, is_guess = _learn(before)
        if {Direction.OUT, Direction.IN} <= set(lines.values()):
            marks.lines, marks.is_guess = lines, is_guess
            return marks
    indents = list(dict.fromkeys(piece.indent for piece in pieces if piece.data))
    if len(indents) == 2 and not own:
        marks.ways = {indents[0]: Direction.OUT, indents[1]: Direction.IN}
        marks.is_indent = marks.is_guess = True
    return marks


def _texts_before(pieces: Sequence[Piece], marks: Marks) -> list[list[str]]:
    """Return for each group of bytes the kinds of the lines before it, the nearest first."""
    groups: list[list[str]] = []
    waiting: list[str] = []
    for piece in pieces:
        if not piece.data:
            kind = marks.kind(piece.text)
            if MARK.search(kind):
                waiting = [kind, *waiting[:_DEPTH - 1]]
        elif waiting:
            groups.append(waiting)
            waiting = []
    return groups


def _line_times(pieces: Sequence[Piece]) -> int:
    """Return how many groups of bytes follow a line without bytes that has a time."""
    count, has_time = 0, False
    for piece in pieces:
        if not piece.data:
            has_time |= bool(TIME_OF_DAY.search(piece.text) or SECONDS.search(piece.text))
        elif has_time:
            count, has_time = count + 1, False
    return count
