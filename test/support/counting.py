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

from __future__ import annotations

from collections.abc import Callable
import sys
from types import FrameType
from typing import Any


def lines_run(work: Callable[[], object], within: str = 'abdf1_ros') -> int:
    """Return how many lines of files in the folder ``within`` are run by ``work``."""
    count = 0

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        if f'/{within}/' not in frame.f_code.co_filename:
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
