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

"""The open line of ``plc``."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
import time
from typing import TypeVar

from abdf1_ros import open_line
from abdf1_ros.cli.terminal import NoPort, RED, tell
from abdf1_ros.df1.stations import ActiveStationList, MAX_STATION
from abdf1_ros.diagnosis.traces import Traces, traces_of
from abdf1_ros.driver.evidence import evidence_of
from abdf1_ros.errors import Abdf1Error, PortLost
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.ports.descriptor import Port, PortAround
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network
from abdf1_ros.sniffer.capture import Chunk, Direction

_Result = TypeVar('_Result')

# Most chunks that are kept to judge a line without an answer: hundreds of transactions.
_MOST_CHUNKS = 4000

complain = partial(tell, 'plc', code=RED)
"""Print a text about a failure on standard error."""


def opened(network: Network,
           around: Callable[[Port], Port] = lambda port: port) -> open_line.OpenedPort:
    """Open the port of ``network``, with a port ``around`` it; NoPort when that fails."""
    try:
        return open_line.OpenedPort(PortSettings.of(network), around)
    except OSError as error:
        raise NoPort(network.port, error) from None


class Witness:
    """The last ``chunks`` of bytes on a line; put it ``around`` each port of the line."""

    def __init__(self) -> None:
        self.chunks: deque[Chunk] = deque(maxlen=_MOST_CHUNKS)

    def around(self, port: Port) -> Port:
        """Return a port whose bytes are kept."""
        return _Witnessed(port, self.chunks)

    def traces(self, network: Network, stations: ActiveStationList, station: int, *,
               echoes: bool) -> Traces:
        """Return what the line has shown while a station was asked."""
        evidence = evidence_of(network.line_mode, stations, station)
        asked = Traces(
            network.line_mode, network.checksum, network.station, station, evidence.gateway,
            other_number=evidence.other_number, is_acknowledged=evidence.is_only_acknowledged,
            is_garbled=evidence.fault is not None)
        return traces_of([*self.chunks], asked, network.cmd_timeout / 1000, echoes=echoes)


class _Witnessed(PortAround):
    """A port whose bytes go into ``chunks``."""

    def __init__(self, port: Port, chunks: deque[Chunk]) -> None:
        super().__init__(port)
        self._chunks = chunks

    def read(self, timeout: float | None, wake: int) -> bytes:
        data = super().read(timeout, wake)
        if data:
            self._chunks.append(Chunk(time.monotonic(), Direction.IN, data))
        return data

    def write(self, data: bytes) -> None:
        self._chunks.append(Chunk(time.monotonic(), Direction.OUT, data))  # before its answer
        super().write(data)


class Session(open_line.OpenLine):
    """
    The line of a net CSV; with ``via`` all other stations are behind this gateway.

    - ``routes``: the gateways of single stations.
    - ``said``: advice given so far.
    - ``silent``: the first station that gave no reply to a command, None for none.
    - ``witness``: the bytes of the line; a given witness has bytes of earlier sessions too.

    Raises NoPort when the port cannot be opened.
    """

    def __init__(self, network: Network, absent: Sequence[int] = (), via: int | None = None,
                 record: str | None = None, routes: Mapping[int, int] | None = None,
                 witness: Witness | None = None) -> None:
        self.network = network
        self.via = via
        self.said: set[str] = set()
        self.silent: int | None = None
        self.witness = witness or Witness()
        self._echoed = False
        through = {} if via is None else dict.fromkeys(range(MAX_STATION + 1), via)
        stations = ActiveStationList(absent, routes={**through, **(routes or {})})
        for number in absent:
            stations.lost(number, 0.0)
        try:
            super().__init__(network.line_mode, network.line, PortSettings.of(network), stations,
                             PlcType(network.plc_type), record, around=self.witness.around)
        except OSError as error:
            raise NoPort(network.port, error) from None

    def attempt(self, station: int,
                work: Steps[_Result]) -> tuple[_Result | None, Abdf1Error | None]:
        """Carry out a request; return its result or its error. Raises PortLost."""
        try:
            return self.ask(station, work), None
        except PortLost:
            raise
        except Abdf1Error as error:
            return None, error

    def close(self) -> None:
        """End all requests, and close the port."""
        self._echoed |= self.echoes  # the end of the port forgets it
        super().close()

    def traces(self, station: int) -> Traces:
        """Return what the line has shown while a station was asked."""
        return self.witness.traces(
            self.network, self.stations, station, echoes=self.echoes or self._echoed)
