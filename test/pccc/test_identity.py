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

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.identity import decode_identity, Identity, Mode
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.properties import PROPERTY
from support.vectors import pair

SLC = bytes.fromhex('00 EE 34 49 22') + b'5/03'.ljust(11) + bytes.fromhex('0000 06 00 3412 20 FC')
PLC5 = pair('diag_status_plc5_40')[1].data


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
        'SLC', 'SLC 5/04', 'B', '3', Mode.RUN, 'RUN', name='5/04', program_id=0x1234,
        memory='32 K', interface=0x34)
    assert identity.is_running


def test_plc5_of_the_vectors() -> None:
    identity = decode_identity(PLC5)
    assert str(identity) == 'PLC-5/40 series C revision C, REM RUN'
    assert (identity.family, identity.is_running, identity.memory) == ('PLC-5', True, '98304')
    assert (identity.faults, identity.remarks) == ((), ())


@pytest.mark.parametrize(('code', 'text', 'is_running'), [
    (0x00, 'REM DOWNLOAD', False), (0x01, 'REM PROG', False), (0x03, 'REM SUSPEND', False),
    (0x06, 'REM RUN', True), (0x07, 'REM TEST', False), (0x08, 'REM TEST, single scan', False),
    (0x09, 'REM TEST, step', False), (0x10, 'DOWNLOAD', False), (0x11, 'PROG', False),
    (0x1B, 'SUSPEND', False), (0x1E, 'RUN', True), (0x05, 'mode 0x05', None)])
def test_slc_modes(code: int, text: str, is_running: bool | None) -> None:
    identity = changed(SLC, byte19=code | 0x80)  # communication active says nothing new
    assert (identity.mode_text, identity.is_running) == (text, is_running)
    assert str(identity).endswith(f', {text}')


@pytest.mark.parametrize(('code', 'text', 'is_running'), [
    (0, 'PROG', False), (2, 'RUN', True), (4, 'REM PROG', False), (5, 'REM TEST', False),
    (6, 'REM RUN', True), (1, 'mode 0x01', None)])
def test_plc5_modes(code: int, text: str, is_running: bool | None) -> None:
    identity = changed(PLC5, byte1=code)
    assert (identity.mode_text, identity.is_running) == (text, is_running)


@pytest.mark.parametrize(('mode', 'words'), [
    (Mode.REMOTE_PROGRAM, 'program'), (Mode.REMOTE_TEST_SCAN, 'test'), (Mode.TEST, 'test'),
    (Mode.SUSPEND, 'suspend'), (Mode.REMOTE_DOWNLOAD, 'download'), (Mode.RUN, 'run')])
def test_modes_in_a_sentence(mode: Mode, words: str) -> None:
    assert mode.words == words


def test_slc_that_has_halted() -> None:
    identity = changed(SLC, byte17=0x16, byte18=0x01, byte19=0x01, byte20=0x20)
    assert identity.faults == ('major error 0x0116, processor halted',)
    assert identity.remarks == ()


def test_slc_remarks_are_no_faults() -> None:
    identity = changed(SLC, byte1=0xC0, byte17=0x20, byte19=0x66, byte24=0xFD)
    assert identity.faults == ()
    assert identity.remarks == (
        'last major error 0x0020', 'forces active', 'forces installed', 'testing edits',
        'edits in the processor', 'program directory corrupted')


def test_plc5_faults_and_remarks() -> None:
    identity = changed(PLC5, byte1=0xDE, byte16=0x11, byte17=1, byte18=1)
    assert identity.faults == ('major processor fault (word S:11 says which)', 'bad RAM')
    assert identity.remarks == (
        'download in progress', 'testing edits', 'edits in the processor', 'forces active',
        'forces installed', 'memory protected')


@pytest.mark.parametrize(('code', 'model'), [
    (0x1A, 'SLC 500 fixed'), (0x18, 'SLC 5/01'), (0x25, 'SLC 5/02'), (0x49, 'SLC 5/03'),
    (0x5B, 'SLC 5/04'), (0x78, 'SLC 5/05'), (0x58, 'MicroLogix 1000'),
    (0x88, 'MicroLogix 1200'), (0x89, 'MicroLogix 1500 LSP'), (0x8C, 'MicroLogix 1500 LRP'),
    (0x9C, 'MicroLogix 1100')])
