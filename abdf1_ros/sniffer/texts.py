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
Read bytes from any text: one tolerant reader for dumps and for logs of other programs.

The reader tries notations and layouts on the first 64 kB of a text, and takes the one with the
largest share of good frames. Directions are learnt from the text, too: known words, or two kinds
of marks, of which one sends the commands. A line that does not fit is a Problem. A text in which
no frame is good is read all the same, as it may come from a line at a wrong speed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat
import math
import re
from string import hexdigits

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.columns import Unfit
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.layouts import (
    Choice,
    ends,
    has_numbers,
    is_cut,
    Piece,
    TextLayout,
    TextLines,
    TIME_OF_DAY,
)
from abdf1_ros.sniffer.marks import GLUED, kind_of, MARK, Marks, marks_of, TextClock, way_of, WORD
from abdf1_ros.sniffer.notations import DIGITS, HAS_NAMES, HEX, NAMES, Notation, NOTATIONS
from abdf1_ros.sniffer.packet_files import shows_packets
from abdf1_ros.sniffer.tables import tables
from abdf1_ros.sniffer.traffic import TrafficDecoder
from abdf1_ros.text import first, shown

SAMPLE = 65_536  # characters from which a text is learnt
_MOST_JUDGED = 16_384  # bytes
_ENOUGH = 0.5  # share of good bytes with which less likely notations are not tried
_SURE = 0.999
_CHANCE = 0.05  # share of good bytes that noise may have
_LATER = 50  # lines after one that does not fit, which show whether the reading is right
_MANY = 32  # bytes that prove a notation although no frame is good

_PACKETS = ('this shows whole packets with their IP headers, not the bytes of a line: record with '
            '"tshark -w" or "tcpdump -w", and give that file; text2pcap makes such a file from '
            'the text of "tshark -x"')

# A line of usbmon as text: tag, time, submission or completion, and the endpoint.
_USBMON = re.compile(r'[0-9a-f]{8,16} \d+ [SCE] [BCIZ][io]:\d+:\d+')
_USB = ('usbmon as text shows at most 32 bytes of each packet: record with "tcpdump -i usbmon1 '
        '-w" or Wireshark, and give that file')
_PUTTY = ('a log of PuTTY: its "printable output" lacks the control characters of DF1, such as '
          'DLE; let it log "all session output" and add --binary, or record with "sniff --port"')

_SHOWN = 60  # characters of a line
_HALF = re.compile(r'(?<!\w)[0-9A-Fa-f]{2}\s[0-9A-Fa-f]\Z')  # at the end of a line
_COMMENT = re.compile(r'#(?!\d)|//')
# The number of a line, as a forum or a list puts it before each.
_LINE_NUMBER = re.compile(r'\s*(\d{1,6})[.)]\s+(?=\S)')


