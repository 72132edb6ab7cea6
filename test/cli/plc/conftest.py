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

"""A simulated line for tests of ``plc``."""

from collections.abc import Iterator

from abdf1_ros.cli.plc.command import main
import pytest
from support.commands import call, Output, PATIENT, Plc
from support.ros import Process
from support.simulator_process import Files, make_files


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return make_files(tmp_path_factory.mktemp('line'))


@pytest.fixture(scope='module')
def simulator(files: Files) -> Iterator[Process]:
    with files.start_simulator() as process:
        yield process


@pytest.fixture
def line(simulator: Process, files: Files) -> str:
    """Return the port of a line on which every station works."""
    for station in (1, 2):
        simulator.say(f'normal {station}')
    return str(files.port)


@pytest.fixture
def plc(line: str, capsys: Output) -> Plc:
    return lambda command, *args: call(main, capsys, command, '--port', line, *PATIENT, *args)


@pytest.fixture(autouse=True)
def listening_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let commands that first listen for another master do so for a moment."""
    monkeypatch.setattr('abdf1_ros.cli.plc.overhear.LISTENED', 0.05)
