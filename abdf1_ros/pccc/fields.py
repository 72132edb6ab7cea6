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

"""Variable-length numbers of PCCC, and a reader of fields."""

from __future__ import annotations

from abdf1_ros.errors import FormatError

_ESCAPE = 0xFF


def number(value: int) -> bytes:
    """Encode an address field: 0-254 in one byte, up to 65535 as FF lo hi (M 13-10, 7-17)."""
    if value < _ESCAPE:
        return bytes((value,))
    return bytes((_ESCAPE,)) + word(value)


def word(value: int) -> bytes:
    """Encode 16 bits, low byte first."""
    return value.to_bytes(2, 'little')


class Reader:
    """
    Take fields off the front of ``data``; FormatError when they run out.

    With ``takes_padding`` zeros may follow the last field: some devices append them.
    """

    takes_padding = True

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._position = 0

    @property
    def is_empty(self) -> bool:
        """Tell whether all bytes have been taken."""
        return self._position == len(self._data)

    def take(self, count: int) -> bytes:
        """Return the next ``count`` bytes."""
        end = self._position + count
        if end > len(self._data):
            raise FormatError(f'{end - len(self._data)} bytes are missing')
        data, self._position = self._data[self._position:end], end
        return data

    def byte(self) -> int:
        """Return the next byte."""
        return self.take(1)[0]

    def word(self) -> int:
        """Return the next 16 bits."""
        return int.from_bytes(self.take(2), 'little')

    def number(self) -> int:
        """Return the next address field, short or long."""
        value = self.byte()
        return self.word() if value == _ESCAPE else value

    def text(self) -> bytes:
        """Return the characters up to a 00, which is taken too."""
        text = self._data[self._position:].partition(b'\0')[0]
        self.take(len(text) + 1)
        return text

    def rest(self) -> bytes:
        """Return all that is left."""
        return self.take(len(self._data) - self._position)

    def end(self) -> None:
        """Raise FormatError when anything but padding is left."""
        left = self.rest()
        if any(left) or left and not self.takes_padding:
            raise FormatError(f'{len(left)} bytes too many')
