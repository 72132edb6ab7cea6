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

"""Master against slaves on a virtual line, clean and noisy, with invariants."""

from collections import Counter
from dataclasses import dataclass, field
from random import Random

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure, Rest
from abdf1_ros.df1.master import HalfDuplexMaster
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.errors import CommandTimeout, LinkError, StationInactive
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
import pytest
from support.peers import CommandTask
from support.virtual_line import char_time, Noise, QUIET, VirtualLine

MASTER = 5
FAMILIES = {1: PlcType.PLC5, 16: PlcType.PLC5, 2: PlcType.SLC, 254: PlcType.SLC}
WORDS = 60
BAUD = 19200
# Longest message on the line, stuffed to the last byte, and the longest pause inside it.
LONGEST = 2 * 270 * char_time(BAUD) + 20 * char_time(BAUD) + 0.1


class Plc:
    """A station on the line, which remembers every command it has executed."""

    def __init__(self, number: int, checksum: Checksum) -> None:
        family = FAMILIES[number]
        self.table = DataTable(family)
        self.table.create(parse_address('N7:0', family), WORDS)
        self.executed: Counter[int] = Counter()
        self.commands: dict[int, Packet] = {}
        self.replies: dict[int, Packet] = {}
        self.slave = HalfDuplexSlave(LinkSettings(station=number, checksum=checksum), self._serve)
        self._server = Server(self.table)

    def _serve(self, command: Packet) -> Packet:
        reply = self._server.serve(command)
        self.executed[command.tns] += 1
        self.commands[command.tns] = command
        self.replies[command.tns] = reply
        return reply


@dataclass(slots=True)
class Outcome:
    """What became of one exchange."""

    command: Packet
    result: Packet | LinkError
    seconds: float
    was_active: bool


@dataclass
class Rig:
    """A master, its stations and the line between them."""

    checksum: Checksum = Checksum.CRC
    seed: int = 1
    timing: LineTiming = LineTiming(char_time(BAUD))
    propagation: float = 0.001
    chunk: int = 1
    settings: LinkSettings = field(init=False)
    outcomes: list[Outcome] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.settings = LinkSettings(
            station=MASTER, checksum=self.checksum, nak_retries=3, enq_retries=3, timeout=0.1,
            cmd_timeout=0.5,
            poll_pause=0.005)
        self.plcs = {number: Plc(number, self.checksum) for number in FAMILIES}
        self.stations = ActiveStationList(FAMILIES)
        self.machine = Machine(self._procedure, checksum=self.checksum, timing=self.timing,
                               forget_on_send=True)
        self.master = HalfDuplexMaster(self.machine, self.settings, self.stations)
        self.slaves = Machine(multidrop([plc.slave for plc in self.plcs.values()]),
                              checksum=self.checksum)
        self.line = VirtualLine(self.machine, self.slaves, baud=BAUD, seed=self.seed,
                                propagation=self.propagation, chunk=self.chunk)
        self.random = Random(self.seed)
        self._tns = 0x0F00
        self._command: Packet | None = None
        self._done = False
        self.line.start()

    def _procedure(self, machine: Machine) -> Procedure:
        while True:
            if self._command is not None:
                command, self._command = self._command, None
                started, was_active = machine.now, self.stations[command.dst].active
                task = CommandTask(command, lambda: machine.now)
                yield from self.master.carry_out(task)
                assert task.result is not None
                result = task.result
                self.outcomes.append(Outcome(command, result, machine.now - started, was_active))
                self._done = True
            yield Rest()

    def exchange(self, number: int, request: Request) -> Outcome:
        """Carry out one transaction and return what became of it."""
        cmd, data = request
        self._tns = self._tns + 1 & 0xFFFF
        self._command = Packet(number, MASTER, cmd, 0, self._tns, data)
        self._done = False
        self.line.wake(self.machine)
        self.line.run(lambda: self._done, limit=60.0)
        return self.outcomes[-1]

    def random_exchange(self) -> Outcome:
        """Read, write or modify some words of some station."""
        number = self.random.choice(list(FAMILIES))
        family = FAMILIES[number]
        dialect = dialect_of(family)
        address = parse_address(f'N7:{self.random.randrange(WORDS - 20)}', family)
        words = self.random.randint(1, 20)
        kind = self.random.randrange(3)
        if kind == 0:
            return self.exchange(number, dialect.read(address, words))
        if kind == 1:
            data = bytes(self.random.choice((0x00, 0x10, 0x55, 0xFF)) for _ in range(2 * words))
            return self.exchange(number, dialect.write(address, data))
        mask, bits = self.random.getrandbits(16), self.random.getrandbits(16)
        return self.exchange(number, dialect.write_bits(address, mask, bits))

    def settle(self) -> None:
        """Let the last bytes arrive."""
        self.line.run_for(1.0)

    def bound(self) -> float:
        """Return the longest time that a transaction may take, by the rule of the master."""
        settings = self.settings
        waits = 1 + settings.nak_retries + 1 + settings.enq_retries + 1
        return waits * (settings.timeout + LONGEST) + settings.cmd_timeout + LONGEST


