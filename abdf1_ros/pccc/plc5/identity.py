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

"""
The identity that a PLC-5 reports (M 10-20..10-22).

The oldest models have no expansion byte, so their fields after the type are one byte earlier. The
reply of a 5/12, 5/15 or 5/25 ends with the byte about its RAM.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import link_counters as names
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.identity import (
    code_of,
    Identity,
    Inquiry,
    letters,
    Mode,
    mode_of,
    named,
    word_at,
)
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.plc5.dialect import Plc5Dialect

EXTENDED = 0xEB  # byte 2: an expansion byte tells the model
PLC_5_40 = 0x15
MAJOR_FAULT = 0x08  # byte 1
SIZE = 36
_BEFORE_SIZES = 3
_FIELDS = 15  # from the size of the memory to the byte about the RAM

# Byte 2 without an expansion byte (M 10-20).
_WITHOUT_EXPANSION = {0xBB: 'PLC-5/15', 0xCB: 'PLC-5 VME (6008-LTV)'}

# Byte 3. 55 is printed as 5/25 in M 10-22, beside the number of a 5/80.
_MODELS = {
    0x13: '5/12', 0x14: '5/25', PLC_5_40: '5/40', 0x22: '5/10', 0x23: '5/60', 0x28: '5/40L',
    0x29: '5/60L', 0x31: '5/11', 0x32: '5/20', 0x33: '5/30', 0x4A: '5/20E', 0x4B: '5/40E',
    0x55: '5/80', 0x59: '5/80E'}

MODES = {0: Mode.PROGRAM, 2: Mode.RUN, 4: Mode.REMOTE_PROGRAM, 5: Mode.REMOTE_TEST,
         6: Mode.REMOTE_RUN}

COUNTERS = (
    names.MODEM_LINES, names.SENT, names.RECEIVED, names.UNDELIVERED, names.ENQ_OR_SENT_AGAIN,
    names.NAK_RECEIVED, names.ENQ_RECEIVED, names.BAD, names.NAK_SENT, names.DUPLICATES,
    'receive errors', names.DCD, names.LOST)

_UNNAMED_FAULT = 'major processor fault (word S:11 says which)'
_FAULT_WORDS = Address(ADDRESSING, FileType.STATUS, 2, 11)
# Bits of S:11. The texts are general knowledge of these processors: no manual that lists them was
# at hand (1785-UM012 has the status file).
_FAULTS = (
    'corrupted program file', 'bad address in the ladder program', 'programming error',
    'SFC fault', 'error when the program was assembled', 'start-up protection',
    'peripheral device fault', 'the program jumped to the fault routine', 'watchdog',
    'system configured wrong', 'recoverable hardware error',
    'a main control program is missing or of a wrong type',
    'the processor input interrupt file is missing or no ladder file',
    'the timed interrupt file is missing or no ladder file',
    'the fault routine is missing or no ladder file',
    'the faulted program file holds no ladder logic')


def decode(data: bytes) -> Identity | None:
    """
    Read the data of a reply to 06/03; None when they are not in this form.

    Raises FormatError for a reply that breaks off.
    """
    if data[1] == EXTENDED:
        number, fields = data[2:3].hex().upper(), data[_BEFORE_SIZES:]
        known = _MODELS.get(int(number or '0', 16))
        model = f'PLC-{known}' if known else f'PLC-5 of type 0x{number}'
    elif data[1] in _WITHOUT_EXPANSION:
        model, fields = _WITHOUT_EXPANSION[data[1]], data[_BEFORE_SIZES - 1:]
    else:
        return None
    if len(fields) < _FIELDS:
        raise FormatError(f'a diagnostic status of {len(data)} bytes; that of a PLC-5 has '
                          f'{len(data) - len(fields) + _FIELDS} or more')
    mode, mode_text = mode_of(MODES, data[0] & 0x07)
    faults = named({_UNNAMED_FAULT: data[0] & MAJOR_FAULT, 'bad RAM': fields[14]})
    remarks = named({
        'download in progress': data[0] & 0x10, 'testing edits': data[0] & 0x40,
        'edits in the processor': data[0] & 0x80, 'forces active': fields[12] & 0x01,
        'forces installed': fields[12] & 0x10, 'memory protected': fields[13]})
    size = int.from_bytes(fields[:4], 'little')
    identity = Identity(PlcType.PLC5, model, *letters(fields[4]), mode, mode_text, faults, remarks,
                        memory=f'{size} (unit not documented)' if size else '',
                        counter_layout=COUNTERS)
    if _UNNAMED_FAULT not in faults:
        return identity
    request = Plc5Dialect().read(_FAULT_WORDS, 2)
    return replace(identity, inquiry=Inquiry(request, partial(_with_fault, identity)))


def _with_fault(identity: Identity, reply: bytes) -> Identity:
    """
    Return an identity whose fault is named by S:11 and S:12.

    Raises FormatError if the reply does not contain these words.
    """
    words = Plc5Dialect().read_data(_FAULT_WORDS, 2, reply)
    bits, code = word_at(words, 0), word_at(words, 2)
    causes = [text for bit, text in enumerate(_FAULTS) if bits >> bit & 1] or ['S:11 is 0']
    fault = f'major processor fault: {", ".join(causes)}; fault code {code} (S:12)'
    return replace(identity, faults=tuple(
        fault if text == _UNNAMED_FAULT else text for text in identity.faults))


def encode(emulated: EmulatedProcessor) -> bytes:
    """
    Return the data of the reply of a PLC-5/40 to 06/03.

    Fields for memory and programs are 0, because the emulated PLC has none.
    """
    state = code_of(MODES, emulated.mode) | MAJOR_FAULT * emulated.is_faulted
    return bytes((state, EXTENDED, PLC_5_40)).ljust(SIZE, b'\0')
