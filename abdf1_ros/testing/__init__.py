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
Fixtures of pytest for programs and nodes that need PLCs; see docs/tutorials/testing.md.

``pytest_plugins = ['abdf1_ros.testing']`` in a conftest.py makes two of them available:
``abdf1_plcs`` has simulated PLCs for a Python program, and ``abdf1_cell`` also a bridge and an
observer of its topics. Only ``abdf1_cell`` needs ROS 2. Where ROS 2 is installed, the plugin keeps
all topics on this machine, in a ROS domain of its own.
"""

from abdf1_ros.testing.plcs import Plcs

__all__ = ['Plcs', 'pytest_plugins']

# A module of its own, so that Plcs do without pytest.
pytest_plugins = ['abdf1_ros.testing.fixtures']
