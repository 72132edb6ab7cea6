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
What a processor says of itself in the reply to a diagnostic status command (06/03).

The layouts are those of M 10-3 and 10-4 (SLC), 10-6 (MicroLogix 1000), 10-21 and 10-22 (PLC-5),
10-13 (PLC-3) and 10-7 (the modules in front of a PLC-2, and the gateways to other links). What
has none of these forms is shown in hexadecimal and never interpreted.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abdf1_ros.errors import FormatError
from abdf1_ros.text import printable

EXTENDED_SLC = 0xEE  # byte 2: interface and processor type follow, then a name
_EXTENDED_MODULE = 0xFE
EXTENDED_PLC5 = 0xEB
_PLC5_15 = 0xBB
SLC_SIZE = 24
PLC5_SIZE = 36
PLC3_SIZE = 18
MODULE_SIZE = 10

FULL_DUPLEX_PORT = 0x34
HALF_DUPLEX_PORT = 0x36
SLC_5_03 = 0x49
MICROLOGIX_1000 = 0x58
PLC_5_40 = 0x15
PLC3_PORT = 0x47  # a 1775-KA's RS-232 port (7) of a PLC-3 (4)
KG_OF_PLC2 = 0x14  # a 1771-KG (4) of a PLC-2 (1)

# Byte 4 of an SLC or MicroLogix; the codes from 78 on are those that drivers in the field know.
_SLC_MODELS = {
    0x18: 'SLC 5/01', 0x1A: 'SLC 500 fixed', 0x25: 'SLC 5/02', SLC_5_03: 'SLC 5/03',
    0x5B: 'SLC 5/04', MICROLOGIX_1000: 'MicroLogix 1000', 0x78: 'SLC 5/05',
    0x88: 'MicroLogix 1200', 0x89: 'MicroLogix 1500 LSP', 0x8C: 'MicroLogix 1500 LRP',
    0x9C: 'MicroLogix 1100'}

# Names of SLCs and MicroLogix whose code nobody has published, such as that of the 1400.
_SLC_NAMES = ('5/', '500', '1747', '1761', '1762', '1763', '1764', '1766')

# Byte 3 of a PLC-5. 55 is printed as 5/25 in M 10-22, beside the number of a 5/80.
_PLC5_MODELS = {
    0x13: '5/12', 0x14: '5/25', PLC_5_40: '5/40', 0x22: '5/10', 0x23: '5/60', 0x28: '5/40L',
    0x29: '5/60L', 0x31: '5/11', 0x32: '5/20', 0x33: '5/30', 0x4A: '5/20E', 0x4B: '5/40E',
    0x55: '5/80', 0x59: '5/80E'}

# Byte 2 of a module: its own type below, the processor behind it above.
_MODULES = {0: '1771-KC/KD', 1: '1771-KA2', 2: '1771-KA4', 3: '1771-KE/KF or 1770-KF2',
            4: '1771-KG', 5: '1771-KGM'}
_BEHIND_MODULE = {
    0x0: 'PLC', 0x1: 'PLC-2', 0x2: 'PLC-2/20 (LP1)', 0x3: 'Mini-PLC-2', 0x5: 'PLC-2/20 (LP2)',
    0x6: 'PLC-2/02 to 2/17', 0x7: 'PLC-2/30', 0xF: 'computer'}

MAJOR_ERROR_HALTED = 0x20  # byte 20 of an SLC
PLC5_MAJOR_FAULT = PLC3_MAJOR_FAULT = MODULE_ALONE = 0x08  # byte 1


class Mode(Enum):
    """What the key and the programmer have set a processor to, in the words of their screens."""

    REMOTE_RUN = 'REM RUN'
    RUN = 'RUN'
    REMOTE_PROGRAM = 'REM PROG'
    PROGRAM = 'PROG'
    REMOTE_TEST = 'REM TEST'
    REMOTE_TEST_SCAN = 'REM TEST, single scan'
    REMOTE_TEST_STEP = 'REM TEST, step'
    TEST = 'TEST'
    REMOTE_SUSPEND = 'REM SUSPEND'
    SUSPEND = 'SUSPEND'
    REMOTE_DOWNLOAD = 'REM DOWNLOAD'
    DOWNLOAD = 'DOWNLOAD'

    @property
    def is_running(self) -> bool:
        """Tell whether the program runs and drives outputs, which it does not in a test."""
        return self in (Mode.REMOTE_RUN, Mode.RUN)

    @property
    def words(self) -> str:
        """Return what the mode is called in a sentence."""
        return _MODE_WORDS[self.value.removeprefix('REM ').partition(',')[0]]


