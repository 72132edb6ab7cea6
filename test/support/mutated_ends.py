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
Ends of a line with habits that can be switched on: slave, peer, master, client, radio nodes.

Without a habit each keeps the rules of the manual. A habit is a fault, or something that the
manual allows. Neither codec nor PLC is that of the package, nor that of ``conform``: a
receiver takes bytes one at a time; the checks are those of the vectors' verifier. Time is virtual.
"""

from collections import deque
from collections.abc import Callable, Generator
from enum import Enum
import heapq
from itertools import count
import runpy

from support.plain_plc import PlainPlc
from support.vectors import VECTOR_FOLDER

_VERIFY = runpy.run_path(str(VECTOR_FOLDER / 'verify.py'))
_right_check: Callable[[str, int | None, bytes], bytes] = _VERIFY['right_check']

_DLE, _SOH, _STX, _ETX, _EOT, _ENQ, _ACK, _NAK = 0x10, 1, 2, 3, 4, 5, 6, 0x15
_LIMIT = 3  # of repetitions, and of enquiries
_ACK_TIMEOUT = 1.0
_COMMAND_TIMEOUT = 5.0


# What an end does otherwise.
Habit = Enum('Habit', [
    # Of everybody who answers.
    'NO_ACK', 'TAKES_BAD_CHECK', 'TAKES_SHORT', 'LOST_AFTER_BROKEN_MESSAGE', 'LOST_AFTER_NOISE',
    'EXECUTES_DUPLICATES', 'COUNTS_NOTHING', 'DUPLICATE_WITHOUT_ACK', 'DUPLICATE_BY_TNS',
    'DUPLICATE_WITHOUT_SOURCE', 'DUPLICATE_BY_COMMAND_AND_SOURCE', 'REMEMBERS_99', 'UNSTUFFED',
    'BAD_CHECK_OF_HIGH_BYTES', 'CUTS_ECHO', 'CUTS_ECHO_AT_80', 'SMALL_PACKETS', 'EXCHANGES_TNS',
    'DOES_ALL_COMMANDS', 'DOES_ALL_FUNCTIONS', 'NO_IDENTITY', 'READS_SHORT', 'READS_LONG',
    'READS_ZEROS_BEYOND', 'WRITES_NOTHING', 'MASKS_NOTHING', 'REFUSES_AREA', 'TEXT_IS_N7_0',
    'LOSES_DOUBLED_BYTE',  # 10, of what it takes
    'ACKS_DUPLICATE_TWICE', 'REFUSES_FIRST',  # copy of each message, as if it were full
    'SENDS_NO_STX', 'READS_BEYOND_LAST', 'TAKES_CMD_0C', 'TAKES_FNC_E7',  # as a read
    'SLOW',  # each response and reply 300 ms late
    'LATE_REPLY',  # 300 ms after the command
    'VERY_LATE_REPLY',  # 3 s
    'EXECUTES_BAD_CHECK',  # without a reply, whatever the response is
    'CHECKS_FIRST_BYTE_ONLY',  # of the two of a CRC
    'CHECKS_LAST_BYTE_ONLY', 'DOUBLES_CHECK',
    'REPLY_WITHOUT_BIT',  # 6 of CMD
    'KEEPS_ADDRESSES',  # of the command, in the reply
    'ADDS_BYTE_TO_ECHO', 'ACKS_TWICE',
    'ALWAYS_STS', 'REFUSES_MASK',  # 50
    'WORDS_REVERSED', 'WRITES_FIRST_WORD_ONLY', 'READS_NEXT_WORD',
    'BYTES_EXCHANGED',  # of words that are written
    'REPEATS_CUT',  # a message without its last byte
    'BIT_15_LOST', 'MASK_SETS_ONLY', 'MASK_CHANGES_NEXT_WORD',
    'MASK_EXCHANGED',  # with the bits
    'SENDS_COMMANDS',  # of its own, as MSG does: 0.7 s after the last
    'FULL_AT_EVERY_THIRD',  # message
    # Of a slave.
    'NAKS_BAD_CHECK', 'ACK_TO_POLL', 'REPLIES_UNASKED', 'POLL_NOT_DOUBLED', 'CRC_WITHOUT_STATION',
    'ANSWERS_BAD_POLL', 'ANSWERS_ALL_STATIONS', 'DROPS_WHAT_IT_SENT',
    'KEEPS_WHAT_WAS_ACKNOWLEDGED', 'NEVER_GIVES_UP', 'LOSES_WHEN_FULL', 'NAKS_WHEN_FULL',
    'ACKS_BROADCAST', 'REPLIES_TO_BROADCAST', 'IGNORES_NAK', 'NO_EOT', 'LAST_REPLY_FIRST',
    'ONE_MESSAGE_ONLY',  # is full as long as it owes a reply
    'EXECUTES_BAD_CHECK_LATER',  # without DLE ACK; the reply comes at the next poll
    'EXECUTES_SHORT_LATER',  # and so a message that is too short
    'EXECUTES_OTHER_STATION',
    'ANSWERS_POLL_OF_ALL',  # of station 255
    'ACK_OF_ANY',  # drops what was sent, as KF2 4-31 has it
    'DROPS_AT_ANY_ACK',  # also what was not sent
    'NEVER_FULL', 'TWO_REPLIES_TO_A_POLL',
    # Of a peer or client.
    'IGNORES_BAD_CHECK', 'NAK_AS_0F', 'NAKS_STRAY_ETX', 'ENQ_IN_MESSAGE_IGNORED',
    'ENQ_IN_MESSAGE_ANSWERED',  # with the last response, and the message goes on
    'ENQ_ALWAYS_NAK', 'ENQ_ALWAYS_ACK', 'ENQ_NOT_ANSWERED',
    'RESPONSE_IS_DATA',  # one inside a message
    'RESPONSE_INSIDE_IGNORED', 'EMBEDS_RESPONSES', 'NO_REPETITION',
    'SILENCE_REPEATED',  # the message instead of DLE ENQ
    'ENQUIRES_ALWAYS',  # 600 ms after each message
    'ENQ_AFTER_NOISE_OLD',  # DLE ENQ gets the response of before the noise
    'EMBEDDED_NAK_IGNORED', 'EMBEDDED_NAK_AS_ACK', 'ENQUIRES_FOR_EVER',
    'DROPS_MESSAGE_AROUND',  # the first response inside of one
    'ACK_TIMEOUT_OF_8',  # s
    'REPEATS_AFTER_ACK',  # once, after 2 s
    'USES_REFUSED_REPLY',
    'REFUSES_SIX_BYTES',  # as it does fewer
    'NAKS_BROKEN_TWICE', 'REPEATS_AT_ANY_NAK', 'REPEATS_AT_EOT',
    # Of a master or client.
    'SAME_TNS', 'NEW_TNS_FOR_REPETITION', 'STS_IN_COMMAND', 'POLL_WITH_CRC', 'DOES_NOT_POLL',
    'EOT_ENDS_COMMAND', 'NAKS_BAD_REPLY', 'IMPATIENT', 'POLLS_BETWEEN_REPETITIONS', 'POLLS_OTHERS',
    'POLLS_LATE', 'SENDS_TWO', 'ONE_REPETITION',
    'ACKS_BAD_REPLY',  # and polls again
    'NAK_BEFORE_COMMAND', 'TAKES_ANY_TNS', 'TAKES_ANY_DESTINATION', 'TAKES_ANY_CODE',
    'REPEATS_FOR_EVER', 'SENDS_NO_FUNCTION',
    'STOPS_AFTER_10',  # commands
    'TAKES_SHORT_REPLY', 'WAITS_FOR_EVER',  # for the answer to a poll
    'ENDS_AT_OTHER_CODE',  # the command as failed
    'TAKES_NO_REPLY',
    'WRITES_BACK',  # each word that it reads
    # Of a radio modem node or client.
    'ACKNOWLEDGES', 'ANSWERS_SYMBOLS', 'REPEATS_AFTER_NAK', 'REPLIES_FOR_OTHERS',
    'EXECUTES_FOR_OTHERS',  # in silence
    'REPEATS_REPLY', 'SENDS_ON', 'SENDS_ON_OWN',
    'SENDS_ON_AGAIN',  # whenever it is heard, two copies
    'TAKES_ANY_REPLY'])

Symbol = tuple[object, ...]
"""(kind, ...): a code; 'poll', station, is_good; 'message', station, data, is_good; 'broken'."""


class Wire:
    """
    One end of a line in virtual time, as ``conform`` uses it.

    What ``say`` is given leaves ``delay`` s later; ``after`` calls something then. ``words`` are
    those of a PLC behind it.
    """

    def __init__(self, check: str, habits: frozenset[Habit], is_half_duplex: bool) -> None:
        self.words = bytearray()
        self.check, self.habits, self.is_half_duplex = check, habits, is_half_duplex
        self.now = 0.0
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._count = count()
        self._next = 0
        self._said = self._embedded = b''
        self._has_dropped = False
        self._copied = b''
        self._receiver = self._receive()
        next(self._receiver)

    def clock(self) -> float:
        return self.now

    def write(self, data: bytes) -> None:
        """Take what the script sends."""
        self._run(self.now)
        for byte in data:
            self._receiver.send(byte)
        self._run(self.now)

    def read(self, timeout: float) -> bytes:
        """Let time pass until something was said, at most ``timeout`` s."""
        end = self.now + timeout
        while not self._said and self._due and self._due[0][0] <= end:
            self._run(self._due[0][0])
        if not self._said:
            self.now = end
        said, self._said = self._said, b''
        return said

    def _run(self, until: float) -> None:
        while self._due and self._due[0][0] <= until:
            when, _, action = heapq.heappop(self._due)
            self.now = max(self.now, when)
            action()

    def after(self, delay: float, action: Callable[[], None]) -> None:
        """Do something later."""
        heapq.heappush(self._due, (self.now + delay, next(self._count), action))

    def then(self, seconds: float, action: Callable[[], None]) -> None:
        """Do something later, unless something else is to be done before."""
        self._next += 1
        mine = self._next
        self.after(seconds, lambda: action() if mine == self._next else None)

    @property
    def reply_time(self) -> float:
        """Return the seconds from a command to its reply."""
        return 3.0 if self.has(Habit.VERY_LATE_REPLY) else self.has(Habit.LATE_REPLY) * 0.3

    def say(self, data: bytes, delay: float = 0.0) -> None:
        """Send bytes; those of a slow end are late."""
        def leave() -> None:
            self._said += data
        self.after(delay + (0.3 if Habit.SLOW in self.habits else 0.0), leave)

    def has(self, habit: Habit) -> bool:
        return habit in self.habits

    def refuses(self, data: bytes) -> bool:
        """Tell whether a message is refused because it comes for the first time."""
        before, self._copied = self._copied, data
        return self.has(Habit.REFUSES_FIRST) and data != before

    def noise(self) -> None:
        """Take note of a byte outside of any symbol."""

    def take(self, symbol: Symbol) -> None:
        """Take what was received."""
        raise NotImplementedError

    def frame(self, data: bytes, station: int | None = None) -> bytes:
        """Return a message as it stands on the line."""
        check = _right_check(self.check, station, data)
        if self.has(Habit.DOUBLES_CHECK):
            check = check.replace(b'\x10', b'\x10\x10')
        if self.has(Habit.BAD_CHECK_OF_HIGH_BYTES) and max(data) >= 0xC0:
            check = bytes(byte ^ 0xFF for byte in check)
        if self.has(Habit.CRC_WITHOUT_STATION):
            check = _right_check(self.check, None, data)
        body = data if self.has(Habit.UNSTUFFED) else data.replace(b'\x10', b'\x10\x10')
        body, self._embedded = self._embedded + body, b''
        head = b'' if station is None else bytes((_DLE, _SOH)) + self.number(station)
        begin = b'' if self.has(Habit.SENDS_NO_STX) else bytes((_DLE, _STX))
        return head + begin + body + bytes((_DLE, _ETX)) + check

    def number(self, station: int) -> bytes:
        """Return a station as data symbol."""
        return bytes((station,)) * (2 if station == _DLE else 1)

    def _receive(self) -> Generator[None, int, None]:
        while True:
            byte = yield
            if byte == _DLE:
                yield from self._control((yield))
                continue
            self.noise()
            if self.has(Habit.LOST_AFTER_NOISE):
                yield from self._deaf()

    def _deaf(self) -> Generator[None, int, None]:
        """Hear nothing up to the next DLE ETX."""
        last = 0
        while (byte := (yield)) != _ETX or last != _DLE:
            last = byte

    def _control(self, code: int) -> Generator[None, int, None]:
        if code == _ENQ and self.is_half_duplex:
            station = yield
            if station == _DLE and not self.has(Habit.POLL_NOT_DOUBLED):
                yield
            self.take(('poll', station, (yield) == _VERIFY['bcc'](bytes((station,)))[0]))
        elif code == _SOH and self.is_half_duplex:
            station = yield
            if station == _DLE:
                yield
            if (yield) == _DLE and (yield) == _STX:
                yield from self._message(station)
        elif code == _STX:
            yield from self._message(None)
        else:
            self.take((code,))

    def _message(self, station: int | None) -> Generator[None, int, None]:
        data, is_dropped = bytearray(), False
        while True:
            byte = yield
            if byte != _DLE:
                data.append(byte)
                continue
            code = yield
            if code == _DLE:
                data += bytes(() if self.has(Habit.LOSES_DOUBLED_BYTE) else (_DLE,))
            elif code == _ETX:
                break
            elif code in (_ACK, _NAK) and self.has(Habit.RESPONSE_IS_DATA):
                data += bytes((_DLE, code))
            elif code in (_ACK, _NAK) or code == _ENQ and self.has(Habit.ENQ_IN_MESSAGE_ANSWERED):
                self._inside(code)
                is_dropped = self.has(Habit.DROPS_MESSAGE_AROUND) and not self._has_dropped
            elif code != _ENQ or not self.has(Habit.ENQ_IN_MESSAGE_IGNORED):
                if self.has(Habit.LOST_AFTER_BROKEN_MESSAGE):
                    for _ in range(3):
                        yield from self._deaf()
                    return
                self.take(('broken',))
                if code in (_SOH, _STX) or code == _ENQ and self.is_half_duplex:
                    yield from self._control(code)
                return
        if is_dropped:
            self._has_dropped = True
            return
        yield from self._check(station, bytes(data))

    def _inside(self, code: int) -> None:
        """Take a symbol inside of a message."""
        if code == _NAK and self.has(Habit.EMBEDDED_NAK_AS_ACK):
            code = _ACK
        is_ignored = code == _NAK and self.has(Habit.EMBEDDED_NAK_IGNORED)
        if not is_ignored and not self.has(Habit.RESPONSE_INSIDE_IGNORED):
            self.take((code,))

    def _check(self, station: int | None, data: bytes) -> Generator[None, int, None]:
        check = b''
        for _ in range(1 if self.check == 'BCC' else 2):
            check += bytes(((yield),))
            if self.has(Habit.DOUBLES_CHECK) and check[-1] == _DLE:
                yield
        right = _right_check(
            self.check, None if self.has(Habit.CRC_WITHOUT_STATION) else station, data)
        is_good = check == right or self.has(Habit.CHECKS_FIRST_BYTE_ONLY) and \
            check[0] == right[0] or self.has(Habit.CHECKS_LAST_BYTE_ONLY) and \
            check[-1] == right[-1]
        self.take(('message', station, data, is_good))


class _Executor:
    """A PLC behind an end: link data in, link data of the reply out; and what is a duplicate."""

    def __init__(self, wire: Wire, family: str) -> None:
        self._wire = wire
        self._plc = PlainPlc(family)
        wire.words = self._plc.words
        self._seen: deque[bytes] = deque(maxlen=99 if wire.has(Habit.REMEMBERS_99) else 1)
        self._count = 0
        self._tns = 0x6000

    @property
    def is_full(self) -> bool:
        """Count a message; tell whether it cannot be stored."""
        self._count += 1
        return self._wire.has(Habit.FULL_AT_EVERY_THIRD) and self._count % 3 == 0

    def own_command(self) -> bytes:
        """Return a command of its program."""
        self._tns += 1
        return bytes((5, 1, 0x0F, 0)) + self._tns.to_bytes(2, 'little') + bytes.fromhex(
            'A2 04 07 89 00 00')

    def _key(self, data: bytes) -> bytes:
        has = self._wire.has
        if has(Habit.DUPLICATE_BY_TNS):
            return data[4:6]
        if has(Habit.DUPLICATE_WITHOUT_SOURCE):
            return data[2:3] + data[4:6]
        if has(Habit.DUPLICATE_BY_COMMAND_AND_SOURCE):
            return data[1:3]
        return data[1:3] + data[4:6]

    def is_duplicate(self, data: bytes) -> bool:
        """Tell whether a message is one that came before."""
        return self._key(data) in self._seen and not self._wire.has(Habit.EXECUTES_DUPLICATES)

    def remember(self, data: bytes) -> None:
        """Remember a message that was accepted."""
        self._seen.append(self._key(data))

    def serve(self, data: bytes) -> bytes:
        """Execute a command."""
        has = self._wire.has
        cmd, fnc = data[2], data[6:7]
        if fnc in (b'\xAA', b'\x67') and has(Habit.WRITES_NOTHING):
            return self._done(data)
        data = self._misread(self._taken_for_a_read(data))
        if cmd == 0x0F and fnc == b'\x68' and data[11:12] == b'\x07' and has(Habit.REFUSES_AREA):
            return self._done(data, sts=0x10)
        reply = self._plc.serve(data)
        reply = reply[:2] + bytes((cmd | 0x40,)) + reply[3:]
        if fnc == b'\xAB' and has(Habit.MASK_CHANGES_NEXT_WORD):
            element = bytes((data[10] + 1,))
            self._plc.serve(
                data[:6] + b'\xAA\x02' + data[8:10] + element + b'\0\x99\x99')
        if fnc == b'\xA2' and has(Habit.WORDS_REVERSED):
            reply = reply[:6] + _reversed(reply[6:])
        if has(Habit.ALWAYS_STS) or fnc == b'\xAB' and has(Habit.REFUSES_MASK):
            reply = self._done(data, sts=0x50)
        if has(Habit.REPLY_WITHOUT_BIT):
            reply = reply[:2] + bytes((cmd,)) + reply[3:]
        if has(Habit.KEEPS_ADDRESSES):
            reply = data[:2] + reply[2:]
        if cmd == 0x06 and fnc == b'\x00':
            reply += bytes(has(Habit.ADDS_BYTE_TO_ECHO))
            reply = reply[:106] if has(Habit.CUTS_ECHO) else reply
            reply = reply[:86] if has(Habit.CUTS_ECHO_AT_80) else reply
        if cmd == 0x06 and fnc == b'\x03' and has(Habit.NO_IDENTITY):
            reply = reply[:6]
        if reply[3] and self._is_lenient(cmd, fnc):
            reply = self._done(data) + bytes(2)
        if fnc in (b'\xA2', b'\x68'):
            reply = reply[:-1] if has(Habit.READS_SHORT) else reply
            reply = reply[:6] + bytes(2 * has(Habit.READS_LONG)) + reply[6:]
        if has(Habit.EXCHANGES_TNS):
            reply = reply[:4] + reply[5:3:-1] + reply[6:]
        return reply

    def _misread(self, data: bytes) -> bytes:
        """Return a command as it is understood (M 7-17, 7-18, 7-20)."""
        has, fnc = self._wire.has, data[6:7]
        if fnc == b'\xAB':
            before, mask, bits = data[:-4], data[-4:-2], data[-2:]
            if has(Habit.MASKS_NOTHING):
                mask = b'\xFF\xFF'
            if has(Habit.MASK_SETS_ONLY):
                mask = bytes(one & other for one, other in zip(mask, bits, strict=True))
            return before + (bits + mask if has(Habit.MASK_EXCHANGED) else mask + bits)
        if data[11:13] == b'\x00$' and has(Habit.TEXT_IS_N7_0):
            return data[:11] + b'\x06\x07\x00\x01\x00'
        if fnc == b'\xA2' and has(Habit.READS_NEXT_WORD):
            return data[:10] + bytes((data[10] + 1 & 0xFF,)) + data[11:]
        if fnc != b'\xAA':
            return data
        head, words = data[:12], data[12:]
        if has(Habit.WORDS_REVERSED):
            words = _reversed(words)
        if has(Habit.BYTES_EXCHANGED):
            words = _reversed(words[::-1])
        if has(Habit.BIT_15_LOST):
            words = bytes(byte & 0x7F if at % 2 else byte for at, byte in enumerate(words))
        if has(Habit.WRITES_FIRST_WORD_ONLY):
            head, words = head[:7] + b'\x02' + head[8:], words[:2]
        return head + words

    def _taken_for_a_read(self, data: bytes) -> bytes:
        has, fnc = self._wire.has, data[6:7]
        if data[2] == 0x0C and has(Habit.TAKES_CMD_0C) and len(data) > 7:
            return data[:2] + b'\x0F' + data[3:]
        if fnc == b'\xE7' and has(Habit.TAKES_FNC_E7) and len(data) > 7:
            return data[:6] + b'\xA2' + data[7:]
        if fnc == b'\xA2' and data[8:12] == b'\x07\x89\x13\x00' and has(Habit.READS_BEYOND_LAST):
            return data[:7] + b'\x02' + data[8:]
        return data

    def _is_lenient(self, cmd: int, fnc: bytes) -> bool:
        has = self._wire.has
        return (cmd == 0x0C and has(Habit.DOES_ALL_COMMANDS)
                or fnc == b'\xE7' and has(Habit.DOES_ALL_FUNCTIONS)
                or fnc == b'\xA2' and has(Habit.READS_ZEROS_BEYOND))

    @staticmethod
    def _done(data: bytes, sts: int = 0) -> bytes:
        return bytes((data[1], data[0], data[2] | 0x40, sts)) + data[4:6]


def _reversed(words: bytes) -> bytes:
    """Return words, the last first."""
    return b''.join(words[at:at + 2] for at in reversed(range(0, len(words), 2)))


class MutatedSlave(Wire):
    """A half-duplex slave (KF2 4-31)."""

    def __init__(self, check: str, *habits: Habit, station: int = 1, family: str = 'SLC') -> None:
        super().__init__(check, frozenset(habits), is_half_duplex=True)
        self._station = station
        self._plc = _Executor(self, family)
        self._queue: deque[tuple[float, bytes]] = deque()
        self._held: bytes | None = None
        self._sent = 0
        self._has_just_sent = False
        self._asked = -1.0

    def take(self, symbol: Symbol) -> None:
        """React to a symbol."""
        kind = symbol[0]
        was_sent, self._has_just_sent = self._has_just_sent, False
        if kind == 'poll':
            is_ours = symbol[1] == self._station or self.has(Habit.ANSWERS_ALL_STATIONS) or (
                symbol[1] == 0xFF and self.has(Habit.ANSWERS_POLL_OF_ALL))
            if is_ours and (symbol[2] or self.has(Habit.ANSWERS_BAD_POLL)):
                self._polled()
        elif kind == 'message':
            _, station, data, is_good = symbol
            assert isinstance(data, bytes)
            if station in (self._station, 0xFF) or self.has(Habit.ANSWERS_ALL_STATIONS):
                self._received(data, bool(is_good), station == 0xFF)
            elif self.has(Habit.EXECUTES_OTHER_STATION):
                self._execute(data, wants_reply=True)
        elif kind == _ACK and not self.has(Habit.KEEPS_WHAT_WAS_ACKNOWLEDGED):
            if was_sent or self.has(Habit.ACK_OF_ANY):
                self._held = None
            elif self.has(Habit.DROPS_AT_ANY_ACK):
                self._held = None
                self._queue.clear()
        elif kind == _NAK and not self.has(Habit.IGNORES_NAK):
            self._held = None
            self._queue.clear()

    def _respond(self, code: int = _ACK) -> None:
        if not self.has(Habit.NO_ACK):
            self.say(bytes((_DLE, code)) * (2 if self.has(Habit.ACKS_TWICE) else 1))

    def _received(self, data: bytes, is_good: bool, is_broadcast: bool) -> None:
        if not is_good and not self.has(Habit.TAKES_BAD_CHECK):
            return self._refused(data)
        if len(data) < 6 and self.has(Habit.TAKES_SHORT):
            self._respond()
        if len(data) < 6 and self.has(Habit.EXECUTES_SHORT_LATER):
            self._queue.append((self.now, data))
        if len(data) < 6 or self.has(Habit.SMALL_PACKETS) and len(data) > 110:
            return
        if not is_broadcast and (self._plc.is_full or self.refuses(data)):
            return
        if self._plc.is_duplicate(data):
            if not self.has(Habit.DUPLICATE_WITHOUT_ACK):
                self._respond()
            if self.has(Habit.ACKS_DUPLICATE_TWICE):
                self._respond()
            return
        waiting = len(self._queue) + (self._held is not None)
        limit = 1 if self.has(Habit.ONE_MESSAGE_ONLY) else 99 if self.has(Habit.NEVER_FULL) else 3
        if waiting >= limit and not is_broadcast:
            if self.has(Habit.NAKS_WHEN_FULL):
                self._respond(_NAK)
            if self.has(Habit.LOSES_WHEN_FULL):
                self._respond()
            return
        self._plc.remember(data)
        if not is_broadcast or self.has(Habit.ACKS_BROADCAST):
            self._respond()
        self._execute(data, not is_broadcast or self.has(Habit.REPLIES_TO_BROADCAST))

    def _refused(self, data: bytes) -> None:
        if self.habits & {Habit.EXECUTES_BAD_CHECK, Habit.EXECUTES_BAD_CHECK_LATER}:
            self._execute(data, self.has(Habit.EXECUTES_BAD_CHECK_LATER))
        if self.has(Habit.NAKS_BAD_CHECK):
            self._respond(_NAK)

    def _execute(self, data: bytes, wants_reply: bool) -> None:
        reply = self._plc.serve(data)
        if wants_reply:
            if self.has(Habit.REPLIES_UNASKED):
                self.say(self.frame(reply), 0.1)
                return
            ready = self.now + self.reply_time, reply
            self._queue.insert(0 if self.has(Habit.LAST_REPLY_FIRST) else len(self._queue), ready)

    def _polled(self) -> None:
        is_given_up = self._sent > _LIMIT and not self.has(Habit.NEVER_GIVES_UP)
        if self._held is not None and (is_given_up or self.has(Habit.DROPS_WHAT_IT_SENT)):
            self._held = None
        if self._held is None and self._queue and self._queue[0][0] <= self.now:
            self._held, self._sent = self._queue.popleft()[1], 0
        if self._held is None and self.has(Habit.SENDS_COMMANDS) and self.now > self._asked + 0.7:
            self._held, self._sent, self._asked = self._plc.own_command(), 0, self.now
        if self._held is not None:
            self._sent += 1
            self._has_just_sent = True
            self.say(self.frame(self._held))
            if self.has(Habit.REPEATS_CUT):
                self._held = self._held[:-1]
            if self._queue and self.has(Habit.TWO_REPLIES_TO_A_POLL):
                self.say(self.frame(self._queue.popleft()[1]))
        elif not self.has(Habit.NO_EOT):
            self.say(bytes((_DLE, _ACK if self.has(Habit.ACK_TO_POLL) else _EOT)))


class _FullDuplex(Wire):
    """What peer and client have in common: responses, and messages that are sent until taken."""

    def __init__(self, check: str, habits: frozenset[Habit]) -> None:
        super().__init__(check, habits, is_half_duplex=False)
        self._last_response = _NAK
        self._outgoing: deque[bytes] = deque()
        self._sent = b''
        self._naks = self._enquiries = 0
        self._ack_timeout = 8.0 if self.has(Habit.ACK_TIMEOUT_OF_8) else _ACK_TIMEOUT
        self._sending = 0  # counts messages and repetitions, so that an old timer is known

    def execute(self, data: bytes) -> None:
        """Take a good message."""
        raise NotImplementedError

    def is_duplicate(self, data: bytes) -> bool:
        """Tell whether a message has come before."""
        raise NotImplementedError

    def failed(self) -> None:
        """Take note that a message was given up."""

    def noise(self) -> None:
        if not self.has(Habit.ENQ_AFTER_NOISE_OLD):
            self._last_response = _NAK

    def refused(self, data: bytes) -> None:
        """Take note of a message with a wrong check."""

    @property
    def is_full(self) -> bool:
        """Tell whether a message cannot be stored."""
        return False

    def take(self, symbol: Symbol) -> None:
        """React to a symbol."""
        kind = symbol[0]
        if kind == 'broken' or kind == _ETX and self.has(Habit.NAKS_STRAY_ETX):
            self._respond(_NAK)
            if self.has(Habit.NAKS_BROKEN_TWICE):
                self._respond(_NAK)
        elif kind == 'message':
            assert isinstance(symbol[2], bytes)
            self._received(symbol[2], bool(symbol[3]))
        elif kind == _ENQ:
            code = (_NAK if self.has(Habit.ENQ_ALWAYS_NAK) else
                    _ACK if self.has(Habit.ENQ_ALWAYS_ACK) else self._last_response)
            if not self.has(Habit.ENQ_NOT_ANSWERED):
                self.say(bytes((_DLE, code)))
        elif kind == _ACK and self._outgoing:
            self._end()
        elif kind == _NAK and self.has(Habit.REPEATS_AT_ANY_NAK) and not self._outgoing or \
                kind == _EOT and self.has(Habit.REPEATS_AT_EOT):
            self.say(self.frame(self._sent))
        elif kind == _NAK and self._outgoing:
            self._naks += 1
            if self._naks > _LIMIT and not self.has(Habit.NEVER_GIVES_UP) or \
                    self.has(Habit.NO_REPETITION):
                self._end(is_taken=False)
            else:
                if self.has(Habit.REPEATS_CUT):
                    self._outgoing[0] = self._outgoing[0][:-1]
                self._transmit()

    def _received(self, data: bytes, is_good: bool) -> None:
        if not is_good and not self.has(Habit.TAKES_BAD_CHECK):
            if not self.has(Habit.IGNORES_BAD_CHECK):
                self._respond(_NAK)
            return self.refused(data)
        shortest = 7 if self.has(Habit.REFUSES_SIX_BYTES) else \
            1 if self.habits & {Habit.TAKES_SHORT, Habit.TAKES_SHORT_REPLY} else 6
        if self.is_full or self.refuses(data) or len(data) < shortest or \
                len(data) > 110 and self.has(Habit.SMALL_PACKETS):
            return self._respond(_NAK)
        is_duplicate = self.is_duplicate(data)
        if not (is_duplicate and self.has(Habit.DUPLICATE_WITHOUT_ACK)):
            self._respond(_ACK, is_followed=not is_duplicate)
        if is_duplicate and self.has(Habit.ACKS_DUPLICATE_TWICE):
            self._respond(_ACK)
        if not is_duplicate and len(data) >= (1 if self.has(Habit.TAKES_SHORT_REPLY) else 6):
            self.execute(data)

    def _respond(self, code: int, is_followed: bool = False) -> None:
        self._last_response = code
        if code == _NAK and self.has(Habit.NAK_AS_0F):
            code = 0x0F
        if self.has(Habit.EMBEDS_RESPONSES) and is_followed and not self._outgoing:
            self._embedded = bytes((_DLE, code))  # in the reply
        elif code == _NAK or not self.has(Habit.NO_ACK):
            self.say(bytes((_DLE, code)) * (2 if self.has(Habit.ACKS_TWICE) else 1))

    def send(self, data: bytes) -> None:
        """Send a message after those that wait."""
        self._outgoing.append(data)
        if len(self._outgoing) == 1:
            self._begin()

    def _begin(self) -> None:
        self._naks = self._enquiries = 0
        self._transmit()

    def _transmit(self) -> None:
        self._sent = self._outgoing[0]
        self.say(self.frame(self._sent))
        self._wait()
        if self.has(Habit.ENQUIRES_ALWAYS):
            self.say(bytes((_DLE, _ENQ)), 0.6)

    def _wait(self) -> None:
        self._sending += 1
        mine = self._sending

        def expire() -> None:
            if mine == self._sending and self._outgoing:
                self._not_answered()
        self.after(self._ack_timeout, expire)

    def _not_answered(self) -> None:
        self._enquiries += 1
        if self._enquiries > _LIMIT and not self.habits & {
                Habit.NEVER_GIVES_UP, Habit.ENQUIRES_FOR_EVER}:
            self._end(is_taken=False)
        else:
            is_repeated = self.has(Habit.SILENCE_REPEATED) or \
                self.has(Habit.NEVER_GIVES_UP) and self._enquiries % 2 == 0
            self.say(self.frame(self._outgoing[0]) if is_repeated else bytes((_DLE, _ENQ)))
            self._wait()

    def _end(self, is_taken: bool = True) -> None:
        self._sending += 1
        message = self._outgoing.popleft()
        if self.has(Habit.REPEATS_AFTER_ACK) and is_taken:
            self.say(self.frame(message), 2.0)
        if not is_taken:
            self.failed()
        if self._outgoing:
            self._begin()


class MutatedPeer(_FullDuplex):
    """A full-duplex node that answers commands (M 4-5 to 4-9)."""

    def __init__(self, check: str, *habits: Habit, station: int = 1, family: str = 'SLC') -> None:
        super().__init__(check, frozenset(habits))
        self._plc = _Executor(self, family)
        if self.has(Habit.SENDS_COMMANDS):
            self.after(0.7, self._ask)

    def _ask(self) -> None:
        if not self._outgoing:
            self.send(self._plc.own_command())
        self.after(0.7, self._ask)

    @property
    def is_full(self) -> bool:
        return self._plc.is_full

    def refused(self, data: bytes) -> None:
        if self.has(Habit.EXECUTES_BAD_CHECK):
            self._plc.serve(data)

    def is_duplicate(self, data: bytes) -> bool:
        """Ask the PLC, which remembers it."""
        is_duplicate = self._plc.is_duplicate(data)
        self._plc.remember(data)
        return is_duplicate

    def execute(self, data: bytes) -> None:
        """Send the reply."""
        reply = self._plc.serve(data)
        self.after(self.reply_time, lambda: self.send(reply))


_PLC5_READ = bytes.fromhex('68 00 00 02 00 06 07 00 02 00')
_PLC5_WRITE = bytes.fromhex('67 00 00 01 00 06 07 01 99 09 03 42')  # and a word


class _Asker:
    """The commands of a master or client: reads of N7:0, the next when one has ended."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._tns = 0x1234
        self._word = b''

    def next_command(self) -> bytes:
        """Return the link data of the next command."""
        self._tns = self._tns ^ 1 if self._wire.has(Habit.SAME_TNS) else self._tns + 1
        if self._wire.has(Habit.STOPS_AFTER_10) and self._tns > 0x123E:
            return b''
        sts = 2 if self._wire.has(Habit.STS_IN_COMMAND) else 0
        body, self._word = _PLC5_WRITE + self._word if self._word else _PLC5_READ, b''
        command = self.with_tns(bytes((1, 5, 0x0F, sts, 0, 0)) + body)
        if self._wire.has(Habit.SENDS_NO_FUNCTION):
            return command[:6] + command[7:]
        return command[:5] if self._wire.has(Habit.TAKES_SHORT) else command

    def with_tns(self, command: bytes) -> bytes:
        """Return a command with the newest TNS."""
        return command[:4] + self._tns.to_bytes(2, 'little') + command[6:]

    def is_reply(self, data: bytes, command: bytes) -> bool:
        """Tell whether a message is taken for the reply to a command (M 6-3, 6-7)."""
        has = self._wire.has
        if len(data) < 6 or has(Habit.TAKES_NO_REPLY):
            return has(Habit.TAKES_SHORT_REPLY)
        is_code = data[2] == command[2] | 0x40 or has(Habit.TAKES_ANY_CODE)
        is_reply = (data[0] == command[1] or has(Habit.TAKES_ANY_DESTINATION)) and (
            data[4:6] == command[4:6] or has(Habit.TAKES_ANY_TNS)) and (
            is_code or has(Habit.ENDS_AT_OTHER_CODE)) or has(Habit.TAKES_ANY_REPLY)
        if is_reply and is_code and has(Habit.WRITES_BACK):
            self._word = data[6:][-2:]
        return is_reply

    def renewed(self, command: bytes) -> bytes:
        """Return a command as it is repeated."""
        if not self._wire.has(Habit.NEW_TNS_FOR_REPETITION):
            return command
        self._tns += 1
        return self.with_tns(command)


