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
Heartbeats and fallbacks on a line with noise and faults, with publishers and guests.

Every value that is published is another one, so what the PLC executes tells who asked for it and
when. Some things have to hold in every mode, whatever happens and whoever writes
(docs/heartbeats.md): no heartbeat vouches for what is overdue, nothing but a fallback stands for
long, the last words in the PLC are ours, and each command of a guest has one reply.
"""

from __future__ import annotations

from collections.abc import Iterable
import heapq
import itertools
import math
from random import Random

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import Guest, GuestCommand, GuestJob, ShareAccess
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.settings.heartbeats import Fallback, Heartbeat
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from hypothesis import given, Phase, settings
from hypothesis import strategies as st
import pytest
from support.driver_bench import Recorder, simulated_plc
from support.mappings import make_mapping
from support.virtual_line import Noise, QUIET, VirtualLine

AFTER = 0.6
SAFE = 32_000
SECONDS = 20.0
SETTLED = 1.0  # s after something wrong, in which a station is known to answer
RECOVERY = 5.0  # s, in which an inactive station is probed
STEP = 0.05
TURNS = 4  # a step: as many messages there may be
FLIGHT = 0.05  # s that a frame takes to the PLC, at most
SMALL = Noise(lost=0.0005, flipped=0.001, inserted=0.0005)
CMD_TIMEOUT = 0.5
GUESTS = range(32_100, 32_200)  # values that only guests write
GATEWAY = 7  # not our own number
DAMAGED = b'ZZZZ'  # what the line does not carry: only guests send it
MODES = {'Message': {'polling': 'Message'}, 'Standard': {'polling': 'Standard'},
         'Peer': {'mode': 'Peer'}, 'Gateway': {'polling': 'Message'},
         'Gateway, Standard': {'polling': 'Standard'}}


def _is_write(command: Packet) -> bool:
    return command.cmd == 0x0F and command.data[:1] == b'\x67'


class World:
    """A driver, a PLC, the line between them, and two publishers."""

    def __init__(self, mode: str, seed: int) -> None:
        self.dice = Random(seed)
        self.is_behind = mode.startswith('Gateway')
        fallback, via = Fallback((SAFE,), int(AFTER * 1000)), GATEWAY if self.is_behind else None
        self.rows = [make_mapping(f'N7:{number}', 'Write', tag=f'w{number}', fallback=fallback,
                                  via=via) for number in range(2)]
        beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=300, heartbeat=Heartbeat(),
                            via=via)
        self.mappings = [*self.rows, beat, make_mapping('N9:0', period=100, via=via)]
        self.network = Network(
            baud=19200, timeout=100, cmd_timeout=int(1000 * CMD_TIMEOUT), nak_retries=1,
            enq_retries=1, **MODES[mode])  # type: ignore[arg-type]
        self.listener = Recorder(self.clock)
        self.driver = Driver(self.network, self.mappings, DriverSettings(), self.listener)
        self.plc = simulated_plc(1, 'PLC5', self.clock, ('N7:0', 4), ('N9:0', 4), ('N10:0', 4))
        self.guests = [Guest(f'pty:{number}', ShareAccess.ALL)
                       for number in range(self.dice.choice([1, 2, 16]))]
        self.asks = 0.0  # how often a guest does, by chance in a turn
        self.asked: list[Packet] = []
        self.answered: list[Packet] = []
        self.holds = 0.0  # how often a gateway keeps a write for a while
        self.held: list[tuple[float, int, Packet]] = []
        far = self._peer() if mode == 'Peer' else self._slave()
        hear = far.receive_data
        far.receive_data = lambda data, now: hear(  # type: ignore[method-assign]
            data.replace(DAMAGED, b'ZYZZ'), now)
        self.line = VirtualLine(self.driver.machine, far, baud=19200, chunk=8, seed=seed)
        self.published: dict[int, float] = {}
        self.beats: list[tuple[float, int]] = []
        self.executed: list[tuple[float, int, int, float]] = []
        self.is_alive = True
        self.refuses = False  # everything but heartbeats
        self.refuses_messages = self.swallows_replies = False  # fallbacks are taken
        self.stood = [0.0, 0.0]  # from when each output's time counts
        self.troubled = 0.0  # when something was wrong last
        self.seen = 0  # results
        self.swallowed = -math.inf  # when a reply was lost last
        self.well_since = -math.inf  # nothing has been wrong but what guests do
        self.changes = 0  # of the station, as far as they are known
        self._values = itertools.count(1)
        self._tickets = itertools.count()
        self._outputs = parse_address('N7:0', self.plc.table.plc_type)

    def _slave(self) -> Machine:
        if self.is_behind:
            self.plc.station = GATEWAY
        self.plc.slave = HalfDuplexSlave(LinkSettings(station=self.plc.station), self._serve)
        return Machine(multidrop([self.plc]), checksum=self.network.checksum)

    def _peer(self) -> Machine:
        self.plc.be_full_duplex()
        return Machine(
            lambda machine: FullDuplexPeer(
                machine, LinkSettings(station=None, checksum=self.network.checksum),
                ActiveStationList(),
                self._serve).run(self.plc),
            checksum=self.network.checksum, duplex=Duplex.FULL)

    def clock(self) -> float:
        """Return the time."""
        return self.line.now if hasattr(self, 'line') else 0.0

    def _serve(self, command: Packet) -> Packet:
        if _is_write(command) and self.dice.random() < self.holds:
            late = self.line.now + self.dice.uniform(0.0, 2 * CMD_TIMEOUT - STEP)
            heapq.heappush(self.held, (late, next(self._tickets), command))
            return command.reply(sts=0x02)
        return self._carry_out(command, self.line.now)

    def _let_go(self) -> None:
        """Let the gateway deliver what it has kept for its time."""
        while self.held and self.held[0][0] <= self.line.now:
            self._carry_out(heapq.heappop(self.held)[2], self.line.now + 2 * CMD_TIMEOUT)

    def _carry_out(self, command: Packet, stands_until: float) -> Packet:
        """Execute a command; what comes late of it may stand up to then (clock value in s)."""
        before = self.words()
        saved = self.plc.table.read(self._outputs, 2)
        reply = self.plc.serve(command)
        after = self.words()
        changed = {new for new, old in zip(after[:2], before[:2], strict=True) if new != old}
        if changed and (self.refuses or self.refuses_messages and SAFE not in changed):
            self.plc.table.write(self._outputs, saved)
            return command.reply(sts=0x10)
        is_late = stands_until > self.line.now
        if after[2] != before[2] and after[2] not in GUESTS and not is_late:
            self._beaten(after[2])
        for number in range(2):
            if after[number] != before[number]:
                self._changed(number, before[number], after[number], stands_until)
        if changed and self.swallows_replies and SAFE not in changed:
            self.swallowed = self.line.now
            reply = reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for
        return reply

    def _changed(self, number: int, before: int, after: int, stands_until: float) -> None:
        """Take note of an output that has another value."""
        is_late = stands_until > self.line.now
        if after not in GUESTS and not is_late:
            sent = self.driver.interlocks.fallbacks[number].sent
            self.executed.append((self.line.now, number, after, sent))
        if after in GUESTS or is_late:
            if before in (SAFE, 0):  # it has to be written over at once
                self.stood[number] = stands_until - AFTER
            elif is_late:
                self.stood[number] = max(self.stood[number], stands_until - AFTER)
        elif before in (SAFE, 0):
            self.stood[number] = self.published.get(after, math.inf)

    def words(self) -> list[int]:
        """Return both outputs and the heartbeat."""
        return [int.from_bytes(self.plc.table.read(
            parse_address(text, self.plc.table.plc_type), 1), 'little')
            for text in ('N7:0', 'N7:1', 'N10:0')]

    def _beaten(self, value: int) -> None:
        """Check that no fallback was due when a counting heartbeat left (rule 3 b)."""
        self.beats.append((self.line.now, value))
        for row in self.driver.interlocks.fallbacks:
            is_due = row.cause is not None and row._due_since < self.line.now - FLIGHT
            assert not (value and is_due), (self.line.now, row.cause)

    def publish(self, row: Mapping) -> None:
        """Publish a value that nobody has published before, which may have come here late."""
        value = next(self._values) % 31_000 + 1
        late = self.dice.uniform(0.0, 1.2 * AFTER) if self.dice.random() < 0.2 else 0.0
        self.published[value] = self.line.now - late
        self.driver.write([row], [value], self.line.now - late)
        self.line.wake(self.driver.machine)

    def ask(self, words: Iterable[str]) -> None:
        """Let a guest write one of these words, to one or to all, or what no PLC knows."""
        guest, dice = self.dice.choice(self.guests), self.dice
        row = make_mapping(dice.choice([*words]), 'Write')
        cmd, data = row.dialect.write(row.address, dice.choice(GUESTS).to_bytes(2, 'little'))
        dst = 1
        if dice.random() < 0.2:
            cmd, data = dice.choice([(0x06, DAMAGED * 50), (0x0F, b'\x68\0\0'), (0x0F, b'\x3A')])
        elif dice.random() < 0.2 and self.network.mode == 'Master':
            dst = 255
        command = Packet(dst, 9, cmd, 0, len(self.asked), data)
        self.asked.append(command)
        self.driver.guests.put(GuestCommand(
            guest, command, self.line.now, self.answered.append))
        self.line.wake(self.driver.machine)

    def pass_time(self, seconds: float) -> None:
        """Let time pass on the line, and for what a gateway keeps."""
        end = self.line.now + seconds
        while self.held and self.held[0][0] <= end:
            self.line.run_for(max(0.0, self.held[0][0] - self.line.now))
            self._let_go()
        self.line.run_for(end - self.line.now)
        self._let_go()

    def run(self) -> None:
        """Let time pass, with all that can happen."""
        self.line.start()
        rates = [0.0, 0.0]
        until = 0.0
        for _ in range(int(SECONDS / STEP)):
            if self.is_alive:
                self.driver.interlocks.executor_ran(self.line.now)
            if self.line.now >= until:
                rates = [self.dice.choice([0.0, 0.2, 0.9, 4.0]) for _ in range(2)]
                until = self.line.now + self.dice.uniform(1.0, 4.0)
                self._trouble()
                if self.refuses_messages:  # long enough to see who keeps an output alive
                    rates, until = [0.9, 4.0], until + 2.0
            for turn in range(TURNS):
                for row, rate in zip(self.rows, rates, strict=True):
                    if turn < rate and self.dice.random() < rate:
                        self.publish(row)
                if self.dice.random() < self.asks:
                    self.ask(('N7:0', 'N7:1', 'N9:3'))
                self.pass_time(STEP / TURNS)
            self._check_outputs()
            self._check_view()

    def recover(self) -> None:
        """End what is wrong, and publish until a message of each row must be written."""
        self._end_trouble()
        for _ in range(int(RECOVERY / STEP)):
            self.driver.interlocks.executor_ran(self.line.now)
            for row in self.rows:
                self.publish(row)
            self.pass_time(STEP)
            self._check_view()
        assert [beat for when, beat in self.beats if beat and when > self.line.now - 1.0]

    def end(self) -> None:
        """
        End in order at any moment, often with writes that wait or are under way (rule 5).

        They are of messages and guests, and a gateway may keep them.
        """
        self.driver.interlocks.executor_ran(self.line.now)
        self.pass_time(self.dice.choice([0.0, 0.3, AFTER + 0.3]))
        self.holds = self.dice.choice([0.0, 0.5])
        for row in self.rows if self.dice.random() < 0.7 else ():
            self.publish(row)
        for _ in range(self.dice.randrange(3)):
            self.ask(('N7:0', 'N7:1', 'N10:0'))
            self.pass_time(self.dice.uniform(0.0, 0.1))
        self.driver.interlocks.wind_down()
        self.holds = 0.0
        self.line.wake(self.driver.machine)
        give_up = self.line.now + 2.0
        while not self.driver.interlocks.is_over:
            assert self.line.now < give_up
            self.pass_time(0.005)
        self.driver.machine.stop(PortLost('the end'))
        self.pass_time(2 * CMD_TIMEOUT)
        assert self.words() == [SAFE, SAFE, 0]

    def reload(self) -> None:
        """Put another driver, with new files, in the place of one that has ended."""
        driver = Driver(self.network, self.mappings, DriverSettings(), self.listener)
        self.line.exchange(self.driver.machine, driver.machine)
        self.driver = driver
        driver.machine.start(self.line.now)
        self.line.wake(driver.machine)

    def _end_trouble(self) -> None:
        self.plc.faults.silent = self.refuses = False
        self.refuses_messages = self.swallows_replies = False
        self.plc.processor.setting = Setting.RUN
        self.is_alive = True
        self.line.noise = QUIET
        self.asks = self.holds = 0.0

    def _trouble(self) -> None:
        """End what is wrong, and let something else go wrong."""
        self._end_trouble()
        machine = self.driver.machine
        what = self.dice.randrange(18)
        if what < 2:
            self.line.noise = SMALL
        elif what == 2:
            self.plc.faults.silent = True
        elif what == 3:
            self.refuses = True
        elif what == 4:
            machine.stop(PortLost('unplugged'))
            machine.start(self.line.now)
        elif what == 5:
            self.line.pause(machine, self.dice.uniform(0.2, 3.0))
        elif what == 6:
            self.is_alive = False
        elif what == 7:
            self.plc.processor.setting = Setting.PROGRAM
        elif what in (8, 9):
            self.refuses_messages = True
        elif what == 10:
            self.swallows_replies = True
        elif what < 15:
            self.asks = self.dice.choice([0.02, 0.05, 0.3])
            self.holds = self.dice.choice([0.0, 0.0, 0.3])
        elif what == 15:
            self.holds = 0.3

    @property
    def is_sound(self) -> bool:
        """Tell whether station and bridge work."""
        is_quiet = self.line.noise is QUIET and not self.plc.faults.silent and not self.refuses
        return is_quiet and self.driver.is_online and self.driver.stations[1].active \
            and self.line._away[0] <= self.line.now

    def _check_view(self) -> None:
        """Check that a station which answers all of ours is not taken for one that does not."""
        now, changes = self.line.now, len(self.listener.changes)
        is_known = self.changes == changes and self.driver.stations[1].replies_in_time
        is_wrong = self.line.noise is not QUIET or self.plc.faults.silent or self.holds \
            or self.swallows_replies or not self.driver.is_online or self.line._away[0] > now
        is_settled = not is_wrong and now > self.well_since + SETTLED
        assert is_known or not is_settled, f'{now}: {self.driver.stations[1]}'
        if is_wrong or not is_known:
            self.well_since = now
        self.changes = changes

    def _check_outputs(self) -> None:
        """Check that nothing but the fallback stands for long (rules 7, 8)."""
        for result in self.listener.results[self.seen:]:
            if result.outcome is Outcome.WRITTEN:
                number = self.rows.index(result.mapping)
                value = int(result.value.strip('[]'))
                self.stood[number] = max(self.stood[number], self.published[value])
        self.seen = len(self.listener.results)
        if not self.is_sound:
            self.troubled = self.line.now
            return
        if self.holds:
            self.swallowed = self.line.now
        # Where replies are lost, a message of each row may wait for that of the other.
        turns = 2 if self.line.now < self.swallowed + 5 * AFTER else 1
        longest = self.network.line_mode.longest_transaction(self.network.line, 0.0)
        bound = AFTER + turns * longest + STEP
        if self.line.now < self.troubled + bound:
            return
        for number, value in enumerate(self.words()[:2]):
            if value not in (SAFE, 0):
                assert self.line.now - self.stood[number] < bound, (self.line.now, number)


@pytest.mark.parametrize('mode', MODES)
@settings(max_examples=4, phases=[Phase.generate])  # a smaller seed is no simpler a case
@given(seed=st.integers(0, 2**32))
def test_whatever_happens_no_beat_vouches_for_it_and_no_output_stands(
        mode: str, seed: int) -> None:
    world = World(mode, seed)
    world.run()
    assert len(world.beats) > 5
    for (when, number, value, sent) in world.executed:
        if value != SAFE:  # nothing that was published before a fallback is executed after it
            assert world.published[value] > sent, (when, number)
    outcomes = [result.outcome for result in world.listener.results]
    assert Outcome.FALLBACK in outcomes
    world.recover()
    afterwards = world.listener.results[len(outcomes):]
    assert {result.mapping for result in afterwards if result.outcome is Outcome.WRITTEN} \
        == {*world.rows}
    world.end()
    for _ in range(2):
        world.reload()
        world.recover()
        world.end()
    outcomes = [result.outcome for result in world.listener.results]
    asked = len(world.published)
    told = len([outcome for outcome in outcomes if outcome is not Outcome.FALLBACK])
    assert asked == told
    assert sorted(reply.tns for reply in world.answered) == [*range(len(world.asked))]


@pytest.mark.parametrize('mode', MODES)
def test_guest_that_is_blamed_for_the_station_is_seen(
        mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def calm(seed: int) -> World:
        """Return a world where nothing goes wrong but what guests do."""
        world = World(mode, seed)
        monkeypatch.setattr(world, '_trouble', lambda: setattr(world, 'asks', 0.05))
        return world

    calm(0).run()
    monkeypatch.setattr(GuestJob, 'blames', True)
    with pytest.raises(AssertionError, match='Station'):
        for seed in range(4):
            calm(seed).run()
