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
The conversations of vectors/conversations.json, and the node that plays one of them.

The codec of conform and the sniffer hear them, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, MAX_LINK_DATA
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.modes import mode_of
from abdf1_ros.df1.packet import BROADCAST, Packet, REPLY_BIT
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.errors import LinkError
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
from support.multidrop import CommandTasks
from support.peers import CommandTask
from support.vectors import load_json

Line = dict[str, Any]
_NO_LINE: Line = {}

_MS = ('timeout', 'cmd_timeout', 'poll_pause', 'poll_timeout')
_OF_THE_RUN = ('char_time', 'tx_delay', 'inactive', 'routes', 'running')
_BEGIN = 100.0  # s on the clock
_PRECISION = 1e-6  # s
_MOST_STEPS = 10_000


@dataclass(frozen=True, slots=True)
class Conversation:
    """One conversation, as vectors/README.md explains it; ``settings`` with those of its mode."""

    entry: dict[str, Any]
    mode: LineMode
    settings: dict[str, Any]

    @property
    def name(self) -> str:
        return str(self.entry['name'])

    @property
    def lines(self) -> list[Line]:
        """Return what is said and done, in the order of the times."""
        lines: list[Line] = self.entry['lines']
        return lines

    @property
    def checksum(self) -> Checksum:
        """Return the check of its messages."""
        return Checksum(self.entry['check'])

    def said(self) -> Iterator[tuple[Line, bytes]]:
        """Yield the lines that are on the wire, each with its bytes."""
        for line in self.lines:
            for side in line.keys() & {'we', 'they'}:
                yield line, bytes.fromhex(line[side])

    def size_of(self, side: str) -> int:
        """Return how many bytes are said by ``we`` or ``they``."""
        return sum(len(data) for line, data in self.said() if side in line)

    def link_settings(self) -> LinkSettings:
        given: dict[str, Any] = {
            name: value / 1000 if name in _MS else value
            for name, value in self.settings.items() if name not in _OF_THE_RUN}
        polling = given.pop('polling', None)
        if polling is not None:
            lists: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value
                                     for name, value in polling.items()}
            polling = PollingSettings(**lists)
        return LinkSettings(
            **given, polling=polling, checksum=self.checksum,
            timing=LineTiming(self.settings.get('char_time', 0.0) / 1000,
                              self.settings.get('tx_delay', 0.0) / 1000))


def make_conversation(entry: dict[str, Any], defaults: dict[str, Any]) -> Conversation:
    """Return a conversation; ``defaults`` are the settings by mode."""
    mode = entry['mode']
    names = ('Master', 'Standard') if mode == 'Standard polling' else (mode, 'Message')
    return Conversation(entry, mode_of(*names), defaults[mode] | entry.get('settings', {}))


def _load() -> tuple[Conversation, ...]:
    content = load_json('conversations.json')
    return tuple(make_conversation(entry, content['settings'])
                 for entry in content['conversations'])


CONVERSATIONS = _load()


