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

"""
A blocking client, without ROS: read and write a PLC from any program.

::

    with Client('/dev/ttyUSB0', plc_type='SLC', station=1) as plc:
        plc.read('N7:0', 10, 'int16')
        plc.read_many(['N7:0-9', 'F8:2'])
        plc.write('B3:0/1', True)

    with Client.from_files('net.csv', 'map.csv') as plant:
        plant.read('line_speed')

docs/library.md has more. Times are seconds, as in Python's own modules (the files have
milliseconds). The errors are defined in ``abdf1_ros.errors``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
import logging
import math
from numbers import Real
import os
import re
from typing import Literal, overload, SupportsIndex, TYPE_CHECKING, TypeVar

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.master import MASTER
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave_link import SLAVE
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.errors import Abdf1Error, FormatError, LinkError, RemoteError
from abdf1_ros.numbers import member_of, one_of, ValueKind
from abdf1_ros.open_line import (
    BlockingClient,
    kind_of,
    LOG,
    OpenLine,
    path_of,
    plain,
    PlcValue,
    single,
    text_of,
    values_of,
)
from abdf1_ros.pccc import steps
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address_range import AddressRange
from abdf1_ros.pccc.families import FAMILIES, parse_range
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.spellings import family_name, processor_name
from abdf1_ros.pccc.steps import AddressedValues
from abdf1_ros.pccc.strings import is_string_element
from abdf1_ros.pccc.values import Values, ValueType, WordOrder
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.text import first, shown

if TYPE_CHECKING:
    from abdf1_ros.readings import Reading
    from abdf1_ros.settings.mapping import Mapping as Row
    from abdf1_ros.tagged_client import TaggedClient

_DUPLEX = one_of({'full': PEER, 'half': MASTER, 'slave': SLAVE})
_PARITY = one_of({name: name for name in ('None', 'Even', 'Odd')})
_LONGEST = 60.0  # s
_MOST_RETRIES = 10

Whole = Literal['int16', 'uint16', 'int32', 'uint32', 'bcd16', 'bcd12']
"""The kinds whose values are int."""

_IN_PYTHON = (
    (re.compile(r', and Length (\d+)'), r', length=\1'), (re.compile('own row'), 'own address'),
    (re.compile('a row each'), 'an address each'))
"""Words of errors about a map, and the words about a call in their place."""

_T = TypeVar('_T')


class Client(BlockingClient):
    """
    The PLC at the far end of a line, or in half duplex the PLCs on it.

    ``port`` is a device path, ``socket://host:port`` or ``rfc2217://host:port``. ``duplex`` is
    full, half (we are the master) or slave (another master polls us). ``station`` is the PLC of a
    call that names no station, ``own_station`` is our address. Without ``plc_type`` (SLC, PLC5,
    PLC3, PLC2) the client asks each PLC for its family. ``timeout`` is the time (s) for each
    acknowledgement or answer on the link, ``cmd_timeout`` the time (s) for a reply. ``retries`` is
    the number of repetitions of a message without acknowledgement, or of a poll without answer.
    ``trace`` is a file for all bytes, which ``sniff`` reads.

    All calls block, and may come from any thread. They raise RemoteError if the PLC refuses a
    command. They raise LinkError if it does not answer: the attribute ``sent`` then tells whether
    the PLC may have executed the command. A wrong call raises FormatError before its command is
    sent.
    """

    __slots__ = 'station', '_access', '_kind', '_kinds', '_own_station'

    def __init__(self, port: str | os.PathLike[str], *, plc_type: str | PlcType | None = None,
                 station: int = 1, duplex: str = 'full', baud: int = 9600,
                 parity: str | None = None, check: str = 'CRC', own_station: int = 5,
                 processor: str | Processor | None = None,
                 access: str | None = None, timeout: float = 1.0, cmd_timeout: float = 1.0,
                 retries: int = 3, trace: str | os.PathLike[str] | None = None,
                 logger: logging.Logger = LOG) -> None:
        self.station = _whole('station', station, 0, MAX_STATION)
        self._access = None if access is None else _choice('access', member_of(Access), access)
        self._kinds: dict[int, tuple[PlcType, Processor | None]] = {}
        self._kind: tuple[PlcType, Processor | None] | None = None
        if plc_type is not None:
            families = one_of({family.value: family for family in FAMILIES}, family_name)
            processors = one_of({known.value: known for known in Processor}, processor_name)
            self._kind = _choice('plc_type', families, plc_type), (
                None if processor is None else _choice('processor', processors, processor))
        elif processor is not None:
            raise FormatError('processor needs plc_type; without both the PLC is asked')
        from abdf1_ros.settings import BAUD_RATES  # one list for files and programs
        speed = _whole('baud', baud, 1)
        if speed not in BAUD_RATES:
            raise FormatError(f'baud {speed} should be one of {", ".join(map(str, BAUD_RATES))}')
        settings = PortSettings(_port(port), speed,
                                parity=_choice('parity', _PARITY, (
                                    'None' if parity is None else parity)))
        times = _whole('retries', retries, 0, _MOST_RETRIES)
        mode = _choice('duplex', _DUPLEX, duplex)
        own = _whole('own_station', own_station, 0, MAX_STATION)
        self._own_station = None if mode.has_one_plc else own
        super().__init__(OpenLine(mode, LinkSettings(
            nak_retries=times, enq_retries=times, station=own,
            checksum=_choice('check', member_of(Checksum), check),
            timing=LineTiming(settings.char_time), timeout=_seconds('timeout', timeout),
            cmd_timeout=_seconds('cmd_timeout', cmd_timeout)), settings,
            trace=None if trace is None else path_of('trace', trace), logger=logger))

    @staticmethod
    def from_files(net_file: str | os.PathLike[str], map_file: str | os.PathLike[str], *,
                   trace: str | os.PathLike[str] | None = None,
                   logger: logging.Logger = LOG) -> TaggedClient:
        """Return a client that reads and writes the rows of a map CSV by their tags."""
        from abdf1_ros.tagged_client import TaggedClient  # only a program with files needs it
        return TaggedClient(path_of('net_file', net_file), path_of('map_file', map_file),
                            None if trace is None else path_of('trace', trace), logger)

    @overload
    def read(self, address: str, length: None = None, *, kind: Whole,
             word_order: str = 'Low', station: int | None = None) -> int: ...

    @overload
    def read(self, address: str, length: SupportsIndex, kind: Whole, *,
             word_order: str = 'Low', station: int | None = None) -> list[int]: ...

    @overload
    def read(self, address: str, length: None = None, *, kind: Literal['float32'],
             word_order: str = 'Low', station: int | None = None) -> float: ...

    @overload
    def read(self, address: str, length: SupportsIndex, kind: Literal['float32'], *,
             word_order: str = 'Low', station: int | None = None) -> list[float]: ...

    @overload
    def read(self, address: str, length: None = None, *, kind: Literal['bool'],
             word_order: str = 'Low', station: int | None = None) -> bool: ...

    @overload
    def read(self, address: str, length: SupportsIndex, kind: Literal['bool'], *,
             word_order: str = 'Low', station: int | None = None) -> list[bool]: ...

    @overload
    def read(self, address: str, length: SupportsIndex | None = None, *,
             kind: Literal['string'], word_order: str = 'Low',
             station: int | None = None) -> str: ...

    # Without ``kind`` the type of the result depends on the file of the address.
    @overload
    def read(self, address: str, length: SupportsIndex | None = None, kind: str | None = None, *,
             word_order: str = 'Low', station: int | None = None) -> PlcValue: ...

    def read(self, address: str, length: SupportsIndex | None = None, kind: str | None = None, *,
             word_order: str = 'Low', station: int | None = None) -> PlcValue:
        """
        Return the value at an address, or a list of ``length`` values from there on.

        ``kind`` is bool, int16, uint16, int32, uint32, float32, bcd16, bcd12 or string; without it
        the values have the natural type of the file. From ``kind`` a type checker knows the type
        of the result. A string over words has ``length`` words.
        """
        number, target = self._target(
            address, 1 if length is None else length, kind, word_order, station)
        with self._naming(_place(address, number)):
            found = plain(self._line.ask(number, steps.read(target)), target.codec.type)
        return single(found, length is None)

    @overload
    def read_many(self, addresses: Iterable[str], *, station: int | None = None,
                  partial: Literal[False] = False) -> dict[str, PlcValue]: ...

    @overload
    def read_many(self, addresses: Iterable[str], *, station: int | None = None,
                  partial: Literal[True]) -> dict[str, Reading]: ...

    def read_many(self, addresses: Iterable[str], *, station: int | None = None,
                  partial: bool = False) -> dict[str, PlcValue] | dict[str, Reading]:
        """
        Return the values at many addresses or ranges (N7:0-9), in as few packets as possible.

        The values do not belong to one instant: each packet is a transaction of its own. The keys
        of the result are the addresses, in their order. The value of a range is a list.

        With ``partial`` each address has a ``Reading``: its value or its own error, and the time.
        Then no error of an address, the PLC or the line is raised. A PLC that has become silent
        gets no more commands of this call.
        """
        number = self._of(station)
        if isinstance(addresses, str) or not isinstance(addresses, Iterable):
            raise FormatError(f'addresses {addresses!r} should be a list of addresses')
        texts = dict.fromkeys([text_of('address', text) for text in addresses])
        if partial:
            return self._readings([*texts], number)
        from abdf1_ros.readings import values_of_rows  # not needed for single reads
        rows = dict(self._row(text, item, number) for item, text in enumerate(texts, 1))
        with self._naming(_place(first([*texts]), number)):
            values = values_of_rows(self._line, rows)
        return {row.tag: _shown(row, values[row], rows[row]) for row in rows}

    def write(self, address: str, values: float | str | Sequence[float], kind: str | None = None,
              *, word_order: str = 'Low', station: int | None = None) -> None:
        """Write one or more values from an address on; return when the PLC has confirmed all."""
        values = values_of(values)
        if isinstance(kind, Real):
            raise FormatError(f'kind {kind} should be a text; several values are one list')
        is_packed = isinstance(values, str) and kind is not None and not is_string_element(
            text_of('address', address))
        length = max(1, (len(values) + 1) // 2) if is_packed else \
            1 if isinstance(values, str) else len(values)
        number, target = self._target(address, length, kind, word_order, station)
        with self._naming(_place(address, number)):
            self._line.ask(number, steps.write(target, values))

    def identify(self, station: int | None = None) -> Identity:
        """Return the identity that a station reports: model, mode, faults."""
        number = self._of(station)
        with self._naming(f'status of station {number}'):
            return self._line.ask(number, steps.identify())

    @contextmanager
    def _naming(self, place: str, asks: bool = True) -> Iterator[None]:
        """Add ``place`` to errors of the block, and let them speak of a call, not of a row."""
        with super()._naming(place, asks):
            try:
                yield
            except (FormatError, RemoteError) as error:
                text = str(error.args[0])
                for pattern, right in _IN_PYTHON:
                    text = pattern.sub(right, text)
                error.args = (text,)
                raise

    def _of(self, station: int | None) -> int:
        number = _whole('station', self.station if station is None else station, 0, MAX_STATION)
        if number == self._own_station:
            raise FormatError(f'station {number} is own_station, so no PLC can answer as {number}')
        return number

    def _readings(self, texts: Sequence[str], station: int) -> dict[str, Reading]:
        from abdf1_ros.readings import Reading, readings_of_rows
        rows: dict[Row, bool] = {}
        found: dict[str, Reading] = {}
        try:
            self._kind_of(station)
        except Abdf1Error as error:
            return {text: Reading.failed(error, _place(text, station)) for text in texts}
        for item, text in enumerate(texts, 1):
            try:
                rows |= [self._row(text, item, station)]
            except FormatError as error:
                found[text] = Reading.failed(error)
        with self._naming(_place(first(texts), station)):
            found |= readings_of_rows(self._line, rows, lambda row: _place(row.tag, station),
                                      lambda row, values: _shown(row, values, rows[row]))
        return {text: found[text] for text in texts}

    def _row(self, text: str, item: int, station: int) -> tuple[Row, bool]:
        """Return a map row for an address or a range, and True if it is a single address."""
        from abdf1_ros.plan.reading import row_of
        plc_type, processor = self._kind_of(station)
        with self._naming(_place(text_of('address', text), station), asks=False):
            found = parse_range(text, plc_type, self._access)
            first, length = (found.first, found.length()) if isinstance(found, AddressRange) \
                else (found, 1)
            target = AddressedValues.of(str(first), plc_type, length, access=self._access)
        row = row_of(text, item, station, target, self._access, processor)
        return row, found is first

    def _target(self, address: str, length: SupportsIndex, kind: str | None, word_order: str,
                station: int | None) -> tuple[int, AddressedValues]:
        number = self._of(station)
        if isinstance(address, list | tuple):
            raise FormatError(
                f'address {shown(repr(address))} should be one text; read_many reads several')
        place, count = text_of('address', address), _whole('length', length, 1)
        chosen = None if kind is None else _choice('kind', member_of(ValueType), kind)
        order = _choice('word_order', member_of(WordOrder), word_order)
        plc_type, processor = self._kind_of(number)
        with self._naming(_place(place, number), asks=False):
            return number, AddressedValues.of(place, plc_type, count, chosen, word_order=order,
                                              access=self._access, processor=processor)

    def _kind_of(self, station: int) -> tuple[PlcType, Processor | None]:
        """Return family and processor of a station; the station is asked for them only once."""
        if self._kind is not None:
            return self._kind
        if station not in self._kinds:
            try:
                self._kinds[station] = kind_of(
                    lambda: self.identify(station), 'name plc_type', f'station {station} ')
            except LinkError as error:
                error.sent = False  # the command of the call was not
                raise
        return self._kinds[station]


def _shown(row: Row, values: Values, is_one: bool) -> PlcValue:
    return single(plain(values, row.type), is_one)


def _place(address: str, station: int) -> str:
    return f'{shown(address)} of station {station}'


def _port(value: str | os.PathLike[str]) -> str:
    """Return the name of a port; if the name has no slash, there has to be such a file."""
    path = path_of('port', value)
    if '://' in path or ('/' not in path and not os.path.exists(path)):
        from abdf1_ros.settings.network import is_url, port_advice, URLS  # not for a device
        if not is_url(path):
            raise FormatError(f'port {shown(repr(path))} should be a device path, {URLS}; '
                              f'{port_advice(path)}')
    return path


def _whole(name: str, value: object, low: float = -math.inf, high: float = math.inf) -> int:
    number = value.__index__() if isinstance(value, SupportsIndex) else None  # numpy's too
    if number is None or isinstance(value, bool) or not low <= number <= high:
        bounds = f' from {low} to {high}' if high < math.inf else \
            f' from {low} on' if low > -math.inf else ''
        raise FormatError(f'{name} {shown(repr(value))} should be a whole number{bounds}')
    return number


def _seconds(name: str, value: float) -> float:
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and 0.0 < value <= _LONGEST:
        return float(value)
    is_ms = is_number and _LONGEST < value <= 1000 * _LONGEST
    hint = f'; {value / 1000:g} for {value:g} ms' if is_ms else ''
    raise FormatError(f'{name} {shown(repr(value))} should be seconds above 0, up to '
                      f'{_LONGEST:.0f}{hint}')


def _choice(name: str, kind: ValueKind[_T], value: object) -> _T:
    """Return the meaning of a text in any letter case, or of what ``identify`` returns."""
    text = value.value if isinstance(value, PlcType | Processor) else value
    found = kind.read(text) if isinstance(text, str) else None
    if found is None:
        raise FormatError(f'{name} {shown(repr(value))} should be {kind.right}')
    return found
