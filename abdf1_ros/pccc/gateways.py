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
The identity of gateways to other links, and of computer cards (M 10-7, 10-15..10-19).

They have no processor and no mode. Some report their name. All other modules are known by two or
three bytes of the reply, and report the address of their counters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from abdf1_ros.pccc.identity import Identity, letters, name_in, release, word_at

_NAMED = 0xFE
_NAMED_SIZE = 24
_KF3 = 0x2C
_KF3_COUNTERS = 20  # bytes at address 0 (1770-KF3 user manual, table B.B)


@dataclass(frozen=True, slots=True)
class _Module:
    """A module without a name; offsets of bytes count from 0."""

    name: str
    counters: int = 6
    release: int = 8


# By the two or three bytes from byte 2 on.
_MODULES = {
    bytes((0xEE, 0x10, 0x10)): _Module('1785-KA'),  # M 10-16
    bytes((0xEE, 0x30, 0x2F)): _Module('1785-KA5'),  # M 10-17, asked over DH+
    bytes((0xFE, 0x19)): _Module('1785-KE'),  # M 10-19
    bytes((0xFE, 0x1B)): _Module('1784-KT or 1784-KT2'),  # M 10-15
}


def decode(data: bytes) -> Identity | None:
    """Read the data of a reply to 06/03; None if they have none of these forms."""
    for start, module in _MODULES.items():
        if data[1:1 + len(start)] == start and len(data) > module.release:
            return Identity(None, module.name, *letters(data[module.release]), interface=data[2],
                            counter_address=word_at(data, module.counters),
                            has_no_processor=True)
    if len(data) < _NAMED_SIZE or data[1] != _NAMED:
        return None
    name = name_in(data[5:16])
    known = Identity(None, name or f'module 0x{data[2]:02X}', *release(data[4]), name=name,
                     interface=data[2], has_no_processor=True)
    return replace(known, counter_size=_KF3_COUNTERS) if data[2] == _KF3 else known
