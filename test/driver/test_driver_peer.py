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

"""The driver in Modes Peer and Radio: reads, writes, served words, heartbeats and fallbacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from random import Random

from abdf1_ros.df1.frames import ACK, Code, Control, Duplex, Frame, FrameDecoder, message_frame
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Mode
from abdf1_ros.pccc.slc.identity import FULL_DUPLEX_PORT
from abdf1_ros.plan.bounds import Times
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, store, stored
from support.mappings import make_mapping
from support.peers import CommandTask
from support.virtual_line import Noise, QUIET

US, PLC = 5, 1
FILES = (('N7:0', 256), ('B3:0', 16), ('N9:0', 20))
FLOATS = (('F8:0', 64),)


class Bench(DriverBench):
    """The driver at one end, a simulated PLC at the other, both with programs of their own."""

    def __init__(self, mappings: Sequence[Mapping], *, family: str = 'PLC5', check: str = 'CRC',
                 outstanding: int = 1, chunk: int = 1, processor_period: float = 0.0) -> None:
        super().__init__(mappings, network=Network(
            mode='Peer', plc_type=family, error_code=check, baud=19200, timeout=300,
            cmd_timeout=500), settings=DriverSettings(
                max_outstanding=outstanding, processor_period=processor_period),
            start=False, chunk=chunk)
        self.other = self.plc(PLC, family, *(FILES if family == 'PLC3' else FILES + FLOATS))
        self.other.counters = self.far.counters
        self.other.be_full_duplex()
        self.said: list[str] = []
        self._family = PlcType(family)
        self._tns = 0x4000

    def message(self, text: str, *values: float) -> None:
        """Let the PLC's own program write to us."""
        self.other.send(parse_address(text, self._family), list(values), US, self.said.append)
        self.line.wake(self.far)

    def plc_reads(self, text: str, words: int) -> tuple[int, bytes]:
        """Return STS and the words that the PLC's own program reads from us."""
        dialect = dialect_of(self._family)
        place = parse_address(text, self._family)
        self._tns += 1
        cmd, body = dialect.read(place, words)
        task = CommandTask(Packet(US, PLC, cmd, 0, self._tns, body), self.clock)
        self.other.outbox.append(task)  # type: ignore[arg-type]
        self.line.wake(self.far)
        self.line.run(lambda: task.result is not None, 5.0)
        reply = task.result
        assert isinstance(reply, Packet), reply
        return reply.sts, dialect.read_data(place, words, reply.data) if not reply.sts else b''


def serve_row(text: str, family: str = 'PLC5', length: int = 1, **other: object) -> Mapping:
    return make_mapping(text, 'Serve', station=US, plc=family, length=length,
                        **other)  # type: ignore[arg-type]


@pytest.mark.parametrize('family, check', long_unless(
    lambda family, check: (family, check) in (('PLC5', 'CRC'), ('SLC', 'BCC')),
    product(('PLC5', 'SLC'), ('CRC', 'BCC'))))
@pytest.mark.parametrize(('outstanding', 'chunk'), [(1, 1), (3, 1), (2, 14)])
def test_reads_of_a_peer_come_in_time_and_true(
        family: str, check: str, outstanding: int, chunk: int) -> None:
    integers = make_mapping('N7:0', plc=family, length=3)
    floats = make_mapping('F8:2', plc=family, length=2)
    bits = make_mapping('B3:1/4', plc=family, length=6)
    long = make_mapping('N7:10', plc=family, length=200)
    bench = Bench([integers, floats, bits, long], family=family, check=check,
                  outstanding=outstanding, chunk=chunk)
    store(bench.other, 'N7:0', [0x1003, -2, 16])
    store(bench.other, 'F8:2', [1.5, -0.25])
    store(bench.other, 'B3:1/4', [1, 0, 0, 1, 1, 1])
    store(bench.other, 'N7:10', list(range(200)))
    bench.open(run=3.0)
    assert bench.listener.values(integers)[-1] == [0x1003, -2, 16]
    assert bench.listener.values(floats)[-1] == [1.5, -0.25]
    assert bench.listener.values(bits)[-1] == [1, 0, 0, 1, 1, 1]
    assert {tuple(values) for values in bench.listener.values(long)} == {tuple(range(200))}
    assert bench.listener.numbers() == {2523}
    assert bench.listener.changes == []
    counters = bench.driver.counters
    assert counters.commands_sent - counters.replies_received in range(outstanding + 1)
    assert bench.driver.tasks.transactions == counters.replies_received > 10


