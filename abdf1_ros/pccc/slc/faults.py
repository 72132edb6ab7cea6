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
The meaning of the major error code of an SLC 500 or MicroLogix (word S:6; M 10-3, 10-4).

The texts are general knowledge of these processors: no manual that lists them was at hand, so the
code is always shown beside them. Publication 1747-RM001 has the list. A code from 50 on
(hexadecimal) in the low byte is about the I/O slot in the high byte. Codes that only one
MicroLogix model has, or that have another meaning there, are left out: the manual of that
controller has their text.
"""

from __future__ import annotations

_CODES = {
    0x01: 'NVRAM error',
    0x02: 'hardware watchdog timeout',
    0x03: 'memory module error',
    0x04: 'memory error while running',
    0x10: 'processor does not have the revision that the program needs',
    0x11: 'program file 2 is missing',
    0x12: 'memory error in the ladder program',
    0x14: 'internal file error',
    0x15: 'configuration file error',
    0x16: 'startup protection after a power loss',
    0x18: 'program does not fit the operating system',
    0x20: 'minor error at the end of a scan',
    0x21: 'power failure of an expansion chassis or of expansion I/O',
    0x22: 'watchdog: scan time exceeded',
    0x23: 'timed interrupt file missing or invalid',
    0x24: 'timed interrupt interval invalid',
    0x28: 'fault routine file missing or invalid',
    0x29: 'indexed address outside the data files',
    0x30: 'too many nested subroutines',
    0x31: 'unsupported instruction',
    0x32: 'sequencer reaches past the end of its data file',
    0x33: 'shift or FIFO/LIFO instruction reaches past the end of its data file',
    0x34: 'negative timer preset or accumulator',
    0x35: 'instruction not allowed in an interrupt or fault routine',
    0x38: 'RET instruction in the main program',
}
_SLOT_CODES = {
    0x50: 'chassis data error',
    0x51: 'stuck error of a module',
    0x52: 'module is missing or was removed',
    0x53: 'module in a slot that is configured as unused',
    0x54: 'module is not of the configured type',
    0x55: 'module has another number of I/O points than configured',
    0x56: 'chassis configuration is not that of the program',
    0x57: 'module does not respond',
    0x58: 'module reports an error',
}


def major_error(code: int) -> str:
    """Return code and meaning, e.g. "major error 0x0022 (watchdog: scan time exceeded)"."""
    slot, low = divmod(code, 256)
    meaning = _CODES.get(code, '')
    if low in _SLOT_CODES:
        meaning = f'slot {slot}: {_SLOT_CODES[low]}'
    return f'major error 0x{code:04X}' + (f' ({meaning})' if meaning else '')
