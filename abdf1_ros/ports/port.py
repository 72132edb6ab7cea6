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
Ports, and the thread that runs a machine on one.

A port that has a file descriptor is read with poll(2) and read(2), which costs a half to a
tenth of pyserial's own read; a port without one (rfc2217) is read through pyserial. What
adapters can do, and what it is worth, is in docs/adapters.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
import errno
import fcntl
import math
import os
import select
import socket
import struct
import termios
import threading
import time
from typing import Any, Protocol

from abdf1_ros.df1.machine import Machine
from abdf1_ros.errors import PortLost
from abdf1_ros.settings.network import Network
import serial
import serial.rfc2217
import serial.rs485

_READ_SIZE = 4096
_INT = struct.Struct('i')
_WRITE_TIMEOUT = 2.0

# A port without a descriptor cannot be waited for together with the wake descriptor; so long (s)
# it is waited for alone. It is set once, in open_port: at every change of it pyserial negotiates
# all settings of an rfc2217 port anew, which takes 0.1 s.
_GLANCE = 0.01

# Between attempts to open a port (s). They cost next to nothing, and whoever has plugged a
# cable in again is waiting.
_RETRY_PERIOD = 0.5

# After so long (s) without an answer from the far host a TCP connection is lost. The system's
# own limit is a quarter of an hour, in which it asks less and less often.
_SILENCE_LIMIT = 5

_MAX_FAULTS = 3
_FAULT_WINDOW = 60.0

# In words of ours, where those of the operating system tell too little.
_BUSY = 'another program has it open'
_REASONS = {errno.EAGAIN: _BUSY, errno.EBUSY: _BUSY, errno.ENOTTY: 'this is no serial port'}

_PARITIES = {'None': serial.PARITY_NONE, 'Even': serial.PARITY_EVEN, 'Odd': serial.PARITY_ODD}


class Port(Protocol):
    """An open line. Every method raises OSError when the line is gone."""

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes up to ``timeout`` s, or until the descriptor ``wake`` is readable."""

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to the operating system."""

    def unsent(self) -> int:
        """Return how many bytes of what was written have still to leave, 0 where nobody knows."""

    def close(self) -> None:
        """Give the line back."""


class DescriptorPort:
    """A port with a file descriptor, which is set to non-blocking; ``close`` closes it."""

    def __init__(self, descriptor: int, close: Callable[[], None]) -> None:
        self._descriptor = descriptor
        self._close = close
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)
        os.set_blocking(descriptor, False)

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes up to ``timeout`` s, or until ``wake`` is readable."""
        self._poll.register(wake, select.POLLIN)  # changes nothing from the second time on
        milliseconds = None if timeout is None else math.ceil(timeout * 1000)
        for descriptor, _ in self._poll.poll(milliseconds):
            if descriptor == self._descriptor:
                return self._take()
        return b''

    def _take(self) -> bytes:
        """Read what has come."""
        try:
            data = os.read(self._descriptor, _READ_SIZE)
        except BlockingIOError:
            return b''
        if not data:
            raise OSError('the other end has closed the connection')
        return data

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to the operating system."""
        give_up = time.monotonic() + _WRITE_TIMEOUT
        while data:
            try:
                data = data[os.write(self._descriptor, data):]
            except BlockingIOError:
                poll = select.poll()
                poll.register(self._descriptor, select.POLLOUT)
                left = give_up - time.monotonic()
                if left <= 0:
                    raise OSError('the line takes no data; is Handshake right?') from None
                poll.poll(math.ceil(left * 1000))

    def unsent(self) -> int:
        """Return how many bytes the operating system still has."""
        try:
            answer = fcntl.ioctl(self._descriptor, termios.TIOCOUTQ, bytes(_INT.size))
        except OSError:  # a device whose driver does not tell
            return 0
        count: int = _INT.unpack(answer)[0]
        return count

    def close(self) -> None:
        """Give the line back."""
        self._close()


