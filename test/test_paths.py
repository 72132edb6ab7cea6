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

"""Where files are found, paths in the home folder, and the end that a signal asks for."""

from argparse import ArgumentTypeError
import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
import re
import signal
import subprocess
import sys
from types import SimpleNamespace

import abdf1_ros
from abdf1_ros import paths
from abdf1_ros.__main__ import main
from abdf1_ros.cli.main import COMMANDS
from abdf1_ros.signals import EndRequest
import pytest
from support.cases import for_all
from support.commands import call, Output

ROOT = Path(__file__).resolve().parent.parent
PLACES = {'FILE', 'FOLDER', 'LINK', 'MAP', 'NET', 'PORT_A', 'ZIP', '--port', '--pty'}


@for_all(('typed', 'meant'), [
    ('~/net.csv', '/home/me/net.csv'), ('$HOME/net.csv', '/home/me/net.csv'),
    ('~/', '/home/me/'), ('', ''), ('~', '~'), ('~root/x', '~root/x'), ('a/~/b', 'a/~/b'),
    ('pty:~/plc', 'pty:~/plc'), ('$HOMES/x', '$HOMES/x'), ('$USER/x', '$USER/x')])
def test_home_folder_at_the_begin_of_a_path(typed: str, meant: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('HOME', '/home/me')
        assert paths.expanded(typed) == meant


@pytest.mark.parametrize('words', [
    ['check', '~/x', '$HOME/y'], ['sniff', '~/x'], ['simulator', '--data=~/x'],
    ['sniff', '--port=$HOME/x'], ['conform', 'slave', '--port', '~/x'],
    ['plc', 'read', 'N7:0', '--net=~/x'], ['plc', 'import', '$HOME/x'],
    ['sniff', '--html', '~/x/no/page.html', '--port', 'x']])
def test_commands_look_for_quoted_paths_in_the_home_folder(
        words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    name, *args = words
    said = call(import_module(COMMANDS[name][0]).main, capsys, *args)
    assert said.status in (1, 2)
    assert str(tmp_path / 'x') in said.out + said.err
    assert '$HOME' not in said.out + said.err


def _made(option: Callable[[str], str]) -> str:
    """Return what an option makes of a place below the home folder, or says of it."""
    try:
        return option('~/no/such')
    except ArgumentTypeError as error:
        return str(error)


def test_every_argument_of_a_command_that_is_a_path_may_begin_at_the_home_folder(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    found = 0
    for file in (ROOT / 'abdf1_ros' / 'cli').rglob('*.py'):
        for call_ in ast.walk(ast.parse(file.read_text('utf-8'))):
            if not isinstance(call_, ast.Call) or getattr(
                    call_.func, 'attr', '') != 'add_argument':
                continue
            named = {word.arg: word.value for word in call_.keywords}
            words = {node.value for part in (*call_.args, *filter(None, [named.get('metavar')]))
                     for node in ast.walk(part) if isinstance(node, ast.Constant)}
            if words & PLACES:
                found += 1
                made_by = named.get('type')
                assert isinstance(made_by, ast.Name), f'{file.name}: {words}'
                dotted = '.'.join(file.relative_to(ROOT).with_suffix('').parts)
                assert _made(getattr(import_module(dotted), made_by.id)).startswith(
                    str(tmp_path)), f'{file.name}: {words}'
    assert found > 20


@pytest.mark.parametrize('name', ['net.csv', 'map.csv', 'simulator.csv'])
def test_file_of_the_source_tree(name: str) -> None:
    path = paths.config_file(name)
    assert path.is_file()
    assert path.parent == ROOT / 'config'


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Pretend that the module lies where there is no config folder beside it."""
    monkeypatch.setattr(paths, '__file__', str(tmp_path / 'lib' / 'abdf1_ros' / 'paths.py'))
    return tmp_path


@pytest.mark.parametrize('share', ['share', LookupError(), OSError('no AMENT_PREFIX_PATH'), None])
def test_file_of_the_installed_package(
        installed: Path, monkeypatch: pytest.MonkeyPatch, share: str | Exception | None) -> None:
    """Ament has an index that knows the package or not, or there is none."""
    def get_package_share_directory(package: str) -> str:
        assert package == 'abdf1_ros'
        if isinstance(share, Exception):
            raise share
        return str(installed / 'share')

    module = SimpleNamespace(get_package_share_directory=get_package_share_directory)
    for name in ('ament_index_python', 'ament_index_python.packages'):
        monkeypatch.setitem(sys.modules, name, module if share else None)
    place = installed / 'share' if share == 'share' else Path(sys.prefix) / 'share' / 'abdf1_ros'
    assert paths.config_file('net.csv') == place / 'config' / 'net.csv'


def test_version_of_the_package_is_that_of_its_commands(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, 'argv', ['abdf1', '--version'])
    assert main() == 0
    assert capsys.readouterr().out == f'abdf1_ros {abdf1_ros.__version__}\n'
    with pytest.raises(AttributeError, match="module 'abdf1_ros' has no attribute 'x'"):
        _ = abdf1_ros.x


# What stays until the interpreter takes its modules apart, when it has no signal handler any more.
SLOW_END = """
import os, time
from abdf1_ros.signals import limit_output, OUTPUTS

class Slow:
    def __del__(self, sleep=time.sleep):
        sleep(0.5)

slow = Slow()
limit_output(0.2)
reader, writer = os.pipe()  # nothing reads it
OUTPUTS.add(pipe := open(writer, 'wb', 0))
written = [pipe.write(bytes(99999)) for _ in range(2)]
print('last words')
"""


def test_second_signal_does_not_begin_the_end_again() -> None:
    begun: list[tuple[float, bool]] = []
    end = EndRequest((), lambda: begun.append((end.when, end.is_set())))
    for _ in range(2):
        end.set()
    assert begun == [(end.when, False)]
    assert end.is_set()


def test_signals_of_others_do_not_begin_the_end() -> None:
    numbers = signal.SIGUSR1, signal.SIGTERM
    before = [signal.signal(number, lambda number, frame: None) for number in numbers]
    with EndRequest(numbers[1:]) as end:
        ended = []
        for number, seconds in zip(numbers, (0.2, 30.0), strict=True):
            signal.raise_signal(number)
            ended.append(end.wait(seconds))
    assert callable(signal.getsignal(signal.SIGTERM))  # a late signal does not kill it
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)
    assert ended == [False, True]


def test_alarm_of_the_last_output_does_not_kill_a_slow_end() -> None:
    ended = subprocess.run(
        [sys.executable, '-c', SLOW_END], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, 'last words\n', '')


def test_commands_are_told_as_they_can_be_pasted(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    venv, workspace = tmp_path / 'a venv' / 'bin', tmp_path / 'install'
    for path, text in ((venv / 'plc', 'from abdf1_ros'), (venv / 'python', ''),
                       (tmp_path / 'ros' / 'ros2', ''), (workspace / 'lib/abdf1_ros/plc', '')):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding='utf-8')
        path.chmod(0o755)
    (venv / 'node').write_text('#!/usr/bin/env node', encoding='utf-8')  # that of Node.js
    monkeypatch.setattr(sys, 'executable', str(venv / 'python'))
    monkeypatch.setenv('PATH', '/nowhere')
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    assert paths.called('plc') == f"'{venv}/plc'"
    assert paths.called('node') == f"'{venv}/python' -m abdf1_ros node"
    (venv / 'abdf1').write_text('from abdf1_ros', encoding='utf-8')
    (venv / 'abdf1').chmod(0o755)
    assert paths.called('node') == f"'{venv}/abdf1' node"
    monkeypatch.setenv('PATH', f'{venv}:{tmp_path}/ros')
    assert paths.called('plc') == 'plc'
    assert paths.called('node') == 'abdf1 node'
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{workspace}')
    assert paths.called('plc') == 'ros2 run abdf1_ros plc'
    assert paths.called('check') == 'abdf1 check'
    monkeypatch.setenv('PATH', str(venv))  # without ros2
    assert paths.called('plc') == 'plc'
    assert paths.as_called('plc', 'plc\n  plc\n  plc read N7:0\n  plcs\n') == \
        'plc\n  plc\n  plc read N7:0\n  plcs\n'
    monkeypatch.setenv('PATH', f'{venv}:{tmp_path}/ros')
    assert paths.as_called('plc', 'plc\n  plc\n  plc read N7:0\n  plcs\n') == (
        'plc\n  ros2 run abdf1_ros plc\n  ros2 run abdf1_ros plc read N7:0\n  plcs\n')


@pytest.mark.parametrize('name', sorted(COMMANDS))
def test_examples_of_the_help_start_the_command_and_need_no_checkout(
        name: str, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    monkeypatch.setattr(paths, 'called', lambda name: f'ros2 run abdf1_ros {name}')
    monkeypatch.setattr(sys, 'argv', [name, '--help'])
    with pytest.raises(SystemExit):
        import_module(COMMANDS[name][0]).main()
    told = capsys.readouterr().out
    assert f'\n  ros2 run abdf1_ros {name}' in told
    assert f'\n  {name} ' not in told and f'\n  {name}\n' not in told
    assert not re.search(r'(?<!/)\bconfig/', told)
