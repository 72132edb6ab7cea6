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
Days of a plant in minutes: any plants, with every kind of fault, and all rules at every step.

``run.py --hours 1`` simulates until so many hours have passed on the virtual clock, ``--seconds
60`` until so many seconds of processor time have. A seed and a commit replay a run to the byte:
``--seed 7 --plants 1`` is the plant that failed. It prints seed, hours, and how many times faster
than real it ran.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
import math
from pathlib import Path
from random import Random
import secrets
import sys
import time

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.settings.heartbeats import HAND_OVER, READS_IN_TIME
from simulate.rules import Broken, Judge
from simulate.steady import Steady
from support.devices import DEVICES
from support.virtual_line import QUIET
from support.world import BEAT, FREE, GREAT, MODES, OUTPUTS, Plant, SAFE, SMALL, STEP, USUAL, World

TURNS = 8  # troubles of a plant, with a calm after each
RATES = (0.0, 0.0, 0.01, 0.05, 0.2)  # messages a step and row
RECOVERY = 40.0  # s at most; an inactive station is probed every few seconds


class Story:
    """
    What happens to one plant: so many ``turns`` of trouble and calm, and the end.

    Before it, if ``is_steady``, topics are published at a rate on a line of their own.
    """

    def __init__(self, seed: int, mode: str = '', turns: int = TURNS, *,
                 is_steady: bool = True) -> None:
        self.dice = Random(seed)
        self._is_steady = is_steady
        self._turns = turns
        self.world = World(Plant.drawn(self.dice, mode), seed)
        self.judge = Judge(self.world)
        self.troubles: Counter[str] = Counter()
        self._rates: dict[str, float] = {}
        # Only such a port can be queued at, only a gateway keeps writes: they come more often.
        self._likely = [_QUEUED] * 4 * self.world.plant.may_store \
            + [_NEW_FILES] * 4 * (self.world.plant.gateway is not None)

    def run(self) -> None:
        """Let it happen; raise Broken where a rule does not hold."""
        if self._is_steady and (text := Steady(self.world.seed).fault()):
            raise Broken('Steady', text, self.world)
        self.wait(2.0)
        for _ in range(self._turns):
            self._publish_anew()
            station = self.dice.randrange(1, self.world.plant.stations + 1)
            name = self.dice.choice([*_TROUBLES, *self._likely])
            self.troubles[name] += 1
            _TROUBLES[name](self, station)
            if name == _NO_EXCUSE:  # for an output that stands
                self.wait(self.longest_bound() + 2.0)
            self._ail(station, self.dice.uniform(0.5, 4.0), is_ill=name not in _EXPECTED)
            self._calm_down()
        self._recover()
        self._end()

    def _publish_anew(self) -> None:
        for row in self.world.messages:
            self._rates[row.tag] = self.dice.choice(RATES)

    def _ail(self, station: int, seconds: float, *, is_ill: bool) -> None:
        """Let something be wrong for a while, then nothing any more."""
        self.endure(station, seconds, is_ill=is_ill)
        self.world.mend()
        if is_ill:
            self._mark(station)

    def endure(self, station: int, seconds: float, *, is_ill: bool = True) -> None:
        """Let something be wrong for a while."""
        end = self.world.line.now + seconds
        while self.world.line.now < end:
            if is_ill:
                self._mark(station)
            self.wait(STEP)

    def _mark(self, station: int) -> None:
        """Keep that something was wrong, with a PLC or (0) with the line."""
        world = self.world
        world.ill[station] = world.line.now
        if world.line.noise is not QUIET or world.line.now < world.away or not world.is_alive \
                or not world.driver.is_online or world.is_unheard \
                or world.odd is not USUAL or world.odd_rows:
            world.ill[0] = max(world.line.now, world.away)

    def publish_much(self) -> None:
        """Let all publish often until the next trouble."""
        self._rates = dict.fromkeys(self._rates, max(RATES))

    def be_quiet(self) -> None:
        """Let nobody publish until the next trouble."""
        self._rates.clear()

    def longest_bound(self) -> float:
        """Return the longest bound that is printed, or 21 s where that is longer."""
        return min(21.0, max(limit or 0.0 for limit in self.world.bounds.values()))

    def _calm_down(self) -> None:
        """Let things be well until the bounds hold again, most often with fewer messages."""
        world = self.world
        end = world.line.now + self.longest_bound() + 9.0
        half = world.line.now + self.dice.uniform(0.0, 4.0)
        while world.line.now < end:
            if world.line.now >= half:
                half = math.inf
                self._publish_anew()
            self.wait(STEP)

    def wait(self, seconds: float) -> None:
        """Let time pass, with messages, and look at each step."""
        world = self.world
        end = world.line.now + seconds - STEP / 2
        while world.line.now < end:
            for row in world.messages:
                if self.dice.random() < self._rates.get(row.tag, 0.0):
                    late = self.dice.uniform(0.0, 1.2) if self.dice.random() < 0.1 else 0.0
                    world.publish(row, late)
            world.run(STEP)
            for number, ill in world.ill.items():  # until it is known to answer again
                if number and not world.driver.stations[number].replies_in_time \
                        and max(ill, world.ill[0]) > world.line.now - world.longest - 2 * STEP:
                    world.ill[number] = world.line.now
            self.judge.look()

    def _recover(self) -> None:
        """
        See that all is as at first when nothing is wrong any more: values, writes, beats.

        On a line so full that a counter is read too rarely, rows that depend on it stay withheld.
        A row that was written makes way once its PLC has a beat, which may need new values of it:
        a full line drops most values, and takes one from each row only if the others make way.
        """
        world = self.world
        self._rates.clear()
        limit = max(RECOVERY, 6 * world.longest)
        results, executed, reads = len(world.results), len(world.executed), len(world.reads)
        end = world.line.now + limit
        wanted = {row.tag for row in world.messages} if not world.plant.is_read_only else set()
        wanted |= {row.tag for row in world.rows.values() if row.reads and not row.serves}
        if not world.plant.is_read_only:
            wanted |= {f'beat_{number}' for number in world.plcs
                       if number not in self.judge.owner.since}
        while wanted and world.line.now < end:
            for row in world.messages:
                if self.dice.random() < 0.02 and wanted & {row.tag, f'beat_{row.station}'}:
                    world.publish(row)
            self.wait(STEP)
            wanted -= {result.mapping.tag for result in world.results[results:]
                       if result.outcome is Outcome.WRITTEN}
            wanted -= {entry.tag for entry in world.executed[executed:]
                       if entry.tag.startswith('beat') and entry.value}
            wanted -= {mapping.tag for _, mapping, _ in world.reads[reads:]}
        cycle = world.driver.readings.reads.poll_cycle or 0.0
        if READS_IN_TIME * cycle > world.plant.counts_within / 1000:
            wanted -= {row.tag for row in world.rows.values() if row.tag.startswith('counted')}
        if wanted:
            raise Broken('Recovery', f'{sorted(wanted)} not back after {limit} s', world)

    def _end(self) -> None:
        """End in order at any moment (rule 5), reload, and end again."""
        world = self.world
        if world.plant.is_read_only or world.plant.mode == 'Radio':
            return
        for _ in range(2):
            # With writes that are done, under way, and wait, some of them kept by a gateway.
            world.holds = self.dice.choice([0.0, 0.5]) if world.plant.gateway else 0.0
            for pause in (0.0, 0.1, 0.5):
                for row in world.messages:
                    world.publish(row)
                for _ in range(self.dice.randrange(3)):
                    world.ask(1, self.dice.choice([OUTPUTS, BEAT]))
                world.run(pause * self.dice.random())
            if world.plant.stations == 1 and not world.holds and self.dice.random() < 0.3:
                world.break_wire()
                world.run(self.dice.uniform(0.0, 1.0))
            elif self.dice.random() < 0.3:
                world.unplug_for(self.dice.uniform(0.0, 1.5))
            if self.dice.random() < 0.5:  # not seen by us, and perhaps over a fallback that stands
                world.run(self.dice.choice([0.0, world.plant.after / 1000 + 0.5]))
                world.overwrite(1)
            world.end()
            if world.is_deaf:
                self._mark(1)
            self.judge.over()
            if not world.is_deaf:  # then the judge knows what was sent
                self._demand_safe_words()
            world.mend()
            world.begin()
            self._recover()

    def reload(self) -> None:
        """Read new files; what is not safe by then is named (rule 5)."""
        world = self.world
        world.wind_down(HAND_OVER)
        self.judge.look()  # at what came for the rows of before
        interlocks = world.driver.kernel
        named = interlocks.end.unconfirmed(world.line.now) + interlocks.end.not_repeated()
        if not world.plant.is_read_only:
            self._demand_safe_words(text.partition(' ')[0] for text in named)
        world.reload()
        self.judge.look()

    def _demand_safe_words(self, named: Iterable[str] = ()) -> None:
        world, left_out = self.world, {*named}
        for station, watched in world.plcs.items():
            words = {row.tag: watched.held(row)
                     for row in world.rows_of(station, ('w', 'beat')) if row.tag not in left_out}
            is_zero = not words.get(f'beat_{station}') or station in self.judge.owner.since
            if {value for tag, value in words.items() if tag[0] == 'w'} - {SAFE} or not is_zero:
                raise Broken('End', f'not in order (5): {words}', world)


