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
Odd devices, each a small function with its source.

A function changes what comes through of a frame, in bytes. Whatever a device of ``DEVICES`` does,
the values that are read have to be right, and a write has to be told as it ended. What those of
``WRONG`` say is not a reply of theirs, and has to be taken for none. A new report costs one
function. Those that break a rule of the manual name the case of ``conform`` that has to find it.
"""

from collections.abc import Callable
from dataclasses import dataclass
import itertools
from typing import Any

from support.odd_device import crc

ACK, NAK, ENQ, EOT, STX, SOH = (
    bytes((0x10, code)) for code in (0x06, 0x15, 0x05, 0x04, 0x02, 0x01))

Filter = Callable[[bytes], bytes]


def symbol_by_symbol(change: Filter) -> Filter:
    """Return a filter that gets what goes out together in parts: each symbol, then a message."""
    def filtered(data: bytes) -> bytes:
        result = b''
        while data[:2] in (ACK, NAK, ENQ, EOT) and data[:2] != data:
            result, data = result + change(data[:2]), data[2:]
        return result + change(data)
    return filtered


@dataclass(frozen=True, slots=True)
class Device:
    """
    A device in some modes of the line.

    ``filters`` makes what stands in the line: from us to the device, and from the device to us.
    ``chunk`` bytes come together, each travels ``propagation`` seconds. ``breaks`` is the case of
    ``conform`` that has to find it, empty for a device that keeps the rules.
    """

    name: str
    source: str
    modes: tuple[str, ...]
    filters: Callable[[], tuple[Filter, Filter]] = lambda: (bytes, bytes)
    chunk: int = 1000
    propagation: float = 0.0
    breaks: str = ''

    def __str__(self) -> str:
        """Return its name, for the names of tests."""
        return self.name


HALF, FULL, RADIO = ('Message', 'Standard'), ('Peer',), ('Radio',)
WIRED = HALF + FULL
ALL = WIRED + RADIO

DEVICES: list[Device] = []
WRONG: list[Device] = []

Maker = Callable[[], Filter]


def says(source: str, modes: tuple[str, ...], breaks: str = '',
         devices: list[Device] = DEVICES) -> Callable[[Maker], Maker]:
    """Register what makes the filter of a device that says symbols in an odd way."""
    def register(make: Maker) -> Maker:
        devices.append(Device(make.__name__, source, modes, breaks=breaks,
                              filters=lambda: (bytes, symbol_by_symbol(make()))))
        return make
    return register


def lies(source: str, modes: tuple[str, ...], breaks: str = 'read-words'
         ) -> Callable[[Maker], Maker]:
    """Register what makes the filter of a device whose replies are none."""
    return says(source, modes, breaks, WRONG)


def hears(source: str, modes: tuple[str, ...], breaks: str = '') -> Callable[[Maker], Maker]:
    """Register what makes the filter of a device that hears symbols in an odd way."""
    def register(make: Maker) -> Maker:
        DEVICES.append(Device(make.__name__, source, modes, breaks=breaks,
                              filters=lambda: (symbol_by_symbol(make()), bytes)))
        return make
    return register


def acts(source: str, modes: tuple[str, ...], breaks: str = '') -> Callable[[Any], Any]:
    """Register what makes both filters of a device, which get all that goes out together."""
    def register(make: Callable[[], tuple[Filter, Filter]]) -> Any:
        DEVICES.append(Device(make.__name__, source, modes, make, breaks=breaks))
        return make
    return register


def message_like(other: bytes, data: bytes) -> bytes:
    """Return a message with the kind of check that another one has."""
    has_crc = other[-4:-2] == b'\x10\x03'
    check = crc(data + b'\x03') if has_crc else bytes((-sum(data) & 0xFF,))
    return STX + data.replace(b'\x10', b'\x10\x10') + b'\x10\x03' + check


def link_of(message: bytes) -> bytes:
    """Return the link data of an undamaged message; nothing of all else."""
    is_from_master = message.startswith(SOH)
    start = message.find(STX) if is_from_master else 0
    if not is_from_master and not message.startswith(STX):
        return b''
    station = message[2:start].replace(b'\x10\x10', b'\x10')
    end = -4 if message[-4:-2] == b'\x10\x03' else -3
    data = message[start + 2:end].replace(b'\x10\x10', b'\x10')
    covered = station + b'\x02' * is_from_master + data + b'\x03'
    check = crc(covered) if end == -4 else bytes((-sum(station + data) & 0xFF,))
    is_good = message[end + 2:] == check and len(data) >= 6
    return data if is_good else b''


def changed(message: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Return a message with other link data, and their check."""
    if not message.startswith(STX):
        return message
    end = -4 if message[-4:-2] == b'\x10\x03' else -3
    return message_like(message, change(message[2:end].replace(b'\x10\x10', b'\x10')))


