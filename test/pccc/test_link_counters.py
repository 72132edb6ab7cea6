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

from __future__ import annotations

from abdf1_ros.counters import Counters
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.diagnostics import ReadCounters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.link_counters import (
    counter_request,
    CounterLayout,
    decode_counters,
    layout_of,
    served_counters,
    ServedCounters,
)
from abdf1_ros.pccc.processor import Processor
from hypothesis import given
from hypothesis import strategies as st
import pytest


def words(count: int) -> bytes:
    """Return that many words whose value is their place plus 100."""
    return b''.join((100 + n).to_bytes(2, 'little') for n in range(count))


@pytest.mark.parametrize(('layout', 'expected'), [
    (CounterLayout.SLC_FULL_DUPLEX, {
        'modem lines': 'DSR', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'ENQ sent': '104', 'NAK received': '105',
        'ENQ received': '106', 'bad messages received': '107',
        'messages refused for lack of memory': '108', 'duplicate messages received': '109',
        'carrier recovered': '111', 'modem lost': '112'}),
    (CounterLayout.SLC_MASTER, {
        'modem lines': 'DSR', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'messages sent again': '104',
        'last normal scan (100 ms)': '105', 'longest normal scan (100 ms)': '106',
        'bad messages received': '107', 'duplicate messages received': '109',
        'last priority scan (100 ms)': '110', 'carrier recovered': '111', 'modem lost': '112',
        'longest priority scan (100 ms)': '113'}),
    (CounterLayout.SLC_SLAVE, {
        'modem lines': 'DSR', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'messages sent again': '104', 'polls received': '106',
        'bad messages received': '107', 'messages refused for lack of memory': '108',
        'duplicate messages received': '109', 'carrier recovered': '111', 'modem lost': '112'}),
    (CounterLayout.MICROLOGIX_1000, {
        'messages sent': '101', 'messages received': '102', 'messages undelivered': '103',
        'ENQ sent': '104', 'NAK received': '105', 'ENQ received': '106',
        'bad messages received': '107', 'messages refused for lack of memory': '108',
        'duplicate messages received': '109', 'framing errors': '110'}),
    (CounterLayout.PLC5, {
        'modem lines': 'DSR', 'messages sent': '101', 'messages received': '102',
        'messages undelivered': '103', 'ENQ sent, or messages sent again': '104',
        'NAK received': '105', 'ENQ received': '106', 'bad messages received': '107',
        'NAK sent': '108', 'duplicate messages received': '109', 'receive errors': '110',
        'carrier recovered': '111', 'modem lost': '112'})])
