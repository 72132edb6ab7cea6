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
Topics that are published at a rate, with values that repeat, in every type.

Whatever was published before, at any rate and by any number of publishers: after the last message
of a topic the words hold it, each message has one result, and that is true.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby, takewhile
from operator import itemgetter
from random import Random
from typing import Any

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from support.driver_bench import DriverBench
from support.mappings import make_mapping

MODES: tuple[dict[str, str], ...] = ({}, {}, {'polling': 'Standard'}, {'mode': 'Peer'})
PATIENCE = 2.0  # s
_WRITES = (b'\x67', b'\xAA', b'\x26')  # functions of a typed write, and of a masked one

Message = tuple[float, ...] | str

# What two or three values of a row are; those of one letter share words.
KINDS: dict[str, tuple[str, dict[str, object], tuple[Message, ...]]] = {
    'bit': ('B3:0/3', {}, ((0,), (1,))),
    'other bit': ('B3:0/4', {'command': 'ReadWrite'}, ((0,), (1,))),
    'bits': ('B3:1/5', {'length': 20}, ((0,) * 20, (1,) * 20, (1, 0) * 10)),
    'word': ('N7:0', {}, ((3,), (4,))),
    'words': ('N7:2', {'length': 3}, ((1, 2, 3), (4, 5, 6))),
    'both words': ('N7:2', {'length': 8}, ((7,) * 8, (8,) * 8)),
    'held': ('N7:20', {'fallback': Fallback((9,), 60_000)}, ((1,), (2,), (3,))),
    'float': ('F8:0', {'command': 'ReadWrite'}, ((0.5,), (-0.5,))),
    'text': ('ST9:0', {}, ('on', 'off')),
}


# What is read where rows have Write_Again.
_READ = (('B3:0', 4), ('N7:0', 24), ('ST9:0', 1))


@dataclass(slots=True)
class Said:
    """A message to a row, and what came of it."""

    when: float
    message: Message
    results: list[WriteResult] = field(default_factory=list)


def _cells(name: str) -> dict[str, Any]:
    return {'command': 'Write', 'plc': 'PLC5'} | KINDS[name][1]


def within(entries: list[tuple[float, bytes]], since: float, until: float,
           ) -> list[tuple[float, bytes]]:
    """Return what was from one time to another, of entries in their order."""
    return entries[bisect_left(entries, since, key=itemgetter(0)):
                   bisect_right(entries, until, key=itemgetter(0))]


