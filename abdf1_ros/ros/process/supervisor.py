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

"""systemd as the supervisor: a process that stands still is started anew (sd_notify)."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
import os
import socket
import time
from typing import Protocol


class Works(Protocol):
    """A thread that shows that it goes on."""

    has_turned: bool

    def is_alive(self) -> bool:
        """Tell whether the thread has not ended; an end is noticed elsewhere."""

    def wake(self) -> None:
        """Have it turn soon."""


class Supervisor:
    """
    Gets a sign of life of this process, if it has set NOTIFY_SOCKET and WATCHDOG_USEC.

    The sign comes from the main thread, and only if each link and each thread of callbacks has
    turned since the last one: so it is missing where one of them hangs.
    """

    def __init__(self) -> None:
        address = os.environ.get('NOTIFY_SOCKET', '')
        self._address = '\0' + address[1:] if address.startswith('@') else address
        # A third: a sign that is lost, or a slow host, does not end the process.
        self._period = int(os.environ.get('WATCHDOG_USEC', '0')) / 3e6
        self._next = 0.0
        self.say('READY=1')

    def look(self, links: Collection[Works]) -> None:
        """Give the sign when it is due."""
        now = time.monotonic()
        if not self._period or now < self._next:
            return
        self._next = now + self._period
        if all(link.has_turned or not link.is_alive() for link in links):
            self.say('WATCHDOG=1')
        for link in links:
            link.has_turned = False
            link.wake()

    def say(self, state: str) -> None:
        """Send a line of sd_notify(3)."""
        if self._address:
            with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)  # a supervisor that stands still ends us anyway
                sender.sendto(state.encode(), self._address)
