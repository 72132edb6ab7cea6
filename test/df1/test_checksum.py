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


def test_crc_begins_with_zero() -> None:
    assert crc16(b'') == 0
    assert crc16(b'\x00\x00') == 0


@pytest.mark.parametrize(('data', 'value'), [
    ('08 09 06 00 02 04 03', 0xE0), ('08 09 06 00 10 04 03', 0xD2), ('', 0), ('80 80', 0)])
def test_bcc_of_the_manual(data: str, value: int) -> None:
    assert bcc(bytes.fromhex(data)) == value


@pytest.mark.parametrize(('station', 'value'), [(0, 0), (1, 0xFF), (0x11, 0xEF), (0xFE, 0x02)])
def test_bcc_of_a_poll_is_the_complement_of_its_station(station: int, value: int) -> None:
    assert bcc(b'', station) == value


def test_bcc_covers_the_station_of_a_master_frame() -> None:
    data = bytes.fromhex('08 09 06 00 10 04 03')
    assert Checksum.BCC.of_message(data) == 0xD2
    assert Checksum.BCC.of_message(data, 0x20) == 0xB2


def test_crc_of_a_slave_frame_covers_data_and_etx() -> None:
    data = bytes.fromhex('07 11 41 00 53 B9') + bytes(12)
    assert Checksum.CRC.of_message(data) == 0x4C6B
    assert Checksum.CRC.of_message(data) == crc16(data + b'\x03')


def test_crc_of_a_master_frame_covers_stn_stx_data_and_etx() -> None:
    data = bytes.fromhex('11 07 01 00 41 00 12 00 0C')
    assert Checksum.CRC.of_message(data, 0x11) == 0x40CF
    assert Checksum.CRC.of_message(data, 0x11) == crc16(b'\x11\x02' + data + b'\x03')


def test_crc_of_a_master_frame_to_station_zero_covers_it_too() -> None:
    assert Checksum.CRC.of_message(b'abc', 0) == crc16(b'\x00\x02abc\x03')
    assert Checksum.CRC.of_message(b'abc', 0) != Checksum.CRC.of_message(b'abc')


@for_all('vector', MESSAGES)
def test_check_of_every_vector(vector: Vector) -> None:
    check = vector.checksum.encode(vector.checksum.of_message(vector.link_data, vector.station))
    assert vector.frame.endswith(check) is vector.valid
    if vector.expected is not None:
        assert int.from_bytes(check, 'little') == vector.expected


def test_crc_goes_on_the_line_low_byte_first() -> None:
    assert Checksum.CRC.encode(0x40CF) == b'\xCF\x40'
    assert Checksum.BCC.encode(0xB2) == b'\xB2'
    assert (Checksum.CRC.size, Checksum.BCC.size) == (2, 1)


@given(st.binary(max_size=300), st.integers(0, 255))
def test_sum_of_covered_bytes_and_bcc_is_zero(data: bytes, station: int) -> None:
    assert (station + sum(data) + bcc(data, station)) % 256 == 0


@given(st.binary(min_size=1, max_size=261), st.integers(0), st.integers(1, 0xFFFF))
def test_crc_sees_every_error_burst_of_up_to_16_bits(data: bytes, place: int, burst: int) -> None:
    at = place % (8 * len(data))
    number = int.from_bytes(data, 'little') ^ burst << at
    damaged = number.to_bytes(len(data) + 3, 'little')[:len(data)]
    same = damaged == data
    assert (Checksum.CRC.of_message(damaged) == Checksum.CRC.of_message(data)) is same
