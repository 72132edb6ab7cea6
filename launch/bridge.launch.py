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

An argument left empty is not passed on, so that the default of the node, or what a parameter
file says, holds. ``ros2 launch abdf1_ros bridge.launch.py --show-args`` lists them all.
"""

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue

# Parameters of the node that have an argument here; all are strings.
PARAMETERS = ('net_file', 'map_file', 'port')


def start_node(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the node, with the arguments that were given."""
    arguments = context.launch_configurations
    # As ParameterValue, because a bare string that reads like a number would become one.
    given = {name: ParameterValue(arguments[name], value_type=str)
             for name in PARAMETERS if arguments[name]}
    # Later ones win: an argument beats the file, in which $(find-pkg-share ...) may stand.
    parameters: list[ParameterFile | dict[str, ParameterValue]] = []
    if arguments['params_file']:
        parameters.append(ParameterFile(arguments['params_file'], allow_substs=True))
    if given:
        parameters.append(given)
    return [Node(
        package='abdf1_ros',
        executable='node',
        namespace=arguments['namespace'],
        name=arguments['name'],
        parameters=parameters,
        arguments=['--ros-args', '--log-level', arguments['log_level']],
        output='screen',
        emulate_tty=True,
        respawn=arguments['respawn'] == 'true',
        respawn_delay=2.0,
    )]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'net_file', default_value='',
            description='CSV file of the serial link; needed here or in params_file'),
        DeclareLaunchArgument(
            'map_file', default_value='',
            description='CSV file of the mappings; needed here or in params_file'),
        DeclareLaunchArgument(
            'port', default_value='',
            description='serial device or pyserial URL; empty: Com_Port of the net file'),
        DeclareLaunchArgument(
            'params_file', default_value='',
            description='YAML file of further parameters; empty: none'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of the node'),
        DeclareLaunchArgument('name', default_value='abdf1', description='name of the node'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            choices=['debug', 'info', 'warn', 'error', 'fatal'],
            description='least severity that is logged'),
        DeclareLaunchArgument(
            'respawn', default_value='false', choices=['true', 'false'],
            description='start the node again, after 2 s, whenever it ends'),
        OpaqueFunction(function=start_node),
    ])
