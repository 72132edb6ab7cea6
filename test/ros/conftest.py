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


"""The node in this process, where it does not get to run."""

from collections.abc import Callable, Iterator
import signal

from abdf1_ros import console
from abdf1_ros.ros.node import main
import pytest
from support.ptys import PATIENCE


@pytest.fixture(autouse=True)
def _patient_console() -> Iterator[None]:
    """Let ``main`` wait for all lines that it has said: on a busy host the relay starts late."""
    before, console.PATIENCE = console.PATIENCE, PATIENCE
    yield
    console.PATIENCE = before


@pytest.fixture
def refusal(capfd: pytest.CaptureFixture[str]) -> Iterator[Callable[..., list[str]]]:
    """Return the lines of a node that ends by itself, with status 2 unless told."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def start(*arguments: str, status: int = 2) -> list[str]:
        capfd.readouterr()
        assert main(['node', *arguments]) == status
        return ''.join(capfd.readouterr()).splitlines()

    yield start
    for number, handler in handlers.items():
        signal.signal(number, handler)
