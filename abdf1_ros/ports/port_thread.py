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


"""A thread that has a port, and closes it while other programs use it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
import threading
import time

from abdf1_ros.ports.wake import Wake

RELEASED = 'polling is off, so other programs may use the port'

LONGEST_HAND_OVER = 5.0
"""Longest time (s) until the thread has closed its port, or has another machine."""

_GLANCE = 0.1


class PortKind(Enum):
    """The reason why a port is not open."""

    NO_CLIENT = 'this end is open, but no program has opened the other end'
    UNAVAILABLE = 'it cannot be opened'
    OTHER = ''


@dataclass(frozen=True, slots=True)
class PortState:
    """Whether the port is open, with a text for users; ``kind`` is the reason if it is not."""

    is_open: bool
    text: str
    kind: PortKind = field(default=PortKind.OTHER, compare=False)


class PortThread(threading.Thread, ABC):
    """
    Keep a port open until ``stop``; ``release`` closes it for other programs until ``take``.

    ``on_fault`` is called with an exception that is a bug. If the bug ends the thread,
    ``has_failed`` becomes True.
    """

    def __init__(self, name: str, on_fault: Callable[[Exception], None]) -> None:
        super().__init__(name=name)
        self.state = PortState(False, 'not opened yet')
        self.has_failed = False
        self.is_released = False
        self._stopping = False
        self._on_fault = on_fault
        self._is_free = threading.Event()
        self._wake = Wake()

    @property
    def fault(self) -> str:
        """Return why the port cannot be used; empty if it is open, or only waits for a program."""
        is_shut = self.state.kind is PortKind.UNAVAILABLE or self.has_failed
        return self.state.text if is_shut else ''

    def wake(self) -> None:
        """Let the thread look for new work; may be called from any thread."""
        self._wake.set()

    def ask_to_stop(self) -> None:
        """Begin the end of the thread; ``stop`` waits for it."""
        self._stopping = True
        self.wake()

    def stop(self) -> None:
        """End the thread, with an error for work under way, and wait for its end."""
        self.ask_to_stop()
        if self.is_alive():
            self.join()
        self._wake.close()

    def release(self) -> bool:
        """Close the port until ``take``; return whether it is closed within 5 s."""
        self._is_free.clear()
        self.is_released = True
        self.wake()
        return self._has_happened(self._is_free)

    def take(self) -> None:
        """Open the port again."""
        self.is_released = False
        self.wake()

    def begin(self) -> None:
        """Start the thread, or open the port again after ``release``."""
        if self.is_released:
            self.take()
        else:
            self.start()

    def _has_happened(self, event: threading.Event) -> bool:
        """Wait up to 5 s until this thread has set an event; not if the thread has ended."""
        give_up = time.monotonic() + LONGEST_HAND_OVER
        # The node takes calls a moment before its link starts; ``ident`` is None until then.
        while not event.wait(_GLANCE) and (self.ident is None or self.is_alive()) \
                and time.monotonic() < give_up:
            pass
        return event.is_set()

    def run(self) -> None:
        """Keep the port open."""
        try:
            self._keep_open()
        except Exception as error:  # a bug that ends the thread
            self.has_failed = True
            self.state = PortState(False, f'internal error: {error!r}')
            self._on_fault(error)

    @abstractmethod
    def _keep_open(self) -> None:
        """Keep the port open until the thread stops; set ``_is_free`` when it is released."""
