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

"""libpccc, a library in C over its link service df1d: SLC commands, whole T, C and R."""

from __future__ import annotations

import ctypes
import re
import sys

from player import Cannot, play

STATUS, BINARY, TIMER, COUNTER, CONTROL, INTEGER, FLOAT, STRING = 0, 1, 2, 3, 4, 5, 6, 9
WAIT = 5  # s for a reply

TIMER_BITS = ('en', 'tt', 'dn')
COUNTER_BITS = ('cu', 'cd', 'dn', 'ov', 'un', 'ua')
CONTROL_BITS = ('en', 'eu', 'dn', 'em', 'er', 'ul', 'in', 'fd')


class Timer(ctypes.Structure):
    _fields_ = [('pre', ctypes.c_int16), ('acc', ctypes.c_int16), ('base', ctypes.c_int),
                *((name, ctypes.c_uint, 1) for name in TIMER_BITS)]


class Counter(ctypes.Structure):
    _fields_ = [('pre', ctypes.c_int16), ('acc', ctypes.c_int16),
                *((name, ctypes.c_uint, 1) for name in COUNTER_BITS)]


class Control(ctypes.Structure):
    _fields_ = [('pos', ctypes.c_int16), ('len', ctypes.c_int16),
                *((name, ctypes.c_uint, 1) for name in CONTROL_BITS)]


class String(ctypes.Structure):
    _fields_ = [('len', ctypes.c_size_t), ('txt', ctypes.c_char * 83)]


# letter: the library's number, its type, and for structures the words after the first and bits
# from 15 downwards
TYPES = {
    'N': (INTEGER, ctypes.c_int16), 'B': (BINARY, ctypes.c_uint16), 'S': (STATUS, ctypes.c_uint16),
    'F': (FLOAT, ctypes.c_float), 'ST': (STRING, String),
    'T': (TIMER, Timer), 'C': (COUNTER, Counter), 'R': (CONTROL, Control)}
SECONDS = 1 << 9  # of the control word of a timer
WORDS = {'T': ('pre', 'acc'), 'C': ('pre', 'acc'), 'R': ('len', 'pos')}
BITS = {'T': TIMER_BITS, 'C': COUNTER_BITS, 'R': CONTROL_BITS}


def main() -> None:
    """Play through the library and the port of df1d in the arguments, towards station 1."""
    library = ctypes.CDLL(sys.argv[1])
    library.pccc_new.restype = ctypes.c_void_p
    library.pccc_new.argtypes = ctypes.c_uint8, ctypes.c_uint, ctypes.c_size_t
    connection = ctypes.c_void_p(library.pccc_new(0, WAIT, 4))

    def checked(status: int) -> None:
        if status:
            text = ctypes.create_string_buffer(256)
            library.pccc_errstr(connection, status, text, 256)
            raise OSError(text.value.decode(errors='replace'))

    checked(library.pccc_connect(
        connection, b'127.0.0.1', ctypes.c_uint16(int(sys.argv[2])), b'interop'))

    def command(name: str, data: object, letter: str, table: int, element: int,
                count: int) -> None:
        function = getattr(library, f'pccc_cmd_ProtectedTypedLogical{name}3AddressFields')
        checked(function(connection, None, ctypes.c_uint8(1), ctypes.byref(data),
                         TYPES[letter][0], ctypes.c_uint16(table), ctypes.c_uint16(element),
                         ctypes.c_uint16(0), ctypes.c_size_t(count)))

    def read(address: str, count: int) -> object:
        letter, table, element, bit = parts(address)
        count = 1 if letter in WORDS else count
        data = (TYPES[letter][1] * count)()
        command('Read', data, letter, table, element, count)
        if bit is not None:
            return [data[0] >> bit & 1]
        if letter == 'ST':
            return data[0].txt[:data[0].len].decode('latin-1')
        if letter in WORDS:
            return words_of(letter, data[0])
        return list(data)

    def write(address: str, values: object) -> None:
        letter, table, element, bit = parts(address)
        if bit is not None:
            data, mask = ctypes.c_uint16(values[0] << bit), ctypes.c_uint16(1 << bit)
            checked(library.pccc_cmd_ProtectedTypedLogicalWriteWithMask(
                connection, None, ctypes.c_uint8(1), ctypes.byref(data), mask, TYPES[letter][0],
                ctypes.c_uint16(table), ctypes.c_uint16(element), ctypes.c_uint16(0),
                ctypes.c_size_t(1)))
            return
        if letter == 'ST':
            text = values.encode('latin-1')
            data = String(len(text), text)
            command('Write', data, letter, table, element, 1)
        elif letter in WORDS:
            command('Write', structure(letter, values), letter, table, element, 1)
        else:
            data = (TYPES[letter][1] * len(values))(*values)
            command('Write', data, letter, table, element, len(values))

    play(read, write)


def words_of(letter: str, data: ctypes.Structure) -> list[int]:
    """Return the three words of an element."""
    control = sum(getattr(data, name) << 15 - number for number, name in enumerate(BITS[letter]))
    if letter == 'T' and data.base == 0:  # seconds
        control |= SECONDS
    return [control, *(getattr(data, name) for name in WORDS[letter])]


def structure(letter: str, words: list[int]) -> ctypes.Structure:
    """Return the element that has these three words."""
    data = TYPES[letter][1]()
    for number, name in enumerate(BITS[letter]):
        setattr(data, name, words[0] >> 15 - number & 1)
    if letter == 'T':
        data.base = not words[0] & SECONDS
    for name, word in zip(WORDS[letter], words[1:]):
        setattr(data, name, word)
    return data


def parts(address: str) -> tuple[str, int, int, int | None]:
    """Return letter, file, element and bit."""
    match = re.fullmatch(r'([A-Z]+)(\d*):(\d+)(?:/(\d+))?', address)
    if not match:
        raise Cannot('a part of an element cannot be named: sub-elements have to be 0')
    letter, table, element, bit = match.groups()
    return letter, int(table or 2), int(element), None if bit is None else int(bit)


main()
