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

"""Faults of users' files, parameters and options."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.errors import Abdf1Error
from abdf1_ros.messages import Message
from abdf1_ros.text import printable


@dataclass(frozen=True, slots=True)
class Place:
    """
    A place in a file; lines, and the cells of a line, are counted from 1.

    ``file`` may also be the name of a parameter or an option of a user.
    """

    file: str
    line: int | None = None
    cell: int | None = None
    column: str | None = None

    def __str__(self) -> str:
        """Return "file:line:cell (column)", without the parts that are not known."""
        numbers = ''.join(f':{number}' for number in (self.line, self.cell) if number)
        return f'{self.file}{numbers}' + (f' ({self.column})' if self.column else '')


class Problem(Abdf1Error):
    """
    One fault in a file or parameter that a user wrote.

    ``place`` is the place of the fault, ``text`` says what is wrong and what would be right.
    ``message`` is its numbered entry, None if the specification has none. Without ``args`` the
    text of the entry would be false, so only number and mnemonic are shown. Without ``text`` the
    text of the entry is the whole description. A problem is shown as one visible line, whatever
    the file contains.
    """

    def __init__(self, where: Place | str, text: str, message: Message | None = None,
                 args: tuple[object, ...] = ()) -> None:
        entry = f'{message.number} {message.name}: ' if message else ''
        if message and args:
            entry = message.entry(*args) + ('; ' if text else '')
        super().__init__(printable(f'{where}: {entry}{text}'))
        self.place = where if isinstance(where, Place) else Place(where)
        self.text = text
        self.message = message


class ConfigurationError(Abdf1Error):
    """All faults that prevent the start of the driver."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__('\n'.join(str(problem) for problem in problems))
        self.problems = problems
