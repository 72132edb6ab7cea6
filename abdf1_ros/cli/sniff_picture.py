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
The picture of ``sniff --html``: a recorded line as a timeline.

First comes an overview with a lane for each station. It links to the strips below, each of some
seconds. In a long recording, strips without a fault are only counted.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
import math

from abdf1_ros.cli.lanes import Bar, cells, drawing, key, Lane, Look, text_of, write_page
from abdf1_ros.cli.sniff_curves import HeardCurves
from abdf1_ros.cli.sniff_report import without_data
from abdf1_ros.df1.listener import LineKind
from abdf1_ros.pccc.describe import command_name
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.report import summary_lines, words
from abdf1_ros.sniffer.summary import BITS_PER_CHARACTER, Summary
from abdf1_ros.text import counted

MOST_DRAWN = 20_000  # entries; then up to the same number again, only in strips with faults
MOST_EPISODES = 200  # shown in the table
_PAUSE = 5.0  # s; after a longer pause the same fault starts a new episode
_MOST_LANES = 40
_BUCKETS = 260  # most moments in the overview
_FINE = 64  # moments of a strip, at first
_INSIDE = 1e-9  # the end of a time belongs to the next one
_STEPS = 0.1, 0.2, 0.5  # of the time; what the full height of a lane may mean
_TALL = 44  # pixels; a lane of the overview
_LEAST_SHARE, _LEAST_FAULT = 0.02, 0.1  # of the height of a lane, so that it can be seen
_CHARACTERS = 2000  # length of a strip of a recording without times

_KEY = ((Look.ASK, 'command'), (Look.ANSWER, 'reply'), (Look.SMALL, 'poll, ACK, EOT'),
        (Look.ODD, 'repeated, NAK, ENQ'), (Look.BAD, 'damaged, or an error'),
        (Look.MISSING, 'no answer'))
_LOOKS = {Kind.COMMAND: Look.ASK, Kind.REPLY: Look.ANSWER, Kind.NAK: Look.ODD, Kind.ENQ: Look.ODD,
          Kind.DAMAGED: Look.BAD, Kind.UNKNOWN: Look.BAD, Kind.NOISE: Look.BAD,
          Kind.SILENCE: Look.MISSING, Kind.UNANSWERED: Look.MISSING}
_ASKING = (Kind.COMMAND, Kind.POLL, Kind.ENQ)
_USUAL = {Mark.RELAYED, Mark.FORWARDED}  # normal for a master or a modem
_RANKS = [Look.SMALL, Look.ASK, Look.ANSWER, Look.ODD, Look.MISSING, Look.BAD]
_FAULTS = (Look.ODD, Look.MISSING, Look.BAD)


@dataclass(slots=True)
class _Strip:
    """The contents of one strip, by station."""

    number: int
    bars: defaultdict[int | None, list[Bar]] = field(default_factory=lambda: defaultdict(list))


@dataclass(slots=True)
class _Episode:
    """
    A repeated fault; ``words`` describe the first, ``start`` and ``end`` are links.

    ``latest``: place of the last fault, in the unit of the recording.
    """

    station: str
    words: str
    start: str
    clock: str
    latest: float
    end: str = ''
    count: int = 1

    def cells(self) -> tuple[str, ...]:
        """Return the row of the fault for the table."""
        return self.start, self.end, self.clock, self.station, str(self.count), self.words


@dataclass(slots=True)
class _Moment:
    """The looks of a station in a part of the time: how many, and how long."""

    seen: Counter[Look] = field(default_factory=Counter)
    spent: defaultdict[Look, float] = field(default_factory=lambda: defaultdict(float))