@acts('M 4-13: the reply overtakes the ACK', FULL)
def reply_before_ack() -> tuple[Filter, Filter]:
    return bytes, lambda data: data[2:] + ACK if data.startswith(ACK + STX) else data


@says('pydf1: a device that never acknowledges', FULL, 'message-acknowledged')
def no_ack() -> Filter:
    return lambda data: b'' if data == ACK else data


@says('modems: text and zeros around each message', ALL)
def noise_around() -> Filter:
    return lambda data: b'\x00' + data + b'\x00\xff'


@says('M 2-6, table 2.C: a BCC after DLE EOT', HALF)
def byte_after_eot() -> Filter:
    return lambda data: data + b'\x00' if data == EOT else data


@says('M 7-25: DLE ENQ after a reply that we have acknowledged', FULL, 'no-needless-enquiry')
def enq_after_reply() -> Filter:
    return lambda data: data + 6 * ENQ if data.startswith(STX) else data


@says('M 3-15: our ACK came too late, so the reply comes twice', WIRED, 'check-not-doubled')
def reply_twice() -> Filter:
    return lambda data: data + data if data.startswith(STX) else data


@says('ML11 517 to 522: a node sends on what it has heard, so the reply comes twice', RADIO)
def reply_sent_on() -> Filter:
    return lambda data: data + data if data.startswith(STX) and data[4] & 0x40 else data


@says('home-made drivers: NAK is 10 0F, as M 2-6 prints it', FULL, 'bad-check-refused')
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
        return data if count % 3 == 0 else data[:-1] + bytes((data[-1] ^ 0x80,))
    return hear


@hears('SLC 13-76: a slave with no room ignores a message, and takes it when it comes again', HALF)
def ignores_every_second_message() -> Filter:
    count = 0

    def hear(data: bytes) -> bytes:
        nonlocal count
        if not data.startswith(SOH) or b'\x10\x03' not in data[-4:-1]:
            return data
        count += 1
        return b'' if count % 2 else data
    return hear


@hears('SLC, DH+ gateways: the last TNS of each source stays known, also over our restarts', ALL)
def knows_the_last_tns_for_ever() -> Filter:
    last: dict[int, tuple[bytes, bytes]] = {}

    def hear(data: bytes) -> bytes:
        link = link_of(data)
        if not link or link[2] & 0x40:
            return data
        key = link[2:3] + link[4:6]
        known, message = last.get(link[1], (b'', b''))
        if known == key:
            return message  # a repetition for the PLC, too: ACK, and no reply
        last[link[1]] = key, data
        return data
    return hear


@says('Micro800, KF2 4-31: EOT suppression, a slave with nothing to send says nothing',
      ('Message',))
def no_eot() -> Filter:
    return lambda data: b'' if data == EOT else data


_READS = (b'\x0f\xa2', b'\x0f\x68', b'\x0f\x01')


class OffForAMoment:
    """
    A gateway whose node is off for every sixth read: the local status comes after later replies.

    Meanwhile the gateway takes commands for other nodes, and replies to them.
    """

    def __init__(self) -> None:
        self.late: list[bytes] = []
        self.reads = 0
        self.is_unread = False  # the PLC has not had the ACK of what was kept back
        self.is_asked = False  # the next ACK is for a late reply
        self._lost: set[bytes] = set()

    def note(self, data: bytes) -> None:
        """Take note of each read."""
        link = link_of(data[data.find(SOH):] if SOH in data else data[data.find(STX):])
        if link and link[2:3] + link[6:7] in _READS:
            self.reads += 1
            if self.reads % 6 == 4:
                self._lost.add(link[4:6])

    def keeps(self, message: bytes) -> bool:
        """Keep a reply back that is late; return False for any other."""
        link = link_of(message)
        if not link or not link[2] & 0x40 or link[4:6] not in self._lost:
            return False
        self._lost.discard(link[4:6])
        self.late.append(changed(message, lambda link: link[:3] + b'\x02' + link[4:6]))
        return True


@acts('KF2 users: STS 02 for a node that is off comes seconds later, after other replies', HALF,
      'write-and-read')
def late_local_status() -> tuple[Filter, Filter]:
    gateway = OffForAMoment()

    def hear(data: bytes) -> bytes:
        gateway.note(data)
        if gateway.is_asked and data.startswith(ACK):
            gateway.is_asked, data = False, data[2:]
        if gateway.is_unread and ENQ in data:
            gateway.is_unread, data = False, ACK + data
        return data

    def say(data: bytes) -> bytes:
        if gateway.keeps(data):
            gateway.is_unread = True
            return EOT
        if gateway.late and gateway.reads % 6 != 4 and (data == EOT or data.startswith(STX)):
            gateway.is_asked = True
            return gateway.late.pop(0)
        return data
    return hear, say


