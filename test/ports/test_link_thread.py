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

"""The link thread, on pseudo-terminals and sockets."""

from collections.abc import Callable, Iterator
import itertools
import math
import os
from pathlib import Path
import queue
import resource
import socket
import threading
import time

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Code, Control, EOT, Frame, message_frame, Symbol
from abdf1_ros.df1.machine import (
    LineTiming,
    Listen,
    Machine,
    Procedure,
    Rest,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import PortLost
from abdf1_ros.ports.descriptor import DescriptorPort, Port, READ_SIZE
from abdf1_ros.ports.link_thread import _Attempt, LinkThread, PortState
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.ports.wake import Wake
import pytest
import serial
from support.counting import open_files
from support.ptys import PATIENCE, Pty, wait_until

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
            self._stopping = True


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    line = Pty(tmp_path / 'line')
    yield line
    line.close()


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


@pytest.fixture
def link() -> Iterator[Link]:
    links = Link()
    yield links
    for thread in links.threads:
        if thread.is_alive():
            thread.stop()


def test_machine_runs_on_a_port(pty: Pty, link: Link) -> None:
    script = Script(Listen(PATIENCE), Send(b'again', PATIENCE))
    thread = link.start(script.machine, pty.name)
    assert link.state() == PortState(True, 'open') == thread.state
    assert pty.read(5) == READY
    pty.write(ACK)
    assert script.next() == Control(Code.ACK)
    assert pty.read(5) == b'again'
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
    machine = script.machine
    thread = LinkThread(machine, lambda: open_port(PortSettings(str(pty.name))))
    link.threads.append(thread)
    for _ in range(100_000):
        thread.wake()
    thread.start()
    assert pty.read(5) == READY
    pty.write(ACK)
    assert script.next() == Control(Code.ACK)


def test_port_that_vanishes_is_opened_again_when_it_is_back(pty: Pty, link: Link) -> None:
    script, thread = link.begin(pty, Listen(None))
    assert link.state().is_open
    pty.close()
    lost = link.state()
    assert not lost.is_open
    assert lost.text.startswith('the port was lost: ')
    assert script.end().startswith('PortLost(')
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


def test_attempts_to_open_do_not_end_and_are_half_a_second_apart() -> None:
    def refuse() -> Port:
        raise OSError(16, 'Device or resource busy')

    states: list[PortState] = []
    thread = Impatient(Script().machine, refuse, 4, on_state=states.append)
    thread.run_out()
    assert thread.pauses == [0.5, 0.5, 0.5, 0.5]
    assert set(states) == {PortState(False, 'cannot open the port: Device or resource busy')}


def test_descriptors_have_no_limit_of_their_own(pty: Pty, link: Link) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 1100:
        pytest.skip('the system does not allow so many files')
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1100), hard))
    many = [os.dup(0) for _ in range(1024)]
    try:
        script = Script(Rest(), Send(b'awake', None))
        thread = link.start(script.machine, pty.name)
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
        """Wait."""
        self.waits.append(math.inf if milliseconds is None else milliseconds)
        super().wait(milliseconds)


def test_missing_port_is_waited_for_asleep() -> None:
    """A thread that looks at the clock over and over would take a whole core."""
    attempts = []

    def refuse() -> Port:
        attempts.append(time.monotonic())
        if len(attempts) == 4:
            thread._stopping = True
        raise OSError('no')

    thread = LinkThread(Script().machine, refuse, retry_period=0.05)
    thread._wake.close()
    thread._wake = counted = Counted()
    thread.run()
    pauses = [wait for wait in counted.waits if wait != math.inf]
    assert sum(pauses) >= 3 * 45
    assert len(pauses) <= 3 * 3  # one and what is left of it, not one after the other
    thread.stop()


class _NoLine:
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


