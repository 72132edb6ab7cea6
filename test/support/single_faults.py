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
Faults of single bytes in a transaction between two drivers, and what must hold all the same.

Each byte of a dialogue, in both directions, can be lost, doubled, flipped in each bit, followed by
00, 10 or FF, or come later than Timeout with all that follows it. Whatever happens: no value is
published that the other end did not have, no write is executed twice or told wrong, each
transaction ends within its bound, and the next one is undisturbed. One fault alone costs time and
nothing else, but for a guest by radio, who has his answer before a command is repeated there.
Where the check of a message cannot tell that it is another one, nothing can be promised; such
cases are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
import heapq
from random import Random

from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, NAK
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.plan.bounds import Times
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from support.driver_bench import Recorder
from support.mappings import make_mapping
from support.virtual_line import VirtualLine

# Not those of symbols: where one byte of DLE STX 05 gets lost, DLE 05 is an ENQ.
NEAR, FAR = 9, 7
_TIMEOUT = 0.2
_LATE = 1.3 * _TIMEOUT
_WHOLE_FRAMES = 1000
_MOST_TOLD = 5
_FRAME = 30  # characters of a command or reply besides its data

# What our end is, and the other one.
MODES = {
    'Master': (('Master', 'Message'), ('Slave', 'Message')),
    'Standard': (('Master', 'Standard'), ('Slave', 'Message')),
    'Slave': (('Slave', 'Message'), ('Master', 'Standard')),
    'Peer': (('Peer', 'Message'), ('Peer', 'Message')),
    'Radio': (('Radio', 'Message'), ('Radio', 'Message'))}
CHECKS = 'BCC', 'CRC'
KINDS = 'read', 'two packets', 'write', 'bit', 'unsolicited', 'guest'

LATE = 'late'
_CHANGES: dict[str, Callable[[bytes], bytes]] = {
    'lost': lambda byte: b'', 'doubled': lambda byte: byte + byte, LATE: lambda byte: byte,
    **{f'{after.hex()} after': lambda byte, after=after: byte + after  # type: ignore[misc]
       for after in (b'\0', b'\x10', b'\xFF')},
    **{f'bit {bit}': lambda byte, bit=bit: bytes((byte[0] ^ 1 << bit,))  # type: ignore[misc]
       for bit in range(8)}}
FAULTS = tuple(_CHANGES)

# The replies that a guest gets in place of the PLC's, if its command was not sent, or maybe.
_NOT_SENT, _UNKNOWN = (0x01, 0x04, 0x07, 0x60), (0x02, 0x05)


@dataclass(frozen=True, slots=True)
class Fault:
    """What becomes of byte ``at`` of all that end ``side`` hears: 0 ours, 1 the other."""

    side: int
    at: int
    what: str

    def __str__(self) -> str:
        """Return it in words."""
        return f'{self.what}, byte {self.at} of what {("our", "the other")[self.side]} end hears'


class FaultyLine(VirtualLine):
    """A line between two ends on which single bytes suffer; it knows what was said and heard."""

    def arm(self, faults: tuple[Fault, ...]) -> None:
        """Begin to count bytes, and do this to them."""
        self._faults = {(fault.side, fault.at): fault.what for fault in faults}
        self.said, self.heard = [bytearray(), bytearray()], [bytearray(), bytearray()]
        self.frames: list[tuple[int, int, bytes]] = []  # who hears it, from which byte on
        self._latest = [self.now, self.now]

    def send(self, data: bytes, start: float, receiver: int) -> None:
        """Put bytes on the wire, with the faults."""
        begun, at = len(self.said[receiver]), 0
        self.said[receiver] += data
        self.frames.append((receiver, begun, data))
        piece = b''
        for hit in [hit for hit in range(len(data)) if (receiver, begun + hit) in self._faults]:
            what = self._faults[receiver, begun + hit]
            piece += data[at:hit]
            if what == LATE:
                self._arrive(piece, start + hit * self.char_time, receiver)
                piece, start = b'', start + _LATE
            piece += _CHANGES[what](data[hit:hit + 1])
            at = hit + 1
        self._arrive(piece + data[at:], start + len(data) * self.char_time, receiver)

    def _arrive(self, data: bytes, here: float, receiver: int) -> None:
        self._latest[receiver] = here = max(here, self._latest[receiver])
        self.heard[receiver] += data
        self._count += 1
        if data:
            heapq.heappush(self._arrivals, (here, self._count, receiver, data))

    def is_unseen(self, network: Network) -> bool:
        """
        Tell whether something came through that nobody has sent.

        It is a message with a good check, or to a slave DLE NAK, which resets it (M 2-7).
        """
        is_reset = network.duplex is Duplex.HALF and any(
            self.heard[side].count(NAK) > self.said[side].count(NAK) for side in (0, 1))
        return is_reset or any(set(_messages(network, self.heard[side])) - set(_messages(
            network, self.said[side])) for side in (0, 1))


