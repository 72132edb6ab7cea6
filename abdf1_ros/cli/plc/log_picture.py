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
The picture of ``plc plot``: values over time, bits and texts as lanes, gaps with their reasons.

Each pixel shows the least and the greatest value of its time, so a week makes a page of the same
size as an hour. A gap is the time from the last value before it to the first value after it.

Where the time goes back, because a clock was set or files were joined, a new run of rows begins.
Each value stands at its own time, and a time between two runs is a gap.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, tzinfo, UTC
from itertools import pairwise
import math
from typing import TypeVar

from abdf1_ros.cli.lanes import (
    Bar,
    cells,
    CurveLane,
    drawing,
    key,
    Lane,
    Look,
    NAMES,
    text_of,
    TICKS,
    WIDTH,
)
from abdf1_ros.cli.plc.log_reader import Sample, ValuePlace
from abdf1_ros.text import counted, first, value_text

MOST_DRAWN = 100  # values; each takes up to 40 kB
MOST_GAPS = 200  # in the table
_MOST_BINS = 2 * (WIDTH - NAMES)  # of one value
_FINEST = 0.001  # s; the first width of a bin
_TOGETHER = 1.0  # s; gaps that begin so close to each other are one row of the table
_IN_DRAWING = 6  # curves
_STEPS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200,
          86400, 172800, 604800)  # s; between two times on the axis
_DAY = 86400
_BETWEEN = 'between two parts of the file, where its time goes back'
_KEY = ((Look.ANSWER, 'on'), (Look.ASK, 'text'), (Look.WAIT, 'several in one pixel'),
        (Look.MISSING, 'no value'))


_State = tuple[Look | None, str]
"""What a bar shows; None for a bit that is 0."""

_Content = TypeVar('_Content')


@dataclass(slots=True)
class _Gap:
    """
    A time without a value (s since 1970), or several that are close together.

    ``noted``: when the reason came.
    """

    start: float
    end: float
    reason: str
    noted: float