def _noise(story: Story, station: int) -> None:
    story.world.line.noise = story.dice.choice([SMALL, GREAT])


def _silence(story: Story, station: int) -> None:
    story.world.fall_silent(station)


def _refusal(story: Story, station: int) -> None:
    story.world.plcs[station].refuses = True


def _refused_messages(story: Story, station: int) -> None:
    """Refuse what keeps coming, over an output that stands."""
    story.publish_much()
    story.wait(1.0)
    story.world.plcs[station].refuses_messages = True


def _lost_replies(story: Story, station: int) -> None:
    story.world.plcs[station].swallows_replies = True


def _lost_port(story: Story, station: int) -> None:
    story.world.unplug()


def _pause(story: Story, station: int) -> None:
    story.world.hold_up(story.dice.uniform(0.2, 3.0))
    if story.dice.random() < 0.5:  # what comes now waits all the time, and nothing after it
        for row in story.world.messages:
            story.world.publish(row)
        story.be_quiet()


def _clock_ahead(story: Story, station: int) -> None:
    """Let the clock of the publishers be ahead, and their messages come late."""
    world = story.world
    lead = world.clocks.lead = story.dice.choice([0.04, 0.3, 1.0, 1.9, 3.0])
    story.publish_much()
    story.wait(story.dice.choice([0.0, 1.0]))
    world.hold_up(lead * story.dice.uniform(0.6, 1.4))