def assert_exact(rig: Rig) -> None:
    """Check that every reply is that of its station, and no command was run twice or damaged."""
    sent = {outcome.command.tns: outcome.command for outcome in rig.outcomes}
    for number, plc in rig.plcs.items():
        assert set(plc.executed.values()) <= {1}
        for tns, command in plc.commands.items():
            assert command == sent[tns]
            assert command.dst == number
    for outcome in rig.outcomes:
        if isinstance(outcome.result, Packet):
            assert outcome.result == rig.plcs[outcome.command.dst].replies[outcome.command.tns]


def assert_recovers(rig: Rig) -> None:
    """Check that the very next exchange with each station succeeds on a line gone quiet."""
    rig.settle()
    rig.line.noise = QUIET
    for number, family in FAMILIES.items():
        was_active = rig.stations[number].active
        address = parse_address('N7:0', family)
        outcome = rig.exchange(number, dialect_of(family).read(address, 20))
        assert isinstance(outcome.result, Packet), f'station {number}, active: {was_active}'
        data = dialect_of(family).read_data(address, 20, outcome.result.data)
        assert data == rig.plcs[number].table.read(address, 20)
        assert rig.stations[number].active


@pytest.mark.parametrize('checksum', Checksum)
@pytest.mark.parametrize('chunk', [1, 14])
def test_counters_of_both_ends_agree_on_a_clean_line(checksum: Checksum, chunk: int) -> None:
    rig = Rig(checksum, chunk=chunk)
    for _ in range(300):
        assert isinstance(rig.random_exchange().result, Packet)
    rig.settle()
    ours = rig.machine.counters
    theirs = Counters()
    for plc in rig.plcs.values():
        for name in Counters.__slots__:
            count = getattr(plc.slave.counters, name)
            setattr(theirs, name, getattr(theirs, name) + count)
    assert ours.messages_sent == theirs.messages_received == 300
    assert ours.messages_received == theirs.messages_sent == 300
    assert ours.commands_sent == theirs.commands_received == 300
    assert ours.replies_received == theirs.replies_sent == 300
    assert ours.polls_sent == theirs.polls_received == 300
    assert ours.acks_sent == theirs.acks_received == 300
    assert ours.acks_received == theirs.acks_sent == 300
    assert ours.eots_received == theirs.eots_sent == 0
    assert ours.chars_sent == rig.slaves.counters.chars_received > 0
    assert ours.chars_received == rig.slaves.counters.chars_sent > 0
    for counters in (ours, theirs):
        assert sum((counters.naks_sent, counters.nak_retries, counters.enq_retries,
                    counters.crc_errors, counters.bcc_errors, counters.stale_messages,
                    counters.duplicate_messages, counters.invalid_messages,
                    counters.command_timeouts, counters.error_messages_received)) == 0
    assert_exact(rig)


