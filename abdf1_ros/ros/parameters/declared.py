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

"""The node's parameters: their table, their declaration, and the resulting configuration."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, Field, field, fields, replace
import difflib
import os
import random
from typing import Any, TypeVar

from abdf1_ros.df1.polling import STANDARD
from abdf1_ros.df1.settings import PollingSettings
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.numbers import Checked, is_digits
from abdf1_ros.paths import config_file, expanded
from abdf1_ros.plan.forecast import USUAL_STALE_AFTER
from abdf1_ros.plan.usable_rows import usable_rows
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.ros.parameters.arguments import Arguments, is_for
from abdf1_ros.ros.parameters.file_watch import FileWatch
from abdf1_ros.ros.parameters.files import parameters_in, typed_numbers
from abdf1_ros.ros.parameters.shown import descriptor_of, map_cells, MOST_SHOWN_ROWS, text_of
from abdf1_ros.ros.parameters.values import usable
from abdf1_ros.settings.columns import COLUMNS, MAX_PERIOD
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import (
    FIELDS,
    load_network,
    make_network,
    Network,
    share_problems,
    URLS,
)
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.station_lists import octal_of, parse_stations
from abdf1_ros.text import counted, printable
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node

_Default = TypeVar('_Default', bound=bool | float | str)


def _parameter(default: _Default, description: str, low: float | None = None,
               high: float | None = None, choices: Collection[str] = ()) -> _Default:
    return field(default=default, metadata={
        'description': description, 'low': low, 'high': high, 'choices': choices})


_YES_OR_BY_LINE = {'auto': None, 'true': True, 'false': False}


@dataclass(frozen=True, slots=True)
class Parameters:
    """The node's own parameters; the parameters ``net.*`` are the fields of Network."""

    net_file: str = _parameter('', 'path of the net CSV, needed')
    map_file: str = _parameter('', 'path of the map CSV, needed')
    port: str = _parameter('', f'device path, {URLS} to use instead of Com_Port')
    low_latency: bool = _parameter(
        True, 'ask the port driver to pass on each byte at once, if it can')
    rs485: bool = _parameter(
        False, 'let the kernel switch an RS-485 transmitter with RTS, if it can')
    strict_map: bool = _parameter(False, 'a bad row in the map ends the process')
    read_only: bool = _parameter(False, 'refuse every write')
    standby: bool = _parameter(
        False, 'offer no topics and services until this bridge has the line; set it on both '
        'hosts that share a line')
    default_period: int = _parameter(
        100, 'ms between reads of a mapping without Period; 0: as often as the line allows',
        0, MAX_PERIOD)
    diagnostics_period: float = _parameter(1.0, 's between diagnostics', 0.1, 60.0)
    snapshot_period: float = _parameter(
        1.0, 's between snapshots of all values, while subscribed to; 0: never', 0.0, 3600.0)
    stale_after: float = _parameter(
        USUAL_STALE_AFTER, 'periods after which a value counts as lost', 1.0, 1000.0)
    processor_period: float = _parameter(
        10.0, 's between questions for type, mode and faults of each processor; 0: never',
        0.0, 3600.0)
    write_timeout: float = _parameter(2.0, 's that a write may wait for the line', 0.05, 60.0)
    nak_on_command_timeout: str = _parameter(
        'auto', 'send DLE NAK, which resets all slaves, when a reply does not come in time; auto: '
        'only where it destroys nothing that is waited for', choices=_YES_OR_BY_LINE)
    max_outstanding: int = _parameter(
        1, 'most commands that wait for a reply at the same time, Mode Peer only', 1, 16)
    accept_slave_messages: bool = _parameter(
        True, 'serve or pass on messages that slaves send on their own; false: acknowledge and '
        'drop them')
    poll_list: str = _parameter(
        '', 'stations to poll with Polling Standard, as in 1,3-5; empty: all mapped ones')
    priority_poll_list: str = _parameter('', 'stations to poll first in every scan')
    poll_group_size: int = _parameter(
        0, 'stations of poll_list polled in each scan; 0: all', 0, 255)
    poll_multiple: bool = _parameter(
        False, 'poll a station until it has no more messages; false: one message per scan')
    send_in_sequence: bool = _parameter(
        False, 'send commands when our own station comes up in the list; false: between polls')
    eot_suppression: bool = _parameter(False, 'Mode Slave: stay silent instead of answering EOT')
    duplicate_detection: bool = _parameter(
        True, 'Mode Slave and Peer: execute a repeated command only once')
    poll_timeout: float = _parameter(
        60.0, 'Mode Slave: s without a poll after which own commands fail; 0: never', 0.0,
        3600.0)
    most_services: int = _parameter(
        100, 'most services: ~/set of all bits if these fit, then ~/read_now of all rows with a '
        'Period if these fit too; a service costs as much as three topics', 0, 10_000)
    expose_map_parameters: bool = _parameter(
        True, 'show every mapping as read-only parameters map.<tag>.<column>; if this is not '
        f'set, only for maps of up to {MOST_SHOWN_ROWS} rows')
    trace_file: str = _parameter(
        '', 'path of a capture of all bytes on the port, for sniff; empty: no capture')
    trace_limit: float = _parameter(
        10.0, 'most MB that the capture takes on the disk', 0.01, 10_000.0)


