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

"""Parameter files, looked at before ROS reads them: its own errors hardly name a line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
import re

from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.text import printable
import yaml

_PARAMETERS = 'ros__parameters'
# Namespaces, a node, and wildcards for either.
_NAME = re.compile(r'[\w/*]+', re.ASCII)


def parameter_files(args: Sequence[str]) -> list[str]:
    """Return the parameter files among the arguments of a process."""
    return [path for option, path in zip(args, args[1:], strict=False)
            if option == '--params-file']


def parameter_tree(path: str) -> yaml.Node | None:
    """Return the nodes of YAML in a parameter file; ConfigurationError where it is not YAML."""
    try:
        return yaml.compose(Path(path).read_text(encoding='utf-8'))
    except yaml.MarkedYAMLError as error:
        mark, text = error.problem_mark, ' '.join(str(error.problem or error).split())
        if "'\\t'" in text:
            text = 'a tab; YAML is indented with spaces'
        place = Place(path, mark.line + 1, mark.column + 1) if mark else Place(path)
        raise ConfigurationError([Problem(place, text)]) from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigurationError([Problem(path, ' '.join(str(error).split()))]) from None


def check_parameter_files(args: Sequence[str]) -> None:
    """Raise ConfigurationError for files that are not YAML, and for names that ROS refuses."""
    problems = []
    for path in parameter_files(args):
        if Path(path).is_file():  # otherwise ROS says why it cannot be read
            problems += [Problem(Place(path, line), (
                f'"{printable(name)}" cannot name a node: letters, digits and underscores, '
                f'as in {re.sub("[^0-9A-Za-z_/]", "_", name)}'))
                for name, line in _sections(parameter_tree(path)) if not _NAME.fullmatch(name)]
    if problems:
        raise ConfigurationError(problems)


def _sections(tree: yaml.Node | None) -> Iterator[tuple[str, int]]:
    """Yield the names above parameters, each with its line."""
    for key, below in tree.value if isinstance(tree, yaml.MappingNode) else ():
        if key.value != _PARAMETERS:
            yield str(key.value), key.start_mark.line + 1
            yield from _sections(below)
