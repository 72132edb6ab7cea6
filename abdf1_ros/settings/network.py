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

"""The net CSV: one serial link and how its driver behaves (S0, "Network Configuration")."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field, fields, replace
import re
from typing import TypedDict, TypeVar, Unpack
from urllib.parse import urlsplit

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import character_time, LineTiming
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.modes import mode_of, MODES
from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.settings import LinkOptions, LinkSettings
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.line_names import device_of, MOST_PORT
from abdf1_ros.messages import Message
from abdf1_ros.numbers import (
    is_digits,
    one_of,
    TEXT,
    ValueKind,
    whole,
    whole_number,
    YES_OR_NO,
)
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.spellings import family_name
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings import BAUD_RATES, PARITIES
from abdf1_ros.settings.csv_table import read_table, Row
from abdf1_ros.settings.hints import hint
from abdf1_ros.settings.share import share_places, station_of
from abdf1_ros.settings.station_lists import octal_remarks, parse_stations
from abdf1_ros.text import shown

MODE_NAMES = tuple(dict.fromkeys(mode.name for mode in MODES))
_Cell = TypeVar('_Cell', int, str, bool)
POLLING_MODES = tuple(mode.polling for mode in MODES if mode.polling)
_HOST = re.compile(r'(?P<scheme>\w+://)?(?P<host>(?!tcp:)[\w.-]+?)(?P<port>:[0-9]{2,5})?')
PLC_TYPES = tuple(entry.value for entry in FAMILIES)
# Schemes of the URLs of device servers; each has a module in ``ports``.
DEVICE_SERVERS = ('socket', 'rfc2217')
URLS = ' or '.join(f'{scheme}://host:port' for scheme in DEVICE_SERVERS)


@dataclass(frozen=True, slots=True)
class NetField:
    """
    One field of the net CSV.

    - ``message``: numbered text for a bad value; its wording fits only numbers and choices.
    - ``message_args``: fill the places of ``message`` after the value.
    - ``other_words``: names of choices in other programs, in lower case, with our choice.
    """

    column: str
    default: int | str | bool
    description: str
    kind: ValueKind[int | str | bool]
    message: Message | None = None
    message_args: tuple[object, ...] = ()
    other_words: MappingType[str, str] = field(default_factory=dict)

    @property
    def parameter(self) -> str:
        """Return the name of the node's parameter."""
        return f'net.{self.column.lower()}'

    def parse(self, text: str, where: Place | str) -> int | str | bool:
        """Return the value of a cell; raise Problem when it is not allowed."""
        value: int | str | bool | None = self.kind.read(text)
        if value is None:
            meant = self.other_words.get(re.sub(r'[\W_]', '', text).lower())
            advice = f'; "{shown(text)}" is {meant}' if meant else hint(text)
            if self.message and (self.kind.choices or is_digits(text)):
                raise Problem(where, advice.removeprefix('; '), self.message,
                              (shown(text), *self.message_args))
            raise Problem(where, f'{self.column} = "{shown(text)}" should be {self.kind.right}'
                          f'{advice}', self.message)
        return value


class _Details(TypedDict, total=False):
    message: Message
    message_args: tuple[object, ...]
    other_words: MappingType[str, str]


def _net(column: str, default: _Cell, description: str,
         kind: ValueKind[int | str | bool] = TEXT, **details: Unpack[_Details]) -> _Cell:
    entry = NetField(column, default, description, kind, **details)
    return field(default=default, metadata={'net': entry})


def _named(*names: str) -> ValueKind[str]:
    return one_of({name: name for name in names})


# S0 prints the default, None, as a dash.
_PARITY = one_of({name: name for name in PARITIES}, lambda text: text.lower().replace('-', 'none'))


