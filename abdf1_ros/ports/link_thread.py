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

"""The thread that runs a machine on a port."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import math
import threading
import time

from abdf1_ros.df1.machine import Machine
from abdf1_ros.errors import CLOSED, INTERNAL_ERROR, PortLost
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import NoClient, Port, READ_SIZE
from abdf1_ros.ports.pace import Pace
from abdf1_ros.ports.port_thread import PortKind, PortState, PortThread, RELEASED

# Time (s) between attempts to open a port. An attempt costs almost nothing. A person who has
# plugged the cable in again waits for it.
_RETRY_PERIOD = 0.5

_MAX_FAULTS = 3
_FAULT_WINDOW = 60.0

_POLL_STEP = 0.001  # poll(2) counts milliseconds

_DROPPED = 65536  # bytes of a flood that are dropped between two rests
_PORTION = 64  # most bytes of one step of work, if bytes come too fast


# The error for all commands that are under way when files are read again.
_READ_AGAIN = 'the files have been read again'
_GLANCE = 0.1


class _Exchange:
    """The next machine of a line; ``is_done`` is set when it has replaced the last machine."""

    def __init__(self, machine: Machine, while_sending: Callable[[], None], reopen: bool,
                 reason: str, take_over: Callable[[], None]) -> None:
        self.reason = reason
        self.machine = machine
        self.while_sending = while_sending
        self.reopen = reopen
        self.take_over = take_over
        self.is_done = threading.Event()
        self._claim = threading.Lock()

    def claim(self) -> bool:
        """Return True to the first caller only, who then does the exchange or cancels it."""
        return self._claim.acquire(blocking=False)


class Attempt(threading.Thread):
    """
    Open a port in a thread of its own, because a name server may take minutes.

    ``wake`` is called at the end, unless ``abandon`` was called before.
    """

    def __init__(self, open_port: Callable[[], Port], wake: Callable[[], None]) -> None:
        super().__init__(name='df1 opening', daemon=True)
        self.port: Port | None = None
        self.error: Exception | None = None
        self._open_port = open_port
        self._wake = wake
        self._lock = threading.Lock()
        self._is_abandoned = False

    @property
    def is_over(self) -> bool:
        """Tell whether there is a port or an error."""
        return self.port is not None or self.error is not None

    def run(self) -> None:
        """Open the port."""
        port = error = None
        try:
            port = self._open_port()
        except Exception as caught:  # raised again in the thread that waits
            error = caught
        with self._lock:
            if not self._is_abandoned:
                self.port, self.error = port, error
                self._wake()
                return
        if port is not None:
            port.close()

    def abandon(self) -> None:
        """Close the port, now or as soon as it is open."""
        with self._lock:
            self._is_abandoned = True
        if self.port is not None:
            self.port.close()


class LinkThread(PortThread):
    """
    Run ``machine`` on the port that ``open_port`` opens; open it again when it is lost.

    ``on_state`` is called in this thread when the port opens, is lost, or cannot be opened.
    Attempts to open it are ``retry_period`` seconds apart. ``came_after`` is the last clock value
    (s) at which all bytes had been read: bytes that the machine gets now came later. It is at most
    about ``longest_wait`` s ago, because no wait takes longer. ``while_sending`` is called
    whenever all bytes to send have been given to the port, so its work does not delay the line.

    ``on_fault`` is called with an exception that is a bug. The machine then starts again. Three
    such exceptions within a minute end the thread, and ``has_failed`` becomes True.

    ``exchange`` puts another machine on the line.
    """

    def __init__(self, machine: Machine, open_port: Callable[[], Port], *,
                 on_state: Callable[[PortState], None] = lambda state: None,
                 on_fault: Callable[[Exception], None] = lambda error: None,
                 while_sending: Callable[[], None] = lambda: None,
                 retry_period: float = _RETRY_PERIOD,
                 longest_wait: float = math.inf,
                 clock: Callable[[], float] = line_time,
                 processor_clock: Callable[[], float] = time.thread_time) -> None:
        super().__init__('df1 link', on_fault)
        self._machine = machine
        self._open_port = open_port
        self._on_state = on_state
        self._while_sending = while_sending
        self.retry_period = retry_period
        self._longest_wait = longest_wait
        self.came_after = -math.inf
        self._clock = clock
        self._pace = Pace(clock, processor_clock)
        self._next: _Exchange | None = None
        self.has_turned = True  # a supervisor sets it to False, and looks for True later
        self._faults: deque[float] = deque(maxlen=_MAX_FAULTS)

    def exchange(self, machine: Machine, while_sending: Callable[[], None], reopen: bool,
                 reason: str = _READ_AGAIN,
                 take_over: Callable[[], None] = lambda: None) -> bool:
        """
        Go on with another machine, on the same port, or with ``reopen`` on a newly opened port.

        Commands under way end with an error that tells the ``reason``. ``take_over`` is called in
        the link's thread: the old machine has stopped, and the other has not begun. Return True
        if the machine is on the line within about 5 s. If not, the exchange is cancelled. Called
        from one thread only.
        """
        exchange = _Exchange(machine, while_sending, reopen, reason, take_over)
        self._next = exchange
        self.wake()
        return self._has_happened(exchange.is_done) or (
            not exchange.claim() and self._has_happened(exchange.is_done))

    def run(self) -> None:
        """Keep the port open and the machine running."""
        self.came_after = self._clock()
        super().run()

    @property
    def _is_interrupted(self) -> bool:
        """Tell whether the port has to be closed, or another one opened."""
        return self._stopping or self.is_released or (
            self._next is not None and self._next.reopen)

    def _keep_open(self) -> None:
        while not self._stopping and not self.has_failed:
            self._exchange()
            if self.is_released:
                self._set_state(False, RELEASED)
                self._is_free.set()
                self._wait()
                self.came_after = self._clock()  # no byte comes to a port that is closed
            elif not self._use_port() and not self.has_failed:
                self._pause(self.retry_period)
        if self.state.is_open:
            self.state = PortState(False, 'closed')

    def _use_port(self) -> bool:
        """Open the port and run on it; return False if it cannot be opened, or was lost."""
        asked = self._clock()
        try:
            port = self._opened_port()
        except NoClient as error:
            self._set_state(False, str(error), PortKind.NO_CLIENT)
        except OSError as error:
            self._set_state(
                False, f'cannot open the port: {_reason(error)}', PortKind.UNAVAILABLE)
        else:
            return port is None or self._run_on(port)
        self.came_after = asked
        return False

    def _opened_port(self) -> Port | None:
        """Return the port, or None if it is no longer needed; raises OSError."""
        attempt = Attempt(self._open_port, self.wake)
        try:
            attempt.start()
        except RuntimeError as error:  # the system has no thread to give
            raise OSError(str(error)) from None
        while not attempt.is_over and not self._is_interrupted:
            self._exchange(keeps_port=True)
            self._wait()
        if self._is_interrupted:
            attempt.abandon()
            attempt.join(_GLANCE)  # most ports are open, and so closed, at once
            return None
        attempt.join()  # it has only its call of ``wake`` left to do
        self._wake.take()
        if attempt.error is not None:
            raise attempt.error
        return attempt.port

    def _exchange(self, keeps_port: bool = False) -> None:
        """
        If another machine has been handed over, put it on the line.

        With ``keeps_port``, a machine for another port waits until this port is closed.
        """
        self.has_turned = True
        exchange = self._next
        if exchange is None or (keeps_port and exchange.reopen):
            return
        self._next = None
        if exchange.claim():
            self._machine.stop(PortLost(exchange.reason), self._clock())
            self._while_sending()
            exchange.take_over()
            self._machine, self._while_sending = exchange.machine, exchange.while_sending
            exchange.is_done.set()

    def _run_on(self, port: Port) -> bool:
        """Run machines until the port has to be closed; return False if it was lost."""
        self._set_state(True, 'open')
        end = CLOSED
        try:
            while not self._is_interrupted:
                self._exchange(keeps_port=True)
                self._serve(port)
            if self.is_released:
                end = RELEASED
            elif not self._stopping:
                end = _READ_AGAIN
                # Not reported: mostly the port is open at once, but a name server takes minutes.
                self.state = PortState(False, 'the port is being opened')
            return True
        except OSError as error:
            end = _reason(error)
            self._set_state(False, f'the port was lost: {end}')
        except Exception as error:  # the first bug must not end the bridge
            end = INTERNAL_ERROR
            self._take_fault(error)
        finally:
            self._machine.stop(PortLost(end), self._clock())
            port.close()
            self._while_sending()  # its work has waited for the next frame, which does not come
        return False

    def _serve(self, port: Port) -> None:
        """Run the machine until the thread stops, the port is released, or a machine follows."""
        machine, clock = self._machine, self._clock
        sender = machine.sender
        machine.start(clock(), port)
        left = b''
        while not (self._stopping or self.is_released or self._next):
            self.has_turned = True
            while sender.send_before < math.inf and (now := clock()) > sender.send_before:
                machine.withdraw(now)  # this process has not run for a while
            data = sender.data_to_send()
            if data:
                port.write(data)
            self._while_sending()
            # Bytes of a connection are always read at once: they may come faster than Baud.
            if port.is_terminal and (spare_time := machine.spare_time):
                self._pause(spare_time)
            deadline, asked = machine.next_call, clock()
            wait = self._longest_wait if deadline is None else max(0.0, deadline - asked)
            timeout = min(wait, self._longest_wait)
            try:
                data = left or port.read(
                    None if timeout == math.inf else timeout, self._wake.descriptor)
            except OSError:
                machine.counters.read_errors += 1
                raise
            now = clock()
            if deadline is not None and now >= deadline:
                # The deadline comes before the bytes: after a pause of this process, it is unknown
                # whether an answer in the buffer came in time.
                machine.handle_timeout(now)
            if not left:  # a terminal keeps few bytes, and a pseudo-terminal has no speed
                machine.came(0 if port.is_terminal else len(data), now)
            machine.is_behind = port.has_more or len(data) > _PORTION and bool(left)
            if port.has_more and not left and self._pace.is_flood:
                left = self._drop(port, len(data), now)
                continue
            if left or port.has_more:
                left = self._take_portion(data, now)
                continue
            self._pace.line_until = -math.inf
            if data:
                machine.receive_data(data, now)
            elif self._wake.take() and not self._stopping:
                machine.wake(now)
            self.came_after = asked

    def _wait(self) -> None:
        """Wait for a wake."""
        self._wake.wait()
        self._wake.take()

    def _take_portion(self, data: bytes, now: float) -> bytes:
        """Work on some of the bytes that come too fast, then rest; return the bytes left."""
        machine = self._machine
        portion = data if len(data) <= _PORTION else data[:_PORTION]  # data may be ``Damaged``
        if portion:
            machine.receive_data(portion, now)
        # There is no portion if all bytes read were commands of a device server.
        self._rest_after(len(portion) or READ_SIZE, now)
        return data[_PORTION:]

    def _drop(self, port: Port, count: int, now: float) -> bytes:
        """Drop ``count`` bytes of a flood and more, then rest; return the bytes at its end."""
        data = b''
        while port.has_more and count < _DROPPED:
            count += len(data)
            data = port.read(0.0, self._wake.descriptor)
        if port.has_more:
            count, data = count + len(data), b''
        self._machine.drop(count, now)
        self._rest_after(count, now)
        return data

    def _rest_after(self, count: int, now: float) -> None:
        """Rest after ``count`` bytes, then take a wake."""
        machine = self._machine
        self._rest(self._pace.rest_after(count, machine.timing.char_time, now))
        self._pace.go_on()
        if self._wake.take() and not self._stopping:
            machine.wake(self._clock())

    def _rest(self, seconds: float) -> None:
        """Let other threads have the processor, for some time, or until a deadline or a wake."""
        deadline = self._machine.next_call
        if deadline is not None:
            seconds = max(0.0, min(seconds, deadline - self._clock()))
        self._wake.wait(math.ceil(seconds * 1000))

    def _pause(self, seconds: float) -> None:
        """Wait, but only while the port need not be closed, or another port opened."""
        end = self._clock() + seconds
        while not self._is_interrupted and (left := end - self._clock()) > 0:
            if left < _POLL_STEP:
                time.sleep(left)
            else:
                self._wake.wait(int(left / _POLL_STEP))
                self._wake.take()

    def _set_state(self, is_open: bool, text: str, kind: PortKind = PortKind.OTHER) -> None:
        self.state = PortState(is_open, text, kind)
        self._on_state(self.state)

    def _take_fault(self, error: Exception) -> None:
        self._faults.append(self._clock())
        recent = [when for when in self._faults if self._faults[-1] - when < _FAULT_WINDOW]
        self.has_failed = len(recent) >= _MAX_FAULTS
        self._set_state(False, f'internal error: {error!r}')
        self._on_fault(error)


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
