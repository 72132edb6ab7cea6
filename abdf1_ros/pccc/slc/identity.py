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
The identity of an SLC 500 or MicroLogix: 24 bytes (M 10-3, 10-4, 10-6).

A MicroLogix 1100 and a 1400 were seen to send a 25th byte, which no manual explains.
"""

from __future__ import annotations

from typing import NamedTuple

from abdf1_ros.pccc import link_counters as names
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import (
    code_of,
    Identity,
    Mode,
    mode_of,
    name_in,
    named,
    release,
    word_at,
)
from abdf1_ros.pccc.link_counters import CounterLayout
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.slc.faults import major_error

EXTENDED = 0xEE  # byte 2: interface and processor type follow, then a name
SIZE = 24

FULL_DUPLEX_PORT = 0x34
HALF_DUPLEX_PORT = 0x36


class _SlcModel(NamedTuple):
    """Byte 4, the beginning of the name, the model, and its name in the map file."""

    code: int
    start: str
    model: str
    processor: Processor


# The codes from 78 on come from drivers in the field, and 9F also from a recording. A fixed SLC
# 500 accepts the packets of the 5/01 (M 7-17).
_MODELS = (
    _SlcModel(0x18, '5/01', 'SLC 5/01', Processor.SLC_5_01),
    _SlcModel(0x1A, '500', 'SLC 500 fixed', Processor.SLC_5_01),
    _SlcModel(0x25, '5/02', 'SLC 5/02', Processor.SLC_5_02),
    _SlcModel(0x49, '5/03', 'SLC 5/03', Processor.SLC_5_03),
    _SlcModel(0x5B, '5/04', 'SLC 5/04', Processor.SLC_5_04),
    _SlcModel(0x78, '5/05', 'SLC 5/05', Processor.SLC_5_05),
    _SlcModel(0x58, '1761', 'MicroLogix 1000', Processor.ML1000),
    _SlcModel(0x9C, '1763', 'MicroLogix 1100', Processor.ML1100),
    _SlcModel(0x88, '1762', 'MicroLogix 1200', Processor.ML1200),
    _SlcModel(0x9F, '1766', 'MicroLogix 1400', Processor.ML1400),
    _SlcModel(0x89, '1764', 'MicroLogix 1500 LSP', Processor.ML1500),
    _SlcModel(0x8C, '1764', 'MicroLogix 1500 LRP', Processor.ML1500))
_ANY_SLC = ('5/', '1747')  # the name of any SLC 500 begins with one of these

MODES = {
    0x00: Mode.REMOTE_DOWNLOAD, 0x01: Mode.REMOTE_PROGRAM, 0x03: Mode.REMOTE_SUSPEND,
    0x06: Mode.REMOTE_RUN, 0x07: Mode.REMOTE_TEST, 0x08: Mode.REMOTE_TEST_SCAN,
    0x09: Mode.REMOTE_TEST_STEP, 0x10: Mode.DOWNLOAD, 0x11: Mode.PROGRAM, 0x1B: Mode.SUSPEND,
    0x1E: Mode.RUN}

# The counters of a port by its role (M 9-6, 9-7, 9-31).
FULL_DUPLEX_COUNTERS = (
    names.MODEM_LINES, names.SENT, names.RECEIVED, names.UNDELIVERED, names.ENQ_SENT,
    names.NAK_RECEIVED, names.ENQ_RECEIVED, names.BAD, names.NO_MEMORY, names.DUPLICATES,
    names.UNUSED, names.DCD, names.LOST)
MASTER_COUNTERS = (
    names.MODEM_LINES, names.SENT, names.RECEIVED, names.UNDELIVERED, names.RETRIES,
    'last normal scan (100 ms)', 'longest normal scan (100 ms)', names.BAD, names.UNUSED,
    names.DUPLICATES, 'last priority scan (100 ms)', names.DCD, names.LOST,
    'longest priority scan (100 ms)')
SLAVE_COUNTERS = (
    names.MODEM_LINES, names.SENT, names.RECEIVED, names.UNDELIVERED, names.RETRIES,
    names.UNUSED, names.POLLS, names.BAD, names.NO_MEMORY, names.DUPLICATES, names.UNUSED,
    names.DCD, names.LOST)
# No source shows this reply by radio. The words are at the places of the status file CSx of a
# radio modem port (1763-RM001C 522: CSx:9 to CSx:18). Where other DF1 ports have counters of these
# names, they have them at the same places.
RADIO_COUNTERS = (
    names.MODEM_LINES, names.SENT, names.RECEIVED, names.UNSENT, *3 * [names.UNUSED], names.BAD,
    names.NO_MEMORY, names.DUPLICATES)
ML1000_COUNTERS = (
    names.UNUSED, names.SENT, names.RECEIVED, names.UNDELIVERED, names.ENQ_SENT,
    names.NAK_RECEIVED, names.ENQ_RECEIVED, names.BAD, names.NO_MEMORY, names.DUPLICATES,
    'framing errors')

MAJOR_ERROR_HALTED = 0x20  # byte 20
_ALWAYS_SET = 0x20  # byte 19 of a MicroLogix
_NO_OWNER = 0xFC  # byte 24: the program has no owner
_MINOR_ERROR_LEFT = 0x0020  # the major error of an emulated processor


def decode(data: bytes) -> Identity | None:
    """Read the data of a reply to 06/03; None when they are not in this form."""
    if len(data) < SIZE or data[1] != EXTENDED:
        return None
    code, name = data[3], name_in(data[5:16])
    model, processor, remarks = _model(code, name)
    if not model:
        return Identity(None, name or f'processor 0x{code:02X}', *release(data[4]), name=name,
                        interface=data[2])
    mode, mode_text = mode_of(MODES, data[18] & 0x1F)
    error = word_at(data, 16)
    halted = bool(data[19] & MAJOR_ERROR_HALTED)
    faults = (f'{major_error(error)}, processor halted',) if halted else ()
    remarks += named({
        f'last {major_error(error)}': error and not halted,
        # Bit 5 is always set on a MicroLogix (1762-RM001C C-4).
        'forces active': data[18] & _ALWAYS_SET and not model.startswith('MicroLogix'),
        'forces installed': data[18] & 0x40,
        'testing edits': data[0] & 0x40, 'edits in the processor': data[0] & 0x80,
        'program directory corrupted': data[23] & 0x01})
    return Identity(PlcType.SLC, model, *release(data[4]), mode, mode_text, faults, remarks, name,
                    word_at(data, 20), f'{data[22]} K' if data[22] else '', data[2],
                    processor=processor, counter_layout=_counters(processor, data[2]))


def _counters(processor: Processor | None, interface: int) -> CounterLayout:
    if processor is Processor.ML1000:
        return ML1000_COUNTERS
    return SLAVE_COUNTERS if interface == HALF_DUPLEX_PORT else FULL_DUPLEX_COUNTERS


def served_counters(mode: str) -> CounterLayout:
    """Return the counter layout of the port of an SLC in a mode."""
    return {'Peer': FULL_DUPLEX_COUNTERS, 'Master': MASTER_COUNTERS,
            'Radio': RADIO_COUNTERS}.get(mode, SLAVE_COUNTERS)


def _model(code: int, name: str) -> tuple[str, Processor | None, tuple[str, ...]]:
    """
    Return the model, which is empty for another family, its processor, and remarks.

    Codes of newer processors come only from drivers in the field. So if code and name disagree,
    the name counts.
    """
    by_code = next((known for known in _MODELS if known.code == code), None)
    by_name = next((known for known in _MODELS if name.startswith(known.start)), None)
    if by_code and (by_name is None and not name.startswith(_ANY_SLC)
                    or by_name and by_name.processor is by_code.processor):
        return by_code.model, by_code.processor, ()
    remarks = (f'its processor code 0x{code:02X} is that of a {by_code.model}',) if by_code else ()
    if by_name:
        return by_name.model.removesuffix(' LSP'), by_name.processor, remarks
    return (name, None, remarks) if name.startswith(_ANY_SLC) else ('', None, ())


def encode(emulated: EmulatedProcessor) -> bytes:
    """
    Return the data of the reply of an SLC 5/03, or of another processor, to 06/03.

    Fields for memory and programs are 0, because the emulated PLC has none.
    """
    processor = emulated.processor or USUAL
    known = next(known for known in _MODELS if known.processor is processor)
    is_micrologix = known.model.startswith('MicroLogix')
    port = FULL_DUPLEX_PORT if emulated.is_full_duplex else HALF_DUPLEX_PORT
    error = _MINOR_ERROR_LEFT if emulated.is_faulted else 0
    state = code_of(MODES, emulated.mode) | _ALWAYS_SET * is_micrologix
    return (bytes((0, EXTENDED, port, known.code, 0))
            + (known.start + '-LEC' * is_micrologix).encode().ljust(11)
            + error.to_bytes(2, 'little')
            + bytes((state, MAJOR_ERROR_HALTED * emulated.is_faulted, 0, 0, 0, _NO_OWNER)))
