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

"""An open line: requests of one program, each with its result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import logging
from numbers import Real
import os
from queue import Empty, SimpleQueue
import random
import sys
from threading import current_thread
import time
from types import TracebackType
from typing import Any, cast, Generic, NoReturn, Self, TYPE_CHECKING, TypeAlias, TypeVar
import warnings

from abdf1_ros.counters import Counters
from abdf1_ros.df1.frames import Duplex, MAX_LINK_DATA
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import is_local_status
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.requests import Requests
from abdf1_ros.errors import Abdf1Error, FormatError, PortLost, RemoteError, StationInactive
from abdf1_ros.messages import Event, Severity
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import STS_ILLEGAL_COMMAND
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import name_port, open_port
from abdf1_ros.ports.ownership import line_of
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.text import counted, shown

if TYPE_CHECKING:
    from abdf1_ros.plan.line_model import LineModel
    from abdf1_ros.ports.trace import Trace

_GLANCE = 0.2  # s; interval of the checks whether the thread of the link still runs

LOG = logging.getLogger('abdf1_ros')
"""
The default logger. It gets requests with their times, and the events of the line. A thread that
makes a request logs these events: during this request, during the next request, or in ``close``.
"""

# Most events on the line that are kept between two requests.
MOST_ENTRIES = 1000

PlcValue: TypeAlias = Any
"""A bool, int, float or str, or a list of them: the address decides."""

_Entry = tuple[int, object, BaseException | None]

_Result = TypeVar('_Result')


class OpenedPort:
    """
    A port that is open: a call returns it, and each later call opens it again.

    So a port that does not exist raises OSError here, and not in the thread of the link. If
    another thread of this program has the port, its ``close`` is waited for. ``around`` may put a
    port around it.
    """

    def __init__(self, settings: PortSettings,
                 around: Callable[[Port], Port] = lambda port: port) -> None:
        self._settings, self._around = settings, around
        line = line_of(settings.name)
        while True:
            holder = _ours.get(line)  # before the attempt, so that no end is missed
            try:
                self._ports = [open_port(settings)]
                return
            except OSError as error:
                if holder is not None and holder.has_ended_elsewhere():
                    continue
                if line in _ours:
                    error.strerror = 'this program has it open already; is a close() missing?'
                name_port(error, settings.name)
                raise

    def __call__(self) -> Port:
        return self._around(self._ports.pop() if self._ports else open_port(self._settings))

    def close(self) -> None:
        """Close the port if no call has taken it."""
        while self._ports:
            self._ports.pop().close()


class Pending(Generic[_Result]):
    """
    The result of a request, set by the thread of the link.

    It is not a Future. If a KeyboardInterrupt comes between the lock of a Future and its ``with``
    block, the lock is never released. The thread of the link would then never end.
    """

    def __init__(self) -> None:
        self.error: Exception | None = None
        self._results: list[_Result] = []
        self._ended: SimpleQueue[None] = SimpleQueue()

    @property
    def is_done(self) -> bool:
        """Tell whether the request has ended."""
        return self.error is not None or bool(self._results)

    def succeed(self, result: _Result) -> None:
        """End the request with its result."""
        self._results.append(result)
        self._ended.put(None)

    def fail(self, error: Exception) -> None:
        """End the request with an error."""
        self.error = error
        self._ended.put(None)

    def wait(self, seconds: float) -> bool:
        """Wait for the end, at most for ``seconds``; return True if the request has ended."""
        if not self.is_done:
            with suppress(Empty):
                self._ended.get(timeout=seconds)
        return self.is_done

    def result(self) -> _Result:
        """Return the result of a request that has ended; raises its error."""
        if self.error is not None:
            raise self.error
        return self._results[0]


class Holder:
    """
    The thread that has a line open; during ``close`` it is the thread that closes the line.

    ``longest`` returns the time (s) of the longest transaction on the line.
    """

    def __init__(self, longest: Callable[[], float]) -> None:
        self.thread = current_thread()
        self.end = Pending[None]()
        self._longest = longest

    def has_ended_elsewhere(self) -> bool:
        """Wait for the end by another thread, at most for a transaction; tell if it has come."""
        if self.thread is not current_thread():
            give_up = time.monotonic() + self._longest()
            while not self.end.wait(_GLANCE) and time.monotonic() < give_up:
                pass
        return self.end.is_done


_ours: dict[str, Holder] = {}  # by line, what this program has open


class _Closes(ABC):
    """Something that the end of ``with`` closes."""

    __slots__ = ()

    @abstractmethod
    def close(self) -> None:
        """Close it."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


