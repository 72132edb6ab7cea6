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
        plc.read('N7:0', 10)
        plc.write('B3:0/1', True)

docs/library.md has more. Errors are those of ``abdf1_ros.errors``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from enum import Enum
import random
from types import TracebackType
from typing import overload, Self, TypeVar

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.link import LinkSettings
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.stations import ActiveStationList, MAX_STATION
from abdf1_ros.driver.requests import Requests
from abdf1_ros.errors import FormatError, PortLost
from abdf1_ros.pccc import steps
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.steps import AddressedValues
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread, PortState
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings

# While waiting, check so often (s) that the port is still open.
_GLANCE = 0.2

_MODES = {'full': 'Peer', 'half': 'Master'}
_PARITIES = ('None', 'Even', 'Odd')

_Result = TypeVar('_Result')
_Choice = TypeVar('_Choice', bound=Enum)


def opened(settings: PortSettings) -> Callable[[], Port]:
    """
    Open a port; return a function that returns it, and later opens it again.

    So a port that does not exist is an OSError here, not a state of a thread.
    """
    try:
        ports = [open_port(settings)]
    except OSError as error:
        error.filename = error.filename or settings.name
        raise
    return lambda: ports.pop() if ports else open_port(settings)


class OpenLine:
    """
    A line on which one request is carried out after the other, from here to the end of ``with``.

    ``absent`` stations get one try; ``routes`` gives the gateways of stations that are behind one.
    To a PLC that asks us we are a ``plc_type``. Raises OSError when the port cannot be opened.
    """

    def __init__(self, line: LinkSettings, port: PortSettings, absent: Sequence[int] = (),
                 routes: Mapping[int, int] | None = None,
                 plc_type: PlcType = PlcType.PLC5) -> None:
        self._lost: str | None = None
        self._requests = Requests(line, absent, random.randrange(0x10000), routes, plc_type)
        self._link = LinkThread(
            self._requests.machine, opened(port), on_state=self._port_changed)
        self._link.daemon = True  # a KeyboardInterrupt before ``with`` leaves nobody to stop it
        self._link.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    @property
    def counters(self) -> Counters:
        """Return the counters of the line."""
        return self._requests.counters

    @property
    def echoes(self) -> bool:
        """Tell whether the line gives back what is sent."""
        return self._requests.machine.echoes

    @property
    def stations(self) -> ActiveStationList:
        """Return what is known of each station."""
        return self._requests.stations

    def ask(self, station: int, work: Steps[_Result]) -> _Result:
        """Carry out a request and return its result; raises what its steps raise."""
        return self.wait(self.start(station, work))

    def start(self, station: int, work: Steps[_Result],
              future: Future[_Result] | None = None) -> Future[_Result]:
        """Begin to carry out a request; ``future`` is where its result goes."""
        future = future or Future()
        self._requests.add(station, work, future.set_result, future.set_exception)
        self._link.wake()
        return future

    def wait(self, future: Future[_Result]) -> _Result:
        """Return the result of a request; raises what it raises, PortLost at the latest."""
        while True:
            try:
                return future.result(_GLANCE)
            except TimeoutError:
                if self._lost is not None and not future.done():
                    raise PortLost(self._lost) from None

    def close(self) -> None:
        """End what is under way and close the port; every request has ended after this."""
        self._link.stop()

    def _port_changed(self, state: PortState) -> None:
        if not state.is_open:
            self._lost = state.text