class MutatedClient(_FullDuplex):
    """A full-duplex node that sends commands, one after the other."""

    def __init__(self, check: str, *habits: Habit) -> None:
        super().__init__(check, frozenset(habits))
        self._asker = _Asker(self)
        self._last = self._command = b''
        self.then(0.1, self._ask)

    def _ask(self) -> None:
        self._command = self._asker.next_command()
        if self._command:
            self.then(1e6 if self.habits & {Habit.ENQUIRES_FOR_EVER, Habit.NEVER_GIVES_UP}
                      else _COMMAND_TIMEOUT, self._ask)
            self._outgoing.clear()
            self.send(self._command)

    def is_duplicate(self, data: bytes) -> bool:
        """Tell whether this is the last reply again."""
        is_last, self._last = data == self._last, data
        return is_last

    def execute(self, data: bytes) -> None:
        """Go on after a reply."""
        if self._asker.is_reply(data, self._command):
            self.then(0.15, self._ask)

    def refused(self, data: bytes) -> None:
        if self.has(Habit.USES_REFUSED_REPLY):
            self.execute(data)

    def failed(self) -> None:
        self.then(0.15, self._ask)


class _Radio(Wire):
    """What both radio modem nodes have in common (SLC 13-76 to 13-80): what is taken, sent on."""

    own_number: int

    def __init__(self, check: str, habits: frozenset[Habit]) -> None:
        super().__init__(check, habits, is_half_duplex=False)
        self._sent_on: set[bytes] = set()
        self._last = b''

    def say(self, data: bytes, delay: float = 0.0) -> None:
        self._last = data
        super().say(data, delay)

    def taken(self, data: bytes, is_ours: bool) -> None:
        """Take a good message."""
        raise NotImplementedError

    def refused(self, data: bytes) -> None:
        """Take note of a damaged message."""

    def take(self, symbol: Symbol) -> None:
        """Take a message, or pass over anything else."""
        if symbol[0] != 'message':
            if self.has(Habit.ANSWERS_SYMBOLS) and symbol == (_ENQ,):
                self.say(bytes((_DLE, _NAK)))
            if self.has(Habit.REPEATS_AFTER_NAK) and symbol == (_NAK,):
                self.say(self._last)
            return
        data, is_good = symbol[2], symbol[3]
        assert isinstance(data, bytes)
        if not is_good and self.has(Habit.NAKS_BAD_CHECK):
            self.say(bytes((_DLE, _NAK)))
        if is_good and self.has(Habit.ACKNOWLEDGES):
            self.say(bytes((_DLE, _ACK)))
        if not (is_good or self.has(Habit.TAKES_BAD_CHECK)) or \
                len(data) < (5 if self.habits & {Habit.TAKES_SHORT, Habit.TAKES_SHORT_REPLY} else
                             7 if self.has(Habit.REFUSES_SIX_BYTES) else 6):
            return self.refused(data)
        dst, src = data[:2]
        if src == self.own_number:
            if self.has(Habit.SENDS_ON_OWN) and (data[2] & 0x40 or self.own_number == 5):
                self.say(self.frame(data), 0.1)
            return
        is_new = data not in self._sent_on or self.has(Habit.SENDS_ON_AGAIN)
        if dst != self.own_number and is_new and self.habits & {
                Habit.SENDS_ON, Habit.SENDS_ON_AGAIN}:
            self._sent_on.add(data)
            self.say(self.frame(data) * (1 + self.has(Habit.SENDS_ON_AGAIN)), 0.1)
        self.taken(data, dst == self.own_number)