_MODE_WORDS = {'RUN': 'run', 'PROG': 'program', 'TEST': 'test', 'SUSPEND': 'suspend',
               'DOWNLOAD': 'download'}

SLC_MODES = {
    0x00: Mode.REMOTE_DOWNLOAD, 0x01: Mode.REMOTE_PROGRAM, 0x03: Mode.REMOTE_SUSPEND,
    0x06: Mode.REMOTE_RUN, 0x07: Mode.REMOTE_TEST, 0x08: Mode.REMOTE_TEST_SCAN,
    0x09: Mode.REMOTE_TEST_STEP, 0x10: Mode.DOWNLOAD, 0x11: Mode.PROGRAM, 0x1B: Mode.SUSPEND,
    0x1E: Mode.RUN}
PLC5_MODES = {0: Mode.PROGRAM, 2: Mode.RUN, 4: Mode.REMOTE_PROGRAM, 5: Mode.REMOTE_TEST,
              6: Mode.REMOTE_RUN}
PLC3_MODES = {0: Mode.PROGRAM, 1: Mode.TEST, 2: Mode.RUN}
PLC2_MODES = PLC3_MODES | {4: Mode.REMOTE_PROGRAM, 5: Mode.REMOTE_TEST}


@dataclass(frozen=True, slots=True)
class Identity:
    """
    Who is there, in which mode, and what is wrong with it.

    ``family`` is SLC, PLC-5, PLC-3, PLC-2 or empty where it is unknown; ``mode`` None where the
    reply has none or one without a name, which is then in ``mode_text``. ``faults`` keep a
    processor from doing its work, ``remarks`` do not. ``name`` is in the processor's own words
    with control characters made visible, ``memory`` in its own unit. ``interface`` is the code
    of the port that was asked; ``counter_address`` is for ``ReadCounters``.
    """

    family: str
    model: str
    series: str = ''
    revision: str = ''
    mode: Mode | None = None
    mode_text: str = ''
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    name: str = ''
    program_id: int | None = None
    memory: str = ''
    interface: int | None = None
    counter_address: int = 0

    @property
    def is_micrologix_1000(self) -> bool:
        """Tell the one of its family whose counters differ."""
        return self.model == _SLC_MODELS[MICROLOGIX_1000]

    @property
    def is_running(self) -> bool | None:
        """Tell whether the program runs, None where the reply does not say."""
        return None if self.mode is None else self.mode.is_running

    def __str__(self) -> str:
        """Return one line such as "SLC 5/03 series B revision 3, REM RUN"."""
        text = self.model
        if self.series:
            text += f' series {self.series} revision {self.revision}'
        return f'{text}, {self.mode_text}' if self.mode_text else text


def decode_identity(data: bytes) -> Identity:
    """Read the data of a reply to 06/03; raise FormatError when it is too short to be one."""
    if len(data) < 2:
        raise FormatError(f'a diagnostic status of {len(data)} bytes')
    kind = data[1]
    if kind == EXTENDED_SLC and len(data) >= SLC_SIZE:
        return _slc(data)
    if kind in (EXTENDED_PLC5, _PLC5_15):
        return _plc5(data)
    if kind >> 4 == PLC3_PORT >> 4 and len(data) >= PLC3_SIZE:
        return _plc3(data)
    if kind & 0x0F in _MODULES and kind >> 4 in _BEHIND_MODULE and len(data) >= MODULE_SIZE:
        return _module(data)
    if kind == _EXTENDED_MODULE and len(data) >= SLC_SIZE:
        return _named_module(data)
    return Identity('', f'unknown processor ({data[:8].hex(" ").upper()})')


def _slc(data: bytes) -> Identity:
    """Read the 24 bytes of an SLC or MicroLogix (M 10-3, 10-4, 10-6)."""
    name = _name(data[5:16])
    model = _SLC_MODELS.get(data[3], name or f'processor 0x{data[3]:02X}')
    if data[3] not in _SLC_MODELS and not name.startswith(_SLC_NAMES):
        return Identity('', model, *_release(data[4]), name=name, interface=data[2])
    mode, mode_text = _mode(SLC_MODES, data[18] & 0x1F)
    error = _word(data, 16)
    halted = bool(data[19] & MAJOR_ERROR_HALTED)
    faults = (f'major error 0x{error:04X}, processor halted',) if halted else ()
    remarks = _named({
        f'last major error 0x{error:04X}': error and not halted,
        'forces active': data[18] & 0x20, 'forces installed': data[18] & 0x40,
        'testing edits': data[0] & 0x40, 'edits in the processor': data[0] & 0x80,
        'program directory corrupted': data[23] & 0x01})
    return Identity('SLC', model, *_release(data[4]), mode, mode_text, faults, remarks, name,
                    _word(data, 20), f'{data[22]} K', data[2])


