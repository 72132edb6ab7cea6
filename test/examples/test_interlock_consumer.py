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

"""The interlock consumer, beside a bridge that loses its PLC and its life."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import signal

import pytest
from support.ros import Process
from support.ros_tools import SOURCE
from support.simulator_process import Files, make_files

EXAMPLE = SOURCE / 'examples' / 'interlock_consumer.py'
PATIENCE_ARGUMENTS = ('--patience', '1.5')

PERMITTED = 'PERMITTED: the PLC permits'
REFUSED = 'not permitted: the PLC does not permit'
STARTING = 'not permitted: no value yet'
SILENT = 'not permitted: nothing heard since the start'
LATE = 'not permitted: no value within the deadline'
GONE = 'not permitted: the bridge or its PLC is gone'


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return make_files(tmp_path)


@pytest.fixture
def simulator(files: Files) -> Iterator[Process]:
    with files.start_simulator() as simulator:
        yield simulator


def consumer(topic: str, bit: int) -> Process:
    return Process(EXAMPLE, '--topic', topic, '--bit', str(bit), *PATIENCE_ARGUMENTS)


def test_nothing_is_permitted_while_there_is_no_bridge() -> None:
    with consumer('/nobody/read/bits', 0) as cell:
        cell.wait_for(SILENT)
        cell.end(signal.SIGTERM)
    assert cell.lines == [STARTING, SILENT]


def test_bit_of_the_plc_decides(files: Files, simulator: Process) -> None:
    with Process('node', *files.args(), '-r', '__node:=deciding') as node, \
            consumer('/deciding/read/bits', 0) as set_bit, \
            consumer('/deciding/read/bits', 1) as clear_bit, \
            consumer('/deciding/read/bits', 6) as beyond:
        set_bit.wait_for(PERMITTED)
        clear_bit.wait_for(REFUSED)
        beyond.wait_for(REFUSED)
        for cell in (set_bit, clear_bit, beyond):
            cell.end()
            assert cell.lines[0] == STARTING
        node.end()
    assert PERMITTED not in clear_bit.lines + beyond.lines


def test_loss_of_the_plc_takes_the_permit_and_its_return_gives_it_back(
        files: Files, simulator: Process) -> None:
    with Process('node', *files.args(), '-r', '__node:=losing') as node, \
            consumer('/losing/read/bits', 0) as cell:
        cell.wait_for(PERMITTED)
        after = len(cell.lines)
        simulator.say('silent 1')
        cell.wait_for('not permitted', after=after)
        # The deadline and the lease end at the same time; either may be told first.
        assert cell.lines[after] in (LATE, GONE)
        assert PERMITTED not in cell.lines[after:]
        after = len(cell.lines)
        simulator.say('normal 1')
        cell.wait_for(PERMITTED, after=after)
        cell.end()
        node.end()


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_end_of_the_bridge_takes_the_permit(
        files: Files, simulator: Process, number: signal.Signals) -> None:
    with Process('node', *files.args(), '-r', '__node:=dying') as node, \
            consumer('/dying/read/bits', 0) as cell:
        cell.wait_for(PERMITTED)
        after = len(cell.lines)
        node.send(number)
        cell.wait_for('not permitted', after=after)
        assert cell.lines[after] in (LATE, GONE)
        assert PERMITTED not in cell.lines[after:]
        cell.end()


def test_restart_of_the_bridge_gives_the_permit_back(files: Files, simulator: Process) -> None:
    arguments = (*files.args(), '-r', '__node:=restarted')
    with consumer('/restarted/read/bits', 0) as cell:
        with Process('node', *arguments) as node:
            cell.wait_for(PERMITTED)
            after = len(cell.lines)
            node.end()
            cell.wait_for('not permitted', after=after)
        after = len(cell.lines)
        with Process('node', *arguments) as node:
            cell.wait_for(PERMITTED, after=after)
            node.end()
        cell.end()


def test_bridge_that_does_not_promise_enough_permits_nothing(
        files: Files, simulator: Process) -> None:
    with Process('node', *files.args('stale_after:=30'), '-r', '__node:=slow') as node, \
            consumer('/slow/read/bits', 0) as cell:
        reason = cell.wait_for('not permitted: the bridge does not promise values that often')
        cell.end()
        node.end()
    assert PERMITTED not in cell.lines
    assert cell.lines[-1] == reason  # silence is no news then


@pytest.mark.parametrize(('args', 'text'), [
    (('--bit', '-1'), '"-1" should be a whole number from 0'),
    (('--patience', '0'), '"0" should be a number of seconds above 0'),
    (('--topic', 'a b'), 'topic name must not contain'),
])
def test_bad_arguments_are_refused(args: tuple[str, ...], text: str) -> None:
    with Process(EXAMPLE, *args) as cell:
        assert cell.result() == 2
    assert text in cell.text
    assert 'Traceback' not in cell.text
