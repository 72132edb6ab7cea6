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

"""
The real tools of ROS: ros2, launch, launch_ros, sros2 and the linters of ament.

CONTRIBUTING says how to get them. Tests that need one call ``needs``; so they are skipped where
it is missing, unless ABDF1_ROS_TOOLS is set, which ``make test-ros`` does: nobody is to believe
that something has passed which has not been run.
"""

import importlib
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import sys
from typing import Any

from abdf1_ros.cli.main import COMMANDS
import pytest
from support.ros import Process

SOURCE = Path(__file__).resolve().parents[2]
TOOLS = ('launch', 'launch_ros', 'ros2launch', 'ros2topic', 'sros2', 'ament_copyright',
         'ament_flake8', 'ament_pep257', 'ament_xmllint')
_INSTALLED = ('config', 'deploy', 'examples', 'launch', 'wireshark')


def found() -> list[str]:
    """Return the tools that are here."""
    specs = {name: find_spec(name) for name in TOOLS}
    # The folder launch of this tree has no origin.
    return [name for name, spec in specs.items() if spec is not None and spec.origin]


def are_demanded() -> bool:
    """Tell whether a missing tool is a fault."""
    return bool(os.environ.get('ABDF1_ROS_TOOLS'))


def needs(name: str) -> Any:
    """Return a module; skip the tests that need it where it is missing and may be."""
    return importlib.import_module(name) if are_demanded() else pytest.importorskip(name)


def install(folder: Path) -> None:
    """
    Make a prefix of ament in ``folder`` that has this source tree as its package.

    So no build is needed to have launch files and commands found.
    """
    share, commands = folder / 'share', folder / 'lib' / 'abdf1_ros'
    marker = share / 'ament_index' / 'resource_index' / 'packages' / 'abdf1_ros'
    marker.parent.mkdir(parents=True)
    marker.touch()
    commands.mkdir(parents=True)
    for name in _INSTALLED:  # and no more: launch would find the files of a build as well
        shutil.copytree(SOURCE / name, share / 'abdf1_ros' / name, copy_function=os.symlink)
    started = {name: f'-m abdf1_ros {name}' for name in COMMANDS} | {
        path.stem: f'"{path}"' for path in (SOURCE / 'examples').glob('*.py')}
    for name, arguments in started.items():
        command = commands / name
        command.write_text(
            f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n', encoding='utf-8')
        command.chmod(0o755)


def environment(folder: Path) -> dict[str, str]:
    """Return variables with which the tools find the package of ``install``."""
    def before(name: str, path: Path) -> str:
        return os.pathsep.join(filter(None, (str(path), os.environ.get(name, ''))))

    return {'AMENT_PREFIX_PATH': before('AMENT_PREFIX_PATH', folder),
            'PYTHONPATH': before('PYTHONPATH', SOURCE), 'ROS_HOME': str(folder / 'home')}


def ros2(*args: str) -> Process:
    """Start ``ros2`` with these arguments."""
    program = shutil.which('ros2')
    assert program is not None
    return Process(Path(program), *args, is_forked=False)