@pytest.mark.parametrize('family', ['PLC5', 'SLC'])
@pytest.mark.parametrize('outstanding', [1, 3])
def test_writes_to_a_peer_are_confirmed_and_stored(family: str, outstanding: int) -> None:
    words = make_mapping('N7:10', 'ReadWrite', plc=family, length=4)
    floats = make_mapping('F8:0', 'Write', plc=family)
    bits = make_mapping('B3:2/3', 'Write', plc=family, length=3)
    bench = Bench([words, floats, bits], family=family, outstanding=outstanding)
    store(bench.other, 'B3:2', [0xFFFF])
    bench.open(run=0.5)
    bench.write(words, [1, -2, 16, 0x1010])
    bench.write(floats, [2.5])
    bench.write(bits, [0, 1, 0], run=1.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN] * 3
    assert stored(bench.other, 'N7:10', 4) == b'\1\0\xfe\xff\x10\0\x10\x10'
    assert stored(bench.other, 'F8:0', 2) == b'\0\0\x20\x40'
    assert stored(bench.other, 'B3:2') == b'\xd7\xff'
    assert bench.listener.values(words)[-1] == [1, -2, 16, 0x1010]


@pytest.mark.parametrize('family', ['PLC3', 'PLC5', 'SLC'])
@pytest.mark.parametrize('check', ['CRC', 'BCC'])
def test_message_of_the_plc_appears_at_once(family: str, check: str) -> None:
    pushed = serve_row('N7:50', family, 4)
    bits = serve_row('B3:5/0', family, 8)
    bench = Bench([pushed, bits, make_mapping(plc=family)], family=family, check=check)
    bench.open(run=1.0)
    began = bench.clock()
    bench.message('N7:50', 11, 22)
    bench.run(0.5)
    assert bench.listener.values(pushed) == [[11, 22, 0, 0]]
    assert bench.listener.times(pushed)[0] - began < 0.1
    assert bench.listener.values(bits) == []
    bench.message('B3:5/2', 1)
    bench.run(0.5)
    assert bench.listener.values(bits) == [[0, 0, 1, 0, 0, 0, 0, 0]]
    assert bench.said == ['confirmed', 'confirmed']
    counters = bench.driver.counters
    assert (counters.commands_received, counters.replies_sent) == (2, 2)
    assert counters.error_messages_sent == counters.duplicate_messages == 0


@pytest.mark.parametrize('family', ['PLC3', 'PLC5', 'SLC'])
def test_what_ros_writes_is_read_by_the_plc(family: str) -> None:
    words, bits = serve_row('N7:50', family, 4), serve_row('B3:5/4', family, 4)
    bench = Bench([words, bits, make_mapping(plc=family)], family=family)
    bench.open(run=0.3)
    assert bench.plc_reads('N7:50', 4) == (0, bytes(8))
    bench.write(words, [-1, 0x1010, 3, 4])
    bench.write(bits, [1, 0, 1, 1], run=0.3)
    assert bench.listener.outcomes() == [Outcome.WRITTEN, Outcome.WRITTEN]
    assert bench.plc_reads('N7:50', 4) == (0, b'\xff\xff\x10\x10\3\0\4\0')
    assert bench.plc_reads('B3:5', 1) == (0, b'\xd0\0')
    assert bench.listener.values(words) == []
    assert bench.plc_reads('N7:54', 1)[0] != 0


