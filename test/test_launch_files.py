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

"""The launch files, started by the real ``ros2 launch``."""

from collections.abc import Callable, Iterator
from contextlib import suppress
import os
from pathlib import Path
import re
import signal
import socket
import time

from abdf1_ros.paths import config_file
from abdf1_ros.ros.launching import parameter_types
from diagnostic_msgs.msg import DiagnosticArray
import pytest
from std_srvs.srv import Trigger
from support.ptys import wait_until
from support.ros import EVERYTHING, get_parameters, Observer, Process
from support.ros_tools import environment, install, needs, ros2, SOURCE
import yaml

for name in ('launch', 'launch_ros', 'ros2launch'):
    needs(name)

LAUNCH = SOURCE / 'launch'
FILES = sorted(path.name for path in LAUNCH.glob('*.launch.py'))
FILES_GIVEN = {f'{name}_file': str(config_file(f'{name}.csv')) for name in ('net', 'map')}
EXAMPLE = [f'{name}:={path}' for name, path in FILES_GIVEN.items()]
# Before every line of a node stands which one it is.
LOG_LINE = re.compile(r'\[node-\d\] \S*\[([A-Z]+)\] \[[\d.]+\] \[([^]]+)\]: ')


@pytest.fixture(autouse=True)
def _installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path / 'prefix')
    for variable, value in environment(tmp_path / 'prefix').items():
        monkeypatch.setenv(variable, value)


Starter = Callable[..., Process]


@pytest.fixture
def launch() -> Iterator[Starter]:
    """Return what launches a file of the package."""
    processes = []

    def start(file: str, *arguments: str) -> Process:
        processes.append(ros2('launch', 'abdf1_ros', file, *arguments))
        return processes[-1]

    yield start
    for process in processes:
        if process.is_running:
            process.send(signal.SIGINT)
        process.result()


def ended(process: Process) -> str:
    """End what was launched as Ctrl-C does; return all that was said."""
    process.send(signal.SIGINT)
    process.result()
    assert 'process has died' not in process.text
    # Python may tell of a Ctrl-C that it has ignored, in ros2 itself.
    assert not [line for line in process.lines if line.startswith('[node') and 'Traceback' in line]
    return process.text


@pytest.mark.parametrize('file', FILES)
def test_every_argument_is_described(launch: Starter, file: str) -> None:
    shown = launch(file, '--show-args')
    assert shown.result() == 0
    names = re.findall(r"^    '(\w+)':$", shown.text, re.MULTILINE)
    assert names
    assert 'no description given' not in shown.text
    if file == 'bridge.launch.py':
        own = {'params_file', 'namespace', 'name', 'log_level', 'respawn'}
        assert set(names) == own | parameter_types().keys()


@pytest.mark.parametrize('file, argument, told', [
    ('bridge.launch.py', 'reda_only:=true', 'did you mean read_only?'),
    ('bridge.launch.py', 'xyz:=1', '--show-args lists them'),
    ('demo.launch.py', 'mapfile:=my.csv', 'did you mean map_file?'),
    ('three_lines.launch.py', 'read_only:=true', '--show-args lists them')])
def test_argument_that_does_not_exist_ends_the_launch(
        launch: Starter, file: str, argument: str, told: str) -> None:
    process = launch(file, *(EXAMPLE if file == 'bridge.launch.py' else []), argument)
    assert process.result() == 1
    assert f'{argument.partition(":")[0]}: there is no such argument; {told}' in process.text
    assert 'process started' not in process.text


@pytest.mark.parametrize('file, name, cure', [
    ('bridge', 'readonly', 'did you mean read_only? '),
    ('three_lines', 'read_only', 'write read_only into the parameter file. ')])
def test_protection_that_does_not_reach_the_bridge_ends_the_launch_that_includes_it(
        tmp_path: Path, file: str, name: str, cure: str) -> None:
    robot = including(tmp_path, file, **FILES_GIVEN if file == 'bridge' else {}, **{name: 'true'})
    process = ros2('launch', str(robot))
    assert process.result() == 1
    assert (f'{name} = "true": there is no such argument; {cure}If it is meant for another launch '
            'file, include this one in a group, with read_only "false"') in process.text
    assert 'process started' not in process.text


def test_other_misspelt_argument_of_an_include_is_warned_of(tmp_path: Path) -> None:
    robot = including(tmp_path, 'bridge', **FILES_GIVEN, loglevel='fatal', port='/dev/ttyS99')
    process = ros2('launch', str(robot))
    process.wait_for('/dev/ttyS99: cannot open the port')
    assert '[WARNING] [bridge.launch.py]: loglevel = "fatal": there is no such argument, so it ' \
        'has no effect; did you mean log_level?' in ended(process)


def including(folder: Path, file: str, **arguments: str) -> Path:
    """Return a launch file of a robot in Python that includes one of the package."""
    robot = folder / 'robot.launch.py'
    robot.write_text(
        'from launch import LaunchDescription\n'
        'from launch.actions import IncludeLaunchDescription\n'
        'def generate_launch_description():\n'
        f'    return LaunchDescription([IncludeLaunchDescription('
        f'{str(LAUNCH / f"{file}.launch.py")!r}, launch_arguments={arguments}.items())])\n',
        encoding='utf-8')
    return robot


