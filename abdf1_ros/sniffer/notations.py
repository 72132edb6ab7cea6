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
Notations of bytes in a text: tokens in hexadecimal, decimal or octal, control names, escapes.

A ``Notation`` finds the runs of bytes in a line. It looks at each sign of a line only a few times,
so a line of 1 MB takes no longer than many short lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import re
from typing import NamedTuple, Protocol

MASK = '~'  # stands for what is not bytes, such as a time

_NAMES = ['NUL', 'SOH', 'STX', 'ETX', 'EOT', 'ENQ', 'ACK', 'BEL', 'BS', 'HT', 'LF', 'VT', 'FF',
          'CR', 'SO', 'SI', 'DLE', 'DC1', 'DC2', 'DC3', 'DC4', 'NAK', 'SYN', 'ETB', 'CAN', 'EM',
          'SUB', 'ESC', 'FS', 'GS', 'RS', 'US']
_VALUES = {name: value for value, name in enumerate(_NAMES)} | {
    'DEL': 127, 'TAB': 9, 'SP': 32, 'SPACE': 32, 'NULL': 0, 'XON': 17, 'XOFF': 19}
_NAME = '|'.join(sorted(_VALUES, key=len, reverse=True))
_HEX = '(?:0[xX])?(?:[0-9A-Fa-f]{2})++[hH]?'

_BEGIN, _END = '(?<![0-9A-Za-z_])', '(?![0-9A-Za-z_])'
# Between two tokens of a run: blanks and commas, or the same signs everywhere.
_SIGNS = r'\s?\|\s?|>\s?<|\]\s?\[|\}\s?\{|",\s?"|\',\s?\'|,?\s?[$%#]'

_SIMPLE = {'a': 7, 'b': 8, 't': 9, 'n': 10, 'v': 11, 'f': 12, 'r': 13, 'e': 27}
_ESCAPE = re.compile(r'\\(?:x([0-9A-Fa-f]{2})|u00([0-9A-Fa-f]{2})|([0-7]{1,3})|(.))', re.DOTALL)
SURE_ESCAPE = re.compile(r'\\(?:x[0-9A-Fa-f]{2}|u00[0-9A-Fa-f]{2}|[0-3][0-7]{2})')
_LITERAL = re.compile(
    r'(?P<mark>\bb)?(?P<quote>["\'])(?P<text>(?:\\.|(?!(?P=quote))[^\\])*+)(?P<end>(?P=quote))?')
_PAIRS_AFTER = re.compile(r'(?:\s+[0-9A-Fa-f]{2})+\s*')
_CARET = re.compile(r'(M-)?(?:\^([?-_])|(.))', re.DOTALL)
_OD_C = re.compile(r'[0-7]{7}((?: {3}[ -~]| {2}\\[0abtnvfr]| [0-7]{3})++)\s*')


class Run(NamedTuple):
    """Bytes that follow each other in a line, from column ``start`` to column ``end``."""

    start: int
    end: int
    data: bytes


class Notation(Protocol):
    """
    A way to write bytes; ``name`` says which.

    ``is_text`` tells that letters stand for themselves, so a run has no tokens, and ``is_words``
    that a token has two bytes, of which the second may be missing at the end of a dump.
    """

    name: str
    is_text: bool
    is_words: bool

    def runs(self, line: str) -> list[Run]:
        """Return the runs of a line; raise ValueError for a value that is not a byte."""

    def tokens(self, line: str, run: Run) -> Iterator[Run]:
        """Yield the tokens of a run."""


class Tokens:
    """A notation with a token for one or more bytes."""

    is_text = False

    def __init__(self, name: str, token: str, value: Callable[[str], bytes],
                 is_words: bool = False) -> None:
        self.name, self.is_words = name, is_words
        one = f'(?:{token}){_END}'
        self._token = re.compile(_BEGIN + one)
        self._run = re.compile(
            rf'{_BEGIN}{one}(?:(?:[\s,;]++{one})++|(?P<sign>[:-]){one}(?:(?P=sign){one})*+'
            rf'|(?P<signs>{_SIGNS}){one}(?:(?P=signs){one})*+(?!\s++{one}))?')
        self._value = value

    def runs(self, line: str) -> list[Run]:
        found = []
        for match in self._run.finditer(line):
            try:
                found.append(Run(match.start(), match.end(), self._value(match[0])))
            except ValueError:
                if self._token.fullmatch(match[0]) is None:
                    raise  # one number alone may be anything
        return found

    def tokens(self, line: str, run: Run) -> Iterator[Run]:
        for match in self._token.finditer(line, run.start, run.end):
            yield Run(match.start(), match.end(), self._value(match[0]))


class _Whole:
    """A notation in which letters stand for themselves: ``find`` returns the run of a line."""

    is_text, is_words = True, False

    def __init__(self, name: str, find: Callable[[str], Run | None]) -> None:
        self.name = name
        self._find = find

    def runs(self, line: str) -> list[Run]:
        run = self._find(line)
        return [] if run is None else [run]

    def tokens(self, line: str, run: Run) -> Iterator[Run]:
        yield run


def _of_pairs(text: str) -> bytes:
    return bytes.fromhex(re.sub('0[xX]|[^0-9A-Fa-f]', '', text))


