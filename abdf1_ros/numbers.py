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
Numbers and choices as people write them.

Python's own ``int`` and ``float`` also accept other texts: "1_000", the digits of every script,
"nan" and "infinity".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
import functools
import math
import re
from typing import Any, Generic, TypeAlias, TypeVar

_T = TypeVar('_T')
_Meaning_co = TypeVar('_Meaning_co', covariant=True)
_Member = TypeVar('_Member', bound=Enum)

_WHOLE = re.compile(r'[+-]?[0-9]{1,20}')
_DECIMAL = re.compile(r'[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_COMMA_AND_THREE = re.compile(r'[+-]?[0-9]+,[0-9]{3}')


def whole_number(text: str) -> int | None:
    """Return the number that decimal digits stand for, None for anything else."""
    return int(text) if _WHOLE.fullmatch(text) else None


def is_digits(text: str) -> bool:
    """Tell whether ``text`` is a whole number without a sign."""
    return text.isascii() and text.isdigit()


def decimal_number(text: str) -> float | None:
    """Return the number that ``text`` stands for, None for other texts and too large numbers."""
    value = float(text) if _DECIMAL.fullmatch(text) else math.inf
    return value if math.isfinite(value) else None


def two_readings(text: str) -> str:
    """Return the advice for "1,000", which may be 1 or 1000; empty for other texts."""
    if not _COMMA_AND_THREE.fullmatch(text):
        return ''
    return f'{text.replace(",", "")} or {text.replace(",", ".")}'


@dataclass(frozen=True, slots=True)
class ValueKind(Generic[_Meaning_co]):
    """
    The kind of value of a cell, an option or an argument.

    ``read`` returns the value of a text, or None for a faulty text. ``right`` describes the right
    texts. A number is from ``low`` to ``high``. ``why_not`` may return a more precise fault.
    """

    read: Callable[[str], _Meaning_co | None]
    right: str = ''
    low: int | None = None
    high: int | None = None
    choices: tuple[str, ...] = ()
    why_not: Callable[[str], str] | None = None

    def fault(self, text: str) -> str:
        """Return the end of an error message, which follows the text that could not be read."""
        return (self.why_not and self.why_not(text)) or f'should be {self.right}'


Checked: TypeAlias = dict[str, Any]
"""Values of different kinds by name; a ValueKind has read each, or a parameter has its type."""

TEXT = ValueKind(str)


def whole(low: int, high: int, unit: str = '') -> ValueKind[int]:
    """Return the kind of whole numbers in a range."""
    def read(text: str) -> int | None:
        value = whole_number(text)
        return value if value is not None and low <= value <= high else None

    right = f'a whole number from {low} to {high} {unit}'.rstrip()

    def why_not(text: str) -> str:
        """Tell of 8.0, which pandas makes of 8 in a column with empty cells."""
        before, _, after = text.partition('.')
        return f'should be {right}: {before}' if after and not after.strip('0') and \
            read(before) is not None else ''
    return ValueKind(read, right, low, high, why_not=why_not)


def one_of(known: Mapping[str, _T], spelled: Callable[[str], object] = str.lower) -> ValueKind[_T]:
    """Return the kind of choices by name; texts are equal if ``spelled`` makes them equal."""
    meanings = {spelled(name): meaning for name, meaning in known.items()}
    choices = tuple(filter(None, known))
    return ValueKind(lambda text: meanings.get(spelled(text)), f'one of {", ".join(choices)}',
                     choices=choices)


YES_OR_NO = one_of({'Yes': True, 'No': False})


@functools.cache
def member_of(kind: type[_Member]) -> ValueKind[_Member]:
    """Return the kind of the members of an enumeration, by value."""
    return one_of({str(member.value): member for member in kind})
