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
The PLC's side of heartbeats, as a small program on the words of a simulated PLC.

This is the ladder of docs/tutorials/heartbeats.md; comments give the numbers of the rungs.

- N10, written by the bridge: word 0 its heartbeat, words 1 and 2 commands.
- N11, written by the program: word 0 the snapshot of the heartbeat, word 1 the snapshot before.
  Words 2 and 4 are the commands that the machine may use. Word 3 is the heartbeat of the program.
- T13: timer 0 watchdog, timer 1 stable, timer 2 the program's clock.
- B12:0: the lamps.

The program runs only at its scans, so it may miss a value that lasts less than a scan. The timers
have a time base of 10 ms, and count from the scan that starts them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.settings.heartbeats import STABLE, TIME_BASE

USUAL_PRESET = 300
"""Preset of the watchdog in units of the time base: 3 s."""

_SCAN_TIME = 0.01  # s
_PLC_HEARTBEAT = 10
_LAST_COUNT = 32000
_COMMANDS = {1: 2, 2: 4}  # word of N10 with a command: word of N11 that the machine uses

# After a pause, the simulator makes up the missed scans of at most this time (s). Earlier scans
# would not change the result.
_LONGEST_PAUSE = 60.0

_ROUNDING = 1e-6

_DONE, _TIMING, _ENABLED = 1 << 13, 1 << 14, 1 << 15
_FIRST_PASS = 1 << 15  # S:1/15


class Lamp(IntEnum):
    """Bits of B12:0."""

    CHANGED = 0
    ALIVE = 1
    IN_CONTROL = 2
    RESET = 3
    STOPPED = 4
    LOST = 5


@dataclass(slots=True)
class _Timer:
    """A TON: counts time (s) while its rung is true, and is done at its preset."""

    preset: int
    time: float = 0.0
    is_done: bool = False
    is_enabled: bool = False

    def scan(self, is_true: bool, passed: float = 0.0) -> None:
        """Update the timer from the state of its rung, ``passed`` s after the last scan."""
        self.time = self.time + passed if is_true and self.is_enabled else 0.0
        self.is_enabled = is_true
        self.is_done = is_true and self.accumulated >= self.preset

    @property
    def accumulated(self) -> int:
        """Return the time in units of the time base."""
        return min(int(self.time / TIME_BASE + _ROUNDING), self.preset)

    @property
    def words(self) -> tuple[int, int, int]:
        """Return control word, preset and accumulated value."""
        control = _DONE * self.is_done | _ENABLED * self.is_enabled
        return control | _TIMING * (self.is_enabled and not self.is_done), self.preset, \
            self.accumulated


