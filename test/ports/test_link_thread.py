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

"""The link thread, on pseudo-terminals and sockets; it leaves its port, or gets a machine."""

from collections.abc import Callable
from functools import partial
import inspect
import itertools
import math
import os
from pathlib import Path
import queue
import resource
import threading
import time

from abdf1_ros.df1.frames import ACK, Code, Control, EOT, Symbol
from abdf1_ros.df1.machine import Listen, Rest, Send, Step
from abdf1_ros.errors import INTERNAL_ERROR, PortLost
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import Attempt, LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.port_thread import PortKind, PortState
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.wake import Wake
import pytest
import serial
from support.counting import open_files
from support.link_threads import Broken, Impatient, Link, NoLine, READY, Script
from support.ptys import PATIENCE, Pty, wait_until


def test_machine_runs_on_a_port(pty: Pty, link: Link) -> None:
    script = Script(Listen(PATIENCE), Send(b'again', PATIENCE))
    thread = link.start(script.machine, pty.name)
    assert link.state() == PortState(True, 'open') == thread.state
    assert pty.read(5) == READY
    thread.has_turned = False
    pty.write(ACK)
    assert script.next() == Control(Code.ACK)
    assert pty.read(5) == b'again' and thread.has_turned
    pty.write(EOT[:1])
    pty.write(EOT[1:])
    assert script.next() == Control(Code.EOT)
    assert script.machine.counters.chars_received == 4
    assert script.machine.counters.chars_sent == 10


def test_deadlines_of_the_machine_are_kept(pty: Pty, link: Link) -> None:
    script = Script(*[Send(b'x', 0.02)] * 3)
    began = time.monotonic()
    link.start(script.machine, pty.name)
    assert [script.next() for _ in range(3)] == [None] * 3
    assert time.monotonic() - began >= 0.06
    assert pty.read(8) == READY + b'xxx'


def test_wake_ends_a_rest(pty: Pty, link: Link) -> None:
    script, thread = link.begin(pty, Rest(), Send(b'awake', None))
    thread.wake()
    assert script.next() is None
    assert pty.read(5) == b'awake'


def test_wake_may_come_in_any_number_and_before_the_start(pty: Pty, link: Link) -> None:
    script = Script(Listen(PATIENCE))
    thread = LinkThread(Script().machine, lambda: open_port(PortSettings(str(pty.name))))
    link.threads.append(thread)

    def begin() -> None:
        for _ in range(100_000):
            thread.wake()
        thread.start()

    threading.Thread(target=begin).start()
    assert thread.exchange(script.machine, lambda: None, reopen=False)  # before the start, too
    assert pty.read(5) == READY
    pty.write(ACK)
    assert script.next() == Control(Code.ACK)


def test_port_that_vanishes_is_opened_again_when_it_is_back(pty: Pty, link: Link) -> None:
    script, thread = link.begin(pty, Listen(None))
    assert link.state().is_open
    vanished = line_time()
    pty.close()
    lost = link.state()
    assert not lost.is_open
    assert lost.text.startswith('the port was lost: ')
    assert script.end().startswith('PortLost(')
    assert script.machine.now >= vanished  # what was under way ended then (rule 10)
    assert script.machine.counters.read_errors == 1
    state = link.state()
    assert state.text.startswith('cannot open the port: ')
    assert 'No such file or directory' in state.text
    back = Pty(pty.name)
    try:
        while not (state := link.state()).is_open:
            assert state.text.startswith('cannot open the port: ')
        assert back.read(5) == READY
        back.write(ACK)
        assert script.next() == Control(Code.ACK)
        thread.stop()
    finally:
        back.close()


@pytest.mark.parametrize('what', [OSError(16, 'no'), RuntimeError('no')])  # no more threads
def test_attempts_to_open_do_not_end_and_are_half_a_second_apart(
        what: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*attempt: object) -> Port:
        raise what

    if isinstance(what, RuntimeError):
        monkeypatch.setattr(Attempt, 'start', refuse)
    states: list[PortState] = []
    thread = Impatient(Script().machine, refuse, 4, on_state=states.append)
    thread.run_out()
    assert thread.pauses == [0.5, 0.5, 0.5, 0.5]
    assert {(state, state.kind) for state in states} == {
        (PortState(False, 'cannot open the port: no'), PortKind.UNAVAILABLE)}


