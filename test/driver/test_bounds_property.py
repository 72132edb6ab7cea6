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
A printed bound is a bound: rule 16 of docs/heartbeats.md, against the driver.

Every publisher dies, while the line loses commands, replies or both, but never more than the
settings repeat. PLCs fall silent, execute without a reply, or stand behind a gateway. The fallback
of every row whose PLC takes commands has to be in that PLC within the bound that ``check`` prints,
counted from the last message. The simulation of any plants (test/lab/simulate) judges the same;
here each plant is the worst case of one part of the bound.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
import math
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Code, message_frame
from abdf1_ros.df1.packet import BROADCAST, Packet, STS_NOT_DELIVERED
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.kernel.plc import Plc
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.plan.bounds import Times
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.simulator.gateway import SimulatedGateway
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, Program, simulated_plc
from support.losses import AirLosses, Losses, Lost
from support.mappings import make_mapping

AFTER = 2.0
SAFE = 32_000
GATEWAY = 99
OUTPUTS, BEAT = (parse_address(text, PlcType.SLC) for text in ('N7:0', 'N10:0'))
LONG_READ = bytes.fromhex('A2 50 09 89 00 00')  # 40 words from N9:0 on
_READ = LONG_READ[:1]  # the function
RADIO = {'mode': 'Radio', 'store_forward': '60,61'}
MODES = {'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
         'Radio': RADIO, 'Radio, several': RADIO | {'collision_avoidance': True}}


@dataclass(frozen=True, slots=True)
class Worst(Lost):
    """
    What is on the line, and what goes wrong beside what gets lost.

    ``delay`` is after how many seconds a PLC has its reply. ``mute`` PLCs execute and do not
    reply, ``silent`` ones do neither; the last ``behind`` stand behind a gateway. A row has
    ``length`` words. The publishers of the stations ``alive`` do not die. The driver hears
    ``chunk`` bytes at a time: of whole frames a long one may come after Timeout.
    Of ``guests`` each has a long read for the first PLC all the time.
    In Mode Peer the PLC has a message for us every ``asks`` seconds, which we refuse.
    By radio the longest packets come from others every ``others`` seconds, to be sent on;
    ``drops`` has PLCs drop repetitions in silence.
    """

    stations: int
    rows: int
    baud: int = 19200
    timeout: int = 100
    has_reads: bool = True
    delay: float = 0.0
    mute: frozenset[int] = frozenset()
    silent: frozenset[int] = frozenset()
    behind: int = 0
    length: int = 1
    alive: frozenset[int] = frozenset()
    phase: float = 0.0
    others: float = math.inf
    drops: bool = False
    chunk: int = 8
    tx_delay: int = 0
    asks: float = math.inf
    guests: int = 0

    @property
    def network(self) -> Network:
        return Network(station=200, baud=self.baud, timeout=self.timeout,
                       cmd_timeout=500, nak_retries=self.nak_retries,
                       enq_retries=self.enq_retries, tx_delay=self.tx_delay,
                       share='tcp:6000' if self.guests else '',
                       **MODES[self.mode])  # type: ignore[arg-type]

    def mappings(self) -> list[Mapping]:
        """Return the rows."""
        found = []
        for station in range(1, self.stations + 1):
            via = GATEWAY if station > self.stations - self.behind else None
            common = {'station': station, 'plc': 'SLC', 'via': via}
            found.append(make_mapping('N10:0', 'Heartbeat', period=1000,
                                      tag=f'beat_{station}', **common))  # type: ignore[arg-type]
            fallback = Fallback(self.length * (SAFE,), int(AFTER * 1000))
            found += [make_mapping(f'N7:{number * self.length}', 'Write', fallback=fallback,
                                   tag=f'w_{station}_{number}', length=self.length,
                                   **common)  # type: ignore[arg-type]
                      for number in range(self.rows)]
            if self.has_reads:
                found.append(make_mapping('N9:0', tag=f'r_{station}', period=100, length=40,
                                          **common))  # type: ignore[arg-type]
        return found


