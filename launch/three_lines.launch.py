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
Start the bridges of a cell with three serial lines, each in the namespace of its machine.

config/three_lines.yaml has the parameters of each bridge; copy both files and change them. A
bridge that ends by itself is started again, unless its files or parameters are faulty. With
one_process:=true all bridges run in one process, the command "lines". An unknown argument ends the
launch.
"""

import sys

from abdf1_ros.paths import expanded
from abdf1_ros.ros.launching import (
    has_substitutions,
    misspelt,
    parameter_types,
    scope_of,
    unknown_arguments,
)
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
    TimerAction,
)
from launch.conditions import IfCondition, UnlessCondition
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.logging import get_logger
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile
from launch_ros.substitutions import FindPackageShare

# The namespaces: values are on /press/abdf1/read/... and so on.
LINES = ('press', 'paint', 'packing')

# Exit status for faulty files or parameters, which do not become better by trying again.
FAULTY = 2

# Seconds for the end after Ctrl-C; launch kills the process some seconds after them.
LONGEST_END = '10'


def line(namespace: str) -> GroupAction:
    """Return one bridge, in a scope of its own: its arguments do not reach the next bridge."""
    bridge = PathJoinSubstitution([ThisLaunchFileDir(), 'bridge.launch.py'])
    # All of them: an argument that is not given comes from the launch file that includes this one.
    arguments = dict.fromkeys(parameter_types(), '') | {
        'namespace': namespace, 'name': 'abdf1', 'log_level': 'info', 'respawn': 'true',
        'params_file': LaunchConfiguration('lines_file')}
    return GroupAction([IncludeLaunchDescription(
        PythonLaunchDescriptionSource(bridge), launch_arguments=arguments.items())],
        condition=UnlessCondition(LaunchConfiguration('one_process')))


def start_lines(context: LaunchContext) -> list[Node]:
    """Return all bridges in one process."""
    lines_file = expanded(context.launch_configurations['lines_file'])
    return [all_lines(lines_file, OpaqueFunction(function=scope_of(context)))]


def all_lines(lines_file: str, restore: OpaqueFunction) -> Node:
    """
    Return all bridges in one process, started again unless their settings are faulty.

    ``restore`` brings back the scope of their first start.
    """
    def started_again(event: ProcessExited, context: LaunchContext) -> list[TimerAction]:
        if context.is_shutdown or event.returncode == FAULTY:
            return []
        return [TimerAction(period=2.0, actions=[GroupAction([
            restore, all_lines(lines_file, restore)])])]

    sections = ParameterFile(lines_file, allow_substs=has_substitutions(lines_file))
    return Node(package='abdf1_ros', executable='lines', output='screen', parameters=[sections],
                sigterm_timeout=LONGEST_END, on_exit=started_again)


def refuse_unknown(context: LaunchContext) -> None:
    """Raise RuntimeError for an unknown argument: parameters belong in the file."""
    known = 'lines_file', 'one_process'
    misspelt_ones, warnings = misspelt(known, context.launch_configurations)
    if problems := unknown_arguments(__file__, known, sys.argv) or misspelt_ones:
        raise RuntimeError('; '.join(problems))
    for text in warnings:
        get_logger('three_lines.launch.py').warning(text)


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the bridges."""
    lines_file = PathJoinSubstitution(
        [FindPackageShare('abdf1_ros'), 'config', 'three_lines.yaml'])
    return LaunchDescription([
        DeclareLaunchArgument(
            'lines_file', default_value=lines_file,
            description='YAML file with the parameters of the three bridges'),
        DeclareLaunchArgument(
            'one_process', default_value='false',
            description='true: all bridges in one process; not if a group has a namespace'),
        OpaqueFunction(function=refuse_unknown),
        *map(line, LINES),
        OpaqueFunction(function=start_lines,
                       condition=IfCondition(LaunchConfiguration('one_process'))),
    ])