def test_descriptors_have_no_limit_of_their_own(pty: Pty, link: Link) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 1100:
        pytest.skip('the system does not allow so many files')
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1100), hard))
    many = [os.dup(0) for _ in range(1024)]
    try:
        thread = link.start(Script(Rest(), Send(b'awake', None)).machine, pty.name)
        assert link.state().is_open
        assert pty.read(5) == READY
        thread.wake()
        assert pty.read(5) == b'awake'
        assert thread.release()
        thread.stop()
        assert not thread.has_failed
    finally:
        for descriptor in many:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_stop_before_start() -> None:
    before = open_files()
    thread = LinkThread(Script().machine, lambda: pytest.fail('opened'))
    ours = open_files() - before
    assert len(ours) == 1
    thread.stop()
    thread.wake()  # somebody who does not know
    assert not ours & open_files()
    thread.start()
    thread.join(PATIENCE)
    assert not thread.is_alive()


class Counted(Wake):
    """A wake that notes how long it was waited for."""

    def __init__(self) -> None:
        super().__init__()
        self.waits: list[float] = []

    def wait(self, milliseconds: int | None = None) -> None:
        self.waits.append(math.inf if milliseconds is None else milliseconds)
        super().wait(milliseconds)


def test_wake_lasts_until_it_is_taken() -> None:
    wake = Wake()
    wake.set()
    for _ in range(2):
        wake.wait(0)
    assert [wake.take(), wake.take()] == [True, False]
    wake.close()


