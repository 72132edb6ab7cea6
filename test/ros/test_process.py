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

"""The node as a process: how it starts, ends, finds its port, and takes other names."""

from contextlib import nullcontext
import os
from pathlib import Path
import signal
from typing import cast

from abdf1_ros.ros import node
from abdf1_ros.ros.bridge.last_writes import LAST_WRITES, take_last_writes
from abdf1_ros.ros.process import main
import pytest
from rclpy.duration import Infinite
from std_msgs import msg
from support import ros
from support.simulator_process import Files, make_files, MAP_HEADER, NET_HEADER, NET_ROW, STATUSES


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return make_files(tmp_path)


# Ends


def writes_taken(*looks: tuple[float, int], limit: float = LAST_WRITES) -> int:
    """Return how many writes are taken by looks of which each takes (s, writes)."""
    moment, taken, left = 0.0, 0, [*looks]

    def look(seconds: float) -> None:
        nonlocal moment, taken
        duration, writes = left.pop(0) if left else (seconds, 0)
        moment, taken = moment + duration, taken + writes

    take_last_writes(look, lambda: taken, limit, lambda: moment)
    return taken


def test_slow_callback_is_no_pause_between_writes() -> None:
    write, timer, slow_timer = (0.001, 1), (0.001, 0), (0.3, 0)
    assert writes_taken(*5 * [write]) == 5
    assert writes_taken(*5 * [(0.2, 1)]) == 5  # each held up, as by a busy host
    assert writes_taken(*5 * [timer], write, slow_timer, slow_timer, write) == 2
    assert writes_taken(write, *3 * [(0.025, 0)], write) == 1
    assert writes_taken(*2 * [(0.025, 0)], write, (0.025, 0), write) == 2
    assert writes_taken(*5000 * [(0.01, 1)]) == pytest.approx(100 * LAST_WRITES, abs=1)


@pytest.mark.parametrize(('given', 'hint'), [
    ('--log-lvl debug', 'did you mean --ros-args --log-level?'),
    ('--log-level=debug', 'did you mean --ros-args --log-level?'),
    ('--params-flie x', 'did you mean --ros-args --params-file?'),
    ('--hlep', 'did you mean --help?'), ('--verison', 'did you mean --version?'),
    ('--ros-arg', 'did you mean --ros-args?'),
    ('net.csv map.csv', 'write parameters after --ros-args'),
    ('-p', 'write parameters after --ros-args')])
def test_unknown_argument_is_told_with_the_option_that_may_be_meant(
        given: str, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        node.main(['node', *given.split()])
    assert f'error: {given}: unknown argument; {hint}\n' in capsys.readouterr().err


@pytest.mark.parametrize('handler', [signal.SIG_DFL, signal.SIG_IGN])
def test_ends_with_its_terminal_but_not_under_nohup(
        handler: signal.Handlers, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    taken: list[int] = []
    monkeypatch.setattr(signal, 'getsignal', {signal.SIGHUP: handler}.get)
    monkeypatch.setattr(main, 'EndRequest', lambda numbers, begin: nullcontext(
        taken.extend(numbers)))
    with pytest.raises(SystemExit, match='2'):
        node.main(['node', '-p', 'net_file:=net.csv'])
    assert 'unknown argument; write parameters after --ros-args' in capsys.readouterr().err
    hangups = [signal.SIGHUP] * (handler is signal.SIG_DFL)
    assert taken == [signal.SIGINT, signal.SIGTERM, *hangups]


def test_silent_station_is_told_at_once_and_does_not_delay_the_end(
        observer: ros.Observer, files: Files) -> None:
    diagnostics = observer.diagnostics(files.port)
    with ros.Process('node', *files.args('diagnostics_period:=60', 'net.cmd_timeout:=500',
                                         'net.timeout:=200')) as node:
        observer.meet('/abdf1')  # what is told once is told to who listens
        with files.start_simulator() as simulator:
            diagnostics.until_fresh()
            diagnostics.clear()
            simulator.say('silent 2')
            ros.until_status(diagnostics, 'station 2', ros.ERROR)
            simulator.say('silent 1')
            status = ros.until_status(diagnostics, 'link', ros.ERROR)
            assert status.message == 'ERROR: port open, but none of 2 stations answers'
            diagnostics.clear()
            node.end(signal.SIGINT)
            simulator.end()
            status = ros.until_status(diagnostics, 'link', ros.ERROR,
                                      lambda status: ros.details(status)['port'] == 'closed')
            assert status.message == 'ERROR: closed'
    observer.forget(diagnostics)


# Starts


def refused_start(*arguments: str, status: int = 2) -> list[str]:
    """Return the lines of a node that does not start; its log is that of no other."""
    with ros.Process('node', *arguments) as node:
        assert node.result() == status, node.text
        assert 'Traceback' not in node.text
        return node.lines


@pytest.mark.parametrize(('given', 'name'), [
    (['--log-file-name', 'mine', '-p', 'read_only:=true'], 'mine'), (['--log-file-name'], 'me')])
def test_log_file_has_the_name_that_was_given(
        given: list[str], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ('ROS_LOG_DIR', 'HOME'):
        monkeypatch.delenv(variable)
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'new'))
    descriptor = cast(int, main.log_file('me', given))
    assert Path(f'/proc/self/fd/{descriptor}').readlink().match(f'{tmp_path}/new/log/{name}_*.log')
    assert os.fstat(descriptor).st_mode & 0o777 == 0o644
    os.close(descriptor)


def test_log_directory_that_is_missing_is_made(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'a' / 'b'))
    descriptor = cast(int, main.log_file('me', []))
    assert Path(f'/proc/self/fd/{descriptor}').readlink().match(f'{tmp_path}/a/b/me_*.log')
    os.close(descriptor)


