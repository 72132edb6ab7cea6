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

from __future__ import annotations

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.address_errors import AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_types import PlcType
from hypothesis import given
from hypothesis import strategies as st
import pytest

PLC2 = PlcType.PLC2


@pytest.mark.parametrize(('text', 'word', 'bit', 'shown'), [
    ('020', 16, None, '020'), ('110/17', 72, 15, '110/17'), ('0', 0, None, '000'),
    ('7/3', 7, 3, '007/03'), ('77777', 0x7FFF, None, '77777'), ('$110/0', 72, 0, '110/00')])
def test_words_and_bits_are_octal(text: str, word: int, bit: int | None, shown: str) -> None:
    address = Address.parse(text, PLC2)
    assert (address.offset, address.bit, str(address)) == (word, bit, shown)


@given(st.integers(0, 0x7FFF), st.one_of(st.none(), st.integers(0, 15)))
def test_every_address_is_read_back(word: int, bit: int | None) -> None:
    address = Address.parse(f'{word:o}' + ('' if bit is None else f'/{bit:o}'), PLC2)
    assert (address.offset, address.bit) == (word, bit)
    assert Address.parse(str(address), PLC2) == address
    assert address.at_offset(word) == Address.parse(f'{word:o}', PLC2)
    assert word < address.area_size


@pytest.mark.parametrize('text', ['', 'N7:0', '020:1', '20/', '/1', '018', '20/9', '-1', '٢'])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(AddressSyntaxError, match='as in 020 or 110/17$'):
        Address.parse(text, PLC2)


@pytest.mark.parametrize(('text', 'right'), [
    ('100000', 'words run from 0 to 77777'), ('20/20', 'bits run from 0 to 17')])
def test_out_of_range(text: str, right: str) -> None:
    with pytest.raises(AddressRangeError, match=f'^{right} \\(octal\\)$'):
        Address.parse(text, PLC2)