class Player(CommandTasks):
    """
    A node of any mode that has its part in a conversation.

    ``done`` becomes the lines of what is done to it, and of all that it does. With ``is_new`` it
    is made anew where its port is opened again.
    """

    def __init__(self, conversation: Conversation, *, is_new: bool = False) -> None:
        self._is_new = is_new
        self._now = _BEGIN - conversation.settings.get('running', 0) / 1000
        super().__init__(lambda: self._now)
        self.done: list[Line] = []
        self._conversation = conversation
        options = conversation.settings
        self.stations = ActiveStationList(
            on_change=self._changed,
            routes={int(number): by for number, by in options.get('routes', {}).items()})
        for number in options.get('inactive', ()):
            self.stations.lost(number, self._now)
        self.done.clear()
        self._make_link()

    def _make_link(self) -> None:
        mode, settings = self._conversation.mode, self._conversation.link_settings()
        self.machine = mode.make_machine(settings, lambda: self._link.run(self), Counters())
        self._link = mode.make_link(
            self.machine, settings, self.stations, self._serve, self.events.append)

    def play(self) -> None:
        """Do what is done to the node, each at its time, and let it act until the end."""
        self.machine.start(self._now, self)
        self._take()
        entry, lines = self._conversation.entry, self._conversation.lines
        for line in lines:
            if not line.keys().isdisjoint(('asks', 'they', 'port')):
                self._pass_time(line['at'])
                self.done.append(line)
                self._do(line)
                self._take()
        self._pass_time(end_of(lines[-1]) if 'until' not in entry else entry['until'])

    def _do(self, line: Line) -> None:
        if 'they' in line:
            self.machine.receive_data(bytes.fromhex(line['they']), self._now)
            self.machine.handle_timeout(self._now)
        elif 'asks' in line:
            command = Packet.decode(bytes.fromhex(line['asks']))
            self.stations.add((command.dst,))
            self._watch(self.add(command))
            self.machine.wake(self._now)
        else:
            if self._is_new:
                self.machine.stop(None, self._now)
                self._make_link()
            self.machine.start(self._now, self)

    def _watch(self, task: CommandTask) -> None:
        """Note the end of a command when it comes."""
        reply, fail = task.reply, task.fail

        def replied(packet: Packet) -> None:
            if task.command.dst == BROADCAST:
                self._note(ends=task.command.tns)
            else:
                self._note(gets=_hex(packet.encode()))
            reply(packet)

        def failed(error: LinkError) -> None:
            self._note(fails=error.message.number, tns=task.command.tns, sent=task.sent)
            fail(error)

        task.reply, task.fail = replied, failed  # type: ignore[method-assign]

    def _pass_time(self, at: float) -> None:
        end = _BEGIN + at / 1000
        for _ in range(_MOST_STEPS):
            call = self.machine.next_call
            if call is None or call > end + _PRECISION:
                self._now = max(self._now, end)
                return
            self._now = max(self._now, call)
            self.machine.handle_timeout(self._now)
            self._take()
        raise AssertionError('it runs in circles')

    def _take(self) -> None:
        if data := self.machine.data_to_send():
            self.write(data)

    def write(self, data: bytes) -> None:
        """Take what leaves at once, as a port does."""
        self._note(we=_hex(data))

    def unsent(self) -> int:
        """Return 0: what is written has left."""
        return 0

    def _serve(self, command: Packet) -> Packet:
        self._note(executes=_hex(command.encode()))
        return command.reply()

    def _changed(self, station: Station) -> None:
        self._note(station=station.number, active=station.active)

    def _note(self, **what: Any) -> None:
        self.done.append({'at': round((self._now - _BEGIN) * 1000, 3), **what})

    def story(self) -> list[Line]:
        """Return what was done and is to be compared, with the times of the conversation."""
        return [self._compared(done, line) for done, line in zip_longest(
            self.done, expected(self._conversation), fillvalue=_NO_LINE) if done]

    @staticmethod
    def _compared(done: Line, line: Line) -> Line:
        at, by = done['at'], end_of(line) if line else 0.0
        if line and line['at'] - _PRECISION <= at <= by + _PRECISION:
            done = {**done, **{name: line[name] for name in ('at', 'by') if name in line}}
        return {name: value for name, value in done.items() if name != 'says'}


def end_of(line: Line) -> float:
    """Return when the last moment of a line is."""
    return float(line['by'] if 'by' in line else line['at'])


def begun_again(conversation: Conversation, cut: int) -> Conversation:
    """Return the first lines of a conversation, the port opened again, and then all of it."""
    entry, lines = conversation.entry, conversation.lines
    end = end_of(lines[cut - 1])
    until = end + 999 + end_of(lines[-1])
    lines = [*lines[:cut], {'at': end + 1, 'port': 'again'}, *(
        {**line, 'at': line['at'] + end + 150} for line in lines)]
    return replace(conversation, entry=entry | {'lines': lines, 'until': until})


