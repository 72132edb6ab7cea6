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

"""Two nodes on one line, a master and a slave, and a box between them that spoils it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path

from abdf1_ros.ports.descriptor import DescriptorPort
from std_msgs.msg import Int16MultiArray
from support.fault_box import FaultBox
from support.fault_rig import HeardNode
from support.ptys import Pty
from support.ros import Observer, Process, ros_args, values_in, write_csv
from support.simulator_process import NET_HEADER, OFTEN

STATIONS = {'Master': 5, 'Slave': 9}

# The master ends a transaction of its own before it passes a reply on, so a busy host needs more
# time than the usual Cmd_Timeout.
_NET_ROW = '2,2,2000,115200,200'

# DDS takes a killed process to be there for a while, so no name is used twice: what is said to
# the topics of the dead is lost.
_NUMBERS = count(1)


class LineBox(FaultBox):
    """
    A fault box between two nodes, with the slave where the node is and the master at the far end.

    So ``to_node`` leads to the slave, ``to_plc`` to the master. ``pass_on`` is called with the
    Mode of who speaks and what it says; what it returns is what the other one hears.
    """

    def __init__(self, far: Path, name: Path) -> None:
        super().__init__(far, name)
        self.pass_on: Callable[[str, bytes], bytes] = lambda mode, data: data

    def _take_from_node(self, data: bytes) -> None:
        super()._take_from_node(self.pass_on('Slave', data))

    def _tell_node(self, data: bytes) -> None:
        super()._tell_node(self.pass_on('Master', data))

    def _find_far(self) -> None:
        pty = Pty(Path(self._far_name))
        self._far = DescriptorPort(pty.fileno(), pty.close)


class End(HeardNode):
    """A node that serves the word ``ours``, and reads and writes the other end's as ``theirs``."""

    def __init__(self, observer: Observer, name: str, port: Path) -> None:
        super().__init__(observer, name, port, 'theirs', ours=Int16MultiArray,
                         theirs=Int16MultiArray)
        self.ours, self.theirs = self.values.values()
        self.asked = 0

    def ask(self, value: int) -> None:
        """Ask for a write to the other end."""
        self.publish(value)
        self.asked += 1

    def result(self) -> str:
        """Wait for the result of the last write; return its text."""
        self.observer.until(lambda: len(self.results) >= self.asked, 'the result of a write')
        return str(self.results[self.asked - 1].message)

    def write(self, value: int) -> str:
        """Write to the other end; return the text of the result."""
        self.ask(value)
        return self.result()

    def write_one_of(self, values: Iterator[int]) -> int | None:
        """Write the next value; return it if it is written, which a busy host may prevent."""
        value = next(values)
        return value if self.write(value) == 'written' else None

    def was_told(self, value: int) -> int:
        """Return how often the other end has written ``value`` here."""
        return [values_in(message) for message in self.ours].count([value])


@dataclass(slots=True)
class Line:
    """Both ends, the box between them, and all ends there have ever been."""

    observer: Observer
    folder: Path
    box: LineBox
    master: End = field(init=False)
    slave: End = field(init=False)
    ends: list[End] = field(default_factory=list)
    values: Iterator[int] = field(default_factory=lambda: count(1))

    def start(self, mode: str, *assignments: str) -> End:
        """Start a node, under a name that no node before it has had."""
        name = f'{mode.lower()}_{next(_NUMBERS)}'
        us, port = STATIONS[mode], self.folder / mode
        other, = set(STATIONS.values()) - {us}
        net = write_csv(self.folder / f'{mode}_net.csv', f'Mode,Station,PLC_Type,{NET_HEADER}',
                        [f'{mode},{us},SLC,{_NET_ROW}'])
        rows = write_csv(self.folder / f'{mode}_map.csv', 'Tag,Command,Address,Station,PLC_Type', [
            f'ours,Serve,N7:0,{us},SLC', f'theirs,ReadWrite,N7:0,{other},SLC'])
        end = End(self.observer, name, port)
        end.node = Process('node', *ros_args(
            f'net_file:={net}', f'map_file:={rows}', f'port:={port}', OFTEN,
            *assignments),
            '-r', f'__node:={name}')
        self.ends.append(end)
        return end

    def until_well(self) -> None:
        """Wait until each end reads the other."""
        self.master.until_well()
        self.slave.until_well()

    def recovers(self) -> None:
        """Wait for new values at both ends, and good diagnostics."""
        before = [(end, len(end.theirs)) for end in (self.master, self.slave)]
        self.clear()
        self.observer.until(
            lambda: all(len(end.theirs) > count for end, count in before), 'new values')
        self.until_well()
        self.clear()

    def clear(self) -> None:
        """Forget what the diagnostics have said."""
        for end in (self.master, self.slave):
            end.diagnostics.clear()

    def works(self) -> None:
        """Let each end write to the other."""
        for writer, reader in ((self.master, self.slave), (self.slave, self.master)):
            value = self.observer.until(partial(writer.write_one_of, self.values), 'a write')
            self.observer.until(partial(reader.was_told, value), 'what was written')
            assert reader.was_told(value) == 1

    def check(self) -> None:
        """Check what holds whatever happens: no result too many, no value from nowhere."""
        for end in self.ends:
            assert len(end.results) == end.asked, f'{end.name}: {end.results}'
        told = {values_in(message)[0] for end in self.ends for message in end.ours}
        assert {values_in(message)[0] for end in self.ends for message in end.theirs} <= {0, *told}


@contextmanager
def two_nodes(observer: Observer, folder: Path, *slave_assignments: str) -> Iterator[Line]:
    """Run box and nodes, all of them well when the block begins."""
    with LineBox(folder / 'Master', folder / 'Slave') as box:
        line = Line(observer, folder, box)
        try:
            line.master, line.slave = line.start('Master'), line.start('Slave', *slave_assignments)
            for end in (line.master, line.slave):  # two at a time may take long to start
                end.node.wait_for('[INFO]', ': open')
            line.until_well()
            yield line
            for end in (line.master, line.slave):
                end.node.end()
            line.check()
        except AssertionError:
            print(*(f'{end.name} has said:\n{end.node.text}' for end in line.ends), sep='\n')
            raise
        finally:
            for end in line.ends:
                end.node.__exit__()
                end.forget()
