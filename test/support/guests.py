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

"""A program that shares a driver's line."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guests import Guest, GuestCommand, ShareAccess
from support.driver_bench import DriverBench

READ_N7 = bytes.fromhex('A2 02 07 89 00 00')


class Program:
    """A program at a place of its own, which asks with ``src`` as its station."""

    def __init__(self, bench: DriverBench, access: ShareAccess = ShareAccess.READ,
                 src: int = 9) -> None:
        self.guest = Guest(f'pty:/tmp/{src}', access)
        self.replies: list[tuple[float, Packet]] = []
        self._again: Callable[[], object] | None = None
        self._pause = 0.0
        self._bench, self._src, self._tns = bench, src, count(1)

    def ask(self, data: bytes, dst: int = 1, cmd: int = 0x0F) -> Packet:
        """Send a command."""
        command = Packet(dst, self._src, cmd, 0, next(self._tns), data)
        bench = self._bench
        bench.driver.guests.put(GuestCommand(self.guest, command, bench.clock(), self._answered))
        bench.line.wake(bench.driver.machine)
        return command

    def keep_asking(self, data: bytes, dst: int = 1) -> None:
        """Send the next command 1 ms after the last has its reply."""
        self.go_on(lambda: self.ask(data, dst))

    def go_on(self, ask: Callable[[], object], pause: float = 0.001) -> None:
        """Ask now, and again a pause (s) after each reply."""
        self._again, self._pause = ask, pause
        ask()

    def _answered(self, reply: Packet) -> None:
        self.replies.append((self._bench.clock(), reply))
        if self._again is not None:
            self._bench.at(self._bench.clock() + self._pause, self._again)

    @property
    def statuses(self) -> list[int]:
        """Return the STS of all replies."""
        return [reply.sts for _, reply in self.replies]
