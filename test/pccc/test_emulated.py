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

"""The processor that an emulated PLC claims to be."""

from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import decode_identity, FAMILIES
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.vectors import pair


def encoded(plc_type: PlcType, setting: Setting = Setting.REMOTE,
            is_full_duplex: bool = False) -> bytes:
    return FAMILIES[plc_type].encode_identity(EmulatedProcessor(setting, is_full_duplex))


def test_slc_has_the_layout_of_the_vectors() -> None:
    ours = encoded(PlcType.SLC, is_full_duplex=True)
    theirs = pair('diag_status_slc504')[1].data
    assert len(ours) == len(theirs) == 24
    assert ours[:3] == theirs[:3]  # mode, type extender, full duplex
    assert ours[3] == 0x49  # a 5/03
    assert ours[5:16] == b'5/03       '
    assert ours[16:20] == b'\0\0\x06\0'  # no major error, remote run
    assert ours[23] == theirs[23] == 0xFC  # no owner of the program
    assert encoded(PlcType.SLC)[2] == 0x36  # half duplex


def test_plc5_has_the_layout_of_the_vectors() -> None:
    ours = encoded(PlcType.PLC5)
    theirs = pair('diag_status_plc5_40')[1].data
    assert len(ours) == len(theirs) == 36
    assert ours[:3] == theirs[:3]  # remote run, PLC-5, 5/40


@pytest.mark.parametrize(('plc_type', 'size', 'first'), [
    (PlcType.PLC3, 18, b'\x02\x47'), (PlcType.PLC2, 10, b'\x02\x14')])
def test_older_families_tell_of_themselves_in_their_own_layout(
        plc_type: PlcType, size: int, first: bytes) -> None:
    data = encoded(plc_type)
    assert (len(data), data[:2]) == (size, first)


@pytest.mark.parametrize(('plc_type', 'texts'), [
    (PlcType.SLC, ('RUN', 'REM PROG', 'REM RUN', 'REM TEST')),
    (PlcType.PLC5, ('RUN', 'REM PROG', 'REM RUN', 'REM TEST')),
    (PlcType.PLC3, ('RUN', 'PROG', 'RUN', 'TEST')),
    (PlcType.PLC2, ('RUN', 'REM PROG', 'RUN', 'REM TEST'))])
def test_every_setting_is_read_back(plc_type: PlcType, texts: tuple[str, ...]) -> None:
    settings = (Setting.RUN, Setting.PROGRAM, Setting.REMOTE, Setting.TEST)
    identities = [decode_identity(encoded(plc_type, setting))
                  for setting in settings]
    assert tuple(identity.mode_text for identity in identities) == texts
    assert [identity.is_running for identity in identities] == [True, False, True, False]
    assert not any(identity.faults for identity in identities)


@pytest.mark.parametrize(('plc_type', 'fault'), [
    (PlcType.SLC, 'major error 0x0020 (minor error at the end of a scan), processor halted'),
    (PlcType.PLC5, 'major processor fault (word S:11 says which)'),
    (PlcType.PLC3, 'major processor fault'),
    (PlcType.PLC2, 'no communication between module and processor')])
def test_fault_is_read_back(plc_type: PlcType, fault: str) -> None:
    identity = decode_identity(encoded(plc_type, Setting.FAULT))
    assert (identity.faults, identity.is_running) == ((fault,), False)