@dataclass(frozen=True, slots=True)
class Network:
    """A checked net CSV; times in milliseconds, as in the file."""

    station: int = _net(
        'Station', 5, 'DF1 address of this node', whole(0, MAX_STATION),
        message=Message.CRT_BAD_STATION_ID, message_args=(255,))
    mode: str = _net(
        'Mode', 'Master', 'driver mode', _named(*MODE_NAMES),
        message=Message.CRT_BAD_DRIVER_MODE,
        message_args=(MODE_NAMES[0], ', '.join(MODE_NAMES[1:-1]), MODE_NAMES[-1]),
        other_words=dict(ChainMap(*(dict(mode.other_words) for mode in MODES))))
    plc_type: str = _net(
        'PLC_Type', 'PLC5', 'PLC that this node emulates',
        one_of({name: name for name in PLC_TYPES}, family_name),
        message=Message.CRT_BAD_PLC_TYPE, message_args=PLC_TYPES)
    error_code: str = _net(
        'Error_Code', 'CRC', 'check of every message', _named('BCC', 'CRC'),
        message=Message.CRT_BAD_ERROR_CODE, message_args=('BCC', 'CRC'))
    nak_retries: int = _net(
        'NAK_Retries', 3, 'repetitions of a command that is not acknowledged', whole(0, 10),
        message=Message.CRT_BAD_NAK_RETRIES, message_args=(10,))
    enq_retries: int = _net(
        'ENQ_Retries', 3, 'repetitions of a poll that is not answered', whole(0, 10),
        message=Message.CRT_BAD_ENQ_RETRIES, message_args=(10,))
    cmd_timeout: int = _net(
        'Cmd_Timeout', 1000, 'ms until a reply is no longer polled for', whole(500, 5000, 'ms'),
        message=Message.CRT_BAD_CMD_TIMEOUT, message_args=(500, 5000))
    com_port: str = _net('Com_Port', '1', f'n for /dev/ttyS(n-1), a device path, {URLS}')
    baud: int = _net('Baud', 9600, 'bits per second', one_of(
        {str(baud): baud for baud in BAUD_RATES}, whole_number))
    data_bits: int = _net('Data_Bits', 8, 'data bits per character', whole(5, 8))
    stop_bits: int = _net('Stop_Bits', 1, 'stop bits per character', whole(1, 2))
    parity: str = _net('Parity', 'None', 'parity bit per character', _PARITY)
    timeout: int = _net(
        'Timeout', 1000, 'ms to wait for each answer of a station', whole(0, 360000, 'ms'))
    tx_delay: int = _net(
        'TX_Delay', 0, 'ms to wait before each transmission', whole(0, 65535, 'ms'))
    handshake: bool = _net('Handshake', False, 'hardware handshake RTS/CTS', YES_OR_NO)
    polling: str = _net('Polling', 'Message', 'how a master polls', _named(*POLLING_MODES))
    share: str = _net(
        'Share', '', 'places where other programs connect to share the line, separated by blanks: '
        'pty:/name, tcp:port, tcp:address:port, eip:port?station=N for EtherNet/IP, or a serial '
        'device')
    share_access: str = _net(
        'Share_Access', 'Read', 'what programs at these places may do',
        _named('Read', 'Write', 'All'))
    store_forward: str = _net(
        'Store_Forward', '', 'Mode Radio: forward packets between these nodes, such as 1,3-5; 255 '
        'for broadcasts')
    collision_avoidance: bool = _net(
        'Collision_Avoidance', False, 'Mode Radio: Yes if the radios avoid collisions and buffer '
        'both directions; then commands may go to several stations at a time', YES_OR_NO)
    listen_port: str = _net(
        'Listen_Port', '', 'Mode Listen: the second device, if each direction of the line has its '
        'own wire')
    # Where the places are written.
    share_at: Place | str = field(default='Share', compare=False)
    # Remarks about the way the file is written.
    remarks: tuple[Problem, ...] = field(default=(), compare=False)

    def cells(self) -> dict[str, int | str]:
        """Return the cells of a file with these values, by field."""
        values = {name: getattr(self, name) for name in FIELDS}
        return {name: ('No', 'Yes')[value] if isinstance(value, bool) else value
                for name, value in values.items()}

    @property
    def checksum(self) -> Checksum:
        """Return the check of messages."""
        return Checksum(self.error_code)

    @property
    def line(self) -> LinkSettings:
        """Return the settings of the link, with the usual options."""
        return self.link(LinkOptions())

    def link(self, options: LinkOptions) -> LinkSettings:
        """Return the settings of the link with these options."""
        return LinkSettings(
            station=self.station, checksum=self.checksum, timing=self.timing,
            nak_retries=self.nak_retries, enq_retries=self.enq_retries,
            timeout=self.timeout / 1000, cmd_timeout=self.cmd_timeout / 1000,
            store_forward=parse_stations(self.store_forward, BROADCAST)[0],
            avoids_collisions=self.duplex is Duplex.RADIO and self.collision_avoidance,
        ).having(options)

    @property
    def line_mode(self) -> LineMode:
        """Return the mode of the line."""
        return mode_of(self.mode, self.polling)

    @property
    def duplex(self) -> Duplex:
        """Return the line discipline of the mode."""
        return self.line_mode.duplex

    @property
    def port(self) -> str:
        """Return the device path or URL that Com_Port means."""
        return _device(self.com_port)

    @property
    def second_port(self) -> str:
        """Return the device path that Listen_Port means, empty for none."""
        return _device(self.listen_port) if self.line_mode.only_listens else ''

    @property
    def names_port(self) -> bool:
        """Tell whether the net file names the port; if not, a remark says so."""
        return all(remark.place.column != 'Com_Port' for remark in self.remarks)

    @property
    def ports(self) -> tuple[str, ...]:
        """Return the port of the line, and the second port if there is one."""
        return (self.port, self.second_port) if self.second_port else (self.port,)

    @property
    def timing(self) -> LineTiming:
        """Return character time and TX_Delay in seconds."""
        return LineTiming(
            character_time(self.baud, self.data_bits, self.parity, self.stop_bits),
            self.tx_delay / 1000)


