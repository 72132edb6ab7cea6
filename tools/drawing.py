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

"""The drawing of docs/architecture.md: the imports between rooms, read from the code."""

from __future__ import annotations

from functools import cache

from tools.rooms import imports, MODULES, PACKAGE, Room, room_of, ROOMS

Arrows = dict[Room, set[Room]]


@cache
def arrows() -> Arrows:
    """Return the rooms that each room imports."""
    found: Arrows = {room: set() for room in ROOMS}
    for module in MODULES:
        source = (PACKAGE / module).read_text(encoding='utf-8')
        for name in imports(module, source):
            top, _, inner = name.partition('.')
            if top == 'abdf1_ros' and inner:
                found[room_of(module)].add(_room_of_name(inner))
    return {room: targets - {room} for room, targets in found.items()}


def _room_of_name(inner: str) -> Room:
    top = inner.split('.')[0]
    return room_of(top if (PACKAGE / top).is_dir() else f'{top}.py')


def _reachable(found: Arrows, start: Room) -> set[Room]:
    """Return every room that ``start`` imports, also indirectly."""
    reached: set[Room] = set()
    waiting = [start]
    while waiting:
        new = found[waiting.pop()] - reached
        reached |= new
        waiting += new
    return reached


def reduced(found: Arrows) -> Arrows:
    """Return the arrows without those that a longer path implies."""
    return {room: {target for target in targets if not any(
        target in _reachable(found, other) for other in targets - {target})}
        for room, targets in found.items()}


def mermaid() -> str:
    """Return the drawing for Markdown."""
    names = {room: f'r{number}' for number, room in enumerate(ROOMS)}
    lines = ['```mermaid', 'graph TD']
    lines += [f'    {name}["{"<br>".join(room.name.split(", "))}"]'
              for room, name in names.items()]
    for room, targets in reduced(arrows()).items():
        lines += [f'    {names[room]} --> {names[target]}'
                  for target in sorted(targets, key=ROOMS.index)]
    return '\n'.join([*lines, '```'])