class PeerLosses(Losses):
    """
    A full-duplex line on which each message of ours takes all tries that the settings allow.

    It is damaged as often as it may be, and then the response to it gets lost as often.
    """

    _message = b''
    _damaged = _muffled = 0

    def hear(self, data: bytes) -> bytes:
        """Return what the PLC hears of a frame."""
        if data[:2] == ACK and len(data) > 2:
            return ACK + self.hear(data[2:])
        if not self.is_due or data[:2] != bytes((Code.DLE, Code.STX)):
            return data
        if data != self._message:
            self._message, self._damaged, self._muffled = data, 0, 0
        if self._damaged == self._plant.nak_retries:
            return data
        self._damaged += 1
        return data[:-1] + bytes((data[-1] ^ 1,))

    def say(self, data: bytes) -> bytes:
        """Return what the driver hears."""
        is_lost = data == ACK and self._damaged == self._plant.nak_retries \
            and self._muffled < self._plant.enq_retries
        self._muffled += is_lost
        return b'' if is_lost else data


class BoundBench:
    """A driver, its PLCs, and the line with its losses."""

    def __init__(self, plant: Worst) -> None:
        self.plant = plant
        self.rows = plant.mappings()
        self.bench = DriverBench(self.rows, network=plant.network,
                                 settings=DriverSettings(processor_period=0), start=False)
        self.bench.line.chunks[0] = plant.chunk
        losses = AirLosses if plant.network.mode == 'Radio' else \
            PeerLosses if plant.asks < math.inf else Losses
        self.losses = losses(plant, self.bench.clock)
        if plant.drops:
            self.bench.far.answers_again = math.inf
        if plant.others < math.inf:
            self.bench.at(3.0, self._hear_others)
        self.bench.far.hear, self.bench.far.say = self.losses.hear, self.losses.say
        self.longest = 0.0  # s, of a transaction
        self._next_task = self.bench.driver.next_task
        self.bench.driver.next_task = self._timed_task  # type: ignore[method-assign]
        self.fallen: dict[str, float] = {}  # when a row got its fallback last
        self.beaten: dict[int, float] = {}  # when a heartbeat came last
        self.gaps: Counter[str] = Counter()  # the longest time between two
        self.plcs: dict[int, SimulatedPlc] = {}
        behind = []
        for station in range(1, plant.stations + 1):
            is_behind = station > plant.stations - plant.behind
            plc = self._plc(station, is_behind)
            self.plcs[station] = plc
            if is_behind:
                behind.append(plc)
        if behind:
            self.bench.connect(SimulatedGateway(GATEWAY, behind, plant.network.checksum))
        self.bench.breathe()
        self.bench.open()
        if plant.asks < math.inf:
            self.bench.at(3.0, self._ask)
        for number in range(plant.guests):
            Program(self.bench, src=210 + number).keep_asking(LONG_READ)

    def _plc(self, station: int, is_behind: bool) -> SimulatedPlc:
        areas = ('N7:0', self.plant.rows * self.plant.length), ('N9:0', 40), ('N10:0', 1)
        bench = self.bench
        if is_behind:
            plc = simulated_plc(station, 'SLC', bench.clock, *areas)
        else:
            plc = bench.plc(station, 'SLC', *areas)
        serve = plc.serve

        def execute(command: Packet) -> Packet:
            before = [] if command.data[:1] == _READ else self.words(station)
            self.losses.ready = bench.clock() + self.plant.delay
            beat = self.beat(station)
            reply = serve(command)
            if self.beat(station) != beat:
                now, tag = bench.clock(), f'beat_{station}'
                if self.losses.is_due:
                    self.gaps[tag] = max(self.gaps[tag], now - self.beaten.get(station, now))
                self.beaten[station] = now
            after = before if command.data[:1] == _READ else self.words(station)
            for number, (old, new) in enumerate(zip(before, after, strict=True)):
                if old != new:
                    self.fallen.pop(f'w_{station}_{number}', None)
                    if new == {SAFE}:
                        self.fallen[f'w_{station}_{number}'] = bench.clock()
            if self.losses.is_due and station in self.plant.mute:
                # Nobody waits for this one; a gateway says that it has none.
                return command.reply(sts=STS_NOT_DELIVERED) if is_behind \
                    else reply._replace(tns=reply.tns ^ 0x8000)
            return reply

        plc.serve = execute  # type: ignore[method-assign]
        plc.slave = HalfDuplexSlave(LinkSettings(station=station), execute)
        return plc

    def _timed_task(self, now: float, busy: Container[int] = ()) -> Job | None:
        """Give the link its next command, and measure how long it takes."""
        task = self._next_task(now, busy)
        if isinstance(task, Job):
            for end in ('reply', 'fail'):
                setattr(task, end, partial(self._ended, task, end, self.bench.clock()))
        return task

    def _ended(self, task: Job, end: str, begun: float, how: Any) -> None:
        del task.reply, task.fail
        # A reply of before, that comes first, is more than the retries allow.
        if not self.bench.driver.counters.stale_messages:
            self.longest = max(self.longest, self.bench.clock() - begun)
        getattr(task, end)(how)

    def _ask(self) -> None:
        """Have the PLC of a full-duplex line send a message to us."""
        plc = self.plcs[1]
        if not plc.outbox:
            plc.send(OUTPUTS, [0.0], 200, str)
            self.bench.line.wake(self.bench.far)
        self.bench.at(self.bench.clock() + self.plant.asks, self._ask)

    def _hear_others(self) -> None:
        """Let a packet of another node come; each has a number of its own."""
        bench = self.bench
        packet = Packet(60, 61, 0x0F, 0, int(1000 * bench.clock()) & 0xFFFF, bytes(240))
        bench.driver.machine.receive_data(
            message_frame(packet.encode(), Checksum.CRC), bench.clock())
        bench.line.wake(bench.driver.machine)
        bench.at(bench.clock() + self.plant.others, self._hear_others)

    def beat(self, station: int) -> bytes:
        """Return the word of the heartbeat in a PLC."""
        return self.plcs[station].table.read(BEAT, 1)

    def words(self, station: int) -> list[set[int]]:
        """Return the values in the outputs of each row of a PLC."""
        length = self.plant.length
        data = self.plcs[station].table.read(OUTPUTS, self.plant.rows * length)
        words = [int.from_bytes(data[at:at + 2], 'little') for at in range(0, len(data), 2)]
        return [set(words[at:at + length]) for at in range(0, len(words), length)]

    def publish(self, stations: Iterable[int] | None = None) -> None:
        """Publish one message for each row, or for each of some stations."""
        for mapping in self.rows:
            if mapping.fallback and (stations is None or mapping.station in stations):
                self.bench.write(mapping, self.plant.length * [7])

    def pauses(self) -> dict[str, tuple[float, float]]:
        """Return preset and longest pause of each heartbeat, by tag, within a minute of losses."""
        plant, bench = self.plant, self.bench
        bench.run(3.0)
        self.publish()
        bench.run(1.0)
        self._live_on()
        self.losses.is_due = True
        bench.line.propagation = plant.travel
        for plc in self.plcs.values():
            plc.faults.delay = plant.delay
        bench.run(5.0)
        self.gaps.clear()
        bench.run(60.0)
        return {bound.mapping.tag: (bound.seconds or 0.0, self.gaps[bound.mapping.tag])
                for bound in make_report(plant.network, self.rows, 0.1).times.bounds()
                if bound.mapping.is_heartbeat and bound.mapping.station in (plant.alive or {1})}

    def _live_on(self) -> None:
        self.publish(self.plant.alive)
        self.bench.at(self.bench.clock() + 0.25, self._live_on)

    def late(self) -> dict[str, tuple[float, float]]:
        """Return bound, and the time it took, of each row that took longer, by its tag."""
        times = self.run()
        times['T'] = make_report(self.plant.network, self.rows, 0.1).times.longest, self.longest
        return {tag: (round(limit, 3), round(took, 3))
                for tag, (limit, took) in times.items() if took > limit + 1e-6}

    def run(self, *, is_usual: bool = False) -> dict[str, tuple[float, float]]:
        """
        Return bound, or the usual one, and the time it took, of each row whose PLC takes commands.

        They are by its tag.

        By radio it has heartbeats too, with their presets and longest pauses.
        """
        plant, bench = self.plant, self.bench
        bench.run(3.0)
        for _ in range(2):  # of many rows only some messages are written in time
            self.publish()
            bench.run(1.0)
        self.publish()
        self.losses.is_due = True
        bench.line.propagation = plant.travel
        bench.run(plant.phase)
        died = bench.clock()
        self.publish()
        if plant.alive:
            self._live_on()
        for station, plc in self.plcs.items():
            plc.faults.silent = station in plant.silent
            plc.faults.delay = plant.delay
        report = make_report(plant.network, self.rows, 0.1)
        limits = {bound.mapping.tag: bound.usual if is_usual else bound.seconds
                  for bound in report.times.bounds() if bound.mapping.fallback}
        judged = [mapping.tag for mapping in self.rows
                  if mapping.fallback and mapping.station not in plant.silent | plant.alive]
        end = died + max(limit for limit in limits.values() if limit) + 2 * AFTER
        stays = 0.0  # s; a last message may come after a fallback
        while bench.clock() < end and stays < 2 * AFTER:
            bench.run(1.0)
            stays = stays + 1.0 if all(tag in self.fallen for tag in judged) else 0.0
        found = {tag: (limits[tag] or math.inf, self.fallen.get(tag, math.inf) - died)
                 for tag in judged}
        if plant.network.mode == 'Radio':
            found |= {bound.mapping.tag: (bound.seconds or 0.0, self.gaps[bound.mapping.tag])
                      for bound in report.times.bounds() if bound.mapping.is_heartbeat
                      and bound.mapping.station not in plant.silent}
        return found


