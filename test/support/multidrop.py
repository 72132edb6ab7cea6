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

"""Half-duplex lines with several nodes: masters of both kinds, slaves that ask by themselves."""

from collections import Counter, deque
from collections.abc import Callable, Container, Iterable
from dataclasses import replace
import math
from typing import Any

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Control, Duplex, Frame, FrameDecoder, Poll, Symbol
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure
from abdf1_ros.df1.master import HalfDuplexMaster
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.polling import StandardPollingMaster
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, Initiator, multidrop
from abdf1_ros.df1.slave_link import SlaveLink
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.errors import LinkError
from support.peers import CommandTask, Recorded
from support.virtual_line import char_time, VirtualLine

Serve = Callable[[Packet], Packet]


class CommandTasks(Recorded):
    """Commands that wait for a link."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self.clock = clock
        self.waiting: deque[CommandTask] = deque()
        self.all: list[CommandTask] = []

    def add(self, command: Packet) -> CommandTask:
        """Queue a command."""
        task = CommandTask(command, self.clock)
        self.waiting.append(task)
        self.all.append(task)
        return task

    def next_task(self, now: float, busy: Container[int] = ()) -> CommandTask | None:
        """Return the next command for a station that is not busy."""
        for task in self.waiting:
            if task.command.dst not in busy:
                self.waiting.remove(task)
                return task
        return None

    def next_due(self) -> float:
        """Return infinity: there is something to do when there is."""
        return math.inf


class Told(Machine):
    """A machine that keeps what it has put on the line, as symbols with their time."""

    def __init__(self, procedure: Callable[[Machine], Procedure], settings: LinkSettings,
                 timing: LineTiming | None) -> None:
        super().__init__(procedure, checksum=settings.checksum, timing=timing, forget_on_send=True)
        self.log: list[tuple[float, str]] = []
        self.sent: list[bytes] = []
        self._reader = FrameDecoder(settings.checksum, Duplex.HALF)

    def data_to_send(self) -> bytes:
        """Return the bytes to put on the line, and note them."""
        data = super().data_to_send()
        if data:
            self.sent.append(data)
        self._reader.feed(data)
        while (symbol := self._reader.next_symbol()) is not None:
            self.log.append((self.now, _text(symbol)))
        return data


def _text(symbol: Symbol) -> str:
    """Return "P3" for a poll of 3, "C3" and "R3" for a command and a reply to it, or "ACK"."""
    if isinstance(symbol, Poll):
        return f'P{symbol.station}'
    if isinstance(symbol, Frame):
        return f'{"R" if Packet.decode(symbol.data).is_reply else "C"}{symbol.station}'
    assert isinstance(symbol, Control)
    return symbol.code.name


class MasterNode(CommandTasks):
    """A master with message-based polling, or with the standard one where ``polling`` is given."""

    machine: Told

    def __init__(self, settings: LinkSettings, clock: Callable[[], float],
                 polling: PollingSettings | None = None, *, numbers: Iterable[int] = (),
                 timing: LineTiming | None = None, serve: Serve | None = Packet.reply) -> None:
        super().__init__(clock)
        self.served: list[Packet] = []
        self.stations = ActiveStationList(numbers, self.change)
        self.machine = Told(lambda machine: self.link.run(self), settings, timing)
        served = None if serve is None else self.serve
        self.execute = serve
        self.link: HalfDuplexMaster | StandardPollingMaster
        if polling is None:
            self.link = HalfDuplexMaster(
                self.machine, settings, self.stations, served, self.events.append)
        else:
            self.link = StandardPollingMaster(
                self.machine, replace(settings, polling=polling), self.stations,
                served, self.events.append)

    def serve(self, command: Packet) -> Packet:
        self.served.append(command)
        assert self.execute is not None
        return self.execute(command)

    @property
    def said(self) -> str:
        """Return what it has sent so far, without the ACKs."""
        return ' '.join(text for _, text in self.machine.log if text != 'ACK')

    def times(self, text: str) -> list[float]:
        """Return when it has sent this."""
        return [when for when, entry in self.machine.log if entry == text]


class Slave(Initiator):
    """
    A station on the line of a test.

    It is dead while ``silent``, deaf to commands while ``deaf``, and has a reply ready
    ``delay`` s after the command. ``outbox`` holds commands of its own, ``heard`` the replies
    to them.
    """

    def __init__(self, number: int, clock: Callable[[], float], serve: Serve = Packet.reply,
                 queue_size: int = 4, retries: int = 3) -> None:
        self.number = number
        self.silent = self.deaf = False
        self.delay = 0.0
        self.outbox: deque[Packet] = deque()
        self.served: list[Packet] = []
        self.heard: list[Packet] = []
        self.polls = 0
        self._clock = clock
        self.execute = serve
        self._ready = 0.0
        self.slave = HalfDuplexSlave(
            LinkSettings(station=number, queue_size=queue_size, nak_retries=retries), self.serve,
            initiator=self)

    def handle(self, symbol: Symbol) -> bytes:
        """Answer, if it is alive."""
        if isinstance(symbol, Poll) and symbol.station == self.number:
            self.polls += 1
            if not self.silent and self._clock() < self._ready:
                return frames.EOT
        is_command = isinstance(symbol, Frame) and symbol.station == self.number
        if self.silent or (self.deaf and is_command):
            return b''
        return self.slave.handle(symbol)

    def serve(self, command: Packet) -> Packet:
        self.served.append(command)
        self._ready = self._clock() + self.delay
        return self.execute(command)

    def polled(self) -> None:
        """Do nothing."""

    def next_command(self) -> Packet | None:
        """Return a command of its own."""
        return self.outbox.popleft() if self.outbox else None

    def delivered(self, command: Packet) -> None:
        """Do nothing."""

    def undelivered(self, command: Packet, error: LinkError) -> None:
        """Do nothing."""

    def replied(self, reply: Packet) -> None:
        """Keep a reply."""
        self.heard.append(reply)


class MasterBench:
    """A master and ``Slave``s on a line without noise; frames arrive whole."""

    def __init__(self, *numbers: int, settings: LinkSettings,
                 polling: PollingSettings | None = None, serve: Serve | None = Packet.reply,
                 baud: float = 19200, dead: Iterable[int] = (), retries: int = 3,
                 tx_delay: float = 0.0) -> None:
        self.slaves = {number: Slave(number, self.clock, retries=retries) for number in numbers}
        for number in dead:
            self.slaves[number].silent = True
        self.master = MasterNode(settings, self.clock, polling, numbers=numbers, serve=serve,
                                 timing=LineTiming(char_time(baud), tx_delay))
        self._there = [*self.slaves.values()]
        self.far = Machine(multidrop(self._there), checksum=settings.checksum)
        self.line = VirtualLine(self.master.machine, self.far, baud=baud, chunk=1000)
        self._tns = 0x0100

    def clock(self) -> float:
        return self.line.now

    def put(self, number: int) -> None:
        """Put one more station on the line, which is in no list of the master."""
        self.slaves[number] = Slave(number, self.clock)
        self._there.append(self.slaves[number])

    def __getitem__(self, number: int) -> Slave:
        return self.slaves[number]

    def ask(self, number: int, master: int = 5, cmd: int = 0x0F, run: float = 0.0) -> CommandTask:
        """Queue a command of the master; let so many seconds pass."""
        self._tns += 1
        task = self.master.add(Packet(number, master, cmd, 0, self._tns, b'\x68'))
        self.line.wake(self.master.machine)
        if run:
            self.run(run)
        return task

    def message(self, src: int, dst: int) -> Packet:
        """Let a slave send a command of its own."""
        self._tns += 1
        command = Packet(dst, src, 0x0F, 0, self._tns, b'\x67')
        self.slaves[src].outbox.append(command)
        return command

    def start(self, *inactive: int, run: float = 0.0) -> None:
        """Start both ends, the master knows some stations as inactive; let seconds pass."""
        for number in inactive:
            self.master.stations.lost(number, 0.0)
        self.master.changes.clear()
        self.line.start()
        if run:
            self.run(run)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.line.run_for(seconds)

    def forget(self) -> None:
        """Forget what the master has said."""
        self.master.machine.log.clear()
        self.master.machine.sent.clear()


class SlaveNode(CommandTasks):
    """A slave that is a driver of its own, on a machine of its own."""

    def __init__(self, settings: LinkSettings, clock: Callable[[], float], *,
                 serve: Serve = Packet.reply, timing: LineTiming | None = None) -> None:
        super().__init__(clock)
        assert settings.station is not None
        self.number = settings.station
        self.settings = settings
        self.served: list[Packet] = []
        self.executed: Counter[tuple[int, int]] = Counter()
        self.replies: dict[tuple[int, int], Packet] = {}
        self.execute = serve
        self.stations = ActiveStationList()
        self.machine = Machine(lambda machine: self.link.run(self), checksum=settings.checksum,
                               timing=timing)
        self.link = SlaveLink(
            self.machine, settings, self.stations, self.serve, self.events.append)

    def serve(self, command: Packet) -> Packet:
        reply = self.execute(command)
        self.served.append(command)
        self.executed[command.src, command.tns] += 1
        self.replies[command.src, command.tns] = reply
        return reply


class SlaveBench(SlaveNode):
    """A slave whose line says what the test tells it."""

    def __init__(self, settings: LinkSettings, *, serve: Serve = Packet.reply,
                 timing: LineTiming | None = None, **others: Any) -> None:
        self.now = 100.0
        super().__init__(replace(settings, **others), lambda: self.now, serve=serve, timing=timing)
        self.machine.start(self.now)

    def hear(self, *data: bytes) -> bytes:
        """Return what the slave says to these."""
        answer = b''
        for part in data:
            self.machine.receive_data(part, self.now)
            self.machine.handle_timeout(self.now)
            answer += self.machine.data_to_send()
        return answer

    def poll(self) -> bytes:
        return self.hear(frames.poll_frame(self.number))

    def frame(self, packet: Packet, station: int | None = None) -> bytes:
        """Return a message of the master to it."""
        number = self.number if station is None else station
        return frames.master_frame(number, packet.encode(), self.settings.checksum)

    def own(self, packet: Packet) -> bytes:
        """Return a message of its own as it stands on the line."""
        return frames.message_frame(packet.encode(), self.settings.checksum)

    def wait(self, seconds: float) -> None:
        """Let time pass in silence; the slave says nothing by itself."""
        end = self.now + seconds
        while (due := self.machine.next_call) is not None and due <= end:
            self.now = max(self.now, due)
            self.machine.handle_timeout(self.now)
            assert self.machine.data_to_send() == b''
        self.now = end

    def listen(self, seconds: float, data: bytes, pause: float) -> None:
        """Let it hear the same again and again, as on a line where others talk."""
        end = self.now + seconds
        while self.now < end:
            self.now += pause
            assert self.hear(data) == b''
