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
The rooms of the package: their contents, and the imports that each may have.

``test/style/test_layers.py`` enforces it; CONTRIBUTING.md and docs/architecture.md show it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parent.parent / 'abdf1_ros'
MODULES = sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob('*.py')
                 if path != PACKAGE / '__init__.py')

_BASE = ('errors', 'messages', 'counters')


class Room(NamedTuple):
    """
    Folders or modules of one subject.

    - ``paths``: may contain ``*``.
    - ``allowed``: the modules of the package that the room may import beside its own, by the
      beginning of their dotted names; None for all.
    - ``is_pure``: the room has no clock, threads, ports and ROS; it gets the time as an argument.
    """

    paths: tuple[str, ...]
    contents: str
    allowed: tuple[str, ...] | None = None
    is_pure: bool = True

    @property
    def name(self) -> str:
        """Return the name of the room in tables."""
        return ', '.join(path if path.endswith('.py') else f'{path}/' for path in self.paths)

    def may_import(self, dotted: str) -> bool:
        """Return True if the room may import a module of the package."""
        own = (path.removesuffix('.py') for path in self.paths)
        return self.allowed is None or any(
            dotted == entry or dotted.startswith(f'{entry}.') for entry in (*self.allowed, *own))

    def has(self, module: str) -> bool:
        """Return True if a module (a path inside the package) is in the room."""
        top = module.split('/')[0]
        return any(fnmatch(top, path) for path in self.paths)


ROOMS = (
    Room(('messages.py', 'counters.py'), 'numbered errors and notices; status counters', ()),
    Room(('text.py', 'numbers.py', 'line_names.py'), 'text, numbers and names from outside', ()),
    Room(('errors.py', 'problems.py'), 'the exceptions; faults in texts of users',
         ('messages', 'text')),
    Room(('df1',), 'the link: frames, checksums, machine, stations; master, standard polling, '
                   'slave, peer', _BASE),
    Room(('pccc',), 'the commands: addresses, values, data table, server; a folder for each PLC '
         'family',
         ('errors', 'counters', 'text', 'df1.packet')),
    Room(('cip',), 'EtherNet/IP and CIP around a PCCC command: sessions, connections, identity',
         ('errors', 'pccc.fields')),
    Room(('sniffer',), 'recorded bytes, and traffic in words',
         ('problems', 'text', 'numbers', 'df1', 'pccc', 'cip')),
    Room(('diagnosis',), 'from what a line has shown to one cause and one next step',
         ('text', 'df1', 'sniffer')),
    Room(('settings',), 'both CSV files',
         ('errors', 'messages', 'problems', 'numbers', 'text', 'line_names', 'df1', 'pccc')),
    Room(('plan',), 'the read plan: blocks, their cost on the line, bounds and remarks',
         ('errors', 'problems', 'text', 'df1', 'pccc', 'settings')),
    Room(('ages.py',), 'the age of a message, as far as clocks can be trusted',
         ('errors', 'settings')),
    Room(('driver',), 'the plan carried out: order of commands, points, served words',
         (*_BASE, 'text', 'df1', 'pccc', 'settings', 'plan', 'sniffer')),
    Room(('ports',), 'ports, the thread that runs a link, recording and listening',
         ('errors', 'line_names', 'df1', 'settings', 'sniffer'), is_pure=False),
    Room(('share',), 'the line shared with other programs: a place for each guest',
         ('text', 'df1', 'cip', 'settings', 'driver', 'ports'), is_pure=False),
    Room(('simulator',), 'simulated PLCs and the commands that they take',
         ('errors', 'counters', 'problems', 'numbers', 'text', 'df1', 'pccc', 'settings')),
    Room(('conform',), 'cases of the manual, run against the far end of a line', ()),
    Room(('client.py', 'tagged_client.py', 'open_line.py', 'readings.py'),
         'a blocking client for programs without ROS',
         (*_BASE, 'problems', 'numbers', 'text', 'df1', 'pccc', 'settings', 'plan',
          'driver.requests', 'ports'), is_pure=False),
    Room(('paths.py', 'signals.py', 'console.py'),
         'places of installed files; the end after a signal; output without a wait',
         (), is_pure=False),
    Room(('ros',), 'the ROS node: parameters, messages, diagnostics, log', is_pure=False),
    Room(('testing',), 'fixtures of pytest: simulated PLCs; with a bridge and a watcher of both',
         is_pure=False),
    Room(('cli', '__main__.py'), 'the commands, one file or folder each', is_pure=False),
)


def room_of(module: str) -> Room:
    """Return the room of a module (a path inside the package); raises LookupError."""
    for room in ROOMS:
        if room.has(module):
            return room
    raise LookupError(f'{module} is in no room of tools/rooms.py')


def _exists(dotted: str) -> bool:
    path = PACKAGE.joinpath(*dotted.split('.'))
    return path.is_dir() or path.with_suffix('.py').is_file()


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements of a tree; most of a tree are expressions, which hold none."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield node
            yield from _statements(node)


@cache
def imports(module: str, source: str) -> tuple[str, ...]:
    """Return the absolute dotted name of everything that ``module`` imports."""
    return tuple(_imports(module, source))


def _imports(module: str, source: str) -> Iterator[str]:
    for node in _statements(ast.parse(source)):
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
