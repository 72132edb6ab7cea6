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
Start a simulated PLC on a pseudo-terminal, and a bridge to this PLC: no hardware needed.

All arguments, for instance log_level:=debug, are passed on to the bridge. The launch file sets the
port itself. An unknown argument ends the launch.
"""

import sys

from abdf1_ros.ros.launching import parameter_types, unknown_arguments
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

PORT = '/tmp/abdf1_demo'

# Arguments that are passed on to the bridge, with their defaults. Its port is the simulator's.
DEFAULTS = {'params_file': '', 'namespace': '', 'name': 'abdf1', 'log_level': 'info',
            'respawn': 'false'}


def refuse_unknown(context: LaunchContext) -> None:
    """Raise RuntimeError if the bridge does not know an argument."""
    problems = unknown_arguments(__file__, [*DEFAULTS, *parameter_types()], sys.argv)
    if problems:
        raise RuntimeError('; '.join(problems))


def generate_launch_description() -> LaunchDescription:
    """Start the simulator and the bridge; the bridge waits for the port by itself."""
    config = PathJoinSubstitution([FindPackageShare('abdf1_ros'), 'config'])
    files = {f'{name}_file': PathJoinSubstitution([config, f'{name}.csv'])
             for name in ('net', 'map')}
    defaults = files | DEFAULTS
    passed_on = {name: LaunchConfiguration(name) for name in defaults}
    return LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=default, description='passed on to bridge.launch.py')
          for name, default in defaults.items()),
        OpaqueFunction(function=refuse_unknown),
        # No Node action: that would add --ros-args, and the simulator is not a ROS node.
        ExecuteProcess(
            cmd=[ExecutableInPackage('simulator', 'abdf1_ros'), '--pty', PORT],
            name='simulator',
            output='screen',
            emulate_tty=True,
        ),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(
                PathJoinSubstitution([ThisLaunchFileDir(), 'bridge.launch.py'])),
            launch_arguments={**passed_on, 'port': PORT}.items(),
        ),
    ])