def test_slc_models(code: int, model: str) -> None:
    identity = changed(SLC, byte4=code)
    assert str(identity) == f'{model} series B revision 3, REM RUN'
    assert identity.is_micrologix_1000 == (code == 0x58)


def test_micrologix_of_an_unknown_code_is_known_by_its_name() -> None:
    data = bytearray(SLC)
    data[3], data[5:16] = 0xB9, b'1766-LEC   '
    identity = decode_identity(bytes(data))
    assert str(identity) == '1766-LEC series B revision 3, REM RUN'
    assert identity.family == 'SLC'


def test_unknown_processor_is_named_and_not_interpreted() -> None:
    data = bytearray(SLC)
    data[3], data[5:16] = 0x95, b'1769-L35E  '
    identity = decode_identity(bytes(data))
    assert (str(identity), identity.mode, identity.faults) == (
        '1769-L35E series B revision 3', None, ())
    data[5:16] = bytes(11)
    assert str(decode_identity(bytes(data))) == 'processor 0x95 series B revision 3'


@pytest.mark.parametrize(('byte3', 'model'), [
    (0x15, 'PLC-5/40'), (0x4A, 'PLC-5/20E'), (0x55, 'PLC-5/80'), (0x14, 'PLC-5/25'),
    (0x77, 'PLC-5 of type 0x77')])
def test_plc5_models(byte3: int, model: str) -> None:
    assert changed(PLC5, byte3=byte3).model == model


def test_plc5_15_has_no_expansion_byte() -> None:
    identity = decode_identity(bytes((0x0A, 0xBB)) + bytes(30))
    assert str(identity) == 'PLC-5/15, RUN'
    assert identity.faults == ('major processor fault (word S:11 says which)',)


def test_plc3() -> None:
    data = bytes((0x02, 0x47, 0x10, 0, 0, 0, 0x34, 0x12, 0x41)) + bytes(9)
    identity = decode_identity(data)
    assert str(identity) == 'PLC-3 series C revision B, RUN'
    assert (identity.family, identity.counter_address) == ('PLC-3', 0x1234)
    assert changed(data, byte1=0x38).faults == ('major processor fault', 'shutdown in effect')
    assert changed(data, byte1=0x38).remarks == ('shutdown requested',)


def test_module_of_a_plc2() -> None:
    data = bytes((0x05, 0x74, 0, 0, 0, 0, 0x44, 0x41, 0x20, 0))
    identity = decode_identity(data)
    assert str(identity) == 'PLC-2/30 at 1771-KG series B revision A, REM TEST'
    assert (identity.family, identity.counter_address) == ('PLC-2', 0x4144)
    bad = changed(data, byte1=0x38)
    assert bad.faults == ('no communication between module and processor',
                          'communication zone of the program has a wrong format')
    assert bad.remarks == ('download or upload in progress',)


def test_gateway_has_no_mode() -> None:
    identity = decode_identity(bytes((0x00, 0xF3, 0, 0, 0, 0, 0x10, 0x20, 0x60, 0x1F)))
    assert str(identity) == '1771-KE/KF or 1770-KF2 series D revision A'
    assert (identity.is_running, identity.counter_address) == (None, 0x2010)


def test_gateway_with_a_name() -> None:
    identity = decode_identity(bytes((0, 0xFE, 0x2C, 0, 0)) + b'1770-KF3\0xx' + bytes(8))
    assert (str(identity), identity.is_running) == ('1770-KF3 series A revision 1', None)


def test_unknown_layout_is_shown_in_hexadecimal() -> None:
    assert str(decode_identity(bytes.fromhex('00 99 12 34'))) == \
        'unknown processor (00 99 12 34)'


@pytest.mark.parametrize('data', [b'', b'\0', PLC5[:35]])
def test_too_short(data: bytes) -> None:
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
@PROPERTY
def test_any_bytes_are_an_identity_or_a_format_error(data: bytes) -> None:
    try:
        identity = decode_identity(data)
    except FormatError:
        return
    assert str(identity)
    for text in (str(identity), identity.name, identity.mode_text, *identity.faults,
                 *identity.remarks):
        assert text.isprintable()
