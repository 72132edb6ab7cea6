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

"""Deployment files: what can be checked of them without installing them."""

import configparser
import contextlib
from fnmatch import fnmatch
import importlib
import itertools
import json
import os
from pathlib import Path
import re
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
from typing import Any
from unittest import mock

from abdf1_ros.cli.main import COMMANDS
import pytest
from support.cases import for_all
from support.ros import get_parameters, Observer, PATIENCE
from support.ros_tools import SOURCE

DEPLOY = SOURCE / 'deploy'
UNIT = DEPLOY / 'abdf1@.service'
LINES_UNIT = DEPLOY / 'abdf1-lines@.service'
UNITS = pytest.mark.parametrize('path', [UNIT, LINES_UNIT], ids=['line', 'lines'])
DISCOVERY_UNIT = DEPLOY / 'abdf1-discovery@.service'
# Wheels have the server beside Python, and its libraries in folders of their own.
PATH = f'{Path(sys.executable).parent}:{os.environ["PATH"]}'
LIBRARIES = ':'.join(map(str, [Path(sys.prefix, 'lib'), *Path(sys.prefix).glob(
    'lib/python*/site-packages/ros_rmw_fastrtps_cpp.libs')]))
# What MemoryDenyWriteExecute asks the kernel for (PR_SET_MDWE, from Linux 6.3 on).
DENY_WRITE_EXECUTE = 'import ctypes, os, sys; ctypes.CDLL(None).prctl(65, 1, 0, 0, 0); ' \
    'os.execvp(sys.argv[1], sys.argv[1:])'
RULES = DEPLOY / '99-abdf1.rules'
DOCKERFILE = DEPLOY / 'Dockerfile'
SETUP = (SOURCE / 'setup.py').read_text(encoding='utf-8')


def described(*arguments: str) -> dict[str, Any]:
    """Return what setup.py says to setuptools when it is called with these arguments."""
    with mock.patch('setuptools.setup') as setup, mock.patch.object(
            sys, 'argv', ['setup.py', *arguments]), contextlib.chdir(SOURCE):
        runpy.run_path('setup.py')
    said: dict[str, Any] = setup.call_args.kwargs
    return said


def executables(*arguments: str) -> set[str]:
    """Return the commands that setup.py installs when it is called with these arguments."""
    said = described(*arguments)
    return {line.partition(' ')[0] for line in said['entry_points']['console_scripts']}


EXECUTABLES = executables('install')


def test_ros_has_all_commands_and_pip_two_that_no_other_program_has() -> None:
    examples = {path.stem for path in (SOURCE / 'examples').glob('*.py')}
    assert EXECUTABLES == {'abdf1', *COMMANDS, *examples}
    assert executables('develop', '--editable') == EXECUTABLES
    for command in ('bdist_wheel', 'egg_info', 'dist_info', 'editable_wheel'):
        assert executables(command) == {'abdf1', 'plc'}


def test_package_index_has_what_a_reader_looks_for() -> None:
    said = described('bdist_wheel')
    assert said['long_description'].startswith('# abdf1_ros')
    assert said['author'] == said['maintainer']
    assert 'Typing :: Typed' in said['classifiers']


@for_all('line', described('install')['entry_points']['console_scripts'])
def test_executables_are_there(line: str) -> None:
    module, _, name = line.partition(' = ')[2].partition(':')
    assert callable(getattr(importlib.import_module(module), name))


# systemd


def unit(path: Path = UNIT) -> dict[str, dict[str, list[str]]]:
    """Return the settings of the unit by section; each may be there several times."""
    sections: dict[str, dict[str, list[str]]] = {}
    for line in path.read_text(encoding='utf-8').splitlines():
        if line.startswith('['):
            section = sections.setdefault(line.strip('[]'), {})
        elif line and not line.startswith('#'):
            key, _, value = line.partition('=')
            section.setdefault(key, []).append(value)
    return sections


@pytest.mark.parametrize('path', [UNIT, LINES_UNIT, DISCOVERY_UNIT])
def test_unit_has_the_syntax_of_systemd(path: Path) -> None:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(path.read_text(encoding='utf-8'))
    assert parser.sections() == ['Unit', 'Service', 'Install']


@pytest.mark.skipif(not shutil.which('systemd-analyze'), reason='there is no systemd here')
@pytest.mark.parametrize('path', [UNIT, LINES_UNIT, DISCOVERY_UNIT])
def test_systemd_finds_nothing_wrong(tmp_path: Path, path: Path) -> None:
    instance = shutil.copy(path, tmp_path / path.name.replace('@', '@1'))
    result = subprocess.run(['systemd-analyze', 'verify', '--man=no', str(instance)],
                            check=False, capture_output=True, text=True, timeout=PATIENCE)
    assert (result.returncode, result.stderr) == (0, '')


