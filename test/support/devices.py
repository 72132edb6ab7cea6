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
Odd but legal devices, each a small function with its source.

A function changes what comes through of a frame, in bytes. Whatever a device does, the values
that are read have to be right, and a write has to be told as it ended. A new report costs one
function.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ACK, NAK, ENQ, EOT, STX = (bytes((0x10, code)) for code in (0x06, 0x15, 0x05, 0x04, 0x02))

Filter = Callable[[bytes], bytes]


@dataclass(frozen=True, slots=True)
class Device:
    """
    A device in some modes of the line.

    ``say`` makes what stands in the line from the device to us, ``hear`` what stands in the
    other direction.
    """

    name: str
    source: str
    modes: tuple[str, ...]
    say: Callable[[], Filter] = lambda: bytes
    hear: Callable[[], Filter] = lambda: bytes

    def __str__(self) -> str:
        """Return its name, for the names of tests."""
        return self.name


HALF, FULL, ALL = ('Message', 'Standard'), ('Peer',), ('Message', 'Standard', 'Peer')

DEVICES: list[Device] = []


def says(source: str, modes: tuple[str, ...]) -> Callable[[Callable[[], Filter]], Any]:
    """Register what makes the filter of a device that says things in an odd way."""
    def register(make: Callable[[], Filter]) -> Callable[[], Filter]:
        DEVICES.append(Device(make.__name__, source, modes, say=make))
        return make
    return register


def hears(source: str, modes: tuple[str, ...]) -> Callable[[Callable[[], Filter]], Any]:
    """Register what makes the filter of a device that hears things in an odd way."""
    def register(make: Callable[[], Filter]) -> Callable[[], Filter]:
        DEVICES.append(Device(make.__name__, source, modes, hear=make))
        return make
    return register


@says('M 4-13', FULL)
def reply_before_ack() -> Filter:
    held = []

    def say(data: bytes) -> bytes:
        if data == ACK:
            held.append(data)
            return b''
        if data.startswith(STX) and held:
            return data + held.pop()
        return data
    return say


@says('pydf1: a device that never acknowledges', FULL)
def no_ack() -> Filter:
    return lambda data: b'' if data == ACK else data


@says('modems: text and zeros around each message', ALL)
def noise_around() -> Filter:
    return lambda data: b'\x00' + data + b'\x00\xff'


@says('M 2-6, table 2.C: a BCC after DLE EOT', HALF)
def byte_after_eot() -> Filter:
    return lambda data: data + b'\x00' if data == EOT else data


@says('M 7-25: DLE ENQ after a reply that we have acknowledged', FULL)
def enq_after_reply() -> Filter:
    return lambda data: data + 6 * ENQ if data.startswith(STX) else data


@says('M 3-15: our ACK came too late, so the reply comes twice', ALL)
def reply_twice() -> Filter:
    return lambda data: data + data if data.startswith(STX) else data


@says('home-made drivers: NAK is 10 0F, as M 2-6 prints it', FULL)
def nak_as_printed() -> Filter:
    return lambda data: b'\x10\x0f' if data == NAK else data


@hears('sink full: the first two tries of each message are refused', FULL)
def refuses_twice() -> Filter:
    count = 0

    def hear(data: bytes) -> bytes:
        nonlocal count
        if not data.startswith(STX):
            return data
        count += 1
        return data if count % 3 == 0 else data[:-1] + bytes((data[-1] ^ 1,))
    return hear


@hears('SLC 13-76: a slave with no room ignores a message, and takes it when it comes again', HALF)
def ignores_every_second_message() -> Filter:
    count = 0

    def hear(data: bytes) -> bytes:
        nonlocal count
        if b'\x10\x01' not in data[:4]:
            return data
        count += 1
        return b'' if count % 2 else data
    return hear


@says('noise on the line: every third answer is lost', HALF)
def loses_every_third_answer() -> Filter:
    count = 0

    def say(data: bytes) -> bytes:
        nonlocal count
        count += 1
        return b'' if count % 3 == 0 else data
    return say
