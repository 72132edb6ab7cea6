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
Layouts of a text of bytes: which of the runs in a line are the bytes, and what the rest is.

A layout divides a line into pieces of text with the bytes after each. Other runs of the line have
to be explained: as an offset, a number of bytes, a number that rises, or always the same. A line
of which bytes would be left over does not fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from itertools import islice
import re
from typing import NamedTuple, Protocol

from abdf1_ros.sniffer.columns import number_of, NumberColumn, OFFSETS, Unfit, WORD_OFFSET
from abdf1_ros.sniffer.notations import (
    AS_TEXT,
    ESCAPES,
    HEX,
    MASK,
    NAMES,
    Notation,
    Run,
    SURE_ESCAPE,
)

_DATE = r'(?:\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?[-/.]\d\d?[-/.](?:\d{4}|\d\d(?=[ T])))'
TIME_OF_DAY = re.compile(
    rf'(?<![0-9A-Fa-f:.])(?:{_DATE}[ T,]+)?(?P<hours>\d\d?):(?P<minutes>\d\d):'
    r'(?P<seconds>\d\d(?:[.,]\d+|:\d{3,9})?)(?!:?[0-9A-Fa-f])(?:\s?(?P<half>[AaPp])[Mm]\b)?')
SECONDS = re.compile(r'(?<![\w.])(?P<number>\d{1,18}\.\d{3,}(?:[eE][-+]?\d{1,2})?)'
                     r'(?:\s?(?P<unit>[mnuµμ]?s)\b|(?![\w.]))')
ADDRESS = r'(?:\d{1,3}\.){3}\d{1,3}(?:[.:]\d{1,5})?'
# Parts that are never bytes. Only three bytes with colons may look like a time.
_NO_BYTES = re.compile(
    rf'{TIME_OF_DAY.pattern}|{_DATE}(?![\w.])|(?<![\w.]){ADDRESS}(?![\w.])'
    r'|(?<![\w.])[-+]?\d+\.\d+(?:[eE][-+]?\d+)?(?![\w.])|#\d+(?=\s+[^#\s])')

# Signs that may follow the bytes of a line.
# The head of a dump, which counts its columns from 00 on.
_RULER = re.compile(r'(?:\s{4,}|\s*(?:offset|addr)\S*\s+)'
                    r'00 +01 +02 +03 +04 +05 +06 +07(?: +08 +09 +0A +0B +0C +0D +0E +0F)?'
                    r'(?:\s+(?![0-9A-F]{2}\b).*)?', re.IGNORECASE)
# A character, or its number, before the same in hexadecimal, as '16' (0x10).
_SHOWN_BEFORE = re.compile(r"((?:'[^']{1,4}'|\\?\S) \()(0[xX][0-9A-Fa-f]{2})\)")
# Characters one by one after a double bar, as another program shows the bytes before it.
_SHOWN_APART = re.compile(r'(?<=[0-9A-Fa-f]{2})[ |]*\|\|(?: .)+\s*\Z')

CLOSED = re.compile(r'[\s,;\])}>"\'|/*\\□]*')
_NAME = re.compile(r'[^\W\d_]{2}')
_LONG_NUMBER = re.compile(r'(?<!\w)(?=[A-Fa-f]*\d)[0-9A-Fa-f]{2,}(?!\w)')
_CUT = re.compile(r'(?:[0-9A-Fa-f]{2}\s?|["\'])(?:…|\.{3}(?!\.))')
_ANY = re.compile(r'(?<!\w)(?:0[xX])?[0-9A-Fa-f]*\d[0-9A-Fa-f]*(?!\w)')
_GAP = re.compile(r'\s{2,}|\t|\s?[|;]\s?|\s|\Z')
_WIDE = re.compile(r'\s{2,}|\t|\s?[|;]')
LITERAL = re.compile(r'\bb["\']')  # of Python
# One token between such signs is a label, a count or a part of a name.
_LABEL_BEFORE = re.compile(r'(?:[=(\[.#]|\w:)\Z')
_LABEL_AFTER = re.compile(r'[)\]=%]|:(?!\S)|\s?\||\s(?:bytes?|ms|s|B)\b')
_DIGIT_BEFORE, _DIGIT_AFTER = (re.compile(r'(?<!\S)[0-9A-F][ \t]{1,2}\Z'),
                               re.compile(r'[ \t]{1,2}[0-9A-F](?!\S)'))
