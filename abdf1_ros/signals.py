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

"""The end of a process after a signal."""

from __future__ import annotations

import atexit
from collections.abc import Callable, Iterable
from contextlib import suppress
from io import FileIO
import os
import select
import signal
import sys
import threading
import time
from types import FrameType
from typing import Self, TextIO
from weakref import WeakSet

# After a signal to end: longest wait of the output for its reader (s), and interval of the checks
# (s).
_LAST_OUTPUT = 2.0
_GLANCE = 0.5

# What ``limit_output`` looks at, beside standard output and standard error.
OUTPUTS: WeakSet[FileIO] = WeakSet()


class EndRequest(threading.Event):
    """
    An event that is set by a signal to end; a context manager of the main thread.

    Python runs a handler between any two steps of the main thread, even inside another handler. An
    event has a lock: a handler that sets the event might wait for ever for a lock that its own
    thread has. So the handlers do nothing. The interpreter writes each signal to a pipe. A thread
    reads this pipe and sets the event, even while the main thread is blocked. A process that ends
    by itself also sets the event. ``set`` calls ``on_set`` once, and stores the monotonic clock
    value (s) in ``when``.
    """

    def __init__(self, numbers: Iterable[signal.Signals],
                 on_set: Callable[[], None] = lambda: None) -> None:
        super().__init__()
        self.when = 0.0
        self._on_set = on_set
        self._numbers = tuple(numbers)
        self._reader = self._writer = -1

    def __enter__(self) -> Self:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        threading.Thread(target=self._wait_for_signals, name='signals', daemon=True).start()
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        for number in self._numbers:
            signal.signal(number, lambda number, frame: None)
        return self

    def __exit__(self, *exception: object) -> None:
        """Keep the empty handlers: a late signal must not kill the process during its end."""
        signal.set_wakeup_fd(-1)
        os.close(self._writer)

    def set(self) -> None:  # noqa: A003
        if not self.is_set():
            self.when = time.monotonic()
            self._on_set()
        super().set()

    def _wait_for_signals(self) -> None:
        while number := os.read(self._reader, 1):
            if number[0] in self._numbers:
                self.set()
        os.close(self._reader)


def limit_output(seconds: float = _LAST_OUTPUT) -> None:
    """
    Drop output that still waits for its reader some ``seconds`` after a signal to end.

    Without this, Ctrl-S or a pipe without a reader would delay the end for ever. An alarm
    interrupts the write, which then continues to the null device. The same holds for ``OUTPUTS``.
    A signal handler may call this function.
    """
    signal.signal(signal.SIGALRM, _drop_stuck)
    signal.setitimer(signal.ITIMER_REAL, seconds, _GLANCE)
    atexit.register(_stop_alarm)


def _stop_alarm() -> None:
    """Write all output, and stop the alarm: near its end Python has no handler for it any more."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # its reader has left, or it is closed
            stream.flush()
    signal.setitimer(signal.ITIMER_REAL, 0)


def _drop_stuck(number: int, frame: FrameType | None) -> None:
    others = [file.fileno() for file in OUTPUTS if not file.closed]
    stuck = [descriptor for descriptor in (1, 2, *others) if _is_stuck(descriptor)]
    for descriptor in stuck:
        drop(descriptor)
    if 1 in stuck and 2 not in stuck:
        os.write(2, b'standard output was not read after the signal: the rest of it is lost\n')


def _is_stuck(descriptor: int) -> bool:
    """Tell whether a write would wait."""
    with suppress(OSError, ValueError):  # it is closed
        return not select.select([], [descriptor], [], 0)[1]
    return False


def has_no_reader(stream: TextIO) -> bool:
    """Tell whether a stream is a pipe whose reader has left."""
    with suppress(OSError, ValueError):  # it is closed, or not a file
        state = select.poll()
        state.register(stream.fileno(), 0)
        return any(event & select.POLLERR for _, event in state.poll(0))
    return False


def drop(descriptor: int) -> None:
    """Redirect a descriptor to the null device."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)
