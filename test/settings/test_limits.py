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


"""Min and Max of values that are written."""

from array import array

from abdf1_ros.errors import FormatError
from abdf1_ros.settings.limits import raw_values
import pytest
from support.mappings import make_mapping


def test_limit_of_floats_is_as_near_as_a_float32_can_come_to_it() -> None:
    mapping = make_mapping('F8:0', 'Write', minimum=-0.1, maximum=0.1)
    (tenth,) = array('f', [0.1])
    assert tenth > 0.1
    assert raw_values(mapping, [tenth]) == [tenth]
    assert raw_values(mapping, [-tenth]) == [-tenth]
    with pytest.raises(FormatError, match=r'value 0.1001 at index 0 is outside Min -0.1, Max 0.1'):
        raw_values(mapping, [0.1001])


def test_limit_of_long_words_is_not_that_of_a_float32() -> None:
    mapping = make_mapping('L10:0', 'Write', plc='SLC', maximum=16_777_217)
    assert raw_values(mapping, [16_777_217]) == [16_777_217]
    with pytest.raises(FormatError, match='outside Min -inf, Max 16777217'):
        raw_values(mapping, [16_777_218])