@dataclass(slots=True)
class _Course:
    """
    One value over time.

    - ``bins``: first, least, greatest and last number by the number of the bin; or the text,
      empty if there were several.
    - ``since``: the time of the last row with a value, or of the first without.
    - ``reason``: why there is no value since ``noted``, empty if there is one.
    - ``latest``: the value at the latest time, ``latest_at``; ``before``: the value of the last
      row.
    - ``begun``: the begin of this run of rows; ``runs``: begin and end of the runs before.
    """

    bins: dict[int, list[float]] = field(default_factory=dict)
    texts: dict[int, str] = field(default_factory=dict)
    gaps: list[_Gap] = field(default_factory=list)
    count: int = 0
    changes: int = 0
    latest: float | str | None = None
    latest_at: float = -math.inf
    before: float | str | None = None
    low: float = math.inf
    high: float = -math.inf
    is_bit: bool = True
    since: float | None = None
    reason: str = ''
    noted: float = 0.0
    gap_count: int = 0
    missing: float = 0.0
    begun: float | None = None
    runs: list[tuple[float, float]] = field(default_factory=list)

    def take(self, number: int, value: float | str, now: float) -> None:
        """Take a value of a bin."""
        self.count += 1
        self.changes += self.before is not None and value != self.before
        self.before = value
        if now >= self.latest_at:
            self.latest, self.latest_at = value, now
        self.since = now
        self.begun = now if self.begun is None else self.begun
        if isinstance(value, str):
            self.texts[number] = value if self.texts.get(number, value) == value else ''
            return
        self.is_bit &= value in (0, 1)
        if not math.isfinite(value):
            return
        self.low, self.high = min(self.low, value), max(self.high, value)
        if found := self.bins.get(number):
            found[1:] = min(found[1], value), max(found[2], value), value
        else:
            self.bins[number] = [value] * 4

    def begin_gap(self, now: float, reason: str) -> None:
        """Take the reason of a gap, or a further reason."""
        self.since = now if self.since is None else self.since
        self.begun = self.since if self.begun is None else self.begun
        if not self.reason:
            self.reason, self.noted = reason, now

    def end_gap(self, now: float) -> None:
        """End a gap, if there is one."""
        if self.reason and self.since is not None:
            self._add_gap(_Gap(self.since, now, self.reason, self.noted))
        self.reason = ''

    def _add_gap(self, gap: _Gap) -> None:
        self.gaps.append(gap)
        self.gap_count += 1
        self.missing += gap.end - gap.start

    def goes_back(self, now: float) -> bool:
        """Return True, and end the run of rows, if ``now`` is before its last row."""
        if self.since is None or self.begun is None:
            return False
        end = max(self.since, self.noted) if self.reason else self.since
        if now >= end:
            return False
        if end > self.since:
            self.end_gap(end)
        self.runs = _joined([*self.runs, (self.begun, end)])
        self.since = self.begun = self.before = None
        self.reason = ''
        return True

    def end(self, now: float) -> None:
        """End the last run at the last row of the file, and find the gaps between the runs."""
        if not self.goes_back(now):
            self.end_gap(now)
        last = [] if self.begun is None or self.since is None else [(self.begun, self.since)]
        for (_, start), (end, _) in pairwise(_joined([*self.runs, *last])):
            self._add_gap(_Gap(start, end, _BETWEEN, start))
        self.gaps.sort(key=lambda gap: gap.start)

    def join_bins(self) -> None:
        """Make one bin of two."""
        bins, texts = self.bins, self.texts
        self.bins, self.texts = {}, {}
        for number in sorted(bins):
            before, now = self.bins.get(number // 2), bins[number]
            self.bins[number // 2] = now if before is None else [
                before[0], min(before[1], now[1]), max(before[2], now[2]), now[3]]
        for number in sorted(texts):
            text = texts[number]
            self.texts[number // 2] = text if self.texts.get(number // 2, text) == text else ''

    def join_gaps(self, width: float) -> None:
        """Make one gap of those that begin in the same bin."""
        self.gaps.sort(key=lambda gap: gap.start)
        kept = self.gaps[:1]
        for gap in self.gaps[1:]:
            if gap.start // width == kept[-1].start // width:
                kept[-1].end = max(kept[-1].end, gap.end)
            else:
                kept.append(gap)
        self.gaps = kept


class ValuePicture:
    """
    Collect the rows of a file, then yield the parts of the page.

    Rows come in the order of their times; ``remark`` tells where they do not.
    """

    def __init__(self, wanted: Sequence[str] = ()) -> None:
        """Make a picture of the ``wanted`` tags and addresses; of all without any."""
        self._wanted = {name.casefold() for name in wanted}
        self.unknown = {*self._wanted}
        self._courses: dict[ValuePlace, _Course] = {}
        self._left_out: dict[ValuePlace, None] = {}
        self._width = _FINEST
        self._begin, self._end = math.inf, -math.inf
        self._now = -math.inf  # of the last row in the file
        self._zone: tzinfo = UTC
        self.rows = 0
        self.remark = ''

    def add(self, sample: Sample) -> None:
        """Take a row."""
        now = sample.when.timestamp()
        if not self.rows:
            self._zone = sample.when.tzinfo or UTC
        self.rows += 1
        if not self._begin <= now <= self._end:
            self._reach(now)
        if sample.place is None:
            for course in self._courses.values():
                if not self._goes_back(course, now):
                    course.begin_gap(now, sample.reason)
        elif found := self._course(sample.place):
            self._take(found, now, sample)
        self._now = now

    def _goes_back(self, course: _Course, now: float) -> bool:
        if not course.goes_back(now):
            return False
        self.remark = self.remark or (
            f'the time goes back from {self._clock(self._now)} to {self._clock(now)}: a clock was '
            'set, or files were joined in another order; each value stands at its own time')
        return True

    def _take(self, course: _Course, now: float, sample: Sample) -> None:
        self._goes_back(course, now)
        if sample.value is None:
            course.begin_gap(now, sample.reason)
            return
        course.end_gap(now)
        course.take(int(now // self._width), sample.value, now)
        if len(course.gaps) > 2 * _MOST_BINS:
            course.join_gaps(self._width)

    @property
    def names(self) -> list[str]:
        """Return the names of all values in the file, each once."""
        return [*dict.fromkeys(place.name for place in (*self._courses, *self._left_out))]

    def _course(self, place: ValuePlace) -> _Course | None:
        """Return the course of a place, None if it is not drawn."""
        if place in self._left_out:
            return None
        course = self._courses.get(place)
        if course is None:
            if not self._is_wanted(place) or len(self._courses) == MOST_DRAWN:
                self._left_out[place] = None
                return None
            course = self._courses[place] = _Course()
        return course

    def _is_wanted(self, place: ValuePlace) -> bool:
        names = {place.address.casefold(), place.tag.casefold(),
                 place.tag.casefold().partition('[')[0]}
        self.unknown -= names
        return not self._wanted or not self._wanted.isdisjoint(names)

    def _reach(self, now: float) -> None:
        """Make the bins wide enough for a time outside of the picture."""
        self._begin, self._end = min(self._begin, now), max(self._end, now)
        while self._end - self._begin > _MOST_BINS * self._width:
            self._width *= 2
            for course in self._courses.values():
                course.join_bins()

    def parts(self) -> Iterator[str]:
        """Yield the parts of the page."""
        for course in self._courses.values():
            course.end(self._now)
            if len(course.gaps) > _MOST_BINS:
                course.join_gaps(self._width)
        groups = [*self._groups()]
        are_joined = any(len(course.gaps) < course.gap_count for course in self._courses.values())
        longest = max((gap.end - gap.start for course in self._courses.values()
                       for gap in course.gaps), default=0.0)
        found = ('at least ' if are_joined else '') + counted(len(groups), 'gap')
        verdict = f'{found}, the longest {_lasted(longest)}' if groups else 'no gap'
        yield f'<p class="verdict {"is-odd" if groups else "is-good"}">{verdict}</p>'
        yield (f'<p>{self._clock(self._begin)} to {self._clock(self._end)} '
               f'({self._zone_name()}), {counted(self.rows, "row")}</p>')
        if self.remark:
            yield f'<p class="is-odd">{text_of(self.remark)}</p>'
        if self._left_out and not self._wanted:
            yield (f'<p class="is-odd">and {counted(len(self._left_out), "value")} more: name '
                   'those to draw after the file</p>')
        yield from self.drawings()
        if groups:
            yield '<h2>Gaps</h2>'
            yield cells(('from', 'lasted', 'station', 'values', 'reason'), groups[:MOST_GAPS],
                        right=(1, 2))
            if len(groups) > MOST_GAPS:
                yield '<p>and more</p>'
        yield '<h2>In figures</h2>'
        yield self._table()

    def drawings(self, head: str = 'h2') -> Iterator[str]:
        """Yield the lanes and curves of each station, below a ``head``."""
        yield key(_KEY)
        stations: defaultdict[str, list[tuple[ValuePlace, _Course]]] = defaultdict(list)
        for place, course in self._courses.items():
            stations[place.station].append((place, course))
        for station, courses in stations.items():
            yield f'<{head}>{f"Station {text_of(station)}" if station else "Values"}</{head}>'
            yield from self._drawings(courses)

    def _drawings(self, found: Sequence[tuple[ValuePlace, _Course]]) -> Iterator[str]:
        lanes = [Lane(place.name, [*self._bars(place, course)]) for place, course in found
                 if not _is_curve(course)]
        curves = [self._curve(place, course) for place, course in found if _is_curve(course)]
        groups: list[Sequence[Lane | CurveLane]] = [lanes]
        groups += (curves[at:at + _IN_DRAWING] for at in range(0, len(curves), _IN_DRAWING))
        for group in groups:
            if group:
                yield drawing(group, self._begin, self._end, self._zone_name(),
                              ticks=[*self._ticks()])

    def _curve(self, place: ValuePlace, course: _Course) -> CurveLane:
        pieces = [[(self._place(number), values) for number, values in piece]
                  for piece in self._pieces(course, course.bins)]
        limits = value_text(course.low), value_text(course.high)
        return CurveLane(
            place.name, f'{_told(place)}: {" to ".join(limits)}', pieces, course.low, course.high,
            limits, [*map(self._missing, course.gaps)])

    def _bars(self, place: ValuePlace, course: _Course) -> Iterator[Bar]:
        """Yield the bars of bits or texts, and of gaps."""
        states: dict[int, _State] = {}
        for number, (_, low, high, _) in course.bins.items():
            states[number] = (Look.WAIT, '') if low != high else \
                (Look.ANSWER if low else None, value_text(low))
        for number, said in course.texts.items():
            states[number] = (Look.ASK if said else Look.WAIT, said)
        for piece in self._pieces(course, states):
            for (look, text), start, end in _runs(piece):
                if look is not None:
                    begin, until = self._place(start), self._place(end)
                    yield Bar(begin, until, look, f'{_told(place)}, {self._clock(begin)} to '
                              f'{self._clock(until)}: {text or "several values"}', (text,))
        yield from map(self._missing, course.gaps)

    def _missing(self, gap: _Gap) -> Bar:
        return Bar(gap.start, gap.end, Look.MISSING, f'{self._clock(gap.start)}, no value for '
                   f'{_lasted(gap.end - gap.start)}: {gap.reason}')

    def _pieces(self, course: _Course,
                bins: Mapping[int, _Content]) -> Iterator[list[tuple[int, _Content]]]:
        """Yield the bins, in order, without a gap between them."""
        breaks = sorted({int(gap.start // self._width) for gap in course.gaps
                         if gap.end // self._width > gap.start // self._width})
        piece: list[tuple[int, _Content]] = []
        for number in sorted(bins):
            while breaks and breaks[0] < number:
                if piece and breaks[0] >= piece[-1][0]:
                    yield piece
                    piece = []
                del breaks[0]
            piece.append((number, bins[number]))
        if piece:
            yield piece

    def _place(self, number: int) -> float:
        """Return the middle of a bin."""
        return min(max((number + 0.5) * self._width, self._begin), self._end)

    def _groups(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows of the table of gaps; gaps of one cause have one row."""
        gaps = sorted(((gap, place) for place, course in self._courses.items()
                       for gap in course.gaps), key=lambda pair: pair[0].noted)
        groups: list[list[tuple[_Gap, ValuePlace]]] = []
        latest: dict[str, list[tuple[_Gap, ValuePlace]]] = {}
        for gap, place in gaps:
            group = latest.get(gap.reason)
            if group is None or gap.noted - group[0][0].noted > _TOGETHER:
                group = latest[gap.reason] = []
                groups.append(group)
            group.append((gap, place))
        for group in groups:
            start = max(gap.start for gap, _ in group)  # others may have a longer Period
            lasted = max(gap.end for gap, _ in group) - start
            stations = dict.fromkeys(place.station for _, place in group)
            yield (self._clock(start), _lasted(lasted), text_of(', '.join(stations)),
                   text_of(first([place.name for _, place in group], 4)),
                   text_of(group[0][0].reason))

    def _table(self) -> str:
        head = ('station', 'address', 'tag', 'reads', 'least', 'greatest', 'last', 'changes',
                'gaps', 'without a value')
        rows = []
        for place, course in self._courses.items():
            limits = [value_text(limit) if math.isfinite(limit) else ''
                      for limit in (course.low, course.high)]
            last = '' if course.latest is None else course.latest \
                if isinstance(course.latest, str) else value_text(course.latest)
            row = (*place, str(course.count), *limits, last, str(course.changes),
                   str(course.gap_count), _lasted(course.missing) if course.gap_count else '')
            rows.append([*map(text_of, row)])
        return cells(head, rows, right=(0, 3, 4, 5, 6, 7, 8, 9))

    def _ticks(self) -> Iterator[tuple[float, str]]:
        """Yield times of day for the axis; the first of a day has its date."""
        step = next((step for step in _STEPS if step * TICKS >= self._end - self._begin),
                    _STEPS[-1])
        offset = (datetime.fromtimestamp(self._begin, self._zone).utcoffset()
                  or timedelta()).total_seconds()
        day = math.floor((self._begin + offset) / _DAY)
        for number in range(math.ceil((self._begin + offset) / step),
                            math.floor((self._end + offset) / step) + 1):
            at = number * step - offset
            form = '%m-%d %H:%M' if number * step // _DAY > day else '%H:%M' if step >= 60 else \
                '%H:%M:%S'
            day = max(day, number * step // _DAY)
            yield at, datetime.fromtimestamp(at, self._zone).strftime(form)

    def _clock(self, at: float) -> str:
        return datetime.fromtimestamp(at, self._zone).strftime('%Y-%m-%d %H:%M:%S')

    def _zone_name(self) -> str:
        return str(self._zone)


def _joined(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return begins and ends in their order, one for those that overlap."""
    kept: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if kept and begin <= kept[-1][1]:
            kept[-1] = kept[-1][0], max(kept[-1][1], end)
        else:
            kept.append((begin, end))
    return kept


def _is_curve(course: _Course) -> bool:
    return bool(course.bins) and not course.is_bit and not course.texts


def _runs(piece: Sequence[tuple[int, _State]]) -> Iterator[tuple[_State, int, int]]:
    """Yield each state with its first bin, and the bin of the next state."""
    begun, state = piece[0]
    for (_, before), (number, now) in pairwise(piece):
        if now != before:
            yield state, begun, number
            begun, state = number, now
    yield state, begun, piece[-1][0]


def _told(place: ValuePlace) -> str:
    return ' '.join(filter(None, (place.tag, place.address)))


def _lasted(seconds: float) -> str:
    return f'{seconds:.1f} s' if seconds < 60 else str(timedelta(seconds=round(seconds)))
