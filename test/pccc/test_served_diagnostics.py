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

"""Diagnostic commands as an emulated PLC of each family answers them."""

from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.diagnostics import ReadCounters, STATUS_REQUEST
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import decode_identity, FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Mode
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.plc5.identity import COUNTERS
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc.identity import SLAVE_COUNTERS
import pytest
from support.cases import for_all

REFUSED = 0x10


def answer(plc_type: PlcType, data: bytes, counters: ServedCounters | None = None,
           cmd: int = 0x06) -> Packet:
    """Return what a PLC with an empty table answers."""
    server = Server(DataTable(plc_type), EmulatedProcessor(), counters)
    return server.serve(Packet(1, 9, cmd, 0, 0x1234, data))


def reply(data: bytes = b'', sts: int = 0, cmd: int = 0x46) -> Packet:
    """Return the reply to the commands of these tests."""
    return Packet(9, 1, cmd, sts, 0x1234, data)


@pytest.fixture
def counters() -> Counters:
    return Counters(messages_sent=300, messages_received=2, polls_received=70_000)


@pytest.mark.parametrize('plc_type', FAMILIES)
def test_echo_up_to_the_limit_of_the_family(plc_type: PlcType) -> None:
    limit = FAMILIES[plc_type].max_echo
    for data in (b'', b'\0', b'\x10\x10\x02\x03', bytes(limit)):
        assert answer(plc_type, b'\0' + data) == reply(data)
    assert answer(plc_type, bytes(limit + 2)) == reply(sts=REFUSED)


@pytest.mark.parametrize('plc_type', FAMILIES)
def test_status_is_that_of_the_processor_at_the_moment(plc_type: PlcType) -> None:
    processor = EmulatedProcessor()
    server = Server(DataTable(plc_type), processor)
    command = Packet(1, 9, 0x06, 0, 0x1234, STATUS_REQUEST)
    assert server.serve(command) == reply(
        FAMILIES[plc_type].encode_identity(processor))
    processor.setting = Setting.RUN
    assert decode_identity(server.serve(command).data).mode is Mode.RUN


def test_slc_counters_are_at_address_0(counters: Counters) -> None:
    served = ServedCounters(counters, SLAVE_COUNTERS)
    block = answer(PlcType.SLC, ReadCounters(0, 26).encode(), served)
    assert block == reply(served.encode())
    assert block.data[2:6] == b'\x2C\x01\x02\x00'
    assert answer(PlcType.SLC, ReadCounters(0, 4).encode(), served) == reply(block.data[:4])
    assert answer(PlcType.SLC, ReadCounters(2, 4).encode(), served) == reply(sts=REFUSED)


def test_plc5_ignores_the_address_of_counters(counters: Counters) -> None:
    served = ServedCounters(counters, COUNTERS)
    assert answer(PlcType.PLC5, ReadCounters(0x1234, 244).encode(), served) == reply(
        served.encode())
    assert answer(PlcType.PLC5, ReadCounters(0, 245).encode(), served) == reply(sts=REFUSED)


def test_reset_concerns_only_what_the_other_end_sees(counters: Counters) -> None:
    served = ServedCounters(counters, SLAVE_COUNTERS)
    before = answer(PlcType.SLC, ReadCounters(0, 26).encode(), served)
    assert answer(PlcType.SLC, b'\7' + b'\1', served) == reply(sts=REFUSED)
    assert answer(PlcType.SLC, ReadCounters(0, 26).encode(), served) == before != reply(bytes(26))
    assert answer(PlcType.SLC, b'\7', served) == reply()
    assert answer(PlcType.SLC, ReadCounters(0, 26).encode(), served) == reply(bytes(26))
    assert counters.messages_sent == 300
    counters.messages_sent += 5
    assert answer(PlcType.SLC, ReadCounters(0, 4).encode(), served) == reply(b'\0\0\5\0')


@for_all('plc_type', FAMILIES)
@for_all('data', [
    b'', b'\x01\0\0\x10', b'\x03\x01', b'\x07', b'\x08\x80\0', b'\x09\0\0\x01', b'\xFF'])
def test_what_there_is_not_is_refused(plc_type: PlcType, data: bytes) -> None:
    assert answer(plc_type, data) == reply(sts=REFUSED)


@for_all('plc_type', FAMILIES)
@for_all(('cmd', 'data'), [
    (0x0F, b'\x3A\0'), (0x0F, b'\x3A\x02'), (0x0F, b'\x80\x01'), (0x0F, b'\x80\x06'),
    (0x0F, b'\x41'), (0x0F, b'\x11'), (0x0F, b'\x07'), (0x07, b'\0'), (0x07, b'\x03')])
def test_nobody_changes_the_mode(plc_type: PlcType, cmd: int, data: bytes) -> None:
    processor = EmulatedProcessor()
    server = Server(DataTable(plc_type), processor)
    refusal = server.serve(Packet(1, 9, cmd, 0, 0x1234, data))
    assert refusal.sts
    assert processor == EmulatedProcessor()
