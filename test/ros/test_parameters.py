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

"""Parameters on a real node: what is declared, and what they come to."""

from collections.abc import Callable, Iterator
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from abdf1_ros.df1.settings import PollingSettings
from abdf1_ros.paths import config_file
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.launching import (
    descriptions,
    misspelt,
    parameter_types,
    scope_of,
    unknown_arguments,
    unusable,
)
from abdf1_ros.ros.parameters.arguments import Arguments, is_for
from abdf1_ros.ros.parameters.declared import Configuration, configure, Parameters
from abdf1_ros.ros.parameters.files import parameter_tree
from abdf1_ros.ros.parameters.shown import map_cells, ShownFiles
from abdf1_ros.settings.columns import COLUMNS, MAP_COLUMNS
from abdf1_ros.settings.network import Network
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from support.ros import ros_args, write_csv
import yaml

MAP = ['recipe,ReadWrite,N7:10,2,SLC,4,0,999', 'line/door,Read,I:017/12,1,PLC5,,,']
MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Min,Max'
YAML_MAKES = 'YAML makes'


@pytest.fixture(scope='module')
def context() -> Iterator[Context]:
    context = Context()
    context.init(args=[])
    yield context
    context.try_shutdown()


Nodes = Callable[..., Node]
Configured = Callable[..., Configuration]
Files = dict[str, str]


@pytest.fixture
def make_node(context: Context) -> Iterator[Nodes]:
    """Return a node whose parameters are overridden."""
    nodes = []

    def make(values: dict[str, Any] | None = None, cli_args: list[str] | None = None) -> Node:
        overrides = [Parameter(name, value=value) for name, value in (values or {}).items()]
        nodes.append(Node('parameters', context=context, parameter_overrides=overrides,
                          cli_args=cli_args, use_global_arguments=False,
                          start_parameter_services=False,
                          automatically_declare_parameters_from_overrides=True))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return {'net_file': str(write_csv(tmp_path / 'net.csv', 'Baud,Com_Port', ['9600,3'])),
            'map_file': str(write_csv(tmp_path / 'map.csv', MAP_HEADER, MAP))}


@pytest.fixture
def configured(make_node: Nodes, files: Files) -> Configured:
    return lambda **values: configure(make_node(files | values))


def problems_of(node: Node, *arguments: Arguments) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        configure(node, *arguments)
    return [str(problem) for problem in caught.value.problems]


def test_without_files_the_node_says_how_to_start(make_node: Nodes, files: Files) -> None:
    examples = config_file('net.csv').parent
    how = ('which file? Start with --ros-args -p net_file:=net.csv -p map_file:=map.csv; '
           f'examples are in {examples}, and "ros2 launch abdf1_ros demo.launch.py" runs them '
           'with a simulated line')
    assert problems_of(make_node()) == [f'parameter net_file: {how}', f'parameter map_file: {how}']
    del files['map_file']
    assert problems_of(make_node(files)) == [f'parameter map_file: {how}']


def test_files_are_shown_as_resolved_paths(
        make_node: Nodes, files: Files, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / 'elsewhere').mkdir()
    monkeypatch.chdir(tmp_path / 'elsewhere')
    monkeypatch.setenv('HOME', str(tmp_path))
    node = make_node({'net_file': '../net.csv', 'map_file': '~/map.csv'})
    configure(node)
    assert node.get_parameter('net_file').value == files['net_file']
    assert node.get_parameter('map_file').value == files['map_file']


def test_cells_keep_what_a_shell_would_expand(make_node: Nodes, files: Files) -> None:
    """A service has another home than the person who has written the file."""
    write_csv(Path(files['net_file']), 'Station,Com_Port', ['5,~/plc'])
    (told,) = problems_of(make_node(files))
    assert 'Com_Port = "~/plc" should be a number from 1, a device path' in told


def test_ethernet_place_has_to_name_a_station_of_the_map(make_node: Nodes, files: Files) -> None:
    write_csv(Path(files['net_file']), 'Station,Share', ['5,eip:44818?station=7'])
    told, = problems_of(make_node(files))
    assert told.startswith(
        f'{files["net_file"]}:2:2 (Share): Share: "eip:44818?station=7": no row')
    told, = problems_of(make_node({**files, 'net.share': 'eip:44818?station=8'}))
    assert told.startswith('parameter net.share: Share: "eip:44818?station=8": no row has station')


def test_one_line_tells_what_the_node_runs_with(configured: Configured, files: Files) -> None:
    rows = [*MAP, 'b,Write,N7:20,2,SLC,4,,,recipe']
    write_csv(Path(files['map_file']), f'{MAP_HEADER},Topic', rows)
    assert str(configured(port='/dev/ttyUSB0')) == (
        f'{files["net_file"]} and {files["map_file"]}: port /dev/ttyUSB0, Mode Master, 9600 '
        'baud, CRC; 3 rows, topics: 2 to read, 1 to write')
    assert 'port /dev/ttyS6 (Com_Port 7), Mode' in str(configured(port=7))
    assert 'port /dev/ttyS2 (Com_Port 3), Mode' in str(configured())  # of the file


