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
Stand-ins for ``launch`` and ``launch_ros``, which are not to be had as wheels.

They take the arguments that the real classes take, as far as our launch files use them, and
remember them: a test sees what a launch file says, not that the real ``ros2 launch`` does it.
What would be started is then started by the tests, as a process with the same command line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
import re
import runpy
import sys
import tempfile
from types import ModuleType
from typing import Any

SOURCE = Path(__file__).resolve().parents[2]
LAUNCH = SOURCE / 'launch'

_COPIES = tempfile.TemporaryDirectory(prefix='abdf1_launch_')  # goes away with this process


@dataclass
class LaunchContext:
    launch_configurations: dict[str, str] = field(default_factory=dict)


@dataclass
class LaunchDescription:
    entities: Sequence[Any]


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: Any
    description: str
    choices: Sequence[str] | None = None

    def __init__(self, name: str, *, default_value: Any, description: str,
                 choices: Sequence[str] | None = None) -> None:
        self.name, self.default_value = name, default_value
        self.description, self.choices = description, choices


@dataclass
class OpaqueFunction:
    function: Callable[[LaunchContext], list[Any]]


@dataclass
class GroupAction:
    actions: Sequence[Any]
    scoped: bool = True


@dataclass
class PythonLaunchDescriptionSource:
    location: Any


@dataclass
class IncludeLaunchDescription:
    source: PythonLaunchDescriptionSource
    launch_arguments: Iterable[tuple[str, Any]]


@dataclass
class ExecuteProcess:
    cmd: Sequence[Any]
    name: str
    output: str
    emulate_tty: bool


class ThisLaunchFileDir:
    def __str__(self) -> str:
        return str(LAUNCH)


@dataclass
class FindPackageShare:
    package: str

    def __str__(self) -> str:
        assert self.package == 'abdf1_ros'
        return str(SOURCE)  # config/ and launch/ lie there as they do in share/


@dataclass
class PathJoinSubstitution:
    parts: Sequence[Any]

    def __str__(self) -> str:
        return '/'.join(map(str, self.parts))


@dataclass
class LaunchConfiguration:
    name: str


@dataclass
class ExecutableInPackage:
    executable: str
    package: str


@dataclass
class ParameterFile:
    path: str
    allow_substs: bool = False


@dataclass
class ParameterValue:
    value: Any
    value_type: type


@dataclass
class Node:
    package: str
    executable: str
    namespace: str
    name: str
    parameters: Sequence[Any]
    arguments: Sequence[str]
    output: str
    emulate_tty: bool
    respawn: bool
    respawn_delay: float

    def command(self) -> list[str]:
        """Return the arguments with which ``launch_ros`` would start the executable."""
        names = ['-r', f'__node:={self.name}']
        if self.namespace:
            names += ['-r', f'__ns:=/{self.namespace.strip("/")}']
        return [*self.arguments, '--ros-args', *names, *self._parameter_arguments()]

    def _parameter_arguments(self) -> Iterator[str]:
        for given in self.parameters:
            if isinstance(given, ParameterFile):
                yield from ('--params-file', _filled_in(given))
                continue
            for name, parameter in given.items():
                assert parameter.value_type is str
                yield from ('-p', f'{name}:="{parameter.value}"')


_MODULES: Mapping[str, Sequence[type]] = {
    'launch': (LaunchContext, LaunchDescription),
    'launch.actions': (DeclareLaunchArgument, ExecuteProcess, GroupAction,
                       IncludeLaunchDescription, OpaqueFunction),
    'launch.launch_description_sources': (PythonLaunchDescriptionSource,),
    'launch.substitutions': (LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir),
    'launch_ros': (),
    'launch_ros.actions': (Node,),
    'launch_ros.parameter_descriptions': (ParameterFile, ParameterValue),
    'launch_ros.substitutions': (ExecutableInPackage, FindPackageShare),
}


@contextmanager
def _stand_ins() -> Iterator[None]:
    before = {name: sys.modules.pop(name, None) for name in _MODULES}
    for name, classes in _MODULES.items():
        module = ModuleType(name)
        vars(module).update({kind.__name__: kind for kind in classes})
        sys.modules[name] = module
    sys.modules['launch'].LaunchDescriptionEntity = object  # type: ignore[attr-defined]
    try:
        yield
    finally:
        for name, module_before in before.items():
            del sys.modules[name]
            if module_before is not None:
                sys.modules[name] = module_before


def load(path: Path) -> Sequence[Any]:
    """Return the entities of a launch file."""
    with _stand_ins():
        description = runpy.run_path(str(path))['generate_launch_description']()
    assert isinstance(description, LaunchDescription)
    return description.entities


def bridge_node(**given: str) -> Node:
    """Return the node that bridge.launch.py starts with these arguments."""
    entities = load(LAUNCH / 'bridge.launch.py')
    defaults = {entity.name: entity.default_value for entity in entities
                if isinstance(entity, DeclareLaunchArgument)}
    assert given.keys() <= defaults.keys(), 'no such argument'
    (action,) = [entity for entity in entities if isinstance(entity, OpaqueFunction)]
    (node,) = action.function(LaunchContext(defaults | given))
    assert isinstance(node, Node)
    return node


def _filled_in(file: ParameterFile) -> str:
    """Return the name of a copy of ``file`` with its substitutions made."""
    if not file.allow_substs:
        return file.path
    text = re.sub(r'\$\(find-pkg-share abdf1_ros\)', str(SOURCE),
                  Path(file.path).read_text(encoding='utf-8'))
    copy = Path(_COPIES.name, Path(file.path).name)
    copy.write_text(text, encoding='utf-8')
    return str(copy)
