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

"""The identity that a module in front of a PLC-2 reports (M 10-7, 10-17)."""

from __future__ import annotations

from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import code_of, Identity, letters, Mode, mode_of, named, word_at

KG = 0x14  # byte 2: a 1771-KG (4) of a PLC-2 (1)
MODULE_ALONE = 0x08  # byte 1
SIZE = 10
_KA3 = 0xD
_EXPANSION = 0xE  # in the place of the processor: the next byte has the processor (M 10-17)

MODES = {0: Mode.PROGRAM, 1: Mode.TEST, 2: Mode.RUN, 4: Mode.REMOTE_PROGRAM, 5: Mode.REMOTE_TEST}

# Byte 2: the module's own type in bits 0-3, its processor in bits 4-7.
_MODULES = {0: '1771-KC/KD', 1: '1771-KA2', 2: '1771-KA4', 3: '1771-KE/KF or 1770-KF2',
            4: '1771-KG', 5: '1771-KGM', _KA3: '1785-KA3'}
_PROCESSORS = {
    0x0: 'PLC', 0x1: 'PLC-2', 0x2: 'PLC-2/20 (LP1)', 0x3: 'Mini-PLC-2', 0x5: 'PLC-2/20 (LP2)',
    0x6: 'PLC-2/02 to 2/17', 0x7: 'PLC-2/30', 0xF: 'computer'}
_KA3_PROCESSORS = _PROCESSORS | {0x6: 'PLC-2/15'}
_KA3_EXPANSION = {0x1D: 'PLC-2/02', 0x1E: 'PLC-2/05', 0x1F: 'PLC-2/16', 0x20: 'PLC-2/17'}


def decode(data: bytes) -> Identity | None:
    """
    Read the data of a reply to 06/03; None when they are not in this form.

    A module without a processor, in front of a computer, has no family and no mode.
    """
    module, processor = _MODULES.get(data[1] & 0x0F), _processor(data)
    # After an expansion byte all fields are one byte later.
    rest = data[3 if data[1] >> 4 == _EXPANSION else 2:]
    if module is None or processor is None or len(rest) < SIZE - 2:
        return None
    address, series = word_at(rest, 4), letters(rest[6])
    if processor == 'computer':
        return Identity(None, module, *series, interface=data[1], counter_address=address)
    mode, mode_text = mode_of(MODES, data[0] & 0x07)
    faults = named({'no communication between module and processor': data[0] & MODULE_ALONE,
                    'communication zone of the program has a wrong format': data[0] & 0x20})
    remarks = named({'download or upload in progress': data[0] & 0x10})
    return Identity(PlcType.PLC2, f'{processor} at {module}', *series, mode, mode_text, faults,
                    remarks, interface=data[1], counter_address=address)


def _processor(data: bytes) -> str | None:
    kind = data[1] >> 4
    if data[1] & 0x0F != _KA3:
        return _PROCESSORS.get(kind)
    if kind != _EXPANSION:
        return _KA3_PROCESSORS.get(kind)
    return _KA3_EXPANSION.get(data[2], f'PLC-2 of type 0x{data[2]:02X}') if data[2:] else None


def encode(emulated: EmulatedProcessor) -> bytes:
    """
    Return the data of the reply of a PLC-2 behind a 1771-KG to 06/03.

    Fields for memory and programs are 0, because the emulated PLC has none.
    """
    # There is no remote run; a PLC-2 that has faulted does not talk to its module.
    state = code_of(MODES, Mode.RUN if emulated.mode is Mode.REMOTE_RUN else emulated.mode)
    return bytes((state | MODULE_ALONE * emulated.is_faulted, KG)).ljust(SIZE, b'\0')