def test_no_path_and_no_port_forges_a_line_of_the_log(
        configured: Configured, files: Files, tmp_path: Path) -> None:
    forged = tmp_path / 'net\n[FATAL] [abdf1]: \x1b[2J.csv'
    Path(files['net_file']).rename(forged)
    told = str(configured(net_file=str(forged), port='/dev/tty\n[FATAL]'))
    assert told.isprintable() and r'net\n[FATAL] [abdf1]: \x1b[2J.csv' in told


def test_defaults_are_those_of_the_contract() -> None:
    parameters = Parameters()
    assert (parameters.strict_map, parameters.read_only) == (False, False)
    assert (parameters.default_period, parameters.diagnostics_period) == (100, 1.0)
    assert (parameters.stale_after, parameters.write_timeout) == (3.0, 2.0)
    assert (parameters.nak_on_command_timeout, parameters.expose_map_parameters) == ('auto', True)


@pytest.mark.parametrize(('given', 'meant'), [
    (True, True), (False, False), ('auto', None), ('True', True), ('false', False)])
def test_yes_and_no_of_a_file_and_of_a_launch_argument_say_when_slaves_are_reset(
        configured: Configured, make_node: Nodes, files: Files, given: bool | str,
        meant: bool | None) -> None:
    assert configured().driver_settings().nak_on_command_timeout is None
    node = make_node(files | {'nak_on_command_timeout': given})
    assert configure(node).driver_settings().nak_on_command_timeout is meant
    assert node.get_parameter('nak_on_command_timeout').value == given  # as a dump has it


def test_every_parameter_is_declared_read_only_with_a_description(
        make_node: Nodes, files: Files) -> None:
    node = make_node(files)
    before = set(node.get_parameters_by_prefix(''))
    configure(node)
    for name in set(node.get_parameters_by_prefix('')) - before:
        descriptor = node.describe_parameter(name)
        assert descriptor.read_only, name
        assert descriptor.description, name
        assert descriptor.name == name
    period, pause = map(node.describe_parameter, ('default_period', 'diagnostics_period'))
    assert (period.integer_range[0].from_value, period.integer_range[0].to_value) == (
        0, 86_400_000)
    assert pause.floating_point_range[0].from_value == pytest.approx(0.1)


def test_what_the_files_say_is_shown_and_nobody_else_sets_it(
        make_node: Nodes, files: Files) -> None:
    node = make_node(files | {'net.baud': '38400'})
    shown, configuration = ShownFiles(node), configure(node)
    node.declare_parameter('free', '0')
    before = set(node.get_parameters_by_prefix(''))
    rows = configuration.shown_rows()
    for shown_rows in (rows, (), (), rows):  # files that are read again are shown anew
        shown.show(configuration.network, shown_rows)
    names = set(node.get_parameters_by_prefix('')) - before
    assert names >= {f'net.{field}' for field in (
        'station', 'mode', 'plc_type', 'error_code', 'nak_retries', 'enq_retries', 'cmd_timeout',
        'com_port', 'baud', 'data_bits', 'stop_bits', 'parity', 'timeout', 'tx_delay',
        'handshake')}
    assert len([name for name in names if name.startswith('map.')]) == 2 * len(COLUMNS)
    assert node.get_parameter('net.baud').value == 38400
    assert '1200, 2400, 4800, 9600, 19200' in node.describe_parameter('net.baud').description
    (station,) = node.describe_parameter('net.station').integer_range
    assert (station.from_value, station.to_value) == (0, 254)
    for name in names:
        assert node.describe_parameter(name).description, name
        result = node.set_parameters_atomically(
            [Parameter('free', value='1'), Parameter(name, value='1')])
        assert not result.successful and '~/reload' in result.reason
    assert node.describe_parameter('map.line.door.plc_type').description == \
        next(column.description for column in MAP_COLUMNS if column.name == 'PLC_Type')


@pytest.mark.parametrize(('name', 'value', 'field', 'expected'), [
    ('net.handshake', True, 'handshake', True),  # YAML makes that of Yes
    ('net.handshake', False, 'handshake', False),
    ('net.station', '7', 'station', 7)])
def test_link_parameters_are_read_as_the_file_is(
        configured: Configured, name: str, value: Any, field: str, expected: Any) -> None:
    assert getattr(configured(**{name: value}).network, field) == expected


