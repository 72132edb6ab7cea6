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
What a command addresses: the kinds of memory and functions that a right may be given for.

The module ``targets`` in the folder of a family finds the target in the bytes of its commands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor

CLOCK_WORDS = 6  # year, month, day, hour, minute, second


class Target(Enum):
    """A kind of place that a command addresses; the value is its name on pages."""

    DATA = 'data files'
    CLOCK = 'clock in the S file'
    STATUS = 'other words of the S file'
    FUNCTION = 'function files'
    FILE_LIST = 'list of the files'
    PORT = 'port of the PLC'
    OTHER = 'anything else'


@dataclass(frozen=True, slots=True)
class Partner:
    """
    The knowledge of the station that a command goes to.

    - ``families``: of its rows. If there is none, or more than one, an address counts in each
      form that it can have.
    - ``clocks``: the first words of the clocks that PLCs of these families have.
    - ``processor``: of an SLC or MicroLogix, None if it is not known.
    - ``sender``: our number; a PLC-5 executes a command of a PLC-2 on the file of this number.
    """

    families: frozenset[PlcType] = frozenset()
    clocks: tuple[Address, ...] = ()
    processor: Processor | None = None
    sender: int = 0

    def may_be(self, family: PlcType) -> bool:
        """Tell whether the station may be a PLC of this family."""
        return len(self.families) != 1 or family in self.families


@dataclass(frozen=True, slots=True)
class Reach:
    """
    The targets that commands of one form can have: ``kinds``.

    ``find`` returns the targets of one command, whose parameters it takes off a reader. It returns
    none for a command that cannot be read, or raises FormatError.
    """

    form: str
    kinds: tuple[Target, ...]
    find: Callable[[Reader, Partner], Iterable[Target]]


UNKNOWN = Reach('', (Target.OTHER,), lambda reader, partner: (Target.OTHER,))
"""The reach of a command whose form is not known."""


def in_status_file(first: int, words: int, clocks: Iterable[Address]) -> Target:
    """Return the target of words of an S file: the clock if each of ``clocks`` has them all."""
    has_all = [clock.element <= first and first + words <= clock.element + CLOCK_WORDS
               for clock in clocks]
    return Target.CLOCK if has_all and all(has_all) else Target.STATUS
