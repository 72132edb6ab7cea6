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

"""A copy of the package with something made up in it: a patch shows what a new thing costs."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

_ROOT = Path(__file__).resolve().parents[2]


def touched(patch: Path) -> list[str]:
    """Return the files of the package that a patch changes or makes."""
    text = patch.read_text(encoding='utf-8')
    return re.findall(r'^\+\+\+ b/(abdf1_ros/\S+)', text, re.MULTILINE)


def run_patched(patch: Path, program: str, folder: Path) -> None:
    """Run a program, which may use test/support, with the package as ``patch`` makes it."""
    shutil.copytree(_ROOT / 'abdf1_ros', folder / 'abdf1_ros',
                    ignore=shutil.ignore_patterns('__pycache__'))
    # Outside of a repository, so that git takes the paths as they are.
    environment = os.environ | {
        'GIT_CEILING_DIRECTORIES': str(folder.parent), 'PYTHONPATH': os.pathsep.join(
            (str(folder), str(_ROOT / 'test')))}
    for command in (['git', 'apply', '-C1', str(patch)], [sys.executable, '-c', program]):
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True,
                              text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