@pytest.mark.parametrize(('values', 'port'), [
    ({}, '/dev/ttyS2'), ({'net.com_port': 1}, '/dev/ttyS0'),
    ({'net.com_port': 'socket://plc:4001'}, 'socket://plc:4001'),
    ({'port': 'socket://plc:4001'}, 'socket://plc:4001'),
    ({'port': '/dev/ttyUSB7', 'net.com_port': 1}, '/dev/ttyUSB7'),
    ({'port': 7}, '/dev/ttyS6')])
def test_port_is_the_parameter_or_else_com_port(
        configured: Configured, values: dict[str, Any], port: str) -> None:
    configuration = configured(**values)
    assert configuration.port == port
    assert configuration.driver_settings().may_store is ('://' in port)


@pytest.mark.parametrize(('name', 'value', 'expected'), [
    ('stale_after', 5, 5.0), ('diagnostics_period', 60, 60.0), ('diagnostics_period', 0.1, 0.1),
    ('default_period', 0, 0), ('default_period', 86_400_000, 86_400_000),
    ('read_only', True, True), ('write_timeout', 0.05, 0.05), ('poll_list', [1, 2], '1,2'),
    ('poll_list', 3, '3'), ('priority_poll_list', [1, 2], '1,2'), ('trace_file', './no', './no')])
def test_own_parameter_has_the_value_and_type_that_was_given(
        configured: Configured, name: str, value: Any, expected: Any) -> None:
    found = getattr(configured(**{name: value}).parameters, name)
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize(('values', 'expected'), [
    ({}, PollingSettings((1, 2))),  # the stations of the map
    ({'priority_poll_list': '2'}, PollingSettings((1,), (2,))),
    ({'poll_list': '7,1-2', 'priority_poll_list': '9', 'poll_group_size': 2,
      'poll_multiple': True}, PollingSettings((7, 1, 2), (9,), 2, multiple=True)),
    ({'send_in_sequence': True}, PollingSettings((1, 2), in_sequence=True))])
def test_parameters_tell_how_stations_are_polled(
        configured: Configured, values: dict[str, Any], expected: PollingSettings) -> None:
    assert configured(**values).driver_settings().polling == expected


def test_poll_list_without_standard_polling_is_told(configured: Configured) -> None:
    given = {'poll_list': '1-2', 'priority_poll_list': '1', 'poll_group_size': 1,
             'poll_multiple': True, 'send_in_sequence': True}
    assert configured(**given).idle == [*given]
    assert configured(**given | {'net.polling': 'Standard'}).idle == []


def test_csv_as_a_parameter_file_is_told(tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'net.csv', 'Station,Mode,Com_Port', ['5,Peer,/dev/ttyUSB0'])
    with pytest.raises(ConfigurationError, match='is not a parameter file, .* -p net_file:='):
        parameter_tree(str(path))


