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

"""Record the bytes of a port, for the node's parameter ``trace_file`` and for ``sniff``."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
import math
from pathlib import Path
from queue import SimpleQueue
import threading
import time

from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.df1.packet import Packet
from abdf1_ros.ports.descriptor import Port, PortAround
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import Lack, PortSettings
from abdf1_ros.sniffer.capture import CaptureWriter, Chunk, Direction, LOST, setting_line

# Most chunks that wait for the disk: some minutes of a busy line.
MOST_WAITING = 10_000

LAST_CHUNKS = 1.0  # s; longest wait for the disk at the end


def begun_now() -> str:
    """Return the time of day for the head of a capture."""
    return datetime.now().astimezone().isoformat(timespec='milliseconds')


class Trace:
    """
    A capture that ends when it cannot be written; then ``on_error`` is called once.

    ``has_failed`` tells this too. A thread of its own writes the capture, so the line does not
    wait for a disk. If the disk is too slow, chunks are lost. The capture and ``on_error`` report
    this loss. ``on_news`` reports what another program has done to the file. ``limit`` is the most
    bytes on the disk. Raises OSError if the capture cannot be begun.
    """

    def __init__(self, path: str, settings: dict[str, str], on_error: Callable[[str], None],
                 limit: float = math.inf, on_news: Callable[[str], None] | None = None) -> None:
        self._path = path
        self._on_error = on_error
        tell = on_news or on_error
        self._writer = CaptureWriter(
            Path(path), limit, settings, lambda text: tell(f'{path} {text}'))
        # a number says how many chunks were lost at this place
        self._waiting: SimpleQueue[Chunk | str | dict[str, str] | int | None] = SimpleQueue()
        self._lost = 0
        self.has_failed = False
        self._thread = threading.Thread(target=self._run, name='trace', daemon=True)
        self._thread.start()

    def write(self, chunk: Chunk | str | dict[str, str]) -> None:
        """Queue a chunk or settings for the disk, from any thread; no effect after an error."""
        if self._waiting.qsize() < MOST_WAITING:
            self._put_lost()
            self._waiting.put(chunk)
        else:
            self._lost += 1

    def _put_lost(self) -> None:
        lost, self._lost = self._lost, 0
        if lost:
            self._waiting.put(lost)

    def close(self) -> None:
        """End the capture; wait at most 1 s for the disk."""
        self._put_lost()
        self._waiting.put(None)
        self._thread.join(LAST_CHUNKS)

    def _run(self) -> None:
        """Write until ``close``, or until a write fails."""
        try:
            self._write_all()
        except OSError as error:
            self.has_failed = True
            self._on_error(f'{self._path}: {error.strerror}; nothing more is recorded')
            while self._waiting.get() is not None:
                pass
        self._writer.close()

    def _write_all(self) -> None:
        while (chunk := self._waiting.get()) is not None:
            if isinstance(chunk, int):
                self._writer.write(f'# {LOST}: {chunk}; the disk was too slow')
                self._on_error(f'{self._path}: the disk was too slow; lines lost: {chunk}')
            else:
                self._writer.write(chunk)
            if self._waiting.empty():
                self._put_lost()


class TracedPort(PortAround):
    """
    A port whose bytes go into ``trace`` as well, with the seconds since ``begun``.

    Bytes that are read get the direction ``first``; bytes of a second port get ``IN``.
    """

    def __init__(self, port: Port, trace: Trace, begun: float,
                 clock: Callable[[], float] = time.monotonic,
                 first: Direction = Direction.IN) -> None:
        super().__init__(port)
        self._first = first
        self._trace = trace
        self._begun = begun
        self._clock = clock

    def read(self, timeout: float | None, wake: int) -> bytes:
        data = self._port.read(timeout, wake)
        if data:
            self._note(Direction.IN if isinstance(data, SecondPort) else self._first, data)
        return data

    def write(self, data: bytes) -> None:
        self._port.write(data)
        self._note(Direction.OUT, data)

    def _note(self, direction: Direction, data: bytes) -> None:
        self._trace.write(Chunk(self._clock() - self._begun, direction, data))


class PortOpener:
    """
    Open a port, again after each loss.

    ``tell`` is called with options that the port does not have, but not at each opening anew.
    After ``trace``, a capture records all bytes of the port from its next opening on. An error of
    the capture is given to ``on_error``, and has no effect on the port; ``on_news`` as in
    ``Trace``.
    """

    def __init__(self, settings: PortSettings,
                 tell: Callable[[Lack], None] = lambda lack: None) -> None:
        self.settings = settings
        self._tell = tell
        self._lacks: list[Lack] = []
        self._port: Port | None = None
        self._trace: Trace | None = None
        self._begun = 0.0

    def use(self, settings: PortSettings, head: dict[str, str]) -> bool:
        """
        Open with these settings from now on; return True if they differ from the last ones.

        ``head`` has the settings of the line, for a capture.
        """
        before, self.settings = self.settings, settings
        if settings != before:
            self._lacks = []
        if self._trace is not None:
            self._trace.write(self._head(head))
        return settings != before

    def errors(self) -> dict[str, int]:
        """Return the UART's error counts since the port was opened; from any thread."""
        return self._port.errors() if self._port else {}

    def trace(self, path: str, limit: float, head: dict[str, str],
              on_error: Callable[[str], None],
              on_news: Callable[[str], None] | None = None) -> None:
        """Begin a capture of at most ``limit`` bytes; ``head`` has the settings of the line."""
        settings = {'begun': begun_now(), **self._head(head)}
        self._begun = time.monotonic()
        try:
            self._trace = Trace(path, settings, on_error, limit, on_news)
        except OSError as error:
            on_error(f'{error.filename or path}: {error.strerror}; nothing is recorded')

    def _head(self, head: dict[str, str]) -> dict[str, str]:
        return {'port': self.settings.name, 'baud': str(self.settings.baud), **head}

    def note_guest(self, place: str, command: Packet) -> None:
        """Record in the capture that the command sent now is from a guest."""
        if self._trace is not None:
            self._trace.write(setting_line('guest', f'{command.tns:04X} {place}'))

    def open(self) -> Port:  # noqa: A003
        """Open the port; raises OSError."""
        lacks: list[Lack] = []
        self._port = port = open_port(self.settings, lacks.append)
        for lack in lacks:
            if lack not in self._lacks:
                self._tell(lack)
        self._lacks = lacks
        if self._trace is None:
            return port
        first = Direction.IN if not self.settings.listens else \
            Direction.OUT if self.settings.second else Direction.UNKNOWN
        return TracedPort(port, self._trace, self._begun, first=first)

    def close(self) -> None:
        """End the capture."""
        if self._trace is not None:
            self._trace.close()
