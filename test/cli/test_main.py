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

"""Signals that come before a command has handlers of its own, and modules that are missing."""

from importlib import import_module
from io import BytesIO, TextIOWrapper
import os
from pathlib import Path
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
from types import SimpleNamespace
from typing import NoReturn
from zipfile import ZipFile

from abdf1_ros.__main__ import main
from abdf1_ros.cli import main as commands
from abdf1_ros.cli import terminal
from abdf1_ros.cli.main import COMMANDS
from abdf1_ros.paths import package_version
import pytest
from support.cases import compare_stored, long_unless
from support.commands import call, Output
from support.ptys import PATIENCE

# Each with a module that it imports, and its status when it is interrupted.
NAMES = {'node': ('rclpy', 0), 'lines': ('yaml', 0), 'monitor': ('rclpy', 0), 'demo': ('rclpy', 0),
         'simulator': ('serial', 0), 'sniff': ('serial', 0), 'check': ('difflib', 130),
         'plc': ('serial', 130)}

# What --help of all others has.
NOT_IN_HELP = {'lines': 'examples:', 'plc': 'exit status: 0'}

# Of a command that imports what it needs when it knows what is wanted.
ARGUMENTS = {'plc': ['status', '--port', 'x']}


def held_at_an_import(folder: Path, name: str, text: str) -> subprocess.Popen[str]:
    """Start a command that finds this text where a module of its imports would be."""
    (folder / f'{NAMES[name][0]}.py').write_text(text)
    call = f'import sys; sys.argv += {ARGUMENTS.get(name, [])}; ' \
        f'from abdf1_ros.cli.main import {name}; sys.exit({name}())'
    return subprocess.Popen(
        [sys.executable, '-c', call], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env=os.environ | {'PYTHONPATH': str(folder)})


# Stands in for a slow import: it says that it has begun, and does not end by itself soon. Python
# sees a signal that comes just before a wait after it, so no wait is long.
SLOW = """import select
print('importing', flush=True)
for _ in range(300):
    select.select([], [], [], 0.1)
"""

TELLING = """import os, sys
with open(os.environ['TOLD'], 'w') as file:
    links = [f'{os.readlink(f"/proc/self/fd/{n}")} {os.get_inheritable(n)}' for n in range(3)]
    print(file.fileno(), *links, file=file)
print('lost')
print('lost', file=sys.stderr)
os._exit(7)
"""


@pytest.mark.parametrize('closed', long_unless(
    lambda closed: '<' in closed, zip(['<&- >&- 2>&-', '>&-', '2>&-'])))
def test_no_file_takes_the_place_of_a_closed_stream(tmp_path: Path, closed: str) -> None:
    """DDS would write its messages into it, and it may be the port."""
    (tmp_path / 'rclpy.py').write_text(TELLING)
    told = tmp_path / 'told'
    done = subprocess.run(
        ['sh', '-c', f'exec "$@" {closed}', 'sh', sys.executable, '-c',
         'from abdf1_ros.cli.main import node; node()'],
        check=False, env=os.environ | {'PYTHONPATH': str(tmp_path), 'TOLD': str(told)},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    assert done.returncode == 7
    number, *links = told.read_text().split()
    assert int(number) > 2
    assert links == ['/dev/null', 'True'] * 3


@pytest.mark.parametrize('name', long_unless(
    lambda name: name in ('node', 'lines', 'plc'), zip(NAMES)))
def test_signal_during_the_imports_ends_quietly(tmp_path: Path, name: str) -> None:
    with held_at_an_import(tmp_path, name, SLOW) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'importing\n'
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output, errors) == (NAMES[name][1], '', '')


def imported_by(call: str) -> set[str]:
    """Return the modules that a call of a fresh interpreter has imported, without its site."""
    path = [str(Path(commands.__file__).parents[2]), sysconfig.get_path('purelib')]
    program = (f'import sys; sys.path[:0] = {path}\ntry:\n    {call}\n'
               'finally:\n    print(*sys.modules, file=sys.stderr)')
    done = subprocess.run([sys.executable, '-S', '-c', program], stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, text=True, timeout=PATIENCE, check=True)
    return set(done.stderr.split())


def test_until_signals_are_handled_little_is_imported() -> None:
    """Before that Ctrl-C brings a traceback."""
    slow = {'contextlib', 'difflib', 'pathlib', 're', 'typing'}
    assert not imported_by('import abdf1_ros.__main__') & slow


