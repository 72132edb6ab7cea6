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

"""The arrows between the layers point one way, as the imports tell."""

import ast
import re
import subprocess
import sys

from support.cases import for_all

from tools.rooms import imports, MODULES, PACKAGE, room_of, ROOMS

_SANS_IO = {'time', 'threading', 'serial', 'select', 'socket', 'os', 'rclpy'}
# The shells that wait for signals, input or bytes; only one of them opens a port.
_WAITING = {'select', 'threading'}
_MAY_WAIT = ('signals.py', 'testing/', 'ports/', 'ros/lines.py', 'ros/process/main.py',
             'ros/callbacks.py', 'ros/parameters/file_watch.py', 'console.py', 'cli/simulator.py',
             'cli/sniff.py', 'open_line.py')


def _may_use_ros(module: str) -> bool:
    return module.startswith(('ros/', 'cli/monitor/')) or module in (
        'cli/demo.py', 'testing/cell.py')


def _is_ros(top: str) -> bool:
    return top.startswith(('rclpy', 'diagnostic_updater')) or top.endswith(('_msgs', '_srvs'))


def violations(module: str, source: str) -> list[str]:
    """Return every import of ``module`` (a path inside the package) that breaks a rule."""
    found = []
    room = room_of(module)
    for name in imports(module, source):
        top, _, inner = name.partition('.')
        if top == 'abdf1_ros':
            if not room.may_import(inner):
                found.append(f'{module} must not import {name}')
        elif room.is_pure and top in _SANS_IO:
            found.append(f'{module} has to do without {top}')
        elif _is_ros(top) and not _may_use_ros(module):
            found.append(f'only the node imports {top}, not {module}')
        elif top == 'serial' and not module.startswith('ports/'):
            found.append(f'only ports/ imports {top}, not {module}')
        elif top in _WAITING and not module.startswith(_MAY_WAIT):
            found.append(f'{module} has to do without {top}')
    return found


@for_all('module', MODULES)
def test_imports_follow_the_arrows(module: str) -> None:
    assert violations(module, (PACKAGE / module).read_text(encoding='utf-8')) == []


def imported(module: str) -> set[str]:
    """Return what a module imports of the package, by dotted names."""
    source = (PACKAGE / module).read_text(encoding='utf-8')
    return {name.removeprefix('abdf1_ros.') for name in imports(module, source)
            if name.startswith('abdf1_ros.')}


def test_rooms_allow_nothing_that_is_not_used() -> None:
    unused = []
    for room in ROOMS:
        used = set().union(*(imported(module) for module in MODULES if room.has(module)))
        unused += [(room.name, entry) for entry in room.allowed or () if not any(
            name == entry or name.startswith(f'{entry}.') for name in used)]
    assert unused == []


def circles(arrows: dict[str, set[str]]) -> set[str]:
    """Return those that reach themselves."""
    left = {name: {*to} for name, to in arrows.items()}
    while ends := {name for name, to in left.items() if not to & left.keys()}:
        left = {name: to for name, to in left.items() if name not in ends}
    return {*left}


def test_no_module_imports_itself_by_others() -> None:
    arrows = {module.removesuffix('.py').replace('/', '.'): imported(module) for module in MODULES}
    assert circles({name: to - {name} for name, to in arrows.items()}) == set()
    assert circles({'a': {'b'}, 'b': {'a'}, 'c': {'a'}, 'd': set()}) == {'a', 'b', 'c'}


@for_all('room', ['ros', 'driver', 'pccc', 'cli'])
def test_folders_of_a_room_import_one_way(room: str) -> None:
    arrows: dict[str, set[str]] = {}

    def place(name: str) -> str:
        return '.'.join(name.split('.')[:2])

    for module in MODULES:
        if module.startswith(f'{room}/'):
            name = module.removesuffix('.py').replace('/', '.')
            arrows.setdefault(place(name), set()).update(
                place(other) for other in imported(module) if other.startswith(f'{room}.'))
    assert circles({name: to - {name} for name, to in arrows.items()}) == set()


@for_all('module', MODULES)
def test_every_module_has_a_room(module: str) -> None:
    assert room_of(module).contents


def test_every_layer_is_looked_at() -> None:
    assert {'df1', 'pccc', 'errors.py', 'messages.py'} <= {m.split('/')[0] for m in MODULES}


@for_all(('module', 'source'), [(module, source) for module, sources in [
    ('df1/master.py', [
        'from abdf1_ros.pccc import slc', 'from abdf1_ros.driver.points import Point',
        'import abdf1_ros.pccc.slc.commands', 'from ..pccc import slc', 'from .. import pccc',
        'from abdf1_ros import pccc']),
    ('df1/new_module.py', [
        'def later():\n    import time', 'from os import path', 'import threading']),
    ('pccc/server.py', [
        'from abdf1_ros.df1 import frames', 'from abdf1_ros.df1.machine import Machine',
        'from abdf1_ros.df1 import Packet', 'import abdf1_ros.df1', 'import socket']),
    ('driver/agenda.py', [
        'import time', 'import select', 'from abdf1_ros.ports.link_thread import LinkThread',
        'from abdf1_ros.ros.node import Node', 'from std_msgs.msg import String']),
    ('driver/deep/inside.py', ['from abdf1_ros import port', 'from ...port import LinkThread']),
    ('messages.py', ['from abdf1_ros.errors import Abdf1Error']),
    ('errors.py', ['from abdf1_ros.df1 import packet']), ('counters.py', ['import time']),
    ('sniffer/traffic.py', [
        'import time', 'from abdf1_ros.ports.link_thread import Port',
        'from abdf1_ros.settings.network import Network']), ('sniffer/capture.py', ['import os']),
    ('cli/sniff.py', ['import rclpy']), ('cli/plc/command.py', ['import rclpy']),
    ('cli/check.py', ['from std_msgs.msg import String']),
    ('cli/plc/session.py', ['import serial', 'import rclpy']), ('plan/report.py', ['import time']),
    ('driver/requests.py', [
        'from abdf1_ros.ports.link_thread import LinkThread',
        'from abdf1_ros.cli.plc import session']),
    ('cli/simulator.py', ['import rclpy.node', 'import serial']),
    ('cli/demo.py', ['from threading import Thread']),
    ('cli/monitor/command.py', ['import threading']),
    ('ros/diagnostics/log.py', ['import threading']), ('paths.py', ['import rclpy']),
    ('ports/link_thread.py', ['from diagnostic_msgs.msg import DiagnosticStatus']),
    ('ports/trace.py', ['from abdf1_ros.driver.driver import Driver']),
    ('simulator/commands.py', ['import time']),
] for source in sources])
def test_import_against_the_arrows_is_found(module: str, source: str) -> None:
    assert len(violations(module, source)) == 1