@pytest.mark.parametrize('family', ['PLC5', 'SLC'])
@pytest.mark.parametrize('outstanding', [1, 3])
def test_nothing_is_lost_or_mixed_up_when_everything_happens_at_once(
        family: str, outstanding: int) -> None:
    read = make_mapping('N7:0', plc=family, length=10, period=0)
    others = [make_mapping(f'N7:{60 + 60 * n}', plc=family, period=0) for n in range(3)]
    write = make_mapping('N9:0', 'Write', plc=family, length=2)
    pushed = serve_row('N7:50', family, 2)
    pulled = serve_row('N9:10', family, 2)
    bench = Bench([read, *others, write, pushed, pulled], family=family, outstanding=outstanding)
    bench.open()
    for number in range(1, 21):
        store(bench.other, 'N7:0', [number] * 10)
        bench.write(write, [number, -number])
        bench.write(pulled, [number, 2 * number])
        bench.message('N7:50', number, 3 * number)
        bench.run(0.15)
        assert stored(bench.other, 'N9:0', 2) == b''.join(
            value.to_bytes(2, 'little', signed=True) for value in (number, -number))
        assert bench.listener.values(pushed)[-1] == [number, 3 * number]
        assert bench.plc_reads('N9:10', 2) == (0, bytes((number, 0, 2 * number, 0)))
    assert [values[0] for values in bench.listener.values(pushed)] == list(range(1, 21))
    assert bench.said == ['confirmed'] * 20
    assert bench.listener.outcomes() == [Outcome.WRITTEN] * 40
    seen = [values[0] for values in bench.listener.values(read)]
    assert seen == sorted(seen)
    assert set(seen) >= set(range(1, 21))
    assert all(len(set(values)) == 1 for values in bench.listener.values(read))
    assert bench.listener.numbers() == {2523}
    counters = bench.driver.counters
    assert (counters.commands_received, counters.replies_sent) == (40, 40)
    assert counters.enq_retries == counters.nak_retries == counters.command_timeouts == 0


def test_dead_line_fails_reads_and_writes_and_all_goes_on_when_it_is_back() -> None:
    read, write = make_mapping(via=9), make_mapping('N7:5', 'Write')  # a peer is not asked Via
    pushed = make_mapping('N7:50', 'Serve', station=PLC)  # we have the number of the PLC
    bench = Bench([read, write, pushed])
    bench.open(run=0.5)
    bench.line.noise = Noise(lost=1.0)
    bench.write(write, [5], run=10.0)
    assert bench.listener.changes == [(PLC, False)]
    assert bench.listener.outcomes() == [Outcome.UNKNOWN]
    assert bench.driver.points[read].freshness(bench.clock()) is Freshness.FAILED
    assert bench.driver.points[pushed].freshness(bench.clock()) is not Freshness.FAILED
    assert {2515, 2520, 2522, 2509} <= bench.listener.numbers()
    before = len(bench.listener.values(read))
    bench.line.noise = QUIET
    bench.run(5.0)
    assert bench.listener.changes == [(PLC, False), (PLC, True)]
    assert len(bench.listener.values(read)) > before + 10
    bench.message('N7:50', 9)
    bench.run(1.0)
    assert bench.listener.values(pushed) == [[9]]


def test_served_word_that_nobody_has_to_write_is_not_late() -> None:
    free, expected = serve_row('N7:50'), serve_row('N7:60', period=200)
    bench = Bench([free, expected])
    bench.open(run=5.0)
    now = bench.clock()
    assert bench.driver.points[free].freshness(now) is Freshness.FRESH
    assert bench.driver.points[free].age(now) is None
    assert bench.driver.points[expected].freshness(now) is Freshness.WAITING
    bench.message('N7:60', 1)
    bench.run(0.1)
    assert bench.driver.points[expected].freshness(bench.clock()) is Freshness.FRESH
    bench.run(5.0)
    assert bench.driver.points[expected].freshness(bench.clock()) is Freshness.STALE


def test_plc_reads_the_newest_value_while_a_command_of_ours_waits() -> None:
    words = serve_row('N7:50')
    bench = Bench([make_mapping(), words])
    machine = bench.driver.machine
    machine.start(-0.1)
    machine.handle_timeout(0.0)
    assert machine.data_to_send()
    machine.receive_data(ACK, 0.1)  # and its reply takes its time
    bench.driver.write([words], [7], 0.2)
    machine.wake(0.2)
    dialect = dialect_of(PlcType.PLC5)
    place = parse_address('N7:50', PlcType.PLC5)
    cmd, body = dialect.read(place, 1)
    command = Packet(US, PLC, cmd, 0, 1, body)
    machine.receive_data(message_frame(command.encode(), bench.network.checksum), 0.3)
    decoder = FrameDecoder(bench.network.checksum, Duplex.FULL)
    decoder.feed(machine.data_to_send())
    assert decoder.next_symbol() == Control(Code.ACK)
    reply = decoder.next_symbol()
    assert isinstance(reply, Frame)
    assert dialect.read_data(place, 1, Packet.decode(reply.data).data) == b'\7\0'
    assert bench.listener.outcomes() == [Outcome.WRITTEN]


