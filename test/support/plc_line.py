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

"""A pseudo-terminal with simulated PLCs at its other end, in this process."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.ports.endpoints import PtyEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.simulated_plc import SimulatedPlc


@contextmanager
def plc_line(path: Path, *plcs: SimulatedPlc) -> Iterator[str]:
    """Put PLCs on a half-duplex line with CRC; yield the name of its port."""
    line = PtyEndpoint(str(path))
    stations = stations_of(plcs, Checksum.CRC)
    link = LinkThread(Machine(multidrop(stations), checksum=Checksum.CRC), line.open)
    link.start()
    try:
        yield line.name
    finally:
        link.stop()
        line.close()
