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
A node in a process of its own, for benchmarks: its files, its line, and what it uses.

``rows`` lays out a map of one-word rows of one SLC: the words of a file side by side, a hundred
to a file, so that the rows of a file are read together. ``running_node`` starts the node on a
pseudo-terminal; everything stays on this machine, in a domain of its own.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import sys
import tempfile
import time

_OURS = [*map(str, Path(__file__).resolve().parents[1:4])]
sys.path[:0] = _OURS
os.environ['PYTHONPATH'] = os.pathsep.join(_OURS)  # also of the processes that are measured

from abdf1_ros.df1.machine import Machine  # noqa: E402
from abdf1_ros.settings.map_file import load_mappings  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from paced_line import far_end  # noqa: E402
from support.ros import Process, ros_args, write_csv  # noqa: E402

STATION = 1
IN_A_FILE = 100
_FIRST_FILE = 10
_TICK = os.sysconf('SC_CLK_TCK')


def rows(count: int, period: int) -> list[str]:
    """Return so many rows of a map file, each of one word."""
    return [f'w{number},Read,N{_FIRST_FILE + number // IN_A_FILE}:{number % IN_A_FILE},'
            f'{STATION},SLC,{period}' for number in range(count)]


class Running:
    """
    A node that runs.

    ``start_time`` is the seconds from the start of its process to the port being open, when
    everything is ready.
    """

    def __init__(self, process: Process, start_time: float) -> None:
        self.process = process
        self.start_time = start_time

    def used(self) -> float:
        """Return the processor time (s) of all its threads up to now."""
        fields = self._read('stat').rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICK

    def memory(self) -> float:
        """Return how many MiB it has resident."""
        line, = (line for line in self._read('status').splitlines() if line.startswith('VmRSS'))
        return int(line.split()[1]) / 1024

    def _read(self, name: str) -> str:
        return Path('/proc', str(self.process.number), name).read_text()


@contextmanager
def files(map_rows: Sequence[str], baud: int) -> Iterator[tuple[Path, Path, list[Mapping]]]:
    """Write both files; give their paths and the mappings."""
    with tempfile.TemporaryDirectory(prefix='abdf1_bench_') as folder:
        net, table = Path(folder, 'net.csv'), Path(folder, 'map.csv')
        write_csv(net, 'Baud,Timeout', [f'{baud},2000'])
        write_csv(table, 'Tag,Command,Address,Station,PLC_Type,Period', map_rows)
        mappings, problems = load_mappings(str(table))
        assert not problems, problems
        yield net, table, mappings


def plc_of(mappings: Sequence[Mapping]) -> Machine:
    """Return the PLC that has all these words."""
    return far_end(Network(), STATION, mappings)


@contextmanager
def running_node(net: Path, table: Path, port: str) -> Iterator[Running]:
    """Run the node on ``port``, from the moment it has opened it."""
    begun = time.monotonic()
    with Process('node', *ros_args(f'net_file:={net}', f'map_file:={table}',
                                   f'port:={port}')) as process:
        process.wait_for(f'{port}: open')
        yield Running(process, time.monotonic() - begun)
