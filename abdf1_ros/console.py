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
Output to terminal, pipe, journal and log file, for which the main process never waits.

rclpy's log call holds the interpreter's lock while it writes, and rcl, DDS and faulthandler write
to the same descriptors. So standard output and standard error become pipes of ours, whose write
ends never block. A second process, the relay, passes their lines on. If a terminal is stopped
(Ctrl-S), a pipe is full or a disk hangs, only the relay waits. Output that the relay cannot keep
is lost. The relay counts the lost lines, and reports their number as soon as the sink accepts
bytes again.

This file is also the program of the relay, which imports no other module of the package.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
import fcntl
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time

# Bytes that wait for each sink: some 10,000 entries.
_MOST_WAITING = 1 << 20

# Size of our own pipes (bytes): some time may pass before the relay can run and read them.
_PIPE_SIZE = 1 << 20

# Time (s) in which the relay may write the last lines after the pipes are closed.
_LAST_ENTRIES = 1.0

PATIENCE = 0.5  # time that the main process waits for the relay (s)
PAUSE = 1.0  # after a write that has failed (s)

_COLOURS = re.compile(rb'\x1b\[[0-9;]*m')


class Sink(threading.Thread):
    """Write lines to a descriptor, which may block for any time; ``put`` never waits."""

    def __init__(self, descriptor: int, most: int = _MOST_WAITING,
                 colours: bool = True) -> None:
        super().__init__(daemon=True)
        self._descriptor = descriptor
        self._most = most
        self._has_colours = colours
        self._lines: deque[bytes] = deque()
        self._size = self._lost = 0
        self._is_ended = False
        self._news = threading.Condition()

    def put(self, line: bytes) -> None:
        """Keep a line for the thread, or count it as lost."""
        with self._news:
            if self._lost or self._size + len(line) > self._most:
                self._lost += 1
            else:
                self._lines.append(line)
                self._size += len(line)
            self._news.notify()

    def end(self) -> None:
        """End the thread when all lines are written."""
        with self._news:
            self._is_ended = True
            self._news.notify()

    def run(self) -> None:
        """Write until ``end``."""
        while True:
            data, lost = self._take()
            if not data and not lost:
                return
            if lost:
                data += b'[WARN] abdf1_ros: lines lost here, as they were not taken: %d\n' % lost
            try:
                while data:
                    data = data[self._write(data):]
            except OSError:  # the disk is full, or the terminal gone
                with self._news:  # our own last line stands for ``lost`` lines
                    self._lost += data.count(b'\n') + max(0, lost - 1)
                time.sleep(PAUSE)

    def _take(self) -> tuple[bytes, int]:
        """Wait for lines; return them, and the number of lines that were lost after them."""
        with self._news:
            self._news.wait_for(lambda: self._lines or self._lost or self._is_ended)
            data = b''.join(self._lines)
            lost, self._size, self._lost = self._lost, 0, 0
            self._lines.clear()
        return data if self._has_colours else _COLOURS.sub(b'', data), lost

    def _write(self, data: bytes) -> int:
        """Write bytes; return how many of them the descriptor has accepted."""
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:  # another process of this terminal has made it non-blocking
            select.select([], [self._descriptor], [])
            return 0


def pass_on(source: int, sinks: Sequence[Sink]) -> None:
    """Pass lines from a descriptor on to sinks, until its end."""
    rest = b''
    while data := os.read(source, _PIPE_SIZE):
        *lines, rest = (rest + data).split(b'\n')
        for line in lines:
            for sink in sinks:
                sink.put(line + b'\n')
        rest = rest[:_MOST_WAITING + 1]  # a sink counts a longer line as lost
    for sink in sinks:
        if rest:
            sink.put(rest)
        sink.end()


def relay(routes: Sequence[str]) -> None:
    """
    Pass lines on from descriptors, as long as a process has their far ends open.

    A route is ``source:sink`` or ``source:sink,sink``; only the first sink of a route gets
    colours.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTTOU):
        # the last lines of the main process have not arrived yet
        signal.signal(number, signal.SIG_IGN)
    threads: list[threading.Thread] = []
    sinks: list[Sink] = []
    for route in routes:
        source, _, names = route.partition(':')
        own = [Sink(int(name), colours=not at) for at, name in enumerate(names.split(','))]
        sinks += own
        threads.append(threading.Thread(target=pass_on, args=(int(source), own), daemon=True))
    for thread in (*sinks, *threads):
        thread.start()
    for thread in threads:
        thread.join()
    give_up = time.monotonic() + _LAST_ENTRIES
    for sink in sinks:
        sink.join(max(0.0, give_up - time.monotonic()))
    os._exit(0)


class Console:
    """
    Pass standard output and standard error to the relay, which may wait; a context manager.

    ``log`` is the descriptor of a file that also gets the stream of rclpy's log, without colours.
    This process closes it.
    """

    def __init__(self, log: int | None = None) -> None:
        self._log = log
        self._before: dict[int, int] = {}

    def __enter__(self) -> Console:
        routes, reads, writes = [], [], {}
        logged = 1 if os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1' else 2
        for number in (1, 2):
            self._before[number] = os.dup(number)
        for number, before in self._before.items():
            reader, writes[number] = os.pipe()
            reads.append(reader)
            log = '' if self._log is None or number != logged else f',{self._log}'
            routes.append(f'{reader}:{before}{log}')
        if os.isatty(self._before[logged]):
            # rcutils cannot see the terminal any more
            os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
        kept = [*reads, *self._before.values(), *([] if self._log is None else [self._log])]
        self._process = subprocess.Popen(
            [sys.executable, '-I', '-S', __file__, *routes], pass_fds=kept,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for number in (*reads, *([] if self._log is None else [self._log])):
            os.close(number)
        for number, writer in writes.items():
            with suppress(OSError):  # the limit of the user is lower: the pipe keeps its size
                fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, _PIPE_SIZE)
            os.set_blocking(writer, False)  # ours alone: no other process has it
            _flush()
            os.dup2(writer, number)
            os.close(writer)
        return self

    def __exit__(self, *exception: object) -> None:
        """Restore both descriptors; if the relay still waits, discard all later output."""
        _flush()
        for number, before in self._before.items():
            os.dup2(before, number)
            os.close(before)
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for number in self._before:
                os.dup2(nowhere, number)
            os.close(nowhere)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()


if __name__ == '__main__':
    relay(sys.argv[1:])