class Paused(_NoLine):
    """A port whose first answer lies in the buffer while the process does not run for 6 s."""

    def __init__(self) -> None:
        self.now = 0.0

    def clock(self) -> float:
        """Return the time."""
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Bring an ACK after the pause, then nothing any more."""
        if self.now:
            raise OSError('the end')
        self.now = 6.0
        return ACK


def test_time_that_is_up_goes_before_bytes_that_lie_in_the_buffer() -> None:
    script, port = Script(Send(b'command', 1.0)), Paused()
    thread = Impatient(script.machine, lambda: port, 1, clock=port.clock)
    thread.run_out()
    assert script.next() is None


class SlowLine(_NoLine):
    """A device whose frame comes at so many seconds a character, on a clock of its own."""

    is_terminal = True

    def __init__(self, frame: bytes, char_time: float) -> None:
        self.now = 0.0
        self._frame = frame
        self._char_time = char_time
        self._taken = 0

    def clock(self) -> float:
        """Return the time."""
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Return what has come, or wait for the next character."""
        if self._taken == len(self._frame):
            raise OSError('the end')
        begun, self._taken = self._taken, max(self._taken + 1, int(self.now / self._char_time))
        self.now = max(self.now, self._taken * self._char_time)
        return self._frame[begun:self._taken]


class Late(LinkThread):
    """A link thread on a host that lets it run 20 ms after each pause."""

    def __init__(self, machine: Machine, port: SlowLine) -> None:
        super().__init__(machine, lambda: port, clock=port.clock)
        self._port = port

    def _pause(self, seconds: float) -> None:
        self._port.now += seconds + 0.02


@pytest.mark.parametrize('char_time', [0.0083, 0.0042, 0.0021, 0.001])
def test_long_reply_at_a_low_speed_is_heard_to_its_end(char_time: float) -> None:
    packet = Packet(1, 5, 0x0F, 0, 7).reply(bytes(234))
    script = Script(Send(b'?', 0.3, reply_size=234), timing=LineTiming(char_time=char_time))
    port = SlowLine(message_frame(packet.encode(), Checksum.CRC), char_time)
    thread = Late(script.machine, port)
    assert not thread._run_on(port)
    assert isinstance(script.next(), Frame)
    thread.stop()


def test_process_that_stops_just_before_it_writes_sends_no_old_command() -> None:
    """The clock is looked at again after all that Python does, right before the write."""
    script, written = Script(Send(b'command', 1.0, expires=2.0)), list[bytes]()
    port = Paused()
    port.write = written.append  # type: ignore[method-assign]
    looks = iter([1.0])  # at the start; then the process does not run for a while
    thread = Impatient(script.machine, lambda: port, 1, clock=lambda: next(looks, 60.0))
    thread.run_out()
    assert 'CommandExpired' in script.end()
    assert written == [READY]


@pytest.mark.parametrize('step', [
    Rest(), Rest(3600.0), Listen(None), Send(b'x', 3600.0)])
def test_stop_ends_what_runs_with_an_error(pty: Pty, link: Link, step: Step) -> None:
    script, thread = link.begin(pty, step)
    thread.stop()
    assert not thread.is_alive()
    assert script.end() == repr(PortLost('the driver is stopping'))
    assert not thread.state.is_open
    assert script.machine.counters.read_errors == 0
    open_port(PortSettings(str(pty.name))).close()


def test_stop_while_the_port_is_not_there(tmp_path: Path) -> None:
    asked = threading.Event()

    def refuse() -> Port:
        asked.set()
        raise OSError('no')

    thread = LinkThread(Script().machine, refuse, retry_period=3600.0)
    thread.start()
    assert asked.wait(PATIENCE)
    began = time.monotonic()
    thread.stop()
    assert not thread.is_alive()
    assert time.monotonic() - began < PATIENCE / 2


