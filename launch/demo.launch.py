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

"""Start a simulated PLC on a pseudo-terminal, and the bridge on that: no hardware needed."""

from launch import LaunchDescription
from launch.actions import ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution, ThisLaunchFileDir
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

PORT = '/tmp/abdf1_demo'


def generate_launch_description() -> LaunchDescription:
    """Start the simulator and the bridge; the bridge waits for the port by itself."""
    bridge = PathJoinSubstitution([ThisLaunchFileDir(), 'bridge.launch.py'])
    config = PathJoinSubstitution([FindPackageShare('abdf1_ros'), 'config'])
    return LaunchDescription([
        # No Node action: that would add --ros-args, and the simulator is no ROS node.
        ExecuteProcess(
            cmd=[ExecutableInPackage('simulator', 'abdf1_ros'), '--pty', PORT],
            name='simulator',
            output='screen',
            emulate_tty=True,
        ),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(bridge),
            launch_arguments={
                'net_file': PathJoinSubstitution([config, 'net.csv']),
                'map_file': PathJoinSubstitution([config, 'map.csv']),
                'port': PORT}.items(),
        ),
    ])