class OpenLine(_Closes):
    """
    An open line, which carries out one request at a time; the end of ``with`` closes it.

    ``stations`` has the state of each station, and the gateway if the station is behind one. An
    inactive station gets only one try for each request until it answers. To a PLC that asks for
    our identity we report a ``plc_type``. ``counters`` counts the events of the whole line. All
    bytes are written to the file ``trace``, for ``sniff``; ``around`` may put a port around ours.
    Raises OSError if the port cannot be opened, and ConfigurationError if the file cannot be
    written or the mode only listens.
    """

    is_open = False

    def __init__(self, mode: LineMode, line: LinkSettings, port: PortSettings,
                 stations: ActiveStationList | None = None, plc_type: PlcType = PlcType.PLC5,
                 trace: str | None = None, logger: logging.Logger = LOG,
                 around: Callable[[Port], Port] = lambda port: port) -> None:
        if mode.only_listens:
            raise ConfigurationError([Problem('Mode', (
                f'in Mode {mode.name} nothing may be sent on this line; "plc log" has its '
                'values, "sniff" its traffic'))])
        self.log = logger_of(logger)
        self._process = os.getpid()
        self.port_name, self._port_settings = port.name, port
        self._entries: deque[_Entry] = deque()
        self._lost = self._lost_reported = 0  # entries
        self._mode, self._settings = mode, line
        self.stations = ActiveStationList() if stations is None else stations
        self._requests = Requests(mode, line, self.stations, random.randrange(0x10000), plc_type,
                                  self._told, may_store='://' in port.name)
        self.counters = self._requests.counters
        self._trace: Trace | None = None
        self._port = OpenedPort(port, around)
        port_of: Callable[[], Port] = self._port
        if trace is not None:
            port_of, self._trace = traced(
                trace, port, line.checksum.value, mode.duplex, port_of, self.log.error)
        self._link = LinkThread(self._requests.machine, port_of,
                                on_fault=lambda error: self._note(
                                    logging.CRITICAL, 'internal error', error))
        self._link.daemon = True  # after a KeyboardInterrupt before ``with`` no code stops it
        self._line = line_of(port.name)
        self._holder = _ours[self._line] = Holder(lambda: mode.longest_transaction(
            line, self.line_model.transaction_time(MAX_LINK_DATA, MAX_LINK_DATA)))
        self._link.start()
        self.is_open = True

    @property
    def state(self) -> str:
        """Return what the port is doing, or why it is not open."""
        if os.getpid() != self._process:
            return 'another process has opened it; each process needs a client of its own'
        if sys.is_finalizing():
            return 'this program ends'
        return self._link.state.text

    @property
    def echoes(self) -> bool:
        """Tell whether the line echoes the bytes that we send."""
        return self._requests.machine.echoes

    @property
    def stray(self) -> str:
        """Return the last reply that answers no command, empty if there was none."""
        return self._requests.stray

    def settle(self) -> None:
        """Wait until the link accepts commands: at first a peer only listens; raises PortLost."""
        self.ask(0, _nothing())

    def ask(self, station: int, work: Steps[_Result]) -> _Result:
        """Carry out a request and return its result; raises what its steps raise."""
        return self.wait(self.start(station, work))

    def start(self, station: int, work: Steps[_Result],
              pending: Pending[_Result] | None = None) -> Pending[_Result]:
        """Begin to carry out a request; ``pending`` gets its result."""
        if os.getpid() != self._process:
            raise PortLost(self.state, sent=False)
        pending = pending or Pending()
        self._requests.add(station, work, pending.succeed, pending.fail)
        self._link.wake()
        return pending

    def wait(self, pending: Pending[_Result]) -> _Result:
        """Return the result of a request; raises its error, or PortLost if the link has ended."""
        while not pending.wait(_GLANCE):
            self._log_entries()
            if not self._link.is_alive() and not pending.is_done:
                raise PortLost(self.state)
        self._log_entries()
        return pending.result()

    def close(self) -> None:
        """End all requests, also waiting ones, and close the port."""
        self.is_open = False
        self._holder.thread = current_thread()
        self._link.stop()
        self._port.close()  # the thread may not have come to it
        self._requests.close()
        self._log_entries()
        if self._trace is not None:
            self._trace.close()
        if _ours.get(self._line) is self._holder:
            del _ours[self._line]
        self._holder.end.succeed(None)

    @property
    def unheard(self) -> str:
        """Return the settings as a remark if nothing that fits has come, or else nothing."""
        counts = self.counters
        if counts.messages_received or counts.acks_received or counts.naks_received \
                or counts.eots_received:
            return ''
        port = self._port_settings
        return (f'; nothing that fits has come in {self._mode.duplex.value} at '
                f'{port.baud} baud, parity {port.parity}, check {self._settings.checksum.value}: '
                '"plc detect" finds the settings of a line')

    @property
    def line_model(self) -> LineModel:
        """Return the model of the times of transactions on this line."""
        from abdf1_ros.plan.line_model import LineModel  # only a plan needs it
        return LineModel(self._settings.checksum, self._mode.duplex, self._settings.timing,
                         self._mode.pause(self._settings))

    @contextmanager
    def naming(self, place: str, asks: bool = True) -> Iterator[None]:
        """Add ``place`` to errors of the block; if it ``asks`` a station, log the time it took."""
        begun = time.monotonic()
        try:
            yield
        except Abdf1Error as error:
            error.about = error.about or place
            self.log.debug('%s', error)
            raise
        if asks:
            self.log.debug('%s: %.1f ms', place, (time.monotonic() - begun) * 1000)

    def _told(self, event: Event) -> None:
        is_error = event.message.severity is not Severity.NOTICE
        self._note(logging.INFO if is_error else logging.DEBUG, event)

    def _note(self, level: int, text: object, error: BaseException | None = None) -> None:
        """Keep a log entry for later: a handler may wait for a disk or pipe, the link must not."""
        if not self.log.isEnabledFor(level):
            return
        if len(self._entries) < MOST_ENTRIES:
            self._entries.append((level, text, error))
        else:
            self._lost += 1

    def _log_entries(self) -> None:
        """Log the entries that the link has kept; only threads that make requests call this."""
        with suppress(IndexError):  # another thread may remove the last entry
            while self._entries:
                level, text, error = self._entries.popleft()
                self.log.log(level, '%s', text, exc_info=error)
        if lost := self._lost - self._lost_reported:
            self._lost_reported += lost
            self.log.warning('%s lost here: nothing was asked meanwhile', counted(lost, 'entry'))


