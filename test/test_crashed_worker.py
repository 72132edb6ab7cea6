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

"""What "make test" does when one of its processes crashes: it must end, and fail."""

from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
CRASHING = 'import os, signal\ndef test_crash():\n    os.kill(os.getpid(), signal.SIGKILL)\n'


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
        [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', *options, str(tmp_path)],
        cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)
    assert ended.returncode == 1, ended.stdout
    assert re.search(r"worker 'gw\d' crashed while running", ended.stdout)