class Client(OpenLine):
    """
    The PLC at the other end of a line, or in half duplex the PLCs on it.

    ``port`` is a device path, ``socket://host:port`` or ``rfc2217://host:port``. ``duplex`` is
    full, or half with us as the master; ``station`` is the PLC that is meant where a call names
    no other, ``own_station`` our address. Without ``plc_type`` (SLC, PLC5, PLC3, PLC2) a PLC is
    asked what it is. ``timeout`` and ``cmd_timeout`` are seconds: for each answer, and for a
    reply. All calls block, may come from any thread, and raise RemoteError where the PLC refuses,
    LinkError where it does not answer (``sent`` tells whether it may have executed the command),
    and FormatError for what is wrong in the call.
    """

    def __init__(self, port: str, *, plc_type: str | None = None, station: int = 1,
                 duplex: str = 'full', baud: int = 9600, parity: str = 'None', check: str = 'CRC',
                 own_station: int = 0, processor: str | None = None, access: str | None = None,
                 timeout: float = 1.0, cmd_timeout: float = 1.0) -> None:
        self.station = _number('station', station)
        self._access = None if access is None else _choice(Access, access)
        self._kinds: dict[int, tuple[PlcType, Processor | None]] = {}
        self._kind: tuple[PlcType, Processor | None] | None = None
        if plc_type is not None:
            if (kind := PlcType(plc_type.upper())) not in FAMILIES:
                raise FormatError(f'plc_type {plc_type} should be one of '
                                  f'{", ".join(map(str, FAMILIES))}')
            self._kind = kind, None if processor is None else _choice(Processor, processor)
        elif processor is not None:
            raise FormatError('processor needs plc_type; without both the PLC is asked')
        if duplex not in _MODES or parity not in _PARITIES:
            raise FormatError(f'duplex {duplex} should be full or half, parity {parity} one of '
                              f'{", ".join(_PARITIES)}')
        settings = PortSettings(port, baud, parity=parity)
        super().__init__(LinkSettings(
            _MODES[duplex], _number('own_station', own_station), _choice(Checksum, check),
            LineTiming(settings.char_time), timeout=timeout, cmd_timeout=cmd_timeout), settings)

    @overload
    def read(self, address: str, length: None = None, kind: str | None = None, *,
             word_order: str = 'Low', station: int | None = None) -> float | str: ...

    @overload
    def read(self, address: str, length: int, kind: str | None = None, *,
             word_order: str = 'Low', station: int | None = None) -> list[float] | str: ...

    def read(self, address: str, length: int | None = None, kind: str | None = None, *,
             word_order: str = 'Low', station: int | None = None) -> float | str | list[float]:
        """
        Return the value at an address, or a list of ``length`` values from there on.

        ``kind`` is int16, uint16, int32, uint32, float32, bcd16 or string where the natural type
        of the file is not meant. Bits are bool; a string over words has ``length`` words.
        """
        number, target = self._target(
            address, 1 if length is None else length, kind, word_order, station)
        values = self.ask(number, steps.read(target))
        if isinstance(values, str):
            return values
        found = [*map(bool, values)] if target.codec.type is ValueType.BOOL else [*values]
        return found[0] if length is None else found

    def write(self, address: str, values: float | str | Sequence[float], kind: str | None = None,
              *, word_order: str = 'Low', station: int | None = None) -> None:
        """Write a value, or several from an address on; returns when the PLC has confirmed all."""
        if not isinstance(values, str | Sequence):
            values = [values]
        is_packed = isinstance(values, str) and kind is not None
        length = (len(values) + 1) // 2 if is_packed else \
            1 if isinstance(values, str) else len(values)
        number, target = self._target(address, length, kind, word_order, station)
        self.ask(number, steps.write(target, values))

    def identify(self, station: int | None = None) -> Identity:
        """Return what a station says of itself: model, mode, faults."""
        return self.ask(self._of(station), steps.identify())

    def _of(self, station: int | None) -> int:
        return self.station if station is None else _number('station', station)

    def _target(self, address: str, length: int, kind: str | None, word_order: str,
                station: int | None) -> tuple[int, AddressedValues]:
        number = self._of(station)
        plc_type, processor = self._kind or self._asked(number)
        return number, AddressedValues.of(
            address, plc_type, length, None if kind is None else _choice(ValueType, kind),
            word_order=_choice(WordOrder, word_order), access=self._access, processor=processor)

    def _asked(self, station: int) -> tuple[PlcType, Processor | None]:
        """Return the family of a station, which is asked once."""
        if station not in self._kinds:
            identity = self.identify(station)
            if identity.plc_type is None:
                raise FormatError(f'station {station} is "{identity}", and its family is not '
                                  'known; name plc_type')
            self._kinds[station] = identity.plc_type, identity.processor
        return self._kinds[station]


def _number(name: str, station: int) -> int:
    if not 0 <= station <= MAX_STATION:
        raise FormatError(f'{name} {station} should be a number from 0 to {MAX_STATION}')
    return station


def _choice(kinds: type[_Choice], text: str) -> _Choice:
    """Return the member of an enum with this value, in any letter case."""
    for member in kinds:
        if str(member.value).lower() == text.lower():
            return member
    raise FormatError(f'{text} should be one of {", ".join(str(m.value) for m in kinds)}')