@acts('the same in full duplex, without a poll', FULL, 'write-and-read')
def late_local_status_by_wire() -> tuple[Filter, Filter]:
    gateway = OffForAMoment()

    def hear(data: bytes) -> bytes:
        gateway.note(data)
        if gateway.is_unread:
            gateway.is_unread, data = False, ACK + data
        return data

    def say(data: bytes) -> bytes:
        symbols = data[:2] if data.startswith(ACK + STX) else b''
        message = data[len(symbols):]
        if gateway.keeps(message):
            gateway.is_unread = True
            return symbols
        if gateway.is_unread and data == ENQ:
            return b''
        if gateway.late and message.startswith(STX):
            return symbols + gateway.late.pop(0) + message
        return data
    return hear, say


@acts('the same by radio', RADIO, 'write-and-read')
def late_local_status_by_radio() -> tuple[Filter, Filter]:
    gateway = OffForAMoment()

    def hear(data: bytes) -> bytes:
        gateway.note(data)
        return data

    def say(data: bytes) -> bytes:
        if gateway.keeps(data):
            return b''
        return gateway.late.pop(0) + data if gateway.late and data.startswith(STX) else data
    return hear, say


@says('noise on the line: every third answer is lost', HALF)
def loses_every_third_answer() -> Filter:
    count = 0

    def say(data: bytes) -> bytes:
        nonlocal count
        count += 1
        return b'' if count % 3 == 0 else data
    return say


@acts('M 4-10: the ACK stands inside the reply (embedded responses on)', FULL)
def embedded_ack() -> tuple[Filter, Filter]:
    return bytes, lambda data: (
        data[2:6] + ACK + data[6:] if data.startswith(ACK + STX) and data[4] != 0x10 else data)


@says('a PLC with a long scan: the reply is ready at the fourth poll', HALF)
def reply_at_the_fourth_poll() -> Filter:
    last, early = b'', 0

    def say(data: bytes) -> bytes:
        nonlocal last, early
        if not data.startswith(STX):
            return data
        if data != last:
            last, early = data, 3
        early -= 1
        return data if early < 0 else EOT
    return say


def _message_of(reply: bytes, tns: int, dst: int | None = None) -> bytes:
    """Return a MSG of the PLC that has sent a reply, to ``dst`` or to whom the reply is for."""
    to = reply[2:3] if dst is None else bytes((dst,))
    return message_like(reply, to + reply[3:4] + b'\x0f\x00' + tns.to_bytes(2, 'little')
                        + b'\xaa\x02\x07\x89\x00\x00\x39\x30')


# By wire that is a second message before the first has its response.
@says('MSG instructions of a PLC without a condition', FULL, 'silence-is-enquired')
def message_after_each_reply() -> Filter:
    numbers = itertools.count(0x1000)
    return lambda data: (data + _message_of(data, next(numbers)) if data.startswith(STX) else data)


@says('the same by radio', RADIO)
def packet_after_each_reply() -> Filter:
    return message_after_each_reply()


@acts('MSG instructions in a slave: to us, to 0, to another slave, before each second reply', HALF)
def messages_before_the_reply() -> tuple[Filter, Filter]:
    numbers, to = itertools.count(0x1000), itertools.cycle((None, 0, 99, -1, -1))
    is_asked = False  # the next ACK is for a message

    def say(data: bytes) -> bytes:
        nonlocal is_asked
        if not data.startswith(STX):
            return data
        dst = next(to)
        is_asked = dst != -1
        return _message_of(data, next(numbers), dst) if is_asked else data

    def hear(data: bytes) -> bytes:
        nonlocal is_asked
        if not data.startswith(ACK) or not is_asked:
            return data
        is_asked = False
        return data[2:]
    return hear, say


def refused(reply: bytes) -> bytes:
    """Return the link data of a reply with STS 10: the command is not known (M 8-2)."""
    return reply[:3] + b'\x10' + reply[4:6]


@says('ProSoft DFCM, FieldServer, AbDf1 as server: no diagnostic commands', ALL, 'identity')
def no_diagnostics() -> Filter:
    return lambda data: changed(
        data, lambda link: refused(link) if link[2] & 0x4F == 0x46 else link)


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


@lies('a modem, or another protocol in DF1 frames: ACK, and no reply ever', HALF)
def only_ack() -> Filter:
    return lambda data: EOT if data.startswith(STX) else data


@lies('the same in full duplex', FULL)
def only_ack_by_wire() -> Filter:
    return lambda data: b'' if data.startswith(STX) else data


@lies('ABKF2 and kin: SRC and DST of each reply are 0', ALL)
def no_addresses() -> Filter:
    return lambda data: changed(data, lambda link: b'\x00\x00' + link[2:])


@lies('converters: DLE EOT where DLE ACK is due, the reply at the next poll', HALF,
      'message-acknowledged')
def eot_in_place_of_ack() -> Filter:
    return lambda data: EOT if data == ACK else data
