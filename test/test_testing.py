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

"""The fixture for tests of cells: the whole example, and the test that its tutorial shows."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from typing import Any, BinaryIO
from unittest.mock import Mock

from abdf1_ros.client import Client
from abdf1_ros.df1 import frames
from abdf1_ros.pccc.data_table import OutOfRange
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros import observer
from abdf1_ros.ros.topics.messages import latched_qos
from abdf1_ros.testing.cell import Bridge, Observer, PATIENCE, SimulatedCell
from abdf1_ros.testing.fixtures import abdf1_cell, abdf1_plcs
from abdf1_ros.testing.plcs import Plcs
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_msgs.msg import Int16MultiArray
from support.forked import Forked
from support.ros_tools import SOURCE
from support.scripted_line import ScriptedLine

EXAMPLE = SOURCE / 'examples' / 'testing'
TUTORIAL = (SOURCE / 'docs' / 'tutorials' / 'testing.md').read_text(encoding='utf-8')

__all__ = ['abdf1_cell', 'abdf1_plcs']

Cells = Callable[..., SimulatedCell]
START = Bridge.start


def _run(text: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(text, 'example', 'exec'), names)
    return names


# Its tests, and its fixtures, become those of this module.
globals().update({name: thing for name, thing in _run(
    (EXAMPLE / 'test_press.py').read_text(encoding='utf-8')).items()
    if name.startswith('test_') or name in ('cell', 'pressure')})


@pytest.fixture(autouse=True)
def _forks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let bridges be forks, but for one test that has them as users do."""
    def start(bridge: Bridge) -> None:
        with bridge.log.open('ab') as log:
            bridge.process = Forked('node', ['--ros-args', *bridge.words], log.fileno())

    if request.node.name != 'test_test_of_the_tutorial_passes':
        monkeypatch.setattr(Bridge, 'start', start)


def test_plugin_of_the_tutorial_is_that_of_the_example() -> None:
    line = "pytest_plugins = ['abdf1_ros.testing']"
    assert line in TUTORIAL
    assert line in (EXAMPLE / 'conftest.py').read_text(encoding='utf-8')


@pytest.mark.long
def test_example_is_collected_where_there_is_no_launch_testing() -> None:
    found = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', 'examples/testing'], cwd=SOURCE,
        check=False, capture_output=True, text=True, timeout=60)
    assert found.returncode == 0, found.stdout
    assert 'test_press.py' in found.stdout


def test_test_of_the_tutorial_passes(abdf1_cell: Cells) -> None:  # noqa: F811
    _run(re.findall(r'```python\n(.*?)```', TUTORIAL, re.DOTALL)[1])['test_pressure'](abdf1_cell)


def test_plcs_of_the_tutorial_need_no_ros(tmp_path: Path) -> None:
    """Also where rclpy is missing; the fixture that needs it says so."""
    plugin, test = re.findall(r'```python\n(.*?)```', TUTORIAL, re.DOTALL)[::3]
    shared = re.findall(r'```python\n(.*?)```', TUTORIAL, re.DOTALL)[4]
    (tmp_path / 'conftest.py').write_text(plugin, 'utf-8')
    (tmp_path / 'test_plcs.py').write_text(
        f'{test}\n\ndef test_cell(abdf1_cell):\n    pass\n', 'utf-8')
    (tmp_path / 'test_shared.py').write_text(
        f'{shared}\n\ndef test_sets(plcs):\n    plcs.set("N7:0", 5)\n'
        '\n\ndef test_sees(plcs):\n    assert plcs.word("N7:0") == 5\n', 'utf-8')
    said = subprocess.run(
        [sys.executable, '-c', 'import sys; sys.modules["rclpy"] = None\nimport pytest; '
         'sys.exit(pytest.main(["-q", "-p", "no:cacheprovider"]))'], cwd=tmp_path, check=False,
        capture_output=True, text=True, timeout=60).stdout
    assert '3 passed, 1 error' in said
    assert re.search(r'abdf1_cell needs ROS 2 \(.*rclpy.*\): is it sourced', said)
    assert 'Traceback' not in said and 'site-packages' not in said


def test_plcs_need_no_pytest(tmp_path: Path) -> None:
    (tmp_path / 'data.csv').write_text('Station,PLC_Type,Address\n1,SLC,N7:0\n')
    subprocess.run(
        [sys.executable, '-c', 'import sys; sys.modules["pytest"] = None\n'
         'from abdf1_ros.testing.plcs import Plcs\n'
         'with Plcs("data.csv") as plcs:\n    assert plcs.word("N7:0") == 0'],
        cwd=tmp_path, check=True, timeout=60)


