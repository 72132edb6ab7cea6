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

"""libplctag, an EtherNet/IP client in C: unconnected, PLC-5 word range or SLC typed."""

from __future__ import annotations

import ctypes
import re
import sys

from player import Cannot, play

TIMEOUT = 5000  # ms
SIZES = {'N': 2, 'B': 2, 'S': 2, 'I': 2, 'O': 2, 'F': 4, 'L': 4, 'ST': 84, 'T': 6, 'C': 6, 'R': 6}
FIXED = {'O': 0, 'I': 1, 'S': 2}  # numbers of files


def main() -> None:
    """Play through the library, host:port, and its name of the PLC in the arguments."""
    library = ctypes.CDLL(sys.argv[1])
    library.plc_tag_get_float32.restype = ctypes.c_float
    library.plc_tag_set_float32.argtypes = ctypes.c_int32, ctypes.c_int, ctypes.c_float
    library.plc_tag_decode_error.restype = ctypes.c_char_p

    def checked(status: int) -> int:
        if status < 0:
            raise OSError(library.plc_tag_decode_error(status).decode())
        return status

    def tag_of(address: str, count: int) -> tuple[int, str]:
        match = re.fullmatch(r'([A-Z]+)(\d*):(\d+)(?:\.(\w+))?(?:/(\d+))?', address)
        assert match, address
        letter, table, element, member, bit = match.groups()
        if letter in 'IO' and sys.argv[3] == 'plc5':
            element = int(element, 8)
        name = f'{letter}{table or FIXED[letter]}:{element}' + (f'.{member}' if member else '') + (
            f'/{bit}' if bit else '')
        if letter in 'TCR' and not member:
            count = 1
        size = 2 if member else SIZES[letter]
        return checked(library.plc_tag_create(
            f'protocol=ab-eip&gateway={sys.argv[2]}&plc={sys.argv[3]}&elem_size={size}'
            f'&elem_count={count}&name={name}'.encode(), TIMEOUT)), letter

    def read(address: str, count: int) -> object:
        tag, letter = tag_of(address, count)
        try:
            checked(library.plc_tag_read(tag, TIMEOUT))
            if '/' in address:
                return [checked(library.plc_tag_get_bit(tag, int(address.split('/')[1])))]
            if letter == 'ST':
                text = ctypes.create_string_buffer(100)
                checked(library.plc_tag_get_string(tag, 0, text, 100))
                return text.value.decode('latin-1')
            if letter == 'F':
                return [library.plc_tag_get_float32(tag, 4 * number) for number in range(count)]
            if letter == 'L':
                return [library.plc_tag_get_int32(tag, 4 * number) for number in range(count)]
            return [library.plc_tag_get_int16(tag, 2 * number) for number in range(count)]
        finally:
            library.plc_tag_destroy(tag)

    def write(address: str, values: object) -> None:
        if '/' in address:
            raise Cannot('it writes the whole word')
        tag, letter = tag_of(address, 1 if isinstance(values, str) else len(values))
        try:
            if letter == 'ST':
                checked(library.plc_tag_set_string(tag, 0, values.encode('latin-1')))
            for number, value in enumerate(values if letter != 'ST' else ()):
                if letter == 'F':
                    checked(library.plc_tag_set_float32(tag, 4 * number, value))
                elif letter == 'L':
                    checked(library.plc_tag_set_int32(tag, 4 * number, value))
                else:
                    checked(library.plc_tag_set_int16(
                        tag, 2 * number, ctypes.c_int16(value).value))
            checked(library.plc_tag_write(tag, TIMEOUT))
        finally:
            library.plc_tag_destroy(tag)

    play(read, write)


main()
