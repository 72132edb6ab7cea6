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

"""When the link thread looks at its port, and when it leaves the port alone."""

from collections.abc import Sequence
from contextlib import suppress
from itertools import count
import math
from pathlib import Path
import socket
import time
from unittest.mock import Mock

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Damaged, Frame, FrameFault, message_frame
from abdf1_ros.df1.machine import LineTiming, Listen, Machine, Procedure, Rest, Send
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import CommandExpired
from abdf1_ros.ports.descriptor import DescriptorPort, READ_SIZE
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortState, RELEASED
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trace import PortOpener
import pytest
from support.cases import for_all
from support.link_threads import Impatient, NoLine, READY, Script
from support.ptys import PATIENCE, Pty, wait_until


class Paused(NoLine):
    """A port whose first answer lies in the buffer while the process does not run for 6 s."""

    def __init__(self) -> None:
        self.now = 0.0

    def clock(self) -> float:
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Bring an ACK after the pause, then nothing any more."""
        if self.now:
            raise OSError('the end')
        self.now = 6.0
        return ACK


def test_time_that_is_up_goes_before_bytes_that_lie_in_the_buffer() -> None:
    script, port, came = Script(Send(b'command', 1.0)), Paused(), list[float]()
    thread = Impatient(script.machine, lambda: port, 1, clock=port.clock,
                       on_state=lambda state: came.append(thread.came_after))
    thread.run_out()
    assert script.next() is None and came == [0.0, 0.0]


class SlowLine(NoLine):
    """A device whose frame comes at so many seconds a character, on a clock of its own."""

    is_terminal = True

    def __init__(self, frame: bytes, char_time: float) -> None:
        self.now = 0.0
        self._frame = frame
        self._char_time = char_time
        self._taken = 0

    def clock(self) -> float:
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
        super().__init__(machine, lambda: port, clock=port.clock,
                         on_state=lambda state: state.is_open or self.ask_to_stop())
        self._port = port

    def _pause(self, seconds: float) -> None:
        self._port.now += seconds + 0.02


@for_all('char_time', [0.0083, 0.0042, 0.0021, 0.001])
def test_long_reply_at_a_low_speed_is_heard_to_its_end(char_time: float) -> None:
    packet = Packet(1, 5, 0x0F, 0, 7).reply(bytes(234))
    script = Script(Send(b'?', 0.3, reply_size=234), timing=LineTiming(char_time=char_time))
    script.machine.came = came = Mock()  # type: ignore[method-assign]
    port = SlowLine(message_frame(packet.encode(), Checksum.CRC), char_time)
    thread = Late(script.machine, port)
    thread.run()
    assert isinstance(script.next(), Frame)
    assert {call.args[0] for call in came.call_args_list} == {0}  # a terminal keeps few bytes
    thread.stop()


def test_process_that_stops_just_before_it_writes_sends_no_old_command() -> None:
    """The clock is looked at again after all that Python does, right before the write."""
    def say(_: Machine) -> Procedure:
        for expires in (2.0, 61.0):
            with suppress(CommandExpired):
                yield Send(b'command', 1.0, expires=expires)
        yield Rest()

    port, written = Paused(), list[bytes]()
    port.write = written.append  # type: ignore[method-assign]
    looks = iter([1.0] * 3 + [60.0])  # at the start; then the process does not run, twice
    Impatient(Machine(say, checksum=Checksum.CRC), lambda: port, 1,
              clock=lambda: next(looks, 70.0)).run_out()
    assert written == []


class Diary(NoLine):
    """A port that notes what becomes of it, and is lost at the second wait."""

    def __init__(self, script: Script) -> None:
        self.notes: list[str] = []
        self.script = script

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Bring an ACK, then nothing any more."""
        self.notes.append('wait')
        if self.notes.count('wait') == 2:
            raise OSError('the cable is gone')
        return ACK

    def write(self, data: bytes) -> None:
        self.notes.append(data.decode('ascii'))

    def close(self) -> None:
        """Note the end."""
        self.notes.append(f'close, {self.script.ended.qsize()} ended')


def test_work_that_can_wait_is_done_when_all_is_sent_and_never_left_undone() -> None:
    script = Script(Send(b'question', PATIENCE), Send(b'thanks'), Send(b'next', PATIENCE))
    diary = Diary(script)
    thread = Impatient(script.machine, lambda: diary, 1,
                       while_sending=lambda: diary.notes.append('work'))
    thread.start()
    thread.join()
    assert diary.notes == [
        'ready', 'question', 'work', 'wait', 'thanks', 'next', 'work', 'wait',
        'close, 1 ended', 'work']


