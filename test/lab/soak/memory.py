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
from collections.abc import Iterator
import gc
import sys
from types import ModuleType
from typing import Any

from abdf1_ros.df1.frames import MAX_WAITING


def container_lengths(root: object) -> dict[str, int]:
    """Return the length of the longest container of each kind that ``root`` keeps alive."""
    found: dict[str, int] = {}
    for thing in _kept([root]):
        if isinstance(thing, bytearray):
            assert len(thing) <= MAX_WAITING
        elif isinstance(thing, list | dict | set | deque):
            name = type(thing).__name__
            found[name] = max(found.get(name, 0), len(thing))
    return found


def kept_bytes(root: object) -> int:
    """Return the bytes that ``root`` keeps alive, with all that is in modules of the package."""
    ours = [thing for name, module in sys.modules.items() if name.startswith('abdf1_ros')
            for thing in vars(module).values()]
    return sum(map(sys.getsizeof, _kept([root, *ours])))


def _kept(roots: list[Any]) -> Iterator[Any]:
    """Yield the ``roots`` and all that they refer to, but no types, modules and their globals."""
    seen: set[int] = set()
    waiting = deque(roots)
    while waiting:
        thing = waiting.popleft()
        is_ours = not isinstance(thing, type | ModuleType) and not _is_namespace(thing)
        if is_ours and id(thing) not in seen:
            seen.add(id(thing))
            yield thing
            waiting.extend(gc.get_referents(thing))


def _is_namespace(thing: object) -> bool:
    """Tell the globals of a module, by which every function keeps everything alive."""
    return isinstance(thing, dict) and '__builtins__' in thing
