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
Start the bridge.

Every parameter of the node is an argument here. An empty argument is not passed on: then the
parameter file or the node's default decides. An unknown argument ends the launch; in a launch file
that includes this one, a misspelt protection does. ``ros2 launch abdf1_ros bridge.launch.py
--show-args`` lists all arguments.
"""

import sys

from abdf1_ros.paths import expanded
from abdf1_ros.ros.launching import (
    descriptions,
    has_substitutions,
    misspelt,
    parameter_types,
    scope_of,
    unknown_arguments,
    unusable,
)
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    TimerAction,
)
from launch.events.process import ProcessExited
from launch.logging import get_logger
from launch.substitutions import TextSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.utilities import make_namespace_absolute, prefix_namespace

# Exit status for faulty files or parameters, which do not become better by trying again.
FAULTY = 2
RESPAWN_DELAY = 2.0

# Seconds for the end after Ctrl-C; launch kills the process some seconds after them.
LONGEST_END = '10'

YES, NO = ('true', 'True'), ('false', 'False')

OWN = ('params_file', 'namespace', 'name', 'log_level', 'respawn')


def start_node(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the node, with the given arguments."""
    # A copy, because the context may have changed when the node ends.
    arguments = dict(context.launch_configurations)
    known = [*OWN, *parameter_types()]
    misspelt_ones, warnings = misspelt(known, arguments)
    problems = unknown_arguments(__file__, known, sys.argv) or misspelt_ones
    problems += unusable(arguments)
    if not arguments['params_file']:
        problems += [f'{name}: which file? Give {name}:=FILE.csv, or params_file:=FILE.yaml'
                     for name in ('net_file', 'map_file') if not arguments[name]]
    if problems:
        raise RuntimeError('; '.join(problems))
    for text in warnings:
        get_logger('bridge.launch.py').warning(text)
    return [bridge(arguments, OpaqueFunction(function=scope_of(context)))]


def bridge(arguments: dict[str, str], restore: OpaqueFunction) -> Node:
    """
    Return a bridge that is started again if ``arguments`` say so, unless it refused them.

    ``restore`` brings back the scope of its first start.
    """
    def started_again(event: ProcessExited,
                      context: LaunchContext) -> list[LaunchDescriptionEntity]:
        if arguments['respawn'] not in YES or context.is_shutdown:
            return []
        if event.returncode == FAULTY:
            return [LogInfo(msg=f'{event.process_name}: not started again after status {FAULTY}: '
                                'faulty files or parameters')]
        return [LogInfo(msg=f'{event.process_name}: to be started again in {RESPAWN_DELAY:g} s'),
                TimerAction(period=RESPAWN_DELAY, actions=[
                    GroupAction([restore, bridge(arguments, restore)])])]

    # With types: otherwise launch turns a text that looks like a number into a number.
    given = {name: ParameterValue(TextSubstitution(text=arguments[name]), value_type=kind)
             for name, kind in parameter_types().items() if arguments[name]}
    # The last entry wins, so arguments come after the file. The file may contain $(find-pkg-share
    # ...).
    parameters: list[ParameterFile | dict[str, ParameterValue]] = []
    if params_file := expanded(arguments['params_file']):
        parameters.append(ParameterFile(
            params_file, allow_substs=has_substitutions(params_file)))
    if given:
        parameters.append(given)
    return Node(
        package='abdf1_ros',
        executable='node',
        namespace=arguments['namespace'],
        name=arguments['name'],
        parameters=parameters,
        ros_arguments=['--log-level', f'{logger(arguments)}:={arguments["log_level"]}'],
        output='screen',
        emulate_tty=True,
        sigterm_timeout=LONGEST_END,
        on_exit=started_again,
    )


def logger(arguments: dict[str, str]) -> str:
    """Return the name of the node's logger; a level without a name also applies to rcl and rmw."""
    namespace = make_namespace_absolute(
        prefix_namespace(arguments.get('ros_namespace'), arguments['namespace']))
    parts = [*(namespace or '').split('/'), arguments['name']]
    return '.'.join(part for part in parts if part)


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=text)
          for name, text in descriptions().items()),
        DeclareLaunchArgument(
            'params_file', default_value='',
            description='YAML file with more parameters; empty: none. Launch replaces $(...) '
                        'everywhere in it, even in comments'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of the node'),
        DeclareLaunchArgument('name', default_value='abdf1', description='name of the node'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            choices=['debug', 'info', 'warn', 'error', 'fatal'],
            description='lowest severity that the node logs; rcl and rmw keep their own levels'),
        DeclareLaunchArgument(
            'respawn', default_value='false', choices=[*YES, *NO],
            description='start the node again 2 s after it has ended; not after status 2 (faulty '
                        'files or parameters)'),
        OpaqueFunction(function=start_node),
    ])