@pytest.mark.parametrize('outstanding', [1, 3])
def test_processor_and_counters_of_the_other_end(outstanding: int) -> None:
    word, lamp = make_mapping('N7:0', plc='SLC'), make_mapping('N7:1', 'Write', plc='SLC')
    bench = Bench([word, lamp], family='SLC', outstanding=outstanding, processor_period=2.0)
    bench.open(run=1.0)
    health = bench.driver.checks
    assert health.known(PLC).processor == 'SLC 5/03 series A revision 1, REM RUN'
    bench.other.processor.setting = Setting.PROGRAM
    bench.driver.checks.request_counters(PLC)
    bench.run(2.0)
    identity = health.known(PLC).identity
    assert identity is not None
    assert identity.mode is Mode.REMOTE_PROGRAM
    assert int(health.known(PLC).counters['messages sent']) > 0
    assert health.counters_wanted == set()
    ours = bench.driver.served.serve(Packet(US, PLC, 0x06, 0, 1, b'\3'))
    assert ours.data[2] == FULL_DUPLEX_PORT


FIRST, SECOND = 1, 2
RADIO_NETWORK = Network(station=200, mode='Radio', baud=19200, cmd_timeout=500, nak_retries=1)


class RadioBench(DriverBench):
    """A driver, and SLCs behind one radio modem; a share ``loss`` of all packets is lost."""

    def __init__(self, network: Network = RADIO_NETWORK, stations: int = SECOND) -> None:
        numbers = range(1, stations + 1)
        self.read = [make_mapping('N7:0', station=number, plc='SLC') for number in numbers]
        self.beat = make_mapping('N10:0', 'Heartbeat', station=FIRST, plc='SLC', period=2000)
        self.speed = make_mapping('N10:1', 'Write', station=FIRST, plc='SLC',
                                  fallback=Fallback((7,), 1000))
        rows = [*self.read, self.beat, self.speed]
        super().__init__(rows, network=network, start=False)
        self.loss = 0.0
        self.plcs = {number: self.plc(number, 'SLC', ('N7:0', 4), ('N10:0', 4))
                     for number in numbers}
        self.line.noise = self
        self.bound = next(bound for bound in Times(network, Rows(rows)).bounds()
                          if bound.mapping is self.speed)
        self.open()

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return a packet, or nothing."""
        return b'' if random.random() < self.loss else data


def test_radios_that_avoid_collisions_carry_several_commands_as_forecast() -> None:
    cycles = []
    for several in (False, True):
        bench = RadioBench(replace(RADIO_NETWORK, collision_avoidance=several), stations=8)
        bench.line.propagation = 0.1
        bench.run(60.0)
        cycle = 60.0 / len(bench.listener.values(bench.read[-1]))
        # The forecast leaves the heartbeat out, and counts waits that overlap in fact.
        assert 0.6 < cycle / make_report(bench.network, bench.read, 0.1, 0.2).poll_cycle < 1.6
        cycles.append(cycle)
    assert cycles[0] > 3 * cycles[1]


@pytest.mark.parametrize('several', [False, True])
@pytest.mark.parametrize('loss', [0.0, 0.3])
def test_guarded_value_ends_with_the_program_of_its_plc(several: bool, loss: float) -> None:
    network = replace(RADIO_NETWORK, collision_avoidance=several)
    alive = make_mapping('N11:3', plc='SLC', station=FIRST, tag='alive', period=500)
    level = make_mapping('N7:0', plc='SLC', station=FIRST, tag='level', period=500,
                         condition=While(('alive',), 3000))
    bench = DriverBench([alive, level], network=network, start=False)
    plc = bench.plc(FIRST, 'SLC', ('N7:0', 4), ('N11:0', 4))
    dice = Random(1)
    bench.far.hear = bench.far.say = lambda data: b'' if dice.random() < loss else data
    bench.open()
    for count in range(1, 150):
        store(plc, 'N11:3', [count])
        bench.run(0.2)
    published = len(bench.listener.times(level))
    stopped = bench.clock()
    bench.run(60.0)
    assert published >= 10
    longest = network.line_mode.longest_transaction(network.line, 0.0)
    assert bench.listener.times(level)[-1] <= stopped + 3.0 + longest