def _messages(network: Network, data: bytes | bytearray) -> Iterator[tuple[int | None, bytes]]:
    """Yield the messages with a good check, from each beginning that there may be."""
    start = data.find(b'\x10')
    while start >= 0:
        decoder = FrameDecoder(network.checksum, network.duplex)
        decoder.feed(bytes(data[start:]))
        symbol = decoder.next_symbol()
        if isinstance(symbol, Frame) and symbol.fault is None:
            yield symbol.station, symbol.data
        start = data.find(b'\x10', start + 1)


@dataclass(slots=True)
class End:
    """A driver at one end, and what it has told."""

    driver: Driver
    listener: Recorder

    def write(self, row: Mapping, value: float, line: VirtualLine, count: int = 1) -> None:
        """Publish a message on the topic of a row."""
        self.driver.write([row], [value] * count, line.now)
        line.wake(self.driver.machine)


class Bench:
    """Two drivers that carry out one kind of transaction again and again."""

    def __init__(self, mode: str, check: str, kind: str, detects_duplicates: bool = True) -> None:
        self.kind, self.mode = kind, mode
        self._detects_duplicates = detects_duplicates
        near, far = (Network(
            station=station, mode=name, polling=polling, error_code=check, plc_type='SLC',
            baud=38400, timeout=int(1000 * _TIMEOUT), cmd_timeout=500)
            for station, (name, polling) in zip((NEAR, FAR), MODES[mode], strict=True))
        self.network = near
        self.period = 0.4 if mode == 'Radio' else 0.12
        # What comes late is here then, all repetitions of a guest's command are over, and guests
        # have their turn again after one that failed.
        is_quick = self.is_read or mode in ('Standard', 'Slave') and kind != 'guest'
        self.pause = _LATE + 0.05 if is_quick else 3.0
        length = 120 if kind == 'two packets' else 1
        bit = kind == 'bit'
        self.served = make_mapping('N7:0', 'Serve', station=FAR, plc='SLC', length=length)
        self.message = make_mapping('N9:0', 'Write', station=NEAR, plc='SLC')
        self.taken = make_mapping('N9:0', 'Serve', station=NEAR, plc='SLC')
        # A master that has no row to read would not poll for the messages of slaves.
        reads = self.is_read or kind == 'unsolicited'
        self.row = make_mapping(
            'N7:0/3' if bit else 'N7:0', 'Read' if reads else 'Write', station=FAR,
            plc='SLC', length=length, period=int(1000 * self.period) if reads else None)
        self.ends = [self._end(near, (self.row, self.taken)),
                     self._end(far, (self.served, self.message))]
        self.near, self.far = self.ends
        self.line = FaultyLine(*(end.driver.machine for end in self.ends), baud=near.baud,
                               chunk=_WHOLE_FRAMES)
        self.line.arm(())
        self.line.start()
        self.guest = Guest('pty:/tmp/guest', ShareAccess.ALL)
        self.replies: list[Packet] = []
        self.value = 1
        rows, blocks = self.near.driver.mappings, self.near.driver.readings.blocks
        # What is printed as the longest transaction takes turns with our replies.
        self.bound = self.period + (2 if kind == 'two packets' else 1) * (
            Times(near, Rows(rows), blocks).longest + near.line_mode.longest_reply(
                near.line, (2 * length + _FRAME) * self.line.char_time))
        self.line.run_for(0.5)
        if (why := self.carry_out(())) or (why := self.carry_out(())):
            raise AssertionError(f'{mode} {check} {kind}, no fault at all: {why}')
        frames = self.line.frames  # of one transaction
        # Each byte that may suffer, by who hears it; one of the polls of an idle line is enough.
        self.places = [
            (side, begun + at) for number, (side, begun, data) in enumerate(frames)
            if number < 2 or frames[number - 2][::2] != (side, data)
            for at in range(len(data))]

    def _end(self, network: Network, rows: tuple[Mapping, ...]) -> End:
        listener = Recorder(lambda: self.line.now)
        driver = Driver(network, rows, DriverSettings(
            nak_on_command_timeout=False, seed=network.station,
            duplicate_detection=self._detects_duplicates), listener)
        return End(driver, listener)

    @property
    def is_read(self) -> bool:
        """Tell whether the transaction is a read."""
        return self.kind in ('read', 'two packets')

    def case(self, *faults: Fault) -> str:
        """Carry out a transaction with faults, and one without; return what is wrong."""
        why = self.carry_out(faults)
        if why:
            is_unseen = self.line.is_unseen(self.network)
            self.line.run_for(3.0)
            self.far.write(self.served, 0, self.line, self.served.length)
            return f'unseen: {why}' if is_unseen else why
        self.line.run_for(self.pause)
        after = self.carry_out(())
        return f'the next one: {after}' if after else ''

    def carry_out(self, faults: tuple[Fault, ...]) -> str:
        """Carry out a transaction; return what is wrong with it, or nothing."""
        self.value = self.value * 12_345 % 30_011  # a prime number: it is never 0
        if self.is_read:  # none is under way then
            self._forget()
            self.line.run(self._has_ended, self.bound)
        self._forget()
        begun = self.line.now
        if self.is_read:
            self.far.write(self.served, self.value, self.line, self.row.length)
        self.line.arm(faults)
        self._ask()
        try:
            self.line.run(self._has_ended, self.bound)
        except AssertionError:
            return f'it has not ended after {self.line.now - begun:.2f} s'
        self.line.run_for(0.05)
        return self._judge_read() if self.is_read else self._judge_write(
            len(faults) > 1 or self.mode == 'Radio' and self.kind == 'guest')

    def _forget(self) -> None:
        """Forget what both ends have told."""
        for end in self.ends:
            end.listener.reads.clear()
            end.listener.results.clear()
            end.listener.events.clear()
        self.replies.clear()

    def _ask(self) -> None:
        if self.kind in ('write', 'bit'):
            value = self.value % 2 if self.kind == 'bit' else self.value
            self.near.write(self.row, value, self.line)
        elif self.kind == 'unsolicited':
            self.far.write(self.message, self.value, self.line)
        elif self.kind == 'guest':
            data = bytes.fromhex('AA 02 07 89 00 00') + self.value.to_bytes(2, 'little')
            self.near.driver.guests.put(GuestCommand(
                self.guest, Packet(FAR, NEAR, 0x0F, 0, self.value, data), self.line.now,
                self.replies.append))
            self.line.wake(self.near.driver.machine)

    def _has_ended(self) -> bool:
        if self.is_read:
            return bool(self.near.listener.values(self.row))
        if self.kind == 'guest':
            return bool(self.replies)
        return bool((self.far if self.kind == 'unsolicited' else self.near).listener.results)

    def _judge_read(self) -> str:
        expected = [self.value] * self.row.length
        wrong = [values for values in self.near.listener.values(self.row) if values != expected]
        return f'published {wrong[0]}, the PLC had {expected}' if wrong else ''

    def _judge_write(self, may_fail: bool) -> str:
        asked, told = (self.far, self.near) if self.kind == 'unsolicited' else (
            self.near, self.far)
        executed = told.listener.values(self.taken if self.kind == 'unsolicited' else self.served)
        if self.kind == 'guest':
            sts = self.replies[0].sts
            least, most = (1, 1) if sts == 0 else (0, int(sts not in _NOT_SENT))
            outcome = f'STS {sts:02X}'
            is_good = sts == 0
        else:
            result = asked.listener.results[0]
            is_good = result.outcome is Outcome.WRITTEN
            least, most = (1, 1) if is_good else (0, int(result.outcome is Outcome.UNKNOWN))
            outcome = str(result.outcome)
        expected = [(self.value % 2) << 3 if self.kind == 'bit' else self.value]
        if not least <= len(executed) <= most:
            return f'{outcome}, executed {len(executed)} times'
        if any(values != expected for values in executed):
            return f'{outcome}, {executed} instead of {expected}'
        return '' if is_good or may_fail else f'{outcome}, though it could be repeated'