LATE = {'timeout': 50, 'nak_retries': 3, 'lost': 0.75, 'delay': 0.45, 'travel': 0.0175}
PLANTS = [
    Worst('Message', 3, 5, **LATE, alive=frozenset((1, 2)), behind=3),  # type: ignore[arg-type]
    Worst('Message', 8, 8, baud=115200, timeout=200, enq_retries=2, lost=0.5, travel=0.07,
          mute=frozenset((1, 3, 6)), silent=frozenset((5,)), behind=2),
    Worst('Message', 8, 1, timeout=200, nak_retries=2, lost=0.75, lose_commands=False, length=200,
          mute=frozenset((2, 3, 6)), silent=frozenset((4,)), alive=frozenset((1, 7)), phase=0.7),
    Worst('Standard', 3, 5, lost=0.5, length=2, mute=frozenset((1,)), alive=frozenset((2,))),
    Worst('Standard', 8, 1, **LATE, mute=frozenset((3, 4, 5, 7, 8)),  # type: ignore[arg-type]
          silent=frozenset((6,)), alive=frozenset((1, 2)), baud=115200),
    Worst('Standard', 8, 2, timeout=200, lost=1.0, delay=0.34, travel=0.09),
    Worst('Peer', 1, 5, **LATE, length=2),  # type: ignore[arg-type]
    Worst('Peer', 1, 30, nak_retries=0, enq_retries=3, lost=0.5, lose_commands=False,
          mute=frozenset((1,))),
    *(plant for mode in ('Radio', 'Radio, several') for plant in (
        Worst(mode, 8, 1, **LATE, silent=frozenset((3, 4)),  # type: ignore[arg-type]
              alive=frozenset((1, 5))),
        Worst(mode, 3, 5, lost=0.5, length=2, lose_replies=False, drops=True, others=1.0,
              alive=frozenset((1, 2)))))]


