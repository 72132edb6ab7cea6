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

"""The order of the words of floats in word range commands."""

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.word_range.commands import in_line_order, word_on_line
import pytest


def at(text: str) -> Address:
    """Return an address of a PLC-5."""
    return parse_address(text, PlcType.PLC5)


@pytest.mark.parametrize('text', ['N7:0', 'T4:0', 'B3:0', 'ST9:0', 'MG9:0'])
def test_other_words_keep_their_order(text: str) -> None:
    assert in_line_order(at(text), b'\1\2\3\4\5\6') == b'\1\2\3\4\5\6'
    assert word_on_line(at(text)) == at(text)


def test_only_the_floats_of_a_pid_block_are_exchanged() -> None:
    words = [bytes((n, 0)) for n in range(82)]
    order = [data[0] for data in words]
    for first in (*range(2, 50, 2),):
        order[first], order[first + 1] = order[first + 1], order[first]
    line = in_line_order(at('PD10:1'), b''.join(words))
    assert list(line[::2]) == order


@pytest.mark.parametrize('text', ['F8:2', 'PD10:1', 'N7:0'])
def test_one_word_and_many_agree(text: str) -> None:
    address = at(text)
    data = bytes(range(164))
    line = in_line_order(address, data)
    for n in range(82):
        ours = word_on_line(address.at_offset(address.offset + n)).offset - address.offset
        assert line[2 * n:2 * n + 2] == data[2 * ours:2 * ours + 2]
