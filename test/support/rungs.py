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
Rungs as text, run as a processor would run them: what a page tells people to type is tested.

One line is a rung: its number, instructions, and after ``;`` a remark. ``[a | b]`` is a branch. An
operand is an address, a number, or a name: ``preset`` and whatever else is given as ``names``,
and ``reset-button``, an input. Anything else on a line is an error, as is an overflow, which
would fault an SLC. The instructions are those that the pages use, with the habits of an SLC: TON
and OTE are cleared when the program begins to run, and a pressed button gives no edge then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re

from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.simulator.ladder import Ladder, Lamp, USUAL_PRESET

HEARTBEATS_PAGE = Path(__file__).parents[2] / 'docs' / 'tutorials' / 'heartbeats.md'

_OPERANDS = {'XIC': 1, 'XIO': 1, 'EQU': 2, 'NEQ': 2, 'GRT': 2, 'GEQ': 2, 'OSR': 1, 'ONS': 1,
             'OTE': 1, 'MOV': 2, 'CLR': 1, 'ADD': 3, 'TON': 5}
_COMPARISONS: dict[str, Callable[[int, int], bool]] = {
    'EQU': int.__eq__, 'NEQ': int.__ne__, 'GRT': int.__gt__, 'GEQ': int.__ge__}
_BUTTON = 'reset-button'

_Place = tuple[bytearray, int, int | None]  # the words of a file, the first byte there, the bit


@dataclass(frozen=True, slots=True)
class Instruction:
    """One instruction and its operands."""

    name: str
    operands: tuple[str, ...]


Branch = tuple['Series', ...]
Series = tuple[Instruction | Branch, ...]


def rungs_of(page: Path = HEARTBEATS_PAGE) -> list[str]:
    """Return the rungs of a page: the numbered lines of the block that begins with rung 0."""
    block = next(block for block in page.read_text(encoding='utf-8').split('```')
                 if block.strip().startswith('0  '))
    lines = [line for line in block.splitlines() if line.strip()]
    for number, line in enumerate(lines):
        assert line.split()[0] == str(number), f'rung {number} is missing before "{line}"'
    return lines


def parse(line: str) -> Series:
    """Return the instructions of a rung; raise ValueError where one is not known."""
    tokens = re.findall(r'[\[\]|]|[^\s\[\]|]+', line.partition(';')[0])[1:]
    found, rest = _series(tokens)
    if rest:
        raise ValueError(f'"{rest[0]}" is too much in "{line.strip()}"')
    return found


def _series(tokens: list[str]) -> tuple[Series, list[str]]:
    found: list[Instruction | Branch] = []
    while tokens and tokens[0] not in '|]':
        if tokens[0] == '[':
            branches: list[Series] = []
            while tokens[0] in '[|':
                branch, tokens = _series(tokens[1:])
                branches.append(branch)
            found.append(tuple(branches))
            tokens = tokens[1:]
            continue
        name = tokens[0]
        if name not in _OPERANDS:
            raise ValueError(f'"{name}" is not an instruction')
        count = _OPERANDS[name]
        if tokens[1 + count:2 + count] == ['+']:
            count += 2
        found.append(Instruction(name, tuple(tokens[1:1 + count])))
        tokens = tokens[1 + count:]
    return tuple(found), tokens


def _instructions(series: Series) -> Iterator[Instruction]:
    for part in series:
        if isinstance(part, Instruction):
            yield part
        else:
            for branch in part:
                yield from _instructions(branch)