@pytest.mark.parametrize('argument, told', [
    ('read_only:=maybe', "read_only = 'maybe' should be true or false"),
    ('trace_file:=off', 'trace_file = False should be text: YAML makes true or false of words')])
def test_value_that_cannot_be_meant_ends_the_launch_with_its_name(
        launch: Starter, argument: str, told: str) -> None:
    process = launch('bridge.launch.py', *EXAMPLE, argument)
    assert process.result() == 1
    assert told in process.text
    assert 'process started' not in process.text


def test_text_where_a_bool_is_meant_ends_the_node(tmp_path: Path) -> None:
    robot = tmp_path / 'robot.launch.py'
    robot.write_text(
        'from launch import LaunchDescription\n'
        'from launch_ros.actions import Node\n'
        'def generate_launch_description():\n'
        "    return LaunchDescription([Node(package='abdf1_ros', executable='node', "
        f"output='screen', parameters=[{FILES_GIVEN | {'read_only': 'true'}}])])\n",
        encoding='utf-8')
    process = ros2('launch', str(robot))
    process.wait_for("read_only = 'true' is a text and should be true or false: write it without "
                     'quotes, in Python True')
    process.result()
    assert 'exit code 2' in process.text


def test_bridge_needs_its_files(launch: Starter) -> None:
    process = launch('bridge.launch.py', EXAMPLE[0])
    assert process.result() == 1
    assert 'map_file: which file? Give map_file:=FILE.csv, or params_file' in process.text


# The bridge