Given = MappingType[str, object]
"""The values that the user has set, by name of the parameter."""

NO_ARGUMENTS = Arguments()

NODE_NAME = 'abdf1'

_OF_RCLPY = 'use_sim_time', 'start_type_description_service'

_MAP_NAMES = {column.lower() for column in COLUMNS}

_OF_STANDARD_POLLING = ('poll_list', 'priority_poll_list', 'poll_group_size', 'poll_multiple',
                        'send_in_sequence')

# Shown as absolute paths, because a relative path does not say which file it is.
_PATHS = ('net_file', 'map_file', 'trace_file')


@dataclass(frozen=True, slots=True)
class Configuration:
    """
    The node's parameters and the contents of both files, checked.

    - ``map_problems``: faults of rows that were left out
    - ``given``: the parameters that the user has set
    - ``ignored``: names in ``given`` without effect
    """

    parameters: Parameters
    network: Network
    port: str
    mappings: Rows
    map_problems: list[Problem]
    given: Given
    polling: PollingSettings | None = None
    ignored: list[str] = field(default_factory=list)
    files: FileWatch = field(default_factory=FileWatch)

    @property
    def held(self) -> tuple[str, ...]:
        """Return the ports and the places of Share: no other line may use them."""
        return self.port, *self.network.share.split(), *self.network.ports[1:]

    def driver_settings(self) -> DriverSettings:
        """Return the driver's settings: parameters of equal name, or derived from parameters."""
        own = {entry.name for entry in fields(Parameters)}
        same = {entry.name: getattr(self.parameters, entry.name)
                for entry in fields(DriverSettings) if entry.name in own}
        return replace(
            DriverSettings(**same),
            nak_on_command_timeout=_YES_OR_BY_LINE[self.parameters.nak_on_command_timeout],
            may_store='://' in self.port,
            default_period=self.parameters.default_period / 1000,
            polling=self.polling, first_tns=random.randrange(0x10000))

    @property
    def idle(self) -> list[str]:
        """Return the changed parameters of standard polling, if the line does not use it."""
        if self.network.line_mode is STANDARD:
            return []
        usual = Parameters()
        return [name for name in _OF_STANDARD_POLLING
                if getattr(self.parameters, name) != getattr(usual, name)]

    def shown_rows(self) -> Sequence[Mapping]:
        """Return the rows to show as parameters: all or none."""
        is_few = len(self.mappings) <= MOST_SHOWN_ROWS or 'expose_map_parameters' in self.given
        return self.mappings if is_few and self.parameters.expose_map_parameters else ()

    def __str__(self) -> str:
        """Return one line of text: files, settings of the line, numbers of rows and topics."""
        network, parameters = self.network, self.parameters
        read = len(self.mappings.published)
        written = len({mapping.topic for mapping in self.mappings.messages})
        files = f'{_resolved(parameters.net_file)} and {_resolved(parameters.map_file)}'
        rows = counted(len(self.mappings), 'row')
        given = parameters.port or network.com_port
        number = f' (Com_Port {given})' if is_digits(given) else ''
        return (f'{printable(files)}: port {printable(self.port)}{number}, Mode {network.mode}, '
                f'{network.baud} baud, {network.error_code}; {rows}, topics: {read} to read, '
                f'{written} to write')


def take_given(node: Node) -> Given:
    """
    Return the parameters that the user has set, and undeclare them.

    Make the node with ``automatically_declare_parameters_from_overrides``: otherwise rclpy
    silently drops a parameter that is not declared.
    """
    given = {parameter.name: parameter.value for parameter in node.get_parameters([
        name for name in node.get_parameters_by_prefix('') if name not in _OF_RCLPY])}
    for name in given:
        node.undeclare_parameter(name)
    return given


def configure(node: Node, arguments: Arguments = NO_ARGUMENTS) -> Configuration:
    """
    Declare the node's own parameters and read both files.

    Raises ConfigurationError with all faults that prevent the node from running. ``ShownFiles``
    shows the contents of the files.
    """
    given = take_given(node)
    known = [entry.name for entry in fields(Parameters)]
    known += [entry.parameter for entry in FIELDS.values()]
    problems = wrong_names(node, given, arguments, known, NODE_NAME, 'net.')
    parameters = _declare_own(node, given, problems)
    return _from_files(given, parameters, problems, is_strict=parameters.strict_map)