class Diary(_NoLine):
    """A port that notes what becomes of it, and is lost at the second wait."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Bring an ACK, then nothing any more."""
        self.notes.append('wait')
        if self.notes.count('wait') == 2:
            raise OSError('the cable is gone')
        return ACK

    def write(self, data: bytes) -> None:
        """Note the bytes."""
        self.notes.append(data.decode('ascii'))

    def close(self) -> None:
        """Note the end."""
        self.notes.append('close')


def test_work_that_can_wait_is_done_when_all_is_sent_and_never_left_undone() -> None:
    script = Script(Send(b'question', PATIENCE), Send(b'thanks'), Send(b'next', PATIENCE))
    diary = Diary()
    thread = Impatient(script.machine, lambda: diary, 1,
                       while_sending=lambda: diary.notes.append('work'))
    thread.start()
    thread.join()
    assert diary.notes == [
        'ready', 'question', 'work', 'wait', 'thanks', 'next', 'work', 'wait', 'close', 'work']


def _script_of_a_reply() -> tuple[Script, bytes]:
    """Return a script that waits for a reply of 100 bytes, and the frame of that."""
    script = Script(Send(b'?', PATIENCE, reply_size=100), timing=LineTiming(char_time=0.001))
    packet = Packet(1, 5, 0x0F, 0, 7).reply(bytes(100))
    return script, message_frame(packet.encode(), Checksum.CRC)


@pytest.mark.parametrize('is_traced', [False, True])
def test_serial_port_is_not_looked_at_before_a_reply_can_be_complete(
        pty: Pty, is_traced: bool, tmp_path: Path) -> None:
    script, frame = _script_of_a_reply()
    opener = PortOpener(PortSettings(str(pty.name)))
    if is_traced:
        opener.trace(str(tmp_path / 'trace'), math.inf, {}, pytest.fail)
    thread = Impatient(script.machine, opener.open, 3)
    thread.start()
    assert pty.read(5) == READY
    began = time.monotonic()
    wait_until(lambda: time.monotonic() > began + 0.02)  # a line of that speed is not faster
    pty.write(frame[:8])
    wait_until(lambda: bool(thread.pauses))
    pty.write(frame[8:])
    assert isinstance(script.next(), Frame)
    assert thread.pauses[0] == pytest.approx(0.084)  # 16 of the 100 bytes are waited for
    thread.stop()
    opener.close()


@pytest.fixture
def sockets() -> Iterator[tuple[DescriptorPort, socket.socket]]:
    ours, theirs = socket.socketpair()
    yield DescriptorPort(ours.fileno(), ours.close), theirs
    theirs.close()
    ours.close()


def test_bytes_of_a_connection_are_read_as_they_come(
        sockets: tuple[DescriptorPort, socket.socket]) -> None:
    ours, theirs = sockets
    script, frame = _script_of_a_reply()
    thread = Impatient(script.machine, lambda: ours, 1)
    thread.start()
    assert theirs.recv(5) == READY
    theirs.send(frame[:8])
    wait_until(lambda: script.machine.decoder.in_message)
    theirs.send(frame[8:])
    assert isinstance(script.next(), Frame)
    assert thread.pauses == []
    thread.stop()


