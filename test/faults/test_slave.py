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

"""What happens to a line of two nodes, a master and a slave; see docs/troubleshooting.md."""

from collections.abc import Iterator
import signal
import time

import pytest
from support.fault_rig import is_unanswered, NOT_SENT, Renewed, UNKNOWN
from support.ros import ERROR, Observer
from support.slave_rig import Line, two_nodes

NO_ANSWER = '2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive'
NO_REPLY = '2508 ERR_COMMAND_TIMEOUT: Command Timed Out'
REFUSED = 'not written: refused: '
# Before or after it has come to the node.
TOO_OLD = NOT_SENT + 'waited longer than 1.5 s for the line', REFUSED + 'it came '

WRITE_TIMEOUT = 'write_timeout:=1.5'  # of the slave


@pytest.fixture(scope='module')
def lines(observer: Observer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Renewed[Line]]:
    renewed = Renewed(lambda: two_nodes(observer, tmp_path_factory.mktemp('line'), WRITE_TIMEOUT))
    yield renewed
    renewed.close()


@pytest.fixture
def line(lines: Renewed[Line], request: pytest.FixtureRequest) -> Iterator[Line]:
    """Return a line that is well; nothing that is done to it makes it lie."""
    with lines.lent(request) as line:
        line.box.mend()
        line.works()
        line.clear()
        yield line
        line.check()


def lose_slave(line: Line) -> int:
    """Let the master find out that the slave does not answer; return what it wanted to write."""
    master, value = line.master, next(line.values)
    # What was on its way when the fault began decides whether it was sent.
    assert is_unanswered(master.write(value).replace('(9)', '(2)'))
    master.status('link', ERROR, 'port open, but none of 1 stations answers')
    master.status('mappings', ERROR, '1 failed')
    line.observer.until(lambda: master.write(next(line.values)) == NOT_SENT + NO_ANSWER,
                        'a write that is not sent')
    return value


def test_slave_is_stopped_and_goes_on(line: Line) -> None:
    line.slave.node.stop()
    own = next(line.values)
    line.slave.ask(own)
    asked, before = time.monotonic(), len(line.master.results)
    value = lose_slave(line)
    was_sent = line.master.results[before].message.startswith(UNKNOWN)
    line.observer.until(lambda: time.monotonic() - asked > 1.6, 'the write to become old')
    line.slave.node.go_on()
    line.recovers()
    assert line.slave.result().startswith(REFUSED + 'it came ')
    line.works()
    assert not line.master.was_told(own)
    # The port has kept the command and its repetitions: executed once at most, if it was sent.
    assert line.slave.was_told(value) <= was_sent


def test_master_is_killed_while_the_slave_sends_a_command(line: Line) -> None:
    master, word = line.master, 0x2345

    def kill(mode: str, data: bytes) -> bytes:
        if mode == 'Slave' and word.to_bytes(2, 'little') in data:
            master.node.send(signal.SIGKILL)
            return b''
        return data

    line.box.pass_on = kill
    assert line.slave.write(word).startswith(UNKNOWN + NO_REPLY)
    master.node.result()
    line.box.pass_on = lambda mode, data: data
    line.master = line.start('Master')
    line.master.node.wait_for('[INFO]', 'open')
    line.recovers()
    line.works()
    assert not line.master.was_told(word)
