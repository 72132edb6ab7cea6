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

"""BCC and CRC-16: published values, and what each of them covers."""

from abdf1_ros.df1.checksum import bcc, Checksum, crc16
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.vectors import MESSAGES, Vector


def test_crc_check_value_of_the_literature() -> None:
    assert crc16(b'123456789') == 0xBB3D


@pytest.mark.parametrize(('data', 'value'), [
    ('08 09 06 00 02 04 03', 0xE0), ('08 09 06 00 10 04 03', 0xD2), ('', 0), ('80 80', 0)])
def test_bcc_of_the_manual(data: str, value: int) -> None:
    assert bcc(bytes.fromhex(data)) == value


@for_all('vector', MESSAGES)
def test_check_of_every_vector(vector: Vector) -> None:
    check = vector.checksum.encode(vector.checksum.of_message(vector.link_data, vector.station))
    assert vector.frame.endswith(check) is vector.valid
    if vector.expected is not None:
        assert int.from_bytes(check, 'little') == vector.expected


@given(st.binary(min_size=1, max_size=261), st.integers(0), st.integers(1, 0xFFFF))
def test_crc_sees_every_error_burst_of_up_to_16_bits(data: bytes, place: int, burst: int) -> None:
    at = place % (8 * len(data))
    number = int.from_bytes(data, 'little') ^ burst << at
    damaged = number.to_bytes(len(data) + 3, 'little')[:len(data)]
    same = damaged == data
    assert (Checksum.CRC.of_message(damaged) == Checksum.CRC.of_message(data)) is same


def test_frames_that_a_micrologix_1400_and_its_software_have_sent() -> None:
    """From a question in a public forum; of the command the last byte is cut off there."""
    reply = bytes.fromhex('00014F00FB6F00000000000000FFFF00000000000000FFFF')
    command = bytes.fromhex('01000F00FB6FA3FFA84FFFAC51FFAE51FF9C4FFF9451FF9651')
    assert Checksum.CRC.encode(Checksum.CRC.of_message(reply)) == b'\xBE\x07'
    assert Checksum.CRC.encode(Checksum.CRC.of_message(command)) == b'\x4B\x01'