class Babbler(_NoLine):
    """A connection with bytes at every read but the last; what it costs is told to its clocks."""

    def __init__(self, data: bytes, reads: int, *, has_more: bool = True) -> None:
        self.now = 100.0
        self.worked = 0.0
        self.has_more = has_more
        self._data = data
        self._reads = reads

    def clock(self) -> float:
        """Return the time."""
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Return so many bytes."""
        self._reads -= 1
        if not self._reads:
            raise OSError('the end')
        return self._data


class Restful(Impatient):
    """A link thread that tells how much it has taken, and how long it leaves the port alone."""

    def __init__(self, script: Script, port: Babbler, *, work: float = 0.0, host: float = 0.0,
                 **options: object) -> None:
        super().__init__(script.machine, lambda: port, 1, clock=port.clock,
                         processor_clock=lambda: port.worked, **options)
        self.rests: list[float] = []
        self.taken: list[int] = []
        self._babbler = port
        receive = script.machine.receive_data

        def take(data: bytes, now: float) -> None:
            self.taken.append(len(data))
            receive(data, now)
            port.worked += work
            port.now += work + host

        script.machine.receive_data = take  # type: ignore[method-assign]

    def _rest(self, seconds: float) -> None:
        self.rests.append(seconds)
        self._babbler.now += seconds


@pytest.mark.parametrize(('work', 'host', 'rest'), [
    (0.001, 0.0, 0.019),  # 19 times as long as it took
    (0.001, 0.01, 0.019),  # of the processor, not of the clock
    (0.004, 0.0, 0.060)])  # up to the 64 ms that these bytes take on the line
def test_connection_that_babbles_leaves_time_to_others(
        work: float, host: float, rest: float) -> None:
    script = Script(Listen(None), timing=LineTiming(0.001))
    thread = Restful(script, Babbler(bytes(READ_SIZE), 11), work=work, host=host)
    thread.run_out()
    assert thread.taken == [64] * 10 * 8
    assert thread.rests == [pytest.approx(rest)] * 10 * 8


def test_burst_beside_load_takes_the_time_of_the_line() -> None:
    """Some portions wait long for the processor; the others make up for it."""
    script = Script(Listen(None), timing=LineTiming(0.001))
    port = Babbler(bytes(READ_SIZE), 11)
    late = iter([0.3] * 10)
    thread = Restful(script, port, work=0.01)
    rest = thread._rest
    thread._rest = lambda seconds: rest(seconds + next(late, 0.0))  # type: ignore[method-assign]
    thread.run_out()
    assert port.now - 100.0 == pytest.approx(10 * READ_SIZE * 0.001)


def test_commands_of_a_device_server_alone_are_rested_after_too() -> None:
    script = Script(Listen(None), timing=LineTiming(0.001))
    port = Babbler(b'', 11)
    thread = Restful(script, port)
    port.worked = 1.0
    thread.run_out()
    assert thread.taken == []
    assert thread.rests[0] == pytest.approx(0.001 * READ_SIZE)


def test_connection_that_babbles_does_not_keep_a_request_from_the_machine() -> None:
    script = Script(Rest(), Send(b'awake', None))
    thread = Restful(script, Babbler(bytes(READ_SIZE), 11),
                     on_state=lambda state: thread.wake())  # as soon as the port is open
    thread.run_out()
    assert script.next() is None


def test_line_is_not_left_alone_after_a_frame() -> None:
    script = Script(Listen(None))
    thread = Restful(script, Babbler(bytes(READ_SIZE - 1), 11, has_more=False))
    thread.run_out()
    assert script.machine.counters.chars_received == 10 * (READ_SIZE - 1)
    assert not thread.rests


class Broken:
    """A machine's procedure that fails as soon as it runs."""

    def __init__(self) -> None:
        self.machine = Machine(self._run, checksum=Checksum.CRC)
        self.runs = 0

    def _run(self, machine: Machine) -> Procedure:
        self.runs += 1
        raise ZeroDivisionError
        yield Rest()


def test_three_faults_within_a_minute_end_the_thread() -> None:
    broken, faults, states = Broken(), list[Exception](), list[PortState]()
    thread = Impatient(broken.machine, _NoLine, 100, on_fault=faults.append,
                       on_state=states.append, clock=lambda: 5.0)
    thread.run_out()
    assert thread.has_failed
    assert broken.runs == len(faults) == 3
    assert all(isinstance(fault, ZeroDivisionError) for fault in faults)
    assert states[1] == PortState(False, 'internal error: ZeroDivisionError()')
    assert thread.pauses == [0.5, 0.5]


@pytest.mark.parametrize('apart, fails', [(29.0, True), (31.0, False)])
def test_faults_that_are_rare_do_not_end_the_thread(apart: float, fails: bool) -> None:
    broken, now = Broken(), [0.0]

    def wait(error: Exception) -> None:
        now[0] += apart

    thread = Impatient(broken.machine, _NoLine, 20, on_fault=wait, clock=lambda: now[0])
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


