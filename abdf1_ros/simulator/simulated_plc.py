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

"""A simulated PLC for trials of the bridge: changing values, and faults to switch on."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Sequence
from contextlib import AbstractContextManager, nullcontext
import copy
from dataclasses import dataclass
from enum import Enum
import math
import random
from typing import TypeVar

from abdf1_ros.counters import Counters
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Frame, Poll, Symbol
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.numbers import decimal_number, member_of, one_of, ValueKind, whole, whole_number
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.address_range import AddressRange
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_range, served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.spellings import family_name
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.steps import write_requests
from abdf1_ros.pccc.values import Codec, types_of, ValueType
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.csv_table import read_rows, Row
from abdf1_ros.simulator.ladder import Ladder
from abdf1_ros.text import shown

COLUMNS = ('Station', 'PLC_Type', 'Address', 'Length', 'Values', 'Motion', 'Period', 'Via',
           'Processor')
_RAMP_TOP = 1000

_T = TypeVar('_T')


class Motion(Enum):
    """How a value changes by itself."""

    NONE = ''
    RAMP = 'Ramp'
    TOGGLE = 'Toggle'


@dataclass(slots=True)
class _Mover:
    """Change ``codec.length`` elements at ``address`` every ``period`` seconds."""

    address: Address
    codec: Codec
    motion: Motion
    period: float
    next_time: float = 0.0

    def advance(self, table: DataTable, now: float) -> None:
        """Make the steps that are due; a word that was written and is not BCD stays as it is."""
        if now < self.next_time:
            return
        steps = int((now - self.next_time) / self.period) + 1
        self.next_time += steps * self.period
        try:
            values = self.codec.decode(table.read(self.address, self.codec.words))
        except FormatError:
            return
        if isinstance(values, str):
            return
        if self.motion is Motion.RAMP:
            changed = [(value + steps) % _RAMP_TOP for value in values]
        else:
            changed = [int(not value) if steps % 2 else value for value in values]
        self.codec.store(table, self.address, changed)


@dataclass(slots=True)
class InjectedFaults:
    """
    The present faults of a station.

    - ``silent``: the station does not answer.
    - ``full``: it has no room for commands, so it ignores them (half duplex) or answers NAK (full
      duplex).
    - ``slow``: number of polls that get EOT before each reply.
    - ``delay``: seconds after a command during which polls get EOT.
    - ``noise``: the share of its characters that is damaged.
    - ``status``: STS and EXT STS of every reply.
    """

    silent: bool = False
    full: bool = False
    slow: int = 0
    delay: float = 0.0
    noise: float = 0.0
    status: tuple[int, ...] = ()


class Sending:
    """A command of a simulated PLC on its way; ``report`` gets its outcome."""

    def __init__(self, command: Packet, report: Callable[[str], None]) -> None:
        self.command = command
        self.sent = False
        self.reply_size = 0
        self.expires = math.inf
        self.blames = True
        self.is_own, self.answer_within = False, math.inf
        self._report = report

    def reply(self, packet: Packet) -> None:
        try:
            check_status(packet)
        except RemoteError as error:
            self._report(str(error))
        else:
            self._report('confirmed')

    def fail(self, error: LinkError) -> None:
        self._report(str(error))


_NO_LOCK = nullcontext()


class SimulatedPlc(TaskSource):
    """
    One station with its data table; ``clock`` gives seconds.

    ``via``: the number of its gateway. ``lock``: a reentrant lock, locked while its program
    advances, or a command is carried out, because several threads may do so.
    """

    def __init__(self, station: int, table: DataTable, checksum: Checksum,
                 clock: Callable[[], float], via: int | None = None,
                 lock: AbstractContextManager[object] = _NO_LOCK,
                 processor: EmulatedProcessor | None = None) -> None:
        self.station = station
        self.via = via
        self.is_radio = False
        self.table = table
        self._polls_to_refuse = 0
        # clock value (s) from which the reply to the last command is ready
        self._ready = -math.inf
        self._faults = InjectedFaults()
        self.processor = processor or EmulatedProcessor()
        self.slave = HalfDuplexSlave(LinkSettings(station=station, checksum=checksum), self.serve)
        self.counters = self.slave.counters  # of our port
        self.outbox: deque[Sending] = deque()
        self._server = self._make_server('Slave')
        self._tns = random.Random(0).randrange(0x10000)
        self.clock = clock
        self._movers: list[_Mover] = []
        self._random = random.Random(station)
        self.ladder: Ladder | None = None
        self.lock = lock
        self._saved: DataTable | None = None

    @property
    def faults(self) -> InjectedFaults:
        """Return the present faults; others take effect at once."""
        return self._faults

    @faults.setter
    def faults(self, faults: InjectedFaults) -> None:
        self._faults, self._polls_to_refuse, self._ready = faults, 0, -math.inf

    def be_full_duplex(self) -> None:
        """Answer from now on as a PLC with a full-duplex port."""
        self.processor.is_full_duplex = True
        self._server = self._make_server('Peer')

    def be_radio(self, counters: Counters) -> None:
        """Answer from now on as a PLC behind a radio modem whose port has these counters."""
        self.counters = counters
        self.is_radio = True
        self._server = self._make_server('Radio')

    def _make_server(self, mode: str) -> Server:
        return Server(self.table, self.processor, served_counters(
            self.counters, self.table.plc_type, mode))

    def handle(self, symbol: Symbol) -> bytes:
        """Answer a symbol, with the effects of the faults."""
        if self.faults.silent or (self.faults.full and isinstance(symbol, Frame)):
            return b''
        is_poll = isinstance(symbol, Poll) and symbol.valid and symbol.station == self.station
        with self.lock:
            if is_poll and (self._polls_to_refuse > 0 or self.clock() < self._ready):
                self._polls_to_refuse -= 1
                return self.damaged(frames.EOT)
            return self.damaged(self.slave.handle(symbol))

    @property
    def is_running(self) -> bool:
        """Return True if the program runs and drives outputs; not in PROGRAM and TEST."""
        return self.processor.mode.is_running

    def run_ladder(self, ladder: Ladder) -> None:
        """Run a program from now on."""
        self.ladder = ladder
        self.save()
        self._set_ladder()

    def save(self) -> None:
        """Let a download restore the present words."""
        self._saved = copy.deepcopy(self.table)

    def set_mode(self, setting: Setting) -> None:
        """Change the mode, like the key or the programming software."""
        self.advance()
        was_running = self.is_running
        self.processor.setting = setting
        if self.is_running != was_running:
            self._set_ladder()

    def download(self) -> None:
        """Download the program: its saved words are restored, and the mode is PROGRAM."""
        self.set_mode(Setting.PROGRAM)
        if self._saved is not None:
            self.table.restore(self._saved)

    def cycle_power(self) -> None:
        """Switch power off and on: words stay, waiting messages are lost."""
        self.advance()
        self.slave.reset()
        self.outbox.clear()
        self._set_ladder()

    def _set_ladder(self) -> None:
        now = self.clock()
        for mover in self._movers:
            mover.next_time = max(mover.next_time, now)
        if self.ladder is not None and self.is_running:
            self.ladder.enter_run(now)

    def advance(self) -> None:
        """Make all changes that are due by now, while the program runs."""
        with self.lock:
            if not self.is_running:
                return
            now = self.clock()
            for mover in self._movers:
                mover.advance(self.table, now)
            if self.ladder is not None:
                self.ladder.advance(now)

    def move(self, mover: _Mover) -> None:
        """Let ``mover`` change values from now on."""
        mover.next_time = self.clock() + mover.period
        self._movers.append(mover)

    def send(self, address: Address, values: list[float], station: int,
             report: Callable[[str], None]) -> None:
        """
        Write to ``station`` with commands of our own, as a MSG instruction does.

        Only a full-duplex line sends these commands. ``report`` gets the outcome of each command.
        Raises FormatError for values that do not fit.
        """
        codec = _natural_codec(address, len(values))
        codec.check(values)
        for cmd, body in write_requests(address, codec, values, dialect_of(address.plc_type)):
            self._tns = self._tns + 1 & 0xFFFF
            command = Packet(station, self.station, cmd, 0, self._tns, body)
            self.outbox.append(Sending(command, report))

    def next_task(self, now: float, busy: Container[int] = ()) -> Sending | None:
        """Return our next command to send; None if there is none, or its station is busy."""
        is_free = self.outbox and self.outbox[0].command.dst not in busy
        return self.outbox.popleft() if is_free else None

    def damaged(self, data: bytes) -> bytes:
        """Return ``data``, with random damage if the fault ``noise`` is on."""
        if not self.faults.noise:
            return data
        return bytes(byte ^ 1 << self._random.randrange(8)
                     if self._random.random() < self.faults.noise else byte for byte in data)

    def serve(self, command: Packet) -> Packet:
        """Execute a command and return its reply."""
        now = self.clock()
        self._polls_to_refuse = self.faults.slow
        self._ready = now + self.faults.delay
        self.advance()
        if self.faults.status:
            sts, *ext_sts = self.faults.status
            return command.reply(bytes(ext_sts), sts)
        with self.lock:
            return self._server.serve(command)


def load_plcs(path: str, checksum: Checksum, clock: Callable[[], float],
              make_lock: Callable[[], AbstractContextManager[object]] = nullcontext
              ) -> list[SimulatedPlc]:
    """Read a simulator CSV; raise ConfigurationError with every fault found."""
    def make(station: int, plc_type: PlcType, via: int | None) -> SimulatedPlc:
        return SimulatedPlc(station, DataTable(plc_type), checksum, clock, via, make_lock())

    plcs: dict[int, SimulatedPlc] = {}
    problems: list[Problem] = []
    for row in read_rows(path, COLUMNS):
        try:
            _load_row(row, plcs, make)
        except Problem as problem:
            problems.append(problem)
    if problems:
        raise ConfigurationError(problems)
    for plc in plcs.values():
        plc.save()
    return list(plcs.values())


def _load_row(row: Row, plcs: dict[int, SimulatedPlc],
              make: Callable[[int, PlcType, int | None], SimulatedPlc]) -> None:
    station = _value(row, 'Station', whole(0, MAX_STATION))
    via = _value(row, 'Via', whole(1, MAX_STATION)) if row.get('Via') else None
    length = _value(row, 'Length', whole(1, 1000)) if row.get('Length') else None
    motion = _value(row, 'Motion', member_of(Motion))
    plc_type = _value(row, 'PLC_Type', one_of(
        {kind.value: kind for kind in FAMILIES}, family_name))
    if station not in plcs:
        plcs[station] = make(station, plc_type, via)
    plc = plcs[station]
    _check_route(row, plc, via, plcs)
    if plc.table.plc_type != plc_type:
        raise Problem(row.where('PLC_Type'),
                      f'station {station} is a {plc.table.plc_type.value} already')
    if row.get('Processor'):
        processor = _value(row, 'Processor', one_of({
            entry.value: entry for entry in FAMILIES[plc_type].by_processor}))
        if (before := plc.processor.processor) not in (None, processor):
            raise Problem(row.where('Processor'), f'station {station} is {before.value} already')
        plc.processor.processor = processor
    try:
        address, size = _place(row, plc_type)
        codec = _natural_codec(address, length or size)
        if size not in (1, codec.length):
            raise Problem(row.where('Length'), f'{row.get("Address")} has Length {size}')
        _check_extent(row, address, codec)
        plc.table.create(address, codec.words)
    except (FormatError, NoSuchFile) as error:
        raise Problem(row.where('Address'), str(error)) from None
    if row.get('Values'):
        codec.store(plc.table, address, _values(row, codec))
    if motion is not Motion.NONE:
        if codec.type is ValueType.STRING:
            raise Problem(row.where('Motion'), 'a string does not move')
        if codec.type is ValueType.BOOL and motion is Motion.RAMP:
            raise Problem(row.where('Motion'), 'bits have no Ramp, only Toggle')
        period = _value(row, 'Period', whole(1, 3_600_000))
        plc.move(_Mover(address, codec, motion, period / 1000))


def _check_route(row: Row, plc: SimulatedPlc, via: int | None,
                 plcs: dict[int, SimulatedPlc]) -> None:
    """Raise Problem for a PLC in two places, or a gateway that is a PLC."""
    if via != plc.via:
        place = 'on the line itself' if plc.via is None else f'behind gateway {plc.via}'
        raise Problem(row.where('Via'), f'station {plc.station} is {place} already')
    gateways = {other.via for other in plcs.values()}
    for number in gateways & plcs.keys():
        raise Problem(row.where('Via'), f'station {number} is a PLC, it cannot be a gateway too')


def _check_extent(row: Row, address: Address, codec: Codec) -> None:
    if address.offset + codec.words > address.area_size:
        raise Problem(row.where('Length'),
                      f'the last word there can be is {address.last_of_area}')


def _place(row: Row, plc_type: PlcType) -> tuple[Address, int]:
    """Return the address, and the Length of its range: 1 without a range."""
    found = parse_range(row.get('Address'), plc_type)
    if isinstance(found, AddressRange):
        return found.first, found.length()
    return found, 1


def _natural_codec(address: Address, length: int) -> Codec:
    return Codec(types_of(address)[0], length, address.bit or 0)


def _value(row: Row, column: str, kind: ValueKind[_T]) -> _T:
    value = kind.read(row.get(column))
    if value is None:
        raise Problem(row.where(column), f'{column} = "{shown(row.get(column))}" should be '
                                         f'{kind.right}')
    return value


def _values(row: Row, codec: Codec) -> list[float] | str:
    values: list[float] | str = row.get('Values')
    try:
        if codec.type is not ValueType.STRING:
            values = numbers(row.get('Values').split())
            values += [0] * (codec.length - len(values))
        codec.check(values)
    except ValueError as error:
        raise Problem(row.where('Values'), str(error)) from None
    return values


def numbers(texts: Sequence[str]) -> list[float]:
    """Return the int or float of each text; raises ValueError for anything else."""
    values = []
    for text in texts:
        number = whole_number(text)
        value = decimal_number(text) if number is None else number
        if value is None:
            raise ValueError(f'"{shown(text)}" should be a number')
        values.append(value)
    return values
