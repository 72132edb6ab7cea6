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
A device on a virtual line, byte by byte: its protocol shares no code with the package.

It is an SLC, or a gateway with SLCs behind it, in full duplex, half duplex or by radio. It
executes all that reaches it, whether its replies are taken or not. A test changes how it behaves::

    device = OddDevice(Wiring.HALF, station=8, nodes=(1, 9))
    device.takes = lambda data: Answer.NAK if data[0] == 9 else Answer.ACK
"""

from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from enum import Enum
from functools import reduce

_DLE, ACK, NAK, EOT, ENQ = b'\x10', b'\x10\x06', b'\x10\x15', b'\x10\x04', b'\x10\x05'
_STX, _SOH = b'\x10\x02', b'\x10\x01'
_REPLY, _NOT_DELIVERED, _ILLEGAL = 0x40, 0x02, 0x10
_ECHO, _TYPED = 6, 15  # commands
# A check byte after its eight shifts.
_SHIFTED = [reduce(lambda check, _: check >> 1 ^ 0xA001 * (check & 1), range(8), byte)
            for byte in range(256)]
# Of an SLC 5/03 in remote RUN.
_IDENTITY = bytes.fromhex('00ee344900') + b'ODD        ' + bytes.fromhex('0000260036820100')


class Wiring(Enum):
    FULL = 'full duplex'
    HALF = 'half duplex'
    RADIO = 'radio'


class Answer(Enum):
    """What a device does with a message that reached it undamaged."""

    ACK = 'executes it'
    REFUSES = 'replies with an error'
    NAK = 'has no room for it'
    NOTHING = 'says nothing'
    LOSES = 'acknowledges it, and nothing follows'
    LATE = 'acknowledges it, and tells long after that it was not delivered'


def crc(data: bytes) -> bytes:
    """Return the check of these bytes, as the manual computes it (M 5-5)."""
    check = 0
    for byte in data:
        check = check >> 8 ^ _SHIFTED[check & 0xFF ^ byte]
    return check.to_bytes(2, 'little')


def frame(data: bytes, station: int | None = None) -> bytes:
    """Return a message on the line; with ``station`` that of a half-duplex master (M 5-3)."""
    head = b'' if station is None else _SOH + bytes((station,))
    checked = data if station is None else bytes((station, 0x02)) + data
    return head + _STX + data.replace(_DLE, 2 * _DLE) + b'\x10\x03' + crc(checked + b'\x03')


def _reply_to(data: bytes, status: int) -> bytes:
    """Return the link data of a reply without a result."""
    return bytes((data[1], data[0], data[2] | _REPLY, status)) + data[4:6]


class OddDevice:
    """
    A device; ``nodes`` have the words ``words[node, file, element]``.

    ``takes`` says what becomes of a message by its link data, ``seconds`` how long the work on it
    takes, ``hear`` and ``say`` what comes through. ``executed`` has the link data of all commands,
    ``answered`` those of the replies to its own messages, ``flushed`` those of all that a master
    has made it drop.
    """

    next_call: float | None = None
    spare_time = 0.0
    late = 2.5  # s

    def __init__(self, wiring: Wiring, station: int = 1, nodes: Iterable[int] = ()) -> None:
        self.wiring, self.station = wiring, station
        self.nodes = frozenset(nodes or {station})
        self.stations = frozenset((station,))  # that it takes messages and polls for
        self.identities: dict[int, bytes] = {}  # of those that are not an SLC
        self.executes_diagnostics = False  # for all nodes
        self.waits_for_poll = True  # with its replies, in half duplex
        self.knows_commands = True
        self.replies_to: int | None = None  # in place of the SRC of a command
        self.words: dict[tuple[int, int, int], int] = {}
        self.takes: Callable[[bytes], Answer] = lambda data: Answer.ACK
        self.seconds: Callable[[bytes], float] = lambda data: 0.0
        self.hear: Callable[[bytes], bytes] = bytes
        self.say: Callable[[bytes], bytes] = bytes
        self.executed: list[bytes] = []
        self.answered: list[bytes] = []
        self.flushed: list[bytes] = []
        self._buffer = self._out = b''
        self._replies: defaultdict[int, deque[bytes]] = defaultdict(deque)  # by station
        self._to_come: list[tuple[float, bytes]] = []
        self._now = 0.0
        self._response = NAK
        self._polled_station: int | None = None  # which has sent a reply
        self._last = b''

    def start(self, now: float) -> None:
        """Begin; there is nothing to do."""

    def handle_timeout(self, now: float) -> None:
        """Send the late replies that are due."""
        due = [reply for when, reply in self._to_come if when <= now]
        self._to_come = self._to_come[len(due):]
        self._plan()
        for reply in due:
            self._send(reply)

    def receive_data(self, data: bytes, now: float) -> None:
        self._now = now
        self._buffer += self.hear(data)
        while self._take_symbol():
            pass

    def data_to_send(self) -> bytes:
        """Give the bytes that go out."""
        data, self._out = self._out, b''
        return self.say(data) if data else b''

    def _take_symbol(self) -> bool:
        """Take the first symbol of what has come; return False where it is not whole yet."""
        _, dle, rest = self._buffer.partition(_DLE)
        data = dle + rest
        if len(data) < 2:
            self._buffer = data
            return False
        pair, size = data[:2], 2
        if pair == ENQ and self.wiring is Wiring.HALF:
            size = 5 if data[2:4] == b'\x10\x10' else 4
            if len(data) >= size and data[2] in self.stations:
                self._polled(data[2])
        elif pair in (_SOH, _STX):
            size = self._message_in(data)
        if len(data) < size or not size:
            self._buffer = data
            return False
        self._buffer = data[size:]
        if pair == ACK and self._polled_station is not None:
            self._replies[self._polled_station].popleft()
            self._polled_station = None
        elif pair == NAK and self.wiring is Wiring.HALF:  # M 2-7, 3-11
            for queue in self._replies.values():
                self.flushed += queue
                queue.clear()
            self._polled_station = None
        elif pair == ENQ and self.wiring is Wiring.FULL:
            self._out += self._response
        return True

    def _message_in(self, data: bytes) -> int:
        """Take the message that begins the data; return its size, 0 where it is not whole yet."""
        at, station = 2, b''
        if data[:2] == _SOH:
            at = 4 if data[2:4] == b'\x10\x10' else 3
            station, at = data[2:3], at + 2
        text = b''
        while at + 1 < len(data):
            if data[at] != 0x10:
                text, at = text + data[at:at + 1], at + 1
            elif data[at + 1] == 0x10:
                text, at = text + b'\x10', at + 2
            elif data[at + 1] == 3:
                at += 4
                if at > len(data):
                    return 0
                covered = (station + b'\x02' if station else b'') + text + b'\x03'
                self._message(station, text, data[at - 2:at] == crc(covered))
                return at
            else:
                return at  # broken off
        return 0

    def _polled(self, station: int) -> None:
        replies = self._replies[station]
        self._polled_station = station if replies else None
        self._out += frame(replies[0]) if replies else EOT

    def _message(self, station: bytes, data: bytes, is_good: bool) -> None:
        if station and station[0] not in self.stations:
            return
        answer = self.takes(data) if is_good else Answer.NAK
        if answer is Answer.NOTHING or not is_good and self.wiring is not Wiring.FULL:
            return
        if self.wiring is not Wiring.RADIO:
            self._response = NAK if answer is Answer.NAK else ACK
            self._out += self._response
        if data[2] & _REPLY:
            self.answered.append(data)
        elif data == self._last:
            return
        elif answer is Answer.LATE:
            self._last = data
            self._send_after(self.late, _reply_to(data, _NOT_DELIVERED))
        elif answer in (Answer.ACK, Answer.REFUSES):
            self._last = data
            self._execute(data, answer is Answer.REFUSES)

    def _send_after(self, seconds: float, reply: bytes) -> None:
        self._to_come.append((self._now + seconds, reply))
        self._to_come.sort()
        self._plan()

    def _plan(self) -> None:
        self.next_call = self._to_come[0][0] if self._to_come else None

    def _execute(self, data: bytes, is_refused: bool) -> None:
        self.executed.append(data)
        status, result = (_NOT_DELIVERED, b'')
        if is_refused or not self.knows_commands:
            status = _ILLEGAL
        elif data[0] in self.nodes | {self.station} or (
                self.executes_diagnostics and data[2] == _ECHO):
            status, result = self.answer(data)
        reply = _reply_to(data, status) + result
        if self.replies_to is not None and not (self.executes_diagnostics and data[2] == _ECHO):
            reply = bytes((self.replies_to,)) + reply[1:]
        if seconds := self.seconds(data):
            self._send_after(seconds, reply)
        else:
            self._send(reply)

    def send(self, message: bytes) -> None:
        """Send a message of its own: its link data; in half duplex it waits for a poll."""
        self._send(message)

    def _send(self, reply: bytes) -> None:
        if self.wiring is Wiring.HALF:
            station = reply[1] if reply[1] in self.stations else self.station
            self._replies[station].append(reply)
            if not self.waits_for_poll:
                self._polled(station)
        else:
            self._out += frame(reply)

    def answer(self, data: bytes) -> tuple[int, bytes]:
        """Return status and data of a reply: to echo, status, typed reads and writes of words."""
        node, command, function, rest = data[0], data[2] & 0x0F, data[6], data[7:]
        if command == _ECHO:
            return 0, self.identities.get(node, _IDENTITY) if function == 3 else rest
        if command != _TYPED or function not in (0xA2, 0xAA):
            return _ILLEGAL, b''
        size, file, element = rest[0], rest[1], rest[3]
        at, taken = (element, 5) if element != 0xFF else (int.from_bytes(rest[4:6], 'little'), 7)
        places = [(node, file, at + number) for number in range(size // 2)]
        if function == 0xA2:
            return 0, b''.join(self.words.get(place, 0).to_bytes(2, 'little') for place in places)
        for number, place in enumerate(places):
            first = taken + 2 * number
            self.words[place] = int.from_bytes(rest[first:first + 2], 'little')
        return 0, b''
