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
@pytest.mark.long  # test/ros/test_standby.py has both hosts in one
@pytest.mark.parametrize(('fault', 'options'), [
    ('kill ', ()),  # a spare takes over the lines of a host that dies
    ('apart', ('--only', 'apart', '--discovery-server'))])  # no result comes a second time
def test_two_hosts_and_a_fault_between_them(fault: str, options: tuple[str, ...]) -> None:
    done = subprocess.run(
        [sys.executable, str(PROGRAM), '--hosts', '2', '--lines', '1', '--faults', '1',
         '--seed', '1', *options], check=False, capture_output=True, text=True, timeout=110)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f'{fault}    1 times, all lines read and written to after ' in done.stdout