@dataclass(slots=True)
class _TextReading:
    """One way to read a text: its layout, and its marks as far as they are learnt."""

    layout: TextLayout
    marks: Marks = field(default_factory=Marks)
    texts: frozenset[str] = frozenset()  # kinds of text after which numbers are no bytes
    kinds: frozenset[str] = frozenset()  # before bytes
    share: float = 0.0
    size: int = 0
    proof: int = 0
    hint: bool = False
    layout_words: str = ''
    remarks: list[str] = field(default_factory=list)
    clock: TextClock = field(default_factory=TextClock)

    def pieces(self, line: str) -> list[Piece]:
        """Return the pieces of a line; raise ValueError if it does not fit."""
        if not line.strip() or _COMMENT.match(line.strip()):
            return []
        pieces = self.layout.split(line)
        if self.texts and any(kind_of(piece.text) in self.texts for piece in pieces):
            return [Piece(ends(line))]
        if any(piece.before and way_of(kind_of(piece.before)) for piece in pieces):
            raise Unfit
        if GLUED.search(''.join(piece.text for piece in pieces)):
            raise Unfit
        return pieces

    def chunks(self, lines: Iterable[tuple[int, str]],
               most: float = math.inf) -> Iterator[tuple[int, Chunk]]:
        """
        Yield the chunks with the number of their line; raise _Stop with the number.

        What a dump has left out is repeated ``most`` times.
        """
        self.clock = clock = TextClock()
        way, time, number = Direction.UNKNOWN, None, 0
        for number, line in lines:
            try:
                pieces = self.pieces(line)
                if self.kinds and len(pieces) == 1 and not pieces[0].data:
                    self._check_text(pieces[0].text)
            except ValueError as error:
                raise _Stop(number, line, str(error) if isinstance(error, Unfit) else '') from None
            for piece in pieces:
                way, time, chunk = self._chunk(piece, way, time, clock)
                if chunk is not None:
                    yield from repeat((number, chunk), int(min(piece.times, most)))
        for piece in self.layout.end():
            way, time, chunk = self._chunk(piece, way, time, clock)
            if chunk is not None:
                yield number, chunk

    def _check_text(self, text: str) -> None:
        """Raise Unfit for a line with numbers that has the mark of lines with bytes."""
        kind = kind_of(text)
        if any(kind.startswith(known) and (
                self.layout.notation.is_text or '#' in kind[len(known):])
               and kind not in self.marks.lines for known in self.kinds):
            raise Unfit

    def _chunk(self, piece: Piece, way: Direction, time: float | None, clock: TextClock,
               ) -> tuple[Direction, float | None, Chunk | None]:
        """Return direction and time after a piece, and its chunk."""
        marks = self.marks
        now = clock.read(piece.text) if piece.text else None
        kind = piece.indent if marks.is_indent and piece.data else marks.kind(piece.text)
        if not piece.data:
            named = marks.of_line(kind)
            if now is not None or named is not None:
                way = named or Direction.UNKNOWN
            if now is not None:
                time = now if marks.has_line_times else None
            return way, time, None
        if marks.is_indent:
            way = marks.ways.get(kind, Direction.UNKNOWN)
        elif kind != marks.plain and MARK.search(kind):
            way = marks.of_bytes(kind)
            time = now
        elif now is not None:
            time = now
        return way, time, Chunk(time, way, piece.data)

    @property
    def score(self) -> tuple[int, float, int, bool]:
        """Return what tells readings apart; of equal ones the first is the likeliest."""
        if self.share > _CHANCE:
            return self.proof, self.share, self.size, self.marks.has_both
        return self.proof, 0.0, self.hint, False

    def describe(self) -> str:
        """Return in words how the text is read."""
        parts = [f'read as bytes in {self.layout_words}', *self.remarks]
        ways = self.marks.ways if self.marks.ways else self.marks.lines
        for way in (Direction.OUT, Direction.IN):
            names = [f'"{shown(kind)}"' if kind.strip() else
                     f'an indent of {len(kind)}' for kind, each in ways.items() if each is way]
            if names and (self.marks.is_guess or self.marks.is_indent or all(
                    way_of(kind) is not each for kind, each in ways.items())):
                parts.append(f'{way.value} is {first(names, 2)}')
        unknown = [f'"{shown(kind)}"' for kind, way in ways.items()
                   if way is Direction.UNKNOWN and WORD.search(kind)]
        if len(unknown) > 1:
            parts.append(f'the direction of {first(unknown, 3)} is not known')
        if self.share <= _CHANCE:
            parts.append('hardly a frame in its first part is good')
        return '; '.join(parts)


class TextProblem(Problem):
    """A line that does not fit: what was read before it may be wrong, too."""


class _Stop(Exception):
    """
    The number and the text of a line that does not fit, and the reason if there is one.

    ``others``: how many other lines are read as bytes. A reading that reads many of them knows
    best which line is wrong.
    """

    def __init__(self, number: int, line: str, reason: str = '', others: int = 0) -> None:
        super().__init__(number, line, reason)
        self.number, self.line, self.reason, self.others = number, line, reason, others

    @property
    def rank(self) -> tuple[bool, int, int]:
        """Return what tells the likeliest of several stops; the greatest counts."""
        return self.reason != '', self.others, self.number

    def problem(self, name: str) -> TextProblem:
        if self.reason:
            text = self.reason
        elif is_cut(self.line):
            text = 'the bytes are cut here; let the program that wrote this show whole lines'
        else:
            line = self.line.strip()
            line = line if len(line) <= _SHOWN else f'{line[:_SHOWN - 25]} ... {line[-20:]}'
            right = 'its last byte has one digit; leave it out, or write 04 for 4' \
                if _HALF.search(line) else (
                    'write bytes as in 10 05 01 FF, after a direction such as TX or RX, or give '
                    '--binary for a file of raw bytes')
            text = f'"{line}" does not fit: {right}'
        return TextProblem(f'{name}:{self.number}', text)


