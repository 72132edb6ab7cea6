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

"""Many lines in one process: their names, their faults, and their end."""

from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from itertools import pairwise
from pathlib import Path
import re
import resource
import socket
from statistics import median
import threading
import time
from typing import Any
from unittest.mock import Mock

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros import lines as module
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.bridge.port_owners import PortOwners
from abdf1_ros.ros.lines import chosen, main, RestartedLine, sections, start_one
from abdf1_ros.ros.parameters import files
from abdf1_ros.ros.parameters.files import usable_files
from abdf1_ros.ros.process import main as process
from abdf1_ros.signals import EndRequest
from abdf1_ros.testing.plcs import Plcs
import pytest
from rclpy.node import Node
from rclpy.utilities import get_default_context
from std_msgs.msg import Int16MultiArray
from std_srvs.srv import Trigger
from support import ros
from support.commands import Output
from support.ptys import PATIENCE

PRESS, PAINT = '/press/press_plc', '/paint/paint_plc'


def yaml_file(folder: Path, text: str) -> str:
    path = folder / 'lines.yaml'
    path.write_text(text, 'latin-1')
    return str(path)


# Names


@pytest.mark.parametrize(('text', 'expected'), [
    ('/press/press_plc:\n  ros__parameters: {a: 1}', ['/press/press_plc']),
    ('press:\n  press_plc:\n    ros__parameters: {a: 1}\n  other:\n    ros__parameters: {}',
     ['/press/press_plc', '/press/other']),
    ('abdf1:\n  ros__parameters: {a: 1}', ['/abdf1']),
    ('/**:\n  ros__parameters: {a: 1}\n/*/x:\n  ros__parameters: {}', []),
    ('lines:\n  ros__parameters: {lines: [x]}\nx/lines:\n  ros__parameters: {a: 1}\n'
     'host_b: {ros__parameters: {}}', ['/x/lines']),
    ('', [])])
