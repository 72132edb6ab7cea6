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
Where the files and commands of this package are, and its version.

A path that a user has typed may begin at the home folder.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
import os
from pathlib import Path
import re
import shlex
import shutil
import sys

_PACKAGE = 'abdf1_ros'

# How a path begins that shells expand, and launch files, services and quotes do not.
_HOMES = '~/', '$HOME/'


def package_version() -> str:
    """Return the version of this package, as it is installed."""
    # this import takes a tenth of the time in which a command starts
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(_PACKAGE)
    except PackageNotFoundError:
        return 'of the source tree'


class ShowVersion(argparse.Action):
    """The option ``--version``; the version is looked up only if the option is given."""

    def __init__(self, option_strings: list[str], dest: str) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, default=argparse.SUPPRESS,
                         help="show program's version number and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print the version and end."""
        with suppress(OSError):  # as argparse does for its help
            print(f'abdf1_ros {package_version()}')
        parser.exit()


def expanded(path: str) -> str:
    """Return a path that a user has typed, with the home folder for a leading ~/ or $HOME/."""
    home = next((begin for begin in _HOMES if path.startswith(begin)), '')
    return os.path.expanduser('~/' + path.removeprefix(home)) if home else path


def config_file(name: str) -> Path:
    """Return a file of config/: of the installed package, or of the source tree."""
    return _folder('config') / name


def example_file(name: str) -> Path:
    """Return a file of examples/, from the same place as ``config_file``."""
    return _folder('examples') / name


def called(name: str) -> str:
    """Return the words that start a command of the package in this environment, for the shell."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    if shutil.which('ros2') and any(
            Path(prefix, 'lib', 'abdf1_ros', name).exists() for prefix in filter(None, prefixes)):
        return f'ros2 run abdf1_ros {name}'
    beside = Path(sys.executable).with_name
    for script, words in ((shutil.which(name), name), (shutil.which('abdf1'), f'abdf1 {name}'),
                          (str(beside(name)), shlex.quote(str(beside(name)))),
                          (str(beside('abdf1')), f'{shlex.quote(str(beside("abdf1")))} {name}')):
        # Other packages have commands of these names too, such as Node.js.
        if script and Path(script).is_file() and b'abdf1_ros' in Path(script).read_bytes()[:1000]:
            return words
    return f'{shlex.quote(sys.executable)} -m abdf1_ros {name}'


def as_called(name: str, text: str) -> str:
    """Return a help text in which each example of a command begins as the command does here."""
    start = f'  {called(name)}'
    return re.sub(f'^  {name}(?= |$)', lambda _: start, text, flags=re.MULTILINE)


def _folder(name: str) -> Path:
    source = Path(__file__).resolve().parent.parent / name
    return source if source.is_dir() else _share() / name


def _share() -> Path:
    try:
        from ament_index_python.packages import get_package_share_directory

        return Path(get_package_share_directory(_PACKAGE))
    except (ImportError, LookupError, OSError):  # installed without an ament index
        return Path(sys.prefix) / 'share' / _PACKAGE
