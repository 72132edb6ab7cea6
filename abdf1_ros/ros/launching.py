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

"""Arguments and files of the launch files, checks of names and values, the scope of a restart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields
import difflib
from pathlib import Path
from typing import Any

from abdf1_ros.ros.parameters.declared import checked, Parameters
from abdf1_ros.ros.parameters.values import read_yaml
from abdf1_ros.text import printable

# A bridge without them writes, or answers beside its spare.
_PROTECTIONS = 'read_only', 'standby'

# How alike (0 to 1) names have to be. A protection may have a word more, as in bridge_read_only.
# Other arguments may not: use_respawn and map_yaml_file are of other launch files.
_LIKE_A_PROTECTION, _LIKE_AN_ARGUMENT = 0.65, 0.85


def parameter_types() -> dict[str, type]:
    """Return the type of each of the node's own parameters, by name."""
    return {entry.name: type(entry.default) for entry in fields(Parameters)}


def descriptions() -> dict[str, str]:
    """Return the description of each of the node's own parameters, with its default."""
    return {entry.name: entry.metadata['description']
            + (f'; default: {entry.default}' if entry.default != '' else '')
            for entry in fields(Parameters)}


def unknown_arguments(file: str, known: Iterable[str], argv: Sequence[str]) -> list[str]:
    """
    Return faults of the arguments ``name:=value`` of ``ros2 launch``.

    ROS silently drops an argument that a launch file does not know. ``file``: the launch file;
    ``known``: its arguments; ``argv``: the command line. If another launch file includes this one,
    the arguments of the command line are that file's.
    """
    if Path(file).name not in [Path(text).name for text in argv]:
        return []
    known = list(known)
    problems = []
    for name in [text.partition(':=')[0] for text in argv if ':=' in text]:
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            hint = f'did you mean {close[0]}?' if close else '--show-args lists them'
            problems.append(f'{name}: there is no such argument; {hint}')
    return problems


def misspelt(known: Iterable[str], given: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """
    Return faults and warnings of arguments that seem to be meant for a launch file.

    ``known``: the names that the file has; ``given``: all arguments in its scope, also the
    arguments of launch files that include it. A protection that is asked for without effect is a
    fault. If the right argument has the same value, the including file passes it on.
    """
    known, problems, warnings = list(known), [], []
    for name, value in given.items():
        meant = '' if name in known else _meant(name, known)
        if not meant or not isinstance(value, str):
            continue
        right = given.get(meant, '') if name != meant else ''
        told = f'{name} = "{printable(value)}": there is no such argument'
        if meant in _PROTECTIONS and not right and _is_asked_for(value):
            cure = f'did you mean {meant}?' if meant in known else (
                f'write {meant} into the parameter file.')
            problems.append(f'{told}; {cure} If it is meant for another launch file, include this '
                            f'one in a group, with {meant} "false"')
        elif name != meant and value != right:
            warnings.append(f'{told}, so it has no effect; did you mean {meant}?')
    return problems, warnings


def _meant(name: str, known: Sequence[str]) -> str:
    """Return the argument that a name resembles; empty if it resembles none."""
    close = (difflib.get_close_matches(name.lower(), _PROTECTIONS, 1, _LIKE_A_PROTECTION)
             or difflib.get_close_matches(name.lower(), known, 1, _LIKE_AN_ARGUMENT))
    return close[0] if close else ''


def _is_asked_for(text: str) -> bool:
    return read_yaml(text) not in (False, None, '')


def unusable(given: Mapping[str, str]) -> list[str]:
    """Return faults of the values of the node's own parameters, each with its name."""
    kinds, problems = parameter_types(), list[str]()
    for entry in fields(Parameters):
        if not (text := given[entry.name]):
            continue
        value = read_yaml(text)
        if kinds[entry.name] is str and not isinstance(value, int | float):
            value = text  # as launch passes it on
        try:
            checked(entry, value)
        except ValueError as error:
            problems.append(printable(str(error)))
    return problems


def has_substitutions(params_file: str) -> bool:
    """
    Return True if launch has to replace something in a parameter file.

    Launch gives the node a copy then, and faults name this copy instead of the user's file.
    """
    try:
        return '$(' in Path(params_file).read_text(encoding='utf-8', errors='replace')
    except OSError:  # launch tells why
        return True


def scope_of(context: Any) -> Callable[[Any], None]:
    """
    Return a function that makes a launch context what ``context`` is now.

    A group has ended when its node is started again. Its namespace, parameters, remappings and
    environment have ended with it.
    """
    now = deepcopy(context.launch_configurations), dict(context.environment)

    def restore(later: Any) -> None:
        for current, values in zip((later.launch_configurations, later.environment), now,
                                   strict=True):
            current.clear()
            current.update(deepcopy(values))  # a later action may append to a list of it
    return restore
