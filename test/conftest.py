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


"""What holds for all tests: the examples of property tests, and which files begin."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
import gc
import os
from pathlib import Path
from typing import Any

from abdf1_ros.cli.plc.detect import LineSettings
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.settings.network import Network
from hypothesis import HealthCheck, settings
import pytest
from support.ptys import Pty

# Files that wait for other processes most of the time, and files that compute; the longest first.
_WAITING = (
    'cli/plc/test_detect.py', 'ros/test_process.py', 'faults/', 'cli/monitor/test_command.py',
    'examples/', 'ros/', 'cli/plc/test_other_lines.py', 'share/', 'lab/interop/', 'test_docs',
    'test_', 'cli/', 'ports/')
_COMPUTING = (
    'lab/simulate/', 'lab/noise/', 'df1/test_multidrop_line.py', 'lab/soak/',
    'driver/', 'df1/', 'lab/fuzz/', 'conform/', 'simulator/', 'sniffer/', 'tools/', 'plan/', '')

_HERE = Path(__file__).parent

gc.disable()  # until all tests are collected

# Each process of the tests that imports numpy would start a thread a processor for its algebra,
# and let them spin for 0.1 s.
os.environ['OPENBLAS_NUM_THREADS'] = '1'

# The same examples each time, but for "make long", which is after new ones and keeps what fails.
_COMMON = {'deadline': None, 'suppress_health_check': [HealthCheck.too_slow]}
settings.register_profile('same', max_examples=60, derandomize=True, database=None, **_COMMON)
settings.register_profile('new', max_examples=150, **_COMMON)
settings.load_profile(os.environ.get('ABDF1_ROS_EXAMPLES', 'same'))


@pytest.fixture(scope='module')
def observer() -> Iterator[Any]:
    from support.ros import Observer
    with Observer() as observer:
        yield observer


@pytest.fixture
def ptys(tmp_path: Path) -> Iterator[list[Pty]]:
    """Two pseudo-terminals, which end with the test."""
    lines = [Pty(tmp_path / name) for name in ('first', 'second')]
    yield lines
    for line in lines:
        line.close()


@pytest.fixture
def half_duplex_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let searches wait for a short time where nobody answers: in full duplex."""
    settled = LineSettings.on

    def brief(settings: LineSettings, line: Network) -> Network:
        network = settled(settings, line)
        return replace(network, timeout=50, cmd_timeout=50) if settings.mode == 'Peer' else network

    monkeypatch.setattr(LineSettings, 'on', brief)


@pytest.fixture
def leap(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Let the clock of all links go forward by some seconds, so that a Timeout takes no time."""
    ahead = [0.0]
    defaults = LinkThread.__init__.__kwdefaults__
    monkeypatch.setitem(defaults, 'clock', lambda: line_time() + sum(ahead))
    monkeypatch.setitem(defaults, 'longest_wait', 0.01)  # until a link sees it
    return ahead.append


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """
    Put one file that computes after each two that wait, and then the others.

    Several workers, which take one file after the other, then have something to compute while
    others wait, and leave those enough of the processors to keep their times.
    """
    names = {path: path.relative_to(_HERE).as_posix()
             for path in dict.fromkeys(item.path for item in items)}
    files = names.values()
    waiting = _sorted([file for file in files if file.startswith(_WAITING)], _WAITING)
    computing = _sorted([file for file in files if not file.startswith(_WAITING)], _COMPUTING)
    place = {file: float(at) for at, file in enumerate(waiting)}
    place.update((file, 1.4 * at + 1.5) for at, file in enumerate(computing))
    items.sort(key=lambda item: place[names[item.path]])


def pytest_collection_finish() -> None:
    """
    Let garbage be collected from here on, but less often, and not looked for among the tests.

    Each worker holds all of them, and nearly all that they make has no cycles: the collector took
    a sixth of the processor time.
    """
    gc.enable()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def _sorted(files: list[str], starts: Sequence[str]) -> list[str]:
    return sorted(files, key=lambda file: next(
        at for at, start in enumerate(starts) if file.startswith(start)))
