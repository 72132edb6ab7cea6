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

"""A publisher with a liveliness lease (s) that publishes a value on a topic until it is killed."""

import sys
import time

import rclpy
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from std_msgs.msg import Int16MultiArray

if __name__ == '__main__':
    topic, lease, value = sys.argv[1:]
    rclpy.init(args=[])
    publisher = rclpy.create_node('robot').create_publisher(
        Int16MultiArray, topic,
        QoSProfile(depth=1, liveliness_lease_duration=Duration(seconds=float(lease))))
    while True:
        publisher.publish(Int16MultiArray(data=[int(value)]))
        time.sleep(0.05)
