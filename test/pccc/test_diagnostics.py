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

"""Diagnostic commands (M 7-6..7-27): status of emulated processors, counters (M 9-6..9-31)."""

import struct

from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.diagnostics import ReadCounters, STATUS_REQUEST
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import decode_identity, FAMILIES, served_counters
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Mode
from abdf1_ros.pccc.link_counters import CounterLayout, decode_counters, ServedCounters
from abdf1_ros.pccc.plc5.identity import COUNTERS
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc.identity import (
    FULL_DUPLEX_COUNTERS,
    MASTER_COUNTERS,
    ML1000_COUNTERS,
    SLAVE_COUNTERS,
)
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.vectors import pair


@for_all('data', [b'', b'\0', b'\0\0', b'\0\0\x1A\x01'])
def test_read_counters_of_another_length_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError):
        ReadCounters.read(Reader(data))


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


@for_all(('plc_type', 'limit'), [
    (PlcType.PLC2, 243), (PlcType.PLC3, 243), (PlcType.PLC5, 243), (PlcType.SLC, 236)])
def test_echo_up_to_the_limit_of_the_family(plc_type: PlcType, limit: int) -> None:
    assert FAMILIES[plc_type].max_echo == limit
    for data in (b'', b'\0', b'\x10\x10\x02\x03', bytes(limit)):
        assert answer(plc_type, b'\0' + data) == reply(data)
    assert answer(plc_type, bytes(limit + 2)) == reply(sts=REFUSED)


@for_all('plc_type', FAMILIES)
def test_status_is_that_of_the_processor_at_the_moment(plc_type: PlcType) -> None:
    processor = EmulatedProcessor()
    server = Server(DataTable(plc_type), processor)
    command = Packet(1, 9, 0x06, 0, 0x1234, STATUS_REQUEST)
    assert server.serve(command) == reply(FAMILIES[plc_type].encode_identity(processor))
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
@for_all(('cmd', 'data'), [
    *((0x06, data) for data in (b'', b'\x01\0\0\x10', b'\x03\x01', b'\x07', b'\x08\x80\0',
                                b'\x09\0\0\x01', b'\xFF')),
    # Nobody changes the mode.
    (0x0F, b'\x3A\0'), (0x0F, b'\x3A\x02'), (0x0F, b'\x80\x01'), (0x0F, b'\x80\x06'),
    (0x0F, b'\x41'), (0x0F, b'\x11'), (0x0F, b'\x07'), (0x07, b'\0'), (0x07, b'\x03')])
def test_what_there_is_not_is_refused(plc_type: PlcType, cmd: int, data: bytes) -> None:
    assert answer(plc_type, data, cmd=cmd) == reply(sts=REFUSED, cmd=cmd | 0x40)


def encoded(plc_type: PlcType, setting: Setting = Setting.REMOTE,
            is_full_duplex: bool = False) -> bytes:
    return FAMILIES[plc_type].encode_identity(EmulatedProcessor(setting, is_full_duplex))


def test_slc_and_plc5_have_the_layout_of_the_vectors() -> None:
    ours = encoded(PlcType.SLC, is_full_duplex=True)
    theirs = pair('diag_status_slc504')[1].data
    assert len(ours) == len(theirs) == 24
    assert ours[:3] == theirs[:3]  # mode, type extender, full duplex
    assert ours[3] == 0x49  # a 5/03
    assert ours[5:16] == b'5/03       '
    assert ours[16:20] == b'\0\0\x06\0'  # no major error, remote run
    assert ours[23] == theirs[23] == 0xFC  # no owner of the program
    assert encoded(PlcType.SLC)[2] == 0x36  # half duplex
    ours = encoded(PlcType.PLC5)
    theirs = pair('diag_status_plc5_40')[1].data
    assert len(ours) == len(theirs) == 36
    assert ours[:3] == theirs[:3]  # remote run, PLC-5, 5/40