def _clock_set(story: Story, station: int) -> None:
    """Set the clock, and set it again when the trouble ends."""
    story.publish_much()
    story.wait(1.0)
    story.world.clocks.set(story.dice.uniform(-3.0, 3.0), story.world.line.now)
    if story.dice.random() < 0.5:
        story.world.hold_up(story.dice.uniform(0.0, 2.0))


def _hung_executor(story: Story, station: int) -> None:
    story.world.is_alive = False


def _program(story: Story, station: int) -> None:
    story.world.plcs[station].set_mode(Setting.PROGRAM, story.world.line.now)
    if story.dice.random() < 0.5:  # for guarded values to be withheld
        story.wait(story.world.longest_patience + 1.0)


def _download(story: Story, station: int) -> None:
    story.world.save(station)
    story.world.at(story.world.line.now + 0.3, lambda: story.world.download(station))


def _kill(story: Story, station: int) -> None:
    story.world.kill(story.dice.choice([0.0, 0.5, 2.0]))


def _new_files(story: Story, station: int) -> None:
    """Read new files, perhaps after writes that a gateway still keeps, or without the port."""
    world = story.world
    if story.dice.random() < 0.5:
        story.publish_much()
    else:  # for safe values to stand
        story.be_quiet()
        story.wait(max(world.plant.after, world.plant.requires or 0) / 1000 + 1.0)
    world.holds = story.dice.choice([0.0, 0.5]) if world.plant.gateway else 0.0
    story.wait(story.dice.uniform(0.0, 2.0))
    if not world.holds and story.dice.random() < 0.3:
        world.unplug_for(story.dice.uniform(0.0, 2.5))
    story.reload()


