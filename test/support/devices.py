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

A function changes what comes through of a frame, in bytes. Whatever a device of ``DEVICES`` does,
the values that are read have to be right, and a write has to be told as it ended. What those of
``WRONG`` say is no reply of theirs, and has to be taken for none. A new report costs one function.
"""

from collections.abc import Callable
from dataclasses import dataclass
import itertools
from typing import Any

from support.odd_device import crc

ACK, NAK, ENQ, EOT, STX = (bytes((0x10, code)) for code in (0x06, 0x15, 0x05, 0x04, 0x02))

Filter = Callable[[bytes], bytes]


@dataclass(frozen=True, slots=True)
class Device:
    """
    A device in some modes of the line.

    ``say`` makes what stands in the line from the device to us, ``hear`` what stands in the
    other direction. ``chunk`` bytes come together, each travels ``propagation`` seconds.
    """

    name: str
    source: str
    modes: tuple[str, ...]
    say: Callable[[], Filter] = lambda: bytes
    hear: Callable[[], Filter] = lambda: bytes
    chunk: int = 1000
    propagation: float = 0.0

    def __str__(self) -> str:
        """Return its name, for the names of tests."""
        return self.name


HALF, FULL, RADIO = ('Message', 'Standard'), ('Peer',), ('Radio',)
WIRED = HALF + FULL
ALL = WIRED + RADIO

DEVICES: list[Device] = []
WRONG: list[Device] = []


def says(source: str, modes: tuple[str, ...]) -> Callable[[Callable[[], Filter]], Any]:
    """Register what makes the filter of a device that says things in an odd way."""
    def register(make: Callable[[], Filter]) -> Callable[[], Filter]:
        DEVICES.append(Device(make.__name__, source, modes, say=make))
        return make
    return register


def lies(source: str, modes: tuple[str, ...]) -> Callable[[Callable[[], Filter]], Any]:
    """Register what makes the filter of a device whose replies are none."""
    def register(make: Callable[[], Filter]) -> Callable[[], Filter]:
        WRONG.append(Device(make.__name__, source, modes, say=make))
        return make
    return register


def hears(source: str, modes: tuple[str, ...]) -> Callable[[Callable[[], Filter]], Any]:
    """Register what makes the filter of a device that hears things in an odd way."""
    def register(make: Callable[[], Filter]) -> Callable[[], Filter]:
        DEVICES.append(Device(make.__name__, source, modes, hear=make))
        return make
    return register


def message_like(other: bytes, data: bytes) -> bytes:
    """Return a message with the kind of check that another one has."""
    has_crc = other[-4:-2] == b'\x10\x03'
    check = crc(data + b'\x03') if has_crc else bytes((-sum(data) & 0xFF,))
    return STX + data.replace(b'\x10', b'\x10\x10') + b'\x10\x03' + check


def changed(message: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Return a message with other link data, and their check."""
    if not message.startswith(STX):
        return message
    end = -4 if message[-4:-2] == b'\x10\x03' else -3
    return message_like(message, change(message[2:end].replace(b'\x10\x10', b'\x10')))


def symbol_by_symbol(change: Filter) -> Filter:
    """Return a filter that gets what goes out together in parts: each symbol, then a message."""
    def filtered(data: bytes) -> bytes:
        result = b''
        while data[:2] in (ACK, NAK, ENQ, EOT) and data[:2] != data:
            result, data = result + change(data[:2]), data[2:]
        return result + change(data)
    return filtered


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


@says('M 4-10: the ACK stands inside the reply (embedded responses on)', FULL)
def embedded_ack() -> Filter:
    held = []

    def say(data: bytes) -> bytes:
        if data == ACK:
            held.append(data)
            return b''
        return data[:4] + held.pop() + data[4:] if data.startswith(STX) and held else data
    return say


@says('a PLC with a long scan: the reply is ready at the fourth poll', HALF)
def reply_at_the_fourth_poll() -> Filter:
    polls = itertools.count(1)
    return lambda data: EOT if data.startswith(STX) and next(polls) % 4 else data


def _with_messages(change: Callable[[bytes, bytes], bytes]) -> Filter:
    """Return what puts a MSG of the PLC to us, each with a TNS of its own, beside each reply."""
    numbers = itertools.count(0x1000)

    def say(data: bytes) -> bytes:
        if not data.startswith(STX):
            return data
        tns = next(numbers).to_bytes(2, 'little')
        return change(data, message_like(data, (
            data[2:4] + b'\x0f\x00' + tns + b'\xaa\x02\x07\x89\x00\x00\x39\x30')))
    return say


@says('MSG instructions of a PLC without a condition: one after each reply', FULL + RADIO)
def message_after_each_reply() -> Filter:
    return _with_messages(lambda reply, message: reply + message)


@says('MSG instructions in a slave: a poll brings them before the reply', HALF)
def message_before_the_reply() -> Filter:
    count = itertools.count(1)
    return _with_messages(lambda reply, message: message if next(count) % 2 else reply)


DEVICES += [
    Device('bytes_apart', 'a device server without packing: each byte by itself', ALL, chunk=1),
    Device('far_away', 'transparent radios, satellite: each byte comes 80 ms later', ALL,
           propagation=0.08)]


@lies('a slave that has a number of its own, whatever DST was', ALL)
def own_number() -> Filter:
    return lambda data: changed(data, lambda link: link[:1] + b'\x09' + link[2:])


@lies('home-made slaves: DST and SRC are not exchanged', ALL)
def same_order() -> Filter:
    return lambda data: changed(data, lambda link: link[1::-1] + link[2:])


@lies('home-made slaves: only the low byte of TNS comes back', ALL)
def low_byte_of_tns() -> Filter:
    return lambda data: changed(data, lambda link: link[:5] + bytes((link[5] ^ 1,)) + link[6:])


@lies('a modem, or another protocol in DF1 frames: ACK, and no reply ever', WIRED)
def only_ack() -> Filter:
    return lambda data: EOT if data.startswith(STX) else data


@lies('ABKF2 and kin: SRC and DST of each reply are 0', ALL)
def no_addresses() -> Filter:
    return lambda data: changed(data, lambda link: b'\x00\x00' + link[2:])
