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

"""Full-duplex peers: one on a scripted line, and two with a virtual line between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import asdict
import math

from abdf1_ros.df1.frames import Duplex, message_frame
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.errors import LinkError
from abdf1_ros.messages import Event

_PRECISION = 6  # digits of a second
_MOST_STEPS = 10_000


class CommandTask:
    """A task that remembers how and when it ended."""

    def __init__(self, command: Packet, clock: Callable[[], float]) -> None:
        self.command = command
        self.sent = False
        self.reply_size = 0
        self.expires = math.inf
        self.blames = True
        self.is_own, self.answer_within = False, math.inf
        self.result: Packet | LinkError | None = None
        self.begun = clock()
        self.ended: float | None = None
        self._clock = clock

    def reply(self, packet: Packet) -> None:
        """Keep the reply."""
        self._end(packet)

    def fail(self, error: LinkError) -> None:
        """Keep the error."""
        self._end(error)

    def _end(self, result: Packet | LinkError) -> None:
        assert self.result is None, f'ended twice: {self.result}, then {result}'
        self.result, self.ended = result, self._clock()

    @property
    def seconds(self) -> float:
        """Return how long it took."""
        assert self.ended is not None
        return self.ended - self.begun


class Recorded:
    """What a link under test has told: events, changes of stations, and its counters."""

    machine: Machine

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.changes: list[tuple[int, bool]] = []

    def change(self, station: Station) -> None:
        """Take note that a station has come or gone."""
        self.changes.append((station.number, station.active))

    def numbers(self) -> list[tuple[object, ...]]:
        """Return number and arguments of every event so far."""
        return [(event.message.number, *event.args) for event in self.events]

    def counts(self) -> dict[str, int]:
        """Return the counters that are not zero, without the characters."""
        return {name: count for name, count in asdict(self.machine.counters).items()
                if count and not name.startswith('chars_')}


class PeerNode(Recorded):
    """A peer with its machine, its tasks, and all that it has done."""

    def __init__(self, settings: LinkSettings, clock: Callable[[], float], *,
                 timing: LineTiming | None = None,
                 serve: Callable[[Packet], Packet] = Packet.reply) -> None:
        super().__init__()
        self.settings = settings
        self.served: list[Packet] = []
        self.tasks: deque[CommandTask] = deque()
        self.stations = ActiveStationList(on_change=self.change)
        self.machine = Machine(
            self._run, checksum=settings.checksum, duplex=Duplex.FULL, timing=timing)
        self.peer = FullDuplexPeer(
            self.machine, settings, self.stations, self._serve, self.events.append)
        self.clock = clock
        self._execute = serve

    def _run(self, machine: Machine) -> Procedure:
        return self.peer.run(self)

    def _serve(self, command: Packet) -> Packet:
        self.served.append(command)
        return self._execute(command)

    def add(self, command: Packet) -> CommandTask:
        """Queue a command."""
        self.stations.add((command.dst,))
        task = CommandTask(command, self.clock)
        self.tasks.append(task)
        return task

    def next_task(self, now: float, busy: Container[int] = ()) -> CommandTask | None:
        if not self.tasks or self.tasks[0].command.dst in busy:
            return None
        task = self.tasks.popleft()
        task.begun = now
        return task

    def next_due(self) -> float:
        """Return infinity: there is something to do when there is."""
        return math.inf


class PeerBench(PeerNode):
    """A peer whose line says what the test tells it."""

    def __init__(self, settings: LinkSettings, timing: LineTiming | None = None,
                 serve: Callable[[Packet], Packet] = Packet.reply) -> None:
        self.now = 99.9
        super().__init__(settings, lambda: self.now, timing=timing, serve=serve)
        self.start()

    def start(self) -> None:
        """Start the machine, and let the pause be over in which late responses may come."""
        self.machine.start(self.now)
        assert self.wait(0.1) == []

    def frame(self, packet: Packet) -> bytes:
        """Return a message as it stands on this line."""
        return message_frame(packet.encode(), self.settings.checksum)

    def begin(self, command: Packet) -> CommandTask:
        """Queue a command, and wake the peer."""
        task = self.add(command)
        self.machine.wake(self.now)
        return task

    def said(self) -> bytes:
        """Return what goes out now."""
        return self.machine.data_to_send()

    def hear(self, *parts: bytes) -> bytes:
        """Let bytes come in, part after part; return what goes out at once."""
        answers = b''
        for part in parts:
            self.machine.receive_data(part, self.now)
            self.machine.handle_timeout(self.now)
            answers += self.said()
        return answers

    def hear_packet(self, packet: Packet) -> bytes:
        """Let a message come in; return what goes out at once."""
        return self.hear(self.frame(packet))

    def wait(self, seconds: float) -> list[tuple[float, bytes]]:
        """Let time pass; return what goes out, each with the time from now."""
        return list(self._wait(seconds))

    def _wait(self, seconds: float) -> Iterator[tuple[float, bytes]]:
        start, end = self.now, self.now + seconds
        for _ in range(_MOST_STEPS):
            deadline = self.machine.next_call
            if deadline is None or deadline > end:
                self.now = end
                return
            self.now = max(self.now, deadline)
            self.machine.handle_timeout(self.now)
            if data := self.said():
                yield round(self.now - start, _PRECISION), data
        raise AssertionError('it runs in circles')


def single_bytes(data: bytes) -> Iterable[bytes]:
    """Return the bytes of ``data`` one by one."""
    return (bytes((byte,)) for byte in data)
