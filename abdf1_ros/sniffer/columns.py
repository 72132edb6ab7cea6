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

"""Numbers beside the bytes of a text: offsets, numbers of bytes, numbers of lines."""

from __future__ import annotations

from dataclasses import dataclass, field
import re

WORD_OFFSET = 7  # digits before the words of hexdump and od
_OTHER_OFFSET = 8  # digits before the bytes of xxd and hexdump -C, which are hexadecimal
_MANY_LINES = 8  # lines in which a number rises; a byte does not rise in all of them


class Unfit(ValueError):
    """A line that does not fit a layout."""


OFFSETS = {'offset 16': 16, 'offset 8': 8, 'offset 10': 10}
_PROVED = {*OFFSETS, 'size 10', 'size 16', 'rising'}


@dataclass(slots=True)
class NumberColumn:
    """Numbers beside the bytes; ``kinds`` is what they may be."""

    kinds: set[str] = field(default_factory=lambda: {'same', *_PROVED})
    count: int = 0
    first: str = ''
    last: str = ''
    size: int = 0  # bytes of the last line
    follows: int = 0  # offsets, other than 0, that follow from the line before
    is_apart: bool = True  # it has a wider gap after it than there is between bytes
    following: dict[tuple[str, str], int] = field(default_factory=dict)

    def take(self, text: str, size: int, indent: str = '', left_out: int = 0) -> int:
        """
        Take the number of a line with ``size`` bytes, and return how many bytes were left out.

        With ``left_out``, the offset may jump by a multiple of it. Raises Unfit.
        """
        self.first = self.first or text
        holds = {'same': text == self.first, 'rising': _rises(self.last, text)}
        jumps: dict[str, int] = {}
        for base in (10, 16):
            holds[f'size {base}'] = number_of(text, base) == size
        for name, base in OFFSETS.items():
            value = number_of(text, base) if _is_usual(len(text), base) else None
            expected = self.following.get((name, indent), value)
            jump = (value or 0) - (expected or 0)
            holds[name] = value is not None and (not jump or not value or left_out > 0 and (
                jump > 0 and not jump % left_out))
            jumps[name] = jump if value else 0
            is_known = name in self.kinds and (name, indent) in self.following
            # A number of lines rises by 1, as an offset after one byte.
            is_offset = bool(value) and (self.size > 1 or not size)
            self.follows += is_known and holds[name] and is_offset
            self.following[name, indent] = (value or 0) + size
        self.kinds &= {name for name, is_held in holds.items() if is_held}
        self.last, self.size, self.count = text, size, self.count + 1
        if not self.kinds:
            raise Unfit
        found = {jumps[name] for name in self.kinds & OFFSETS.keys()}
        if left_out and len(found) > 1:
            raise Unfit
        return max(found, default=0)

    @property
    def meaning(self) -> str:
        """Return in words what the numbers are."""
        kinds = {kind.split()[0] for kind in self.kinds}
        return next(meaning for kind, meaning in _MEANINGS.items() if kind in kinds)

    @property
    def is_proved(self) -> bool:
        """Return True if the numbers are no bytes, whatever they are."""
        if 'same' in self.kinds:
            return self.is_apart and re.fullmatch('(?:0x)?0{4,}', self.first) is not None
        if self.kinds & OFFSETS.keys():
            digits = len(re.sub('^0[xX]', '', self.first))
            return self.follows > 2 or self.follows > 0 and digits > 3
        return self.count >= (_MANY_LINES if self.kinds == {'rising'} else 3)


_MEANINGS = {'offset': 'an offset', 'size': 'the number of bytes',
             'rising': 'the number of a line', 'same': 'a name'}


def number_of(text: str, base: int) -> int | None:
    try:
        return int(text[:20], base)
    except ValueError:
        return None


def _is_usual(digits: int, base: int) -> bool:
    """Return True if programs write offsets of this base with this number of digits."""
    if base == 8:
        return digits == WORD_OFFSET
    return base == 16 or digits not in (WORD_OFFSET, _OTHER_OFFSET)


def _rises(last: str, text: str) -> bool:
    before, now = (re.match(r'\d{1,18}', part) for part in (last, text))
    return now is not None and (not last or before is not None and int(before[0]) <= int(now[0]))
