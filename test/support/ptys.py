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

"""Pseudo-terminals whose other end the test holds; pipes and files that take no more."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import resource
import select
import time
import tty

PATIENCE = 30.0  # s; what takes longer does not happen


class Pty:
    """A pseudo-terminal under a name; ``close`` is what unplugging an adapter looks like."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        name.unlink(missing_ok=True)
        name.symlink_to(os.ttyname(self._slave))
        self._is_open = True

    def fileno(self) -> int:
        """Return the descriptor of our end."""
        return self._master

    def write(self, data: bytes) -> None:
        """Say something."""
        os.write(self._master, data)

    def read(self, count: int) -> bytes:
        """Return the next ``count`` bytes that the other side says."""
        return read_exactly(self._master, count)

    def close(self) -> None:
        """Vanish."""
        if self._is_open:
            self._is_open = False
            self.name.unlink(missing_ok=True)
            os.close(self._slave)
            os.close(self._master)


def full_pipe() -> tuple[int, int]:
    """Return both ends of a pipe that takes no more bytes, as after Ctrl-S."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    return reader, writer


def read_exactly(descriptor: int, count: int) -> bytes:
    data = b''
    while len(data) < count:
        assert select.select([descriptor], [], [], PATIENCE)[0], f'only {data.hex(" ")} came'
        data += os.read(descriptor, count - len(data))
    return data


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for something that another thread or process does."""
    give_up = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < give_up, 'it does not happen'
        time.sleep(0.002)


@contextmanager
def no_file_longer_than(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond ``size`` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
