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

"""Addresses of a PLC-2."""

from abdf1_ros.pccc.address import AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
import pytest

PLC2 = PlcType.PLC2


@pytest.mark.parametrize(('text', 'word', 'bit', 'shown'), [
    ('020', 16, None, '020'), ('110/17', 72, 15, '110/17'), ('0', 0, None, '000'),
    ('7/3', 7, 3, '007/03'), ('077777', 0x7FFF, None, '077777'), ('11017', 72, 15, '110/17'),
    ('7777', 0o7777, None, '7777'), ('10000/1', 0o10000, 1, '010000/01'),
    ('$110/0', 72, 0, '110/00')])
def test_words_and_bits_are_octal(text: str, word: int, bit: int | None, shown: str) -> None:
    address = parse_address(text, PLC2)
    assert (address.offset, address.bit, str(address)) == (word, bit, shown)


@pytest.mark.parametrize('text', ['', 'N7:0', '020:1', '20/', '/1', '018', '20/9', '-1', '٢'])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(AddressSyntaxError, match='as in 020 or 110/17$'):
        parse_address(text, PLC2)


@pytest.mark.parametrize(('text', 'right'), [
    ('100000', 'words run from 0 to 77777'), ('11020', 'bits run from 0 to 17'),
    ('20/20', 'bits run from 0 to 17')])
def test_out_of_range(text: str, right: str) -> None:
    with pytest.raises(AddressRangeError, match=f'^{right} \\(octal\\)$'):
        parse_address(text, PLC2)
