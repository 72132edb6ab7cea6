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

"""A small rehearsal of a plant: two hosts as namespaces, each with a spare of the other."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

PROGRAM = Path(__file__).parent / 'lab' / 'rehearsal' / 'run.py'


def has_namespaces() -> bool:
    """Tell whether this user may make network namespaces here."""
    return not os.geteuid() and shutil.which('ip') is not None and subprocess.run(
        ['unshare', '--net', 'true'], check=False, capture_output=True).returncode == 0


NEEDS_NAMESPACES = pytest.mark.skipif(not has_namespaces(), reason='namespaces need root')


@NEEDS_NAMESPACES
@pytest.mark.long  # test/ros/test_standby.py has both on one host
def test_spare_takes_over_the_lines_of_a_host_that_dies() -> None:
    done = subprocess.run(
        [sys.executable, str(PROGRAM), '--hosts', '2', '--lines', '1', '--faults', '1',
         '--seed', '1'], check=False, capture_output=True, text=True, timeout=110)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'kill     1 times, all lines read and written to after ' in done.stdout


@NEEDS_NAMESPACES
@pytest.mark.long
def test_no_result_comes_a_second_time_after_a_long_cut() -> None:
    done = subprocess.run(
        [sys.executable, str(PROGRAM), '--hosts', '2', '--lines', '1', '--faults', '1',
         '--only', 'apart', '--discovery-server', '--seed', '1'], check=False,
        capture_output=True, text=True, timeout=110)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'apart    1 times, all lines read and written to after ' in done.stdout