@for_all(('module', 'source'), [(module, source) for module, sources in [
    ('df1/master.py', [
        'from abdf1_ros.df1 import frames', 'from . import frames',
        'from ..errors import LinkError', 'import math']),
    ('pccc/server.py', [
        'from abdf1_ros.df1.packet import Packet', 'from abdf1_ros.df1 import packet']),
    ('driver/agenda.py', [
        'from abdf1_ros.df1.master import HalfDuplexMaster',
        'from abdf1_ros.pccc import dialects']),
    ('ports/link_thread.py', ['import os, select, threading, time']),
    ('ports/serial_device.py', ['import serial']),
    ('ros/node.py', ['import rclpy\nfrom std_msgs.msg import String\nfrom abdf1_ros import port']),
    ('ros/parameters/a.py', ['from rcl_interfaces.msg import ParameterDescriptor\nimport rclpy']),
    ('ros/diagnostics/statuses.py', ['from diagnostic_msgs.msg import DiagnosticStatus']),
    ('cli/monitor/node.py', ['import rclpy\nfrom std_msgs.msg import String']),
    ('cli/simulator.py', ['import os, time\nfrom abdf1_ros.ports.link_thread import LinkThread']),
] for source in sources])
def test_import_along_the_arrows_is_let_through(module: str, source: str) -> None:
    assert violations(module, source) == []


def loaded_with(modules: str) -> list[str]:
    program = f'import sys, {modules}; print(*sys.modules)'
    return subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          check=True, timeout=60).stdout.split()


def test_commands_at_the_line_need_no_ros() -> None:
    loaded = loaded_with(', '.join(f'abdf1_ros.cli.{name}' for name in (
        'check', 'conform', 'plc.command', 'simulator', 'sniff')))
    assert not [name for name in loaded if _is_ros(name) or name.startswith('abdf1_ros.ros')]


def test_library_has_neither_ros_nor_files() -> None:
    loaded = loaded_with('abdf1_ros.client')
    assert 'abdf1_ros.driver.requests' in loaded
    unwanted = ('abdf1_ros.settings', 'abdf1_ros.plan', 'abdf1_ros.ros', 'abdf1_ros.cli.',
                'abdf1_ros.simulator', 'abdf1_ros.sniffer', 'yaml', 'rclpy', 'std_msgs')
    assert [name for name in loaded if name.startswith(unwanted)] == []


def test_only_what_shows_the_time_of_day_asks_for_it() -> None:
    """A wait by a clock that is set may last for ever."""
    asked = {module: len(re.findall(r'\btime\.time(?:_ns)?\b|\bdatetime\.now\b', (
        PACKAGE / module).read_text(encoding='utf-8'))) for module in MODULES}
    assert {module: count for module, count in asked.items() if count} == {
        'cli/monitor/node.py': 1, 'cli/plc/log_file.py': 1, 'cli/plc/reading.py': 1,
        'cli/plc/verbs/clock.py': 4, 'ports/trace.py': 1, 'readings.py': 2,
        'ros/bridge/session.py': 1, 'ros/process/main.py': 1, 'ros/topics/services.py': 1,
        'ros/topics/snapshot.py': 1, 'ros/topics/writes.py': 1}


def test_dataclasses_have_slots_and_are_frozen_unless_a_field_is_assigned() -> None:
    nodes = [node for module in MODULES for node in ast.walk(ast.parse(
        (PACKAGE / module).read_text(encoding='utf-8')))]
    assigned = {node.attr for node in nodes
                if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    for node in nodes:
        for made in node.decorator_list if isinstance(node, ast.ClassDef) else ():
            if ast.unparse(made).startswith('dataclass'):
                assert isinstance(made, ast.Call), node.name
                options = {option.arg: ast.literal_eval(option.value) for option in made.keywords}
                assert options.pop('slots') and not options.pop('eq', False), node.name
                assert all(options.values()), node.name
                fields = {ast.unparse(part.target) for part in node.body
                          if isinstance(part, ast.AnnAssign)}
                assert options.get('frozen') or fields & assigned, node.name


def test_no_test_replaces_a_private_name() -> None:
    """Find names in text, which ruff's SLF001 does not see."""
    texts = {path.name: path.read_text() for path in PACKAGE.parent.glob('test/**/*.py')}
    found = [(name, str(word.value)) for name, text in texts.items() if 'setattr' in text
             for call in ast.walk(ast.parse(text))
             if isinstance(call, ast.Call) and ast.unparse(call.func).endswith('setattr')
             for word in call.args[:2] if isinstance(word, ast.Constant)]
    assert sorted(entry for entry in found if re.search(r'(^|\.)_[^_]', entry[1])) == [
        ('test_main.py', '_exit'), ('test_runner.py', '_take_subscription')]
