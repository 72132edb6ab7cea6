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

"""Word range requests to a PLC-3 and a PLC-5."""

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc3.dialect import PLC3
from abdf1_ros.pccc.plc5.dialect import PLC5_WORD_RANGE
from abdf1_ros.pccc.word_range.dialect import WordRangeDialect
import pytest

FAMILIES = {PlcType.PLC3: PLC3, PlcType.PLC5: PLC5_WORD_RANGE}


def at(text: str, family: str = 'PLC3') -> Address:
    """Return an address."""
    return parse_address(text, PlcType(family))


@pytest.mark.parametrize(('text', 'family', 'encoded'), [
    ('N7:5', 'PLC3', '2C 05 07 05'), ('B260:300', 'PLC3', '2C 08 FF 04 01 FF 2C 01'),
    ('T:9.ACC', 'PLC3', '3C 03 00 09 02'), ('C:0.PRE', 'PLC3', '2C 04 00 01'),
    ('I:017', 'PLC3', '2C 02 00 0F'), ('S:3', 'PLC3', '2C 0D 00 03'),
    ('T4:2.ACC', 'PLC5', '0E 04 02 02'), ('T4:2', 'PLC5', '06 04 02'),
    ('B3:300', 'PLC5', '06 03 FF 2C 01'), ('I:012', 'PLC5', '06 01 0A')])
def test_address_is_encoded_for_its_family(text: str, family: str, encoded: str) -> None:
    dialect: WordRangeDialect = FAMILIES[PlcType(family)]
    assert dialect.read(at(text, family), 1) == (
        0x0F, bytes.fromhex(f'01 00 00 01 00 {encoded} 02'))


@pytest.mark.parametrize(('family', 'letters', 'read', 'write'), [
    ('PLC3', 'N', 122, 114), ('PLC3', 'T', 120, 114), ('PLC5', 'N', 122, 116),
    ('PLC5', 'F', 122, 116), ('PLC5', 'T', 120, 114), ('PLC5', 'ST', 84, 84)])
def test_limits_are_whole_elements(family: str, letters: str, read: int, write: int) -> None:
    dialect, kind = FAMILIES[PlcType(family)], FileType(letters)
    assert (dialect.max_read(kind), dialect.max_write(kind)) == (read, write)


@pytest.mark.parametrize(('text', 'family'), [
    ('N999:9000', 'PLC3'), ('I999:7000', 'PLC3'), ('T:9000.CTL', 'PLC3'), ('N999:900', 'PLC5'),
    ('F999:900', 'PLC5'), ('T999:900', 'PLC5')])
def test_largest_write_fits_with_the_longest_address(text: str, family: str) -> None:
    dialect, address = FAMILIES[PlcType(family)], at(text, family)
    _, data = dialect.write(address, bytes(2 * dialect.max_write(address.file_type)))
    assert len(data) - 5 <= 240  # FNC, offset and total do not count
