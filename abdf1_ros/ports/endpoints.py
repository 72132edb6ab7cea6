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

"""Ends of lines that we make or open: pseudo-terminal, listening TCP port, serial port."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
import fcntl
from functools import partial
import os
from pathlib import Path
import select
import socket
import termios
from time import monotonic
import tty
from typing import Protocol

from abdf1_ros.line_names import link_of
from abdf1_ros.ports.descriptor import DescriptorPort, NoClient, Port
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.ownership import own
from abdf1_ros.ports.settings import PortSettings

_PTYS = '/dev/pts/'

_GLANCE = 0.2  # s; longest wait for a client in ``open``

_PAUSE = 50  # ms between two reads of a wire that no program has opened

# A client that gives no sign of life for this time (s) loses its place to the next client.
_SILENT = 30.0

# TCP probes a silent client after 4 s, then every 2 s. After three probes without an answer the
# client counts as gone. Bytes sent to it have to arrive within the same 10 s.
_TCP = socket.IPPROTO_TCP
TCP_OPTIONS = (
    (_TCP, socket.TCP_NODELAY, 1), (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (_TCP, socket.TCP_KEEPIDLE, 4), (_TCP, socket.TCP_KEEPINTVL, 2), (_TCP, socket.TCP_KEEPCNT, 3),
    (_TCP, socket.TCP_USER_TIMEOUT, 10_000))


class Endpoint(Protocol):
    """
    The end of a line that a link opens as its port, and opens again after a loss.

    ``name`` is the name that other programs use. The constructor raises OSError if the
    endpoint cannot be made.
    """

    name: str

    def open(self) -> Port:  # noqa: A003
        """Return the port; raise OSError while there is none."""

    def close(self) -> None:
        """Remove the endpoint; the caller closes the port that ``open`` has returned."""


class PtyEndpoint:
    """
    A pseudo-terminal; ``link`` is a name for its far end.

    A link that an earlier run has left is replaced. Raises OSError if another file has the name.
    """

    def __init__(self, link: str | None) -> None:
        self._link = Path(link) if link else None
        self._lock = _own(self._link) if self._link else None
        self._ends: list[int] = []
        try:
            self._make()
        except OSError:
            if self._lock is not None:
                self._lock.close()
            raise
        self.name = link or self._target

    def _make(self) -> None:
        """Make the pseudo-terminal and its name; close the one before it."""
        if self._link:
            # Done before we make a terminal, because it may get the number in an old link.
            _remove_left_over(self._link)
        # Both ends stay open. Otherwise a read fails while no client is connected.
        ends = [*os.openpty()]
        tty.setraw(ends[1])
        target = os.ttyname(ends[1])
        try:
            if self._link:
                _make_link(self._link, target)
        except OSError:
            _close(ends)
            raise
        _close(self._ends)
        self._ours, self._ends, self._target = ends[0], ends, target

    def open(self) -> Port:  # noqa: A003
        """Return our end."""
        descriptor = os.dup(self._ours)
        return DescriptorPort(descriptor, lambda: os.close(descriptor))

    def drop_unread(self) -> None:
        """Drop the bytes that no program has read."""
        theirs = os.open(self._target, os.O_RDWR | os.O_NOCTTY)
        fcntl.ioctl(theirs, termios.TIOCNXCL)  # we may be root, other programs may not
        _drop_received(theirs)
        os.close(theirs)

    def close(self) -> None:
        """Remove the pseudo-terminal and its name."""
        if self._link and _target_of(self._link) == self._target:
            self._link.unlink()
        _close(self._ends)
        self._ends.clear()  # by the next ``close`` the numbers may belong to others
        if self._lock is not None:
            self._lock.close()


class _ShowingPty(PtyEndpoint):
    """A pseudo-terminal that shows whether a program has opened the far end."""

    def _make(self) -> None:
        super()._make()
        os.close(self._ends.pop())

    @property
    def is_idle(self) -> bool:
        """Tell whether no program has opened the far end."""
        hangs_up = select.poll()
        hangs_up.register(self._ours, 0)
        return bool(hangs_up.poll(0))


class PtyPlace(_ShowingPty):
    """
    A pseudo-terminal for one program at a time.

    When a program ends, bytes that it has not read are dropped. So are bytes that it has written
    shortly before its end. If it has kept the terminal for itself (TIOCEXCL), another terminal
    takes the name.
    """

    def open(self) -> Port:  # noqa: A003
        """Return our end if a program has opened the far end; raise NoClient otherwise."""
        if self.is_idle:
            try:
                self._forget()
            except OSError:
                # A program has set TIOCEXCL, which lasts as long as this terminal.
                if self.is_idle:  # not the next program, which has come just now
                    self._make()
            raise NoClient
        descriptor = os.dup(self._ours)

        def close() -> None:
            os.close(descriptor)
            with suppress(OSError):  # left to ``open``
                self._forget()

        return DescriptorPort(descriptor, close)

    def _forget(self) -> None:
        """Drop the bytes of both directions."""
        _drop_received(self._ours)
        self.drop_unread()


class PtyWire(_ShowingPty):
    """
    A pseudo-terminal as a wire: bytes that no program takes are lost.

    A wire that ``is_awaited`` cannot be opened before a first program has opened the far end. If a
    program has kept the terminal for itself (TIOCEXCL), another terminal takes the name.
    """

    def __init__(self, link: str | None, *, is_awaited: bool = False) -> None:
        super().__init__(link)
        self._is_awaited = is_awaited

    def open(self) -> Port:  # noqa: A003
        """Return our end, which stays open while programs come and go; may raise NoClient."""
        if self._is_awaited and self.is_idle:
            raise NoClient
        descriptor = os.dup(self._ours)
        return _WirePort(descriptor, lambda: os.close(descriptor), self)

    def forget(self, descriptor: int) -> None:
        """Drop the bytes that no program has read; ``descriptor`` may get a new far end."""
        try:
            self.drop_unread()
        except OSError:
            if not self.is_idle:  # a program has come and keeps others out
                return
            if self._link is None:  # no program would find the new terminal
                raise OSError(f'a program keeps {self.name} for itself; with pty:NAME another '
                              'terminal would take the name') from None
            self._make()
            os.set_blocking(self._ours, False)
            os.dup2(self._ours, descriptor, inheritable=False)


class _WirePort(DescriptorPort):
    """Our end of a ``wire``."""

    def __init__(self, descriptor: int, close: Callable[[], None], wire: PtyWire) -> None:
        super().__init__(descriptor, close)
        self._wire = wire

    def read(self, timeout: float | None, wake: int) -> bytes:
        try:
            return super().read(timeout, wake)
        except OSError:  # no program has opened the far end
            self._wire.forget(self._descriptor)
        pause = select.poll()
        pause.register(wake, select.POLLIN)
        pause.poll(_PAUSE if timeout is None else min(timeout * 1000, _PAUSE))
        return b''

    def write(self, data: bytes) -> None:
        with suppress(BlockingIOError):
            if not self._wire.is_idle:
                os.write(self._descriptor, data)


def _drop_received(terminal: int) -> None:
    fcntl.ioctl(terminal, termios.TCFLSH, termios.TCIFLUSH)  # tcflush raises termios.error


def _close(ends: Iterable[int]) -> None:
    for end in ends:
        os.close(end)


def _own(link: Path) -> socket.socket:
    """Reserve a link; raise OSError if this or another process has it."""
    try:
        # Not as a device: a program that looks for a missing device reserves its name meanwhile.
        return own(f'link {link_of(str(link))}')
    except OSError:
        raise OSError(f'{link} is in use by another bridge, simulator or sniff') from None


def _remove_left_over(link: Path) -> None:
    """Remove the link of an earlier run."""
    if _target_of(link).startswith(_PTYS):
        link.unlink()


def _make_link(link: Path, target: str) -> None:
    """Make ``link`` point to a pseudo-terminal; raise OSError with the reason if it cannot."""
    try:
        link.symlink_to(target)
    except FileExistsError:
        raise OSError(f'{link} exists already, and no simulator has made it; give another '
                      'name') from None
    except OSError as error:
        raise OSError(f'{link} cannot be made: {error.strerror}') from None


def _target_of(link: Path) -> str:
    """Return the target of a symbolic link, empty if there is none."""
    try:
        return os.readlink(link)
    except OSError:
        return ''


class _ClientPort(DescriptorPort):
    """
    The connection of the one client of a listening port.

    ``look`` is called after each read; its argument tells whether the read has brought bytes. It
    raises OSError if another client takes the place.
    """

    def __init__(self, client: socket.socket, listener: socket.socket,
                 look: Callable[[bool], None]) -> None:
        super().__init__(client.fileno(), client.close)
        self._poll.register(listener, select.POLLIN)
        self._look = look

    def read(self, timeout: float | None, wake: int) -> bytes:
        data = super().read(timeout, wake)
        self._look(bool(data))
        return data


def _has_left(client: socket.socket) -> bool:
    """Tell whether the client has closed, even if we have not read all its bytes."""
    closed = select.poll()
    closed.register(client, select.POLLRDHUP)
    return bool(closed.poll(0))


def listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens, and does not wait for a client; OSError if it cannot."""
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    listener = socket.create_server((host, port), family=family)
    listener.setblocking(False)
    return listener