class Tally:
    """The cases of one kind of transaction, and what came of them."""

    def __init__(self, mode: str, check: str, kind: str, detects_duplicates: bool = True) -> None:
        self.name = f'{mode} {check} {kind}'
        self.singles = self.pairs = self.unseen = 0
        self.wrong: list[str] = []
        self._make = partial(Bench, mode, check, kind, detects_duplicates)
        self._bench = self._make()

    def all_singles(self) -> list[Fault]:
        """Return every single fault."""
        return [Fault(*place, what) for place in self._bench.places for what in FAULTS]

    def pair(self, random: Random) -> list[Fault]:
        """Return faults at two places."""
        return [Fault(*place, random.choice(FAULTS))
                for place in random.sample(self._bench.places, 2)]

    def carry_out(self, *faults: Fault) -> None:
        """Carry out a case."""
        self.singles += len(faults) == 1
        self.pairs += len(faults) > 1
        why = self._bench.case(*faults)
        if why.startswith('unseen'):
            self.unseen += 1
        elif why:
            self.wrong.append(f'{self.name}: {" and ".join(map(str, faults))}: {why}')
            self._bench = self._make()

    def __str__(self) -> str:
        """Return a line of a table."""
        return (f'{self.name:<24}{self.singles:>8,} single {self.pairs:>8,} pairs '
                f'{self.unseen:>6,} that no {self.name.split()[1]} can see'
                + ''.join(f'\n  WRONG {why}' for why in self.wrong[:_MOST_TOLD]))