def _slowness(story: Story, station: int) -> None:
    plc = story.world.plcs[station].plc
    plc.faults.delay = story.dice.uniform(0.05, 0.4)
    story.world.at(story.world.line.now + 0.5, lambda: setattr(plc.faults, 'delay', 0.0))


def _guest(story: Story, station: int) -> None:
    world = story.world
    for number in range(story.dice.randrange(1, 12)):
        place = story.dice.choice([OUTPUTS, FREE])
        world.at(world.line.now + 0.3 * number, partial(world.ask, station, place))


def _lost_frames(story: Story, station: int) -> None:
    """Lose frames, while nobody publishes: no bound is excused by that."""
    if story.world.network.mode != 'Slave':
        story.world.lose_frames()
        story.wait(story.dice.uniform(2.0, 5.0))
        story.be_quiet()
        story.wait(story.longest_bound() + 2.0)


def _broken_wire(story: Story, station: int) -> None:
    """Let PLCs execute what they are not heard to answer, and then nobody publish any more."""
    if story.world.network.mode != 'Slave':
        story.world.break_wire()
        story.endure(station, story.dice.uniform(0.0, 3.0))
        story.be_quiet()
        story.endure(station, story.longest_bound() + 2.0)


def _queued(story: Story, station: int) -> None:
    if story.world.plant.may_store and story.world.network.mode != 'Slave':
        story.world.be_queued()


def _overwritten(story: Story, station: int) -> None:
    story.be_quiet()  # for the fallback to stand
    story.wait(story.world.plant.after / 1000 + 1.0)
    story.world.overwrite(station)


def _gateway_holds(story: Story, station: int) -> None:
    story.world.holds = 0.3 if story.world.plant.gateway else 0.0


def _other_writer(story: Story, station: int) -> None:
    """Let another one count for so long that both know of each other."""
    world = story.world
    if station in story.judge.owner.since:
        return
    story.judge.owner.since[station] = world.line.now

    def count() -> None:
        world.write_heartbeat(station)
        world.at(world.line.now + 0.7 * world.plant.period / 1000, count)

    count()


def _other_bridge(story: Story, station: int) -> None:
    """Put another bridge on the heartbeat of a PLC, for so long that both know of each other."""
    world = story.world
    if station not in story.judge.owner.since:
        story.judge.owner.since[station] = world.line.now
        world.add_bridge(station)


def _crowd(story: Story, station: int) -> None:
    """Let a second one publish on a topic that should have one, for a while or for a moment."""
    world = story.world
    story.publish_much()
    story.wait(1.0)
    row = story.dice.choice(world.rows_of(station))
    if story.dice.random() < 0.3:
        world.crowd(row, is_told=False)
        world.part()
    else:
        world.crowd(row)
        story.wait(story.longest_bound())


def _odd_device(story: Story, station: int) -> None:
    """Let the PLCs behave like a device that somebody has met."""
    mode = {'Gateway': 'Message', 'Standard gateway': 'Standard'}.get(
        story.world.plant.mode, story.world.plant.mode)
    # One that is far away needs a longer Timeout than a plant has.
    devices = [device for device in DEVICES if mode in device.modes and not device.propagation]
    if devices:
        story.world.behave_oddly(story.dice.choice(devices))


def _odd_rows(story: Story, station: int) -> None:
    """Damage all replies of some rows, until they are known and for some time more."""
    world, dice = story.world, story.dice
    if world.network.mode == 'Slave':
        return
    share = dice.choice([0.2, 0.5, 0.8])
    rows = [row.tag for row in world.rows.values() if row.reads and not row.serves]
    world.damage_rows(tag for tag in rows if dice.random() < share)
    story.be_quiet()
    # A try has its share of the line, each row has three, and each division of a block one.
    a_try = world.network.line.cmd_timeout * (1 + world.plant.retries)
    story.endure(station, 6 * a_try * len(rows))
    world.odd_known = world.line.now
    story.wait(20.0)


