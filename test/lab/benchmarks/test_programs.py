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

"""The benchmarks that nothing else runs still measure."""

from pathlib import Path
import subprocess
import sys

import pytest

_HERE = Path(__file__).parent


def last_row(program: str, *options: str) -> list[str]:
    """Run a benchmark at 115,200 baud; return the cells of the last row that it prints."""
    run = subprocess.run([sys.executable, str(_HERE / program), *options, '--baud', '115200'],
                         capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout.splitlines()[-1].split()


@pytest.mark.long
@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_the_line_is_measured(mode: str) -> None:
    row = last_row('wire_efficiency.py', '--mode', mode, '--words', '1', '--transactions', '2',
                   '--rounds', '1')
    assert row[:3] == [mode, '115200', '1']
    assert row[-1] == '0'  # troubles


@pytest.mark.long
def test_ethernet_place_is_measured() -> None:
    row = last_row('ethernet_place.py', '--reads', '3')
    assert row[0] == '115200' and len(row) == 7
    assert all(float(entry) >= float(row[1]) for entry in row[2:6])
