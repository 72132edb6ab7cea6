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

"""pycomm3, an EtherNet/IP client: its SLCDriver, on a connection."""

from __future__ import annotations

import re
import sys

from player import Cannot, play
from pycomm3 import SLCDriver


def main() -> None:
    """Play towards the "host:port" of the first argument."""
    driver = SLCDriver(sys.argv[1])
    driver.open()

    def read(address: str, count: int) -> object:
        tag = driver.read(tag_of(address, count))
        if tag.error:
            raise OSError(tag.error)
        values = tag.value if isinstance(tag.value, list) else [tag.value]
        return values[0] if address.startswith('ST') else [
            int(value) if isinstance(value, bool) else value for value in values]

    def write(address: str, values: object) -> None:
        if '.' in address or address.startswith('ST'):
            raise Cannot('1.2.16 sends fewer bytes than it announces, the size of an element')
        if '/' in address:
            value = bool(values[0])
        else:
            words = [value if address[0] in 'FL' else signed(value) for value in values]
            value = words if len(words) > 1 else words[0]
        tag = driver.write((tag_of(address, len(values)), value))
        if tag.error:
            raise OSError(tag.error)

    play(read, write)
    driver.close()


def signed(word: int) -> int:
    """Return a word as a signed number, which is all it takes."""
    return (word & 0xFFFF ^ 0x8000) - 0x8000


def tag_of(address: str, count: int) -> str:
    """Return what it calls an address."""
    if re.match(r'[TCR]\d+:\d+$', address) or address.startswith('R'):
        raise Cannot('no elements of three words, and no R')
    if address[0] in 'IO':  # it counts the words of the whole image
        address = f'{address[0]}:0'
    return f'{address}{{{count}}}' if count > 1 else address


main()
