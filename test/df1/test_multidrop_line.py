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

"""A master and three slaves on one noisy line where everybody hears everything and asks."""

from collections import Counter
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.sender import Sender
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.errors import CommandTimeout, LineReset, NeverTaken, StationInactive
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
import pytest
from support.cases import long_unless
from support.multidrop import CommandTasks, MasterNode, SlaveNode
from support.peers import CommandTask
from support.virtual_line import char_time, Noise, QUIET, VirtualLine

MASTER, SLAVES, ASKING = 5, (1, 2, 16), (1, 2)
BAUD = 19200
WORDS = 40
FAMILY = PlcType.SLC
DIALECT = dialect_of(FAMILY)
MODES = {
    'message': None,
    'single': PollingSettings(SLAVES),
    'multiple': PollingSettings((2, 16), priority=(1,), group_size=1, multiple=True),
    'in sequence': PollingSettings((1, MASTER, 2, 16), in_sequence=True)}
QUICK = long_unless(lambda mode: mode in ('message', 'multiple'), ((mode,) for mode in MODES))


class Rig:
    """All nodes and their line; each has words of its own."""

    def __init__(self, mode: str, *, noise: Noise = QUIET, seed: int = 1, chunk: int = 1,
                 checksum: Checksum = Checksum.CRC) -> None:
        self.random = Random(seed)
        self.tables = {number: DataTable(FAMILY) for number in (MASTER, *SLAVES)}
        for table in self.tables.values():
            table.create(parse_address('N7:0', FAMILY), WORDS)
        self.executed: Counter[tuple[int, int, int]] = Counter()
        self.replies: dict[tuple[int, int, int], Packet] = {}
        self.commands: dict[tuple[int, int, int], Packet] = {}
        timing = LineTiming(char_time(BAUD))
        settings = LinkSettings(station=MASTER, checksum=checksum, timeout=0.1, cmd_timeout=0.5)
        self.master = MasterNode(settings, self.clock, MODES[mode], numbers=SLAVES,
                                 serve=lambda command: self.serve(MASTER, command), timing=timing)
        self.slaves = {number: SlaveNode(
            LinkSettings(station=number, checksum=checksum, cmd_timeout=2.0, poll_timeout=5.0),
            self.clock, serve=lambda command, number=number: self.serve(number, command),
            timing=timing) for number in SLAVES}
        self.nodes: dict[int, MasterNode | SlaveNode] = {MASTER: self.master, **self.slaves}
        self.tns = dict.fromkeys(self.nodes, 0x0F00)
        self.line = VirtualLine(
            *(node.machine for node in self.nodes.values()), baud=BAUD, propagation=0.0005,
            chunk=chunk, noise=noise, seed=seed)
        self.line.start()

    def clock(self) -> float:
        return self.line.now if hasattr(self, 'line') else 0.0

    def serve(self, number: int, command: Packet) -> Packet:
        """Execute a command at a node, and remember it."""
        key = number, command.src, command.tns
        self.executed[key] += 1
        self.commands[key] = command
        self.replies[key] = Server(self.tables[number]).serve(command)
        return self.replies[key]

    def ask(self, src: int, dst: int) -> CommandTask:
        """Queue a random read or write from one node to another."""
        address = parse_address(f'N7:{self.random.randrange(WORDS - 12)}', FAMILY)
        words = self.random.randint(1, 12)
        cmd, body = DIALECT.read(address, words)
        if self.random.random() < 0.5:
            cmd, body = DIALECT.write(address, bytes(
                self.random.choice((0x00, 0x10, 0x55, 0xFF)) for _ in range(2 * words)))
        self.tns[src] = self.tns[src] + 1 & 0xFFFF
        node: CommandTasks = self.nodes[src]
        task = node.add(Packet(dst, src, cmd, 0, self.tns[src], body))
        if src == MASTER:
            self.line.wake(self.master.machine)
        return task

    def run(self, count: int) -> None:
        """Let the master and two slaves ask ``count`` times each, until all of it has ended."""
        for _ in range(count):
            for src in ASKING:
                self.ask(src, self.random.choice([dst for dst in self.nodes if dst != src]))
        for asked in range(10_000):
            if asked >= count and self.is_done():
                return
            # Message-based polling polls a slave only when it has something for it.
            task = self.ask(MASTER, SLAVES[asked % 3])
            self.line.run(lambda task=task: task.result is not None, 100.0)
        raise AssertionError('not everything ends')

    def is_done(self) -> bool:
        """Tell whether every command has its end."""
        return all(task.result is not None for node in self.nodes.values() for task in node.all)

    def results(self, src: int) -> list[CommandTask]:
        """Return the tasks of a node that have a good reply."""
        return [task for task in self.nodes[src].all
                if isinstance(task.result, Packet) and task.result.sts == 0]


def noise_of(rate: float) -> Noise:
    """Return noise of every kind."""
    return Noise(rate / 4, rate / 4, rate / 4, rate / 4)