@pytest.mark.parametrize('plant', PLANTS, ids=range(len(PLANTS)))
def test_rule_16_no_fallback_comes_later_than_printed(plant: Worst) -> None:
    assert BoundBench(plant).late() == {}


def test_rule_16_rest_of_a_long_fallback_does_not_wait_for_heartbeats_that_are_always_due(
        ) -> None:
    plant = Worst('Message', 8, 1, baud=115200, length=200, timeout=200, lost=0.75, delay=0.3,
                  alive=frozenset(range(1, 8)))
    assert BoundBench(plant).late() == {}
    assert BoundBench(replace(plant, mute=frozenset((8,)))).late() == {}


def test_rule_7_message_after_a_fallback_that_is_not_confirmed_counts_once() -> None:
    # It is written over the fallback, which then waited for the time that silent PLCs share.
    plant = Worst('Peer', 1, 1, timeout=50, nak_retries=0, length=200, mute=frozenset((1,)),
                  phase=2.0)
    assert BoundBench(plant).late() == {}


# On this line nearly every try waits for its whole time: no frame that may get lost gets through,
# and what comes comes late.
WORST = Worst('Message', 8, 1, timeout=200, lost=1.0, delay=0.34, travel=0.09)

# Handed over as whole frames the values come after Timeout, so reads take all the time there is.
# They fail, which is more than the retries allow: another seed may break the bound.
TOO_LATE = replace(WORST, chunk=1000, seed=8)