class TcpEndpoint:
    """
    A listening TCP port, which one client at a time uses as a line; with 0, any free port.

    The connection of a second client is closed at once, and ``tell`` is called with its address.
    But a second client takes the place of a client that has closed, or has given no sign of life
    for 30 s. A sign of life is a change of ``count_frames()``, the number of good frames so far;
    without it, any byte. The loss of a client is noticed within 10 s. ``open`` waits ``glance``
    seconds for a client.
    """

    def __init__(self, host: str, port: int, tell: Callable[[str], None] = lambda other: None,
                 glance: float = _GLANCE, count_frames: Callable[[], int] | None = None) -> None:
        self._listener = listening(host, port)
        self._tell = tell
        self._glance = glance
        self._next: socket.socket | None = None
        self._count_frames = count_frames
        self._frames = 0
        self._heard = 0.0  # when the client gave its last sign of life (s)
        host, port = self._listener.getsockname()[:2]
        self.name = f'socket://[{host}]:{port}' if ':' in host else f'socket://{host}:{port}'

    def open(self) -> Port:  # noqa: A003
        """Return the connection of a client; raise NoClient while there is none."""
        client, self._next = self._next, None
        if client is None:
            glance = select.poll()
            glance.register(self._listener, select.POLLIN)
            glance.poll(self._glance * 1000)
            try:
                client, _ = self._listener.accept()
            except BlockingIOError:
                raise NoClient from None
        for level, option, value in TCP_OPTIONS:
            client.setsockopt(level, option, value)
        self._heard = monotonic()
        return _ClientPort(client, self._listener, partial(self._look, client))

    def _look(self, client: socket.socket, has_said: bool) -> None:
        """Refuse another client, or raise OSError if it takes the place of this client."""
        if self._count_frames is not None:
            before, self._frames = self._frames, self._count_frames()
            has_said = self._frames != before
        if has_said:
            self._heard = monotonic()
        try:
            other, address = self._listener.accept()
        except BlockingIOError:
            return
        if _has_left(client):
            self._next = other
            raise OSError('the program closed the connection, and another program has come')
        if monotonic() - self._heard > _SILENT:
            self._next = other
            raise OSError(f'the program gave no sign of life for {_SILENT:.0f} s, and another '
                          'program has come')
        other.close()
        self._tell(':'.join(map(str, address[:2])))

    def close(self) -> None:
        """Stop listening."""
        self._listener.close()
        if self._next is not None:
            self._next.close()


class SerialEndpoint:
    """A serial port, of this machine or of a device server."""

    def __init__(self, settings: PortSettings) -> None:
        self.name = settings.name
        self._settings = settings
        # Opened at once: a lost port may come back, but a port that never existed is a mistake.
        self._first: Port | None = open_port(settings)

    def open(self) -> Port:  # noqa: A003
        """Return the port, opened again from the second call on."""
        port, self._first = self._first, None
        return port or open_port(self._settings)

    def close(self) -> None:
        """Close the port if ``open`` has not returned it."""
        if self._first is not None:
            self._first.close()