def assert_exact(rig: Rig) -> None:
    """Check that nothing was executed twice, altered, or answered by anybody else."""
    assert set(rig.executed.values()) <= {1}
    sent = {(task.command.dst, src, task.command.tns): task.command
            for src, node in rig.nodes.items() for task in node.all}
    for key, command in rig.commands.items():
        assert sent[key] == command
    for src, node in rig.nodes.items():
        for task in node.all:
            key = task.command.dst, src, task.command.tns
            if not isinstance(task.result, Packet):
                known = (CommandTimeout | StationInactive if src == MASTER
                         else CommandTimeout | NeverTaken | LineReset)
                assert isinstance(task.result, known)
            elif task.result.sts == 2:  # the master could not pass it on, as far as it knows
                assert src in SLAVES and task.command.dst in SLAVES
                assert task.result == task.command.reply(sts=2)
            else:
                assert task.result == rig.replies[key]


def assert_recovers(rig: Rig) -> None:
    """Check that everybody reaches everybody when the line is quiet."""
    rig.line.noise = QUIET
    rig.line.chunks = [14] * len(rig.line.chunks)  # takes a third of the steps
    rig.line.run_for(4.0)  # what was under way comes to its end
    for number in SLAVES:  # message-based polling brings a station back by a command
        rig.ask(MASTER, number)
        rig.line.run_for(1.0)
        assert rig.master.stations[number].active
    for src in (MASTER, *ASKING):
        for dst in rig.nodes:
            if src != dst:
                task = rig.ask(src, dst)
                for _ in range(20):
                    if task.result is None:
                        rig.ask(MASTER, src if src != MASTER else dst)
                        rig.line.run_for(0.1)
                assert isinstance(task.result, Packet), (src, dst)
                assert task.result == rig.replies[dst, src, task.command.tns]
    rig.line.run(rig.is_done, 60.0)


@pytest.mark.parametrize('mode', MODES)
def test_reflexes_change_nothing_on_the_line(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    for react in Sender.react, lambda sender, reflex, symbol: None:
        monkeypatch.setattr(Sender, 'react', react)
        rig = Rig(mode, noise=noise_of(0.004), seed=3, chunk=8)
        rig.run(12)
        seen.append((rig.master.machine.sent, rig.master.counts(), rig.line.now))
    assert seen[0] == seen[1]


@pytest.mark.parametrize('mode, chunk', long_unless(
    lambda mode, chunk: mode == 'message' or chunk == 1,
    [*((mode, 14) for mode in MODES), ('multiple', 1)]))
def test_counters_of_all_ends_agree_on_a_clean_line(mode: str, chunk: int) -> None:
    rig = Rig(mode, chunk=chunk)
    rig.run(10)
    rig.line.run_for(2.0)
    assert_exact(rig)
    for src, node in rig.nodes.items():
        assert len(rig.results(src)) == len(node.all)
    ours = rig.master.machine.counters
    theirs = [slave.machine.counters for slave in rig.slaves.values()]
    total = {name: sum(getattr(counters, name) for counters in theirs)
             for name in type(ours).__slots__}
    for sent in ('messages', 'commands', 'replies', 'error_messages'):
        assert getattr(ours, f'{sent}_sent') == total[f'{sent}_received'], sent
        assert getattr(ours, f'{sent}_received') == total[f'{sent}_sent'], sent
    assert ours.acks_received == total['acks_sent']
    # An ACK names no station: a slave counts all that it has not sent (S0, counter 2536).
    on_the_line = ours.acks_sent + total['acks_sent']
    assert all(slave.acks_received == on_the_line - slave.acks_sent for slave in theirs)
    # The last poll, and the EOT to it, may be on their way.
    assert 0 <= total['eots_sent'] - ours.eots_received <= 1
    assert 0 <= ours.polls_sent - total['polls_received'] <= 1
    asked = sum(len(node.all) for node in rig.nodes.values())
    passed_on = sum(task.command.dst != MASTER for src in ASKING for task in rig.nodes[src].all)
    assert ours.commands_sent == len(rig.master.all) + passed_on
    assert sum(rig.executed.values()) == asked
    for counters in (ours, *theirs):
        assert not any((
            counters.naks_sent, counters.nak_retries, counters.enq_retries, counters.crc_errors,
            counters.stale_messages, counters.duplicate_messages, counters.invalid_messages,
            counters.command_timeouts, counters.nak_limit_exceeded, counters.enq_limit_exceeded))
    assert rig.master.changes == []
    assert_recovers(rig)


@pytest.mark.parametrize('mode', QUICK)
def test_noise_costs_time_but_no_result_is_wrong(mode: str) -> None:
    rig = Rig(mode, noise=noise_of(1e-2), seed=101, chunk=4)
    rig.run(15)
    assert_exact(rig)
    for src in (MASTER, *ASKING):
        assert len(rig.results(src)) >= 0.25 * len(rig.nodes[src].all)
    assert rig.master.machine.counters.enq_retries > 0
    assert_recovers(rig)
    assert_exact(rig)


@pytest.mark.parametrize('mode', QUICK)
def test_line_that_goes_and_comes_again(mode: str) -> None:
    rig = Rig(mode, chunk=14)
    rig.run(2)
    rig.line.noise = Noise(lost=1.0)
    rig.ask(1, 2)
    rig.ask(2, MASTER)
    rig.line.run_for(8.0)
    assert rig.is_done()  # by the poll timeout
    assert_exact(rig)
    assert_recovers(rig)
