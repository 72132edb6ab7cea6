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
The rooms of the package: what is in each, and what it may import.

``test/test_layers.py`` enforces it; CONTRIBUTING.md and docs/architecture.md show it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parent.parent / 'abdf1_ros'
MODULES = sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob('*.py'))

_BASE = ('errors', 'messages', 'counters')


class Room(NamedTuple):
    """
    Folders or modules of one subject.

    ``paths`` may hold ``*``. ``allowed`` are the modules of the package that may be imported, by
    the beginning of their dotted names, beside the room's own; None stands for all.
    """

    paths: tuple[str, ...]
    contents: str
    allowed: tuple[str, ...] | None = None

    @property
    def name(self) -> str:
        """Return what tables call it."""
        return ', '.join(path if path.endswith('.py') else f'{path}/' for path in self.paths)

    def has(self, module: str) -> bool:
        """Tell whether a module (a path inside the package) is in it."""
        top = module.split('/')[0]
        return any(fnmatch(top, path) for path in self.paths)


ROOMS = (
    Room(('messages.py',), 'numbered errors and notices', ()),
    Room(('counters.py',), 'status counters', ()),
    Room(('text.py', 'numbers.py'), 'text and numbers from outside', ()),
    Room(('errors.py',), 'the exceptions', ('messages', 'text')),
    Room(('df1',), 'data-link layer: frames, checksums, machine, stations; master, standard '
                   'polling, slave, peer', _BASE),
    Room(('pccc',), 'application layer: addresses, commands of each PLC family, data table, '
                    'server', (*_BASE, 'text', 'df1.packet')),
    Room(('driver',), 'both CSV files, points, read planner, scheduler, served words, driver',
         (*_BASE, 'numerals', 'df1', 'pccc')),
    Room(('sniffer/capture.py',), 'the format of recorded bytes', ('errors', 'text', 'numerals')),
    Room(('sniffer/dumps.py',), 'recorded bytes from files of other kinds', ('errors', 'capture')),
    Room(('sniffer',), 'traffic told to people', ('errors', 'capture', 'df1', 'pccc')),
    Room(('cli/monitor/view.py',), 'the state of a running node as lines of text', ('text',)),
    Room(('ports/port.py',), 'opens a port, runs a link in its thread'),
    Room(('ports/endpoints.py',), 'lines that we make or open ourselves: pseudo-terminal, listening TCP '
                        'port, serial port'),
    Room(('ports/trace.py', 'ports/tap.py'), 'recording and listening on ports'),
    Room(('ros/node.py', 'node_*.py'), 'the ROS node: parameters, messages, diagnostics, log'),
    Room(('cli/simulator.py', 'simulator/commands.py', 'simulator/simulated_plc.py'),
         'PLCs on a line, to test against'),
    Room(('commissioning', 'cli/plc/command.py'), 'single questions to PLCs: the command `plc`'),
    Room(('cli/sniff.py', 'cli/check.py'), 'the commands of these names'),
    Room(('cli/monitor/command.py', 'cli/monitor/node.py'), 'the command `monitor`'),
    Room(('cli/demo.py',), 'starts node and simulator together'),
    Room(('cli/main.py',), 'entry points that end quietly while they still import'),
    Room(('paths.py', 'cli/terminal.py'), 'installed files; what commands print on a terminal'),
)

ALLOWED = {path: (*room.allowed, *room.paths) for room in ROOMS if room.allowed is not None
           for path in room.paths}
"""What may be imported, by folder or module; others may import everything."""


def room_of(module: str) -> Room:
    """Return the room of a module (a path inside the package); LookupError where none has it."""
    for room in ROOMS:
        if room.has(module):
            return room
    raise LookupError(f'{module} is in no room of tools/rooms.py')


def _exists(dotted: str) -> bool:
    path = PACKAGE.joinpath(*dotted.split('.'))
    return path.is_dir() or path.with_suffix('.py').is_file()


def imports(module: str, source: str) -> Iterator[str]:
    """Yield the absolute dotted name of everything that ``module`` imports."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                folder = ['abdf1_ros', *module.split('/')[:-1]]
                parts = folder[:len(folder) - node.level + 1]
                base = '.'.join([*parts, base] if base else parts)
            for alias in node.names:
                inner = f'{base}.{alias.name}'.removeprefix('abdf1_ros.')
                is_module = base.split('.')[0] == 'abdf1_ros' and _exists(inner)
                yield f'{base}.{alias.name}' if is_module else base
