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

"""Values of parameters: which can be used, and how to write one that cannot."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import yaml

# Texts that may be a number: of a COM port, of a station. All other texts name a file.
_NUMBERED = 'port', 'poll_list', 'priority_poll_list'
_STATION_LISTS = _NUMBERED[1:]

_KINDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'text'}


def usable(name: str, value: object, default: bool | float | str, low: float | None = None,
           high: float | None = None, choices: Collection[str] = ()) -> Any:
    """
    Return the value of a parameter, of the type of ``default``.

    ``low`` and ``high`` are its range; ``choices`` has its only texts, and a bool may be one of
    them. Raises ValueError, with the cure, for any other value. YAML makes a bool or a number of
    many a word; which word it was cannot be known any more.
    """
    if choices:
        if (text := str(value).lower()) in choices:
            return text
        raise ValueError(f'{name} = {value!r} should be one of {", ".join(choices)}')
    kind: type = type(default)
    taken = _taken_as(kind, name, value)
    if type(taken) is kind and _is_within(taken, low, high):
        return taken
    right = _KINDS[kind] + (f' from {low:.15g} to {high:.15g}' if low is not None else '')
    raise ValueError(f'{name} = {taken!r} {_what_is_right(name, taken, kind, right)}')


def _taken_as(kind: type, name: str, value: object) -> Any:
    """Return a value as another type where no meaning is lost."""
    if kind is float and type(value) is int:
        return float(value)
    if name in _STATION_LISTS and isinstance(value, list):  # a YAML list: [1, 2]
        return ','.join(map(str, value))
    return str(value) if name in _NUMBERED and type(value) in (int, float) else value


def _is_within(value: Any, low: float | None, high: float | None) -> bool:
    return low is None or high is None or low <= value <= high


def _what_is_right(name: str, value: object, kind: type, right: str) -> str:
    if isinstance(value, str) and type(_taken_as(kind, name, meant := read_yaml(value))) is kind:
        python = f', in Python {meant}' if kind is bool else ''
        return f'is a text and should be {right}: write it without quotes{python}'
    made = {bool: 'true or false of words such as on and no', int: 'a number of it',
            float: 'a number of it'}.get(type(value))
    if kind is not str or made is None:
        return f'should be {right}'
    cure = '' if name in _NUMBERED else (
        f'; leave {name} out, or write ./ before the name of a file')
    return f'should be {right}: YAML makes {made}{cure}'


def read_yaml(text: str) -> object:
    """Return what YAML makes of a text; the text itself if it makes nothing of it."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return text