class TextReader:
    """
    Read a text; ``told`` says how, as soon as the first chunk has come.

    ``begun`` is then the first time of the text in seconds, None without times.
    ``chunks`` raises Problem, with the line, if a line does not fit, and if a text that is not
    empty has no bytes.
    """

    def __init__(self, name: str) -> None:
        self.told = ''
        self.begun: float | None = None
        self._name = name

    def chunks(self, lines: Iterator[str]) -> Iterator[Chunk]:
        """Yield the chunks of a text."""
        sample: list[tuple[int, str]] = []
        size = 0
        for number, line in enumerate(lines, 1):
            sample.append((number, line))
            size += len(line)
            if size > SAMPLE:
                break
        if not any(line.strip() for _, line in sample):
            return
        if _is_numbered(line for _, line in sample):
            sample = [(number, _LINE_NUMBER.sub('', line, count=1)) for number, line in sample]
            lines = (_LINE_NUMBER.sub('', line, count=1) for line in lines)
        if reason := _refused([line for _, line in sample]):
            raise TextProblem(self._name, reason)
        try:
            best = _best([(number, _begin(line)) for number, line in sample])
        except _Stop as stop:
            cut = next((_Stop(*pair) for pair in sample if is_cut(pair[1])), stop)
            raise cut.problem(self._name) from None
        if best is None:
            raise TextProblem(f'{self._name}:1', (
                'no line has bytes; write them as in 10 05 01 FF, or for a file of raw bytes give '
                '--binary'))
        self.told = best.describe()
        rest = ((number, line) for number, line in enumerate(lines, len(sample) + 1))
        try:
            for _, chunk in best.chunks(chain(sample, rest)):
                if self.begun is None:
                    self.begun = best.clock.begun
                yield chunk
        except _Stop as stop:
            raise stop.problem(self._name) from None


def _refused(lines: Sequence[str]) -> str:
    """Return why a text of a known program lacks bytes of the line; empty for any other text."""
    if any(map(_USBMON.match, lines)):
        return _USB
    if lines[0].startswith('=~=') and 'PuTTY log' in lines[0]:
        return _PUTTY
    return _PACKETS if shows_packets(lines) else ''


def _is_numbered(lines: Iterable[str]) -> bool:
    """Return True if lines have numbers that count up by one."""
    numbers = [int(found[1]) for found in map(_LINE_NUMBER.match, lines) if found]
    return len(numbers) > 2 and numbers == [*range(numbers[0], numbers[0] + len(numbers))]


def _begin(line: str) -> str:
    """Return the begin of a very long line, up to whole bytes."""
    if len(line) <= SAMPLE:
        return line
    line = line[:SAMPLE]
    digits = len(line) - len(line.rstrip(hexdigits))
    return line[:len(line) - digits % 2] if digits > _MANY else line[:len(line) - digits]


def _best(sample: Sequence[tuple[int, str]]) -> _TextReading | None:
    """Return the best reading of a text; raise _Stop at the line where the last one failed."""
    best: _TextReading | None = None
    stop: _Stop | None = None
    for group in NOTATIONS:
        has_pairs = best is not None and best.layout.notation in NOTATIONS[0]
        for layout in chain.from_iterable(_layouts(notation, sample) for notation in group
                                          if notation is not DIGITS or not has_pairs):
            try:
                for reading in _tried(layout, sample):
                    if best is None or reading.score > best.score:
                        best = reading
            except _Stop as failed:
                if stop is None or failed.rank > stop.rank:
                    stop = failed
            if best is not None and best.share > _SURE and best.marks.has_both:
                return best
        if best is not None and best.share > _ENOUGH:
            break
    if best is None and stop is not None:
        raise stop
    return best


def _layouts(notation: Notation, sample: Sequence[tuple[int, str]]) -> Iterator[TextLayout]:
    lines = [line for _, line in sample if line.strip()]
    if notation.is_text:
        yield TextLines(notation, Choice.LAST)
        return
    if notation is NAMES and not any(HAS_NAMES.search(line) for line in lines):
        return
    for choice in (Choice.BESIDE, Choice.LAST):
        plain, led = TextLines(notation, choice), TextLines(notation, choice, has_lead=True)
        yield plain
        yield led
        if choice is Choice.BESIDE and (plain.is_fit or led.is_fit):
            return  # their characters prove the bytes
    if notation.is_words:
        return
    if plain.has_others:
        yield TextLines(notation, Choice.LONGEST)
        yield TextLines(notation, Choice.ALL)
    if notation is HEX and any(TIME_OF_DAY.search(line) for line in lines):
        yield TextLines(notation, Choice.LAST, has_times=False)
    yield from tables(notation, lines)


def _tried(layout: TextLayout, sample: Sequence[tuple[int, str]]) -> Iterator[_TextReading]:
    """Yield the readings of a sample with a layout, judged; raise _Stop if it does not fit."""
    trial = _TextReading(layout)
    said: list[tuple[int, list[Piece]]] = []
    for at, (number, line) in enumerate(sample):
        try:
            said.append((number, trial.pieces(line)))
        except ValueError as error:
            later = sum(_has_bytes(trial, line) for _, line in sample[at + 1:at + _LATER])
            raise _Stop(number, line, str(error) if isinstance(error, Unfit) else '',
                        _with_bytes(said) + later) from None
    learnt = layout.again()
    if learnt is None or not any(piece.data for _, pieces in said for piece in pieces):
        return
    stop: _Stop | None = None
    for texts in _texts(said):
        try:
            reading = _judged(layout, said, sample, texts)
        except _Stop as failed:
            stop = failed
            stop.others = _with_bytes(said)
        else:
            if reading is not None:
                layout.is_fit = True
                yield reading
    if stop is not None:
        raise stop