class MutatedRadioNode(_Radio):
    """A radio modem node that answers commands."""

    def __init__(self, check: str, *habits: Habit, station: int = 1, family: str = 'SLC') -> None:
        super().__init__(check, frozenset(habits))
        self.own_number = station
        self._plc = _Executor(self, family)
        self._replies: dict[bytes, bytes] = {}
        self._executed = 0

    def refused(self, data: bytes) -> None:
        if self.has(Habit.EXECUTES_BAD_CHECK) and len(data) >= 6:
            self._plc.serve(data)

    def taken(self, data: bytes, is_ours: bool) -> None:
        """Execute a command; the reply comes by itself."""
        is_broadcast = data[0] == 0xFF
        if not (is_ours or is_broadcast or self.habits & {
                Habit.REPLIES_FOR_OTHERS, Habit.EXECUTES_FOR_OTHERS}):
            return
        if self.has(Habit.SMALL_PACKETS) and len(data) > 110:
            return
        if self._plc.is_duplicate(data):
            if self.has(Habit.REPEATS_REPLY):
                self.say(self.frame(self._replies[data]))
            return
        self._plc.remember(data)
        self._executed += 1
        if len(data) < 6:
            return self.say(self.frame(data))
        reply = self._plc.serve(data)
        # This counter counts what is executed.
        if data[2:3] + data[6:7] == b'\x06\x01' and not self.has(Habit.COUNTS_NOTHING):
            reply = reply[:8] + self._executed.to_bytes(2, 'little') + reply[10:]
        self._replies[data] = reply
        if is_ours or self.has(Habit.REPLIES_FOR_OTHERS) and not is_broadcast or \
                is_broadcast and self.has(Habit.REPLIES_TO_BROADCAST):
            self.say(self.frame(reply), self.reply_time)
            if self.has(Habit.ENQUIRES_ALWAYS):
                self.say(bytes((_DLE, _ENQ)), self.reply_time + 1.0)


