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

"""The names of a bridge's topics, and other nodes that publish them."""

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.topics.names import TopicNames
from support.cases import for_all
from support.mappings import make_mapping

ROWS = [make_mapping('B3:0/0', topic='door'), make_mapping('B3:1/0', topic='lamps'),
        make_mapping('N7:0', 'ReadWrite', topic='speed'),
        make_mapping('N7:4', 'Write', topic='recipe'),
        make_mapping('N7:9', 'Write', topic='recipe')]  # two rows may share a write topic


def names(**remaps: str) -> TopicNames:
    """Return the names at node /press; ``remaps`` by the names below it."""
    def resolve(name: str) -> str:
        return remaps.get(name.removeprefix('~/').replace('/', '_'), f'/press{name[1:]}')

    return TopicNames.of(resolve, ROWS)


def test_names_of_topics_have_the_remaps_in_them() -> None:
    assert names(read_door='/cell/door', write_recipe='/press/set') == TopicNames(
        {'door': '/cell/door', 'lamps': '/press/read/lamps', 'speed': '/press/read/speed'},
        {'speed': '/press/write/speed', 'recipe': '/press/set'},
        ('/press/write_results', '/press/active_stations', '/press/snapshot'))
    assert names().published == (
        '/press/read/door', '/press/read/lamps', '/press/read/speed', '/press/write_results',
        '/press/active_stations', '/press/snapshot')


@for_all(('remaps', 'topics', 'name'), [
    ({'read_door': '/bits', 'read_lamps': '/bits'}, '~/read/door, ~/read/lamps', '/bits'),
    ({'read_door': '/press/read/lamps'}, '~/read/door, ~/read/lamps', '/press/read/lamps'),
    ({'write_speed': '/set', 'write_recipe': '/set'}, '~/write/speed, ~/write/recipe', '/set'),
    # the bridge would feed the Fallback of one row with what it reads of the other
    ({'read_door': '/x', 'write_speed': '/x'}, '~/read/door, ~/write/speed', '/x'),
    ({'write_speed': '/press/read/speed'}, '~/read/speed, ~/write/speed', '/press/read/speed'),
    ({'read_door': '/press/snapshot'}, '~/read/door, ~/snapshot', '/press/snapshot')])
def test_two_topics_of_one_name_are_a_fault(
        remaps: dict[str, str], topics: str, name: str) -> None:
    try:
        names(**remaps)
    except ConfigurationError as error:
        assert [str(problem) for problem in error.problems] == [
            f'remaps: {topics} have one name, {name}; give each topic a name of its own']
    else:
        raise AssertionError(f'{remaps} are accepted')
