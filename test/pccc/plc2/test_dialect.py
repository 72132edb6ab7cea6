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

"""Requests with the commands of a PLC-2."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2.dialect import Plc2Dialect
import pytest

UNPROTECTED = Plc2Dialect(Access.UNPROTECTED)
PROTECTED = Plc2Dialect(Access.PROTECTED)
CIF = Plc2Dialect(Access.CIF)


def at(text: str) -> Address:
    """Return an address."""
    return parse_address(text, PlcType.PLC2)


@pytest.mark.parametrize(('mask', 'bits', 'encoded'), [
    (0x0001, 0x0001, '20 00 01 00'), (0x0080, 0x0000, '20 00 00 80'),
    (0x0100, 0x0100, '21 00 01 00'), (0x8000, 0x0000, '21 00 00 80'),
    (0x0180, 0xFF00, '20 00 00 80 21 00 01 00'), (0xFFFF, 0x00FF, '20 00 FF 00 21 00 00 FF')])
@pytest.mark.parametrize(('dialect', 'cmd'), [(UNPROTECTED, 0x05), (PROTECTED, 0x02)])
def test_bits_from_10_octal_on_are_in_the_odd_byte(dialect: Plc2Dialect, cmd: int, mask: int,
                                                   bits: int, encoded: str) -> None:
    assert dialect.write_bits(at('020'), mask, bits) == (cmd, bytes.fromhex(encoded))


def test_common_interface_file_has_no_bit_write() -> None:
    assert (UNPROTECTED.writes_bits, PROTECTED.writes_bits, CIF.writes_bits) == (True, True, False)
    with pytest.raises(FormatError, match='^a common interface file has no bit write$'):
        CIF.write_bits(at('020'), 1, 1)


@pytest.mark.parametrize(('dialect', 'read', 'write'), [
    (UNPROTECTED, 122, 121), (PROTECTED, 122, 121), (CIF, 47, 47)])
def test_longest_read_and_write_are_those_of_the_family(
        dialect: Plc2Dialect, read: int, write: int) -> None:
    assert (dialect.max_read(FileType.BINARY), dialect.max_write(FileType.BINARY)) == (read, write)
