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

"""Which rows are named because their messages fill the line."""

from abdf1_ros.ros.diagnostics.load import FullLine
from support.mappings import make_mapping


def test_rows_whose_messages_fill_the_line_are_named_the_fullest_first() -> None:
    rows = [make_mapping(f'N7:{number}', 'Write', tag=f'w{number}') for number in range(2)]
    spent = dict.fromkeys(rows, 0.0)
    line = FullLine(spent)
    assert line.text(100.0) == ''
    spent[rows[0]], spent[rows[1]] = 1.0, 3.5
    assert line.text(104.0) == ''  # it is not looked at all the time
    assert line.text(105.0) == (
        'messages fill 90% of the line: w1 (70%), w0 (20%); set Write_Again to leave out '
        'unchanged values')
    spent[rows[1]] = 9.0
    assert line.text(120.0) == ''
