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

"""Echo and diagnostic status, which every emulated PLC answers (M 7-6, 7-9, 10-3..10-6)."""

from __future__ import annotations

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import SERVED_FAMILIES, Server
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.properties import PROPERTY
from support.vectors import pair

REMOTE_RUN = 6


def answer(plc_type: PlcType, data: bytes) -> Packet:
    """Return what a PLC with an empty table answers to CMD 06."""
    return Server(DataTable(plc_type)).serve(Packet(1, 9, 0x06, 0, 0x1234, data))


@pytest.mark.parametrize('plc_type', SERVED_FAMILIES)
@pytest.mark.parametrize('data', [b'', b'\0', b'\x10\x10\x02\x03', bytes(243)])
def test_echo(plc_type: PlcType, data: bytes) -> None:
    assert answer(plc_type, b'\0' + data) == Packet(9, 1, 0x46, 0, 0x1234, data)


@pytest.mark.parametrize('plc_type', SERVED_FAMILIES)
def test_echo_of_the_vectors(plc_type: PlcType) -> None:
    command, reply = pair('diag_echo')
    assert Server(DataTable(plc_type)).serve(command) == reply


@given(data=st.binary(max_size=243))
@PROPERTY
def test_echo_of_anything(data: bytes) -> None:
    assert answer(PlcType.SLC, b'\0' + data).data == data


@pytest.mark.parametrize('plc_type', SERVED_FAMILIES)
def test_status_is_the_identity(plc_type: PlcType) -> None:
    reply = answer(plc_type, b'\x03')
    assert reply == Packet(9, 1, 0x46, 0, 0x1234, diagnostics.identity(plc_type))


def test_slc_has_the_layout_of_the_vectors() -> None:
    ours = diagnostics.identity(PlcType.SLC)
    theirs = pair('diag_status_slc504')[1].data
    assert len(ours) == len(theirs) == 24
    assert ours[:3] == theirs[:3]  # mode, type extender, full duplex
    assert ours[3] == 0x49  # a 5/03
    assert ours[5:16] == b'5/03       '
    assert ours[16:18] == bytes(2)  # no major error
    assert ours[18] & 0x1F == REMOTE_RUN
    assert ours[23] == theirs[23] == 0xFC  # no owner of the program


def test_plc5_has_the_layout_of_the_vectors() -> None:
    ours = diagnostics.identity(PlcType.PLC5)
    theirs = pair('diag_status_plc5_40')[1].data
    assert len(ours) == len(theirs) == 36
    assert ours[:3] == theirs[:3]  # remote run, PLC-5, 5/40
    assert ours[0] & 0x07 == REMOTE_RUN


@pytest.mark.parametrize('plc_type', SERVED_FAMILIES)
@pytest.mark.parametrize('data', [
    b'', b'\x01\0\0\x10', b'\x02\1\1\1', b'\x04\1', b'\x07', b'\xFF'])
def test_other_diagnostics_are_refused(plc_type: PlcType, data: bytes) -> None:
    assert answer(plc_type, data) == Packet(9, 1, 0x46, 0x10, 0x1234)
