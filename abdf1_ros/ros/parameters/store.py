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
What rclpy has no public way for: the only place that reaches into its nodes.

It holds for rclpy 7.1 (Jazzy); ``test/ros/test_parameter_store.py`` fails for an rclpy that keeps
its parameters elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter


def overrides(node: Node) -> Mapping[str, Parameter]:
    """Return all that the user has given; rclpy drops in silence what is not declared."""
    found: Mapping[str, Parameter] = node._parameter_overrides
    return found


def show(node: Node, texts: Iterable[tuple[str, str, str]]) -> None:
    """
    Declare read-only parameters, each a name, a text and a description.

    ``declare_parameters`` would send an event for each: 120,000 for 5000 rows, in 12 s.
    """
    for name, value, description in texts:
        node._parameters[name] = Parameter(name, Parameter.Type.STRING, value)
        node._descriptors[name] = ParameterDescriptor(
            name=name, type=ParameterType.PARAMETER_STRING, description=description,
            read_only=True)


def forget(node: Node, prefix: str) -> None:
    """Undeclare parameters; rclpy does it for none that are read-only."""
    for name in [name for name in node._parameters if name.startswith(prefix)]:
        del node._parameters[name], node._descriptors[name]
