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

"""Where the files of the package are found, and the end that a signal asks for."""

from pathlib import Path
import signal
import subprocess
import sys
from types import SimpleNamespace

import abdf1_ros
from abdf1_ros import paths
from abdf1_ros.__main__ import main
from abdf1_ros.signals import EndRequest
import pytest


@pytest.mark.parametrize('name', ['net.csv', 'map.csv', 'simulator.csv'])
def test_file_of_the_source_tree(name: str) -> None:
    path = paths.config_file(name)
    assert path.is_file()
    assert path.parent == Path(__file__).resolve().parent.parent / 'config'


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
