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

"""``make setup`` on odd machines (nothing is installed), and ``make test`` in a crash."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest
from support.ros_tools import SOURCE


@pytest.fixture
def programs(tmp_path: Path) -> Path:
    """Return a folder of programs that come before all others in PATH."""
    folder = tmp_path / 'bin'
    folder.mkdir()
    return folder


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'#!/bin/sh\n{text}\n', encoding='utf-8')
    path.chmod(0o755)


def setup(tmp_path: Path, programs: Path) -> subprocess.CompletedProcess[str]:
    """Run ``make setup`` of this tree for an environment in a folder of the test."""
    unset = {'ROS_DISTRO', 'MAKEFLAGS', 'MAKELEVEL', 'MFLAGS'}
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    return subprocess.run(
        ['make', '--no-print-directory', 'setup', f'VENV={tmp_path / "venv"}',
         f'PYTHON={programs / "python3"}'], cwd=SOURCE, check=False, capture_output=True,
        text=True, timeout=60,
        env=environment | {'PATH': f'{programs}{os.pathsep}{os.environ["PATH"]}'})


pytestmark = pytest.mark.skipif(shutil.which('make') is None, reason='there is no make')


def test_machine_without_wheels_is_told_at_once_what_to_do(tmp_path: Path, programs: Path) -> None:
    script(programs / 'uname', 'echo aarch64')
    script(programs / 'python3', f'echo "$@" >> {tmp_path}/calls')
    result = setup(tmp_path, programs)
    assert result.returncode != 0
    assert 'There are no wheels of ROS for aarch64.' in result.stderr
    assert 'pip install .' in result.stderr
    assert not (tmp_path / 'calls').exists()


@pytest.mark.parametrize('is_there', [False, True])
def test_environment_that_was_interrupted_is_made_again(
        tmp_path: Path, programs: Path, is_there: bool) -> None:
    script(programs / 'uname', 'echo x86_64')
    script(programs / 'python3', f'echo "$@" >> {tmp_path}/calls; exit 1')
    if is_there:
        script(tmp_path / 'venv' / 'bin' / 'python', 'exit 1')  # no module named pip
    assert setup(tmp_path, programs).returncode != 0
    assert (tmp_path / 'calls').read_text(encoding='utf-8') == f'-m venv --clear {tmp_path}/venv\n'


ROOT = Path(__file__).resolve().parents[1]
CRASHING = 'import os, signal\ndef test_crash():\n    os.kill(os.getpid(), signal.SIGKILL)\n'


@pytest.mark.long
def test_crashed_worker_ends_the_run_with_a_failure(tmp_path: Path) -> None:
    pytest.importorskip('xdist')
    recipe = re.search(r'-m pytest (-n \$\(TEST_WORKERS\).+?) \$\(PYTEST_ARGS\)',
                       (ROOT / 'Makefile').read_text(encoding='utf-8'), re.DOTALL)
    assert recipe
    options = recipe[1].replace('\\\n', ' ').replace('$(TEST_WORKERS)', '2').split()
    (tmp_path / 'test_a.py').write_text(CRASHING, encoding='utf-8')
    for name in 'bcd':
        (tmp_path / f'test_{name}.py').write_text('def test_ok():\n    pass\n', encoding='utf-8')
    ended = subprocess.run(
        [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', '-p', 'xdist', *options,
         str(tmp_path)], env=os.environ | {'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1'},
        cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)
    assert ended.returncode == 1, ended.stdout
    assert re.search(r"worker 'gw\d' crashed while running", ended.stdout)
