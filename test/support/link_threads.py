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

"""Link threads for tests: what runs on them, and on which port."""

from collections.abc import Callable
from pathlib import Path
import queue

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Symbol
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure, Rest, Send, Silence, Step
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ports.settings import PortSettings
from support.ptys import PATIENCE, Pty

READY = b'ready'


class Script:
    """A procedure that says when it begins, tells what it hears, and how it ended."""

    def __init__(self, *steps: Step, timing: LineTiming | None = None) -> None:
        self.heard: queue.Queue[Symbol | None] = queue.Queue()
        self.ended: queue.Queue[BaseException | None] = queue.Queue()
        self.machine = Machine(self._run, checksum=Checksum.CRC, timing=timing)
        self._steps = steps

    def _run(self, machine: Machine) -> Procedure:
        try:
            yield Send(READY)
            for step in self._steps:
                heard = yield step
                self.heard.put(None if isinstance(heard, Silence) else heard)
        except BaseException as error:
            self.ended.put(error)
            raise
        yield Rest()

    def next(self) -> Symbol | None:  # noqa: A003
        """Return what came of the next step."""
        return self.heard.get(timeout=PATIENCE)

    def end(self) -> str:
        """Return the error that ended the procedure."""
        return repr(self.ended.get(timeout=PATIENCE))


class Impatient(LinkThread):
    """A link thread that keeps its pauses short and tells how long they should be."""

    def __init__(self, machine: Machine, opener: Callable[[], Port], most: int,
                 **options: object) -> None:
        super().__init__(machine, opener, **options)  # type: ignore[arg-type]
        self.pauses: list[float] = []
        self._most = most

    def run_out(self) -> None:
        """Run in this thread until the end."""
        self.run()
        self.stop()

    def _pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        if len(self.pauses) >= self._most:
            self.ask_to_stop()


class Link:
    """A link thread with the states it has gone through."""

    def __init__(self) -> None:
        self.states: queue.Queue[PortState] = queue.Queue()
        self.threads: list[LinkThread] = []

    def start(self, machine: Machine, name: Path | str, **options: object) -> LinkThread:
        """Run ``machine`` on the port of that name."""
        settings = PortSettings(str(name))
        thread = LinkThread(
            machine, lambda: open_port(settings), on_state=self.states.put,
            retry_period=0.02, **options)  # type: ignore[arg-type]
        self.threads.append(thread)
        thread.start()
        return thread

    def begin(self, pty: Pty, *steps: Step) -> tuple[Script, LinkThread]:
        """Run a script on a pseudo-terminal until it is ready."""
        script = Script(*steps)
        thread = self.start(script.machine, pty.name)
        assert pty.read(5) == READY
        return script, thread

    def state(self) -> PortState:
        """Return the next state."""
        return self.states.get(timeout=PATIENCE)


class NoLine:
    """A port on which nothing ever happens."""

    has_more = is_terminal = False

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Return nothing."""
        return b''

    def write(self, data: bytes) -> None:
        """Drop it."""

    def unsent(self) -> int:
        """Return 0: all has left."""
        return 0

    def close(self) -> None:
        """Do nothing."""


class Broken:
    """A machine's procedure that fails as soon as it runs."""

    def __init__(self) -> None:
        self.machine = Machine(self._run, checksum=Checksum.CRC)
        self.runs = 0

    def _run(self, machine: Machine) -> Procedure:
        self.runs += 1
        raise ZeroDivisionError
        yield Rest()
