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

"""The launch files, read with stand-ins for launch; what they start is started for real."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
import py_compile

from abdf1_ros.ros.parameters import Parameters
from diagnostic_msgs.msg import DiagnosticArray
import pytest
from support.launch_stand_in import (
    bridge_node,
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
    LAUNCH,
    LaunchConfiguration,
    load,
    ParameterFile,
    ParameterValue,
    SOURCE,
)
from support.ros import EVERYTHING, get_parameters, Observer, Process
import yaml

FILES = sorted(LAUNCH.glob('*.launch.py'))
LINES_FILE = SOURCE / 'config' / 'three_lines.yaml'


def arguments(file: str) -> dict[str, DeclareLaunchArgument]:
    return {entity.name: entity for entity in load(LAUNCH / file)
            if isinstance(entity, DeclareLaunchArgument)}


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_every_launch_file_compiles_and_describes_something(path: Path, tmp_path: Path) -> None:
    py_compile.compile(str(path), str(tmp_path / 'compiled'), doraise=True)
    assert load(path)


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_every_argument_is_described(path: Path) -> None:
    assert all(argument.description for argument in arguments(path.name).values())


# The bridge


def test_bridge_has_the_arguments_that_are_promised() -> None:
    assert set(arguments('bridge.launch.py')) == {
        'net_file', 'map_file', 'port', 'params_file', 'namespace', 'name', 'log_level',
        'respawn'}


def test_empty_arguments_leave_the_defaults_of_the_node() -> None:
    node = bridge_node()
    assert (node.package, node.executable, node.name, node.namespace) == (
        'abdf1_ros', 'node', 'abdf1', '')
    assert node.parameters == []
    assert node.arguments == ['--ros-args', '--log-level', 'info']
    assert node.respawn is False


def test_arguments_reach_the_node_as_text_and_beat_the_parameter_file() -> None:
    node = bridge_node(
        net_file='/n.csv', map_file='/m.csv', port='1', params_file='/p.yaml',
        log_level='debug', respawn='true', namespace='cell', name='line')
    assert node.parameters == [
        ParameterFile('/p.yaml', allow_substs=True),
        {'net_file': ParameterValue('/n.csv', str), 'map_file': ParameterValue('/m.csv', str),
         'port': ParameterValue('1', str)}]
    assert node.arguments == ['--ros-args', '--log-level', 'debug']
    assert (node.respawn, node.respawn_delay) == (True, 2.0)
    assert (node.namespace, node.name) == ('cell', 'line')


def test_arguments_of_the_bridge_that_are_parameters_exist_in_the_node() -> None:
    (given,) = bridge_node(net_file='a', map_file='b', port='c').parameters
    assert given.keys() <= set(Parameters.__dataclass_fields__)


def test_bridge_starts_with_what_the_launch_file_says(tmp_path: Path) -> None:
    params = tmp_path / 'params.yaml'
    params.write_text('/**: {ros__parameters: {port: /dev/from_file, stale_after: 7.0}}\n')
    config = SOURCE / 'config'
    node = bridge_node(
        net_file=str(config / 'net.csv'), map_file=str(config / 'map.csv'),
        params_file=str(params), port='/dev/ttyS99', namespace='cell', name='line',
        log_level='debug')
    with Observer() as observer, Process('node', *node.command()) as process:
        process.wait_for('/dev/ttyS99: cannot open the port')
        assert get_parameters(observer, 'port', 'stale_after', node='/cell/line') == [
            '/dev/ttyS99', 7.0]
        process.end()


# The demo


def test_demo_starts_a_simulator_and_a_bridge_on_its_port() -> None:
    simulator, bridge = load(LAUNCH / 'demo.launch.py')
    assert isinstance(simulator, ExecuteProcess)
    assert isinstance(bridge, IncludeLaunchDescription)
    assert Path(str(bridge.source.location)) == LAUNCH / 'bridge.launch.py'
    given = {name: str(value) for name, value in bridge.launch_arguments}
    assert Path(given['net_file']).samefile(SOURCE / 'config' / 'net.csv')
    assert Path(given['map_file']).samefile(SOURCE / 'config' / 'map.csv')
    executable, *rest = simulator.cmd
    assert (executable.executable, executable.package) == ('simulator', 'abdf1_ros')
    assert rest == ['--pty', given['port']]


# Three lines


def included() -> list[dict[str, str]]:
    """Return the arguments of each bridge of three_lines.launch.py."""
    declared = {name: str(argument.default_value)
                for name, argument in arguments('three_lines.launch.py').items()}
    found = []
    for group in load(LAUNCH / 'three_lines.launch.py'):
        if isinstance(group, DeclareLaunchArgument):
            continue
        assert isinstance(group, GroupAction)
        assert group.scoped
        (include,) = group.actions
        assert Path(str(include.source.location)) == LAUNCH / 'bridge.launch.py'
        found.append({
            name: declared[value.name] if isinstance(value, LaunchConfiguration) else value
            for name, value in include.launch_arguments})
    return found


def test_three_lines_have_namespaces_names_and_parameters_of_their_own() -> None:
    lines = included()
    assert len(lines) == 3
    for key in ('namespace', 'name'):
        assert len({line[key] for line in lines}) == 3
    sections = yaml.safe_load(LINES_FILE.read_text(encoding='utf-8'))
    assert set(sections) == {f'/{line["namespace"]}/{line["name"]}' for line in lines}
    assert len({section['ros__parameters']['port'] for section in sections.values()}) == 3
    assert {Path(line['params_file']) for line in lines} == {LINES_FILE}


def test_three_lines_run_side_by_side() -> None:
    nodes = [bridge_node(**line) for line in included()]
    with Observer() as observer, ExitStack() as stack:
        diagnostics = observer.listen(DiagnosticArray, '/diagnostics', EVERYTHING)
        processes = [stack.enter_context(Process('node', *node.command())) for node in nodes]
        for process, port in zip(processes, ('press', 'paint', 'packing'), strict=True):
            process.wait_for(f'/dev/abdf1-{port}: cannot open the port')
        observer.until(
            lambda: {array.status[0].name for array in diagnostics} >= {
                f'{node.name}: link' for node in nodes}, 'the diagnostics of all three')
        assert get_parameters(observer, 'net.baud', 'read_only', node='/paint/paint_plc') == [
            9600, True]
        assert get_parameters(observer, 'net.mode', node='/packing/packing_plc') == ['Peer']
        for process in processes:
            process.end()