def test_nodes_of_a_parameter_file(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert [*sections(2 * [yaml_file(tmp_path, text)], 'host_b')] == expected


def test_two_sections_of_one_name_are_a_fault(tmp_path: Path) -> None:
    line = '/hall/a:\n  ros__parameters:\n    port: x\n'
    path = yaml_file(tmp_path, f'{line}hall:\n  b:\n    ros__parameters: {{}}\n{line}')
    with pytest.raises(ConfigurationError) as error:
        sections([path])
    assert str(error.value) == (
        f'{path}:7: /hall/a has a section already, in line 1; give each DF1 line a name '
        'of its own')


@pytest.mark.parametrize('text', [None, '{', '\x00', '\xff', '5'])
def test_parameter_file_that_cannot_be_read(tmp_path: Path, text: str | None) -> None:
    path = str(tmp_path / 'nothing') if text is None else yaml_file(tmp_path, text)
    with pytest.raises(ConfigurationError, match=path):
        sections([path])


@pytest.mark.parametrize(('text', 'expected'), [
    ('a:\n\tros__parameters:\n\t\tport: x\n', ':2:1: a tab; YAML is indented with spaces'),
    ('a: [1\nb: 2\n', ":2:2: expected ',' or ']', but got ':'"),
    ('a:\n  ros__parameters: {}\n  hall/press-plc:\n    ros__parameters: {"x-y": 1}\n',
     ':3: "hall/press-plc" cannot name a node: letters, digits and underscores, as in '
     'hall/press_plc'),
    ('a: &x\n  ros__parameters: {}\nb: *x\n',
     ':3:4: an alias, *x: ROS does not accept it; write the values out'),
    ('a: &x\n  b: *x\n', ':2:6: an alias, *x: ROS does not accept it; write the values out'),
    ('a:\n  ros__parameters: {b: ' + 600 * '[',
     ':2:41: more than 20 levels inside each other'),
    (''.join(f'{number * " "}a:\n' for number in range(600)) + 600 * ' ' + 'a: 1\n',
     ':21:21: more than 20 levels inside each other'),
    ('a:\n  ros__parameters: !foo {}\n', ':2:20: the tag !foo: ROS does not know it; leave it '
     'out'),
    ('a:\n  ros__parameters: {b: !!python/name:os.system x}\n',
     ':2:24: the tag tag:yaml.org,2002:python/name:os.system: ROS does not know it; leave it '
     'out'),
    ('b: {ros__parameters: {}}\n? [a]\n: {ros__parameters: {}}\n',
     ':2:3: a list or mapping as a name: a name should be one word')])
def test_parameter_file_that_ros_would_refuse(tmp_path: Path, text: str, expected: str) -> None:
    path = yaml_file(tmp_path, text)
    with pytest.raises(ConfigurationError) as error, \
            usable_files(['node', '--ros-args', '--params-file', path], leaves_out=False):
        pass
    assert str(error.value) == f'{path}{expected}'


def test_parameter_file_in_the_home_folder(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    assert files.with_home(['lines', '--ros-args', '--params-file', '~/a.yaml', '-p', '~/b',
                            '--log-config-file', '$HOME/log']) == [
        'lines', '--ros-args', '--params-file', f'{tmp_path}/a.yaml', '-p', '~/b',
        '--log-config-file', f'{tmp_path}/log']
    path = yaml_file(tmp_path, 'a: [')
    assert main(['lines', '--ros-args', '--params-file', '$HOME/lines.yaml']) == 2
    assert f'{path}:1:' in capfd.readouterr().err


def test_what_is_left_out_changes_nothing_else(tmp_path: Path) -> None:
    kept = "  a:\n    ros__parameters: {day: 2001-99-99, no-1: 010, text: '5', list: [1, 2]}\n"
    path = yaml_file(tmp_path, (
        f'hall/press-plc:\n  ros__parameters: {{}}\nhall:\n  "b\\xe9": {{c: {{}}}}\n{kept}'))
    given = ['--params-file', '/nowhere', *['--params-file', path] * 2, '-p', '--params-file']
    with usable_files(given, leaves_out=True) as (*first, usable, name, again, option, value):
        assert [*first, path, name, path, option, value] == given
        for file in usable, again:
            assert Path(file).read_text('utf-8') == f'hall:\n{kept}'


def test_temporary_folder_is_asked_for_only_where_a_name_is_left_out(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk may be full or read-only, as in a container."""
    def refuse(**kwargs: object) -> None:
        raise FileNotFoundError('no usable temporary directory')

    monkeypatch.setattr(files, 'TemporaryDirectory', refuse)
    good = ['--params-file', yaml_file(
        tmp_path, 'a: {ros__parameters: [!!str x, [!!bool on], !!int 1, !!float 2, !!null ~]}')]
    with usable_files(good, leaves_out=True) as given:
        assert given == good
    bad = yaml_file(tmp_path, 'a-b: {ros__parameters: {port: x}}')
    with pytest.raises(ConfigurationError, match='"a-b" cannot name a node'), \
            usable_files(['--params-file', bad], leaves_out=True):
        pass


def test_lines_are_chosen_by_name() -> None:
    assert chosen([PRESS, PAINT], []) == [PRESS, PAINT]
    assert chosen([PRESS, PAINT], ['paint_plc']) == [PAINT]
    assert chosen([PRESS, PAINT], ['/press/press_plc', 'paint_plc']) == [PRESS, PAINT]
    assert chosen([PRESS, PAINT], ['paint']) == [PAINT]  # a part of its name, and of no other
    both = ['/hall/a/plc', '/hall/b/plc']
    assert chosen(both, ['plc']) == both
    with pytest.raises(ConfigurationError, match='no section is called hall'):
        chosen(both, ['hall'])
    with pytest.raises(ConfigurationError, match='called glue; the sections are /press/'):
        chosen([PRESS, PAINT], ['press_plc', 'glue'])
    with pytest.raises(ConfigurationError, match='no line to run: give a parameter file'):
        chosen([], [])


# A process with three lines


def test_line_is_started_again_once_after_each_internal_error(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'RESTART_AFTER', 0.0)
    made: list[Exception] = []
    ends = iter([*4 * [AttributeError('a bug')], *2 * [ConfigurationError([])]])

    def make() -> BridgeNode:
        made.append(next(ends))
        raise made[-1]

    line, other = lines = [RestartedLine('/hall/a', make), RestartedLine('/hall/b', make)]
    line.make()
    other.make()
    for count in (3, 4, 5, 6, 6):  # each start holds up the other lines, so one comes at a time
        start_one(lines)
        assert len(made) == count
    assert (line.restarts, other.restarts) == (2, 2)
    line.due, line.closing = 0.0, threading.current_thread()
    assert not line.is_due
    line.closing = threading.Timer(0.1, list)
    line.closing.start()
    line.end_callbacks(time.monotonic())  # its PLCs have to be told first
    assert not line.closing.is_alive()
    line.faults, line.closing = (), threading.current_thread()
    assert line.reason == 'is started again'
    monkeypatch.setattr(module, 'time', Mock(**{
        'monotonic.return_value': time.monotonic() + 9.0}))
    assert line.reason == 'its old node does not end: restart the process'


class Plant:
    """Simulated PLCs on lines of their own, and ``lines`` in a thread of this process."""

    def __init__(self, folder: Path, stack: ExitStack, request: EndRequest) -> None:
        self.folder = folder
        self._request = request
        self.observer = stack.enter_context(ros.Observer())
        self.plcs = {}
        self.nodes: dict[str, BridgeNode] = {}
        for name in ('a', 'b', 'c'):
            (folder / name).mkdir()
            data = ros.write_csv(
                folder / name / 'plc.csv', 'Station,PLC_Type,Address,Length,Values',
                [f'1,PLC5,N7:0,16,7 {ord(name)}'])
            self.plcs[name] = stack.enter_context(Plcs(data))
        self.status = 0
        self.thread = threading.Thread()
        for name in self.plcs:
            self.write_map(name, 'speed,Read,N7:0,1,PLC5,2')
            self.write_net(name, self.plcs[name].port)

    def write_net(self, name: str, port: str, share: str = '') -> None:
        """Write the net file of a line."""
        ros.write_csv(self.folder / f'{name}_net.csv', 'Com_Port,Baud,Timeout,Share',
                      [f'{port},115200,100,{share}'])

    def write_map(self, name: str, row: str) -> None:
        ros.write_csv(self.folder / f'{name}_map.csv',
                      'Tag,Command,Address,Station,PLC_Type,Length', [row])

    def start(self, *arguments: str, reads: str = '') -> None:
        """Run the process; see that these lines read."""
        text = ''.join(
            f'/hall/{name}:\n  ros__parameters:\n'
            f'    net_file: {self.folder}/{name}_net.csv\n'
            f'    map_file: {self.folder}/{name}_map.csv\n' for name in self.plcs)
        given = ['lines', '--ros-args', '--params-file', yaml_file(self.folder, text), *arguments]
        self.thread = threading.Thread(target=lambda: setattr(self, 'status', main(given)))
        self.thread.start()
        assert [self.speeds(name) for name in reads] == [[7, ord(name)] for name in reads]

    def speeds(self, name: str) -> list[float] | str:
        """Return the next value of a line."""
        inbox = self.observer.listen(Int16MultiArray, f'/hall/{name}/read/speed', ros.EVERYTHING)
        value = ros.values_in(inbox.first())
        self.observer.forget(inbox)
        return value

    def make_node(self, name: str, **named: Any) -> BridgeNode:
        self.nodes[name] = node = BridgeNode(name, **named)
        return node

    def fail(self, name: str) -> None:
        """Let a bug show in a line."""
        self.nodes[name].session.events.read = None

    def end(self) -> int:
        """End the process as SIGTERM does; return its exit status."""
        if self.thread.is_alive():
            self._request.set()
            self.thread.join(PATIENCE)
            assert not self.thread.is_alive()
        return self.status


@pytest.fixture(autouse=True)
def end_request(monkeypatch: pytest.MonkeyPatch) -> EndRequest:
    """Return what asks the process to end: only the main thread could take signals."""
    event = EndRequest(())
    monkeypatch.setattr(process, 'EndRequest', lambda *arguments: nullcontext(event))
    monkeypatch.setattr(process, 'end_by_the_clock', lambda: None)  # it would end all tests too
    return event


@pytest.fixture
def plant(tmp_path: Path, end_request: EndRequest,
          monkeypatch: pytest.MonkeyPatch) -> Iterator[Plant]:
    with ExitStack() as stack:
        plant = Plant(tmp_path, stack, end_request)
        monkeypatch.setattr(module, 'BridgeNode', plant.make_node)
        yield plant
        plant.end()
        assert not [thread for thread in threading.enumerate() if thread.name == 'callbacks']
        assert not get_default_context().ok()
        plant.observer.until(lambda: not {'lines', *plant.nodes} & {
            *plant.observer.node.get_node_names()}, 'the end of all nodes')


def line_status(plant: Plant, level: bytes) -> dict[str, str]:
    """Wait for the status of all lines; return its values."""
    return ros.details(ros.until_status(plant.observer.diagnostics(''), 'lines', level))


def test_each_line_is_a_node_of_its_own(plant: Plant, capfd: Output) -> None:
    second = yaml_file(plant.folder / 'b', '/hall/b: {ros__parameters: {write_timeout: 3.5}}')
    plant.start('--params-file', second, reads='abc')
    assert f'{second}:1: /hall/b has a section in {plant.folder}/lines.yaml:5 too: it is one ' \
        'line, with the later of two values' in capfd.readouterr().err
    assert ros.get_parameters(plant.observer, 'net.com_port', 'write_timeout', node='/hall/b') == [
        plant.plcs['b'].port, 3.5]
    diagnostics = plant.observer.diagnostics(plant.plcs['c'].port)
    assert ros.until_status(diagnostics, 'link', ros.OK).name == 'hall/c: link'
    assert line_status(plant, ros.OK) == {'lines': '3', 'running': '3', 'restarts': '0'}
    assert plant.observer.call(Trigger, '/hall/a/reload', Trigger.Request()).success
    assert plant.end() == 0


def test_process_has_a_name_of_its_own(plant: Plant) -> None:
    own = yaml_file(plant.folder / 'b', 'host_b: {ros__parameters: {strict_lines: true}}')
    plant.start('-r', 'lines:__node:=host_b', '--params-file', own, reads='a')
    diagnostics = plant.observer.diagnostics('')
    assert ros.until_status(diagnostics, 'lines', ros.OK).name == 'host_b: lines'
    assert plant.observer.call(Trigger, '/host_b/reload', Trigger.Request()).success


def test_second_process_of_the_same_name_is_a_warning(plant: Plant, capfd: Output) -> None:
    text = 'another node is called /lines too'
    (plant.folder / 'b_net.csv').write_text('Baud\n9601\n')
    plant.start(reads='a')
    shown = plant.observer.diagnostics('')
    other = Node('lines', context=plant.observer.context)
    try:
        ros.until_status(shown, 'lines', ros.ERROR, lambda status: status.message.startswith(
            f'ERROR: 1 of 3 lines do not run; {text}'))
        plant.write_net('b', plant.plcs['b'].port)
        plant.observer.call(Trigger, '/lines/reload', Trigger.Request())
        status = ros.until_status(shown, 'lines', ros.WARN)
    finally:
        other.destroy_node()
    assert status.message.startswith(f'WARN: 3 of 3 lines run; {text}')
    logged = capfd.readouterr().err
    assert re.search(r'\[WARN\] \[[0-9.]+\] \[lines\]: 2 of 3 lines run', logged)
    assert text in logged


def test_process_may_open_as_many_files_as_the_system_allows(
        plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, 'getrlimit', lambda number: (1024, 5000))
    monkeypatch.setattr(resource, 'setrlimit', lambda number, pair: limits.append(pair))
    plant.start('-p', 'lines:=[a]', reads='a')
    assert limits == [(5000, 5000)]


def test_line_with_faulty_files_is_told_and_the_others_run(
        plant: Plant, capfd: Output) -> None:
    (plant.folder / 'b_net.csv').write_text('Baud,Parity\n9601,Much\n')
    plant.start(reads='ac')
    values = line_status(plant, ros.ERROR)
    assert values['running'] == '2'
    assert values['/hall/b'].startswith(f'{plant.folder}/b_net.csv:2:1 (Baud): Baud = "9601"')
    assert f'; {plant.folder}/b_net.csv:2:2 (Parity): ' in values['/hall/b']
    plant.observer.call(Trigger, '/lines/reload', Trigger.Request())
    line_status(plant, ros.ERROR)
    told = capfd.readouterr().err.count('9601')
    assert 2 <= told <= 4  # at the start, and for each call, which may come again
    plant.write_net('b', plant.plcs['b'].port)
    plant.write_map('b', 'speed,Read,N7:0,1,PLC5,2')
    plant.observer.call(Trigger, '/lines/reload', Trigger.Request())
    assert plant.speeds('b') == [7, ord('b')]
    before = {**plant.nodes}
    plant.observer.call(Trigger, '/lines/reload', Trigger.Request())  # all lines run
    assert line_status(plant, ros.OK)['running'] == '3'
    assert plant.nodes == before


def test_line_whose_name_ros_refuses_is_told_and_the_others_run(
        plant: Plant, recwarn: pytest.WarningsRecorder) -> None:
    plant.plcs['b-1'] = plant.plcs.pop('b')
    plant.start(reads='ac')
    values = line_status(plant, ros.ERROR)
    assert values['running'] == '2'
    assert 'must not contain characters other than alphanumerics' in values['/hall/b-1']
    assert [warning for warning in recwarn if 'rosout' in str(warning.message)] == []


def test_faulty_line_ends_all_where_that_is_asked_for(
        plant: Plant, end_request: EndRequest) -> None:
    (plant.folder / 'b_net.csv').write_text('Baud\n9601\n')
    plant.start('-p', 'strict_lines:=true')
    plant.thread.join(PATIENCE)
    assert (plant.end(), end_request.is_set()) == (2, True)


def test_parameter_for_no_line_is_not_passed_over(plant: Plant, capfd: Output) -> None:
    plant.start('-p', 'abdf1:read_only:=true')
    plant.thread.join(PATIENCE)
    assert plant.end() == 2
    assert 'this node is /hall/c; leave out "abdf1:"' in capfd.readouterr().err


def test_two_lines_have_not_one_port_nor_one_place_of_guests(plant: Plant) -> None:
    other_name, place = plant.folder / 'other_name', f'pty:{plant.folder}/hmi'
    other_name.symlink_to(plant.plcs['a'].port)
    plant.write_net('a', plant.plcs['a'].port, place)
    plant.write_net('b', str(other_name))
    plant.write_net('c', plant.plcs['c'].port, place.replace('/hmi', '//hmi'))
    plant.start(reads='a')
    faults = line_status(plant, ros.ERROR)
    assert faults['/hall/b'] == f'port: {other_name} is the port of /hall/a'
    assert faults['/hall/c'] == f'port: pty:{plant.folder}//hmi is the place of /hall/a'
    plant.observer.until(lambda: not {'b', 'c'} & {*plant.observer.node.get_node_names()},
                         'the end of both nodes')


def test_new_files_do_not_make_a_line_the_second_master_on_the_port_of_another(
        plant: Plant) -> None:
    place = f'pty:{plant.folder}/hmi'
    taken, free = plant.plcs['a'].port, plant.plcs['c'].port
    plant.write_net('a', taken, place)
    plant.start('-p', 'lines:=[a, b]', reads='ab')

    for net, why in [((taken,), f'{taken} is the port'), ((free, place), f'{place} is the place')]:
        plant.write_net('b', *net)
        response = plant.observer.call(Trigger, '/hall/b/reload', Trigger.Request())
        assert (response.success, response.message) == (
            False, f'goes on as before: port: {why} of /hall/a')
    assert plant.speeds('b') == [7, ord('b')]

    plant.write_net('b', free)
    assert plant.observer.call(Trigger, '/hall/b/reload', Trigger.Request()).success
    plant.write_net('a', plant.plcs['b'].port)
    assert plant.observer.call(Trigger, '/hall/a/reload', Trigger.Request()).success
    assert [plant.nodes[name].session.port for name in 'ab'] == [plant.plcs['b'].port, free]
    assert [plant.speeds(name) for name in 'ab'] == [[7, ord('b')], [7, ord('c')]]


def test_internal_error_at_the_start_of_a_line(
        plant: Plant, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    made: list[float] = []
    refused, start = ['callbacks', 'closing'], threading.Thread.start

    def start_some(thread: threading.Thread) -> None:
        if thread.name in refused:
            refused.remove(thread.name)
            raise RuntimeError("can't start new thread")
        start(thread)

    def make(name: str, **named: Any) -> BridgeNode:
        if name == 'b':
            made.append(time.monotonic())
            if len(made) == 1:
                raise AttributeError('a bug')
        return plant.make_node(name, **named)

    monkeypatch.setattr(module, 'BridgeNode', make)
    monkeypatch.setattr(threading.Thread, 'start', start_some)
    plant.start()
    plant.observer.call(Trigger, '/lines/reload', Trigger.Request())
    assert [plant.speeds(name) for name in 'bac'] == [[7, ord(name)] for name in 'bac']
    assert len(made) == 2 and made[1] - made[0] >= module.RESTART_AFTER
    assert line_status(plant, ros.OK)['restarts'] == '2'
    assert "is started again: AttributeError('a bug')" in capfd.readouterr().err


def test_internal_error_restarts_its_line_only_and_its_slow_end_holds_up_no_other(
        plant: Plant, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    monkeypatch.setattr(module, 'RESTART_AFTER', 0.1)
    slow, ended = threading.Event(), threading.Event()

    def publish_last_diagnostics(node: BridgeNode, give_up: float) -> None:
        slow.set()
        assert ended.wait(PATIENCE)

    plant.start(reads='abc')
    before = {**plant.nodes}
    monkeypatch.setattr(BridgeNode, 'publish_last_diagnostics', publish_last_diagnostics)
    plant.fail('b')
    plant.observer.until(slow.is_set, 'the end of a line')
    assert ros.until_status(plant.observer.diagnostics(plant.plcs['a'].port), 'link', ros.OK)
    assert line_status(plant, ros.ERROR)['/hall/b'] == 'is started again'
    ended.set()
    assert plant.speeds('b') == [7, ord('b')]
    assert ros.get_parameters(
        plant.observer, 'net.com_port', node='/hall/b') == [plant.plcs['b'].port]
    assert {name for name in 'abc' if not before[name].link.is_alive()} == {'b'}
    assert line_status(plant, ros.OK)['restarts'] == '1'
    said = capfd.readouterr().err
    assert 'ended by an internal error and is started again: internal error: TypeError' in said
    assert 'Traceback' in said


def test_status_of_all_lines_comes_once_a_second(plant: Plant) -> None:
    plant.start('-p', 'lines:=[a]')
    inbox = plant.observer.diagnostics('')
    seconds = [ros.stamp(inbox.next()) for _ in range(4)]
    # Most of them: after one that a busy host has held up the next comes in time.
    assert median(later - one for one, later in pairwise(seconds)) > 0.8


def test_name_servers_that_do_not_answer_hold_up_neither_the_others_nor_the_end(
        plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, over = threading.Event(), threading.Event()

    def resolve(*arguments: object, flags: int = 0, **named: object) -> None:
        if not flags & socket.AI_NUMERICHOST:  # which asks no server
            asked.set()
            over.wait(2 * PATIENCE)
        raise socket.gaierror('no answer')

    monkeypatch.setattr('socket.getaddrinfo', resolve)
    plant.write_net('b', 'socket://device.server:4001')
    plant.start(reads='ac')
    plant.observer.until(asked.is_set, 'the question')
    assert plant.end() == 0
    over.set()


def test_one_name_for_all_lines_is_refused(capfd: Output) -> None:
    assert main(['lines', '--ros-args', '-r', 'lines:__node:=y', '-r', '__node:=x']) == 2
    assert 'the sections of the parameter file name the lines, and -r lines:__node:=NAME the ' \
        'process' in capfd.readouterr().err


@pytest.mark.parametrize(('option', 'text'), [
    ('lines:=a', "parameter lines: 'a' should be a list of names, as in -p 'lines:=[/press/abdf1"),
    ('lines:=[1]', 'should be a list of names'),
    ('lines:=123', 'parameter lines: 123 should be a list of names'),
    ('lines:=no', 'parameter lines: False should be a list of names'),
    ('strict_lines:=3', 'parameter strict_lines: strict_lines = 3 should be true or false'),
    ('strict_lines:="true"', "parameter strict_lines: strict_lines = 'true' is a text and should "
                             'be true or false: write it without quotes, in Python True'),
    ('strict_line:=true', 'there is no such parameter; did you mean strict_lines?'),
    ('line:=[a]', 'there is no such parameter; did you mean lines?')])
def test_options_that_cannot_be_meant(
        tmp_path: Path, option: str, text: str, capfd: Output) -> None:
    path = yaml_file(tmp_path, 'a: {ros__parameters: {port: x}}')
    assert main(['lines', '--ros-args', '--params-file', path, '-p', option]) == 2
    assert text in capfd.readouterr().err


def test_options_in_a_section_for_another_node_are_refused(tmp_path: Path, capfd: Output) -> None:
    path = yaml_file(tmp_path, 'cell:\n  a: {ros__parameters: {port: x}}\n'
                               '  lines: {ros__parameters: {strict_lines: true}}')
    assert main(['lines', '--ros-args', '--params-file', path]) == 2
    told = capfd.readouterr().err
    assert 'section /cell/lines is not for this node, /lines: write "/lines:", or "/**:"' in told
    assert 'section /cell/a' not in told


def test_port_has_one_owner_until_he_leaves_it() -> None:
    owners = PortOwners()
    owners.hold('/a', 'socket://server:4001')
    with pytest.raises(ConfigurationError) as error:
        owners.hold('/b', 'SOCKET://Server:4001')
    assert str(error.value) == 'port: SOCKET://Server:4001 is the port of /a'
    owners.hold('/a', 'socket://server:4002')
    owners.hold('/b', 'socket://server:4001')
    owners.hold('/a')
    owners.hold('/b', 'socket://server:4002')


def test_refusal_leaves_a_line_what_it_has() -> None:
    owners = PortOwners()
    owners.hold('/a', '/dev/one')
    owners.hold('/b', '/dev/two')
    with pytest.raises(ConfigurationError):
        owners.hold('/b', '/dev/two', '/dev/one')
    owners.hold('/a', '/dev/one')
    with pytest.raises(ConfigurationError):
        owners.hold('/c', '/dev/two')


def test_device_is_one_port_under_all_its_names(tmp_path: Path) -> None:
    (tmp_path / 'device').touch()
    (tmp_path / 'link').symlink_to('device')
    owners = PortOwners()
    owners.hold('/a', str(tmp_path / 'device'))
    with pytest.raises(ConfigurationError, match=f'{tmp_path}/link is the port of /a'):
        owners.hold('/b', str(tmp_path / 'link'))


def test_place_is_that_of_one_line() -> None:
    owners = PortOwners()
    owners.hold('/a', '/dev/one', 'pty:/tmp/hmi', 'tcp:4501', '/dev/ttyS9?baud=9600')
    for place in 'pty:/tmp//hmi', 'tcp:127.0.0.1:4501':
        with pytest.raises(ConfigurationError, match=f'{place} is the place of /a'):
            owners.hold('/b', '/dev/two', place)
    for names in ('/dev/two', '/dev/one?check=BCC'), ('/dev/ttyS9',):
        with pytest.raises(ConfigurationError, match='is the port of /a'):
            owners.hold('/b', *names)
    owners.hold('/b', '/dev/two', 'pty:/tmp/hmi_2', 'tcp:4502')