def test_each_line_of_plcs_is_its_own(abdf1_plcs: Callable[..., Plcs]) -> None:  # noqa: F811
    data = 'Station,PLC_Type,Address,Length,Values\n{0},SLC,N7:0,2,{0}\n'
    lines = [abdf1_plcs(data.format(station)) for station in (1, 2)]
    for station, line in enumerate(lines, 1):
        with line.client(station=station, plc_type='SLC') as plc:
            assert plc.read('N7:0') == station
            line.set('N7:1', 7, station=station)
            assert plc.read('N7:1') == 7
        files = line.files('Tag,Command,Address,Station,PLC_Type\n'
                           f'a,ReadWrite,N7:0,{station},SLC\n')
        with Client.from_files(*files) as plant:
            plant.write('a', 9)
        assert line.word('N7:0', station) == 9


@pytest.mark.parametrize(('call', 'text'), [
    (lambda plcs: plcs.word('N7:0/1'), '^N7:0/1 is a bit of the word N7:0; a client'),
    (lambda plcs: plcs.set('N7:0/1', 1), '^N7:0/1 is a bit'),
    (lambda plcs: plcs.word('F8:0'), r'^F8:0 is a float32 of 2 words; a client\(\)'),
    (lambda plcs: plcs.set('ST9:0', 1), '^ST9:0 is a string of 42 words'),
    (lambda plcs: plcs.set('N7:0', 1.5), '^1.5 is not a word, from'),
    (lambda plcs: plcs.set('N7:0', [1, 2]), r'^\[1, 2\] is not a word'),
    (lambda plcs: plcs.set('N7:0'), '^None is not a word')])
def test_fixture_takes_no_word_for_what_is_none(
        call: Callable[[Plcs], object], text: str,
        abdf1_plcs: Callable[..., Plcs]) -> None:  # noqa: F811
    plcs = abdf1_plcs('Station,PLC_Type,Address\n1,SLC,N7:0\n1,SLC,F8:0\n1,SLC,ST9:0\n')
    with pytest.raises(ValueError, match=text):
        call(plcs)
    with plcs.client() as plc:
        assert plc.read('N7:0') == 0


def test_mistaken_arguments_of_fixture_and_client_are_named(
        abdf1_plcs: Callable[..., Plcs], tmp_path: Path) -> None:  # noqa: F811
    for path in (tmp_path / 'data.csv', 'data.csv'):
        with pytest.raises(ValueError, match=r'data.csv.* should be the text of a simulator CSV'):
            abdf1_plcs(path)
    plcs = abdf1_plcs('Station,PLC_Type,Address,Length\n1,SLC,N7:0,4\n')
    with pytest.raises(TypeError, match='^baud, duplex: the simulated line decides that$'):
        plcs.client(duplex='full', baud=9600)
    with pytest.raises(OutOfRange, match='^1 word at N7:99 would end after the file, which has 4'):
        plcs.set('N7:99', 1)
    (tmp_path / 'data.csv').write_text('Station,PLC_Type,Address\n1,SLC,N7:0\n')
    idle = Plcs(tmp_path / 'data.csv')
    with pytest.raises(RuntimeError, match=r'use "with Plcs\(...\) as plcs:"'):
        idle.client()
    with idle:
        idle.client(plc_type='SLC').close()


@pytest.mark.parametrize('station', ['1', 1.0])
def test_station_that_is_no_whole_number_is_named(
        station: object, abdf1_plcs: Callable[..., Plcs]) -> None:  # noqa: F811
    plcs: Any = abdf1_plcs('Station,PLC_Type,Address\n1,SLC,N7:0\n')
    for call in (lambda: plcs[station], lambda: plcs.word('N7:0', station=station),
                 lambda: plcs.set('N7:0', 1, station=station)):
        with pytest.raises(TypeError, match=f'^station {station!r} should be a whole number$'):
            call()