class BlockingClient(_Closes):
    """What all clients have: their line, with the state of its stations, and its end."""

    __slots__ = '__dict__', '__weakref__', '_line'

    def __init__(self, line: OpenLine) -> None:
        self._line = line

    @contextmanager
    def _naming(self, place: str, asks: bool = True) -> Iterator[None]:
        """Add ``place`` to errors of the block, and the settings while nothing fits them."""
        with self._line.naming(place, asks):
            try:
                yield
            except StationInactive as error:
                error.hint = self._line.unheard
                raise

    if not TYPE_CHECKING:  # with it mypy would let all names pass

        def __setattr__(self, name: str, value: object) -> None:
            """Refuse what would have no effect, as ``client.timeout = 5``; tests may patch."""
            is_ours = type(self).__module__.startswith(f'{__package__}.')
            if is_ours and not hasattr(type(self), name):
                raise AttributeError(f'a {type(self).__name__} has no {name} that can be set; '
                                     'give settings when you make it')
            super().__setattr__(name, value)

    def __repr__(self) -> str:
        state = self._line.state if self._line.is_open else 'closed'
        return f'<{type(self).__name__} of {self._line.port_name}: {state}>'

    def __reduce__(self) -> NoReturn:
        raise TypeError(f'a {type(self).__name__} cannot be pickled or copied, because it has the '
                        'port; each process needs a client of its own')

    def __del__(self) -> None:
        if hasattr(self, '_line') and self._line.is_open:
            warnings.warn(f'unclosed {self!r}', ResourceWarning,
                          stacklevel=2, source=self)

    @property
    def counters(self) -> Counters:
        """Return the counts of all events of the line since it was opened."""
        return self._line.counters

    @property
    def stations(self) -> ActiveStationList:
        """Return the state of each station; an inactive one gets one try for each request."""
        return self._line.stations

    def close(self) -> None:
        """End all calls, also waiting ones, and close the port; may come from any thread."""
        self._line.close()


