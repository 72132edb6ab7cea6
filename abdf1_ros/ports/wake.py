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

"""A signal from any thread that ends the wait of another thread for its port."""

from __future__ import annotations

import os
import select
import threading


class Wake:
    """
    A flag that any thread may set. A thread waits for it on ``descriptor`` or in ``wait``.

    It stays set until ``take``. After ``close``, ``set`` has no effect.
    """

    def __init__(self) -> None:
        self.descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._is_closed = False
        self._closing = threading.Lock()
        self._poll = select.poll()  # not select(), which fails for descriptors from 1024 on
        self._poll.register(self.descriptor, select.POLLIN)

    def set(self) -> None:  # noqa: A003
        """End the wait, or the next one."""
        with self._closing:
            if not self._is_closed:
                os.eventfd_write(self.descriptor, 1)

    def take(self) -> bool:
        """Clear the flag; return True if it was set."""
        try:
            return bool(os.eventfd_read(self.descriptor))
        except BlockingIOError:
            return False

    def wait(self, milliseconds: int | None = None) -> None:
        """Wait until the flag is set, but at most for this time; None for no limit."""
        self._poll.poll(milliseconds)

    def close(self) -> None:
        """Close the descriptor."""
        with self._closing:  # without the lock, ``set`` might write to another file
            if not self._is_closed:
                self._is_closed = True
                os.close(self.descriptor)