def played(name: str) -> Player:
    """Play the conversation of that name; return the node that has played it."""
    player = Player(next(entry for entry in CONVERSATIONS if entry.name == name))
    player.play()
    return player


def expected(conversation: Conversation) -> list[Line]:
    """Return the lines of a conversation, without what explains them."""
    return [{name: value for name, value in line.items() if name != 'says'}
            for line in conversation.lines]


def _hex(data: bytes) -> str:
    return data.hex(' ').upper()


_PAUSE = 150  # ms that end what has broken off
_PART = 'part of a message'
_AGAIN = {Mark.RETRANSMISSION, Mark.DUPLICATE, Mark.FORWARDED}


def said_by_codec(conversation: Conversation) -> Iterator[tuple[Line, list[str]]]:
    """Yield what the codec of conform reads in each line."""
    check = codec.BlockCheck(conversation.entry['check'])
    is_half = conversation.mode.duplex is Duplex.HALF
    begun = {'we': (b'', 0, 0.0), 'they': (b'', 0, 0.0)}  # bytes, responses inside, time
    for line, data in conversation.said():
        side = 'we' if 'we' in line else 'they'
        buffer, told, last = begun[side]
        if line['at'] - last > _PAUSE:
            buffer, told = b'', 0
        buffer, words = buffer + data, []
        while (symbol := codec.next_symbol(buffer, check, is_half)) is not None:
            buffer = buffer[len(symbol.raw):]
            words += [*(kind.value for kind in symbol.embedded[told:]), _word(symbol)]
            told = 0
        # What a message has inside when it breaks off here.
        begin = codec.next_symbol(buffer + b'\x10\x03\0\0', check, is_half)
        inside = begin.embedded if begin else ()
        words += [_PART] * bool(buffer) + [kind.value for kind in inside[told:]]
        begun[side] = buffer, len(inside), line['at']
        yield line, words


def _word(symbol: Symbol) -> str:
    if symbol.kind is SymbolKind.NOISE:
        return 'noise'
    if symbol.kind is SymbolKind.POLL:
        return 'poll' if symbol.is_good else 'damaged poll'
    if symbol.kind not in (SymbolKind.MESSAGE, SymbolKind.MASTER_MESSAGE):
        return str(symbol.kind.value)
    if not symbol.is_good:
        return 'damaged'
    if not codec.HEADER_SIZE <= len(symbol.data) <= MAX_LINK_DATA:
        return 'too short' if len(symbol.data) < codec.HEADER_SIZE else 'too long'
    return 'reply' if symbol.data[2] & REPLY_BIT else 'command'


def heard_by_sniffer(conversation: Conversation) -> list[tuple[str, Entry]]:
    """Return what the sniffer hears, and who has said it."""
    decoder = TrafficDecoder(conversation.checksum, conversation.mode.duplex)
    sides = {Direction.OUT: 'we', Direction.IN: 'they', Direction.UNKNOWN: ''}
    heard = [entry for line, data in conversation.said() for entry in decoder.feed(Chunk(
        line['at'] / 1000, Direction.OUT if 'we' in line else Direction.IN, data))]
    return [(sides[entry.direction], entry) for entry in (*heard, *decoder.finish())]


def said_by_sniffer(conversation: Conversation) -> Iterator[tuple[str, str]]:
    """Yield who says what, as the sniffer hears it, but for what is no symbol."""
    for side, entry in heard_by_sniffer(conversation):
        if entry.kind in (Kind.ACK, Kind.NAK, Kind.EOT, Kind.ENQ):
            yield side, f'DLE {entry.kind.value}'
        elif entry.kind in (Kind.POLL, Kind.COMMAND, Kind.REPLY, Kind.DAMAGED):
            again = ' again' * bool(_AGAIN & {*entry.marks})
            is_bad_poll = entry.kind is Kind.POLL and not entry.valid
            yield side, 'damaged ' * is_bad_poll + entry.kind.value + again
