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

"""Arguments of the launch files, a check for unknown names, and the scope of a restart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from dataclasses import fields
import difflib
from pathlib import Path
from typing import Any

from abdf1_ros.ros.parameters.declared import Parameters


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
    there is nothing to check.
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
