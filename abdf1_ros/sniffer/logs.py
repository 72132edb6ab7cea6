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
Read logs of serial port monitors, by one rule for all logs.

A line has an optional time, a word or sign for the direction, and bytes. The bytes are pairs of
hexadecimal digits with blanks, commas or dashes between them. Characters beside the bytes have to
show the same bytes. A line without bytes sets time and direction of the lines after it. A line
that fits the rule in two ways is refused, and so is a line of which bytes would be left over.
"""

from __future__ import annotations

import ast
import math
import re

from abdf1_ros.sniffer.capture import Chunk, Direction

# Only before a time of day, because a date alone might be bytes.
_DATE = r'(?:\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?[-/.]\d\d?[-/.]\d{2,4})[ T]+'
_TIME_OF_DAY = re.compile(
    rf'(?:{_DATE})?(?P<hours>\d\d?):(?P<minutes>\d\d):(?P<seconds>\d\d(?:[.,]\d+)?)(?!:?\d)')
_SECONDS = re.compile(r'(?<![\d.])\d{1,18}\.\d{3,}(?![\d.])')
_DAY = 86400.0
_TIME = '~'  # stands for the time in the words of a line
_SET_BACK = 3600.0  # s; a time of day that is earlier by more than this is of the next day

_OUT = {'tx', 'sent', 'send', 'sending', 'written', 'write', 'wrote', 'irp_mj_write', 'out',
        'transmit', 'transmitted', '>', '>>', '>>>', '->', '-->'}
_IN = {'rx', 'received', 'receive', 'recv', 'receiving', 'read', 'irp_mj_read', 'in', '<', '<<',
       '<<<', '<-', '<--'}
_WAYS = {**dict.fromkeys(_OUT, Direction.OUT), **dict.fromkeys(_IN, Direction.IN)}
_WORD = re.compile(r'[A-Za-z_]+|(?<!-)-+>+|>+|<+-*')

# A line with only bytes: pairs, or groups of pairs, with the same sign between them.
_PAIRS = re.compile(r'(?P<group>(?:[0-9A-Fa-f]{2})+)(?:(?P<sign>[ -])(?:[0-9A-Fa-f]{2})+'
                    r'(?:(?P=sign)(?:[0-9A-Fa-f]{2})+)*)?')
_BYTE = r'(?:0[xX])?[0-9A-Fa-f]{2}'
_AFTER = r'(?![0-9A-Za-z:=.])'
# One byte, the signs after it, and the gap if they begin with one.
_ONE = re.compile(r'(?:0[xX])?(?P<byte>[0-9A-Fa-f]{2})(?=(?P<gap>\s{2,}|\t)?)(?P<signs>[\s,;-]*)')
# A run of bytes. It may include characters beside the bytes that look like more bytes.
_BYTES = re.compile(rf'(?:^|(?<=[\s,\[({{"\'])){_BYTE}(?:[\s,;-]+{_BYTE})*{_AFTER}')
_GAP = re.compile(r'\s{2,}|\t')
_REST = re.compile(r'[\s,;\])}"\']*')
# What looks like bytes, and is neither a word, a decimal number, a count, a label nor an offset. A
# line is refused if this stands between its direction or time and its bytes, or instead of bytes.
_HEX = r'(?=[A-Fa-f]*\d)[0-9A-Fa-f]+|[A-F]|(?:[A-Fa-f]{2}){1,2}|[0-9A-Fa-f]{2}h'
_LEFT_OVER = re.compile(
    rf'(?<![\w=(\[.#])(?:0[xX]|\\x)?(?:{_HEX})'
    r'(?![\w=)]|:(?:\s|$)| bytes?\b| *\||\.\d+(?![\w.])|(?<=\w{4})(?:\s{2}|\t))|\bb[\'"]')
_GLUED = re.compile(r'(?:[0-9A-Fa-f]{2})+(?=[\s,;-]|$)')
_LITERAL = re.compile(r'\bb(?P<sign>[\'"])(?:\\.|(?!(?P=sign))[^\\])*(?P=sign)')


class LogReader:
    """
    Read the lines of a log in their order.

    ``read`` returns the chunk of a line, or None if the line has no bytes. It raises ValueError if
    a line does not fit the rule.
    """

    def __init__(self) -> None:
        self._way = Direction.UNKNOWN
        self._time: float | None = None
        self._begun: float | None = None
        self._is_first = True

    def read(self, line: str) -> Chunk | None:
        """Read a line that is not empty."""
        is_first, self._is_first = self._is_first, False
        if _PAIRS.fullmatch(line):
            return self._chunk(bytes.fromhex(line.replace('-', '')))
        head, data = _divided(line)
        time, words = _time_of(head)
        # each direction, with the end of its first word
        ways = {way: match.end() for match in reversed([*_WORD.finditer(words)])
                if (way := _WAYS.get(match[0].lower()))}
        has_words = re.search('[A-Za-z]', words) is not None
        if time is None and not ways and not data and not (is_first and ',' in line):
            raise ValueError
        if data and has_words and not ways and '0x' not in line.lower():
            data = b''  # such as the settings of a port in the log of a port monitor
            if time is None:
                raise ValueError
        after = min(ways.values(), default=words.rfind(_TIME) + 1)
        if (ways or data) and (_LEFT_OVER.search(words, after if data else 0)
                               or _GLUED.match(words, after)):
            raise ValueError
        if time is not None:
            self._time = self._since_begin(time, _TIME_OF_DAY.search(head) is not None)
        if ways or not data or has_words:
            self._way = next(iter(ways)) if len(ways) == 1 else Direction.UNKNOWN
        return self._chunk(data) if data else None

    def _chunk(self, data: bytes) -> Chunk:
        return Chunk(self._time, self._way, data)

    def _since_begin(self, time: float, is_of_day: bool) -> float:
        if self._begun is None or not is_of_day and time < self._begun:
            self._begun = time  # a clock that has begun again: another recording
        later = time - self._begun
        if self._time is not None and is_of_day:  # a time of day starts again at midnight
            later += _DAY * max(0, math.ceil((self._time - _SET_BACK - later) / _DAY))
        return later


def _divided(line: str) -> tuple[str, bytes]:
    """Return the head of a line and its bytes; raise ValueError if the border is unclear."""
    if match := _LITERAL.search(line):
        if _LITERAL.search(line, match.end()) or _LEFT_OVER.search(line, match.end()):
            raise ValueError
        try:
            data = ast.literal_eval(match[0])
        except SyntaxError:  # it is cut: b'\x1'
            raise ValueError from None
        assert isinstance(data, bytes)
        return line[:match.start()], data
    rest = _TIME_OF_DAY.sub(lambda match: _TIME * len(match[0]), line)
    match = next((match for match in _BYTES.finditer(rest)
                  if _REST.fullmatch(rest, match.end()) or _GAP.match(rest, match.end())
                  or _GAP.search(match[0])), None)
    if match is None:
        return line, b''
    data = _bytes_of(rest, match)
    head = line[:match.start()]
    # "RX 02 10 06": a count of two bytes, or three bytes?
    first = re.match(r'\d\d\b', match[0])
    if first and re.search('[A-Za-z]\\s*$', head) and int(first[0]) == len(data) - 1:
        raise ValueError
    return head, data


def _bytes_of(line: str, match: re.Match[str]) -> bytes:
    """Return the bytes of a run, without the characters beside them."""
    data = _beside_characters(line.rstrip(' '), match.start())
    if data is not None:
        return data
    if _REST.fullmatch(line, match.end()):
        return bytes.fromhex(re.sub('0x|[,;-]', ' ', match[0], flags=re.IGNORECASE))
    raise ValueError


def _beside_characters(line: str, start: int) -> bytes | None:
    """
    Return the bytes from ``start`` to a gap, where the same bytes follow it as characters.

    As many characters have to follow as bytes come before, so no two gaps are possible.
    """
    data = bytearray()
    first = last = 0  # the bytes without blanks at their ends, which may be missing
    while match := _ONE.match(line, start):
        start = match.end()
        data += bytes.fromhex(match['byte'])
        if data[-1:] != b' ':
            last = len(data)
        elif not last:
            first = len(data)
        if match['gap'] and len(line) - match.end('gap') == last - first:
            text = line[match.end('gap'):]
            return bytes(data) if _are_characters(text, data) else None
        if not match['signs']:
            break
    return None


def _are_characters(text: str, data: bytes | bytearray) -> bool:
    """Return True if a text can show ``data`` in a dump, with signs for unprintable bytes."""
    text, data = text.strip(' '), data.strip(b' ')  # blanks at the ends may be missing
    return len(text) == len(data) > 0 and all(
        chr(byte) == sign or sign == '.' or not (0x20 < byte < 0x7F or sign.isalnum())
        for sign, byte in zip(text, data, strict=True))


def _time_of(head: str) -> tuple[float | None, str]:
    """Return the time (s) of a head, and the head with ``_TIME`` in its place."""
    if match := _TIME_OF_DAY.search(head):
        time = 3600.0 * int(match['hours']) + 60 * int(match['minutes']) \
            + float(match['seconds'].replace(',', '.'))
        return time, head[:match.start()] + _TIME + head[match.end():]
    if match := _SECONDS.search(head):
        return float(match[0]), head[:match.start()] + _TIME + head[match.end():]
    return None, head
