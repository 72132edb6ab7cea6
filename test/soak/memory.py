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

"""How much an object keeps alive."""

from __future__ import annotations

from collections import deque
import gc
from types import ModuleType
from typing import Any

from abdf1_ros.df1.frames import MAX_WAITING


def container_lengths(root: object) -> dict[str, int]:
    """Return the length of the longest container of each kind that ``root`` keeps alive."""
    found: dict[str, int] = {}
    seen = {id(root)}
    waiting: deque[Any] = deque([root])
    while waiting:
        thing = waiting.popleft()
        if isinstance(thing, bytearray):
            assert len(thing) <= MAX_WAITING
        elif isinstance(thing, list | dict | set | deque):
            name = type(thing).__name__
            found[name] = max(found.get(name, 0), len(thing))
        for inner in gc.get_referents(thing):
            is_ours = not isinstance(inner, type | ModuleType) and not _is_namespace(inner)
            if is_ours and id(inner) not in seen:
                seen.add(id(inner))
                waiting.append(inner)
    return found


def _is_namespace(thing: object) -> bool:
    """Tell the globals of a module, by which every function keeps everything alive."""
    return isinstance(thing, dict) and '__builtins__' in thing