def test_names_of_the_words(layout: CounterLayout, expected: dict[str, str]) -> None:
    block = (4).to_bytes(2, 'little') + words(layout.size // 2)[2:]
    assert decode_counters(block, layout) == expected


def test_modem_lines() -> None:
    assert decode_counters(b'\x1F\0', CounterLayout.PLC5) == {'modem lines': 'CTS RTS DSR DCD DTR'}
    assert decode_counters(b'\0\0', CounterLayout.PLC5) == {'modem lines': 'none on'}


def test_reply_may_have_fewer_or_more_words() -> None:
    assert decode_counters(words(2), CounterLayout.MICROLOGIX_1000) == {'messages sent': '101'}
    more = decode_counters(words(15), CounterLayout.SLC_FULL_DUPLEX)
    assert (more['word 13'], more['word 14']) == ('113', '114')


def test_counters_of_an_unknown_processor_are_bytes() -> None:
    assert decode_counters(b'\x01\xAB', None) == {'bytes': '01 AB'}


@pytest.mark.parametrize('data', [b'', b'\0', bytes(25)])
def test_half_a_word_is_no_counter(data: bytes) -> None:
    with pytest.raises(FormatError):
        decode_counters(data, CounterLayout.SLC_SLAVE)


@given(data=st.binary(max_size=60), layout=st.sampled_from([None, *CounterLayout]))
def test_any_bytes_are_counters_or_a_format_error(data: bytes,
                                                  layout: CounterLayout | None) -> None:
    try:
        counters = decode_counters(data, layout)
    except FormatError:
        assert not data or len(data) % 2
        return
    assert all(name and value for name, value in counters.items())


@pytest.mark.parametrize(('identity', 'layout', 'request_'), [
    (Identity('SLC', 'SLC 5/03', interface=0x34), CounterLayout.SLC_FULL_DUPLEX,
     ReadCounters(0, 26)),
    (Identity('SLC', 'SLC 5/03', interface=0x36), CounterLayout.SLC_SLAVE, ReadCounters(0, 26)),
    (Identity('SLC', 'MicroLogix 1000', interface=0x34, processor=Processor.ML1000),
     CounterLayout.MICROLOGIX_1000,
     ReadCounters(0, 22)),
    (Identity('PLC-5', 'PLC-5/40'), CounterLayout.PLC5, ReadCounters(0, 26)),
    (Identity('PLC-2', 'PLC-2', counter_address=0x4144), None, ReadCounters(0x4144, 55)),
    (None, None, ReadCounters(0, 55))])
def test_what_to_ask_whom(identity: Identity | None, layout: CounterLayout | None,
                          request_: ReadCounters) -> None:
    assert layout_of(identity) is layout
    assert counter_request(identity) == request_


def test_own_counters_under_the_names_of_the_layout() -> None:
    counters = Counters(
        messages_sent=1, messages_received=2, nak_limit_exceeded=3, enq_limit_exceeded=4,
        enq_retries=5, nak_retries=6, naks_received=7, polls_received=8, bcc_errors=9,
        crc_errors=10, invalid_messages=11, naks_sent=12, duplicate_messages=13,
        enqs_received=14, refused_for_memory=15)
    shown = {layout: decode_counters(ServedCounters(counters, layout).encode(), layout)
             for layout in CounterLayout}
    assert shown[CounterLayout.SLC_SLAVE]['messages sent again'] == '6'
    assert shown[CounterLayout.SLC_SLAVE]['polls received'] == '8'
    assert shown[CounterLayout.SLC_FULL_DUPLEX]['ENQ sent'] == '5'
    assert shown[CounterLayout.SLC_FULL_DUPLEX]['ENQ received'] == '14'
    assert shown[CounterLayout.SLC_FULL_DUPLEX]['messages refused for lack of memory'] == '15'
    assert shown[CounterLayout.SLC_SLAVE]['messages refused for lack of memory'] == '15'
    assert shown[CounterLayout.PLC5]['ENQ received'] == '14'
    assert shown[CounterLayout.PLC5]['ENQ sent, or messages sent again'] == '11'
    assert shown[CounterLayout.PLC5]['NAK sent'] == '12'
    for counts in shown.values():
        assert (counts['messages sent'], counts['messages received']) == ('1', '2')
        assert (counts['messages undelivered'], counts['bad messages received']) == ('7', '30')
        assert counts['duplicate messages received'] == '13'
    for layout in (CounterLayout.SLC_FULL_DUPLEX, CounterLayout.PLC5,
                   CounterLayout.MICROLOGIX_1000):
        assert shown[layout]['NAK received'] == '7'


def test_own_counters_begin_again_behind_16_bits() -> None:
    counters = Counters(messages_sent=0x1_0003)
    served = ServedCounters(counters, CounterLayout.PLC5)
    assert decode_counters(served.encode(), CounterLayout.PLC5)['messages sent'] == '3'
    served.reset()
    counters.messages_sent += 0x1_0001
    assert decode_counters(served.encode(), CounterLayout.PLC5)['messages sent'] == '1'


@pytest.mark.parametrize(('plc_type', 'full_duplex', 'master', 'size'), [
    (PlcType.PLC5, False, True, 26), (PlcType.SLC, True, False, 26),
    (PlcType.SLC, False, False, 26), (PlcType.SLC, False, True, 28)])
def test_block_by_family_and_role(plc_type: PlcType, full_duplex: bool, master: bool,
                                  size: int) -> None:
    served = served_counters(
        Counters(enq_retries=1, nak_retries=2), plc_type, is_full_duplex=full_duplex,
        is_master=master)
    assert served is not None
    block = served.encode()
    assert len(block) == size
    expected = 3 if plc_type is PlcType.PLC5 else 1 if full_duplex else 2
    assert block[8:10] == bytes((expected, 0))


@pytest.mark.parametrize('plc_type', [PlcType.PLC2, PlcType.PLC3])
def test_modules_have_blocks_that_are_not_emulated(plc_type: PlcType) -> None:
    assert served_counters(Counters(), plc_type, is_full_duplex=True) is None