@pytest.mark.parametrize('name', ['check', 'sniff'])
def test_pictures_are_imported_where_they_are_drawn(name: str) -> None:
    pictures = {f'abdf1_ros.cli.{module}' for module in (
        'lanes', 'check_picture', 'overhearing', 'sniff_picture', 'sniff_report')}
    assert not imported_by(f'from abdf1_ros.cli.main import {name}; '
                           f'sys.argv[1:] = ["--help"]; {name}()') & pictures


@pytest.mark.parametrize('name', COMMANDS)
def test_signal_before_a_command_has_its_own_handlers_ends_quietly(
        name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the process would end, that is shown by an exception here."""
    def leave(status: int) -> NoReturn:
        raise SystemExit(status)

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    fake = SimpleNamespace(main=lambda: os.kill(os.getpid(), signal.SIGTERM))
    monkeypatch.setitem(sys.modules, COMMANDS[name][0], fake)
    monkeypatch.setattr(os, '_exit', leave)
    for number in handlers:  # without a handler of ours the test fails, and goes on
        signal.signal(number, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as end:
            getattr(commands, name)()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert end.value.code == {**NAMES, 'conform': ('', 130)}[name][1]


def test_process_with_threads_of_rclpy_or_pyserial_ends_at_once() -> None:
    for name in COMMANDS:
        program = (f'import atexit, signal, sys, types; from abdf1_ros.cli.main import *\n'
                   f'sys.modules[COMMANDS["{name}"][0]] = types.SimpleNamespace('
                   f'main=lambda: sys.stderr.close() or 3)\natexit.register(print, "later")\n'
                   f'atexit.register(signal.raise_signal, signal.SIGINT)  # another Ctrl-C\n'
                   f'print("said"); sys.exit(run("{name}"))')
        done = subprocess.run([sys.executable, '-c', program], text=True, stdout=subprocess.PIPE,
                              timeout=PATIENCE, check=False,
                              env=os.environ | {'PYTHONUNBUFFERED': ''})
        ends_later = name not in ('node', 'lines', 'simulator')
        assert (done.returncode, done.stdout) == (3, 'said\n' + 'later\n' * ends_later), name


@pytest.mark.parametrize(('name', 'module', 'cure'), [
    ('node', 'rclpy', 'is ROS 2 sourced, as by ". /opt/ros/jazzy/setup.bash"?'),
    ('plc', 'serial', '"pip install pyserial", or "make setup" in a checkout'),
    ('plc', 'serial.serialutil', 'another package is imported as serial, and is not pyserial. '
     'Rename it if it is yours; else "pip uninstall serial", then "pip install pyserial"')])
def test_module_that_is_missing_is_named(
        tmp_path: Path, name: str, module: str, cure: str) -> None:
    text = f"raise ModuleNotFoundError('no', name='{module}')\n"
    with held_at_an_import(tmp_path, name, text) as process:
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert errors == f'-c: the Python module {module} is missing; {cure}\n'


def test_program_is_told_which_file_hides_pyserial(tmp_path: Path) -> None:
    for text, right in (
            ('', f'{tmp_path}/serial.py is imported as serial, and is not pyserial. Rename it'),
            ("raise ModuleNotFoundError('no', name='serial')", '"pip install pyserial", or ')):
        (tmp_path / 'serial.py').write_text(text)
        done = subprocess.run(
            [sys.executable, '-c', 'from abdf1_ros import Client'], check=False, text=True,
            capture_output=True, timeout=PATIENCE, env=os.environ | {'PYTHONPATH': str(tmp_path)})
        last = done.stderr.splitlines()[-1]
        assert last.startswith('ModuleNotFoundError: the Python module serial')
        assert right in last


@pytest.mark.parametrize('name', ['node', 'lines', 'monitor', 'demo'])
def test_help_of_a_program_with_ros_needs_no_ros(name: str, tmp_path: Path) -> None:
    program = ('import sys; sys.modules["rclpy"] = None\n'
               'from abdf1_ros.__main__ import main; sys.exit(main())')
    for more, status, said, fault in (
            (['--help'], 0, f'usage: {name} ', ''),
            ([], 2, '', f'{name}: the Python module rclpy')):
        done = subprocess.run([sys.executable, '-c', program, name, *more], check=False,
                              capture_output=True, text=True, timeout=PATIENCE)
        assert (done.returncode, done.stdout[:len(said)], done.stderr[:len(fault)]) == (
            status, said, fault)


@pytest.mark.filterwarnings('ignore:.*found in sys.modules')
@pytest.mark.parametrize('name', sorted(COMMANDS))
def test_module_of_a_command_is_one_too(
        name: str, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    monkeypatch.setattr(sys, 'argv', [name, '--version'])
    with pytest.raises(SystemExit) as end:
        runpy.run_module(COMMANDS[name][0], run_name='__main__')
    assert not end.value.code
    assert capsys.readouterr().out == f'abdf1_ros {package_version()}\n'


@pytest.mark.parametrize('name', sorted(COMMANDS))
def test_every_command_tells_its_version_and_what_it_takes(
        name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    helps = {'examples:', 'exit status: 0'} - {NOT_IN_HELP.get(name)}
    for option, texts in (('--version', {'abdf1_ros '}), ('--help', helps)):
        monkeypatch.setattr(sys, 'argv', [name, option])
        monkeypatch.setattr(sys, 'stdout', output := TextIOWrapper(BytesIO(), 'ascii'))
        with pytest.raises(SystemExit) as end:
            import_module(COMMANDS[name][0]).main()
        assert end.value.code == 0
        output.seek(0)
        said = output.read()
        assert [text for text in texts if text not in said] == []
        # Text of a user, such as a tag, may have characters that a terminal does not know.
        assert output.errors == 'backslashreplace' or name in ('node', 'lines', 'demo')


def test_help_without_room_or_reader(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    reader, writer = os.pipe()
    os.close(reader)
    for name, given in (('abdf1', '--help'), ('abdf1', '--version'), ('plc', '--version')):
        for place, status, reason in (
                ('/dev/full', 2, f'{name}: cannot print: No space left on device\n'),
                (os.dup(writer), 0, '')):
            monkeypatch.setattr(sys, 'argv', ['abdf1', *['plc'] * (name == 'plc'), given])
            with open(place, 'w') as stdout, pytest.raises(SystemExit) as end:
                monkeypatch.setattr(sys, 'stdout', stdout)
                sys.exit(main())
            assert (end.value.code, capsys.readouterr().err) == (status, reason)
    os.close(writer)


@pytest.mark.parametrize(('name', 'args', 'status'), [
    ('plc', ['ports'], 130), ('conform', ['slave', '--port', 'x'], 130), ('sniff', ['x'], 0),
    ('simulator', [], 0), ('demo', [], 0)])
def test_signal_where_nothing_is_under_way_ends_quietly(
        name: str, args: list[str], status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    module = import_module(COMMANDS[name][0])
    monkeypatch.setattr(terminal, 'interruptible', interrupted)
    assert module.main(args) == status


@pytest.mark.parametrize(('given', 'status', 'told'), [
    (['--version'], 0, f'abdf1_ros {package_version()}\n'),
    (['plcc'], 2, '"plcc" is not a command; did you mean plc?'),
    (['plc\x1b'], 2, r'"plc\x1b" is not a command'),
    (['--verison'], 2, '"--verison" is not a command; did you mean --version?'),
    (['plc', '--hlep'], 2, '"--hlep" is not a command; did you mean --help?'),
    (['plc', '\x1b'], 2, r'"\x1b" is not a command'),
    (['help'], 0, 'plc        read, write'), ([], 2, 'plc        read, write')])
def test_first_word_that_is_no_command(given: list[str], status: int, told: str) -> None:
    said = subprocess.run([sys.executable, '-m', 'abdf1_ros', *given], text=True, timeout=60,
                          capture_output=True, check=False)
    assert (said.returncode, told in said.stdout + said.stderr) == (status, True)


@pytest.mark.parametrize('name', ['check', 'plan', 'plc', 'sniff'])
def test_all_that_commands_tell_is_as_stored(
        name: str, tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a change that is wanted, run it with UPDATE_STORED=1 and look at the difference."""
    stored = Path(__file__).with_name('stored')
    monkeypatch.chdir(shutil.copytree(stored, tmp_path / 'copy') / name)
    monkeypatch.setattr('abdf1_ros.cli.plc.verbs.import_.called', str)
    told = ''
    for line in Path('commands.txt').read_text('utf-8').splitlines():
        command, *args = shlex.split(line)
        said = call(import_module(COMMANDS[command][0]).main, capsys, *args)
        out = said.out.replace(os.getcwd(), 'HERE')
        told += f'$ {line}\n{out}{said.err}exit status {said.status}\n'
    for page in sorted([*Path().glob('*.html'), *Path().glob('made/*/map.csv')]):
        told += f'{page}:\n{page.read_text("utf-8")}'
    for path in sorted(Path().glob('*.zip')):
        with ZipFile(path) as bundle:
            told += ''.join(f'{name}:\n{bundle.read(name).decode()}' for name in bundle.namelist()
                            if name != 'versions.json')
    compare_stored(stored / name / 'told.txt', told)
