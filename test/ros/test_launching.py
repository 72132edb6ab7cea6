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

"""Which arguments of a launch file are refused; the files themselves: test_launch_files.py."""

from abdf1_ros.ros.launching import descriptions, parameter_types, unknown_arguments
import pytest

FILE = '/ws/share/abdf1_ros/launch/bridge.launch.py'


@pytest.mark.parametrize('command', [
    ['ros2', 'launch', 'abdf1_ros', 'bridge.launch.py'], ['ros2', 'launch', './bridge.launch.py']])
def test_unknown_arguments_are_told_with_what_would_be_right(command: list[str]) -> None:
    given = [*command, 'port:=/dev/x', 'mapfile:=map.csv', 'a:=b:=c']
    assert unknown_arguments(FILE, ['port', 'map_file'], given) == [
        'mapfile: there is no such argument; did you mean map_file?',
        'a: there is no such argument; --show-args lists them']


def test_arguments_of_a_file_that_includes_this_one_are_its_own() -> None:
    assert not unknown_arguments(FILE, [], ['ros2', 'launch', 'cell', 'cell.launch.py', 'x:=1'])


def test_every_parameter_has_a_type_and_a_description() -> None:
    assert parameter_types()['read_only'] is bool
    assert parameter_types()['stale_after'] is float
    assert parameter_types()['default_period'] is int
    assert descriptions()['stale_after'].endswith('; default: 3.0')
    assert descriptions().keys() == parameter_types().keys()