def _has_bytes(reading: _TextReading, line: str) -> bool:
    try:
        return any(piece.data for piece in reading.pieces(line))
    except ValueError:
        return False


def _with_bytes(said: Sequence[tuple[int, list[Piece]]]) -> int:
    return sum(any(piece.data for piece in each) for _, each in said)


def _texts(said: Sequence[tuple[int, list[Piece]]]) -> Iterator[frozenset[str]]:
    """Yield the kinds of lines with a number at their end that may be text."""
    pieces = [piece for _, each in said for piece in each
              if piece.data and WORD.search(piece.text)]
    counts = Counter(kind_of(piece.text) for piece in pieces)
    long = {kind_of(piece.text) for piece in pieces if len(piece.data) > 4}
    rare = frozenset(kind for kind, count in counts.items() if count == 1)
    short = frozenset(counts) - long
    known = {kind for kind in counts if way_of(kind)}
    unknown = frozenset(short - known) if known else frozenset()
    rare, short = rare - known, short - known
    yield from dict.fromkeys((unknown, frozenset(), rare, short, rare | short))


def _judged(layout: TextLayout, said: Sequence[tuple[int, list[Piece]]],
            sample: Sequence[tuple[int, str]], texts: frozenset[str]) -> _TextReading | None:
    """Return the reading of a sample, judged; None if too much of it is not read."""
    pieces = [piece for _, each in said for piece in each]
    left = [piece for piece in pieces if not (piece.data and kind_of(piece.text) in texts)]
    again = layout.again()
    assert again is not None
    reading = _TextReading(again, marks_of(left), texts, frozenset(
        kind for piece in left if piece.data and MARK.search(kind := kind_of(piece.text))))
    fresh = layout.again()
    assert fresh is not None
    trial = _TextReading(fresh, reading.marks, texts, reading.kinds)
    chunks = [chunk for _, chunk in trial.chunks(sample, 3)]
    reading.layout = again
    reading.size = sum(len(chunk.data) for chunk in chunks)
    reading.proof, reading.hint = layout.proof, layout.hint
    reading.layout_words = layout.describe()
    again.is_sure = layout.is_sure
    if not reading.size:
        return None
    reading.share = _judge(chunks, reading.marks)
    is_weak = again.notation in NOTATIONS[-1] and reading.size < _MANY
    if reading.share <= _CHANCE and not _is_likely(reading, said) or (
            is_weak and reading.share < _SURE):
        return None
    numbers = [number for number, each in said if any(
        piece.data and kind_of(piece.text) in texts for piece in each)]
    if numbers:
        lines = dict(sample)
        more = f' (and {len(numbers) - 1} more)' if len(numbers) > 1 else ''
        reading.remarks.append(
            f'line {numbers[0]} has no bytes: "{shown(lines[numbers[0]].strip())}"{more}')
    return reading


def _is_likely(reading: _TextReading, said: Sequence[tuple[int, list[Piece]]]) -> bool:
    """Return True if a text without good frames has bytes all the same."""
    layout, marks = reading.layout, reading.marks
    left, read = _numbered(said), _with_bytes(said)
    unknown = [kind for kind, way in marks.ways.items() if way is Direction.UNKNOWN]
    if left > read or len(unknown) > 2 or not layout.is_sure:
        return False
    return not left or layout.notation not in NOTATIONS[-1]


def _numbered(said: Sequence[tuple[int, list[Piece]]]) -> int:
    """Return the number of lines that have numbers and no bytes."""
    return sum(len(each) == 1 and not each[0].data and has_numbers(each[0].text)
               for _, each in said)


def _judge(chunks: Sequence[Chunk], marks: Marks) -> float:
    """Return the share of bytes in good frames; turn guessed directions if replies go out."""
    decoder = TrafficDecoder()
    size, asked, judged = 0, Counter[Direction](), 0
    entries: list[Entry] = []
    for chunk in chunks:
        entries += decoder.feed(chunk)
        judged += len(chunk.data)
        if judged > _MOST_JUDGED:
            break
    for entry in chain(entries, decoder.finish()):
        if entry.kind not in (Kind.DAMAGED, Kind.UNKNOWN, Kind.NOISE) and entry.valid is not False:
            size += len(entry.wire)
        if entry.kind in (Kind.COMMAND, Kind.REPLY) and entry.packet is not None and entry.wire:
            way = entry.direction
            asked[way if entry.kind is Kind.COMMAND else way.opposite] += 1
    if marks.is_guess and asked[Direction.IN] > asked[Direction.OUT]:
        marks.swap()
    return size / judged if judged else 0.0