@pytest.mark.parametrize('seed', range(2))
def test_rule_16_bound_holds_where_nearly_all_tries_take_their_whole_time(seed: int) -> None:
    assert BoundBench(replace(WORST, seed=seed, phase=seed / 4)).late() == {}


def test_rule_16_nothing_can_be_left_out_of_the_bound() -> None:
    took = max(took for number in range(4) for _, took in
               BoundBench(replace(TOO_LATE, phase=number / 4)).run().values())
    rows = WORST.mappings()
    blocks = make_report(WORST.network, rows, 0.1).blocks

    def limit(network: Network, rows: Sequence[Mapping] = rows) -> float:
        return max(bound.seconds or 0.0 for bound in Times(network, Rows(rows), blocks).bounds()
                   if bound.mapping.fallback)

    network = WORST.network
    once = Times(network, Rows(rows), blocks)
    mistaken = {
        'NAK_Retries': limit(replace(network, nak_retries=0)),
        'ENQ_Retries': limit(replace(network, enq_retries=0)),
        'Cmd_Timeout': limit(replace(network, cmd_timeout=200)),
        'heartbeats': limit(network, [row for row in rows if not row.is_heartbeat]),
        'other fallbacks': limit(network, [row for row in rows if not row.fallback or row is
                                           rows[1]]),
        'one transaction': limit(network) - once.at_most(once.any_frames),
        'frames': limit(replace(network, baud=115200))}
    assert took <= limit(network)
    assert {name: late for name, late in mistaken.items() if took <= late} == {}


@pytest.mark.parametrize('mistake', [
    lambda rank, row: rank and (1, *rank[1:]),  # second tries like first ones
    lambda rank, row: rank and (-rank[0], *rank[1:]),  # what is last goes first
    lambda rank, row: None if rank and rank[0] == 0 and rank[1] else rank])  # the ill never
def test_rule_16_another_order_breaks_the_bound(
        mistake: Callable[..., object], monkeypatch: pytest.MonkeyPatch) -> None:
    rank = Plc.rank
    monkeypatch.setattr(Plc, 'rank', lambda self, row, now: mistake(rank(self, row, now), row))
    plants = [replace(WORST, mute=frozenset(range(1, 8)), silent=frozenset()),
              replace(WORST, rows=8, stations=2, mute=frozenset((1, 2)))]
    assert any(BoundBench(plant).late() for plant in plants)


SHAPES = [(1, 30, 1), (4, 5, 1), (8, 1, 200)]  # stations, rows, words of a row
TIGHTEST = dict(zip(MODES, (0, 2, 1, 1, 2), strict=True))  # where a shorter bound shows first


