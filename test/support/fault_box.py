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

"""A box between a PLC and the node that does to their line what happens to lines."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import os
from pathlib import Path
from queue import Empty, SimpleQueue
import select
import threading
from typing import Self

from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from support.ptys import PATIENCE, Pty

_TURN = 0.01  # s; so long the box listens before it looks at what it has been told


class FaultBox:
    """
    Pass on bytes between the port ``far`` and a pseudo-terminal of the name ``name``.

    The far end may come and go. What is set from outside holds from the next bytes on:
    ``to_plc`` and ``to_node`` tell which direction works. ``overhear`` is called with what the
    node has sent, before the PLC gets it; what it returns the node hears first.
    """

    def __init__(self, far: Path, name: Path) -> None:
        self.name = name
        self.to_plc = self.to_node = True
        self.overhear: Callable[[bytes], bytes] = lambda data: b''
        self._far_name = str(far)
        self._far: DescriptorPort | None = None
        self._near: Pty | None = _quick(Pty(name))
        self._orders: SimpleQueue[tuple[Callable[[], None], threading.Event]] = SimpleQueue()
        self._is_working = True
        self._thread = threading.Thread(target=self._run, name='fault box')

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._is_working = False
        self._thread.join()
        self._unplug()
        self._lose_far()

    def mend(self) -> None:
        """Let both directions work."""
        self.to_plc = self.to_node = True

    def unplug(self) -> None:
        """Let the device of the node vanish."""
        self._do(self._unplug)

    def plug(self, other_than: str = '') -> None:
        """Let the device come back under its name, but not as the device ``other_than``."""
        taken = []
        while not self.name.is_symlink() or os.readlink(self.name) == other_than:
            self.name.unlink(missing_ok=True)
            taken.append(Pty(self.name))
        self._near = _quick(taken.pop())
        for pty in taken:
            pty.name = self.name.with_suffix('.taken')  # its end leaves the name alone
            pty.close()

    def _do(self, action: Callable[[], None]) -> None:
        """Have the thread do something between two of its turns."""
        done = threading.Event()
        self._orders.put((action, done))
        assert done.wait(PATIENCE)

    def _unplug(self) -> None:
        near, self._near = self._near, None
        if near is not None:
            near.close()

    def _lose_far(self) -> None:
        far, self._far = self._far, None
        if far is not None:
            far.close()

    def _run(self) -> None:
        while self._is_working:
            with suppress(Empty):
                action, done = self._orders.get_nowait()
                action()
                done.set()
            if self._far is None:
                self._find_far()
            self._turn()

    def _find_far(self) -> None:
        with suppress(OSError):
            port = open_port(PortSettings(self._far_name))
            assert isinstance(port, DescriptorPort)
            self._far = port

    def _turn(self) -> None:
        near, far = self._near, self._far
        ready = select.select([end for end in (near, far) if end is not None], [], [], _TURN)[0]
        if near is not None and near in ready:
            self._take_from_node(os.read(near.fileno(), 4096))
        if far is not None and far in ready:
            self._take_from_plc(far)

    def _take_from_node(self, data: bytes) -> None:
        self._tell_node(self.overhear(data))
        if self.to_plc and self._far is not None:
            with suppress(OSError):  # the PLC is gone, and the next turn finds that out
                self._far.write(data)

    def _take_from_plc(self, far: DescriptorPort) -> None:
        try:
            data = os.read(far.fileno(), 4096)
        except OSError:
            data = b''
        if not data:
            self._lose_far()
        elif self.to_node:
            self._tell_node(data)

    def _tell_node(self, data: bytes) -> None:
        if data and self._near is not None:
            with suppress(BlockingIOError):  # nobody has read for long; a line keeps nothing
                os.write(self._near.fileno(), data)


def _quick(pty: Pty) -> Pty:
    """Let writing to a line on which nobody reads fail instead of wait."""
    os.set_blocking(pty.fileno(), False)
    return pty