class Steady(DriverBench):
    """A line with such topics."""

    def __init__(self, seed: int) -> None:
        self._dice = dice = Random(seed)
        mode = dice.choice(MODES)
        self._names = dice.sample([*KINDS], dice.randrange(2, 7))
        self.rows: dict[str, Mapping] = {
            name: make_mapping(KINDS[name][0], tag=name, **_cells(name)) for name in self._names}
        self._is_light = dice.random() < 0.5
        if dice.random() < 0.5:  # an unchanged value is written again only now and then
            again, period = dice.choice([300, 1000, 60_000]), dice.choice([50, 200])
            self.rows = {
                name: replace(row, write_again=again) for name, row in self.rows.items()}
            reads = [make_mapping(place, length=length, tag=place, period=period)
                     for place, length in _READ]
        else:
            reads = []
        super().__init__([*self.rows.values(), *reads], network=Network(
            baud=dice.choice([9600, 19200]), timeout=200, **mode),  # type: ignore[arg-type]
            settings=DriverSettings(processor_period=0.0, write_timeout=PATIENCE))
        areas = ('B3:0', 4), ('N7:0', 24), ('F8:0', 4), ('ST9:0', 42)
        self._plc = self.plc(1, 'PLC5', *areas)
        self._plc.faults.delay = 0.0 if mode.get('mode') else dice.choice([0.0, 0.02])
        # What the PLC has shown to a read.
        self.shown: defaultdict[str, list[tuple[float, bytes]]] = defaultdict(list)
        self._watch(self._plc)
        self.said: defaultdict[str, list[Said]] = defaultdict(list)
        self.held: defaultdict[str, list[tuple[float, bytes]]] = defaultdict(list)

    def _watch(self, plc: SimulatedPlc) -> None:
        serve = plc.serve

        def execute(command: Packet) -> Packet:
            if command.data[:1] not in _WRITES:
                return self._read_out(serve, command)
            reply = serve(command)
            for name in self._names:
                self.held[name].append((self.clock(), self._words(name)))
            return reply

        plc.serve = execute  # type: ignore[method-assign]
        plc.slave = HalfDuplexSlave(
            LinkSettings(station=1, checksum=self.network.checksum), execute)

    def _read_out(self, serve: Callable[[Packet], Packet], command: Packet) -> Packet:
        """Execute a command that is no write; keep what it has read of the rows."""
        table, found = self._plc.table, list[Extent]()
        read = table.read

        def note(address: Address, words: int) -> bytes:
            found.append(Extent(1, address.area, address.offset, address.offset + words))
            return read(address, words)

        table.read = note  # type: ignore[method-assign]
        reply = serve(command)
        del table.read
        for name in self._names:
            if any(extent.holds(self.rows[name].extent) for extent in found):
                self.shown[name].append((self.clock(), self._words(name)))
        return reply

    def _words(self, name: str) -> bytes:
        """Return what the PLC holds of a row; of bits only these."""
        row = self.rows[name]
        words = self._plc.table.read(row.address, row.codec.words)
        values = row.codec.decode(words)
        return values.encode() if isinstance(values, str) else bytes(str([*values]), 'ascii')

    def _wanted(self, name: str, message: Message) -> bytes:
        row = self.rows[name]
        if isinstance(message, str):
            return message.encode()
        return bytes(str([*row.codec.decode(row.codec.encode(message))]), 'ascii') \
            if row.address.bit is None else bytes(str([*map(int, message)]), 'ascii')

    def _say(self, name: str, message: Message) -> None:
        number = len(self.said[name])
        self.said[name].append(Said(self.clock(), message))
        values = message if isinstance(message, str) else [*message]
        self.driver.write([self.rows[name]], values, self.clock(), str(number))
        self.line.wake(self.driver.machine)

    def _publish(self, name: str, seconds: float) -> None:
        """Let one publisher go on for so long, with changes now and then, or all the time."""
        dice = self._dice
        rate = dice.choice([2, 10, 50, 200]) * dice.uniform(0.9, 1.1)
        pause = 2.0 * len(self._names) if self._is_light else 1 / rate
        values = KINDS[name][2]
        chosen, changed = dice.choice(values), self.clock()
        for number in range(int(seconds * rate)):
            when = self.clock() + number / rate
            if when >= changed + pause:
                chosen, changed = dice.choice(values), when
            self.at(when, partial(self._say, name, chosen))

    def fault(self) -> str:
        """Publish for a while and stop; return what does not hold then, empty if all does."""
        self.run(1.0)
        for name in self._names:
            for _ in range(1 if self._is_light else self._dice.randrange(1, 4)):
                self._publish(name, self._dice.uniform(2.0, 6.0))
        self.run(6.0 + PATIENCE + 0.5)
        for result in self.listener.results:
            if result.outcome is not Outcome.FALLBACK:
                self.said[result.mapping.tag][int(result.request)].results.append(result)
        return next(filter(None, (
            self._wrong_result(name) or self._wrong_end(name) or self._wrong_order(name)
            for name in self._names)), '')

    def _wrong_result(self, name: str) -> str:
        """Return that a message has no result, two, or one that is not true."""
        for number, each in enumerate(self.said[name]):
            if len(each.results) != 1:
                return f'message {number} of {name} has {len(each.results)} results'
            result, = each.results
            ended, wanted = each.when + result.latency, self._wanted(name, each.message)
            held = within(self.held[name], each.when, ended)
            if result.outcome is Outcome.WRITTEN and wanted not in [words for _, words in held]:
                return f'{name}: {result} at {ended:.3f} s, but nothing was executed'
            if result.outcome is Outcome.STANDS:
                if text := self.why_unproven(name, wanted, ended):
                    return f'{name}: {result} at {ended:.3f} s, but {text}'
                continue
            may_give_way = not self._is_light or self.rows[name].address.bit is None
            if result.outcome is not Outcome.WRITTEN and not (
                    result.outcome is Outcome.SUPERSEDED and may_give_way):
                return f'{name}: {result}, on a line without a fault'
        return ''

    def why_unproven(self, name: str, wanted: bytes, now: float) -> str:
        """Return why a value that is told to stand had to be written (27)."""
        row = self.rows[name]
        again = (row.write_again or 0) / 1000
        held = within(self.held[name], -1.0, now)
        stood = [when for when, words in takewhile(lambda entry: entry[1] == wanted, held[::-1])]
        if not stood:
            return 'the PLC holds another value'
        patience = row.fallback.after / 1000 if row.fallback else PATIENCE
        since = max(stood[-1], now - min(again, patience))
        if not any(since < when and words == wanted
                   for when, words in within(self.shown[name], since, now)):
            return f'no read has shown it since {since:.3f} s'
        confirmed = max((each.when + result.latency for each in self.said[name]
                         for result in each.results if result.outcome is Outcome.WRITTEN
                         and each.when + result.latency <= now), default=-1.0)
        return '' if confirmed > now - again else f'it was confirmed at {confirmed:.3f} s'

    def _wrong_end(self, name: str) -> str:
        """Return that the words do not hold the newest message of all rows that share them."""
        sharing = [other for other in self._names
                   if self.rows[other].shares_words(self.rows[name]) and self.said[other]]
        newest = max(sharing, key=lambda other: self.said[other][-1].when, default='')
        if newest != name:
            return ''
        last = self.said[name][-1]
        is_held = self._words(name) == self._wanted(name, last.message)
        return '' if is_held else f'{name}: the message of {last.when:.3f} s is not held'

    def _wrong_order(self, name: str) -> str:
        """Return that a change of bits is missing on a line that can carry all."""
        if not self._is_light or self.rows[name].address.bit is None or not self.said[name]:
            return ''
        changes = [words for words, _ in groupby(
            self._wanted(name, each.message) for each in self.said[name])]
        # Between two packets of a write the bits are partly new.
        shown = (words for when, words in self.held[name] if when >= self.said[name][0].when)
        is_right = all(words in shown for words in changes)
        return '' if is_right else f'{name}: not each change was written, in its order'
