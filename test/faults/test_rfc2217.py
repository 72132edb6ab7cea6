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

"""What happens to rfc2217:// device servers, done to a real node; see docs/troubleshooting.md."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.device_server import LineServer
from support.fault_rig import is_unanswered, NO_ANSWER, NOT_SENT, Rig, rigged, SETPOINT
from support.renewed import Renewed
from support.ros import ERROR, Observer, write_csv
from support.simulator_process import Files, IMPATIENT_ROW, make_files, MAP_HEADER

REFUSED = 'not written: refused: the port is not open'

MAP_ROWS = ('speeds,Read,N7:0,1,PLC5,2,,500', 'setpoint,ReadWrite,F8:4,2,SLC,,,500')

Served = tuple[Rig, LineServer]


@pytest.fixture(scope='module')
def observer() -> Iterator[Observer]:
    with Observer() as observer:
        yield observer


def short_files(folder: Path) -> Files:
    """Return the usual files, but with two mappings."""
    files = make_files(folder, IMPATIENT_ROW)
    write_csv(files.map, MAP_HEADER, MAP_ROWS)
    return files


@pytest.fixture(scope='module')
def shared(observer: Observer, tmp_path_factory: pytest.TempPathFactory
           ) -> Iterator[Renewed[Served]]:
    @contextmanager
    def serve() -> Iterator[Served]:
        """Run a node, and the device server between it and its PLCs."""
        files = short_files(tmp_path_factory.mktemp('server'))
        simulator = files.start_simulator()
        with LineServer(files.port) as server, \
                rigged(observer, files, server.url, simulator) as rig:
            yield rig, server

    renewed = Renewed(serve)
    yield renewed
    renewed.close()


@pytest.fixture
def served(shared: Renewed[Served], request: pytest.FixtureRequest) -> Iterator[Served]:
    """Return them when all is well; whatever is done to them, it works again afterwards."""
    with shared.lent(request) as (rig, server):
        rig.until_well()
        yield rig, server
        rig.writes(3.0)
        assert rig.has_read_only(SETPOINT, 3.0)


def test_server_is_not_there_at_first(observer: Observer, tmp_path: Path) -> None:
    files = short_files(tmp_path)
    simulator = files.start_simulator()
    with LineServer(files.port) as server:
        server.stop()
        with rigged(observer, files, server.url, simulator) as rig:
            rig.status('link', ERROR, 'cannot open the port: ')
            rig.writes(4.0, REFUSED)
            assert not rig.speeds
            server.start()
            rig.recovers()
            assert rig.has_read_only(SETPOINT)
            assert rig.node.text.count('cannot open the port') == 1  # not once for each attempt


def test_server_goes_away_and_returns(served: Served) -> None:
    rig, server = served
    server.stop()
    rig.node.wait_for('[ERROR]', f'{server.url}: the port was lost: ')
    rig.node.wait_for('[ERROR]', f'{server.url}: cannot open the port: ', 'refused')
    rig.status('link', ERROR, 'cannot open the port: ')
    rig.status('mappings', ERROR, '2 failed')
    rig.status('station 2', ERROR, 'unknown: the port is not open')
    rig.writes(4.0, REFUSED)
    lines = len(rig.node.lines)
    server.start()
    rig.recovers()
    rig.node.wait_for('[INFO]', f'{server.url}: open', after=lines)


def test_connection_is_reset(served: Served) -> None:
    rig, server = served
    lines = len(rig.node.lines)
    server.reset()
    rig.node.wait_for('[ERROR]', f'{server.url}: the port was lost: ', after=lines)
    rig.recovers()
    rig.node.wait_for('[INFO]', f'{server.url}: open', after=lines)


def test_frozen_server_takes_no_new_connection(served: Served) -> None:
    rig, server = served
    server.is_frozen = True
    server.reset()
    rig.status('link', ERROR, 'cannot open the port: the other end does not speak RFC 2217')
    rig.writes(4.0, REFUSED)
    server.is_frozen = False
    rig.recovers()


def test_server_is_frozen_and_goes_on(served: Served) -> None:
    rig, server = served
    lines = len(rig.node.lines)
    server.is_frozen = True
    assert is_unanswered(rig.write(3.0))
    rig.status('link', ERROR, 'port open, but none of 2 stations answers')
    rig.writes(4.0, NOT_SENT + NO_ANSWER)
    server.is_frozen = False
    rig.recovers()
    rig.node.wait_for('[INFO]', 'station 2 answers again', after=lines)


def test_server_hangs_up_on_every_client(served: Served) -> None:
    rig, server = served
    server.hangs_up = True
    server.reset()
    rig.status('link', ERROR, 'cannot open the port: ')
    rig.writes(4.0, REFUSED)
    server.hangs_up = False
    rig.recovers()  # an attempt to open the port may take 3 s