def _device(text: str) -> str:
    return f'/dev/ttyS{int(text) - 1}' if is_digits(text) else text


def _is_device(text: str) -> bool:
    """Tell whether a text is the path of a device, or the number of a port from 1 on."""
    return text.startswith('/') or bool(is_digits(text) and whole_number(text))


FIELDS: dict[str, NetField] = {
    entry.name: entry.metadata['net'] for entry in fields(Network)
    if 'net' in entry.metadata}


def load_network(path: str) -> Network:
    """
    Read a net CSV.

    Raises ConfigurationError with every fault found; any fault is critical (S0).
    """
    table = read_table(path, [entry.column for entry in FIELDS.values()])
    problems = table.faults + table.row_faults
    if len(table.rows) != 1 and not table.row_faults:
        where = Place(path, table.rows[1].line if table.rows else None)
        problems.append(Problem(
            where, f'a net file has one data row, this one has {len(table.rows)}'))
    network = Network()
    for row in table.rows:
        cells = {name: (row.get(entry.column), row.where(entry.column))
                 for name, entry in FIELDS.items() if row.get(entry.column)}
        try:
            network = make_network(cells)
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    return replace(network, remarks=tuple(_row_remarks(table.rows[0])))


def _row_remarks(row: Row) -> Iterator[Problem]:
    """Yield remarks on the way the data row is written."""
    yield from octal_remarks(row)
    absent = [column for column in row.columns if column not in row.cells]
    if absent:
        yield Problem(Place(row.file, row.line), (
            f'the row ends before {", ".join(absent)}: the defaults apply'))
    if not row.get('Com_Port'):
        yield Problem(row.where('Com_Port'), (
            f'Com_Port is empty: the port is {Network().port}, unless the parameter port or '
            'net.com_port names a port'))


