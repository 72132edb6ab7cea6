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

"""A pseudo-terminal, a pipe, a connection, and link threads that end with the test."""

from collections.abc import Iterator
import os
from pathlib import Path
import socket

from abdf1_ros.ports.descriptor import DescriptorPort
import pytest
from support.link_threads import Link
from support.ptys import Pty


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    line = Pty(tmp_path / 'line')
    yield line
    line.close()


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture
def wake(pipe: tuple[int, int]) -> int:
    """Return a descriptor that comes to life when ``pipe`` is written to."""
    return pipe[0]


@pytest.fixture
def sockets() -> Iterator[tuple[DescriptorPort, socket.socket]]:
    ours, theirs = socket.socketpair()
    yield DescriptorPort(ours.fileno(), ours.close), theirs
    theirs.close()
    ours.close()


@pytest.fixture
def link() -> Iterator[Link]:
    links = Link()
    yield links
    for thread in links.threads:
        if thread.is_alive():
            thread.stop()
