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
"""What has words in common with what."""

from abdf1_ros.pccc.extent import Extent
from abdf1_ros.settings.mapping import Mapping
import pytest
from support.mappings import make_mapping


def extent(text: str, length: int = 1, station: int = 1) -> Extent:
    """Return the words of a mapping."""
    row: Mapping = make_mapping(text, 'Write', plc='SLC', length=length, station=station)
    return row.extent


@pytest.mark.parametrize(('text', 'length', 'meets', 'holds'), [
    ('N7:5', 2, True, True), ('N7:4', 1, False, False), ('N7:7', 1, False, False),
    ('N7:4', 2, True, False), ('N7:6', 2, True, False), ('N7:4', 9, True, False),
    ('N7:6', 1, True, True), ('N7:5/3', 1, True, True), ('N7:4/15', 2, True, False),
    ('N7:4/14', 2, False, False), ('N9:5', 2, False, False)])
def test_extents_are_by_words(text: str, length: int, meets: bool, holds: bool) -> None:
    here, other = extent('N7:5', 2), extent(text, length)
    assert here.meets(other) is other.meets(here) is meets
    assert here.holds(other) is holds
    elsewhere = extent(text, length, station=2)
    assert not here.meets(elsewhere)
    assert not here.holds(elsewhere)