def _plc5(data: bytes) -> Identity:
    """Read what a PLC-5 says (M 10-21, 10-22); a 5/15 has no expansion byte and less is known."""
    mode, mode_text = _mode(PLC5_MODES, data[0] & 0x07)
    faults = _named({'major processor fault (word S:11 says which)': data[0] & PLC5_MAJOR_FAULT})
    edits = {'download in progress': data[0] & 0x10, 'testing edits': data[0] & 0x40,
             'edits in the processor': data[0] & 0x80}
    if data[1] == _PLC5_15:
        return Identity('PLC-5', 'PLC-5/15', '', '', mode, mode_text, faults, _named(edits))
    if len(data) < PLC5_SIZE:
        raise FormatError(f'a diagnostic status of {len(data)} bytes; a PLC-5 has {PLC5_SIZE}')
    model = _PLC5_MODELS.get(data[2])
    remarks = _named(edits | {
        'forces active': data[15] & 0x01, 'forces installed': data[15] & 0x10,
        'memory protected': data[16]})
    faults += _named({'bad RAM': data[17]})
    return Identity(
        'PLC-5', f'PLC-{model}' if model else f'PLC-5 of type 0x{data[2]:02X}',
        *_letters(data[7]), mode, mode_text, faults, remarks,
        memory=str(int.from_bytes(data[3:7], 'little')))


def _plc3(data: bytes) -> Identity:
    """Read the 18 bytes of a PLC-3's port (M 10-13); series and revision are the module's."""
    mode, mode_text = _mode(PLC3_MODES, data[0] & 0x03)
    faults = _named({'major processor fault': data[0] & PLC3_MAJOR_FAULT,
                     'shutdown in effect': data[0] & 0x20})
    remarks = _named({'shutdown requested': data[0] & 0x10})
    return Identity('PLC-3', 'PLC-3', *_letters(data[8]), mode, mode_text, faults, remarks,
                    interface=data[1], counter_address=_word(data, 6))


def _module(data: bytes) -> Identity:
    """Read what a module in front of a PLC-2, or of a computer, says (M 10-7)."""
    module, processor = _MODULES[data[1] & 0x0F], _BEHIND_MODULE[data[1] >> 4]
    address = _word(data, 6)
    if processor == 'computer':
        return Identity('', module, *_letters(data[8]), interface=data[1],
                        counter_address=address)
    mode, mode_text = _mode(PLC2_MODES, data[0] & 0x07)
    faults = _named({'no communication between module and processor': data[0] & MODULE_ALONE,
                     'communication zone of the program has a wrong format': data[0] & 0x20})
    remarks = _named({'download or upload in progress': data[0] & 0x10})
    return Identity('PLC-2', f'{processor} at {module}', *_letters(data[8]), mode, mode_text,
                    faults, remarks, interface=data[1], counter_address=address)


def _named_module(data: bytes) -> Identity:
    """Read the 24 bytes of a module that has a name and no mode, such as a 1770-KF3 (M 10-7)."""
    name = _name(data[5:16])
    return Identity('', name or f'module 0x{data[2]:02X}', *_release(data[4]), name=name,
                    interface=data[2])


def _mode(modes: dict[int, Mode], code: int) -> tuple[Mode | None, str]:
    mode = modes.get(code)
    return mode, mode.value if mode else f'mode 0x{code:02X}'


def _release(byte: int) -> tuple[str, str]:
    """Return series and revision where releases are counted from 1 (M 10-4)."""
    return _letter(byte >> 5), str((byte & 0x1F) + 1)


def _letters(byte: int) -> tuple[str, str]:
    """Return series and revision where both are letters (M 10-22)."""
    return _letter(byte >> 5), _letter(byte & 0x1F)


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at:at + 2], 'little')


def _letter(number: int) -> str:
    return chr(ord('A') + number) if number < 26 else str(number)


def _name(data: bytes) -> str:
    """Return a name that is safe to show, whatever the bytes are."""
    return printable(data.partition(b'\0')[0].decode('latin-1').strip())


def _named(conditions: dict[str, int]) -> tuple[str, ...]:
    return tuple(name for name, holds in conditions.items() if holds)