def test_clean_exchange_takes_the_time_of_its_characters() -> None:
    rig = Rig(propagation=0.0)
    command = dialect_of(PlcType.SLC).read(parse_address('N7:0', PlcType.SLC), 1)
    outcome = rig.exchange(2, command)
    # Command 21 characters, ACK 2, poll 4, reply 14; the TNS is 0F01, nothing is stuffed.
    assert rig.machine.counters.chars_sent == 21 + 4 + 2
    assert outcome.seconds == pytest.approx((21 + 2 + 4 + 14) * char_time(BAUD))


def test_tx_delay_passes_before_command_poll_and_ack() -> None:
    rig = Rig(propagation=0.0, timing=LineTiming(char_time(BAUD), tx_delay=0.05))
    command = dialect_of(PlcType.SLC).read(parse_address('N7:0', PlcType.SLC), 1)
    outcome = rig.exchange(2, command)
    assert outcome.seconds == pytest.approx((21 + 2 + 4 + 14) * char_time(BAUD) + 3 * 0.05)


def test_refused_command_counts_as_error_message_at_both_ends() -> None:
    rig = Rig()
    command = dialect_of(PlcType.SLC).read(parse_address('N99:0', PlcType.SLC), 1)
    result = rig.exchange(2, command).result
    assert isinstance(result, Packet)
    assert result.sts == 0x10
    rig.settle()
    assert rig.machine.counters.error_messages_received == 1
    assert rig.plcs[2].slave.counters.error_messages_sent == 1


HEAVY = Noise(lost=0.01, flipped=0.02, doubled=0.01, inserted=0.01)
STORM = Noise(lost=0.1, flipped=0.1, doubled=0.1, inserted=0.1)


@pytest.mark.parametrize(('noise', 'seed', 'count', 'chunk', 'good'), [
    (HEAVY, 14, 1000, 14, 0.2), (STORM, 15, 500, 1, 0.0)])
def test_noise_with_crc_costs_replies_and_no_exchange_is_wrong(
        noise: Noise, seed: int, count: int, chunk: int, good: float) -> None:
    rig = Rig(Checksum.CRC, seed, chunk=chunk)
    rig.line.noise = noise
    for _ in range(count):
        outcome = rig.random_exchange()
        assert outcome.seconds <= rig.bound()
        assert isinstance(outcome.result, Packet | StationInactive | CommandTimeout)
    assert (rig.machine.counters.crc_errors > 0) is (noise is not STORM)
    succeeded = sum(isinstance(outcome.result, Packet) for outcome in rig.outcomes)
    assert succeeded >= good * count
    assert_exact(rig)
    assert_recovers(rig)
    assert_exact(rig)


@pytest.mark.parametrize('seed', range(40, 45))
def test_line_that_goes_quiet_recovers_at_once(seed: int) -> None:
    rig = Rig(seed=seed)
    rig.line.noise = STORM
    for _ in range(12):
        rig.random_exchange()
    assert_recovers(rig)


def test_dead_stations_come_back_by_a_probe() -> None:
    rig = Rig()
    rig.line.noise = Noise(lost=1.0)
    for number in FAMILIES:
        first, second = (rig.exchange(number, (0x0F, b'\x00')) for _ in range(2))
        assert isinstance(first.result, StationInactive)
        assert isinstance(second.result, StationInactive)
        assert first.seconds > 4 * 0.1 and second.seconds < 0.11
    assert rig.stations.words() == [0] * 16
    assert_recovers(rig)
    assert sum(map(int.bit_count, rig.stations.words())) == len(FAMILIES)


def test_same_seed_gives_the_same_line() -> None:
    seconds = []
    for _ in range(2):
        rig = Rig(seed=77)
        rig.line.noise = HEAVY
        seconds.append([rig.random_exchange().seconds for _ in range(50)])
    assert seconds[0] == seconds[1]
    assert len(set(seconds[0])) > 10
