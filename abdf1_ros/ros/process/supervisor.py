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

"""Signs of life for systemd, which restarts a process that hangs (sd_notify)."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
import os
import socket
import time
from typing import Protocol


class Works(Protocol):
    """A thread that proves that it still runs: ``has_turned`` becomes True at each turn."""

    has_turned: bool

    def is_alive(self) -> bool:
        """Return True until the thread ends; its end is noticed elsewhere."""

    def wake(self) -> None:
        """Make the thread turn soon."""


class Supervisor:
    """
    Sends signs of life to systemd, if systemd has set NOTIFY_SOCKET and WATCHDOG_USEC.

    The main thread sends the sign only if each link and each thread of callbacks has turned since
    the last sign. So the sign is missing if any of them hangs.
    """

    def __init__(self) -> None:
        address = os.environ.get('NOTIFY_SOCKET', '')
        self._address = '\0' + address[1:] if address.startswith('@') else address
        # A third of the limit, so that a lost sign or a slow host does not end the process.
        self._period = int(os.environ.get('WATCHDOG_USEC', '0')) / 3e6
        self._next = 0.0
        self.say('READY=1')

    def look(self, links: Collection[Works]) -> None:
        """Send the sign if it is due and all threads have turned."""
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
                sender.setblocking(False)  # if systemd hangs, we do not wait for it
                sender.sendto(state.encode(), self._address)