@pytest.mark.parametrize('directory', ['/proc/none', '/proc'])
def test_unusable_log_directory_is_named(directory: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_LOG_DIR', directory)
    (line,) = refused_start(status=1)  # a disk may not be there yet
    assert directory in line
    assert line.endswith('; set ROS_LOG_DIR to a directory that this user may write to')
    assert 'arguments' not in line


def test_user_without_a_home_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('ROS_LOG_DIR', 'HOME'):
        monkeypatch.delenv(name)
    (line,) = refused_start()
    assert line.startswith('[FATAL]')
    assert line.endswith('] [abdf1]: environment: HOME is not set, so there is no directory for '
                         'the log; set ROS_LOG_DIR to a directory that this user may write to')


def test_trace_that_cannot_be_written_is_an_error_and_no_stop(
        observer: ros.Observer, files: Files) -> None:
    trace = files.folder / 'nowhere' / 'field.cap'
    speeds = observer.listen(msg.Int16MultiArray, '/traced/read/speeds')
    args = (*files.args(f'trace_file:={trace}'), '-r', '__node:=traced')
    with files.start_simulator() as simulator, ros.Process('node', *args) as node:
        node.wait_for('[ERROR] ', f'trace_file: {trace}: No such file or directory; '
                                  'nothing is recorded')
        speeds.values([1200, -800])
        node.end()
        simulator.end()
    observer.forget(speeds)


def test_names_can_be_remapped(observer: ros.Observer, files: Files) -> None:
    diagnostics = observer.diagnostics(files.port)
    door = observer.listen(msg.UInt8MultiArray, '/cell/door_closed')
    bits = observer.listen(msg.UInt8MultiArray, '/cell/line_a/read/bits')
    active = observer.listen(msg.UInt16MultiArray, '/cell/line_a/active_stations')
    remaps = ('-r', '__ns:=/cell', '-r', '__node:=line_a', '-r', '~/read/door:=/cell/door_closed',
              '-r', 'read/bits:=/cell/bits')
    with files.start_simulator() as simulator, \
            ros.Process('node', *files.args('use_sim_time:=true', 'map.recipe.max:=5',
                                            'send_in_sequence:=true'), *remaps) as node:
        node.wait_for('[WARN] ', 'the remap of read/bits has no effect: write ~/read/bits')
        node.wait_for('[WARN] ', 'without effect', ': map.recipe.max')
        node.wait_for('[WARN] ', 'send_in_sequence without effect: only for Mode Master')
        assert ros.values_in(door.first()) == [1]
        assert ros.values_in(bits.first()) == [1, 0, 0, 1, 1, 0]
        assert active.first().data[0] == 0b110
        # Also with the clock of a simulation, which nobody publishes here.
        diagnostics.until_fresh()
        assert [status.name for status in diagnostics[-1].status] == [
            f'cell/line_a: {name}' for name in STATUSES]
        assert not observer.node.count_publishers('/cell/line_a/read/door')
        observer.until(
            lambda: observer.node.count_subscribers('/cell/line_a/write/flags'), 'a subscriber')
        assert ros.get_parameters(observer, 'net.baud', node='/cell/line_a') == [115200]
        node.end()
        simulator.end()
    for inbox in (diagnostics, door, bits, active):
        observer.forget(inbox)


def test_full_duplex_bridge_is_read_and_written_by_the_plc(
        observer: ros.Observer, files: Files) -> None:
    ros.write_csv(files.net, f'Mode,PLC_Type,{NET_HEADER}', [f'Peer,PLC5,{NET_ROW}'])
    ros.write_csv(files.map, MAP_HEADER, [
        'speeds,Read,N7:0,1,PLC5,2,,,,,', 'orders,Serve,N7:50,5,PLC5,2,,,,,'])
    speeds = observer.listen(msg.Int16MultiArray, '/peer/read/speeds')
    orders = observer.listen(msg.Int16MultiArray, '/peer/read/orders')
    results = observer.results('/peer')
    arguments = ('--pty', str(files.port), '--data', str(files.simulator))
    with ros.Process('simulator', *arguments, '--full-duplex', '1') as simulator:
        simulator.wait_for('stations 1 (PLC5) on')
        with ros.Process('node', *files.args(), '-r', '__node:=peer') as node:
            assert ros.values_in(speeds.first()) == [1200, -800]
            (endpoint,) = observer.until(
                lambda: observer.node.get_publishers_info_by_topic('/peer/read/orders'),
                'the publisher')
            assert endpoint.qos_profile.deadline == Infinite  # the PLC writes when it likes
            assert not orders
            simulator.say('msg 1 N7:50 11 -22')
            assert ros.values_in(orders.first()) == [11, -22]
            simulator.wait_for('station 1: msg N7:50 confirmed')
            publisher = observer.publisher(msg.Int16MultiArray, '/peer/write/orders')
            publisher.publish(msg.Int16MultiArray(data=[3, 4]))
            assert results.first().message == 'written'
            node.end()
        simulator.end()
    observer.node.destroy_publisher(publisher)
    for inbox in (speeds, orders, results):
        observer.forget(inbox)