def _script_of_a_reply() -> tuple[Script, bytes]:
    """Return a script that waits for a reply of 100 bytes, and the frame of that."""
    script = Script(Send(b'?', PATIENCE, reply_size=100), timing=LineTiming(char_time=0.001))
    return script, message_frame(Packet(1, 5, 0x0F, 0, 7).reply(bytes(100)).encode(), Checksum.CRC)


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


def test_bytes_of_a_connection_are_read_as_they_come(
        sockets: tuple[DescriptorPort, socket.socket]) -> None:
    ours, theirs = sockets
    script, frame = _script_of_a_reply()
    thread = Impatient(script.machine, lambda: ours, 1)
    thread.start()
    assert theirs.recv(5) == READY
    theirs.send(frame[:8])
    wait_until(lambda: script.machine.receiver.decoder.in_message)
    theirs.send(frame[8:])
    assert isinstance(script.next(), Frame)
    assert thread.pauses == [] and not ours.is_terminal
    thread.stop()


class Babbler(NoLine):
    """A connection with bytes at every read but the last; what it costs is told to its clocks."""

    def __init__(self, data: bytes, reads: int, *, has_more: bool = True, quiet: int = 0) -> None:
        self.now = 100.0
        self.worked = 0.0
        self.has_more = has_more
        self._quiet = quiet  # the number of a read after a minute, that takes all
        self._data = data
        self._reads = reads

    def clock(self) -> float:
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Return so many bytes."""
        self._reads -= 1
        if not self._reads:
            raise OSError('the end')
        if self._quiet:
            self.has_more = self._reads != self._quiet
            self.now += 60.0 * (not self.has_more)
        return self._data


class Restful(Impatient):
    """A link thread that tells how much it has taken, and how long it leaves the port alone."""

    def __init__(self, script: Script, port: Babbler, *, work: float = 0.0, host: float = 0.0,
                 late: Sequence[float] = (), **options: object) -> None:
        super().__init__(script.machine, lambda: port, 1, clock=port.clock,
                         processor_clock=lambda: port.worked, **options)
        self.rests: list[float] = []
        self.taken: list[int] = []
        self.behind: list[bool] = []
        self._babbler = port
        self._late = iter(late)
        receive = script.machine.receive_data

        def take(data: bytes, now: float) -> None:
            self.taken.append(len(data))
            self.behind.append(script.machine.is_behind)
            receive(data, now)
            port.worked += work
            port.now += work + host

        script.machine.receive_data = take  # type: ignore[method-assign]

    def _rest(self, seconds: float) -> None:
        self.rests.append(seconds)
        self._babbler.now += seconds + next(self._late, 0.0)


@pytest.mark.parametrize(('work', 'host', 'rest'), [
    (0.001, 0.0, 0.019),  # 19 times as long as it took
    (0.001, 0.01, 0.019),  # of the processor, not of the clock
    (0.004, 0.0, 0.060)])  # up to the 64 ms that these bytes take on the line
def test_connection_that_babbles_leaves_time_to_others(
        work: float, host: float, rest: float) -> None:
    script = Script(Listen(None), timing=LineTiming(0.001))
    thread = Restful(script, Babbler(bytes(READ_SIZE), 11, quiet=6), work=work, host=host)
    script.machine.came = came = Mock()  # type: ignore[method-assign]
    thread.run_out()
    assert [call.args[0] for call in came.call_args_list] == [READ_SIZE] * 10
    assert thread.taken == [*[64] * 4 * 8, READ_SIZE, *[64] * 5 * 8]
    assert [at for at, is_behind in enumerate(thread.behind) if not is_behind] == [4 * 8]
    del thread.rests[4 * 8]  # after the work of the read before it too
    assert thread.rests == [pytest.approx(rest)] * 71


def test_burst_beside_load_takes_the_time_of_the_line() -> None:
    """Some portions wait long for the processor; the others make up for it."""
    script = Script(Listen(None), timing=LineTiming(0.001))
    port = Babbler(bytes(READ_SIZE), 9)
    Restful(script, port, work=0.01, late=[0.3] * 10).run_out()
    assert port.now - 100.0 == pytest.approx(8 * READ_SIZE * 0.001)


@pytest.mark.parametrize(('reads', 'others'), [(2001, 4), (8009, 19)])
def test_flood_is_dropped_after_its_first_bytes(reads: int, others: int) -> None:
    """It leaves time to others: most of it, when it is longer than what a server may keep."""
    script = Script(Listen(None))
    port = Babbler(bytes(READ_SIZE), reads + 1, quiet=1)
    thread = Restful(script, port)
    drop, dropped, were_old = script.machine.drop, list[int](), list[bool]()

    def take(count: int, now: float) -> None:
        dropped.append(count)
        drop(count, now)
        were_old.append(script.machine.may_be_old)
        port.worked += 0.0001

    script.machine.drop = take  # type: ignore[method-assign]
    thread.run_out()
    assert thread.taken == [64] * (64 + 8)
    assert set(dropped[:-1]) == {65536 + READ_SIZE}
    assert sum(dropped) == READ_SIZE * (reads - 9)
    assert max(thread.rests) == pytest.approx(others * 0.0001)
    assert script.machine.counters.chars_received == reads * READ_SIZE
    assert all(were_old)


def test_command_around_a_flood_is_no_command() -> None:
    """What comes before dropped bytes and what comes after them are never one message."""
    frame = message_frame(Packet(1, 5, 0x0F, 0, 7).encode(), Checksum.CRC)
    for dropped in (0, 512):
        script = Script(Listen(None))
        script.machine.start(0.0)
        script.machine.receive_data(frame[:6], 0.0)
        if dropped:
            script.machine.drop(dropped, 0.0)
        script.machine.receive_data(frame[6:], 0.0)
        heard = [] if script.heard.empty() else [script.heard.get_nowait()]
        assert any(isinstance(symbol, Frame) and symbol.fault is None
                   for symbol in heard) is (dropped == 0)


@pytest.mark.parametrize(('char_time', 'pace'), [(0.001, 0.001), (0.0, 10 / 115200)])
def test_commands_of_a_device_server_alone_are_rested_after_too(
        char_time: float, pace: float) -> None:
    script = Script(Listen(None), timing=LineTiming(char_time))
    port = Babbler(b'', 11)
    thread = Restful(script, port)
    port.worked = 1.0
    thread.run_out()
    assert thread.taken == []
    assert thread.rests[0] == pytest.approx(pace * READ_SIZE)


def test_connection_that_babbles_does_not_keep_a_request_from_the_machine() -> None:
    script = Script(Rest(), Send(b'awake', None))
    thread = Restful(script, Babbler(bytes(READ_SIZE), 11),
                     on_state=lambda state: thread.wake())  # as soon as the port is open
    thread.run_out()
    assert script.next() is None


def test_damaged_character_of_a_burst_stays_damaged() -> None:
    script, port = Script(Listen(None)), Babbler(b'', 0)
    frame = message_frame(Packet(1, 5, 0x0F, 0, 7).encode(), Checksum.CRC)
    port.read = Mock(side_effect=[  # type: ignore[method-assign]
        frame[:4], Damaged(frame[4:5]), frame[5:], OSError('the end')])
    Restful(script, port).run_out()
    assert isinstance(message := script.next(), Frame)
    assert message.fault is FrameFault.BAD_CHECK


def test_bytes_may_have_come_since_an_attempt_to_open_began() -> None:
    thread = Impatient(Script().machine, Mock(side_effect=OSError('no client')), 1,
                       clock=count(100.0).__next__)
    thread.run_out()
    assert thread.came_after == 101.0


def test_no_byte_came_while_the_port_was_left_to_another_program() -> None:
    def told(state: PortState) -> None:
        if state.text == RELEASED:
            port.now = 60.0
            thread.take()
        came.append(thread.came_after)

    script, port, came = Script(Rest()), Paused(), list[float]()
    thread = Impatient(script.machine, lambda: port, 1, clock=port.clock, on_state=told)
    thread.is_released = True
    thread.run_out()
    assert came == [0.0, 60.0, 60.0]


def test_request_that_comes_together_with_bytes_is_taken_after_them() -> None:
    script, port = Script(Rest(), Send(b'awake', 3600.0)), NoLine()
    port.read = Mock(side_effect=[b'x', b'', OSError('the end')])  # type: ignore[method-assign]
    thread = Impatient(script.machine, lambda: port, 1, longest_wait=0.25,
                       on_state=lambda state: thread.wake())
    thread.run_out()
    assert [call.args[0] for call in port.read.call_args_list] == [0.25] * 3
    assert script.heard.get_nowait() is None


def test_rest_in_a_burst_ends_with_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    wake = Mock(descriptor=0, take=lambda: False)
    monkeypatch.setattr('abdf1_ros.ports.port_thread.Wake', lambda: wake)
    for timeout, rest in ((0.005, 11), (3600.0, 64)):
        script = Script(Send(b'?', timeout), timing=LineTiming(0.001))
        port = Babbler(bytes(64), 2)
        Impatient(script.machine, Mock(return_value=port), 1, clock=port.clock,
                  processor_clock=count(1.0).__next__).run_out()
        assert wake.wait.call_args.args == (rest,)