def traced(path: str, port: PortSettings, check: str, duplex: Duplex, open_it: Callable[[], Port],
           on_error: Callable[[str], None]) -> tuple[Callable[[], Port], Trace]:
    """
    Begin a trace; return it after a function that opens the port and records its bytes.

    Raises ConfigurationError if the file cannot be written.
    """
    from abdf1_ros.ports.trace import begun_now, Trace, TracedPort
    try:
        trace = Trace(path, {'begun': begun_now(), 'port': port.name, 'baud': str(port.baud),
                             'check': check, 'duplex': duplex.name.lower()}, on_error)
    except OSError as error:
        open_it().close()  # it was open already
        raise ConfigurationError([Problem(
            error.filename or path, error.strerror or str(error))]) from None
    begun = time.monotonic()
    return lambda: TracedPort(open_it(), trace, begun), trace


def kind_of(identify: Callable[[], Identity], cure: str,
            subject: str = '') -> tuple[PlcType, Processor | None]:
    """
    Return family and processor of a station, from its own identity.

    Raises FormatError, about the ``subject`` and with a ``cure``, if the family is unknown, and
    RemoteError if the station refuses for a reason that may hold for all commands.
    """
    try:
        identity = identify()
    except RemoteError as error:
        if is_local_status(error.sts):
            raise
        if error.sts != STS_ILLEGAL_COMMAND:
            raise RemoteError(error.sts, error.ext_sts, (
                f'{subject}does not identify itself: {error}. If this holds for no other command, '
                f'{cure}')) from None
        raise FormatError(f'{subject}does not identify itself (STS {error.sts:02X} to the '
                          f'question); {cure}') from None
    if identity.plc_type is None:
        raise FormatError(f'{subject}is "{identity}", and its family is not known; {cure}')
    return identity.plc_type, identity.processor


def _nothing() -> Steps[None]:
    yield from ()


def single(values: list[float] | str, is_one: bool) -> float | str | list[float]:
    """Return the value itself if only one value was asked for."""
    return values[0] if is_one and not isinstance(values, str) else values


def plain(values: Values, kind: ValueType) -> list[float] | str:
    """Return values as a list (bits as bool) or a str, for programs without arrays."""
    if isinstance(values, str):
        return values
    return [*map(bool, values)] if kind is ValueType.BOOL else [*values]


def values_of(values: object) -> Sequence[float] | str:
    """Return the values to write; arrays and numbers of numpy become Python's."""
    found = values.tolist() if hasattr(values, 'tolist') else values
    found = [found] if isinstance(found, Real) else found
    if isinstance(found, str) or (
            isinstance(found, Sequence) and found and not isinstance(found, bytes | bytearray)
            and all(isinstance(value, Real) for value in found)):
        return found
    raise FormatError(f'{shown(repr(values))} should be a number (int, float, bool), a list of '
                      'numbers, or a text (str)')


def logger_of(value: object) -> logging.Logger:
    if not isinstance(value, logging.Logger | logging.LoggerAdapter):
        name = repr(value) if isinstance(value, str) else ''
        raise FormatError(f'logger {shown(repr(value))} should be a logging.Logger, as from '
                          f'logging.getLogger({name})')
    return cast(logging.Logger, value)


def path_of(name: str, value: object) -> str:
    return text_of(name, os.fspath(value) if isinstance(value, os.PathLike) else value)


def text_of(name: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        end = ', and is empty' if value == '' else ''
        raise FormatError(f'{name} {shown(repr(value))} should be a text{end}')
    return value
