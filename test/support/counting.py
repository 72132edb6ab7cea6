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

"""How much work something is: instructions of the interpreter, which no load changes."""

from collections.abc import Callable
from contextlib import suppress
import os
from pathlib import Path
import sys
from types import FrameType
from typing import Any

import abdf1_ros

PACKAGE = Path(abdf1_ros.__file__).parent


def lines_run(work: Callable[[], object], room: str) -> int:
    """Return how many lines of a ``room`` of the package are run by ``work``."""
    count, folder = 0, f'{PACKAGE / room}/'

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        if not frame.f_code.co_filename.startswith(folder):
            return None
        return take

    def take(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal count
        count += event == 'line'
        return take

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


def open_files() -> set[tuple[str, str]]:
    """Return number and name of each descriptor of this process; others may come and go."""
    found = set()
    for number in os.listdir('/proc/self/fd'):
        with suppress(FileNotFoundError):  # that of the folder
            found.add((number, os.readlink(f'/proc/self/fd/{number}')))
    return found
