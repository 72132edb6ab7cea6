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

"""An SLC 500 or a PLC-5 with one file, N7, byte by byte: it shares no code with the package."""

_ECHO, _COUNTERS, _IDENTITY = 0x00, 0x01, 0x03  # FNC of CMD 06 (M 7-3)
_LARGEST = {'SLC': 242, 'PLC5': 249}  # bytes of a reply's link data
_IDENTITIES = {
    'SLC': bytes.fromhex('00EE364900') + b'5/03       ' + bytes.fromhex('00000600000000FC'),
    'PLC5': bytes.fromhex('06EB15') + bytes(33)}
_DONE, _ILLEGAL, _BEYOND = b'\x00', b'\x10', b'\x50'  # STS (M 8-2)
_NO_FILE, _NO_ELEMENT = b'\xF0\x06', b'\xF0\x07'  # STS and EXT STS of a PLC-5 (M 8-4)


class PlainPlc:
    """
    The commands that ``conform`` sends, and what they do to ``words``, those of N7:0 to N7:19.

    ``family`` is SLC (M 7-17 to 7-20, 1770-6.5.16) or PLC5 (M 7-20, 7-28 to 7-30).
    """

    def __init__(self, family: str) -> None:
        self._family = family
        self.words = bytearray(40)

    def serve(self, data: bytes) -> bytes:
        """Return the link data of the reply to a command."""
        dst, src, cmd = data[:3]
        answer = self._answer(cmd, data[6:7], data[7:])
        if 5 + len(answer) > _LARGEST[self._family]:
            answer = _ILLEGAL
        return bytes((src, dst, cmd | 0x40)) + answer[:1] + data[4:6] + answer[1:]

    def _answer(self, cmd: int, fnc: bytes, rest: bytes) -> bytes:
        """Return STS, and what follows TNS."""
        if not fnc or cmd not in (0x06, 0x0F):
            return _ILLEGAL
        if cmd == 0x06:
            return self._diagnose(fnc[0], rest)
        return self._typed_slc(fnc[0], rest) if self._family == 'SLC' else \
            self._typed_plc5(fnc[0], rest)

    def _diagnose(self, fnc: int, rest: bytes) -> bytes:
        if fnc == _ECHO:
            return _DONE + rest
        if fnc == _IDENTITY:
            return _DONE + _IDENTITIES[self._family]
        if fnc == _COUNTERS and len(rest) == 3:
            return _DONE + bytes(rest[2])
        return _ILLEGAL

    def _typed_slc(self, fnc: int, rest: bytes) -> bytes:
        if fnc not in (0xA2, 0xAA, 0xAB) or len(rest) < 5:
            return _ILLEGAL
        size, (file, rest) = rest[0], _level(rest[1:])
        kind, (element, rest) = rest[0], _level(rest[1:])
        _, data = _level(rest)
        if file != 7 or kind != 0x89 or not size or size % 2:
            return _ILLEGAL
        begin = 2 * element
        if begin + size > len(self.words):
            return _BEYOND
        if fnc == 0xA2:
            return _DONE + self.words[begin:begin + size]
        if fnc == 0xAA and len(data) == size:
            self.words[begin:begin + size] = data
        elif fnc == 0xAB and len(data) == 2 + size:
            for at in range(begin, begin + size):
                mask, bits = data[at - begin & 1], data[2 + at - begin]
                self.words[at] = self.words[at] & ~mask | bits & mask
        else:
            return _ILLEGAL
        return _DONE

    def _typed_plc5(self, fnc: int, rest: bytes) -> bytes:
        if fnc == 0x26:
            file, element, data = _address(rest)
            return self._without_place(file, element, 1) or self._change(element, data)
        if fnc not in (0x67, 0x68) or len(rest) < 7:
            return _ILLEGAL
        file, element, data = _address(rest[4:])
        if fnc == 0x68:
            count = int.from_bytes(data[:2], 'little')
            return self._without_place(file, element, count) or self._read(element, count)
        kind, size, head = (data[0] >> 4, data[0] & 0x0F, data[1:]) if data else (0, 0, b'')
        if kind != 9 or size != 9 or head[:1] != b'\x09' or head[2:3] != b'\x42' or \
                head[1] != len(head) - 2:
            return _ILLEGAL
        words = head[3:]
        failure = self._without_place(file, element, len(words) // 2)
        if not failure:
            self.words[2 * element:2 * element + len(words)] = words
        return failure or _DONE

    def _without_place(self, file: int, element: int, count: int) -> bytes:
        """Return why there are no such words, empty if there are."""
        if file != 7:
            return _NO_FILE
        return b'' if 2 * (element + count) <= len(self.words) else _NO_ELEMENT

    def _read(self, element: int, count: int) -> bytes:
        """Return words after their type: an array of integers of two bytes (M 7-28, 7-29)."""
        size = 1 + 2 * count
        head = bytes((0x90 | size, 0x09)) if size < 8 else bytes((0x99, 0x09, size))
        return _DONE + head + b'\x42' + self.words[2 * element:2 * (element + count)]

    def _change(self, element: int, data: bytes) -> bytes:
        """Keep the bits of the first word of ``data``, and set those of the second."""
        for at in range(2):
            place = 2 * element + at
            self.words[place] = self.words[place] & data[at] | data[2 + at]
        return _DONE


def _level(data: bytes) -> tuple[int, bytes]:
    """Return a level of an address, and what follows it (M 13-10 to 13-15)."""
    if data[0] == 0xFF:
        return int.from_bytes(data[1:3], 'little'), data[3:]
    return data[0], data[1:]


def _address(data: bytes) -> tuple[int, int, bytes]:
    """Return file and element of a PLC-5's address, and what follows it (M 13-10 to 13-15)."""
    if data[:2] == b'\x00$':
        text, _, rest = data[2:].partition(b'\x00')
        file, _, element = text[1:].partition(b':')
        return int(file), int(element), rest
    levels, rest = [], data[1:]
    for bit in range(3):
        level = 0
        if data[0] & 1 << bit:
            level, rest = _level(rest)
        levels.append(level)
    return levels[1], levels[2], rest