def read_again(before: Configuration) -> Configuration:
    """
    Read both files again.

    Raises ConfigurationError with all faults, even of single rows: the node then goes on with the
    old files.
    """
    return _from_files(before.given, before.parameters, [], is_strict=True)


def _from_files(given: Given, parameters: Parameters, problems: list[Problem], *,
                is_strict: bool) -> Configuration:
    found: Network | None = None
    mappings = Rows()
    map_problems: list[Problem] = []
    files = FileWatch((parameters.net_file, parameters.map_file))
    try:
        found = _overridden(
            given, load_network(_needed('net_file', parameters.net_file, problems)))
    except ConfigurationError as error:
        problems += error.problems
    try:
        map_file = _needed('map_file', parameters.map_file, problems)
        mappings, map_problems = load_mappings(map_file)
        if found is not None:  # the rows cannot be judged by a line that is not known
            mappings, unusable = usable_rows(mappings, found, parameters.default_period / 1000)
            map_problems += unusable
            problems += share_problems(found, mappings.stations)
    except ConfigurationError as error:
        problems += error.problems
    if is_strict:
        problems += map_problems
    polling = _polling(parameters, mappings, problems)
    network = found or Network()
    port = network.port
    if parameters.port:
        try:
            other = make_network({'com_port': (
                expanded(parameters.port), 'parameter port')}, network)
            port, network = other.port, replace(network, remarks=other.remarks)
        except ConfigurationError as error:
            problems += error.problems
    if problems:  # all that is wrong, as the node does not begin
        raise ConfigurationError(problems if is_strict else [*problems, *map_problems])
    return Configuration(parameters, network, port, mappings, map_problems, given, polling,
                         _ignored(given, mappings), files)


def _overridden(given: Given, network: Network) -> Network:
    """Return the network with the values of parameters ``net.*`` in place of the file's values."""
    texts = {name: text_of(given[entry.parameter]) for name, entry in FIELDS.items()
             if entry.parameter in given}
    if 'com_port' in texts:
        texts['com_port'] = expanded(texts['com_port'])
    cells = network.cells()
    return make_network({  # compare as text: 5.0 equals 5, but is not a valid station
        name: (text, f'parameter {FIELDS[name].parameter}') for name, text in texts.items()
        if text != str(cells[name])}, network)


def _needed(name: str, path: str, problems: list[Problem]) -> str:
    """Return the path of a file; raises ConfigurationError, with help, if none is given."""
    if '$(' in path:
        raise ConfigurationError([Problem(
            f'parameter {name}', f'{path}: $(...) is for launch files; write the path')])
    if path:
        return path
    if any(problem.place.file == f'parameter {name}' for problem in problems):
        raise ConfigurationError([])  # the user gave it, but not as text: reported already
    raise ConfigurationError([Problem(
        f'parameter {name}', f'which file? Start with --ros-args -p net_file:=net.csv -p '
        f'map_file:=map.csv; examples are in {config_file("net.csv").parent}, and "ros2 launch '
        'abdf1_ros demo.launch.py" runs them with a simulated line')])


def _resolved(path: str) -> str:
    return os.path.realpath(path) if path else ''


def wrong_names(node: Node, given: Given, arguments: Arguments, known: Collection[str],
                usual_name: str, begins: str = ' ') -> list[Problem]:
    """
    Return faults of parameters that do not exist, are for another node, or are octal.

    In sections that name this node, and on the command line if no other node gets the parameter,
    every name is checked. Elsewhere, a name is checked only if it resembles ours or starts with
    ``begins``: all other names may belong to other nodes. ``map.*`` is allowed, because a dump of
    our parameters contains it; see ``_ignored``. Numbers with a leading zero are reported, because
    YAML reads them as octal.
    """
    full_name = node.get_fully_qualified_name()
    problems = [*arguments.misdirected(full_name, usual_name, known)]
    typed, only_ours = arguments.typed_for(full_name), arguments.only_for(full_name)
    found = set(_OF_RCLPY)
    for section, name, place, numbers in parameters_in(arguments.files):
        if section == full_name:
            found.add(name)
            if not (name in known or name in _OF_RCLPY or _is_of_map(name)):
                problems.append(Problem(place, (
                    f'{name}: there is no such parameter; {_nearest(name, known, begins, 0.5)}')))
        if name in known and is_for(section, full_name):
            problems += _octal(place, f'{name}: ', numbers)
    for name in given:
        is_other = name.startswith('qos_overrides.') and f'.{full_name}/' not in name
        if name in found or name in known or _is_of_map(name) or is_other:
            continue
        if hint := _nearest(name, known, begins, 0.5 if name in only_ours else 0.75):
            problems.append(Problem(f'parameter {name}', f'there is no such parameter; {hint}'))
    for name in given.keys() & typed.keys() & {*known}:
        problems += _octal(f'parameter {name}', '', typed_numbers(typed[name]))
    return problems


