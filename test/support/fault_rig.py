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
The node, the simulator, and a box between them that spoils their line.

The tests of a module share a rig, made anew after a test that has failed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, ExitStack
from pathlib import Path
import signal
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from std_msgs.msg import Float32MultiArray, Int16MultiArray
from support.fault_box import FaultBox
from support.ros import EVERYTHING, Observer, Process, ros_args, until_status, values_in
from support.simulator_process import Files, IMPATIENT_ROW, make_files, OFTEN

SPEEDS = (1200, -800)  # of station 1
SETPOINT = 21.5  # of station 2

# What results begin with.
UNKNOWN = 'unknown whether written: '
NOT_SENT = 'not written: not sent: '
NO_ANSWER = '2509 ERR_INACTIVE_STATION: Slave Station (2) Inactive'


def is_unanswered(result: str) -> bool:
    """
    Tell whether a write had no answer of station 2.

    What was on its way when the fault began decides whether the write was sent, and how long
    that took whether the station was found to be silent before the write was too old.
    """
    return result.startswith((
        UNKNOWN + NO_ANSWER, UNKNOWN + 'too old to be sent once more', NOT_SENT + NO_ANSWER,
        NOT_SENT + 'too old to be sent', NOT_SENT + 'waited longer than '))


class HeardNode:
    """
    A node that is to be started, as ``node``, and what is heard of it.

    ``topics`` are those that it reads, with the types of their messages; one is ``written`` too.
    """

    node: Process

    def __init__(self, observer: Observer, name: str, port: Path | str, written: str,
                 **topics: Any) -> None:
        self.observer = observer
        self.name = name
        self.diagnostics = observer.diagnostics(port)
        self.results = observer.results(f'/{name}')
        self.values = {topic: observer.listen(kind, f'/{name}/read/{topic}', EVERYTHING)
                       for topic, kind in topics.items()}
        self._written, self._kind = f'/{name}/write/{written}', topics[written]
        self._publisher: Any = None

    def until_well(self) -> None:
        """Wait until every mapping is read, and the node may be written to."""
        self._find()
        self.diagnostics.until_well()

    def status(self, name: str, level: bytes, *words: str) -> DiagnosticStatus:
        """Wait for a status with this level and these words."""
        return until_status(self.diagnostics, name, level,
                            lambda status: all(word in status.message for word in words))

    def publish(self, value: float) -> None:
        """Publish a value for the topic that is written."""
        self._find()
        self._publisher.publish(self._kind(data=[value]))

    def _find(self) -> None:
        if self._publisher is None:
            self._publisher = self.observer.publisher(self._kind, self._written)

    def forget(self) -> None:
        """Listen no more."""
        for inbox in (self.diagnostics, self.results, *self.values.values()):
            self.observer.forget(inbox)
        if self._publisher is not None:
            self.observer.node.destroy_publisher(self._publisher)


class Rig(HeardNode):
    """Processes, and what is heard of the node."""

    def __init__(self, observer: Observer, name: str, port: str, files: Files,
                 simulator: Process) -> None:
        super().__init__(observer, name, port, 'setpoint', speeds=Int16MultiArray,
                         setpoint=Float32MultiArray)
        self.files = files
        self.simulator = simulator
        self.speeds, self.setpoint = self.values.values()
        self.begun = 0  # so many lines the node had said when this test began

    def begin(self) -> None:
        """Begin a test where another may have ended: all is well, and as at the start."""
        self.diagnostics.clear()
        self.until_well()
        self.writes(SETPOINT)
        self.setpoint.clear()
        self.setpoint.values([SETPOINT])
        for inbox in (self.diagnostics, self.speeds, self.setpoint):
            inbox.clear()
        self.begun = len(self.node.lines)

    @property
    def said(self) -> str:
        """Return what the node has said in this test."""
        return '\n'.join(self.node.lines[self.begun:])

    def told(self, *texts: str) -> str:
        """Wait for a line of the node with these texts, said in this test; return it."""
        return self.node.wait_for(*texts, after=self.begun)

    def recovers(self) -> None:
        """Wait for new values of both stations, and good diagnostics."""
        self.diagnostics.clear()
        before = len(self.speeds), len(self.setpoint)
        self.observer.until(
            lambda: len(self.speeds) > before[0] and len(self.setpoint) > before[1], 'new values')
        self.until_well()

    def write(self, value: float) -> str:
        """Write the set point of station 2; return the text of the result."""
        self.results.clear()
        self.publish(value)
        return str(self.results.first().message)

    def writes(self, value: float, outcome: str = 'written') -> None:
        """Write the set point until that comes of it: a busy host may be too late at first."""
        self.observer.until(lambda: self.write(value) == outcome, outcome)

    def has_read_only(self, *setpoints: float) -> bool:
        """Tell whether the true speeds and those set points are all that has ever come."""
        return {tuple(values_in(message)) for message in self.speeds} <= {SPEEDS} and \
            {values_in(message)[0] for message in self.setpoint} <= {*setpoints}

    def kill_simulator(self) -> None:
        """Cut the PLCs' power; their terminal's name goes first, before another test gets it."""
        self.files.port.unlink(missing_ok=True)
        self.simulator.send(signal.SIGKILL)

    def restart_simulator(self) -> None:
        """Start the simulator that has ended anew."""
        self.simulator.result()
        self.simulator = self.files.start_simulator()


@contextmanager
def rigged(observer: Observer, files: Files, port: str, simulator: Process, *assignments: str,
           program: str | Path = 'node', name: str = 'abdf1') -> Iterator[Rig]:
    """Run the node on ``port`` with a running simulator; two nodes at a time need two names."""
    rig = Rig(observer, name, port, files, simulator)
    arguments = ros_args(f'net_file:={files.net}', f'map_file:={files.map}', f'port:={port}',
                         OFTEN, *assignments)
    with Process(program, *arguments, '-r', f'__node:={name}') as rig.node:
        try:
            yield rig
            rig.node.end()
        finally:
            rig.simulator.__exit__()  # the one that runs by now
    rig.forget()


@contextmanager
def boxed(observer: Observer, folder: Path, *assignments: str,
          name: str = 'abdf1') -> Iterator[tuple[Rig, FaultBox]]:
    """Run simulator, box and node, all of them well when the block begins."""
    files = make_files(folder, IMPATIENT_ROW)
    simulator = files.start_simulator()
    with FaultBox(files.port, folder / 'line') as box, rigged(
            observer, files, str(box.name), simulator, *assignments, name=name) as rig:
        rig.until_well()
        yield rig, box


_Shared = TypeVar('_Shared')


class Renewed(Generic[_Shared]):
    """Lends one thing to test after test, so that one failure is one, and not a row of them."""

    def __init__(self, make: Callable[[], AbstractContextManager[_Shared]]) -> None:
        self._make = make
        self._stack = ExitStack()
        self._lent: list[_Shared] = []  # what there is now: one or nothing

    @contextmanager
    def lent(self, request: pytest.FixtureRequest) -> Iterator[_Shared]:
        """Lend it to the test of ``request``."""
        failed = request.session.testsfailed
        if not self._lent:
            self._lent.append(self._stack.enter_context(self._make()))
        try:
            yield self._lent[0]
        except BaseException:
            failed -= 1
            raise
        finally:
            if request.session.testsfailed > failed:
                self._lent.clear()
                try:
                    self._stack.close()
                except AssertionError as error:  # its failure has been told
                    print(error)

    def close(self) -> None:
        """End it, after the last test."""
        self._stack.close()
