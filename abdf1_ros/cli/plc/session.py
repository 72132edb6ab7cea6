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

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TypeVar

from abdf1_ros import open_line
from abdf1_ros.cli.terminal import NoPort, RED, tell
from abdf1_ros.df1.stations import ActiveStationList, MAX_STATION
from abdf1_ros.errors import Abdf1Error, PortLost
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network

_Result = TypeVar('_Result')

complain = partial(tell, 'plc', code=RED)
"""Print a text about a failure on standard error."""


def opened(network: Network) -> open_line.OpenedPort:
    """Open the port of ``network``; NoPort when that fails."""
    try:
        return open_line.OpenedPort(PortSettings.of(network))
    except OSError as error:
        raise NoPort(network.port, error) from None


class Session(open_line.OpenLine):
    """
    The line of a net CSV; with ``via`` all other stations are behind this gateway.

    - ``routes``: the gateways of single stations.
    - ``said``: advice given so far.
    - ``is_silent``: True if a command had no reply.

    Raises NoPort when the port cannot be opened.
    """

    def __init__(self, network: Network, absent: Sequence[int] = (), via: int | None = None,
                 record: str | None = None, routes: Mapping[int, int] | None = None) -> None:
        self.network = network
        self.via = via
        self.said: set[str] = set()
        self.is_silent = False
        through = {} if via is None else dict.fromkeys(range(MAX_STATION + 1), via)
        stations = ActiveStationList(absent, routes={**through, **(routes or {})})
        for number in absent:
            stations.lost(number, 0.0)
        try:
            super().__init__(network.line_mode, network.line, PortSettings.of(network), stations,
                             PlcType(network.plc_type), record)
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