@for_all(('plc_type', 'texts'), [
    (PlcType.SLC, ('RUN', 'REM PROG', 'REM RUN', 'REM TEST')),
    (PlcType.PLC5, ('RUN', 'REM PROG', 'REM RUN', 'REM TEST')),
    (PlcType.PLC3, ('RUN', 'PROG', 'RUN', 'TEST')),
    (PlcType.PLC2, ('RUN', 'REM PROG', 'RUN', 'REM TEST'))])
def test_every_setting_is_read_back(plc_type: PlcType, texts: tuple[str, ...]) -> None:
    settings = (Setting.RUN, Setting.PROGRAM, Setting.REMOTE, Setting.TEST)
    identities = [decode_identity(encoded(plc_type, setting)) for setting in settings]
    assert tuple(identity.mode_text for identity in identities) == texts
    assert [identity.is_running for identity in identities] == [True, False, True, False]
    assert not any(identity.faults or identity.memory for identity in identities)


@for_all(('plc_type', 'fault'), [
    (PlcType.SLC, 'major error 0x0020 (minor error at the end of a scan), processor halted'),
    (PlcType.PLC5, 'major processor fault (word S:11 says which)'),
    (PlcType.PLC3, 'major processor fault'),
    (PlcType.PLC2, 'no communication between module and processor')])
def test_fault_is_read_back(plc_type: PlcType, fault: str) -> None:
    identity = decode_identity(encoded(plc_type, Setting.FAULT))
    assert (identity.faults, identity.mode and identity.mode.words) == ((fault,), 'program')


LAYOUTS = (COUNTERS, FULL_DUPLEX_COUNTERS, MASTER_COUNTERS, SLAVE_COUNTERS, ML1000_COUNTERS)


@for_all(('layout', 'names'), [
    (FULL_DUPLEX_COUNTERS, 'messages sent, messages received, messages undelivered, ENQ sent, NAK '
     'received, ENQ received, bad messages received, messages refused for lack of memory, '
     'duplicate messages received, , carrier recovered, modem lost'),
    (MASTER_COUNTERS, 'messages sent, messages received, messages undelivered, messages sent '
     'again, last normal scan (100 ms), longest normal scan (100 ms), bad messages received, , '
     'duplicate messages received, last priority scan (100 ms), carrier recovered, modem lost, '
     'longest priority scan (100 ms)'),
    (SLAVE_COUNTERS, 'messages sent, messages received, messages undelivered, messages sent '
     'again, , polls received, bad messages received, messages refused for lack of memory, '
     'duplicate messages received, , carrier recovered, modem lost'),
    (ML1000_COUNTERS, 'messages sent, messages received, messages undelivered, ENQ sent, NAK '
     'received, ENQ received, bad messages received, messages refused for lack of memory, '
     'duplicate messages received, framing errors'),
    (COUNTERS, 'messages sent, messages received, messages undelivered, ENQ sent; or messages '
     'sent again, NAK received, ENQ received, bad messages received, NAK sent, duplicate messages '
     'received, receive errors, carrier recovered, modem lost')])
def test_words_have_the_names_of_their_layout(layout: CounterLayout, names: str) -> None:
    parts = ['' if layout is ML1000_COUNTERS else 'modem lines', *names.split(', ')]
    values = {name.replace(';', ','): str(n) for n, name in enumerate(parts) if name}
    block = b''.join(n.to_bytes(2, 'little') for n in range(len(layout)))
    assert decode_counters(block, layout) == values | (
        {'modem lines': 'none on'} if parts[0] else {})


def test_modem_lines_that_are_on_are_named() -> None:
    assert decode_counters(b'\x1F\0', COUNTERS) == {'modem lines': 'CTS RTS DSR DCD DTR'}
    assert decode_counters(bytes(30), COUNTERS).items() >= {
        'modem lines': 'none on', 'word 13': '0', 'word 14': '0'}.items()
    for bit, name in enumerate(('CTS', 'RTS', 'DSR', 'DCD', 'DTR')):
        assert decode_counters(bytes((1 << bit, 0)), COUNTERS) == {'modem lines': name}


