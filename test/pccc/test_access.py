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

"""The ways to a PLC's words."""

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
import pytest


@pytest.mark.parametrize(('family', 'names'), [
    ('PLC2', ['Unprotected', 'Protected', 'CIF']), ('PLC3', ['WordRange']),
    ('PLC5', ['Typed', 'WordRange']), ('SLC', ['Slot', 'Flat'])])
def test_ways_of_a_family_the_usual_one_first(family: str, names: list[str]) -> None:
    assert [access.value for access in FAMILIES[PlcType(family)].accesses] == names


def test_every_access_belongs_to_a_family() -> None:
    assert {way for family in FAMILIES for way in FAMILIES[family].accesses} == set(Access)