def _fail_once(put: Callable[..., None]) -> Callable[..., None]:
    calls = itertools.count()

    def fail_first(item: Symbol | None) -> None:
        if next(calls) == 0:
            raise ZeroDivisionError
        put(item)
    return fail_first


def test_busy_port_is_reported_and_opened_when_it_is_free(pty: Pty, link: Link) -> None:
    other = serial.Serial(str(pty.name), exclusive=True)
    script = Script()
    link.start(script.machine, pty.name)
    state = link.state()
    assert state == PortState(False, 'cannot open the port: another program has it open')
    other.close()
    while not link.state().is_open:
        pass
    assert pty.read(5) == READY


def test_full_pty_is_a_lost_port(pty: Pty, link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.descriptor._WRITE_TIMEOUT', 0.05)
    script = Script(Send(bytes(1_000_000), None))
    link.start(script.machine, pty.name)
    assert link.state().is_open
    assert link.state() == PortState(
        False, 'the port was lost: the line takes no data; is Handshake right?')
    assert script.machine.counters.read_errors == 0
    assert script.end().startswith('PortLost(')


def test_machine_runs_on_a_socket_url(link: Link) -> None:
    script = Script(Listen(None))
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(PATIENCE)
        link.start(script.machine, f'socket://127.0.0.1:{server.getsockname()[1]}')
        assert link.state().is_open
        client, _ = server.accept()
        with client:
            client.settimeout(PATIENCE)
            data = b''
            while len(data) < 5:
                data += client.recv(5)
            assert data == READY
            client.sendall(ACK)
            assert script.next() == Control(Code.ACK)
        assert link.state().text == 'the port was lost: the other end has closed the connection'
        again, _ = server.accept()
        again.close()


class Stuck(_NoLine):
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
    attempt = _Attempt(stuck.open, lambda: None)
    attempt.run()
    attempt.abandon()
    assert stuck.closed.is_set()


def test_port_that_is_released_is_free_until_it_is_taken_again(pty: Pty, link: Link) -> None:
    script, thread = link.begin(pty, Listen(None))
    assert link.state().is_open
    assert thread.release()
    assert link.state() == PortState(False, 'the port is left to others: polling is off')
    assert script.end() == repr(PortLost('the port is left to others: polling is off'))
    open_port(PortSettings(str(pty.name))).close()
    thread.wake()
    thread.take()
    while not link.state().is_open:
        pass
    assert pty.read(5) == READY


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
    while 'left to others' not in states.get(timeout=PATIENCE).text:
        pass
    thread.stop()
    assert not is_repeated


def test_other_machine_goes_on_with_the_same_port(pty: Pty, link: Link) -> None:
    before, after = Script(Send(b'before', None)), Script(Send(b'after', None))
    thread = link.start(before.machine, pty.name)
    assert pty.read(11) == READY + b'before'
    done: list[str] = []
    assert thread.exchange(after.machine, lambda: done.append('sent'), reopen=False)
    assert before.end() == repr(PortLost('the files have been read again'))
    assert pty.read(10) == READY + b'after'
    pty.write(ACK)
    assert after.next() == Control(Code.ACK)
    assert 'sent' in done
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


class _Stuck(_NoLine):
    """A port that takes nothing until ``free`` is set."""

    def __init__(self) -> None:
        self.is_used = threading.Event()
        self.free = threading.Event()

    def write(self, data: bytes) -> None:
        """Wait."""
        self.is_used.set()
        assert self.free.wait(PATIENCE)


def test_machine_that_came_to_nothing_does_not_come_later(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.link_thread._EXCHANGE_LIMIT', 0.0)
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
    thread = Impatient(Broken().machine, _NoLine, 100)
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
