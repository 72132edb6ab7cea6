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

"""What ends the wait of a thread for its port, from any other thread."""

from __future__ import annotations

import os
import select
import threading


class Wake:
    """
    Set by any thread, seen by the one that waits: on ``descriptor``, or in ``wait``.

    It stays set until ``take``; to set it after ``close`` does nothing.
    """

    def __init__(self) -> None:
        self.descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._is_closed = False
        self._closing = threading.Lock()
        self._poll = select.poll()  # not select(): that knows no descriptor from 1024 on
        self._poll.register(self.descriptor, select.POLLIN)

    def set(self) -> None:  # noqa: A003
        """End the wait, or the next one."""
        with self._closing:
            if not self._is_closed:
                os.eventfd_write(self.descriptor, 1)

    def take(self) -> bool:
        """Return whether it was set; it is not any more."""
        try:
            return bool(os.eventfd_read(self.descriptor))
        except BlockingIOError:
            return False

    def wait(self, milliseconds: int | None = None) -> None:
        """Wait until it is set, but not for longer."""
        self._poll.poll(milliseconds)

    def close(self) -> None:
        """Give the descriptor back."""
        with self._closing:  # or another thread might write to another file
            if not self._is_closed:
                self._is_closed = True
                os.close(self.descriptor)