_NO_EXCUSE, _QUEUED, _NEW_FILES = 'messages refused', 'queued', 'new files'
# Which excuse nothing.
_EXPECTED = (
    'guest', 'gateway holds', 'another network', 'frames lost', 'odd rows', 'two publishers')
_TROUBLES: dict[str, Callable[[Story, int], None]] = {
    'noise': _noise, 'silence': _silence, 'refusal': _refusal,
    _NO_EXCUSE: _refused_messages, 'replies lost': _lost_replies,
    'port lost': _lost_port, 'process stands still': _pause, 'clock ahead': _clock_ahead,
    'clock set': _clock_set, 'executor hangs': _hung_executor,
    'PROGRAM': _program, 'download': _download, 'killed': _kill, 'slow PLC': _slowness,
    'other writer': _other_writer, 'other bridge': _other_bridge, 'guest': _guest,
    'gateway holds': _gateway_holds, 'frames lost': _lost_frames, 'another network': _overwritten,
    'receive wire broken': _broken_wire, _NEW_FILES: _new_files, _QUEUED: _queued,
    'odd device': _odd_device, 'odd rows': _odd_rows, 'two publishers': _crowd}


@dataclass(slots=True)
class Totals:
    """What was simulated."""

    plants: int = 0
    seconds: float = 0.0
    messages: int = 0
    values: int = 0
    executed: int = 0
    troubles: Counter[str] = field(default_factory=Counter)
    modes: Counter[str] = field(default_factory=Counter)

    def add(self, story: Story) -> None:
        """Add a plant."""
        world = story.world
        self.plants += 1
        self.seconds += world.line.now
        self.messages += len(world.published)
        self.values += len(world.reads)
        self.executed += len(world.executed)
        self.troubles += story.troubles
        self.modes[world.plant.mode] += 1


def simulate(seed: int, is_enough: Callable[[Totals], bool], mode: str = '',
             turns: int = TURNS, *, is_steady: bool = True) -> Totals:
    """Simulate plants of any or one mode, ``seed`` first and then the next; raise Broken."""
    totals = Totals()
    while not is_enough(totals):
        story = Story(seed + totals.plants, mode, turns, is_steady=is_steady)
        story.run()
        totals.add(story)
    return totals


def main() -> int:
    """Simulate; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--hours', type=float, default=math.inf, help='to simulate')
    parser.add_argument('--seconds', type=float, default=math.inf, help='of processor time')
    parser.add_argument('--plants', type=int, default=math.inf)
    parser.add_argument('--mode', choices=MODES, default='', help='of all plants')
    parser.add_argument('--turns', type=int, default=TURNS, help='of trouble in each plant')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(10**9))
    wanted = parser.parse_args()
    if math.inf == wanted.hours == wanted.seconds == wanted.plants:
        wanted.hours = 1.0
    begun = time.process_time()
    print(f'seed {wanted.seed}', flush=True)

    def is_enough(totals: Totals) -> bool:
        return bool(totals.seconds >= 3600 * wanted.hours or totals.plants >= wanted.plants
                    or time.process_time() - begun >= wanted.seconds)

    try:
        totals = simulate(wanted.seed, is_enough, wanted.mode, wanted.turns)
    except Broken as broken:
        print(f'FAILED {broken}')
        return 1
    took = time.process_time() - begun
    print(f'{totals.plants} plants, {totals.seconds / 3600:.2f} h in {took:.0f} s of a processor, '
          f'{totals.seconds / took:.0f} times faster than real: {totals.messages} messages, '
          f'{totals.executed} words executed, {totals.values} values')
    for counts in (totals.modes, totals.troubles):
        print(', '.join(f'{name} {count}' for name, count in sorted(counts.items())))
    return 0


if __name__ == '__main__':
    sys.exit(main())
