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

"""A column that is made up, Unseen: three files have to know it."""

from pathlib import Path

from support.patched import run_patched, touched

PATCH = Path(__file__).with_name('made_up_column.patch')

PROGRAM = """
from array import array
from abdf1_ros.driver.reads.point import ReadPoint
from support.mappings import cell_of, fault, one

row = one(Command='Read', Publish='Change', Unseen='7')
assert cell_of(row, 'Unseen') == '7' and cell_of(one(), 'Unseen') == ''
assert 'Unseen = "x" should be a number' in fault(Unseen='x')
assert 'a Write row has no Unseen: it is for Read' in fault(Command='Write', Unseen='7')
point = ReadPoint(row, 0.1, 0.6)
words = (b'\\x05\\x00', b'\\x07\\x00', b'\\x08\\x00')
assert [point.update(word, now) for now, word in enumerate(words)] == [
    array('h', [5]), None, array('h', [8])]
"""


def test_a_new_column_costs_three_files(tmp_path: Path) -> None:
    assert len(touched(PATCH)) <= 3
    run_patched(PATCH, PROGRAM, tmp_path)
