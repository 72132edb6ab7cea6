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
A PLC-5 or SLC at the end of a line that shares no code with the package.

Frames are those of ``OddDevice``, and what is here is written from the manual (chapter 7), so a
mistake of ours cannot stand at both ends. An SLC has two words of inputs in slot 1 and two of
outputs in slot 2; no other module, so word 0 of the whole image is word 0 of these.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
import os
import re
import select
import struct
import threading
import time
import tty

from support.odd_device import OddDevice, Wiring

# The bytes of an element, by the letters of its file.
SIZES = {'O': 2, 'I': 2, 'S': 2, 'B': 2, 'N': 2, 'F': 4, 'L': 4, 'T': 6, 'C': 6, 'R': 6, 'ST': 84}
FIXED = {'O': 0, 'I': 1, 'S': 2}  # numbers of files
_CODES = {0x82: 'O', 0x83: 'I', 0x84: 'S', 0x85: 'B', 0x86: 'T', 0x87: 'C', 0x88: 'R', 0x89: 'N',
          0x8A: 'F', 0x8B: 'O', 0x8C: 'I', 0x8D: 'ST', 0x91: 'L'}  # of an SLC
_BY_SLOT = {0x8B: 2, 0x8C: 1}  # which slot has words
_INTEGER = b'\x42'
_TYPES = {'B': b'\x22', 'F': b'\x94\x08', 'T': b'\x56', 'C': b'\x66', 'R': b'\x76'}  # of a PLC-5
_MEMBERS = {'PRE': 1, 'LEN': 1, 'ACC': 2, 'POS': 2}
_ELEMENTS = 300
_REFUSED = 0x10

Place = tuple[int, int]
"""The number of a file, and which of its bytes is the first."""

Files = dict[int, bytearray]


def split(address: str) -> tuple[str, int, int, int, int | None]:
    """Return letters, number of the file, element, word in it, and bit of an address."""
    match = re.fullmatch(r'([A-Z]+)(\d*):(\d+)(?:\.(\w+))?(?:/(\d+))?', address)
    assert match, address
    letters, number, element, word, bit = match.groups()
    return (letters, int(number or FIXED.get(letters, 0)), int(element),
            _MEMBERS[word] if word in _MEMBERS else int(word or 0), int(bit) if bit else None)


class PlainPlc(OddDevice):
    """
    A device whose stations have files: ``files[station][number]``, of type ``letters``.

    ``scan`` is called before each command; it may change words, as the PLC's program does.
    """

    def __init__(self, wiring: Wiring, station: int = 1, nodes: Iterable[int] = ()) -> None:
        super().__init__(wiring, station, nodes)
        self.is_plc5 = False
        self.scan: Callable[[], None] = lambda: None
        self.letters = {number: letters for letters, number in FIXED.items()}
        self.files: defaultdict[int, defaultdict[int, bytearray]] = defaultdict(
            lambda: defaultdict(lambda: bytearray(_ELEMENTS * max(SIZES.values()))))

    def place(self, address: str) -> Place:
        """Return where the words of an address are; its file is there from now on."""
        letters, number, element, word, _ = split(address)
        if letters in 'OI' and self.is_plc5:
            element = int(str(element), 8)
        self.letters[number] = letters
        return number, 2 * word if letters in 'OI' and not self.is_plc5 else (
            SIZES[letters] * element + 2 * word)

    def answer(self, data: bytes) -> tuple[int, bytes]:
        """Return status and data of a reply."""
        node, command, function, fields = data[0], data[2] & 0x0F, data[6], data[7:]
        if command != 0x0F:
            return super().answer(data)
        handler = {0xA2: self._read, 0xAA: self._write, 0xAB: self._masked, 0x01: self._range_read,
                   0x00: self._range_write, 0x26: self._modify, 0x67: self._typed_write,
                   0x68: self._typed_read}.get(function)
        if handler is None or (function < 0x80) is not self.is_plc5:
            return _REFUSED, b''
        self.scan()
        try:
            return 0, handler(self.files[node], fields)
        except LookupError:
            return _REFUSED, b''

    def _logical(self, fields: bytes) -> tuple[Place, bytes]:
        """Return the place of a three-field address of an SLC, and what follows it."""
        numbers = []
        for is_number in (True, False, True, True):  # file, type, element, word
            first, fields = fields[0], fields[1:]
            if is_number and first == 0xFF:
                first, fields = int.from_bytes(fields[:2], 'little'), fields[2:]
            numbers.append(first)
        number, code, element, word = numbers
        letters = _CODES[code]
        if self.letters.get(number) != letters or code in _BY_SLOT and element != _BY_SLOT[code]:
            raise LookupError
        if code in _BY_SLOT:
            return (number, 2 * word), fields
        return (number, SIZES[letters] * element + 2 * word), fields

    def _levels(self, fields: bytes) -> tuple[Place, str, bytes]:
        """Return place and letters of a PLC-5 address, in ASCII or levels, and what follows."""
        if fields[:2] == b'\0$':
            text, _, rest = fields[2:].partition(b'\0')
            address = text.decode('ascii')
            return self.place(address), 'N' if '.' in address else split(address)[0], rest
        mask, fields, levels = fields[0], fields[1:], [0, 0, 0, 0]
        for level in range(4):
            if mask >> level & 1:
                levels[level], fields = fields[0], fields[1:]
                if levels[level] == 0xFF:
                    levels[level] = int.from_bytes(fields[:2], 'little')
                    fields = fields[2:]
        _, number, element, word = levels
        letters = self.letters[number]
        return ((number, SIZES[letters] * element + 2 * word),
                'N' if mask >> 3 & 1 else letters, fields)

    def _read(self, files: Files, fields: bytes) -> bytes:
        (number, at), _ = self._logical(fields[1:])
        return bytes(files[number][at:at + fields[0]])

    def _write(self, files: Files, fields: bytes) -> bytes:
        (number, at), data = self._logical(fields[1:])
        if len(data) != fields[0]:
            raise LookupError
        files[number][at:at + len(data)] = data
        return b''

    def _masked(self, files: Files, fields: bytes) -> bytes:
        (number, at), data = self._logical(fields[1:])
        mask = int.from_bytes(data[:2], 'little')
        for first in range(0, fields[0], 2):
            self._change(files[number], at + first, ~mask, mask & int.from_bytes(
                data[2 + first:4 + first], 'little'))
        return b''

    @staticmethod
    def _change(file: bytearray, at: int, keep: int, put: int) -> None:
        word = int.from_bytes(file[at:at + 2], 'little')
        file[at:at + 2] = ((word & keep | put) & 0xFFFF).to_bytes(2, 'little')

    def _range_read(self, files: Files, fields: bytes) -> bytes:
        (number, at), letters, rest = self._levels(fields[4:])
        at += 2 * int.from_bytes(fields[:2], 'little')
        return _as_words(letters, files[number][at:at + rest[0]])

    def _range_write(self, files: Files, fields: bytes) -> bytes:
        (number, at), letters, data = self._levels(fields[4:])
        at += 2 * int.from_bytes(fields[:2], 'little')
        files[number][at:at + len(data)] = _as_words(letters, data)
        return b''

    def _modify(self, files: Files, fields: bytes) -> bytes:
        while fields:
            (number, at), _, fields = self._levels(fields)
            keep, put = struct.unpack_from('<HH', fields)
            self._change(files[number], at, keep, put)
            fields = fields[4:]
        return b''

    def _typed_read(self, files: Files, fields: bytes) -> bytes:
        """Return an array: flag, its type and size, and the type of an element (M 14-1)."""
        (number, at), letters, rest = self._levels(fields[4:])
        size = SIZES[letters]
        at += size * int.from_bytes(fields[:2], 'little')
        data = _TYPES.get(letters, _INTEGER) + bytes(
            files[number][at:at + size * int.from_bytes(rest[:2], 'little')])
        return bytes((0x99, 9, len(data))) + data

    def _typed_write(self, files: Files, fields: bytes) -> bytes:
        (number, at), letters, data = self._levels(fields[4:])
        kind = _TYPES.get(letters, _INTEGER)
        if data[:1] == b'\x99':
            data = data[3:]
        if not data.startswith(kind):
            raise LookupError
        data = data[len(kind):]
        at += SIZES[letters] * int.from_bytes(fields[:2], 'little')
        files[number][at:at + len(data)] = data
        return b''