@pytest.mark.parametrize(('mode', 'stations', 'rows', 'length'), long_unless(
    lambda mode, *shape: SHAPES.index(shape) == TIGHTEST[mode],
    [(mode, *shape) for mode in MODES for shape in SHAPES]))
def test_rule_16_nor_where_no_frame_gets_lost_than_is_told_for_that(
        mode: str, stations: int, rows: int, length: int) -> None:
    if mode == 'Peer':
        stations, rows = 1, stations * rows if length == 1 else rows
    plant = Worst(mode, stations, rows, length=length, phase=0.07)
    assert late_of(BoundBench(plant).run(is_usual=True)) == {}


SLOW = {'lost': 1.0, 'timeout': 200, 'delay': 0.34, 'travel': 0.09}


@pytest.mark.parametrize('plant', [
    Worst('Message', 8, 1, **SLOW, alive=frozenset(range(1, 9))),  # type: ignore[arg-type]
    Worst('Message', 3, 1, **SLOW, alive=frozenset((1, 2, 3)), guests=3),  # type: ignore[arg-type]
    Worst('Message', 3, 5, lost=1.0, alive=frozenset((1,))),
    Worst('Peer', 1, 1, **SLOW, alive=frozenset((1,)), guests=3),  # type: ignore[arg-type]
    Worst('Standard', 3, 1, **SLOW, alive=frozenset((1, 2, 3))),  # type: ignore[arg-type]
    Worst('Radio', 3, 1, lost=1.0, alive=frozenset((1, 2, 3))),
    Worst('Message', 1, 1, length=1800)], ids=range(7))  # here its fallback is written again
def test_rule_16_no_heartbeat_of_a_living_bridge_pauses_for_longer_than_its_preset(
        plant: Worst) -> None:
    """Of eight PLCs one stood still for 9.4 s, with a preset of 3.9 s."""
    pauses = BoundBench(plant).pauses()
    assert late_of(pauses) == {}
    assert min(pause for _, pause in pauses.values()) > 0.9


def test_rule_10_second_writes_and_heartbeats_take_turns_on_a_full_line() -> None:
    bound = BoundBench(Worst('Message', 3, 4))
    bound.bench.run(3.0)
    Program(bound.bench, ShareAccess.ALL).ask(b'\0', BROADCAST)  # it may be any write
    bound.bench.run(0.95)  # each is written once
    for plc in bound.plcs.values():
        plc.faults.delay, bound.losses.is_due = 0.45, True
    bound.bench.run(40.0)
    assert max(bound.gaps.values()) < 6.96  # the preset
    assert {row.again_at for row in bound.bench.driver.kernel.rows.fallbacks} == {math.inf}


@pytest.mark.parametrize('mode', ['Message', 'Standard', 'Peer'])
@pytest.mark.parametrize('lost', [0.0, 1.0])
def test_rule_16_guests_that_ask_all_the_time_break_no_bound(mode: str, lost: float) -> None:
    plant = Worst(mode, 1, 8, guests=3, lost=lost, phase=0.07, seed=1)
    assert late_of(BoundBench(plant).run(is_usual=not lost)) == {}


def late_of(times: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    return {tag: (limit, took) for tag, (limit, took) in times.items() if took > limit + 1e-6}


def test_rule_16_replies_to_a_peer_are_counted_where_nothing_is_served() -> None:
    plant = Worst('Peer', 1, 8, timeout=200, travel=0.08, nak_retries=3, enq_retries=3,
                  mute=frozenset((1,)), asks=0.05)
    assert BoundBench(plant).late() == {}


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize(('baud', 'timeout', 'tx_delay'), [(19200, 0, 0), (1200, 100, 50)])
def test_rule_16_longest_transaction_has_every_frame_and_delay(
        mode: str, baud: int, timeout: int, tx_delay: int) -> None:
    plant = Worst(mode, 1, 2, baud=baud, timeout=timeout, tx_delay=tx_delay, nak_retries=3,
                  enq_retries=3, lost=1.0, delay=0.45, length=20, has_reads=False, chunk=1)
    assert BoundBench(plant).late() == {}
