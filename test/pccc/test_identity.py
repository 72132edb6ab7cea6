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

"""Who is there: diagnostic status replies of all the layouts that are known."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.diagnostics import ReadCounters
from abdf1_ros.pccc.families import decode_identity
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.link_counters import CounterLayout
from abdf1_ros.pccc.plc5.identity import COUNTERS
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc.faults import major_error
from abdf1_ros.pccc.slc.identity import FULL_DUPLEX_COUNTERS, ML1000_COUNTERS, SLAVE_COUNTERS
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.vectors import pair

SLC = bytes.fromhex('00 EE 34 49 22') + b'5/03'.ljust(11) + bytes.fromhex('0000 06 00 3412 20 FC')
PLC5 = pair('diag_status_plc5_40')[1].data
PLC3 = bytes((0x02, 0x47, 0x10, 0, 0, 0, 0x34, 0x12, 0x41)) + bytes(9)
PLC2 = bytes((0x05, 0x74, 0, 0, 0, 0, 0x44, 0x41, 0x20, 0))
# An expansion byte (M 10-17, 10-18).
PLC2_KA3 = bytes.fromhex('02 ED 1F 00 00 00 00 00 20 21 00')


def changed(data: bytes, **bytes_from_1: int) -> Identity:
    """Decode ``data`` with some bytes replaced, which are numbered from 1 as in the manual."""
    edited = bytearray(data)
    for name, value in bytes_from_1.items():
        edited[int(name.removeprefix('byte')) - 1] = value
    return decode_identity(bytes(edited))


def test_slc_of_the_vectors() -> None:
    identity = decode_identity(pair('diag_status_slc504')[1].data)
    assert str(identity) == 'SLC 5/04 series B revision 3, RUN'
    assert identity == Identity(
        PlcType.SLC, 'SLC 5/04', 'B', '3', Mode.RUN, 'RUN', name='5/04', program_id=0x1234,
        memory='32 K', interface=0x34, processor=Processor.SLC_5_04,
        counter_layout=FULL_DUPLEX_COUNTERS)


def test_plc5_of_the_vectors() -> None:
    identity = decode_identity(PLC5)
    assert str(identity) == 'PLC-5/40 series C revision C, REM RUN'
    assert (identity.plc_type, identity.memory) == (PlcType.PLC5, '98304 (unit not documented)')
    assert (identity.faults, identity.remarks) == ((), ())


@for_all(('data', 'at', 'codes'), [
    # Communication active (80) says nothing new.
    (SLC, 19, {0x80: 'REM DOWNLOAD', 0x01: 'REM PROG', 0x03: 'REM SUSPEND', 0x86: 'REM RUN',
               0x07: 'REM TEST', 0x08: 'REM TEST, single scan', 0x09: 'REM TEST, step',
               0x10: 'DOWNLOAD', 0x11: 'PROG', 0x1B: 'SUSPEND', 0x1E: 'RUN', 0x85: 'mode 0x05'}),
    (PLC5, 1, {0: 'PROG', 2: 'RUN', 4: 'REM PROG', 5: 'REM TEST', 6: 'REM RUN', 1: 'mode 0x01'})])
def test_mode_is_read_from_its_code(data: bytes, at: int, codes: dict[int, str]) -> None:
    for code, text in codes.items():
        identity = changed(data, **{f'byte{at}': code})
        assert str(identity).endswith(f', {text}')
        assert identity.is_running is (None if text.startswith('mode') else text.endswith('RUN'))


# M 10-20; 0x55 as its L80B.
@for_all(('data', 'at', 'start', 'models'), [
    (SLC[:5] + bytes(11) + SLC[16:], 4, '', {  # without a name
        0x1A: 'SLC 500 fixed', 0x18: 'SLC 5/01', 0x25: 'SLC 5/02', 0x49: 'SLC 5/03',
        0x5B: 'SLC 5/04', 0x78: 'SLC 5/05', 0x58: 'MicroLogix 1000', 0x88: 'MicroLogix 1200',
        0x89: 'MicroLogix 1500 LSP', 0x8C: 'MicroLogix 1500 LRP', 0x9C: 'MicroLogix 1100'}),
    (PLC5, 3, 'PLC-5/', {
        0x15: '40', 0x22: '10', 0x23: '60', 0x28: '40L', 0x29: '60L', 0x31: '11', 0x32: '20',
        0x33: '30', 0x4A: '20E', 0x4B: '40E', 0x55: '80', 0x59: '80E', 0x13: '12', 0x14: '25'}),
    (PLC5, 3, 'PLC-5 of type ', {0x77: '0x77'}),
    (PLC2, 2, '', {
        0x00: 'PLC at 1771-KC/KD', 0x11: 'PLC-2 at 1771-KA2', 0x22: 'PLC-2/20 (LP1) at 1771-KA4',
        0x33: 'Mini-PLC-2 at 1771-KE/KF or 1770-KF2', 0x54: 'PLC-2/20 (LP2) at 1771-KG',
        0x65: 'PLC-2/02 to 2/17 at 1771-KGM', 0x7D: 'PLC-2/30 at 1785-KA3', 0xF4: '1771-KG'}),
    (PLC2_KA3, 3, 'PLC-2', {
        0x1D: '/02 at 1785-KA3', 0x1E: '/05 at 1785-KA3', 0x1F: '/16 at 1785-KA3',
        0x20: '/17 at 1785-KA3', 0x77: ' of type 0x77 at 1785-KA3'})])
def test_model_is_read_from_its_code(data: bytes, at: int, start: str,
                                     models: dict[int, str]) -> None:
    for code, model in models.items():
        assert changed(data, **{f'byte{at}': code}).model == start + model


@for_all(('mode', 'words'), [
    (Mode.REMOTE_PROGRAM, 'program'), (Mode.REMOTE_TEST_SCAN, 'test'), (Mode.TEST, 'test'),
    (Mode.SUSPEND, 'suspend'), (Mode.REMOTE_DOWNLOAD, 'download'), (Mode.RUN, 'run')])
def test_modes_in_a_sentence(mode: Mode, words: str) -> None:
    assert mode.words == words


@for_all(('code', 'name', 'model', 'processor', 'remarks'), [
    (0xB9, b'5/01       ', 'SLC 5/01', Processor.SLC_5_01, ()),
    (0xB9, b'5/02       ', 'SLC 5/02', Processor.SLC_5_02, ()),
    (0xB9, b'5/03       ', 'SLC 5/03', Processor.SLC_5_03, ()),
    (0xB9, b'5/05       ', 'SLC 5/05', Processor.SLC_5_05, ()),
    (0xB9, b'1761-LEC   ', 'MicroLogix 1000', Processor.ML1000, ()),
    (0xB9, b'1763-LEC   ', 'MicroLogix 1100', Processor.ML1100, ()),
    (0xB9, b'1764-LRP   ', 'MicroLogix 1500', Processor.ML1500, ()),
    (0xB9, b'1766-LEC   ', 'MicroLogix 1400', Processor.ML1400, ()),
    (0x77, b'1747-L542B ', '1747-L542B', None, ()),
    (0x89, b'1764-LSP   ', 'MicroLogix 1500 LSP', Processor.ML1500, ()),
    (0x8C, b'1764-LRP   ', 'MicroLogix 1500 LRP', Processor.ML1500, ()),
    (0x1A, b'500-20     ', 'SLC 500 fixed', Processor.SLC_5_01, ()),
    (0x78, b'5/04       ', 'SLC 5/04', Processor.SLC_5_04,
     ('its processor code 0x78 is that of a SLC 5/05',)),
    (0x9C, b'1762-L24   ', 'MicroLogix 1200', Processor.ML1200,
     ('its processor code 0x9C is that of a MicroLogix 1100',)),
    (0x18, b'5/06       ', '5/06', None, ('its processor code 0x18 is that of a SLC 5/01',))])
def test_name_of_an_slc_counts_more_than_its_code(
        code: int, name: bytes, model: str, processor: Processor | None,
        remarks: tuple[str, ...]) -> None:
    identity = decode_identity(SLC[:3] + bytes((code,)) + SLC[4:5] + name + SLC[16:])
    assert (identity.plc_type, identity.model, identity.remarks) == (PlcType.SLC, model, remarks)
    assert identity.processor is processor


# Those of modules of another type or size also stand in 1747-UM005B, 7-3.
@for_all(('code', 'text'), [
    (0x0022, 'major error 0x0022 (watchdog: scan time exceeded)'),
    (0x1E54, 'major error 0x1E54 (slot 30: module is not of the configured type)'),
    (0x0056, 'major error 0x0056 (slot 0: chassis configuration is not that of the program)'),
    (0x0122, 'major error 0x0122'), (0x0099, 'major error 0x0099')])
def test_major_error_has_its_text(code: int, text: str) -> None:
    assert major_error(code) == text


def test_words_of_the_texts_of_faults() -> None:
    slc = {0x01: 'NVRAM', 0x02: 'hardware watchdog', 0x03: 'module', 0x04: 'while running',
           0x10: 'revision', 0x11: 'file 2', 0x12: 'ladder', 0x14: 'internal', 0x15: 'configurat',
           0x16: 'power loss', 0x18: 'operating system', 0x20: 'minor', 0x21: 'power failure',
           0x23: 'file missing', 0x24: 'interval', 0x28: 'fault routine file', 0x29: 'indexed',
           0x30: 'nested', 0x31: 'unsupported', 0x32: 'sequencer', 0x33: 'shift', 0x34: 'timer',
           0x35: 'not allowed', 0x38: 'RET', 0x150: 'data error', 0x151: 'stuck', 0x152: 'missing',
           0x153: 'unused', 0x155: 'another number', 0x157: 'respond', 0x158: 'reports an error'}
    assert [code for code, word in slc.items() if word not in major_error(code)] == []
    plc5 = ('corrupted', 'bad address', 'programming', 'SFC', 'assembled', 'start-up',
            'peripheral', 'jumped', 'watchdog', 'configured', 'hardware', 'main control',
            'processor input', 'timed', 'fault routine is', 'faulted program file')
    inquiry = changed(PLC5, byte1=0x0A).inquiry
    assert inquiry is not None
    told = [inquiry.answered(bytes.fromhex('95 09 42') + (1 << bit).to_bytes(2, 'little')
                             + bytes(2)).faults[0] for bit in range(16)]
    assert [word for word, text in zip(plc5, told, strict=True) if word not in text] == []


@for_all(('identity', 'faults', 'remarks'), [
    (changed(SLC, byte17=0, byte18=0, byte20=0x20), ('major error 0x0000, processor halted',), ()),
    (changed(SLC, byte17=0x34, byte20=0xDF), (),
     ('last major error 0x0034 (negative timer preset or accumulator)',)),
    (changed(SLC, byte1=0xC0, byte17=0x20, byte19=0x66, byte24=0xFD), (), (
        'last major error 0x0020 (minor error at the end of a scan)', 'forces active',
        'forces installed', 'testing edits', 'edits in the processor',
        'program directory corrupted')),
    (changed(PLC5, byte1=0xDE, byte16=0x11, byte17=1, byte18=1),
     ('major processor fault (word S:11 says which)', 'bad RAM'), (
         'download in progress', 'testing edits', 'edits in the processor', 'forces active',
         'forces installed', 'memory protected')),
    (changed(SLC, byte1=0x80, byte19=0x26), (), ('forces active', 'edits in the processor')),
    (changed(PLC3, byte1=0x28), ('major processor fault', 'shutdown in effect'), ()),
    (changed(PLC3, byte1=0x10), (), ('shutdown requested',)),
    (changed(PLC2, byte1=0x28), ('no communication between module and processor',
                                 'communication zone of the program has a wrong format'), ()),
    (changed(PLC2, byte1=0x10), (), ('download or upload in progress',))])
def test_faults_and_remarks(identity: Identity, faults: tuple[str, ...],
                            remarks: tuple[str, ...]) -> None:
    assert (identity.faults, identity.remarks) == (faults, remarks)


def test_each_bit_of_a_plc5_has_one_remark_or_none() -> None:
    told = {(byte, bit): changed(PLC5, **{f'byte{byte}': PLC5[byte - 1] & mask | 1 << bit}).remarks
            for byte, mask in ((1, 0x07), (17, 0), (16, 0)) for bit in range(8)
            if byte != 1 or bit > 3}
    none: tuple[str, ...] = ()
    assert {bit for bit, remarks in told.items() if remarks != none} == {
        (1, 4), (1, 6), (1, 7), (16, 0), (16, 4), *((17, bit) for bit in range(8))}
    assert (told[1, 7], told[16, 0]) == (('edits in the processor',), ('forces active',))
    assert [changed(PLC5, byte1=mode, byte16=0, byte17=0).remarks for mode in range(8)] == [
        none] * 8


@for_all(('data', 'family', 'text', 'address', 'size'), [
    (PLC3, PlcType.PLC3, 'PLC-3 series C revision B, RUN', 0x1234, 55),
    (PLC2, PlcType.PLC2, 'PLC-2/30 at 1771-KG series B revision A, REM TEST', 0x4144, 55),
    *((bytes.fromhex(data), PlcType.PLC2, f'{model} at 1785-KA3 series B revision B, RUN',
       0x2000, 55) for data, model in (
          ('02 1D 00 00 00 00 00 20 21 00', 'PLC-2'),
          ('02 6D 00 00 00 00 00 20 21 00', 'PLC-2/15'),
          (PLC2_KA3.hex(), 'PLC-2/16'))),
    (PLC2[:1] + b'\xF4' + PLC2[2:], None, '1771-KG series B revision A', 0x4144, 55),
    # Gateways (M 10-15..10-19), those with a name last.
    *((bytes.fromhex(data), None, text, address, 55) for data, text, address in (
        ('01 EE 10 10 34 12 00 20 21 00 00 30', '1785-KA series B revision B', 0x2000),
        ('00 EE 30 2F 34 12 00 20 39 00 30', '1785-KA5 series B revision Z', 0x2000),
        ('00 FE 19 00 00 30 00 20 3A 00', '1785-KE series B revision 26', 0x2000),
        ('00 FE 1B 00 00 00 44 41 03 00' + '20' * 8, '1784-KT or 1784-KT2 series A revision D',
         0x4144))),
    *((bytes((0, 0xFE, kind, 0, 0)) + name.ljust(11, b'\0') + b'xx' + bytes(6), None,
       f'{name.decode()} series A revision 1', 0, size)
      for kind, name, size in ((0x2C, b'1770-KF3', 20), (0x24, b'1784-KR 1.2', 55))),
    (b'\0\x99' + b'1234567', None, 'unknown processor (00 99 31 32 33 34 35 36)', 0, 55)])
def test_modules_and_where_their_counters_are(
        data: bytes, family: PlcType | None, text: str, address: int, size: int) -> None:
    identity = decode_identity(data)
    assert (identity.plc_type, str(identity)) == (family, text)
    assert identity.faults == identity.remarks == ()
    assert identity.counters == ReadCounters(address, size)
    assert identity.is_running is {'RUN': True, 'TEST': False}.get(text.rpartition(' ')[2])


@for_all('data', [SLC, PLC2, PLC2_KA3, PLC3, bytes.fromhex('00 FE 24').ljust(24, b'\0'),
                  bytes.fromhex('00 EE 10 10 00 00 34 12 42')])
def test_status_without_its_last_byte_is_of_no_known_processor(data: bytes) -> None:
    assert not str(decode_identity(data)).startswith('unknown')
    for size in range(2, len(data)):
        assert str(decode_identity(data[:size])).startswith('unknown processor (')


def test_unknown_processor_is_named_and_not_interpreted() -> None:
    data = bytearray(SLC)
    data[3], data[5:16] = 0x95, b'1769-L35E  '
    identity = decode_identity(bytes(data))
    assert (str(identity), identity.mode, identity.faults, identity.interface) == (
        '1769-L35E series B revision 3', None, (), 0x34)
    data[5:16] = bytes(11)
    assert str(decode_identity(bytes(data))) == 'processor 0x95 series B revision 3'


# M 10-20 and 10-21: the same fields, with and without the expansion byte in front of them.
_OLD_FIELDS = '00 80 01 00 42 07 FD 00 0C 00 05 00 11 01 01'


@for_all(('start', 'model'), [
    ('0A EB 13', 'PLC-5/12'), ('0A EB 14', 'PLC-5/25'), ('0A BB', 'PLC-5/15'),
    ('0A CB', 'PLC-5 VME (6008-LTV)')])
def test_old_plc5_ends_with_the_byte_about_its_ram(start: str, model: str) -> None:
    data = bytes.fromhex(start + _OLD_FIELDS)
    identity = decode_identity(data)
    assert str(identity) == f'{model} series C revision C, RUN'
    assert identity.faults == ('major processor fault (word S:11 says which)', 'bad RAM')
    assert identity.remarks == ('forces active', 'forces installed', 'memory protected')
    assert identity.memory == '98304 (unit not documented)'
    with pytest.raises(FormatError, match=f'{len(data) - 1} bytes; .* {len(data)} or more'):
        decode_identity(data[:-1])


def test_fault_of_a_plc5_is_asked_for_and_named() -> None:
    assert changed(PLC5, byte1=0x06).inquiry is None
    inquiry = changed(PLC5, byte1=0x0A, byte18=1).inquiry
    assert inquiry is not None
    assert inquiry.request == (0x0F, bytes.fromhex('68 00 00 02 00 06 02 0B 02 00'))
    known = inquiry.answered(bytes.fromhex('95 09 42 84 01 58 00'))
    assert known.faults == (
        'major processor fault: programming error, the program jumped to the fault routine, '
        'watchdog; fault code 88 (S:12)', 'bad RAM')
    assert known.inquiry is None
    assert inquiry.answered(bytes.fromhex('95 09 42 00 00 00 00')).faults[0] == \
        'major processor fault: S:11 is 0; fault code 0 (S:12)'


@for_all('data', [b'', b'\0', PLC5[:17], PLC5[:2]])
def test_reply_that_is_too_short_is_a_format_error(data: bytes) -> None:
    with pytest.raises(FormatError, match='a diagnostic status of'):
        decode_identity(data)


def test_control_characters_of_a_name_are_made_visible() -> None:
    data = bytearray(SLC)
    data[3], data[5:16] = 0xFF, b'a\x1b[31m\nb\x80\0z'
    assert decode_identity(bytes(data)).name == r'a\x1b[31m\nb\x80'


_DATA = st.one_of(
    st.binary(max_size=50),
    st.builds(lambda first, rest: bytes(first) + rest, st.tuples(
        st.integers(0, 255), st.sampled_from([0xEE, 0xEB, 0xBB, 0x47, 0xFE, 0x14, 0xF3])),
        st.binary(min_size=8, max_size=40)))


@given(data=_DATA)
def test_any_bytes_are_an_identity_or_a_format_error(data: bytes) -> None:
    try:
        identity = decode_identity(data)
    except FormatError:
        return
    assert str(identity)
    for text in (str(identity), identity.name, identity.mode_text, *identity.faults,
                 *identity.remarks):
        assert text.isprintable()


@for_all(('data', 'layout', 'asked'), [
    (SLC[:2] + b'\x33' + SLC[3:], FULL_DUPLEX_COUNTERS, ReadCounters(0, 26)),
    (SLC[:2] + b'\x36' + SLC[3:], SLAVE_COUNTERS, ReadCounters(0, 26)),
    (SLC[:3] + b'\x58\0' + b'1761'.ljust(11) + SLC[16:], ML1000_COUNTERS, ReadCounters(0, 22)),
    (PLC5, COUNTERS, ReadCounters(0, 26))])
def test_what_tells_about_the_counters(data: bytes, layout: CounterLayout,
                                       asked: ReadCounters) -> None:
    identity = decode_identity(data)
    assert (identity.counter_layout, identity.counters) == (layout, asked)
    assert Identity(None, '').counters == ReadCounters(0, 55)
