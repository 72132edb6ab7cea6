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

"""Listen on a port, or pass all bytes on between two ports."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from queue import Empty, SimpleQueue
import threading
import time

from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.endpoints import Endpoint, PtyWire, SerialEndpoint
from abdf1_ros.ports.opening import name_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.wake import Wake
from abdf1_ros.sniffer.capture import Chunk, Direction

_PTY = 'pty'

# Most chunks that wait for the output: some minutes of a busy line.
MOST_WAITING = 10_000


class _Received:
    """What the readers have heard and the output has not taken yet."""

    def __init__(self) -> None:
        self.waiting: SimpleQueue[tuple[int, Chunk] | OSError | None] = SimpleQueue()
        self.lost = 0  # chunks, after the last that waits
        self._lock = threading.Lock()

    def put(self, chunk: Chunk) -> None:
        """Keep a chunk, with the number of chunks lost before it; lose it if many wait."""
        with self._lock:
            if self.waiting.qsize() < MOST_WAITING:
                self.waiting.put((self.lost, chunk))
                self.lost = 0
            else:
                self.lost += 1


def is_pty(name: str) -> bool:
    """Tell whether ``name`` asks for a new pseudo-terminal: "pty" or "pty:NAME"."""
    return name.partition(':')[0] == _PTY


class _TapReader(threading.Thread):
    """Read a port, queue its bytes with their time, and pass them on at once."""

    def __init__(self, port: Port, direction: Direction, onward: Port | None, heard: _Received,
                 wake: int) -> None:
        super().__init__(name=f'tap {direction.value}')
        self.stopping = False
        self._port = port
        self._direction = direction
        self._onward = onward
        self._heard = heard
        self._wake = wake

    def run(self) -> None:
        """Read until asked to stop, or until a port is lost."""
        try:
            while not self.stopping:
                data = self._port.read(None, self._wake)
                if data:
                    # Queued before it is passed on. Otherwise an answer could be queued before it.
                    self._heard.put(Chunk(time.monotonic(), self._direction, data))
                    if self._onward is not None:
                        self._onward.write(data)
        except OSError as error:
            # Not as BrokenPipeError, which would look like the broken pipe of standard output.
            self._heard.waiting.put(OSError(error.strerror or str(error)))


class Tap:
    """
    One port to listen on, or two ports to pass bytes between; open during the ``with`` block.

    Each of ``names`` is a port with these ``settings``; "pty" or "pty:NAME" makes a new
    pseudo-terminal. The attribute ``names`` has the names that other programs use. Raises OSError
    if a port cannot be opened.
    """

    def __init__(self, names: Sequence[str], settings: PortSettings) -> None:
        self.names: list[str] = []
        self._settings = settings
        self._heard = _Received()
        with ExitStack() as stack:
            ports = [self._open(name, stack) for name in names]
            self._open_ports = stack.pop_all()
        self._begun = time.monotonic()
        self._lost = 0
        self._wake = Wake()
        if len(ports) == 1:
            self._readers = [self._reader(ports[0], Direction.UNKNOWN, None)]
        else:
            self._readers = [self._reader(ports[0], Direction.OUT, ports[1]),
                             self._reader(ports[1], Direction.IN, ports[0])]

    def __enter__(self) -> Tap:
        for reader in self._readers:
            reader.start()
        return self

    def __exit__(self, *exception: object) -> None:
        """End all threads, then close the ports."""
        for reader in self._readers:
            reader.stopping = True
        self._wake.set()  # never taken, so that every reader wakes up
        for reader in self._readers:
            reader.join()
        self._wake.close()
        self._open_ports.close()

    def new_losses(self) -> int:
        """
        Return how many chunks were lost just before the last chunk, or at the end of ``chunks``.

        ``chunks`` was used too slowly then. A second call returns 0.
        """
        lost, self._lost = self._lost, 0
        return lost

    def stop(self) -> None:
        """End ``chunks``; may be called by a signal handler."""
        self._heard.waiting.put(None)

    def chunks(self, seconds: float, period: float, idle: Callable[[], None]) -> Iterator[Chunk]:
        """
        Yield the bytes that are received, with the seconds since the ports were opened.

        It ends after ``seconds`` or ``stop``. ``idle`` is called every ``period`` seconds in
        which nothing is heard. Raises OSError if a port is lost.
        """
        end = self._begun + seconds
        try:
            while (left := end - time.monotonic()) > 0:
                try:
                    item = self._heard.waiting.get(timeout=min(left, period))
                except Empty:
                    idle()
                    continue
                if item is None:
                    return
                if isinstance(item, OSError):
                    raise item
                self._lost, chunk = item
                # In microseconds, as in a capture, so that live and saved traffic look the same.
                yield chunk._replace(time=round((chunk.time or 0.0) - self._begun, 6))
        finally:
            self._lost, self._heard.lost = self._heard.lost, 0

    def _open(self, name: str, stack: ExitStack) -> Port:
        line = self._line(name)
        stack.callback(line.close)
        port = line.open()
        stack.callback(port.close)
        self.names.append(line.name)
        return port

    def _line(self, name: str) -> Endpoint:
        if is_pty(name):
            return PtyWire(name.partition(':')[2] or None)
        try:
            return SerialEndpoint(replace(self._settings, name=name))
        except OSError as error:
            name_port(error, name)
            raise

    def _reader(self, port: Port, direction: Direction, onward: Port | None) -> _TapReader:
        return _TapReader(port, direction, onward, self._heard, self._wake.descriptor)