def make_network(values: MappingType[str, tuple[str, Place | str]],
                 base: Network | None = None) -> Network:
    """
    Check ``values`` and make a network of them.

    ``values`` has the text of each field and the place of the text, by field name. Other fields
    are taken from ``base``. Raises ConfigurationError.
    """
    base = base or Network()
    checked = {entry.name: getattr(base, entry.name) for entry in fields(base)}
    problems: list[Problem] = []
    for name, (text, where) in values.items():
        try:
            checked[name] = FIELDS[name].parse(text, where)
        except Problem as problem:
            problems.append(problem)
        else:
            if fault := _FAULTS[name](checked[name]) if name in _FAULTS else '':
                problems.append(Problem(where, fault))
    share = values.get('share', ('', 'Share'))[1]
    mode = mode_of(checked['mode'], checked['polling'])
    if mode.only_listens and not problems:
        column, fault = _listen_fault(checked['com_port'], checked['listen_port'])
        if fault:
            problems.append(Problem(
                values.get(column.lower(), ('', column))[1], f'{column}: {fault}'))
    why_unshared = mode.why_unshared
    if checked['share'] and why_unshared:
        problems.append(Problem(share, f'Share needs Mode Master or Peer: {why_unshared}'))
    if problems:
        raise ConfigurationError(problems)
    port = Network(com_port=checked['com_port']).port
    for place in share_places(checked['share']):
        if place.is_port(port):
            raise ConfigurationError([Problem(share, (
                f'Share: "{shown(place.text)}" is the port of the line, {shown(port)}; a guest '
                'needs another port'))])
    given = {FIELDS[name].column for name in values}
    checked['share_at'] = share if 'share' in values else base.share_at
    checked['remarks'] = tuple(
        remark for remark in base.remarks if remark.place.column not in given)
    return Network(**checked)


def share_problems(network: Network, stations: Sequence[int]) -> Iterator[Problem]:
    """Yield the faults of places that do not go with the rows of a map, by their stations."""
    for place in share_places(network.share):
        if place.is_ethernet:
            try:
                station_of(place, stations)
            except ValueError as error:
                yield Problem(network.share_at, f'Share: {error}')


def port_advice(text: str) -> str:
    """Return what may be meant by a text that is neither a device path nor a URL."""
    match = _HOST.fullmatch(text)
    if match and match['port'] and not _is_host(match['host']):
        return f'"{shown(match["host"])}" is not the name of a host'
    if match and match['port'] and int(match['port'][1:]) > MOST_PORT:
        return f'a port is at most {MOST_PORT}'
    if match and match['port']:
        return f'write socket://{shown(match["host"])}{match["port"]}'
    if match and match['scheme']:
        return f'the port is missing, as in {shown(text)}:4001'
    if is_url(text.rstrip('/')):
        return f'write {shown(text.rstrip("/"))}'
    return f'"plc ports" lists the devices{hint(text)}'


def _port_fault(text: str) -> str:
    return '' if is_url(text) or _is_device(text) else (
        f'Com_Port = "{shown(text)}" should be a number from 1, a device path such as '
        f'/dev/ttyUSB0, {URLS}; {port_advice(text)}')


def _second_fault(text: str) -> str:
    return '' if not text or _is_device(text) else (
        f'Listen_Port = "{shown(text)}" should be a number from 1 or a device path such as '
        '/dev/ttyUSB1')


def _listen_fault(first: str, second: str) -> tuple[str, str]:
    """Return the column and the fault of the ports in Mode Listen; empty for none."""
    if first.lower().startswith('rfc2217:'):
        return 'Com_Port', ('RFC 2217 sets the lines of the far port, and Mode Listen sets none; '
                            'write socket:// where the server has raw TCP')
    if second and '://' in first:
        return 'Listen_Port', 'both ports must be devices of this machine'
    if second and device_of(_device(first)) == device_of(_device(second)):
        return 'Listen_Port', f'{shown(second)} is the device of Com_Port, too'
    return '', ''


def _share_fault(text: str) -> str:
    try:
        share_places(text)
    except ValueError as error:
        return f'Share: {error}'
    return ''


def _nodes_fault(text: str) -> str:
    _, faults = parse_stations(text, BROADCAST)
    return f'Store_Forward = {faults[0]}' if faults else ''


# Functions that return the fault of the text of a field, empty for none.
_FAULTS = {'com_port': _port_fault, 'listen_port': _second_fault, 'share': _share_fault,
           'store_forward': _nodes_fault}


def _is_host(name: str) -> bool:
    """Return True if a name server could know the name: no part is empty or too long."""
    try:
        return bool(name.encode('idna'))
    except UnicodeError:
        return False


def is_url(text: str) -> bool:
    """Tell whether ``text`` is the URL of a device server: host, port, and nothing after them."""
    try:
        url = urlsplit(text)
        is_server = url.scheme in DEVICE_SERVERS and url.hostname and url.port
        return '://' in text and bool(is_server) and _is_host(url.hostname or '') \
            and not (url.path or url.query or url.fragment)
    except ValueError:  # a port above 65535
        return False
