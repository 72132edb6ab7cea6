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

"""Diagnostic counters of a port, as bytes and by name (M 9-6, 9-7, 9-31)."""

import struct

from abdf1_ros.counters import Counters
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.families import served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.link_counters import CounterLayout, decode_counters, ServedCounters
from abdf1_ros.pccc.plc5.identity import COUNTERS
from abdf1_ros.pccc.slc.identity import (
    FULL_DUPLEX_COUNTERS,
    MASTER_COUNTERS,
    ML1000_COUNTERS,
    SLAVE_COUNTERS,
)
from hypothesis import given
from hypothesis import strategies as st
import pytest

LAYOUTS = (COUNTERS, FULL_DUPLEX_COUNTERS, MASTER_COUNTERS, SLAVE_COUNTERS, ML1000_COUNTERS)


def words(count: int) -> bytes:
    """Return that many words whose value is their place plus 100."""
    return b''.join((100 + n).to_bytes(2, 'little') for n in range(count))


@pytest.mark.parametrize(('layout', 'expected'), [
    (FULL_DUPLEX_COUNTERS, {
        'modem lines': 'CTS', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'ENQ sent': '104', 'NAK received': '105',
        'ENQ received': '106', 'bad messages received': '107',
        'messages refused for lack of memory': '108', 'duplicate messages received': '109',
        'carrier recovered': '111', 'modem lost': '112'}),
    (MASTER_COUNTERS, {
        'modem lines': 'CTS', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'messages sent again': '104',
        'last normal scan (100 ms)': '105', 'longest normal scan (100 ms)': '106',
        'bad messages received': '107', 'duplicate messages received': '109',
        'last priority scan (100 ms)': '110', 'carrier recovered': '111', 'modem lost': '112',
        'longest priority scan (100 ms)': '113'}),
    (SLAVE_COUNTERS, {
        'modem lines': 'CTS', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'messages sent again': '104', 'polls received': '106',
        'bad messages received': '107', 'messages refused for lack of memory': '108',
        'duplicate messages received': '109', 'carrier recovered': '111', 'modem lost': '112'}),
    (ML1000_COUNTERS, {
        'messages sent': '101', 'messages received': '102', 'messages undelivered': '103',
        'ENQ sent': '104', 'NAK received': '105', 'ENQ received': '106',
        'bad messages received': '107', 'messages refused for lack of memory': '108',
        'duplicate messages received': '109', 'framing errors': '110'}),
    (COUNTERS, {
        'modem lines': 'CTS', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'ENQ sent, or messages sent again': '104',
        'NAK received': '105', 'ENQ received': '106', 'bad messages received': '107',
        'NAK sent': '108', 'duplicate messages received': '109', 'receive errors': '110',
        'carrier recovered': '111', 'modem lost': '112'})])
def test_words_have_the_names_of_their_layout(
        layout: CounterLayout, expected: dict[str, str]) -> None:
    block = (1).to_bytes(2, 'little') + words(len(layout))[2:]
    assert decode_counters(block, layout) == expected


def test_modem_lines_that_are_on_are_named() -> None:
    assert decode_counters(b'\x1F\0', COUNTERS) == {'modem lines': 'CTS RTS DSR DCD DTR'}
    assert decode_counters(b'\0\0', COUNTERS) == {'modem lines': 'none on'}
    for bit, name in enumerate(('CTS', 'RTS', 'DSR', 'DCD', 'DTR')):
        assert decode_counters(bytes((1 << bit, 0)), COUNTERS) == {'modem lines': name}


@pytest.mark.parametrize('data', [b'', b'\0', bytes(25)])
def test_half_a_word_is_no_counter(data: bytes) -> None:
    with pytest.raises(FormatError):
        decode_counters(data, SLAVE_COUNTERS)


@given(data=st.binary(max_size=60), layout=st.sampled_from([None, *LAYOUTS]))
def test_any_bytes_are_counters_or_a_format_error(data: bytes,
                                                  layout: CounterLayout | None) -> None:
    try:
        counters = decode_counters(data, layout)
    except FormatError:
        assert not data or layout is not None and len(data) % 2
        return
    assert counters or layout is ML1000_COUNTERS  # whose first word has no name
    assert all(name and value for name, value in counters.items())


@pytest.mark.parametrize(('layout', 'expected'), [
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
    counters = Counters(messages_sent=0x1_0003)
    served = ServedCounters(counters, COUNTERS)
    assert decode_counters(served.encode(), COUNTERS)['messages sent'] == '3'
    served.reset()
    counters.messages_sent += 0x1_0001
    assert decode_counters(served.encode(), COUNTERS)['messages sent'] == '1'


@pytest.mark.parametrize(('plc_type', 'mode', 'size', 'expected'), [
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
