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

"""The bytes of the diagnostic commands (M 7-6..7-27)."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.diagnostics import ReadCounters
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import PlcType
from hypothesis import given
from hypothesis import strategies as st
import pytest


def parameters(data: bytes, fnc: int) -> Reader:
    """Return a reader after the FNC."""
    reader = Reader(data)
    assert reader.byte() == fnc
    return reader


def test_counters_are_asked_for_by_address_and_size() -> None:
    assert ReadCounters(0x4144, 26).encode() == b'\x01\x44\x41\x1A'


@given(address=st.integers(0, 0xFFFF), size=st.integers(0, 255))
def test_read_counters_is_read_as_it_was_made(address: int, size: int) -> None:
    request = ReadCounters(address, size)
    assert ReadCounters.read(parameters(request.encode(), diagnostics.READ_COUNTERS)) == request


@pytest.mark.parametrize('data', [b'', b'\0', b'\0\0', b'\0\0\x1A\x01'])
def test_read_counters_of_another_length_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError):
        ReadCounters.read(Reader(data))


def test_slc_echoes_less() -> None:
    assert [FAMILIES[kind].max_echo for kind in (PlcType.SLC, PlcType.PLC5)] == [236, 243]
