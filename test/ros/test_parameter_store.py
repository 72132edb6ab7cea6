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

"""Where rclpy keeps parameters: what reaches into it has the effect of its public ways."""

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version

from abdf1_ros.ros.parameters.store import forget, overrides, show
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from support.ros import Observer


def rclpy_version() -> str:
    """Return the version that the fields of a node are those of."""
    try:
        return version('rclpy')
    except PackageNotFoundError:
        return 'of the sourced ROS'


@pytest.fixture
def node() -> Iterator[Node]:
    given = [Parameter('known', value=1), Parameter('unknown', value='x')]
    with Observer() as observer:
        node = Node('store', context=observer.context, parameter_overrides=given)
        node.declare_parameter('known', 0)
        missing = [name for name in ('_parameter_overrides', '_parameters', '_descriptors')
                   if not isinstance(getattr(node, name, None), dict)]
        assert not missing, f'rclpy {rclpy_version()} keeps its parameters elsewhere: {missing}'
        yield node
        node.destroy_node()


def test_overrides_are_all_that_was_given(node: Node) -> None:
    assert {name: overrides(node)[name].value for name in ('known', 'unknown')} == {
        'known': 1, 'unknown': 'x'}


def test_what_is_shown_is_declared_until_it_is_forgotten(node: Node) -> None:
    show(node, [('map.a', 'text', 'of a row')])
    assert node.get_parameter('map.a').value == 'text'
    descriptor = node.describe_parameter('map.a')
    assert (descriptor.description, descriptor.read_only) == ('of a row', True)
    assert not node.set_parameters([Parameter('map.a', value='other')])[0].successful
    forget(node, 'map.')
    assert not node.has_parameter('map.a')
    assert node.get_parameter('known').value == 1
