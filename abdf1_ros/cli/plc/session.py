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

"""An open line on which one request is carried out after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
import random
from types import TracebackType
from typing import TypeVar

from abdf1_ros.cli.terminal import reason_of
from abdf1_ros.counters import Counters
from abdf1_ros.df1.stations import ActiveStationList, MAX_STATION
from abdf1_ros.driver.job_tasks import Steps
from abdf1_ros.driver.requests import Requests
from abdf1_ros.errors import PortLost
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread, PortState
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network

# While waiting, check so often (s) that the port is still open.
_GLANCE = 0.2

_Result = TypeVar('_Result')


def opened(network: Network) -> Callable[[], Port]:
    """
    Open the port of ``network``; return a function that returns it, and later opens it again.

    So a port that does not exist is an OSError here, not a state of a thread.
    """
    settings = PortSettings.of(network)
    try:
        ports = [open_port(settings)]
    except OSError as error:
        raise OSError(reason_of(network.port, error)) from None
    return lambda: ports.pop() if ports else open_port(settings)


class Session:
    """
    A line from opening its port to the end of a ``with`` block.

    ``absent`` stations get one try. With ``via`` all stations are behind this gateway. Raises
    OSError when the port cannot be opened.
    """

    def __init__(self, network: Network, absent: Sequence[int] = (),
                 via: int | None = None) -> None:
        routes = {} if via is None else dict.fromkeys(range(MAX_STATION + 1), via)
        self.network = network
        self._lost: str | None = None
        self._requests = Requests(network, absent, random.randrange(0x10000), routes)
        self._link = LinkThread(
            self._requests.machine, opened(network), on_state=self._port_changed)
        self._link.start()

    def __enter__(self) -> Session:
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

    def ask(self, station: int, steps: Steps[_Result]) -> _Result:
        """Carry out a request and return its result; raises what its steps raise."""
        return self.wait(self.start(station, steps))

    def start(self, station: int, steps: Steps[_Result],
              future: Future[_Result] | None = None) -> Future[_Result]:
        """Begin to carry out a request; ``future`` is where its result goes."""
        future = future or Future()
        self._requests.add(station, steps, future.set_result, future.set_exception)
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