# A line without bytes may begin with a number that rises.
_NUMBERED = re.compile(r'\s*(\d{1,18})[\s:]+[^\W\d]{2}')
_SHOWN_AS = 6  # most characters that show a byte
# How control characters are shown in a column of characters.
_SHOWN = re.compile(r'(?:M-)?\^.|M-.|\\x..|\\.|<\w{1,4}>')
# A number at the begin of a line, which may be an offset.
_LABEL = re.compile(r'\s*(?:0[xX])?([0-9A-Fa-f]{4,16})(?=[:\s])')
_LONGEST_MARK = 200  # characters
MOST_COLUMNS = 50
# What a "*" in a dump may stand for, all together: hours of the same byte on the fastest line.
_MOST_LEFT_OUT = 100_000_000
_NO_OFFSET = ('the offset does not fit: "*" stands for lines like the one above, in a file for '
              f'at most {_MOST_LEFT_OUT // 1_000_000} MB of them; "hexdump -v" makes no "*"')


class Piece(NamedTuple):
    """A text, the bytes after it, and how far the line is indented; ``times`` repeats them."""

    text: str  # of a long one both ends
    data: bytes = b''
    indent: str = ''
    times: int = 1
    before: str = ''  # without bytes: the text before a number that is not read


class Choice(Enum):
    """The run of a line that has its bytes, in words."""

    LAST = 'at the end of a line'
    BESIDE = 'beside their characters'
    ALL = 'in several parts of a line'
    LONGEST = 'as the longest part of a line'


class TextLayout(Protocol):
    """A layout; ``describe`` names it, and ``again`` returns it as learnt, for the first line."""

    notation: Notation
    is_fit: bool  # each line of a sample fits
    is_sure: bool  # what is read can hardly be anything but bytes

    def split(self, line: str) -> list[Piece]:
        """Return the pieces of a line; raise ValueError if the line does not fit."""

    def end(self) -> list[Piece]:
        """Return what is left at the end of the text."""

    def again(self) -> TextLayout | None:
        """Return the layout for another reading; None if something stays unexplained."""

    @property
    def proof(self) -> int:
        """Return how many columns are proved to be offsets, or numbers of bytes."""

    @property
    def hint(self) -> bool:
        """Return True if a text looks as if it had this layout, even without good frames."""

    def describe(self) -> str:
        """Return the layout in words."""


def masked(line: str, with_times: bool = True) -> str:
    """Return a line with signs in place of what is never bytes."""
    if _RULER.fullmatch(line):
        return MASK * len(line)
    line = _SHOWN_APART.sub(lambda match: ' ' * len(match[0]), line)
    line = _SHOWN_BEFORE.sub(lambda match: f'{MASK * len(match[1])}{match[2]} ', line)

    def mask(match: re.Match[str]) -> str:
        is_bytes = match['minutes'] and not with_times
        return match[0] if is_bytes else MASK * len(match[0])
    return _NO_BYTES.sub(mask, line)


def has_numbers(line: str) -> bool:
    """Return True if a line has a number that may be bytes in some notation."""
    return _ANY.search(masked(line)) is not None


def is_cut(line: str) -> bool:
    """Return True if a program has cut the bytes of a line."""
    return _CUT.search(line) is not None