class MutatedRadioClient(_Radio):
    """A radio modem node that reads station 1, one command after the other."""

    own_number = 5

    def __init__(self, check: str, *habits: Habit) -> None:
        super().__init__(check, frozenset(habits))
        self._asker = _Asker(self)
        self._command = b''
        self._tries = 0
        self.then(0.1, self._ask)

    def _ask(self) -> None:
        self._command, self._tries = self._asker.next_command(), 0
        self._try()

    def _try(self) -> None:
        if self._tries > (0 if self.has(Habit.NO_REPETITION) else _LIMIT) and not self.has(
                Habit.NEVER_GIVES_UP):
            return self._ask()
        self._tries += 1
        self.say(self.frame(self._command))
        if self.has(Habit.POLLS_OTHERS):
            self.say(self.frame(b'\7' + self._command[1:5] + b'\x99' + self._command[6:]), 0.2)
        if self.has(Habit.REPEATS_CUT):
            self._command = self._command[:-1]
        if self.has(Habit.SILENCE_REPEATED):
            self.say(bytes((_DLE, _ENQ)), 1.0)
        self.then(_COMMAND_TIMEOUT, self._try)

    def taken(self, data: bytes, is_ours: bool) -> None:
        """Go on after a reply."""
        mine = self._command
        if is_ours and data[1] == mine[0] and self._asker.is_reply(data, mine) or \
                self.has(Habit.TAKES_ANY_REPLY):
            is_again = self.has(Habit.REPEATS_AFTER_ACK)
            self._command = mine if is_again else bytes(6)  # nothing is waited for
            self.then(0.15, self._try if is_again else self._ask)