class SerialPort:
    """A pyserial port without a file descriptor."""

    def __init__(self, port: serial.Serial | serial.rfc2217.Serial) -> None:
        self._port = port

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes up to ``timeout`` s, or until ``wake`` is readable."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            is_over = time.monotonic() >= end
            data = self._port.read(max(not is_over, self._port.in_waiting))
            if data or is_over or select.select([wake], [], [], 0)[0]:
                return bytes(data)

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to pyserial."""
        self._port.write(data)

    def unsent(self) -> int:
        """Return 0: the far port does not tell."""
        return 0

    def close(self) -> None:
        """Give the line back."""
        self._port.close()


class _Rfc2217Port(serial.rfc2217.Serial):
    """A port on a device server."""

    def _telnet_read_loop(self) -> None:
        """End without a traceback when the server hangs up during the negotiation."""
        with suppress(OSError):  # whoever opens or reads the port finds the thread dead
            super()._telnet_read_loop()  # type: ignore[misc]  # the stubs do not have it


@dataclass(frozen=True, slots=True)
class PortOptions:
    """
    What is asked of an adapter, if it can do it.

    ``low_latency`` hands on bytes as they come, where USB adapters gather them for up to
    16 ms; ``rs485`` switches the transmitter of an RS-485 port on and off with RTS.
    """

    low_latency: bool = True
    rs485: bool = False


USUAL_OPTIONS = PortOptions()


def open_port(network: Network, name: str | None = None, options: PortOptions = USUAL_OPTIONS,
              tell: Callable[[str], None] = lambda text: None) -> Port:
    """
    Open the port of a net CSV exclusively; ``name`` is used instead of its Com_Port.

    ``tell`` is called with what of ``options`` the port cannot do, which is no error. Raises
    OSError, also where pyserial has another exception for it.
    """
    try:
        url = name or network.port
        open_url = _Rfc2217Port if url.lower().startswith('rfc2217:') else serial.serial_for_url
        port = open_url(
            url, baudrate=network.baud, bytesize=network.data_bits,
            parity=_PARITIES[network.parity], stopbits=network.stop_bits,
            rtscts=network.handshake == 'Yes', timeout=_GLANCE, exclusive=True)
    except (OSError, ValueError, termios.error) as error:  # the last: not every device has parity
        raise OSError(*_plain(error)) from error
    if isinstance(port, serial.Serial):
        _set_options(port, options, tell)
    connection = getattr(port, '_socket', None)
    if isinstance(connection, socket.socket):
        _set_connection(connection)
    try:
        return DescriptorPort(port.fileno(), port.close)
    except (OSError, AttributeError):
        return SerialPort(port)


def _plain(error: Exception) -> tuple[Any, ...]:
    """Return what the operating system has said, without the words that pyserial puts around."""
    said = error.__context__ if isinstance(error, serial.SerialException) else error
    args = said.args if isinstance(said, OSError | termios.error) else error.args
    return (args[0], _REASONS.get(args[0], args[1])) if len(args) > 1 else args


def _set_options(port: serial.Serial, options: PortOptions, tell: Callable[[str], None]) -> None:
    """Ask the driver of a device for what goes beyond speed and character."""
    if options.low_latency:
        try:
            port.set_low_latency_mode(True)
        except (AttributeError, ValueError, OSError) as error:
            tell(f'the port has no low-latency mode: {error}')
    if options.rs485:
        try:
            port.rs485_mode = serial.rs485.RS485Settings()
        except (ValueError, OSError) as error:
            port.rs485_mode = None
            tell(f'the port has no RS-485 mode: {error}')


def _set_connection(connection: socket.socket) -> None:
    """Send every frame at once, and find out soon that the far host is gone."""
    # Without the first an ACK waits for the one before it. The last is for what we send, the
    # others for a line on which we only listen.
    for option, value in (
            (socket.TCP_NODELAY, 1), (socket.TCP_KEEPIDLE, _SILENCE_LIMIT),
            (socket.TCP_KEEPINTVL, 1), (socket.TCP_USER_TIMEOUT, _SILENCE_LIMIT * 1000)):
        connection.setsockopt(socket.IPPROTO_TCP, option, value)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)


@dataclass(frozen=True, slots=True)
class PortState:
    """Whether the port is open, and what there is to say about it."""

    is_open: bool
    text: str


class LinkThread(threading.Thread):
    """
    Run ``machine`` on the port that ``open_port`` opens; open it again when it is lost.

    ``on_state`` is called when the port opens, is lost, or cannot be opened (in this thread);
    attempts to open it are ``retry_period`` seconds apart. ``while_sending`` is called whenever
    all there is to send has been handed to the port: nobody on the line waits for what it does.
    ``on_fault`` is called with an exception that is a bug; the machine starts afresh after it.
    Three within a minute end the thread, and ``has_failed`` tells so.
    """

    def __init__(self, machine: Machine, open_port: Callable[[], Port], *,
                 on_state: Callable[[PortState], None] = lambda state: None,
                 on_fault: Callable[[Exception], None] = lambda error: None,
                 while_sending: Callable[[], None] = lambda: None,
                 retry_period: float = _RETRY_PERIOD,
                 clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(name='df1 link')
        self.state = PortState(False, 'not opened yet')
        self.has_failed = False
        self._machine = machine
        self._open_port = open_port
        self._on_state = on_state
        self._on_fault = on_fault
        self._while_sending = while_sending
        self._retry_period = retry_period
        self._clock = clock
        self._stopping = False
        self._is_closed = False
        self._faults: deque[float] = deque(maxlen=_MAX_FAULTS)
        self._wake_reader, self._wake_writer = os.pipe()
        os.set_blocking(self._wake_reader, False)
        os.set_blocking(self._wake_writer, False)

    def wake(self) -> None:
        """Tell the machine, from any thread, that there may be something new to do."""
        if not self._is_closed:
            with suppress(BlockingIOError):  # it is being woken already
                os.write(self._wake_writer, b'w')

    def stop(self) -> None:
        """End the thread, finishing what it does with an error, and wait for its end."""
        self._stopping = True
        self.wake()
        if self.is_alive():
            self.join()
        if not self._is_closed:
            self._is_closed = True
            os.close(self._wake_reader)
            os.close(self._wake_writer)

    def run(self) -> None:
        """Keep the port open and the machine running."""
        try:
            self._keep_open()
        except Exception as error:  # a bug outside of the machine; nobody else would see it
            self.has_failed = True
            self.state = PortState(False, f'internal error: {error!r}')
            self._on_fault(error)

    def _keep_open(self) -> None:
        while not self._stopping and not self.has_failed:
            try:
                port = self._open_port()
            except OSError as error:
                self._set_state(False, f'cannot open the port: {_reason(error)}')
            else:
                self._set_state(True, 'open')
                self._run_on(port)
            if not self._stopping and not self.has_failed:
                self._pause(self._retry_period)
        if self.state.is_open:
            self.state = PortState(False, 'closed')

    def _run_on(self, port: Port) -> None:
        end = 'the driver is stopping'
        try:
            self._serve(port)
        except OSError as error:
            end = _reason(error)
            self._set_state(False, f'the port was lost: {end}')
        except Exception as error:  # a bug must not end the bridge at its first appearance
            end = 'internal error, see the log'
            self._take_fault(error)
        finally:
            self._machine.stop(PortLost(end))
            port.close()
            self._while_sending()  # what was put off until the next frame, which never came

    def _serve(self, port: Port) -> None:
        machine, clock = self._machine, self._clock
        machine.send_at_once, machine.unsent = port.write, port.unsent
        # Only there do bytes come at the speed of the line; others may be faster than it is set.
        is_terminal = isinstance(port, DescriptorPort) and os.isatty(port.fileno())
        machine.start(clock())
        while not self._stopping:
            data = machine.data_to_send()
            if data:
                port.write(data)
            self._while_sending()
            if is_terminal and (spare_time := machine.spare_time):
                self._pause(spare_time)
            deadline = machine.next_call
            timeout = None if deadline is None else max(0.0, deadline - clock())
            data = self._read(port, timeout)
            # First: after a pause of this process the answer that lies in the buffer came too
            # late, or nobody can tell that it did not.
            machine.handle_timeout(clock())
            if data:
                machine.receive_data(data, clock())
            elif self._take_wake() and not self._stopping:
                machine.wake(clock())

    def _read(self, port: Port, timeout: float | None) -> bytes:
        try:
            return port.read(timeout, self._wake_reader)
        except OSError:
            self._machine.counters.read_errors += 1
            raise

    def _take_wake(self) -> bool:
        try:
            return bool(os.read(self._wake_reader, _READ_SIZE))
        except BlockingIOError:
            return False

    def _pause(self, seconds: float) -> None:
        """Wait, but not when asked to stop."""
        end = self._clock() + seconds
        while not self._stopping and (left := end - self._clock()) > 0:
            select.select([self._wake_reader], [], [], left)
            self._take_wake()

    def _set_state(self, is_open: bool, text: str) -> None:
        self.state = PortState(is_open, text)
        self._on_state(self.state)

    def _take_fault(self, error: Exception) -> None:
        self._faults.append(self._clock())
        recent = [when for when in self._faults if self._faults[-1] - when < _FAULT_WINDOW]
        self.has_failed = len(recent) >= _MAX_FAULTS
        self._set_state(False, f'internal error: {error!r}')
        self._on_fault(error)


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