def _of_names(text: str) -> bytes:
    return b''.join(
        bytes((_VALUES[part],)) if part in _VALUES else _of_pairs(part)
        for part in re.findall(r'\w+', text))


def _of_numbers(base: int) -> Callable[[str], bytes]:
    return lambda text: bytes(int(part, base) for part in re.findall(r'\w+', text))


def _of_words(base: int) -> Callable[[str], bytes]:
    return lambda text: b''.join(
        int(part, base).to_bytes(2, 'little') for part in re.findall(r'\w+', text))


def _unescaped(match: re.Match[str]) -> str:
    pair, code, octal, sign = match.groups()
    if sign == 'x':
        raise ValueError('an escape is cut')
    if sign is not None:
        return chr(_SIMPLE[sign]) if sign in _SIMPLE else sign
    return chr(int(octal, 8) if octal else int(pair or code, 16))


def _bytes(text: str) -> bytes:
    """Return characters as bytes; UnicodeEncodeError, a ValueError, for others."""
    return text.encode('latin-1')


def _literal(line: str) -> Run | None:
    """Return the quoted text of a line, or the text around the first escape."""
    found = None
    for match in _LITERAL.finditer(line):
        if not match['end']:
            break
        if _PAIRS_AFTER.fullmatch(line, match.end()):
            raise ValueError('bytes after a text')
        if line.startswith('...', match.end()):
            raise ValueError('a text is cut')
        is_last = not re.search(r'[\w"\']', line[match.end():match.end() + 60])
        if match['mark'] or '\\' in match['text'] or is_last:
            if found is not None:
                raise ValueError('two texts in one line')
            found = Run(*match.span(), _bytes(_ESCAPE.sub(_unescaped, match['text'])))
    if found is None and (escape := SURE_ESCAPE.search(line)):
        start = _begin_of(line, escape.start())
        found = Run(start, len(line), _bytes(_ESCAPE.sub(_unescaped, line[start:])))
    return found


def _begin_of(line: str, at: int) -> int:
    """Return where a text with a sign at ``at`` begins: after the blank or colon before it."""
    before = re.search(r'[^\s:\]>)=-]*\Z', line[max(0, at - 300):at])
    return at - len(before[0]) if before else at


def _in_brackets(left: str, right: str) -> Callable[[str], Run | None]:
    left, right = re.escape(left), re.escape(right)
    code = re.compile(rf'{left}(?:({_NAME})|(?:0x|\$)?([0-9A-Fa-f]{{2}})){right}')
    name = re.compile(rf'{left}(?:{_NAME}){right}')

    def value(match: re.Match[str]) -> str:
        return chr(_VALUES[match[1]] if match[1] else int(match[2], 16))

    def find(line: str) -> Run | None:
        first = name.search(line) and code.search(line)
        if not first:
            return None
        start = _begin_of(line, first.start())
        return Run(start, len(line), _bytes(code.sub(value, line[start:])))
    return find


def _in_carets(line: str) -> Run | None:
    first = re.search(r'(?:M-)?\^[?-_]', line)
    if first is None:
        return None
    start = _begin_of(line, first.start())

    def value(match: re.Match[str]) -> str:
        high, control, plain = match.groups()
        low = ord(control) ^ 64 if control else ord(plain)
        return chr(low | 128 if high else low)
    return Run(start, len(line), _bytes(_CARET.sub(value, line[start:])))


def _of_od_c(line: str) -> Run | None:
    match = _OD_C.fullmatch(line)
    if match is None:
        return None
    cells = (match[1][at:at + 4].strip(' ') or ' ' for at in range(0, len(match[1]), 4))
    return Run(*match.span(1), _bytes(''.join(
        chr(int(cell, 8)) if len(cell) == 3 else _ESCAPE.sub(_unescaped, cell) for cell in cells)))


HEX = Tokens('hexadecimal', _HEX, _of_pairs)
NAMES = Tokens('hexadecimal with names of control characters', f'{_NAME}|{_HEX}', _of_names)
# Bytes in a notation in which letters stand for themselves, or whole names in brackets.
AS_TEXT = re.compile(rf'\\x[0-9A-Fa-f]{{2}}|\bb["\']|[<\[{{](?:{_NAME})[>\]}}]')
HAS_NAMES = re.compile(rf'(?<!\w)(?:{_NAME})(?!\w)')
DIGITS = Tokens('hexadecimal without leading zeros', '(?:0[xX])?[0-9A-Fa-f]{1,2}', _of_numbers(16))
WORDS = Tokens('hexadecimal words, low byte first', '[0-9A-Fa-f]{4}', _of_words(16), True)
ESCAPES = _Whole('text with escapes', _literal)
# The likelier notations come first.
NOTATIONS: tuple[tuple[Notation, ...], ...] = (
    (HEX, WORDS, NAMES),
    (ESCAPES,
     _Whole('text with names in < >', _in_brackets('<', '>')),
     _Whole('text with names in [ ]', _in_brackets('[', ']')),
     _Whole('text with names in { }', _in_brackets('{', '}')),
     _Whole('characters of od -c', _of_od_c),
     _Whole('text with carets', _in_carets)),
    (Tokens('octal', '[0-7]{3}', _of_numbers(8)),
     Tokens('decimal', r'\d{1,3}', _of_numbers(10)),
     DIGITS,
     Tokens('octal words', '[01][0-7]{5}', _of_words(8), is_words=True)))