def test_missing_port_is_waited_for_asleep(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that looks at the clock over and over would take a whole core."""
    attempts = []

    def refuse() -> Port:
        attempts.append(time.monotonic())
        if len(attempts) == 4:
            thread.ask_to_stop()
        raise OSError('no')

    counted = Counted()
    monkeypatch.setattr('abdf1_ros.ports.port_thread.Wake', lambda: counted)
    thread = LinkThread(Script().machine, refuse, retry_period=0.05,
                        on_state=lambda state: thread.wake())
    thread.run()
    pauses = [wait for wait in counted.waits if wait != math.inf]
    assert sum(pauses) >= 3 * 45
    assert len(pauses) <= 3 * 3  # one and what is left of it, not one after the other
    thread.stop()


@pytest.mark.parametrize('step', [Rest(), Rest(3600.0), Listen(None), Send(b'x', 3600.0)])
def test_stop_ends_what_runs_with_an_error(pty: Pty, link: Link, step: Step) -> None:
    script, thread = link.begin(pty, step)
    thread.stop()
    assert not thread.is_alive()
    assert script.end() == repr(PortLost('closed by this program'))
    assert thread.state == PortState(False, 'closed')
    assert script.machine.counters.read_errors == 0
    open_port(PortSettings(str(pty.name))).close()


def test_three_faults_within_a_minute_end_the_thread() -> None:
    broken, faults, states = Broken(), list[Exception](), list[PortState]()
    thread = Impatient(broken.machine, NoLine, 100, on_fault=faults.append,
                       on_state=states.append, clock=lambda: 5.0)
    thread.run_out()
    assert thread.has_failed
    assert broken.runs == len(faults) == 3
    assert all(isinstance(fault, ZeroDivisionError) for fault in faults)
    assert states[1] == thread.state == PortState(False, 'internal error: ZeroDivisionError()')
    assert thread.pauses == [0.5, 0.5]


def test_fault_outside_of_the_machine_is_told_and_ends_the_thread() -> None:
    faults = list[Exception]()
    thread = LinkThread(Script().machine, NoLine, on_state=lambda state: print(1 / 0),
                        on_fault=faults.append)
    thread.run()
    thread.stop()
    assert (thread.has_failed, thread.state.text) == (True, f'internal error: {faults[0]!r}')


@pytest.mark.parametrize('apart, fails', [(29.0, True), (30.0, False)])
def test_faults_that_are_rare_do_not_end_the_thread(apart: float, fails: bool) -> None:
    broken, now = Broken(), [0.0]

    def wait(error: Exception) -> None:
        now[0] += apart

    thread = Impatient(broken.machine, NoLine, 20, on_fault=wait, clock=lambda: now[0])
    thread.run_out()
    assert thread.has_failed is fails
    assert broken.runs == (3 if fails else 20)


def test_fault_ends_what_runs_and_the_next_port_has_a_fresh_procedure(
        pty: Pty, link: Link) -> None:
    faults: queue.Queue[Exception] = queue.Queue()
    script = Script(Listen(None), Listen(None))
    script.heard.put = _fail_once(script.heard.put)  # type: ignore[method-assign]
    thread = link.start(script.machine, pty.name, on_fault=faults.put)
    assert pty.read(5) == READY
    pty.write(ACK)
    assert isinstance(faults.get(timeout=PATIENCE), ZeroDivisionError)
    assert pty.read(5) == READY
    pty.write(ACK)
    assert script.next() == Control(Code.ACK)
    assert not thread.has_failed


def test_fault_outside_of_what_runs_is_the_reason_of_its_end(pty: Pty, link: Link) -> None:
    script = Script(Listen(None))
    link.start(script.machine, pty.name, while_sending=partial(_fail_once(print), None))
    assert script.end() == repr(PortLost(INTERNAL_ERROR))


def _fail_once(put: Callable[..., None]) -> Callable[..., None]:
    calls = itertools.count()

    def fail_first(item: Symbol | None) -> None:
        if next(calls) == 0:
            raise ZeroDivisionError
        put(item)
    return fail_first


def test_busy_port_is_reported_and_opened_when_it_is_free(pty: Pty, link: Link) -> None:
    other = serial.Serial(str(pty.name), exclusive=True)
    link.start(Script().machine, pty.name)
    assert link.state() == PortState(False, 'cannot open the port: another program has it open')
    other.close()
    while not link.state().is_open:
        pass
    assert pty.read(5) == READY


def test_full_pty_is_a_lost_port(pty: Pty, link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.descriptor.WRITE_TIMEOUT', 0.05)
    script = Script(Send(bytes(1_000_000), None))
    link.start(script.machine, pty.name)
    assert link.state().is_open
    assert link.state() == PortState(
        False, 'the port was lost: the line takes no data; is Handshake right?')
    assert script.machine.counters.read_errors == 0
    assert script.end().startswith('PortLost(')


def test_rule_6_clock_counts_a_suspend() -> None:
    before = time.clock_gettime(time.CLOCK_BOOTTIME)
    assert before <= line_time() <= time.clock_gettime(time.CLOCK_BOOTTIME)


def test_rule_6_link_thread_has_that_clock() -> None:
    assert inspect.signature(LinkThread).parameters['clock'].default is line_time


# It leaves its port, or takes another machine


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


def test_machine_for_another_port_never_has_the_one_that_is_open() -> None:
    states: list[str] = []
    woken = threading.Event()

    class Late(LinkThread):

        def __setattr__(self, name: str, value: object) -> None:
            super().__setattr__(name, value)
            if name == 'has_turned' and self.state.is_open and not states:  # after its look
                states.append('asked')
                woken.clear()
                threading.Thread(target=self.exchange, args=(
                    Script(Rest()).machine, lambda: None, True, '',
                    lambda: states.append(self.state.text))).start()
                assert woken.wait(PATIENCE)

        def wake(self) -> None:
            super().wake()
            woken.set()

    thread = Late(Script(Rest()).machine, NoLine)
    thread.start()
    wait_until(lambda: len(states) > 1)
    thread.stop()
    assert states == ['asked', 'the port is being opened']


def test_other_machine_on_a_port_that_is_opened_anew(pty: Pty, link: Link) -> None:
    before, after = Script(Listen(None)), Script(Listen(None))
    thread = link.start(before.machine, pty.name)
    assert pty.read(5) == READY
    shown: list[PortState] = []
    assert thread.exchange(after.machine, lambda: None, reopen=True,
                           take_over=lambda: shown.append(thread.state))
    assert shown == [PortState(False, 'the port is being opened')]
    assert before.end() == repr(PortLost('the files have been read again'))
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
    monkeypatch.setattr('abdf1_ros.ports.port_thread.LONGEST_HAND_OVER', 0.0)
    port, before, after = _Stuck(), Script(Rest()), Script(Rest())
    thread = LinkThread(before.machine, lambda: port)
    thread.start()
    assert port.is_used.wait(PATIENCE)
    assert not thread.exchange(after.machine, lambda: None, reopen=False)
    port.is_used.clear()
    monkeypatch.undo()
    threading.Timer(0.15, port.free.set).start()
    assert thread.release()
    port.free.clear()
    thread.take()
    assert port.is_used.wait(PATIENCE)  # by whatever machine there is now
    monkeypatch.setattr('abdf1_ros.ports.port_thread.LONGEST_HAND_OVER', 0.0)
    assert not thread.release()  # which has not happened a second time
    port.free.set()
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