def test_gateway_is_polled_for_the_stations_behind_it(
        configured: Configured, make_node: Nodes, files: Files, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('random.randrange', lambda stop: stop - 1)
    rows = [f'{tag},Read,N7:0,{station},PLC5,{via}'  # c is read often enough
            for tag, station, via in (('a', 1, '0,,'), ('b', 9, '0,,'), ('c', 2, ',,'),
                                      ('d', 2, ',c,1000'))]
    files['map_file'] = str(write_csv(
        tmp_path / 'via.csv', 'Tag,Command,Address,Station,PLC_Type,Via,While,While_Timeout',
        rows))
    assert configured().map_problems == []
    settings = configured().driver_settings()
    assert (settings.polling, settings.default_period, settings.first_tns) == (
        PollingSettings((0, 2)), 0.1, 0xFFFF)
    assert problems_of(make_node(files | {'poll_list': '0,9'})) == [
        'parameter poll_list: station 9 is behind gateway 0, which is polled in its place']
    assert problems_of(make_node(files | {'priority_poll_list': '1'})) == [
        'parameter priority_poll_list: station 1 is behind gateway 0, which is polled in its '
        'place']


@pytest.mark.parametrize(('name', 'value', 'expected'), [
    ('default_period', -1, 'default_period = -1 should be a whole number from 0 to 86400000'),
    ('default_period', 1.5, 'default_period = 1.5 should be a whole number from 0 to 86400000'),
    ('default_period', True, 'default_period = True should be a whole number from 0 to 86400000'),
    ('diagnostics_period', 0.0, 'diagnostics_period = 0.0 should be a number from 0.1 to 60'),
    ('diagnostics_period', 61, 'diagnostics_period = 61.0 should be a number from 0.1 to 60'),
    ('stale_after', math.nan, 'stale_after = nan should be a number from 1 to 1000'),
    ('stale_after', 'long', "stale_after = 'long' should be a number from 1 to 1000"),
    ('read_only', 1, 'read_only = 1 should be true or false'),
    ('strict_map', 'maybe', "strict_map = 'maybe' should be true or false"),
    ('strict_map', 'on', "strict_map = 'on' is a text and should be true or false: write it "
                         'without quotes, in Python True'),
    ('read_only', 'true', "read_only = 'true' is a text and should be true or false: write it "
                          'without quotes, in Python True'),
    ('stale_after', '5', "stale_after = '5' is a text and should be a number from 1 to 1000: "
                         'write it without quotes'),
    ('poll_group_size', '9', "poll_group_size = '9' is a text and should be a whole number from "
                             '0 to 255: write it without quotes'),
    ('default_period', '1.5', "default_period = '1.5' should be a whole number from 0 to "
                              '86400000'),
    ('nak_on_command_timeout', 'never',
     "nak_on_command_timeout = 'never' should be one of auto, true, false"),
    ('nak_on_command_timeout', 1,
     'nak_on_command_timeout = 1 should be one of auto, true, false'),
    ('map_file', [1, 2], 'map_file = [1, 2] should be text'),
    *((name, value, f'{name} = {value} should be text: {YAML_MAKES} {made}; leave {name} out, or '
       'write ./ before the name of a file')
      for name in ('net_file', 'map_file', 'trace_file')
      for value, made in ((False, 'true or false of words such as on and no'),
                          (123, 'a number of it'), (1.5, 'a number of it'))),
    *((name, False, f'{name} = False should be text: {YAML_MAKES} true or false of words such as '
                    'on and no') for name in ('port', 'poll_list', 'priority_poll_list')),
    ('poll_list', '1,300', '"300" should be a station from 0 to 254, or a range such as 3-5; '
                           'put commas between them'),
    ('port', 'ttyUSB0', 'Com_Port = "ttyUSB0" should be a number from 1, a device path such as '
     '/dev/ttyUSB0, socket://host:port or rfc2217://host:port; "plc ports" '
     'lists the devices'),
    ('net.station', 5.0,
     '2552 CRT_BAD_STATION_ID: Station = "5.0" should be a whole number from 0 to 254'),
    ('net.baud', 9601, 'Baud = "9601" should be one of 300, 600, 1200, 2400, 4800, 9600, 19200, '
                       '38400, 57600, 115200'),
    ('net.handshake', 1, 'Handshake = "1" should be one of Yes, No')])
def test_faulty_value_is_a_problem_that_says_what_would_be_right(
        make_node: Nodes, files: Files, name: str, value: Any, expected: str) -> None:
    assert problems_of(make_node(files | {name: value})) == [f'parameter {name}: {expected}']


def test_all_problems_are_told_together(make_node: Nodes, files: Files) -> None:
    write_csv(Path(files['map_file']), MAP_HEADER, [
        'recipe,Rad,N7:10,2,SLC,4,0,999', 'good_unless_we_are_5,Read,N7:0,5,SLC,,,'])
    found = problems_of(make_node(files | {
        'default_period': -1, 'strict_map': True, 'net.station': 255, 'net.baud': 0}))
    assert [problem.split(': ')[0] for problem in found] == [
        'parameter default_period', 'parameter net.station', 'parameter net.baud',
        f'{files["map_file"]}:2:2 (Command)']


def test_missing_files_are_problems(make_node: Nodes) -> None:
    missing = {'net_file': '/nowhere/net.csv', 'map_file': '/nowhere/map.csv'}
    assert problems_of(make_node(missing)) == [
        f'{path}: cannot be read: No such file or directory' for path in missing.values()]


def test_bad_row_is_left_out_unless_the_map_is_strict(make_node: Nodes, files: Files) -> None:
    write_csv(Path(files['map_file']), MAP_HEADER, [
        'bad,Read,N7:0,300,SLC,,,', *MAP, 'ours,Read,N7:0,5,SLC,,,'])
    configuration = configure(make_node(files))
    assert [mapping.tag for mapping in configuration.mappings] == ['recipe', 'line/door']
    bad, ours = map(str, configuration.map_problems)
    assert '2501 ERR_BAD_STATION: Item: 1, ' in bad and 'Station 5 is our own Station' in ours
    assert problems_of(make_node(files | {'strict_map': True})) == [bad, ours]
    assert problems_of(make_node(files | {'default_period': -1}))[1:] == [bad, ours]


def test_mappings_are_shown_with_their_defaults(configured: Configured) -> None:
    cells = {name: value for name, value, _ in map_cells(configured().shown_rows())}
    assert {name: value for name, value in cells.items() if value and 'door' in name} == {
        f'map.line.door.{column}': value for column, value in {
            'tag': 'line/door', 'command': 'Read', 'address': 'I:017/12', 'station': '1',
            'plc_type': 'PLC5', 'length': '1', 'type': 'bool', 'topic': 'line/door',
            'publish': 'Always', 'word_order': 'Low', 'access': 'Typed'}.items()}


@pytest.mark.parametrize(('rows', 'given', 'is_shown'), [
    (100, {}, True), (101, {}, False), (101, {'expose_map_parameters': True}, True),
    (1, {'expose_map_parameters': False}, False)])
def test_maps_of_up_to_a_hundred_rows_are_shown_unless_the_user_says_otherwise(
        configured: Configured, files: Files, rows: int,
        given: dict[str, Any], is_shown: bool) -> None:
    write_csv(Path(files['map_file']), MAP_HEADER,
              [f'row{row},Read,N7:{row},1,SLC,,,' for row in range(rows)])
    assert len(configured(**given).shown_rows()) == rows * is_shown


@pytest.mark.parametrize('is_exposed', [True, False])
def test_overrides_of_the_map_are_ignored_unless_they_repeat_it(
        make_node: Nodes, files: Files, is_exposed: bool) -> None:
    given = {'map.line.door.address': 'I:017/12', 'map.line.door.station': 1,  # of a dump
             'map.line.door.length': 2, 'map.gate.max': '', 'mapper.rate': 3}
    configuration = configure(make_node({**files, **given, 'expose_map_parameters': is_exposed}))
    assert configuration.ignored == ['map.gate.max', 'map.line.door.length']
    assert configuration.mappings[1].length == 1


def test_parameter_file_sets_parameters_of_node_and_net(
        make_node: Nodes, files: Files, tmp_path: Path) -> None:
    path = tmp_path / 'parameters.yaml'
    path.write_text(
        '/**:\n  ros__parameters:\n    default_period: 250\n    stale_after: 4\n'
        '    net:\n      baud: 38400\n      handshake: Yes\n      parity: Odd\n',
        encoding='utf-8')
    arguments = [*ros_args(*(f'{name}:={value}' for name, value in files.items())),
                 '--params-file', str(path)]
    configuration = configure(make_node(cli_args=arguments))
    assert configuration.parameters.default_period == 250
    assert configuration.parameters.stale_after == 4.0
    assert configuration.network == Network(baud=38400, com_port='3', handshake=True, parity='Odd')


def test_file_of_all_parameters_starts_the_same_bridge(
        make_node: Nodes, files: Files, tmp_path: Path) -> None:
    """Write what "ros2 param dump" does."""
    node = make_node({**files, 'default_period': 250, 'poll_list': '1,2', 'net.baud': 38400})
    first = configure(node)
    ShownFiles(node).show(first.network, first.mappings)
    dumped: dict[str, Any] = {}
    for name, parameter in node.get_parameters_by_prefix('').items():
        *folders, last = name.split('.')
        place = dumped
        for folder in folders:
            place = place.setdefault(folder, {})
        place[last] = parameter.value
    path = tmp_path / 'dumped.yaml'
    path.write_text(yaml.safe_dump({'/parameters': {'ros__parameters': dumped}}), 'utf-8')
    again = configure(make_node(cli_args=['--ros-args', '--params-file', str(path)]))
    assert (again.network, [*map_cells(again.mappings)], again.parameters, again.ignored) == (
        first.network, [*map_cells(first.mappings)], first.parameters, [])


@pytest.mark.parametrize(('name', 'right'), [
    ('net.buad', 'did you mean net.baud?'), ('baud', 'did you mean net.baud?'),
    ('Com_Port', 'did you mean net.com_port?'),
    ('map.recipe.addres', 'map.* only shows the map file: change the file'),
    ('qos_overrides./parameters/read/door.publisher.depth', 'the QoS of our topics follows'),
    ('net.speed', 'net.* has the columns of the net file'),
    ('READ_ONLY', 'did you mean read_only?'),
    ('prot', 'did you mean port?'), ('map_fil', 'did you mean map_file?')])
def test_misspelt_parameter_is_an_error(
        make_node: Nodes, files: Files, name: str, right: str) -> None:
    problem, = problems_of(make_node({**files, name: '9600'}))
    assert problem.startswith(f'parameter {name}: there is no such parameter; ')
    assert right in problem


@pytest.mark.parametrize(('section', 'name', 'expected'), [
    ('parameters', 'low_letancy', '3:5: low_letancy: there is no such parameter; did you mean '
                                  'low_latency?'),
    ('/parameters', 'gain', '3:5: gain: there is no such parameter; another version may have it'),
    ('parameters', 'baud', '3:5: baud: there is no such parameter; did you mean net.baud?'),
    ('parameters', 'qos_overrides.x', '3:5: qos_overrides.x: there is no such parameter; the QoS '
                                      'of our topics follows from the files'),
    ('"/**"', 'gain', None), ('camera', 'low_letancy', None),
    ('parameters', 'use_sim_time', None), ('parameters', 'map.door.max', None)])
def test_section_that_names_the_node_has_no_unknown_parameter(
        make_node: Nodes, files: Files, tmp_path: Path, section: str, name: str,
        expected: str | None) -> None:
    path = tmp_path / 'shared.yaml'
    path.write_text(f'{section}:\n  ros__parameters:\n    {name}: true\n', encoding='utf-8')
    node = make_node(files if section == 'camera' else {**files, name: True})
    if expected is None:
        assert configure(node, Arguments([str(path)])).mappings
        return
    assert problems_of(node, Arguments([str(path)])) == [f'{path}:{expected}']


@pytest.mark.parametrize('section', ['parameters', '"/**"', '"/*"'])
def test_number_that_yaml_takes_for_octal_is_told(
        make_node: Nodes, files: Files, tmp_path: Path, section: str) -> None:
    path = tmp_path / 'shared.yaml'
    path.write_text(f'{section}:\n  ros__parameters:\n    net:\n      station: 010\n'
                    '      baud: 9600\n      timeout: "0500"\n      nak_retries: 03\n'
                    '    poll_list: [1, 011]\n    map: {door: {max: 010}}\n'
                    '/other:\n  ros__parameters:\n    write_timeout: 010\n',
                    encoding='utf-8')
    assert problems_of(make_node(files), Arguments([str(path)])) == [
        f'{path}:4:7: net.station: 010 is octal in YAML; write 10 or 8',
        f'{path}:8:5: poll_list: 011 is octal in YAML; write 11 or 9']


@pytest.mark.parametrize(('rule', 'expected'), [
    ('net.station:=010', 'net.station: 010 is octal in YAML; write 10 or 8'),
    ('parameters:net.station:=010', 'net.station: 010 is octal in YAML; write 10 or 8'),
    ('poll_list:=[12, 010]', 'poll_list: 010 is octal in YAML; write 10 or 8'),
    ('net.station:="010"', None), ('net.station:=07', None), ('camera:gain:=010', None),
    ('camera:read_only:=true', 'camera:read_only: this node is /parameters; leave out "camera:"'),
    ('gain:=3', 'gain: there is no such parameter; another version may have it'),
    ('camera:gain:=3', None), ('use_sim_time:=true', None), ('map.door.max:=7', None)])
def test_parameter_of_the_command_line_is_for_this_node(
        make_node: Nodes, files: Files, rule: str, expected: str | None) -> None:
    args = ['node', '--ros-args', '--param' if rule.startswith('net') else '-p', rule]
    node = make_node(files, cli_args=args[1:])
    if expected is None:
        assert configure(node, Arguments.of(args)).mappings
        return
    assert problems_of(node, Arguments.of(args)) == [f'parameter {expected}']


def test_port_in_the_home_directory_and_a_substitution_of_launch_files(
        make_node: Nodes, files: Files, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('HOME', '/home/me')
    for name in ('port', 'net.com_port'):
        for port in ('~/plc', '$HOME/plc'):
            assert configure(make_node({**files, name: port})).port == '/home/me/plc'
    kept = configure(make_node({**files, 'trace_file': '$HOME/line.cap'}))
    assert kept.parameters.trace_file == '/home/me/line.cap'
    assert problems_of(make_node({**files, 'map_file': '/$(find-pkg-share x)/map.csv'})) == [
        'parameter map_file: /$(find-pkg-share x)/map.csv: $(...) is for launch files; write the '
        'path']


def test_parameter_of_another_node_is_none_of_our_business(make_node: Nodes, files: Files) -> None:
    other = 'qos_overrides./camera/parameters/image.publisher.depth'
    assert configure(make_node({**files, 'camera.gain': 3, other: 2})).mappings


def write_section(path: Path, *sections: str) -> Arguments:
    """Write a parameter file of sections, each a name and parameters as YAML has them."""
    path.write_text(''.join(f'{name}:\n  ros__parameters: {{{values}}}\n' for name, _, values in (
        section.partition(' ') for section in sections)), encoding='utf-8')
    return Arguments([str(path)])


@pytest.mark.parametrize(('sections', 'section', 'without_effect'), [
    (['robot_1/parameters read_only: true'], '/robot_1/parameters', 'read_only'),
    (['abdf1 gain: 1'], '/abdf1', ''),
    (['line_1 net.baud: 9600, gain: 1'], '/line_1', 'net.baud'),
    (['"/**" default_period: 50', 'x/parameters gain: 1'], '/x/parameters', ''),
    (['"/robot_1/**" read_only: true'], '/robot_1/**', 'read_only'),
    (['"/*/*" read_only: true'], '/*/*', 'read_only'),
    (['camera gain: 1', 'press strict_map: true', 'paint net_file: x'], '/press', 'strict_map')])
def test_section_that_would_be_passed_over_is_an_error(
        make_node: Nodes, files: Files, tmp_path: Path, sections: list[str],
        section: str, without_effect: str) -> None:
    arguments = write_section(tmp_path / 'site.yaml', *sections)
    line = 2 * [f'{text.split()[0].strip(chr(34)).strip("/")}' for text in sections].index(
        section.strip('/')) + 1
    effect = f'; {without_effect} would have no effect' if without_effect else ''
    assert problems_of(make_node(files), arguments) == [
        f'{tmp_path / "site.yaml"}:{line}: section {section} is not for this node, /parameters: '
        f'write "/parameters:", or "/**:" for every node{effect}']


@pytest.mark.parametrize('sections', [
    ['parameters read_only: true', 'abdf1 read_only: false'],
    ['"/**" read_only: true', 'camera port: /dev/ttyUSB3, write_timeout: 3, '
     'rs485: true, low_latency: true, diagnostics_period: 2'],
    ['"/*" gain: 1', 'camera gain: 3'], ['camera port: /dev/ttyUSB3'],
    ['parameters ', 'x/parameters read_only: true']])
def test_sections_of_other_nodes_are_none_of_our_business(
        make_node: Nodes, files: Files, tmp_path: Path, sections: list[str]) -> None:
    arguments = write_section(tmp_path / 'site.yaml', *sections)
    assert configure(make_node(files), arguments).mappings


def test_sections_of_other_lines_of_the_process_are_theirs(
        make_node: Nodes, files: Files, tmp_path: Path) -> None:
    theirs = write_section(tmp_path / 'press.yaml', 'press/abdf1 read_only: true')
    assert configure(make_node(files), Arguments(
        theirs.files, others=['/press/abdf1', '/parameters'])).mappings


def test_parameters_of_the_command_line_of_many_lines(make_node: Nodes, files: Files) -> None:
    args = ['--ros-args', '-p', 'press:read_only:=true', '-p', 'gain:=3', '-p', 'press:gain:=4',
            '-p', 'abdf1:read_only:=true', '-p', 'parameters:loss:=3']
    node = make_node(files, cli_args=args)
    assert Arguments.of(args).typed_for('/hall/press') == {'gain': '3'}  # the name is a full name
    assert problems_of(node, Arguments.of(args, ['/press'])) == [
        'parameter abdf1:read_only: this node is /parameters; leave out "abdf1:"',
        'parameter loss: there is no such parameter; another version may have it']


@pytest.mark.parametrize('section', [
    '/**', '/*', '/robot_1/*', '/robot_1/**', '/**/abdf1', '/*/abdf1', '/abdf1', '/robot_1/abdf1',
    '/robot_2/**', '/*/*/*', '/**/robot_1/*', '/robot_1'])
@pytest.mark.parametrize('namespace', ['/', '/robot_1', '/robot_1/cell'])
def test_ros_gives_a_node_the_same_sections_as_we_think(
        context: Context, tmp_path: Path, section: str, namespace: str) -> None:
    arguments = write_section(tmp_path / 'site.yaml', f'"{section}" gain: 1')
    node = Node('abdf1', namespace=namespace, context=context, use_global_arguments=False,
                cli_args=['--ros-args', '--params-file', arguments.files[0]],
                start_parameter_services=False,
                automatically_declare_parameters_from_overrides=True)
    assert is_for(section, node.get_fully_qualified_name()) == node.has_parameter('gain')
    node.destroy_node()


FILE = '/ws/share/abdf1_ros/launch/bridge.launch.py'


@pytest.mark.parametrize('command', [
    ['ros2', 'launch', 'abdf1_ros', 'bridge.launch.py'], ['ros2', 'launch', './bridge.launch.py']])
def test_unknown_arguments_are_told_with_what_would_be_right(command: list[str]) -> None:
    given = [*command, 'port:=/dev/x', 'mapfile:=map.csv', 'a:=b:=c']
    assert unknown_arguments(FILE, iter(['port', 'map_file']), given) == [
        'mapfile: there is no such argument; did you mean map_file?',
        'a: there is no such argument; --show-args lists them']


INCLUDED = ['ros2', 'launch', 'cell', 'cell.launch.py', 'x:=1']
BRIDGE = ['name', 'log_level', 'respawn', *parameter_types()]
ELSEWHERE = 'If it is meant for another launch file, include this one in a group, with'


@pytest.mark.parametrize(('name', 'value', 'meant'), [
    ('readonly', 'true', 'read_only'), ('READ_ONLY', 'True', 'read_only'),
    ('readOnly', '1', 'read_only'), ('read_only_mode', 'yes', 'read_only'),
    ('bridge_read_only', 'on', 'read_only'), ('reda_only', 'ture', 'read_only'),
    ('stand_by', 'true', 'standby'), ('standby_mode', 'true', 'standby')])
def test_protection_that_is_misspelt_in_an_include_ends_the_launch(
        name: str, value: str, meant: str) -> None:
    given = dict.fromkeys(BRIDGE, '') | {name: value}
    refused = f'{name} = "{value}": there is no such argument; did you mean {meant}? '
    assert included(given) == ([f'{refused}{ELSEWHERE} {meant} "false"'], [])
    assert included(given | {name: 'false'}) == ([], [warned(name, 'false', meant)])
    assert included(given | {meant: 'false'}) == ([], [warned(name, value, meant)])
    assert included(given | {meant: value}) == ([], [])


@pytest.mark.parametrize(('name', 'value', 'meant'), [
    ('mapfile', 'm.csv', 'map_file'), ('Map_File', 'm.csv', 'map_file'),
    ('loglevel', 'debug', 'log_level'), ('write_timout', '1', 'write_timeout')])
def test_other_misspelt_argument_of_an_include_is_warned_of(
        name: str, value: str, meant: str) -> None:
    given = dict.fromkeys(BRIDGE, '') | {name: value}
    assert included(given) == ([], [warned(name, value, meant)])
    assert included(given | {meant: value}) == ([], [])  # the including file passes it on


@pytest.mark.parametrize('others', [
    {'x': '1', 'robot': 'r', 'use_namespace': 'true', 'use_respawn': 'True', 'node_name': 'a',
     'map_yaml_file': 'm', 'serial_port': 'p', 'ros_namespace': '/hall', 'lines_file': 'l'},
    {'global_params': [('read_only', True)]}])
def test_arguments_of_including_launch_files_are_none_of_our_business(
        others: dict[str, Any]) -> None:
    assert included(dict.fromkeys(BRIDGE, '') | others) == ([], [])


def test_protection_that_a_launch_file_does_not_pass_on_ends_the_launch() -> None:
    def lines(**given: str) -> tuple[list[str], list[str]]:
        return misspelt(['lines_file', 'one_process'], given)

    refused = ('read_only = "true": there is no such argument; write read_only into the parameter '
               f'file. {ELSEWHERE} read_only "false"')
    assert lines(read_only='true', lines_file='l') == ([refused], [])
    assert lines(read_only='false', port='/dev/lidar') == ([], [])
    assert lines(lines_fiel='l') == ([], [warned('lines_fiel', 'l', 'lines_file')])


def included(given: dict[str, Any]) -> tuple[list[str], list[str]]:
    assert not unknown_arguments(FILE, BRIDGE, INCLUDED)
    return misspelt(BRIDGE, given)


def warned(name: str, value: str, meant: str) -> str:
    return (f'{name} = "{value}": there is no such argument, so it has no effect; did you mean '
            f'{meant}?')


@pytest.mark.parametrize(('name', 'text', 'expected'), [
    ('read_only', 'maybe', "read_only = 'maybe' should be true or false"),
    ('read_only', '"true"', "read_only = 'true' is a text and should be true or false: write it "
                            'without quotes, in Python True'),
    ('trace_file', 'off', 'trace_file = False should be text: YAML makes true or false of words '
     'such as on and no; leave trace_file out, or write ./ before the name of a file'),
    ('net_file', '123', 'net_file = 123 should be text: YAML makes a number of it; leave net_file '
     'out, or write ./ before the name of a file'),
    ('stale_after', '0', 'stale_after = 0.0 should be a number from 1 to 1000'),
    ('port', '99', None), ('poll_list', '3', None), ('net_file', '2026-11-28', None),
    ('read_only', 'True', None), ('stale_after', '7', None), ('map_file', '[a', None),
    ('name', 'off', None), ('read_only', '', None), ('nak_on_command_timeout', 'false', None),
    ('nak_on_command_timeout', 'maybe',
     "nak_on_command_timeout = 'maybe' should be one of auto, true, false")])
def test_value_of_a_launch_argument_is_judged_as_the_node_does(
        name: str, text: str, expected: str | None) -> None:
    given = dict.fromkeys(BRIDGE, '') | {name: text}
    assert unusable(given) == ([] if expected is None else [expected])


def test_restart_has_the_scope_of_the_first_start() -> None:
    context = SimpleNamespace(launch_configurations={'ns': ['a']}, environment={'A': '1'})
    restore = scope_of(context)
    for _ in range(2):
        context.launch_configurations['ns'].append('b')
        context.environment |= {'A': '2', 'B': '3'}
        restore(context)
        assert vars(context) == {
            'launch_configurations': {'ns': ['a']}, 'environment': {'A': '1'}}


def test_every_parameter_has_a_type_and_a_description() -> None:
    assert [parameter_types()[name] for name in (
        'read_only', 'stale_after', 'default_period')] == [bool, float, int]
    assert [descriptions()[name] for name in ('read_only', 'net_file')] == [
        'refuse every write; default: False', 'path of the net CSV, needed']
    assert descriptions().keys() == parameter_types().keys()