def test_data_of_plcs_are_a_file_in_the_working_folder_too(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('data.csv').write_text('Station,PLC_Type,Address,Values\n1,SLC,N7:0,5\n')
    for data in ('data.csv', Path('data.csv')):
        with Plcs(data) as plcs, plcs.client(plc_type='SLC') as plc:
            assert plc.read('N7:0') == 5


def test_what_never_happens_is_named(
        abdf1_cell: Cells, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    monkeypatch.setattr('abdf1_ros.testing.cell.PATIENCE', 0.2)
    cell = abdf1_cell(*SMALL)
    with pytest.raises(AssertionError, match='waited for a word of 7'):
        cell.ros.until(lambda: cell.plcs.word('N7:0') == 7, 'a word of 7')
    with pytest.raises(AssertionError, match=r'message on /none; got \[\], publishers: 0'):
        cell.ros.listen(Int16MultiArray, '/none').first()
    monkeypatch.undo()
    with pytest.raises(LookupError, match='there is no station 9; the data has 1'):
        cell.plcs.word('N7:0', station=9)
    with pytest.raises(ValueError, match='65536 is not a word'):
        cell.plcs.set('N7:0', 1, 0x10000)


def test_domain_of_others_and_the_default_one_are_not_taken(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, 'getpid', lambda: 299)
    claims = [observer.claim_domain() for _ in range(3)]
    for _, claim in claims:
        claim.close()
    first, second, third = (domain for domain, _ in claims)
    assert 0 not in (first, second, third) and first != second != third


def test_what_can_never_come_is_told_at_once(abdf1_cell: Cells) -> None:  # noqa: F811
    data = 'Station,PLC_Type,Address,Length,Values,Motion,Period\n1,SLC,N7:0,4,250,,\n'
    rows = 'Tag,Command,Address,Station,PLC_Type\npressure,Read,N7:{},1,SLC\n'
    with pytest.raises(ConfigurationError, match='(?s)map.csv:2:3.*map.csv:3:1'):
        abdf1_cell(data, rows.format('x') + ',Read,N7:0,1,SLC')
    with pytest.raises(ConfigurationError, match='net.csv: .* only Mode Master with Error'):
        abdf1_cell(data, rows.format(0), 'Mode\nPeer\n')
    with pytest.raises(LookupError, match='there is no station 3'):
        abdf1_cell(data, rows.format(0), ladders=[3])
    for parameters in ({'write_timeout': 1.0}, 'write_timeout:=1.0', [1.0]):
        with pytest.raises(ConfigurationError, match='^parameters: .* should be a list of texts'):
            abdf1_cell(data, rows.format(0), parameters=parameters)
    cell = abdf1_cell(data, rows.format(0), parameters=['write_timeout:=1.0', 'net.baud:=7'])
    begun = time.monotonic()
    with pytest.raises(AssertionError, match='(?s)bridge has ended with 2.*Baud = "7"'):
        cell.ros.listen(Int16MultiArray, '/abdf1/read/pressure').first()
    with pytest.raises(AssertionError, match='bridge has ended with 2'):
        cell.ros.until(lambda: False, 'a condition that is only false')
    assert cell.ros.until(lambda: 7, 'what is there though the bridge has ended') == 7
    assert time.monotonic() - begun < PATIENCE - 5.0
    assert cell.end() == 2


@pytest.mark.parametrize(('failure', 'told'), [
    (None, 'the bridge has ended with 2.*stale_aftr'),
    (AssertionError('its own failure'), '^its own failure$')])
def test_bridge_that_has_ended_by_itself_fails_a_test_that_waits_for_nothing(
        failure: Exception | None, told: str, tmp_path: Path) -> None:
    cell = SimulatedCell(tmp_path, *SMALL, parameters=['stale_aftr:=2.0'])
    with pytest.raises(AssertionError, match=f'(?s){told}'), cell:
        with suppress(AssertionError):
            cell.ros.until(lambda: False, 'the end of the bridge')
        if failure:
            raise failure
    assert not cell.ros.context.ok()


def test_end_of_the_bridge_by_the_test_is_told_when_nothing_comes(
        abdf1_cell: Cells, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    monkeypatch.setattr('abdf1_ros.testing.cell.PATIENCE', 0.2)
    cell = abdf1_cell(*SMALL)
    cell.end(signal.SIGKILL)
    with pytest.raises(AssertionError, match='^waited for nine; the test has ended the bridge'):
        cell.ros.until(lambda: False, 'nine')


def test_node_of_the_test_needs_no_context(abdf1_cell: Cells) -> None:  # noqa: F811
    cell = abdf1_cell(*SMALL)
    node, heard = Node('mine'), []
    node.create_subscription(Int16MultiArray, '/abdf1/read/a', heard.append, latched_qos())
    cell.ros.executor.add_node(node)
    cell.ros.until(lambda: heard, 'a value in our own node')
    assert cell.end() == 0
    assert 'abdf1' not in node.get_node_names()  # no publisher goes while a subscription does
    node.destroy_node()


def test_log_of_a_bridge_has_all_starts_and_its_end_is_shown(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Told:
        poll = staticmethod(int)  # its exit status is 0

        def __init__(self, words: object, stdout: BinaryIO, stderr: object) -> None:
            stdout.write(b''.join(b'line %d\n' % number for number in range(8)))

    monkeypatch.setattr(Bridge, 'start', START)
    monkeypatch.setattr(subprocess, 'Popen', Told)
    bridge = Bridge([], tmp_path / 'log')
    assert bridge.last_words() == ''
    bridge.start()
    bridge.start()
    assert bridge.last_words().splitlines()[1:] == [
        'line 6', 'line 7', *(f'line {number}' for number in range(8))]
    with pytest.raises(AssertionError, match='the bridge has ended with 0; its last words:'):
        bridge.check()


def test_program_of_a_ladder_runs_in_the_station_that_is_named(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Mock(**{'monotonic.return_value': 9})
    monkeypatch.setattr('abdf1_ros.testing.plcs.time', clock)
    (tmp_path / 'data.csv').write_text(
        'Station,PLC_Type,Address,Length,Motion,Period\n1,SLC,N7:0,2,,\n2,SLC,N7:0,2,,\n'
        '3,SLC,N7:0,3,Ramp,1000\n', 'utf-8')
    plcs = Plcs(tmp_path / 'data.csv', ladders=[2, 3])
    assert [plcs[number].ladder is None for number in (1, 2, 3)] == [True, False, False]
    plcs.set('N7:0', -0x8000, 0xFFFF)
    clock.monotonic.return_value = 16
    plcs.set('N7:1', 40, station=3)  # its program ran before
    assert [plcs.word('N7:0'), plcs.word('N7:1')] == [0x8000, 0xFFFF]
    assert [plcs.word(f'N7:{number}', 3) for number in range(3)] == [7, 40, 7]
    monkeypatch.undo()
    with pytest.raises(AssertionError), plcs:  # the line ends all the same
        plcs.faults.append(ValueError())
    assert not plcs.link.is_alive() and not Path(plcs.port).is_symlink()


def test_gateway_of_the_data_answers_for_its_plcs(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'data.csv').write_text('Station,PLC_Type,Address,Via\n1,SLC,N7:0,10\n', 'utf-8')
    monkeypatch.setattr('abdf1_ros.testing.plcs.LinkThread', links := Mock())
    (plcs := Plcs(tmp_path / 'data.csv')).lose()
    links.call_args.kwargs['on_fault'](bug := ValueError())
    assert plcs.faults == [bug]
    line = ScriptedLine(links.call_args.args[0])
    for station, answer in ((1, b''), (10, frames.EOT)):
        line.write(frames.poll_frame(station))
        assert line.read(1.0) == answer


SMALL = ('Station,PLC_Type,Address,Length\n1,SLC,N7:0,2\n',
         'Tag,Command,Address,Station,PLC_Type\na,Read,N7:0,1,SLC\n')


def test_executor_ends_before_a_node_goes_and_the_context_last(
        monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def record(owner: Any, name: str) -> None:
        original = getattr(owner, name)

        def recorded(*arguments: Any, **named: Any) -> Any:
            calls.append(name)
            return original(*arguments, **named)
        monkeypatch.setattr(owner, name, recorded)

    with Observer() as observer:
        Observer('guest', observer.context).__exit__()
        assert observer.context.ok()
        observer.executor.add_node(Node('other', context=observer.context))
        for owner, name in ((observer.executor, 'shutdown'), (observer.node, 'destroy_node'),
                            (observer.context, 'try_shutdown')):
            record(owner, name)
    assert calls == ['shutdown', 'destroy_node', 'try_shutdown']
    assert observer.executor.get_nodes() == []


def test_publisher_asks_its_node_until_one_of_the_questions_is_answered(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.testing.cell.time', Mock(monotonic=count(5).__next__))
    never, late = Mock(done=lambda: False), Mock(done=Mock(side_effect=[False, False, True]))
    observer = Mock(until=lambda condition, _: next(filter(None, (condition() for _ in '12345'))))
    observer.meet = partial(Observer.meet, observer)
    node = observer.node
    client = node.create_client.return_value
    client.call_async.side_effect = [never, late, never]
    assert Observer.publisher(observer, Int16MultiArray, '/line/plc/write/a') \
        is node.create_publisher.return_value
    assert node.create_client.call_args[0] == (GetParameters, '/line/plc/get_parameters')
    node.destroy_client.assert_called_once_with(client)


def test_cell_that_cannot_be_made_leaves_no_thread(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread of its PLCs ran before the observer was there."""
    def fail(*arguments: object, **options: object) -> None:
        raise TimeoutError('a busy host')

    monkeypatch.setattr(SimulatedCell, 'observer', fail)
    before = threading.enumerate()
    with pytest.raises(TimeoutError):
        SimulatedCell(tmp_path, *SMALL)
    assert threading.enumerate() == before


@pytest.mark.parametrize('at', ['start', 'end'])
def test_cell_that_fails_leaves_no_thread_and_no_context(
        at: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise TimeoutError('a busy host')

    monkeypatch.setattr(Bridge, at, fail)
    cell = SimulatedCell(tmp_path, *SMALL)
    with pytest.raises(TimeoutError), cell:
        assert at == 'end'
        cell.plcs.word('N7:0')
    assert not cell.ros.context.ok()
    assert not [thread for thread in threading.enumerate() if thread is cell.plcs.link]
    monkeypatch.undo()
    cell.end()
