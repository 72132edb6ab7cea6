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

"""A half-duplex master on a scripted line: what it has to send, and what it gets for it."""

from __future__ import annotations

from dataclasses import dataclass, fields

from abdf1_ros.df1.machine import LineTiming, Machine, Procedure, Rest
from abdf1_ros.df1.master import HalfDuplexMaster
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.errors import LinkError
from support.peers import CommandTask, Recorded

_JUST_BEFORE = 1e-6


@dataclass(frozen=True, slots=True)
class Expect:
    """Exactly these bytes go out, ``after`` seconds from now and not earlier."""

    data: bytes
    after: float = 0.0


@dataclass(frozen=True, slots=True)
class Answer:
    """These bytes come in, ``after`` seconds from now, before the master's patience ends."""

    data: bytes
    after: float = 0.0


@dataclass(frozen=True, slots=True)
class Murmur(Answer):
    """Bytes that keep a listening master from speaking, whatever its patience with each wait."""


@dataclass(frozen=True, slots=True)
class Silence:
    """Nothing comes in for exactly ``seconds``; then the master's patience ends."""

    seconds: float


class MasterScript(Recorded):
    """A master whose line says what a script tells it; ``task`` is the last one."""

    task: CommandTask

    def __init__(self, settings: LinkSettings, timing: LineTiming | None = None,
                 routes: dict[int, int] | None = None) -> None:
        super().__init__()
        self.now = 100.0
        self.stations = ActiveStationList(on_change=self.change, routes=routes)
        self.machine = Machine(self._procedure, checksum=settings.checksum, timing=timing,
                               forget_on_send=True)
        self.master = HalfDuplexMaster(
            self.machine, settings, self.stations, report=self.events.append)
        self._result: Packet | LinkError | None = None
        self._sent = self._received = 0
        self._started = False

    def _procedure(self, machine: Machine) -> Procedure:
        while True:
            if self._result is None:
                yield from self.master.carry_out(self.task)
                self._result = self.task.result
            yield Rest()

    def run(self, command: Packet, *script: Expect | Answer | Silence) -> Packet | LinkError:
        """Carry out one transaction and return its reply or its error."""
        self.begin(command, *script)
        assert self._result is not None, 'the script ends before the transaction'
        assert self.machine.data_to_send() == b'', 'the master says more than the script'
        assert self.machine.counters.chars_sent == self._sent
        assert self.machine.counters.chars_received == self._received
        return self._result

    def begin(self, command: Packet, *script: Expect | Answer | Silence) -> None:
        """Carry out the first part of a transaction."""
        self.task, self._result = CommandTask(command, lambda: self.now), None
        self.stations.add((command.dst,))
        if not self._started:
            self._started = True
            self.machine.start(self.now)
        else:
            self.machine.wake(self.now)
        for step in script:
            self.step(step)

    def step(self, step: Expect | Answer | Silence) -> None:
        """Carry out a part of a script."""
        if isinstance(step, Expect):
            self._expect(step)
        elif isinstance(step, Answer):
            assert self.machine.data_to_send() == b'', 'the master says more than the script'
            self.now += step.after
            if isinstance(step, Murmur):
                self.machine.handle_timeout(self.now)
                assert self.machine.data_to_send() == b'', 'the master does not listen on'
            assert self.machine.deadline is None or self.now < self.machine.deadline
            self._received += len(step.data)
            self.machine.receive_data(step.data, self.now)
        else:
            self._pass_time(step.seconds)

    def _expect(self, step: Expect) -> None:
        if step.after:
            self._pass_time(step.after)
        self._sent += len(step.data)
        sent = self.machine.data_to_send()
        assert sent == step.data, f'{sent.hex(" ")} instead of {step.data.hex(" ")}'

    def _pass_time(self, seconds: float) -> None:
        early = self.now + seconds - _JUST_BEFORE
        self.machine.handle_timeout(early)
        assert self.machine.data_to_send() == b'', 'the master says something too early'
        deadline = self.machine.deadline
        assert deadline is not None and abs(deadline - self.now - seconds) < _JUST_BEFORE
        self.now = deadline
        self.machine.handle_timeout(self.now)

    def forget(self) -> None:
        """Set events, changes and counters back to nothing."""
        self.events.clear()
        self.changes.clear()
        for counter in fields(self.machine.counters):
            setattr(self.machine.counters, counter.name, 0)
        self._sent = self._received = 0