def _octal(place: Place | str, name: str, numbers: Sequence[str]) -> list[Problem]:
    return [Problem(place, f'{name}{number} is octal in YAML; write {int(number)} or {octal}')
            for number in numbers if (octal := octal_of(number)) is not None]


def _is_of_map(name: str) -> bool:
    return name.startswith('map.') and name.rpartition('.')[2] in _MAP_NAMES


def _nearest(name: str, known: Collection[str], begins: str, likeness: float) -> str:
    if name.startswith('qos_overrides.'):
        return 'the QoS of our topics follows from the files'
    if name.startswith('map.'):
        return 'map.* only shows the map file: change the file'
    in_net = f'net.{name.lower()}'
    close = [in_net] if in_net in known else difflib.get_close_matches(
        name.lower(), known, 1, likeness)
    if close:
        return f'did you mean {close[0]}?'
    if name.startswith(begins):
        return f'{begins}* has the columns of the net file'
    return 'another version may have it' if likeness < 0.75 else ''


def _ignored(given: Given, mappings: Rows) -> list[str]:
    """Return the parameters ``map.*`` whose values differ from the map."""
    texts = {name: text_of(value) for name, value in given.items() if name.startswith('map.')}
    repeated = {name for name, value, _ in map_cells(mappings) if texts.get(name) == value} \
        if texts else set()
    return sorted(texts.keys() - repeated)


def _polling(parameters: Parameters, mappings: Rows,
             problems: list[Problem]) -> PollingSettings:
    """Return the settings of standard polling."""
    priority = _stations('priority_poll_list', parameters.priority_poll_list, problems)
    normal = _stations('poll_list', parameters.poll_list, problems)
    routes = {mapping.station: mapping.via for mapping in mappings if mapping.via is not None}
    for name, listed in (('priority_poll_list', priority), ('poll_list', normal)):
        problems += (Problem(f'parameter {name}', f'station {station} is behind gateway '
                             f'{routes[station]}, which is polled in its place')
                     for station in listed if station in routes)
    if not parameters.poll_list:
        polled = {routes.get(station, station) for station in mappings.stations}
        normal = tuple(sorted(polled - {*priority}))
    return PollingSettings(normal, priority, parameters.poll_group_size,
                           parameters.poll_multiple, parameters.send_in_sequence)


def _stations(name: str, text: str, problems: list[Problem]) -> tuple[int, ...]:
    """Return the stations of a list such as "1,3-5", in its order."""
    stations, faults = parse_stations(text)
    problems += [Problem(f'parameter {name}', fault) for fault in faults]
    return stations


def _declare(node: Node, given: Given, name: str, default: object,
             descriptor: ParameterDescriptor) -> object:
    """
    Declare a parameter and return its value, even a value of a wrong type or range.

    rclpy only shows types and ranges; we check them, with better messages. A path is shown
    resolved, but returned as the user gave it, with the home folder.
    """
    if name in _PATHS and isinstance(value := given.get(name), str):
        path = expanded(value)
        node.declare_parameter(name, _resolved(path), descriptor, ignore_override=True)
        return path
    try:
        return node.declare_parameter(name, default, descriptor).value
    except ParameterException:
        descriptor.integer_range, descriptor.floating_point_range = [], []
        return node.declare_parameter(name, default, descriptor).value


def checked(entry: Field[Any], value: object) -> Any:
    """Return the value of a field of Parameters; raises ValueError if it cannot be used."""
    return usable(entry.name, value, getattr(Parameters(), entry.name), **{
        limit: entry.metadata[limit] for limit in ('low', 'high', 'choices')})


def _declare_own(node: Node, given: Given, problems: list[Problem]) -> Parameters:
    usual, values = Parameters(), Checked()
    for entry in fields(Parameters):
        low, high = entry.metadata['low'], entry.metadata['high']
        default = getattr(usual, entry.name)
        value = _declare(node, given, entry.name, default, descriptor_of(
            default, entry.metadata['description'], low, high, read_only=True))
        try:
            values[entry.name] = checked(entry, value)
        except ValueError as error:
            problems.append(Problem(f'parameter {entry.name}', str(error)))
            values[entry.name] = default
    return Parameters(**values)
