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

"""The link thread leaves its port, or takes another machine."""

from collections.abc import Callable
from pathlib import Path
import queue
import threading
import time

from abdf1_ros.df1.frames import ACK, Code, Control
from abdf1_ros.df1.machine import Listen, Rest, Send
from abdf1_ros.errors import PortLost
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import Attempt, LinkThread, PortState
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.link_threads import Broken, Impatient, Link, NoLine, READY, Script
from support.ptys import PATIENCE, Pty, wait_until


class Stuck(NoLine):
    """What opens a port when it is let go."""

    def __init__(self) -> None:
        self.is_asked = threading.Event()
        self.go_on = threading.Event()
        self.closed = threading.Event()

    def open(self) -> Port:  # noqa: A003
        """Open a port, after a while."""
        self.is_asked.set()
        assert self.go_on.wait(PATIENCE)
        return self

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Never be called."""
        raise AssertionError

    def close(self) -> None:
        """Note it."""
        self.closed.set()


def test_neither_another_machine_nor_the_end_waits_for_a_name_server() -> None:
    stuck = Stuck()
    faults: list[Exception] = []
    thread = LinkThread(Script().machine, stuck.open, on_fault=faults.append)
    thread.start()
    assert stuck.is_asked.wait(PATIENCE)
    assert thread.exchange(Script().machine, lambda: None, reopen=False)
    began = time.monotonic()
    thread.stop()
    assert time.monotonic() - began < PATIENCE / 2
    assert not stuck.closed.is_set()
    assert faults == []
    stuck.go_on.set()  # the port that nobody waits for any more
    assert stuck.closed.wait(PATIENCE)


def test_port_that_opens_while_the_end_begins_is_closed() -> None:
    stuck = Stuck()
    stuck.go_on.set()
    attempt = Attempt(stuck.open, lambda: None)
    attempt.run()
    attempt.abandon()
    assert stuck.closed.is_set()


def test_port_that_is_released_is_free_until_it_is_taken_again(pty: Pty, link: Link) -> None:
    script, thread = link.begin(pty, Listen(None))
    assert link.state().is_open
    assert thread.release()
    assert link.state() == PortState(False, 'polling is off, so other programs may use the port')
    assert script.end() == repr(PortLost('polling is off, so other programs may use the port'))
    open_port(PortSettings(str(pty.name))).close()
    thread.has_turned = False
    thread.wake()
    wait_until(lambda: thread.has_turned)
    thread.take()
    while not link.state().is_open:
        pass
    assert pty.read(5) == READY
    assert thread.release()
    assert not thread.state.is_open


def test_release_while_the_port_cannot_be_opened() -> None:
    asked, again = threading.Event(), threading.Event()

    def refuse() -> Port:
        (again if asked.is_set() else asked).set()
        raise OSError('no')

    states: queue.Queue[PortState] = queue.Queue()
    thread = LinkThread(Script().machine, refuse, retry_period=3600.0, on_state=states.put)
    thread.start()
    assert asked.wait(PATIENCE)
    is_repeated = again.wait(0.7)  # longer than the period of a node
    assert thread.release()
    while 'other programs may use the port' not in states.get(timeout=PATIENCE).text:
        pass
    thread.stop()
    assert not is_repeated


def test_other_machine_goes_on_with_the_same_port(pty: Pty, link: Link) -> None:
    before, after = Script(Send(b'before', None)), Script(Send(b'after', None))
    done: list[str] = []
    thread = link.start(before.machine, pty.name, while_sending=lambda: done.append(
        f'{before.ended.qsize()} ended'))
    assert pty.read(11) == READY + b'before'
    assert thread.exchange(after.machine, lambda: done.append('sent'), reopen=False)
    assert before.end() == repr(PortLost('the files have been read again'))
    assert pty.read(10) == READY + b'after'
    pty.write(ACK)
    assert after.next() == Control(Code.ACK)
    assert {'1 ended', 'sent'} <= {*done}
    assert link.state() == PortState(True, 'open')
    assert link.states.empty()  # the port has not been closed


def test_other_machine_on_a_port_that_is_opened_anew(pty: Pty, link: Link) -> None:
    before, after = Script(Listen(None)), Script(Listen(None))
    thread = link.start(before.machine, pty.name)
    assert pty.read(5) == READY
    assert thread.exchange(after.machine, lambda: None, reopen=True)
    assert before.end().startswith('PortLost(')
    assert pty.read(5) == READY
    assert [link.state().is_open, link.state().is_open] == [True, True]


class _Stuck(NoLine):
    """A port that takes nothing until ``free`` is set."""

    def __init__(self) -> None:
        self.is_used = threading.Event()
        self.free = threading.Event()

    def write(self, data: bytes) -> None:
        self.is_used.set()
        assert self.free.wait(PATIENCE)


def test_machine_that_came_to_nothing_does_not_come_later(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.link_thread.EXCHANGE_LIMIT', 0.0)
    port, before, after = _Stuck(), Script(Rest()), Script(Rest())
    thread = LinkThread(before.machine, lambda: port)
    thread.start()
    assert port.is_used.wait(PATIENCE)
    assert not thread.exchange(after.machine, lambda: None, reopen=False)
    port.is_used.clear()
    port.free.set()
    monkeypatch.undo()
    assert thread.release()
    thread.take()
    assert port.is_used.wait(PATIENCE)  # by whatever machine there is now
    thread.stop()
    assert after.ended.empty()


@pytest.mark.parametrize('ask', [
    LinkThread.release,
    lambda thread: thread.exchange(Script().machine, lambda: None, reopen=False)])
def test_thread_that_has_ended_is_not_waited_for(ask: Callable[[LinkThread], bool]) -> None:
    thread = Impatient(Broken().machine, NoLine, 100)
    thread.start()
    thread.join()
    began = time.monotonic()
    assert not ask(thread)
    assert time.monotonic() - began < 4.0
    thread.stop()


def test_other_machine_while_there_is_no_port(tmp_path: Path, link: Link) -> None:
    after = Script(Listen(None))
    thread = link.start(Script().machine, tmp_path / 'line')
    assert not link.state().is_open
    assert thread.exchange(after.machine, lambda: None, reopen=False)
    pty = Pty(tmp_path / 'line')
    assert pty.read(5) == READY
    pty.write(ACK)
    assert after.next() == Control(Code.ACK)
    thread.stop()
    pty.close()