def _as_words(letters: str, data: bytes) -> bytes:
    """Return floats as a range of words has them, the high word first, or the other way."""
    if letters != 'F':
        return bytes(data)
    return b''.join(data[at + 2:at + 4] + data[at:at + 2] for at in range(0, len(data), 4))


def encoded(letters: str, values: list[float] | str) -> bytes:
    """Return values as they lie in the PLC; a string has its characters of a word swapped."""
    if isinstance(values, str):
        text = values.encode('latin-1').ljust(82, b'\0')
        return struct.pack('<H', len(values)) + b''.join(
            text[at:at + 2][::-1] for at in range(0, 82, 2))
    if letters == 'F':
        return struct.pack(f'<{len(values)}f', *values)
    if letters == 'L':
        return struct.pack(f'<{len(values)}i', *map(int, values))
    return struct.pack(f'<{len(values)}H', *(int(value) & 0xFFFF for value in values))


def decoded(letters: str, data: bytes) -> list[float] | str:
    """Return the values that lie in the PLC so."""
    if letters == 'ST':
        text = b''.join(data[at:at + 2][::-1] for at in range(2, 84, 2))
        return text[:int.from_bytes(data[:2], 'little')].decode('latin-1')
    kind, size = {'F': ('f', 4), 'L': ('i', 4)}.get(letters, ('h', 2))
    return list(struct.unpack(f'<{len(data) // size}{kind}', data))


class PlainLine:
    """
    The thread that puts a device at a port.

    With ``char_time`` (s) each byte takes so long, first of what comes, then of the answer, as in
    half duplex; so the line is never faster than a real one.
    """

    _CHUNK = 8  # bytes that a UART hands over at a time

    def __init__(self, port: str, device: OddDevice, char_time: float = 0.0) -> None:
        self._descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._descriptor)
        self._device = device
        self._char_time = char_time
        self._free = 0.0
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        poll = select.poll()
        poll.register(self._descriptor, select.POLLIN)
        while not self._is_over.is_set():
            if poll.poll(20):
                data = os.read(self._descriptor, 4096)
                self._free = max(self._free, time.monotonic()) + len(data) * self._char_time
                self._device.receive_data(data, 0.0)
                self._send(self._device.data_to_send())

    def _send(self, data: bytes) -> None:
        for at in range(0, len(data), self._CHUNK):
            chunk = data[at:at + self._CHUNK]
            self._free += len(chunk) * self._char_time
            time.sleep(max(0.0, self._free - time.monotonic()))
            os.write(self._descriptor, chunk)

    def close(self) -> None:
        """End the thread."""
        self._is_over.set()
        self._thread.join()
        os.close(self._descriptor)
