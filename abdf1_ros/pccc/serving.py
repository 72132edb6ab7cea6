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

"""What the server needs of a PLC family: its commands, and how it refuses bad ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from abdf1_ros.pccc import status
from abdf1_ros.pccc.fields import Reader

Commands = dict[tuple[int, int], Callable[[Reader], bytes]]
"""Functions by CMD and FNC. They take the parameters from a reader and return the reply's data."""

BasicCommand = Callable[[Reader, int], bytes]
"""A function for a command without FNC; the second argument is the command's SRC."""

BasicCommands = dict[int, BasicCommand]
"""Functions by CMD, for commands without FNC."""

Codes = tuple[int, int | None]
"""STS and EXT STS."""


class Refusal(Exception):
    """A command is answered with this STS (and EXT STS) instead of data."""

    def __init__(self, sts: int, ext_sts: int | None = None) -> None:
        super().__init__(sts, ext_sts)
        self.sts = sts
        self.ext_sts = ext_sts

    def __str__(self) -> str:
        """Return the meaning of the codes."""
        return status.status_text(self.sts, self.ext_sts)


def extended(ext_sts: int) -> Refusal:
    """Return the refusal with this EXT STS."""
    return Refusal(status.EXTENDED, ext_sts)


class ServedFamily(Protocol):
    """
    The commands of a family, and its answers to addresses that do not exist.

    ``protected`` is the answer to a write of words that may only be read.
    """

    commands: Commands
    basic_commands: BasicCommands
    no_such_file: Codes
    out_of_range: Codes
    protected: Codes
