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

"""A script at one end of a virtual line, a machine at the other."""

from __future__ import annotations

from abdf1_ros.df1.machine import Machine


class ScriptedLine:
    """What ``machine`` sends is read, what is written it receives; the clock jumps."""

    def __init__(self, machine: Machine) -> None:
        self.now = 0.0
        self._machine = machine
        self._unread = b''
        machine.start(0.0)

    def clock(self) -> float:
        return self.now

    def write(self, data: bytes) -> None:
        """Send bytes, which are there at once."""
        self._take()
        self._machine.receive_data(data, self.now)
        self._take()

    def read(self, timeout: float) -> bytes:
        """Let time pass until the machine has sent something, at most ``timeout`` s."""
        end = self.now + timeout
        self._take()
        while not self._unread:
            deadline = self._machine.deadline
            if deadline is None or deadline > end:
                self.now = end
                break
            self.now = max(self.now, deadline)
            self._machine.handle_timeout(self.now)
            self._take()
        data, self._unread = self._unread, b''
        return data

    def _take(self) -> None:
        self._unread += self._machine.data_to_send()