def test_arguments_reach_the_node_and_beat_the_parameter_file(
        launch: Starter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    params = tmp_path / 'params.yaml'
    params.write_text('/**: {ros__parameters: {port: /dev/from_file, stale_after: 7.0}}\n')
    with Observer() as observer:
        process = launch('bridge.launch.py', *EXAMPLE, 'params_file:=~/params.yaml',
                         'port:=/dev/ttyS99', 'namespace:=cell', 'name:=line', 'read_only:=yes',
                         'write_timeout:=3', 'default_period:=50')
        process.wait_for('/dev/ttyS99: cannot open the port')
        assert get_parameters(
            observer, 'port', 'stale_after', 'read_only', 'write_timeout', 'default_period',
            node='/cell/line') == ['/dev/ttyS99', 7.0, True, 3.0, 50]
    ended(process)


@pytest.mark.parametrize('arguments', [
    ['bridge.launch.py', 'params_file'],
    ['three_lines.launch.py', 'one_process:=true', 'lines_file']])
def test_fault_of_a_parameter_file_names_the_file_of_the_user(
        launch: Starter, tmp_path: Path, arguments: list[str]) -> None:
    params = tmp_path / 'params.yaml'
    params.write_text('/abdf1: {ros__parameters: {port: !x y}}\n')
    *given, name = arguments
    process = launch(*given, f'{name}:={params}')
    process.wait_for(f'{params}:1:34: the tag !x: ROS does not know it')
    process.result()


def test_port_that_reads_like_a_number_is_text(launch: Starter) -> None:
    process = launch('bridge.launch.py', *EXAMPLE, 'port:=99')
    process.wait_for('/dev/ttyS98: cannot open the port')
    ended(process)


@pytest.mark.parametrize('namespace', ['', 'cell'])
def test_log_level_is_that_of_the_node_alone(launch: Starter, namespace: str) -> None:
    given = [f'namespace:={namespace}'] if namespace else []
    process = launch('bridge.launch.py', *EXAMPLE, *given, 'port:=/dev/ttyS99', 'log_level:=debug')
    process.wait_for('/dev/ttyS99: cannot open the port')
    lines = [LOG_LINE.match(text) for text in ended(process).splitlines()]
    assert {match[2] for match in lines if match} == {f'{namespace}.abdf1'.lstrip('.')}


def grouped(folder: Path, *arguments: str) -> Process:
    """Launch a bridge from the launch file of a robot, which has a namespace and a parameter."""
    outer = folder / 'outer.launch.xml'
    outer.write_text(
        '<launch><group><push-ros-namespace namespace="hall"/>'
        '<set_parameter name="port" value="/dev/ttyS99"/>'
        '<include file="$(find-pkg-share abdf1_ros)/launch/bridge.launch.py">'
        + ''.join(f'<arg name="{name}" value="{value}"/>' for name, _, value in (
            text.partition(':=') for text in (*EXAMPLE, *arguments)))
        + '</include></group></launch>', encoding='utf-8')
    return ros2('launch', str(outer))


def test_log_level_reaches_a_node_below_a_pushed_namespace(tmp_path: Path) -> None:
    with Observer() as observer:
        process = grouped(tmp_path, 'namespace:=cell', 'log_level:=fatal')
        assert get_parameters(observer, 'port', node='/hall/cell/abdf1') == ['/dev/ttyS99']
        assert not LOG_LINE.search(ended(process))


@pytest.mark.parametrize('yes', ['true', 'True'])
def test_faulty_configuration_is_not_started_again(launch: Starter, yes: str) -> None:
    process = launch('bridge.launch.py', 'net_file:=/nowhere/net.csv', EXAMPLE[1],
                     f'respawn:={yes}')
    process.wait_for('not started again after status 2: faulty files or parameters')
    process.result()  # nothing is left to be done
    assert process.text.count('process started with pid') == 1
    assert 'exit code 2' in process.text


def test_killed_bridge_is_started_again_in_its_group_until_the_launch_ends(tmp_path: Path) -> None:
    process = grouped(tmp_path, 'respawn:=true')
    for _ in range(2):
        before = len(process.lines)
        started = process.wait_for('process started with pid', after=before if _ else 0)
        process.wait_for('[hall.abdf1]: /dev/ttyS99: cannot', after=before if _ else 0)
        match = re.search(r'pid \[(\d+)\]', started)
        assert match
        os.kill(int(match[1]), signal.SIGKILL)
    process.wait_for('node-2: to be started again in 2 s')
    time.sleep(0.5)  # SIGINT ends the task of launch that runs just then, and launch waits for it
    process.send(signal.SIGINT)
    process.result()
    assert process.text.count('process started with pid') == 2


# The demo


@pytest.fixture
def demo_port() -> Iterator[str]:
    """Return the port that all demos have, once no other session on this machine has it."""
    with socket.socket(socket.AF_UNIX) as claim:
        def is_ours() -> bool:
            with suppress(OSError):
                claim.bind('\0abdf1_ros.test.demo')  # a name in no file system
                return True
            return False

        wait_until(is_ours)
        yield '/tmp/abdf1_demo'


def test_demo_runs_the_example_on_its_simulator_and_passes_arguments_on(
        launch: Starter, demo_port: str) -> None:
    with Observer() as observer:
        process = launch('demo.launch.py', 'namespace:=cell', 'log_level:=debug',
                         'port:=/dev/ttyS99')
        process.wait_for('DEBUG', '[cell.abdf1]')
        process.wait_for(f'{demo_port}: open')
        files = get_parameters(observer, 'net_file', 'map_file', node='/cell/abdf1')
    assert [Path(file).samefile(config_file(name))
            for file, name in zip(files, ('net.csv', 'map.csv'))] == [True, True]
    ended(process)


# A robot's own launch file


def test_robot_starts_its_bridge_and_its_cell_in_its_namespace(tmp_path: Path) -> None:
    example = SOURCE / 'examples' / 'robot.launch.xml'
    port = tmp_path / 'plc'
    with Observer() as observer, Process('simulator', '--pty', str(port)) as simulator:
        simulator.wait_for('stations 1 (PLC5), 2 (SLC) on')
        process = ros2('launch', str(example), 'robot:=robot_2', f'port:={port}', 'namespace:=a')
        try:
            process.wait_for('not permitted: the PLC permits; waiting for a reset')
            reset = '/robot_2/interlock_consumer/reset'
            assert observer.call(Trigger, reset, Trigger.Request()).success
            process.wait_for('] PERMITTED: the PLC permits')
            assert get_parameters(observer, 'port', 'read_only', node='/robot_2/abdf1') == [
                str(port), False]
        finally:
            ended(process)


# Three lines


@pytest.mark.parametrize('one_process', ['false', 'true'])
def test_three_lines_run_side_by_side(tmp_path: Path, one_process: str) -> None:
    robot = tmp_path / 'robot.launch.xml'
    robot.write_text('<launch><include file="$(find-pkg-share abdf1_ros)/launch/'
                     'three_lines.launch.py"/></launch>', encoding='utf-8')
    sections = yaml.safe_load((SOURCE / 'config' / 'three_lines.yaml').read_text('utf-8'))
    with Observer() as observer:
        diagnostics = observer.listen(DiagnosticArray, '/diagnostics', EVERYTHING)
        process = ros2('launch', str(robot), f'one_process:={one_process}', 'port:=/dev/lidar')
        for namespace in ('press', 'paint', 'packing'):
            process.wait_for(f'/dev/abdf1-{namespace}: cannot open the port')
        observer.until(
            lambda: {array.status[0].name for array in diagnostics} >= {
                f'{node.lstrip("/")}: link' for node in sections}, 'the diagnostics of all three')
        assert get_parameters(observer, 'net.baud', 'read_only', node='/paint/abdf1') == [
            9600, True]
        assert get_parameters(observer, 'net.mode', node='/packing/abdf1') == ['Peer']
    ended(process)


def test_faulty_lines_in_one_process_are_not_started_again(
        launch: Starter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    faulty = tmp_path / 'lines.yaml'
    faulty.write_text('/press/abdf1: {ros__parameters: {net_file: /no, map_file: /no}}\n')
    monkeypatch.setenv('HOME', str(tmp_path))
    process = launch('three_lines.launch.py', 'lines_file:=~/lines.yaml', 'one_process:=true')
    process.wait_for('exit code 2')
    process.result()  # nothing is left to be done
    assert process.text.count('process started with pid') == 1
