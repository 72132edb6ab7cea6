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

"""The extended address of a PLC-3 on the line."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from hypothesis import given
from hypothesis import strategies as st
import pytest

levels = st.integers(0, 0xFFFF)


@pytest.mark.parametrize(('address', 'encoded'), [
    (ExtendedAddress(8, 10), '2C 08 0A 00'), (ExtendedAddress(8, 260), '2C 08 FF 04 01 00'),
    (ExtendedAddress(3, 0, 9, 2), '3C 03 00 09 02'), (ExtendedAddress(5, 7, 0, 255),
                                                      '2C 05 07 FF FF 00')])
def test_extended_address_is_encoded_and_read_back(address: ExtendedAddress, encoded: str) -> None:
    assert address.encode() == bytes.fromhex(encoded)
    assert ExtendedAddress.read(Reader(bytes.fromhex(encoded))) == address


@given(st.builds(ExtendedAddress, levels, levels, levels, levels))
def test_every_address_is_read_back(address: ExtendedAddress) -> None:
    reader = Reader(address.encode())
    assert ExtendedAddress.read(reader) == address
    assert reader.is_empty


@pytest.mark.parametrize('encoded', [
    '', '00 41 42 00', '6C 08 0A 00', 'AC 08 0A 00', '2C 08 0A', '2D 02 08 0A 00',
    '2E 02 08 0A 00'])
def test_what_is_no_place_in_the_data_table(encoded: str) -> None:
    with pytest.raises(FormatError):
        ExtendedAddress.read(Reader(bytes.fromhex(encoded)))