class MutatedMaster(Wire):
    """A half-duplex master (M 3-13 to 3-15) that reads station 1, one command after the other."""

    def __init__(self, check: str, *habits: Habit) -> None:
        super().__init__(check, frozenset(habits), is_half_duplex=True)
        self._asker = _Asker(self)
        self._steps = self._transactions()
        self.then(0.1, self._go_on)

    def take(self, symbol: Symbol) -> None:
        """Hand a symbol to the transaction; what breaks off is nothing, and six bytes may be."""
        is_short = self.has(Habit.REFUSES_SIX_BYTES) and symbol[0] == 'message' and \
            isinstance(symbol[2], bytes) and len(symbol[2]) < 7
        if symbol != ('broken',) and not is_short:
            self._go_on(symbol)

    def _go_on(self, symbol: Symbol | None = None) -> None:
        """Let the transaction take a symbol (None: silence), and wait for the next."""
        self.then(self._steps.send(symbol), self._go_on)

    def _poll(self, station: int = 1) -> None:
        check = _VERIFY['crc' if self.has(Habit.POLL_WITH_CRC) else 'bcc']
        self.say(bytes((_DLE, _ENQ)) + self.number(station) + check(bytes((station,))))

    def _transactions(self) -> Generator[float, Symbol | None, None]:
        while True:
            if not (command := self._asker.next_command()):
                yield 1e6
                continue
            if self.has(Habit.NAK_BEFORE_COMMAND):
                self.say(bytes((_DLE, _NAK)))
            if (yield from self._delivered(command)):
                further = self._asker.next_command() if self.has(Habit.SENDS_TWO) else b''
                yield from self._delivered(further) if further else ()
                yield from self._fetched(command)
                yield from self._fetched(further) if further else ()
            yield 0.05

    def _delivered(self, command: bytes) -> Generator[float, Symbol | None, bool]:
        for attempt in range(1 if self.has(Habit.NO_REPETITION) else
                             1000 if self.has(Habit.REPEATS_FOR_EVER) else 1 + _LIMIT):
            if attempt:
                command = self._asker.renewed(command)
                if self.has(Habit.REPEATS_FOR_EVER):
                    self.say(bytes((_DLE, _NAK)))
            self.say(self.frame(command, 1))
            symbol = yield _ACK_TIMEOUT
            if symbol == (_ACK,):
                return True
            if self.has(Habit.POLLS_BETWEEN_REPETITIONS):
                self._poll()
                yield _ACK_TIMEOUT
        return False

    def _refuse(self) -> Generator[float, Symbol | None, None]:
        if self.has(Habit.ACKS_BAD_REPLY):
            self.say(bytes((_DLE, _ACK)))
        if self.has(Habit.IGNORES_BAD_CHECK):
            yield 1e6

    def _fetched(self, command: bytes) -> Generator[float, Symbol | None, None]:
        silent = 0
        end = self.now + _COMMAND_TIMEOUT
        if self.has(Habit.DOES_NOT_POLL):
            return
        if self.has(Habit.POLLS_LATE):
            yield 0.2
        while self.now < end and silent <= (1 if self.has(Habit.ONE_REPETITION) else _LIMIT):
            self._poll()
            symbol = yield 0.02 if self.has(Habit.IMPATIENT) else _ACK_TIMEOUT
            if symbol is None and self.has(Habit.WAITS_FOR_EVER):
                yield 1e6
            if symbol == (_EOT,):
                if self.has(Habit.EOT_ENDS_COMMAND):
                    return
                yield 0.02
                continue
            if symbol is not None and symbol[0] == 'message':
                data = symbol[2]
                assert isinstance(data, bytes)
                if symbol[3] or self.has(Habit.TAKES_BAD_CHECK):
                    is_ours = self._asker.is_reply(data, command)
                    if not self.has(Habit.NO_ACK) and (
                            is_ours or not self.has(Habit.DUPLICATE_WITHOUT_ACK)):
                        self.say(bytes((_DLE, _ACK)))
                    if is_ours:
                        return
                    continue
                yield from self._refuse()
                if self.has(Habit.NAKS_BAD_REPLY):
                    self.say(bytes((_DLE, _NAK)))
                    return
            silent += 1
            if self.has(Habit.POLLS_OTHERS):
                self._poll(7)
                yield 0.05