@given(data=st.binary(max_size=60), layout=st.sampled_from([None, *LAYOUTS]))
def test_any_bytes_are_counters_or_a_format_error(data: bytes,
                                                  layout: CounterLayout | None) -> None:
    if not data or layout is not None and len(data) % 2:
        with pytest.raises(FormatError):
            decode_counters(data, layout)
        return
    counters = decode_counters(data, layout)
    assert counters or layout is ML1000_COUNTERS  # whose first word has no name
    assert all(name and value for name, value in counters.items())


@for_all(('layout', 'expected'), [
    (COUNTERS, {'ENQ sent, or messages sent again': '11', 'NAK received': '16',
                'ENQ received': '14', 'NAK sent': '12'}),
    (FULL_DUPLEX_COUNTERS, {'ENQ sent': '5', 'NAK received': '16', 'ENQ received': '14',
                            'messages refused for lack of memory': '15'}),
    (MASTER_COUNTERS, {'messages sent again': '6'}),
    (SLAVE_COUNTERS, {'messages sent again': '6', 'polls received': '8',
                      'messages refused for lack of memory': '15'}),
    (ML1000_COUNTERS, {'ENQ sent': '5', 'NAK received': '16', 'ENQ received': '14',
                       'messages refused for lack of memory': '15'})])
def test_own_counters_under_the_names_of_the_layout(
        layout: CounterLayout, expected: dict[str, str]) -> None:
    counters = Counters(
        messages_sent=1, messages_received=2, nak_limit_exceeded=3, enq_limit_exceeded=4,
        enq_retries=5, nak_retries=6, naks_received=16, polls_received=8, bcc_errors=9,
        crc_errors=10, invalid_messages=11, naks_sent=12, duplicate_messages=13,
        enqs_received=14, refused_for_memory=15)
    shown = decode_counters(ServedCounters(counters, layout).encode(), layout)
    assert {name: count for name, count in shown.items() if count not in ('0', 'none on')} == {
        'messages sent': '1', 'messages received': '2', 'messages undelivered': '7',
        'bad messages received': '30', 'duplicate messages received': '13'} | expected


def test_own_counters_begin_again_behind_16_bits() -> None:
    counters = Counters(messages_sent=0x1_8003)
    served = ServedCounters(counters, COUNTERS)
    assert decode_counters(served.encode(), COUNTERS)['messages sent'] == '32771'
    served.reset()
    counters.messages_sent += 0x1_0001
    assert decode_counters(served.encode(), COUNTERS)['messages sent'] == '1'


@for_all(('plc_type', 'mode', 'size', 'expected'), [
    (PlcType.PLC5, 'Master', 26, 3), (PlcType.SLC, 'Peer', 26, 1), (PlcType.SLC, 'Slave', 26, 2),
    (PlcType.SLC, 'Master', 28, 2), (PlcType.SLC, 'Radio', 20, 0)])
def test_block_by_family_and_mode(plc_type: PlcType, mode: str, size: int, expected: int) -> None:
    served = served_counters(Counters(enq_retries=1, nak_retries=2), plc_type, mode)
    assert served is not None
    block = served.encode()
    assert len(block) == size
    assert block[8:10] == bytes((expected, 0))


def test_words_of_a_radio_modem_port_are_where_its_channel_status_has_them() -> None:
    counters = Counters(messages_sent=10, messages_received=11, unsent_messages=12, bcc_errors=16,
                        refused_for_memory=17, duplicate_messages=18, nak_retries=1,
                        nak_limit_exceeded=1)
    served = served_counters(counters, PlcType.SLC, 'Radio')
    assert served is not None
    status = struct.unpack('<10H', served.encode())  # from CSx:9 on
    assert status == (0, 10, 11, 12, 0, 0, 0, 16, 17, 18)