@UNITS
def test_unit_starts_again_after_what_may_pass_only(path: Path) -> None:
    service = unit(path)['Service']
    assert service['Restart'] == ['on-failure']
    assert service['RestartPreventExitStatus'] == ['2']  # faulty files
    assert service['KillSignal'] == ['SIGINT']
    assert (service['Type'], service['WatchdogSec']) == (['notify'], ['30'])
    assert unit(path)['Unit']['StartLimitIntervalSec'] == ['0']


@UNITS
def test_unit_may_open_serial_ports_only(path: Path) -> None:
    service = unit(path)['Service']
    assert service['DevicePolicy'] == ['closed']
    assert set(service['DeviceAllow']) == {
        f'char-{kind} rw' for kind in ('ttyS', 'ttyUSB', 'ttyACM', 'ttyAMA')}
    assert service['SupplementaryGroups'] == ['dialout']
    assert service['User'] != ['root']
    assert service['CapabilityBoundingSet'] == ['']


@pytest.mark.parametrize(('path', 'command', 'file', 'section'), [
    (UNIT, 'node', 'press.yaml', '/**'), pytest.param(
        LINES_UNIT, 'lines', 'press.yaml', '/hall/line_1', marks=pytest.mark.long)],
    ids=['line', 'lines'])
def test_command_of_the_unit_starts_a_bridge_and_ends_by_its_signal(
        tmp_path: Path, path: Path, command: str, file: str, section: str) -> None:
    """Run ExecStart as it stands, with an installation and an /etc/abdf1 of our own."""
    install, etc = tmp_path / 'install', tmp_path / 'etc'
    executable = install / 'lib' / 'abdf1_ros' / command
    executable.parent.mkdir(parents=True)
    executable.write_text(
        f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m abdf1_ros {command} "$@"\n')
    executable.chmod(0o755)
    (install / 'setup.bash').write_text(f'cd {shlex.quote(str(SOURCE))}\n')
    etc.mkdir()
    files = ', '.join(f'{name}_file: {SOURCE}/config/{name}.csv' for name in ('net', 'map'))
    (etc / file).write_text(
        f'{section}: {{ros__parameters: {{{files}, port: /dev/ttyS99, stale_after: 9.0}}}}\n')
    service = unit(path)['Service']
    (start,) = service['ExecStart']
    settings = dict(entry.split('=', 1) for entry in service['Environment'])
    assert settings['ABDF1_INSTALL'] == '/opt/abdf1'
    assert settings['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    words = [word.replace('%i', 'press').replace('/etc/abdf1', str(etc))
             for word in shlex.split(start)]
    environment = os.environ | settings | {
        'ABDF1_INSTALL': str(install), 'ROS_LOG_DIR': str(tmp_path)}
    assert service['MemoryDenyWriteExecute'] == ['yes']
    denied = [sys.executable, '-c', DENY_WRITE_EXECUTE, *words]
    with Observer() as observer, subprocess.Popen(denied, env=environment) as process:
        try:
            line = '/press' if section == '/**' else section
            assert get_parameters(observer, 'stale_after', node=line) == [9.0]
            observer.meet('press')
            process.send_signal(signal.Signals[service['KillSignal'][0]])
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()


def test_command_of_the_discovery_unit_starts_a_server(tmp_path: Path) -> None:
    if not shutil.which('fast-discovery-server', path=PATH):
        pytest.skip('this ROS has no fast-discovery-server')
    (tmp_path / 'setup.bash').write_text(f'export LD_LIBRARY_PATH={LIBRARIES} PATH={PATH}\n')
    service = unit(DISCOVERY_UNIT)['Service']
    settings = dict(entry.split('=', 1) for entry in service['Environment'])
    assert settings['ROS_SETUP'] == '/opt/ros/jazzy/setup.bash'
    words = [word.replace('%i', '1') for word in shlex.split(service['ExecStart'][0])]
    environment = os.environ | settings | {
        'ROS_SETUP': str(tmp_path / 'setup.bash'), 'ADDRESS': '127.0.0.1', 'PORT': '11897'}
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            said = ''.join(itertools.takewhile(lambda line: 'Addresses' not in line,
                                               process.stdout))
            assert re.search(r'Server ID: +1\n', said)
        finally:
            process.terminate()
            process.wait(PATIENCE)


# udev

ITEM = re.compile(r'(\w+)(\{\w+\})?(==|!=|\+=|=)"([^"]*)"')
MATCHES = {'SUBSYSTEM', 'ATTRS', 'ATTR', 'KERNELS', 'ACTION', 'DRIVER'}


def rules() -> list[list[tuple[str, str, str, str]]]:
    """Return the items (key, attribute, operator, value) of each rule."""
    found = []
    for line in RULES.read_text(encoding='utf-8').splitlines():
        if line and not line.startswith('#'):
            items = line.split(', ')
            assert all(ITEM.fullmatch(item) for item in items), line
            found.append([ITEM.fullmatch(item).groups('') for item in items])  # type: ignore
    return found


def test_rules_match_before_they_set() -> None:
    for rule in rules():
        operators = [operator for _, _, operator, _ in rule]
        assert operators == sorted(operators, key=lambda operator: operator != '==')
        assert operators[0] == '=='
        assert all(key in MATCHES for key, _, operator, _ in rule if operator == '==')


def test_every_adapter_gets_one_name_and_the_group_that_may_open_it() -> None:
    names = []
    for rule in rules():
        if ('SUBSYSTEM', '', '==', 'tty') not in rule:
            continue
        assert ('GROUP', '', '=', 'dialout') in rule
        assert ('MODE', '', '=', '0660') in rule
        assert ('ENV', '{ID_MM_DEVICE_IGNORE}', '=', '1') in rule
        names += [value for key, _, operator, value in rule if (key, operator) == (
            'SYMLINK', '+=')]
    three_lines = (SOURCE / 'config' / 'three_lines.yaml').read_text(encoding='utf-8')
    assert names == re.findall(r'port: /dev/(\S+)', three_lines)


def test_latency_timer_is_set_for_ftdi() -> None:
    assert [('ACTION', '', '==', 'add'), ('SUBSYSTEM', '', '==', 'usb-serial'),
            ('DRIVER', '', '==', 'ftdi_sio'), ('ATTR', '{latency_timer}', '=', '1')] in rules()


@pytest.mark.skipif(not shutil.which('udevadm'), reason='there is no udev here')
def test_udev_finds_nothing_wrong() -> None:
    result = subprocess.run(['udevadm', 'verify', str(RULES)], check=False,
                            capture_output=True, text=True, timeout=PATIENCE)
    if 'Unknown command' in result.stderr:
        pytest.skip('this udev is too old to verify')
    assert result.returncode == 0, result.stdout + result.stderr


# Docker


def instructions() -> list[tuple[str, str]]:
    """Return the instructions of the Dockerfile, lines joined."""
    text = DOCKERFILE.read_text(encoding='utf-8')
    lines = [line for line in text.splitlines() if not line.startswith('#')]
    joined = '\n'.join(lines).replace('\\\n', ' ')
    return [(word, rest) for word, _, rest in (
        line.partition(' ') for line in joined.splitlines() if line)]


def test_image_is_the_official_one_and_runs_as_an_ordinary_user() -> None:
    words = [word for word, _ in instructions()]
    assert instructions()[0] == ('FROM', 'ros:jazzy-ros-base')
    assert ('USER', 'abdf1') in instructions()
    assert words.index('RUN') < words.index('USER') < words.index('ENTRYPOINT')
    assert ('STOPSIGNAL', 'SIGINT') in instructions()
    assert 'rosdep install' in next(rest for word, rest in instructions() if word == 'RUN')


def test_first_word_is_the_executable(tmp_path: Path) -> None:
    """Run the entry point as Docker does, with an installation of our own."""
    command = dict(instructions())
    entry, default = json.loads(command['ENTRYPOINT']), json.loads(command['CMD'])
    assert default == ['node']
    for name in EXECUTABLES:
        script = tmp_path / 'lib' / 'abdf1_ros' / name
        script.parent.mkdir(parents=True, exist_ok=True)
        script.write_text(f'#!/bin/sh\necho {name} "$@"\n')
        script.chmod(0o755)
    (tmp_path / 'setup.bash').write_text('')
    entry = [word.replace('/opt/abdf1', str(tmp_path)) for word in entry]
    for words, expected in ((default, 'node\n'), (['simulator', '--pty', 'a b'],
                                                  'simulator --pty a b\n')):
        assert subprocess.check_output([*entry, *words], text=True) == expected


def test_all_that_is_installed_reaches_the_image() -> None:
    allowed = [line.removeprefix('!') for line in (
        DEPLOY / 'Dockerfile.dockerignore').read_text(encoding='utf-8').splitlines()
        if line.startswith('!')]
    wanted = {'README.md', 'package.xml', 'setup.py', 'setup.cfg', 'LICENSE', 'abdf1_ros/py.typed',
              'abdf1_ros/ros/node.py', 'abdf1_ros/df1/frames.py', 'resource/abdf1_ros'}
    wanted |= {f'{folder}/x' for folder in re.findall(r"glob\('(\w+)/", SETUP)}
    wanted |= set(re.findall(r"\['(\w+/[\w.]+)'\]", SETUP))
    for name in wanted:
        assert any(fnmatch(name, pattern.replace('**/', '*')) or name.startswith(f'{pattern}/')
                   for pattern in allowed), name


# The document


def test_commands_and_files_of_the_document_exist() -> None:
    text = (SOURCE / 'docs' / 'deployment.md').read_text(encoding='utf-8')
    for name in re.findall(r'\b((?:deploy|config|launch|docs)/[\w@./-]+\w)', text):
        assert (SOURCE / name).exists(), name
    for name in re.findall(r'abdf1_ros (\w+) --', text):
        assert name in EXECUTABLES
    assert EXECUTABLES >= {'node', 'simulator', 'monitor', 'sniff', 'check', 'plc'}