class Ladder:
    """
    The program of one PLC.

    - ``preset``: preset of the watchdog in units of 10 ms.
    - ``scan_time``: seconds.
    - ``on_lamp``: called at every change of a lamp, with time (s), lamp and new state.

    Raises NoSuchFile if a file of the program has a wrong type.
    """

    def __init__(self, table: DataTable, preset: int = USUAL_PRESET,
                 on_lamp: Callable[[float, Lamp, bool], None] = lambda at, lamp, on: None,
                 scan_time: float = _SCAN_TIME) -> None:
        self.scan_time = scan_time
        self._table = table
        self._addressing = FAMILIES[table.plc_type].addressing
        self._on_lamp = on_lamp
        self._watchdog = _Timer(preset)
        self._stable = _Timer(preset + STABLE)
        self._clock = _Timer(_PLC_HEARTBEAT)
        self._lamps = 0
        self._button = False  # True while pressed
        self._button_before = True  # for OSR: a button that stays pressed has no edge
        self._is_first_pass = True
        self._next_scan: float | None = None
        for kind, file, words in ((FileType.INTEGER, 10, 3), (FileType.INTEGER, 11, 5),
                                  (FileType.BINARY, 12, 2), (FileType.TIMER, 13, 9)):
            table.create(Address(self._addressing, kind, file, 0), words)

    def is_on(self, lamp: Lamp) -> bool:
        """Return True if a lamp is on."""
        return bool(self._lamps >> lamp & 1)

    def press_reset(self) -> None:
        """Press the reset button, for one scan."""
        self._button = True

    def enter_run(self, now: float) -> None:
        """Start to run after PROGRAM, a download or power-up: OTE and TON start at rest."""
        for timer in (self._watchdog, self._stable, self._clock):
            timer.scan(False)
        self._light(0, now)
        self._button_before, self._is_first_pass = True, True
        self._next_scan = now

    def advance(self, now: float) -> None:
        """Make the scans that are due."""
        if self._next_scan is None:
            self.enter_run(now)
        assert self._next_scan is not None
        self._next_scan = max(self._next_scan, now - _LONGEST_PAUSE)
        while self._next_scan <= now:
            self._scan(self._next_scan)
            self._next_scan += self.scan_time

    def _scan(self, now: float) -> None:
        self._show_first_pass()
        before, heartbeat = self.get(11, 1), self.get(10, 0)
        commands = {used: self.get(10, word) for word, used in _COMMANDS.items()}
        self.put(11, 0, heartbeat)  # 0
        is_changed = heartbeat != before  # 1
        self.put(11, 1, heartbeat)  # 2
        self._watchdog.scan(not is_changed, self.scan_time)  # 3
        is_alive = (is_changed or self.is_on(Lamp.ALIVE)) and 0 < heartbeat < 0x8000 \
            and not self._watchdog.is_done and not self._is_first_pass  # 4
        self._stable.scan(is_alive, self.scan_time)  # 5
        is_reset = self._button and not self._button_before  # 6
        in_control = is_alive and (
            is_reset and self._stable.is_done and not any(commands.values())
            or self.is_on(Lamp.IN_CONTROL))  # 7
        for used, command in commands.items():
            self.put(11, used, command if in_control else 0)  # 8, 9
        lamps = {Lamp.CHANGED: is_changed, Lamp.ALIVE: is_alive, Lamp.IN_CONTROL: in_control,
                 Lamp.RESET: is_reset, Lamp.STOPPED: heartbeat == 0,  # 10
                 Lamp.LOST: self._watchdog.is_done}  # 11
        self._clock.scan(not self._clock.is_done, self.scan_time)  # 12
        count = self.get(11, 3)
        if count >= _LAST_COUNT:  # 13
            count = 0
        self.put(11, 3, count + self._clock.is_done)  # 14
        self._light(sum(is_on << lamp for lamp, is_on in lamps.items()), now)
        for number, timer in enumerate((self._watchdog, self._stable, self._clock)):
            for word, value in enumerate(timer.words):
                self._write(FileType.TIMER, 13, number, value, word)
        self._button_before, self._button = self._button, False
        self._is_first_pass = False

    def _light(self, lamps: int, now: float) -> None:
        changed, self._lamps = self._lamps ^ lamps, lamps
        self._write(FileType.BINARY, 12, 0, lamps)
        for lamp in Lamp:
            if changed >> lamp & 1:
                self._on_lamp(now, lamp, self.is_on(lamp))

    def _show_first_pass(self) -> None:
        place = Address(self._addressing, FileType.STATUS, 2, 1)
        with suppress(NoSuchFile, OutOfRange):  # a data table may lack the status file
            self._table.write_bits(place, _FIRST_PASS, _FIRST_PASS * self._is_first_pass)

    def get(self, file: int, element: int) -> int:
        place = Address(self._addressing, FileType.INTEGER, file, element)
        return int.from_bytes(self._table.read(place, 1), 'little')

    def put(self, file: int, element: int, value: int) -> None:
        self._write(FileType.INTEGER, file, element, value)

    def _write(self, kind: FileType, file: int, element: int, value: int, word: int = 0) -> None:
        place = Address(self._addressing, kind, file, element, word)
        self._table.write(place, value.to_bytes(2, 'little'))
