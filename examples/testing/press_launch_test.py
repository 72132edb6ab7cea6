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
Test a bridge and a simulated PLC with launch_testing; a launch file starts both.

Run it with ``launch_test press_launch_test.py``, or ``add_launch_test`` in a CMakeLists.txt. The
bridge runs as in the plant. With the fixture of test_press.py, a test can also change the PLC.
"""

import os
from pathlib import Path
import tempfile
import unittest

from launch import LaunchDescription
from launch.actions import ExecuteProcess
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage
from launch_testing.actions import ReadyToTest
import launch_testing.asserts
import launch_testing.markers
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int16MultiArray

FILES = {
    'data.csv': 'Station,PLC_Type,Address,Length,Values,Motion,Period\n1,SLC,N7:0,4,250,,\n',
    'map.csv': 'Tag,Command,Address,Station,PLC_Type,Period\npressure,Read,N7:0,1,SLC,100\n',
    'net.csv': 'Com_Port,Baud,Timeout\n/dev/plc,115200,200\n'}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@launch_testing.markers.keep_alive
def generate_test_description():
    """Return a simulator, and a bridge that waits for its port."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    folder = Path(tempfile.mkdtemp(prefix='press_'))
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding='utf-8')
    simulator = ExecuteProcess(cmd=[  # not a ROS node
        ExecutableInPackage('simulator', 'abdf1_ros'), '--pty', str(folder / 'plc'),
        '--data', str(folder / 'data.csv')])
    bridge = Node(package='abdf1_ros', executable='node', name='press', parameters=[{
        'net_file': str(folder / 'net.csv'), 'map_file': str(folder / 'map.csv'),
        'port': str(folder / 'plc')}])
    return LaunchDescription([simulator, bridge, ReadyToTest()]), {'bridge': bridge}


class TestPress(unittest.TestCase):
    """Tests while both processes run."""

    def test_pressure_comes_as_a_topic(self):
        rclpy.init()
        node = rclpy.create_node('test_press')
        came = []
        node.create_subscription(
            Int16MultiArray, '/press/read/pressure', came.append, LATCHED)
        for _ in range(400):
            if came:
                break
            rclpy.spin_once(node, timeout_sec=0.1)
        node.destroy_node()
        rclpy.shutdown()
        self.assertEqual(list(came[0].data), [250])


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    """Tests after both processes have ended."""

    def test_bridge_ends_well(self, proc_info, bridge):
        launch_testing.asserts.assertExitCodes(proc_info, [0], process=bridge)