class TextLines:
    """Lines with text around the bytes."""

    def __init__(self, notation: Notation, choice: Choice, has_lead: bool = False,
                 has_times: bool = True, columns: dict[int, NumberColumn] | None = None) -> None:
        self.notation = notation
        self._choice, self._has_lead, self._has_times = choice, has_lead, has_times
        self._is_learnt = columns is not None
        self._columns = columns or {}
        self._numbers = NumberColumn()  # those before lines without bytes
        self._labels = NumberColumn()  # the label at the begin of a line, which may be an offset
        self._has_label = False
        self.is_fit, self.is_sure = False, choice is Choice.BESIDE or (
            notation.is_text and notation is not ESCAPES)
        self._count = 0  # lines with bytes
        self._last, self._indent = b'', ''
        self._is_repeated = False
        self._left_out = 0
        self._held: list[Piece] = []  # of words: the next offset tells how many bytes they are

    def split(self, line: str) -> list[Piece]:
        if line.strip() == '*' and self._last:
            if self._offsets is None:
                raise Unfit
            self._is_repeated = True
            return []
        shown = line if self.notation.is_text else masked(line, self._has_times)
        runs = self.notation.runs(shown)
        found = [run for run in runs if not self._is_label(shown, run)]
        self._has_label |= len(found) < len(runs)
        is_glued = not found and len(runs) == 1 and shown[:runs[0].start].endswith(':')
        runs = runs if is_glued else found
        if LITERAL.search(line) and not self.notation.is_text and not (
                self.notation is HEX and _is_quoted(line, runs)):
            raise Unfit
        if self._choice is Choice.ALL:
            chosen = runs if runs and CLOSED.fullmatch(shown, runs[-1].end) else []
        else:
            chosen = [run for run in [self._chosen(shown, runs)] if run]
        if not chosen:
            if not self._is_end(line):
                self._check_rest(shown, runs)
                return [Piece(ends(line), before=ends(line[:runs[0].start]) if runs else '')]
            return [*self._whole(line.strip()), *self._repeat(self._jump(line.strip()))]
        self._count += 1
        self.is_sure = self.is_sure or self._is_sure(shown, chosen)
        others = [] if self._choice is Choice.ALL else [
            run for run in runs if run.end <= chosen[0].start
            or run.start >= chosen[0].end and self._choice is not Choice.BESIDE]
        if len(others) > MOST_COLUMNS:
            raise Unfit
        if not self.notation.is_text and any(
                _DIGIT_BEFORE.search(shown, max(0, run.start - 4), run.start)
                or self._choice is not Choice.BESIDE and _DIGIT_AFTER.match(shown, run.end)
                for run in chosen):
            raise Unfit  # it may be half a byte
        pieces = self._pieces(line, chosen, others)
        if not self.notation.is_words:
            return pieces
        held, self._held = self._held, pieces
        return held

    def _is_sure(self, line: str, chosen: Sequence[Run]) -> bool:
        """Return True if these runs can hardly be anything but bytes."""
        if self.notation.is_text:
            return bool(AS_TEXT.search(line) or SURE_ESCAPE.search(line))
        return any(len(run.data) > 2 or '0x' in line[run.start:run.end] or is_long(
            self.notation, line, run) for run in chosen)

    def _whole(self, offset: str) -> list[Piece]:
        """Return the last words of a dump; the offset tells whether the last one is whole."""
        held, self._held = self._held, []
        column = self._offsets
        if held and column is not None and not self._is_repeated and all(
                number_of(offset, OFFSETS[name]) != column.following.get((name, self._indent))
                for name in column.kinds & OFFSETS.keys()):
            held[-1] = held[-1]._replace(data=held[-1].data[:-1])
            column.following = {place: value - 1 for place, value in column.following.items()}
        return held

    def _pieces(self, line: str, chosen: Sequence[Run], others: Sequence[Run]) -> list[Piece]:
        size = sum(len(run.data) for run in chosen)
        indent = line[:len(line) - len(line.lstrip())]
        columns: list[tuple[int, Run]] = []
        if self._has_lead:
            lead, rest = self._led(line, chosen[0])
            chosen = [rest, *chosen[1:]]
            size -= len(lead.data)
            columns.append((0, lead))
            self._columns.setdefault(0, NumberColumn()).is_apart &= rest.start - lead.end > 1
            others = [*others, lead]
        place = 0
        for run in others:
            if run.start < chosen[0].start and not (columns and run is columns[0][1]):
                columns.append((place := place + 1, run))
            elif run.start > chosen[0].start:
                columns.append((-(place := place + 1), run))
        jump = 0
        for place, run in columns:
            jump = max(jump, self._explain(place, line[run.start:run.end], size, indent))
        label = _LABEL.match(line)
        if label and label.end() <= chosen[0].start and not self._has_lead:
            jump = max(jump, self._label(label[1], size, indent))
        before = self._repeat(jump)
        if self.notation is HEX and any(_is_uneven(line[run.start:run.end]) for run in chosen):
            raise Unfit
        pieces, at = [], 0
        for run in chosen:
            text = _without(line, at, run.start, others)
            pieces.append(Piece(ends(text), run.data, indent))
            at = run.end
        if self._choice is Choice.LONGEST:
            pieces[-1] = pieces[-1]._replace(text=pieces[-1].text + ' ' + _without(
                line, at, len(line), others))
        self._last, self._indent = chosen[-1].data, indent
        return [*before, *(piece for piece in pieces if piece.data or piece.text.strip())]

    def _explain(self, place: int, text: str, size: int, indent: str) -> int:
        if self._is_learnt and place not in self._columns:
            raise Unfit
        return self._take(self._columns.setdefault(place, NumberColumn()), text, size, indent)

    def _take(self, column: NumberColumn, text: str, size: int, indent: str) -> int:
        try:
            return column.take(text, size, indent, len(self._last) * self._is_repeated)
        except Unfit:
            raise Unfit(_NO_OFFSET if self._is_repeated else '') from None

    def _label(self, text: str, size: int, indent: str) -> int:
        try:
            jump = self._take(self._labels, text, size, indent)
        except Unfit:
            if self._is_repeated:
                raise
            jump = 0
        if self._labels.follows > 1 and not self._labels.kinds & OFFSETS.keys():
            raise Unfit('the offset does not follow from the lines before')
        return jump

    @property
    def _offsets(self) -> NumberColumn | None:
        """Return the column with the offsets of a dump."""
        return next((column for column in (*self._columns.values(), self._labels)
                     if column.count and column.kinds & OFFSETS.keys()), None)

    def _jump(self, text: str) -> int:
        column = self._offsets
        assert column is not None
        return self._take(column, text, 0, self._indent)

    def _is_end(self, line: str) -> bool:
        """Return True for the offset after the last byte, which stands alone."""
        column, text = self._offsets, line.strip()
        if column is None or not re.fullmatch('[0-9A-Fa-f]{6,16}', text):
            return False
        left = [column.following.get((name, self._indent), 0) - (number_of(text, base) or 0)
                for name, base in OFFSETS.items() if name in column.kinds]
        return self._is_repeated or 0 in left or self.notation.is_words and 1 in left

    def _repeat(self, count: int) -> list[Piece]:
        """Return the bytes that a "*" stands for."""
        is_repeated, self._is_repeated = self._is_repeated, False
        if not is_repeated:
            return []
        self._left_out += count
        if not 0 <= count <= self._left_out <= _MOST_LEFT_OUT:
            raise Unfit(_NO_OFFSET)
        return [Piece('', self._last, '', count // len(self._last))] if count else []

    def _chosen(self, line: str, runs: Sequence[Run]) -> Run | None:
        if self.notation.is_text:
            return runs[-1] if runs else None
        if self._choice is Choice.BESIDE:
            return next((found for run in runs if (found := self._beside(line, run))), None)
        if not runs or not CLOSED.fullmatch(line, runs[-1].end):
            return None
        if self._choice is Choice.LONGEST:
            return max(runs, key=lambda run: len(run.data))
        return runs[-1]

    def _beside(self, line: str, run: Run) -> Run | None:
        """Return the bytes of a run as far as their characters follow; None if they do not."""
        line = line.rstrip()
        gap = _GAP.match(line, run.end)
        if gap and not self._has_lead and len(line) - gap.end() <= len(run.data) + 2:
            text = line[gap.end():]
            if len(text.strip('|')) == len(run.data) and agree(text, run.data):
                return run
        size, tries = 0, 3  # no more: a line may have very many gaps
        for token in self.notation.tokens(line, run):
            size += len(token.data)
            is_end = token.end == run.end
            gap = (_GAP if is_end else _WIDE).match(line, token.end)
            if gap is None or len(line) - gap.end() > (_SHOWN_AS * is_end or 1) * (size + 2):
                continue
            part = self.notation.runs(line[run.start:token.end])[0]
            found = Run(run.start, token.end, part.data)
            data = self._led(line, found)[1].data if self._has_lead else found.data
            text = line[gap.end():]
            if data and _width(text) <= len(data) + 2 and agree(text, data):
                return found
            tries -= 1
            if not tries:
                return None
        return None

    def _led(self, line: str, run: Run) -> tuple[Run, Run]:
        """Return the first token of a run, and its other tokens."""
        tokens = self.notation.tokens(line, run)
        lead = next(tokens)
        second = next(tokens, None)
        if second is None:
            return lead, Run(run.end, run.end, b'')
        return lead, Run(second.start, run.end, run.data[len(lead.data):])

    def _is_label(self, line: str, run: Run) -> bool:
        if self.notation.is_text or len(run.data) > 4:
            return False
        is_one = line[run.start:run.end].isalnum()
        before = line[max(0, run.start - 2):run.start]
        if before[-1:] in ('(', '[') and line[run.end:run.end + 1] in ')]':
            return is_one and CLOSED.fullmatch(line, run.end) is None
        return is_one and (_LABEL_BEFORE.search(before) is not None
                           or _LABEL_AFTER.match(line, run.end) is not None)

    def _check_rest(self, line: str, runs: Sequence[Run]) -> None:
        """Raise Unfit for a line without bytes that looks as if it had some."""
        if self.notation.is_text:
            runs = HEX.runs(masked(line))
        elif _LONG_NUMBER.search(masked(line)) and not _NAME.search(line) or (
                self.notation is not NAMES and AS_TEXT.search(line)):
            raise Unfit
        for run in runs:
            if is_long(HEX if self.notation.is_text else self.notation, line, run):
                raise Unfit
            if not line[:run.start].strip():
                match = _NUMBERED.match(line)
                if match is None:
                    raise Unfit
                self._numbers.take(match[1], 0)

    def end(self) -> list[Piece]:
        return self._held

    def again(self) -> TextLines | None:
        for place, column in self._columns.items():
            is_often = column.count >= 0.9 * self._count and column.count > 2
            if not column.is_proved and not (place and is_often):
                return None
        return TextLines(self.notation, self._choice, self._has_lead, self._has_times, {
            place: NumberColumn(set(column.kinds)) for place, column in self._columns.items()})

    @property
    def has_others(self) -> bool:
        """Return True if a line had more runs than that with its bytes."""
        return bool(self._columns) or self._has_label

    @property
    def proof(self) -> int:
        return sum(column.is_proved and column.kinds != {'rising'}
                   for column in self._columns.values())

    @property
    def hint(self) -> bool:
        return self.notation.is_words and len(self._labels.last) == WORD_OFFSET and bool(
            self._labels.kinds & OFFSETS.keys())

    def describe(self) -> str:
        others = ''.join(f'; "{column.first}" is taken for {column.meaning}'
                         for column in self._columns.values() if column.count)
        return f'{self.notation.name}, {self._choice.value}{others}'


def _without(line: str, start: int, end: int, runs: Sequence[Run]) -> str:
    """Return a part of a line with "#" in place of these runs."""
    parts, at = [], start
    for run in sorted(runs):
        if start <= run.start and run.end <= end:
            parts.append(line[at:run.start] + '#')
            at = run.end
    return ''.join(parts) + line[at:end]


def ends(text: str) -> str:
    """Return both ends of a long text: no mark is longer."""
    return text if len(text) <= 2 * _LONGEST_MARK else (
        f'{text[:_LONGEST_MARK]} {text[-_LONGEST_MARK:]}')


def _width(text: str) -> int:
    """Return how many characters a text shows."""
    return len(_SHOWN.sub('.', text))


def agree(text: str, data: bytes) -> bool:
    """Return True if a text can show these bytes as characters, maybe cut."""
    text = text.strip()
    if not text:
        return not data.strip(b' ')
    found = iter(chr(byte) for byte in data)
    shown = re.sub(r'[^0-9A-Za-z]', '', _SHOWN.sub('', text))
    return all(sign in found for sign in shown)


def _is_uneven(text: str) -> bool:
    """Return True if a token, other than the first, is longer than one before the last."""
    sizes = [len(token) for token in text.split()][1:]
    return len(set(sizes)) > 1 and (len(set(sizes[:-1])) > 1 or sizes[-1] > sizes[0])


def is_long(notation: Notation, line: str, run: Run) -> bool:
    """Return True if a run has two tokens or more."""
    return len([*islice(notation.tokens(line, run), 2)]) > 1


def _is_quoted(line: str, runs: Sequence[Run]) -> bool:
    """Return True if the quotes of a bytes literal have nothing but a run."""
    return any(line[run.start - 2:run.start] in ('b"', "b'")
               and line[run.end:run.end + 1] == line[run.start - 1]
               and line[run.start:run.end].isalnum() for run in runs)