@dataclass(slots=True)
class _Drawing:
    """
    The drawing of one recording, whose times increase.

    - ``length``: length of a strip, in ``unit``.
    - ``ends``: the time until which each row of a lane is in use.
    - ``ranks``: the worst look of each strip, by station.
    - ``moments``: what each station does in each part of the time, of equal ``width``.
    - ``strips``: drawings by number; None if not drawn.
    """

    number: int
    length: float
    unit: str = 's'
    begun: datetime | None = None
    ends: defaultdict[tuple[int | None, int], float] = field(
        default_factory=lambda: defaultdict(float))
    ranks: dict[tuple[int | None, int], int] = field(default_factory=dict)
    moments: defaultdict[tuple[int | None, int], _Moment] = field(
        default_factory=lambda: defaultdict(_Moment))
    width: float = 0.0
    least: float = math.inf
    most: float = -math.inf
    strips: dict[int, str | None] = field(default_factory=dict)

    def note(self, station: int | None, look: Look, begin: float, end: float) -> None:
        """Record a symbol in the moments in which it was on the line."""
        key = station, int(max(begin, end - _INSIDE) // self.length)
        self.ranks[key] = max(self.ranks.get(key, 0), _RANKS.index(look))
        self.width = self.width or self.length / _FINE
        self.least, self.most = min(self.least, begin), max(self.most, end)
        while self.most // self.width - self.least // self.width >= _BUCKETS:
            self._join()
        self.moments[station, int(begin // self.width)].seen[look] += 1
        for number in range(int(begin // self.width), int(end // self.width) + 1):
            left, right = number * self.width, (number + 1) * self.width
            self.moments[station, number].spent[look] += max(min(right, end) - max(left, begin), 0)

    def _join(self) -> None:
        """Make one moment of two."""
        moments, self.width = self.moments, 2 * self.width
        self.moments = defaultdict(_Moment)
        for (station, number), moment in moments.items():
            joined = self.moments[station, number // 2]
            joined.seen.update(moment.seen)
            for look, seconds in moment.spent.items():
                joined.spent[look] += seconds

    def clock(self, place: float) -> str:
        """Return the time of day; empty if unknown."""
        if self.begun is None or self.unit != 's':
            return ''
        try:
            return (self.begun + timedelta(seconds=place)).strftime('%H:%M:%S')
        except OverflowError:  # beyond the years that a date can have
            return ''

    @property
    def of(self) -> str:
        """Return what a share is a share of."""
        return 'time' if self.unit == 's' else 'bytes'

    def name(self, strip: int) -> str:
        """Return the target of links to a strip."""
        return f'r{self.number}s{strip}'


class Timeline:
    """Collect decoded entries, then write the page; ``is_anonymous`` leaves names, values out."""

    def __init__(self, title: str, is_anonymous: bool = False,
                 curves: Sequence[str] = ()) -> None:
        """Begin a page, with the curves of some addresses."""
        self._title = 'A recorded DF1 line' if is_anonymous else title
        self._is_anonymous = is_anonymous
        self._recordings: list[_Drawing] = []
        self._episodes: list[_Episode] = []
        self._latest: dict[tuple[object, ...], _Episode] = {}
        self._count = self._drawn = self._characters = 0
        self._last: float | None = None  # None in a recording without times
        self._character = 0.0
        self._strip: _Strip | None = None
        self._curves = HeardCurves(curves) if curves else None

    def take(self, chunk: Chunk, baud: int | None, begun: str) -> None:
        """
        Record a chunk's time before its entries.

        A new recording starts if times go back, or if chunks begin or cease to have times.
        """
        time, last, self._last = chunk.time, self._last, chunk.time
        goes_on = time == last if time is None or last is None else time >= last
        if not self._recordings or not goes_on:
            self._close()
            length = min(16.0, max(0.5, 19200 / baud)) if baud else 1.0
            length, unit = (_CHARACTERS, 'bytes') if time is None else (length, 's')
            self._recordings.append(_Drawing(len(self._recordings) + 1, length, unit))
            self._characters = 0
        recording = self._recordings[-1]
        recording.begun = recording.begun or _moment(begun)
        self._character = BITS_PER_CHARACTER / baud if baud else 0.0

    def add(self, entry: Entry) -> None:
        """Draw an entry."""
        recording = self._recordings[-1]
        if self._curves:
            self._curves.add(entry, recording.begun)
        if self._last is None:
            place = begin = float(self._characters)
            self._characters += len(entry.wire)
            end = float(self._characters)
        else:
            # the entry may be of the recording before this one
            place = self._last if entry.time is None else min(entry.time, self._last)
            size = len(entry.wire) * self._character
            begin, end = (place, place + size) if entry.direction is Direction.OUT \
                else (place - size, place)
        number = int(place // recording.length)
        if self._strip is None or number > self._strip.number:
            self._close()
            self._strip = _Strip(number)
        self._draw(entry, self._strip, begin, end)

    def _draw(self, entry: Entry, strip: _Strip, begin: float, end: float) -> None:
        recording, look = self._recordings[-1], _look(entry)
        station, row = entry.station, _row(entry)
        start, ends = strip.number * recording.length, recording.ends
        if entry.kind is Kind.SILENCE:
            begin = min(ends[station, 0], end)
        else:  # several symbols in one chunk have the same time
            at = max(begin, ends[station, row], start)
            begin, end = at, at + end - begin
            ends[station, row] = end
        title = _told(entry.kind, self._words(entry))
        if entry.time is not None:
            title = f'{entry.time:.6f} {title}'
        strip.bars[station].append(Bar(max(begin, start), end, look, title, row=row))
        recording.note(station, look, max(begin, end - recording.length), end)
        if look in _FAULTS:
            self._note_fault(entry, recording, strip.number, begin)

    def _note_fault(self, entry: Entry, recording: _Drawing, strip: int, place: float) -> None:
        self._count += 1
        what = recording.number, entry.station, entry.kind, entry.marks
        time = f'{place:.3f} s' if recording.unit == 's' else f'byte {place:.0f}'
        link = f'<a href="#{recording.name(strip)}">{time}</a>'
        known = self._latest.get(what)
        if known and (recording.unit != 's' or place - known.latest <= _PAUSE):
            known.latest, known.end, known.count = place, link, known.count + 1
            return
        station = '' if entry.station is None else str(entry.station)
        told = _told(entry.kind, self._words(entry))
        episode = self._latest[what] = _Episode(
            station, text_of(told), link, recording.clock(place), place)
        if len(self._episodes) <= MOST_EPISODES:  # one more than we show
            self._episodes.append(episode)

    def _words(self, entry: Entry) -> str:
        if self._is_anonymous:
            packet = entry.packet
            known = command_name(packet) if packet and entry.kind is Kind.COMMAND else \
                f'STS {packet.sts:02X}' if packet and packet.sts else ''
            entry = replace(without_data(entry), text=known)
        return words(entry)

    def _close(self) -> None:
        """Draw a strip that is complete."""
        strip, self._strip = self._strip, None
        if strip is None:
            return
        recording = self._recordings[-1]
        bars = [bar for found in strip.bars.values() for bar in found]
        most = MOST_DRAWN * (1 + any(bar.look in _FAULTS for bar in bars))
        if self._drawn >= most:
            recording.strips[strip.number] = None
            return
        self._drawn += len(bars)
        lanes = [Lane(_name(station), strip.bars[station], 2)
                 for station in _in_order(strip.bars)]
        start = strip.number * recording.length
        recording.strips[strip.number] = drawing(
            lanes, start, start + recording.length, recording.clock(start) or recording.unit,
            name=recording.name(strip.number))

    @property
    def remarks(self) -> list[str]:
        """Return what the page cannot show."""
        return self._curves.remarks if self._curves else []

    def write(self, path: str, summary: Summary, kind: LineKind) -> None:
        """Write the page; raises OSError."""
        self._close()
        write_page(path, self._title, self._page(summary, kind))

    def _page(self, summary: Summary, kind: LineKind) -> Iterator[str]:
        verdict = f'{counted(self._count, "fault")} on the line' if self._count else 'no fault'
        yield f'<p class="verdict {"is-bad" if self._count else "is-good"}">{verdict}</p>'
        for recording in self._recordings:
            if recording.moments:
                yield from _overview(recording)
        if self._curves:
            yield from self._curves.parts()
        if self._episodes:
            yield '<h2>Faults</h2>'
            rows = (episode.cells() for episode in self._episodes[:MOST_EPISODES])
            yield cells(('from', 'to', 'clock', 'station', 'times', 'the first of them'), rows,
                        right=(0, 1, 3, 4))
            if len(self._episodes) > MOST_EPISODES:
                yield '<p>and more</p>'
        yield '<h2>In figures</h2>'
        told = '\n'.join(map(text_of, summary_lines(summary, kind)))
        yield f'<pre>{told}</pre>'
        for recording in self._recordings:
            yield from _strips(recording)


def _overview(recording: _Drawing) -> Iterator[str]:
    """Yield the whole recording as one drawing: the share of each station in the time."""
    stations = _in_order({station for station, _ in recording.moments})
    numbers = [number for _, number in recording.moments]
    full = _full(recording)
    lanes = [Lane(_name(station), [
        bar for (other, number), moment in recording.moments.items() if other == station
        for bar in _bars(recording, station, number, moment, full)],
        most=f'{full:.0%}' if full else '', tall=_TALL)
        for station in stations[:_MOST_LANES]]
    yield f'<h2>{f"Recording {recording.number}" if recording.number > 1 else "All of it"}</h2>'
    yield key(_KEY)
    told = f'The height of a lane is {full:.0%} of the {recording.of}. Faults are drawn higher, ' \
        'so that they are seen.' if full else \
        'The speed is not known: --baud shows how much of the time the messages take.'
    yield f'<p class="quiet">{told}</p>'
    start, end = min(numbers) * recording.width, (max(numbers) + 1) * recording.width
    yield drawing(lanes, start, end, recording.clock(start) or recording.unit)
    if (more := len(stations) - _MOST_LANES) > 0:
        yield f'<p>and {counted(more, "station")} more</p>'


def _full(recording: _Drawing) -> float:
    """Return the share that the full height of a lane means; 0 if the speed is not known."""
    most = max(sum(moment.spent.values()) for moment in recording.moments.values())
    return next((step for step in _STEPS if most <= step * recording.width), 1.0) if most else 0.0


def _bars(recording: _Drawing, station: int | None, number: int, moment: _Moment,
          full: float) -> Iterator[Bar]:
    """
    Yield the shares of a moment of a station, with a link to its worst strip.

    ``full`` is the share of the full height, 0 if shares are not known.
    """
    start, end = number * recording.width, (number + 1) * recording.width
    strips = [strip for strip in range(int(start // recording.length),
                                       int((end - _INSIDE) // recording.length) + 1)
              if (station, strip) in recording.ranks]
    worst = max(strips, key=lambda strip: recording.ranks[station, strip], default=0)
    link = recording.name(worst) if recording.strips.get(worst) else ''
    looks = [look for look in _RANKS if moment.seen[look] or moment.spent[look]]
    faults = sum(moment.seen[look] for look in _FAULTS)
    share = f', {min(sum(moment.spent.values()) / recording.width, 1):.0%} of the ' \
        f'{recording.of}' if full else ''
    title = (f'{_name(station)}, {start:.6g} to {end:.6g} {recording.unit} '
             f'{recording.clock(start)}: {moment.seen.total()} seen, '
             f'{counted(faults, "fault")}{share}')
    if not full:
        yield Bar(start, end, looks[-1], title, link=link)
        return
    low = 0.0
    for look in looks:
        least = _LEAST_FAULT if look in _FAULTS else _LEAST_SHARE
        high = min(low + max(moment.spent[look] / recording.width / full, least), 1.0)
        yield Bar(start, end, look, title, link=link, low=min(low, high - least), high=high)
        low = high


def _strips(recording: _Drawing) -> Iterator[str]:
    yield '<h2>Every message</h2>'
    yield key(_KEY)
    yield ('<p class="quiet">The upper half of a lane shows messages to the station, the lower '
           'half what it sends. The mouse shows the words.</p>')
    left_out = 0
    for drawn in recording.strips.values():
        if drawn is None:
            left_out += 1
            continue
        yield from _note(left_out)
        left_out = 0
        yield drawn
    yield from _note(left_out)


def _note(left_out: int) -> Iterator[str]:
    if left_out:
        yield f'<p class="quiet">{counted(left_out, "strip")} not drawn</p>'


def _look(entry: Entry) -> Look:
    is_error = entry.kind is Kind.REPLY and entry.packet is not None and entry.packet.sts
    if entry.valid is False or is_error:
        return Look.BAD
    look = _LOOKS.get(entry.kind, Look.SMALL)
    return Look.ODD if look in (Look.ASK, Look.ANSWER) and {*entry.marks} - _USUAL else look


def _row(entry: Entry) -> int:
    """Return 0 for messages to a station, 1 for messages from it."""
    if entry.direction is Direction.UNKNOWN:
        return int(entry.kind not in _ASKING)
    return int(entry.direction is Direction.IN)


def _told(kind: Kind, said: str) -> str:
    return f'{kind.value}: {said}' if said else kind.value


def _name(station: int | None) -> str:
    return 'line' if station is None else f'station {station}'


def _in_order(stations: Iterable[int | None]) -> list[int | None]:
    return sorted(stations, key=lambda station: -1 if station is None else station)


def _moment(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None
