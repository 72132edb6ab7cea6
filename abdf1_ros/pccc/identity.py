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
The identity of a processor or module: its reply to a diagnostic status command (06/03).

The module ``identity`` in the folder of a family has its layouts. ``gateways`` has the layouts of
gateways and computer cards. ``families`` finds the layout of a reply.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from abdf1_ros.pccc.diagnostics import ReadCounters
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.link_counters import CounterLayout
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.text import printable


class Mode(Enum):
    """The mode of a processor, in the words of its programming software."""

    REMOTE_RUN = 'REM RUN'
    RUN = 'RUN'
    REMOTE_PROGRAM = 'REM PROG'
    PROGRAM = 'PROG'
    REMOTE_TEST = 'REM TEST'
    REMOTE_TEST_SCAN = 'REM TEST, single scan'
    REMOTE_TEST_STEP = 'REM TEST, step'
    TEST = 'TEST'
    REMOTE_SUSPEND = 'REM SUSPEND'
    SUSPEND = 'SUSPEND'
    REMOTE_DOWNLOAD = 'REM DOWNLOAD'
    DOWNLOAD = 'DOWNLOAD'

    @property
    def is_running(self) -> bool:
        """Tell whether the program runs and drives outputs; in a test mode it does not."""
        return self in (Mode.REMOTE_RUN, Mode.RUN)

    @property
    def words(self) -> str:
        """Return the name of the mode for a sentence."""
        return _MODE_WORDS[self.value.removeprefix('REM ').partition(',')[0]]


_MODE_WORDS = {'RUN': 'run', 'PROG': 'program', 'TEST': 'test', 'SUSPEND': 'suspend',
               'DOWNLOAD': 'download'}

# Bytes of the counters of a module: each counter is one byte, in an order of its own (M 9-10).
_MODULE_COUNTERS = 55


@dataclass(frozen=True, slots=True)
class Inquiry:
    """A second request to a station, and the identity that its reply completes."""

    request: Request
    answered: Callable[[bytes], Identity]


@dataclass(frozen=True, slots=True)
class Identity:
    """
    The type of a station, its mode, and its faults.

    - ``plc_type``: None if the family is unknown.
    - ``mode``: None if the reply has no mode, or a mode without a name; its code is then in
      ``mode_text``.
    - ``faults``: faults because of which a processor does not run its program; ``remarks``: other
      facts.
    - ``name``: the processor's own name, with control characters made visible.
    - ``memory``: in the processor's own unit, empty if it does not say.
    - ``interface``: code of the port that was asked.
    - ``counter_layout``: layout of its counters. Without one they are ``counter_size`` bytes at
      ``counter_address``.
    - ``processor``: its name in the map file, None if the map file has none.
    - ``inquiry``: a request that tells more about a fault.
    - ``has_no_processor``: it is a gateway or a computer card.
    """

    plc_type: PlcType | None
    model: str
    series: str = ''
    revision: str = ''
    mode: Mode | None = None
    mode_text: str = ''
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    name: str = ''
    program_id: int | None = None
    memory: str = ''
    interface: int | None = None
    counter_address: int = 0
    counter_size: int = _MODULE_COUNTERS
    processor: Processor | None = None
    counter_layout: CounterLayout | None = None
    inquiry: Inquiry | None = field(default=None, compare=False)
    has_no_processor: bool = False

    @property
    def counters(self) -> ReadCounters:
        """Return the command that reads the counters of the port that was asked."""
        if self.counter_layout is not None:
            return ReadCounters(0, 2 * len(self.counter_layout))
        return ReadCounters(self.counter_address, self.counter_size)

    @property
    def is_running(self) -> bool | None:
        """Tell whether the program runs, None where the reply does not say."""
        return None if self.mode is None else self.mode.is_running

    def __str__(self) -> str:
        """Return one line such as "SLC 5/03 series B revision 3, REM RUN"."""
        text = self.model
        if self.series:
            text += f' series {self.series} revision {self.revision}'
        return f'{text}, {self.mode_text}' if self.mode_text else text


def mode_of(modes: dict[int, Mode], code: int) -> tuple[Mode | None, str]:
    """Return a mode and its text; without a name the text is the code."""
    mode = modes.get(code)
    return mode, mode.value if mode else f'mode 0x{code:02X}'


def code_of(modes: dict[int, Mode], mode: Mode) -> int:
    """Return the code of a mode that is among ``modes``."""
    return next(code for code, known in modes.items() if known is mode)


def release(byte: int) -> tuple[str, str]:
    """Return series and revision where releases are counted from 1 (M 10-4)."""
    return _letter(byte >> 5), str((byte & 0x1F) + 1)


def letters(byte: int) -> tuple[str, str]:
    """Return series and revision where each is a letter (M 10-22)."""
    return _letter(byte >> 5), _letter(byte & 0x1F)


def _letter(number: int) -> str:
    return chr(ord('A') + number) if number < 26 else str(number)


def word_at(data: bytes, at: int) -> int:
    """Return 16 bits, low byte first."""
    return int.from_bytes(data[at:at + 2], 'little')


def name_in(data: bytes) -> str:
    """Return a name that is safe to show, whatever the bytes are."""
    return printable(data.partition(b'\0')[0].decode('latin-1').strip())


def named(conditions: dict[str, int]) -> tuple[str, ...]:
    """Return the names whose condition holds."""
    return tuple(name for name, holds in conditions.items() if holds)