class PageLadder(Ladder):
    """
    A ladder whose rungs are those of a page.

    ``before_rung`` is called before each rung with its number: what it writes comes in the middle
    of a scan.
    """

    def __init__(self, table: DataTable, preset: int = USUAL_PRESET,
                 on_lamp: Callable[[float, Lamp, bool], None] = lambda at, lamp, on: None,
                 scan_time: float = 0.01, lines: Sequence[str] | None = None,
                 names: Mapping[str, int] | None = None) -> None:
        super().__init__(table, preset, on_lamp, scan_time)
        self.before_rung: Callable[[int], None] = lambda number: None
        self._names = {'preset': preset} | dict(names or {})
        self._rungs = [parse(line) for line in lines or rungs_of()]
        self._places: dict[str, _Place] = {}
        self._times: dict[str, float] = {}  # s that each TON has counted

    def enter_run(self, now: float) -> None:
        """Begin to run: outputs and timers are cleared, a button that is pressed has no edge."""
        super().enter_run(now)
        for rung in self._rungs:
            for entry in _instructions(rung):
                if entry.name in ('OTE', 'OSR', 'ONS'):
                    self._set_bit(entry.operands[0], entry.name != 'OTE')
                elif entry.name == 'TON':
                    self._time(entry.operands, False)

    def _scan(self, now: float) -> None:
        self._show_first_pass()
        for number, rung in enumerate(self._rungs):
            self.before_rung(number)
            self._solve(rung, True)
        self._is_first_pass = self._button = False
        changed = self._lamps ^ (lamps := self._word('B12:0'))
        self._lamps = lamps
        for lamp in Lamp:
            if changed >> lamp & 1:
                self._on_lamp(now, lamp, self.is_on(lamp))

    def _solve(self, series: Series, is_true: bool) -> bool:
        """Return whether power flows to the end of a series."""
        for part in series:
            if isinstance(part, Instruction):
                is_true = self._execute(part, is_true)
            else:
                # All of them: those after a true one may have outputs.
                is_true = max(list(map(partial(self._solve, is_true=is_true), part)))
        return is_true

    def _execute(self, entry: Instruction, is_true: bool) -> bool:
        name, operands = entry.name, entry.operands
        if name in ('XIC', 'XIO'):
            is_set = self._button if operands[0] == _BUTTON else self._bit(operands[0])
            return is_true and is_set is (name == 'XIC')
        if name in _COMPARISONS:
            return is_true and _COMPARISONS[name](*map(self._value, operands))
        if name in ('OSR', 'ONS'):
            was_true = self._bit(operands[0])
            self._set_bit(operands[0], is_true)
            return is_true and not was_true
        if name == 'OTE':
            self._set_bit(operands[0], is_true)
        elif name == 'TON':
            self._time(operands, is_true)
        elif is_true:
            self._move(name, operands)
        return is_true

    def _move(self, name: str, operands: Sequence[str]) -> None:
        *sources, place = operands
        value = sum(map(self._value, sources))  # MOV has one, ADD two, CLR none
        if not -0x8000 <= value < 0x8000:
            raise OverflowError(f'{name} {" ".join(operands)}: {value} sets S:5/0')
        self._store(place, value & 0xFFFF)

    def _time(self, operands: Sequence[str], is_true: bool) -> None:
        """Let a timer count; from the scan on in which its rung becomes true."""
        name, base, pre, equals, *preset = operands
        assert (pre, equals) == ('PRE', '='), operands
        limit = sum(self._value(word) for word in preset if word != '+')
        is_enabled = self._bit(f'{name}/EN')
        self._times[name] = self._times.get(name, 0.0) + self.scan_time \
            if is_true and is_enabled else 0.0
        count = min(int(self._times[name] / float(base) + 1e-6), limit)
        self._set_bit(f'{name}/EN', is_true)
        self._set_bit(f'{name}/TT', is_true and count < limit)
        self._set_bit(f'{name}/DN', is_true and count >= limit)
        self._store(f'{name}.PRE', limit)
        self._store(f'{name}.ACC', count)

    def _place(self, text: str) -> _Place:
        if text not in self._places:
            address = parse_address(text, self._table.plc_type)
            self._places[text] = (*self._table.find(address, 1), address.bit)
        return self._places[text]

    def _word(self, text: str) -> int:
        store, at, _ = self._place(text)
        return store[at] | store[at + 1] << 8

    def _value(self, text: str) -> int:
        """Return a constant, or a word with its sign."""
        if text not in self._names and re.fullmatch(r'-?\d+', text):
            self._names[text] = int(text)
        if text in self._names:
            return self._names[text]
        word = self._word(text)
        return word - 0x10000 if word & 0x8000 else word

    def _bit(self, text: str) -> bool:
        bit = self._place(text)[2]
        assert bit is not None, text
        return bool(self._word(text) >> bit & 1)

    def _set_bit(self, text: str, is_set: bool) -> None:
        bit = self._place(text)[2]
        assert bit is not None, text
        self._store(text, self._word(text) & ~(1 << bit) | is_set << bit)

    def _store(self, text: str, value: int) -> None:
        store, at, _ = self._place(text)
        store[at:at + 2] = value.to_bytes(2, 'little')
