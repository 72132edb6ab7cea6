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

"""A subscriber that keeps the last value reliably, and says when it gets one."""

import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int16MultiArray


def main() -> None:
    """Listen until interrupted."""
    rclpy.init()
    node = rclpy.create_node('stalling')
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    subscription = node.create_subscription(
        Int16MultiArray, '/abdf1/read/speeds', lambda message: print('got', flush=True), qos)
    assert subscription.handle
    try:
        rclpy.spin(node)
    except rclpy.executors.ExternalShutdownException:
        pass


if __name__ == '__main__':
    main()
