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

"""Text from users and devices, made safe to show, and values as text."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, UTC
import difflib
import math
import re

# The beginning of a cell is enough to find it.
_SHOWN = 100

# --perod suggests --period, but --force does not suggest --port.
_ALIKE = 0.7

# The characters of a curve, the lowest first.
BARS = '▁▂▃▄▅▆▇█'


def printable(text: str) -> str:
    """
    Return ``text`` on one line, with every character visible.

    Line ends, escape sequences of terminals, marks that turn the direction of writing and other
    invisible characters become escapes as in a Python string. Letters of any language stay. So
    one entry of a log cannot look like two, and a terminal shows every character.
    """
    if text.isprintable():
        return text
    return ''.join(
        character if character.isprintable() else ascii(character)[1:-1] for character in text)


def is_head_of_values(line: str) -> bool:
    """Return True for the head of "plc log", "plc watch --csv" or examples/recorder.py."""
    return line.startswith(('time,station,address,', 'time,topic,address,'))


def is_head_of_settings(line: str) -> bool:
    """Return True for the head of a net file or a map."""
    cells = {cell.strip('\ufeff" ') for cell in re.split('[,;\t]', line)}
    return 'Com_Port' in cells or cells >= {'Tag', 'Address'}


def value_text(value: float) -> str:
    """Return a value as text, with as many digits as a float32 has."""
    return str(value) if isinstance(value, int) else f'{value:.7g}'


def bar(value: float, low: float, high: float, bars: str = BARS) -> str:
    """Return the character of a value on a scale from ``low`` to ``high``; a blank for NaN."""
    if not math.isfinite(value):
        return ' '
    return bars[round((value - low) / (high - low) * (len(bars) - 1))] if high > low else bars[0]


def cut(text: str, width: int) -> str:
    """Return ``text`` in at most ``width`` characters; a longer one ends with "..."."""
    return text if len(text) <= width else text[:max(width - 3, 0)] + '...'[:width]


def shown(cell: str) -> str:
    """Return a cell as errors show it, a long one without its end."""
    return cell if len(cell) <= _SHOWN else f'{cell[:_SHOWN]}...'


def first(names: Sequence[str], most: int = 5) -> str:
    """Return at most ``most`` names as text, and the number of the remaining names."""
    more = f' and {len(names) - most} more' if len(names) > most else ''
    return printable(', '.join(names[:most])) + more


def alike(name: str, options: Sequence[str]) -> list[str]:
    """Return the long options that a name may mean: those that begin with it, or similar ones."""
    name = name.partition('=')[0].strip('-').lower()
    return [option for option in options if name and option[2:].startswith(name)] \
        or difflib.get_close_matches(f'--{name}', options, 2, _ALIKE)


def counted(number: int, name: str) -> str:
    """Return e.g. "1 word", "2 words" or "2 replies"."""
    plural = f'{name[:-1]}ies' if name.endswith('y') else f'{name}s'
    return f'{number} {name if number == 1 else plural}'


def by_number(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts names as people do: line2 before line10."""
    return [(int(part) if part.isdecimal() else 0, part) for part in re.split('([0-9]+)', name)]


def milliseconds(seconds: float | None, digits: int = 0) -> str:
    """Return a time (s) in ms, None as unknown."""
    return 'unknown' if seconds is None else f'{seconds * 1000:.{digits}f} ms'


def age_text(since: float, now: float) -> str:
    """Return the seconds since a clock value; another thread may have set it after ``now``."""
    return f'{max(0.0, now - since):.1f} s'


def utc_text(seconds: float) -> str:
    """Return a time (s since 1970) as text in UTC, with milliseconds."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec='milliseconds')


def in_ms(seconds: float | None) -> float | None:
    """Return a time (s) in ms as JSON has it."""
    return None if seconds is None else round(seconds * 1000, 3)
