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
What has to hold at every step of a simulated plant, whatever goes wrong.

The numbers are those of docs/heartbeats.md. A rule looks at what came since its last look, from
outside: at words that PLCs have executed, at values and results, not at the state of the driver.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
import math
from operator import attrgetter
import re

from abdf1_ros.conform.codec import BlockCheck, next_symbol, SymbolKind
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import MOST_LATE
from abdf1_ros.df1.probes import OTHERS_SHARE
from abdf1_ros.df1.radio import LONGEST_WAIT
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.simulator.ladder import Lamp
from support.world import (
    Executed,
    FOREIGN,
    GUESTS,
    OTHERS,
    SAFE,
    Said,
    Sent,
    STEP,
    WatchedPlc,
    World,
)

_LEAST_ZERO = 0.5  # s
_LEAST_LIFE_SIGN = 1.0  # s
_MOMENT = 0.02  # s, for what goes out before it
_REWRITTEN = 5.0  # s after which a fallback is written again
_READ_BACK = 'read back: the PLC holds'
_READ_VALUE = re.compile(r'(\d+) was read where')
_READ_BACK_WITHIN = 2.0  # s, of a late value to its read
_LONGEST_REPLY = 400  # characters, with the poll for it
_REPEATED = 10.0  # s, until a number of a command may come again
_NEVER_EXECUTED = {Outcome.NOT_SENT, Outcome.REFUSED, Outcome.SUPERSEDED, Outcome.FAILED}


class Broken(AssertionError):
    """A rule does not hold, as ``check`` has found."""

    def __init__(self, check: str, text: str, world: World) -> None:
        super().__init__(f'{check}: {text} at {world.line.now:.3f} s of seed {world.seed}, '
                         f'{world.plant}')
        self.check = check


class Rule:
    """Something that has to hold, whatever is told of a world, and after each step of it."""

    text = ''

    def __init__(self, world: World) -> None:
        self.world = world
        # From the decision to send to its execution: all repetitions, and a step of the world.
        self.flight = world.longest + 2 * STEP
        # From the decision what is sent to the sending: by radio it waits for a quiet line.
        self.lag = _MOMENT + (LONGEST_WAIT if world.plant.mode == 'Radio' else 0.0)

    def sent(self, entry: Sent) -> None:
        """Judge what was put on the line."""

    def executed(self, entry: Executed) -> None:
        """Judge what a PLC has executed."""

    def told(self, result: WriteResult) -> None:
        """Judge a result."""

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        """Judge what was published."""

    def stand(self) -> None:
        """Judge how things stand."""

    def over(self) -> None:
        """Judge what is left after an orderly end."""

    @property
    def held(self) -> float:
        """Return for how long (s) what came for the process had to wait, as it stood still."""
        return 3.0 if self.world.line.now < self.world.away + self.flight else 0.0

    def demand(self, condition: bool, *what: object) -> None:
        """Raise Broken, with the seed that replays it, where something does not hold."""
        if not condition:
            raise Broken(type(self).__name__, f'{self.text}: {what}', self.world)


class Results(Rule):
    text = 'each message has one result, and the result is true'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        # Messages by their number, and the last look before they came.
        self._waits: dict[int, float] = {}
        self._ended: set[int] = set()
        # By tag and value: messages so far, those that were never to be sent, and when a PLC
        # executed a packet, by the first of its words in the row.
        self._asked: Counter[tuple[str, int]] = Counter()
        self._never: Counter[tuple[str, int]] = Counter()
        self._times: defaultdict[tuple[str, int], dict[int, list[float]]] = defaultdict(dict)
        self._safe: defaultdict[str, float] = defaultdict(lambda: -math.inf)
        self._seen = self._process = 0
        self._looked = 0.0
        # To wait, to be sent and polled for, to be read back, and while the process stood still.
        self._limit = 3 * world.plant.write_timeout + 4 * world.longest + 8.0

    def executed(self, entry: Executed) -> None:
        key = entry.tag, entry.value
        if entry.value == SAFE:
            self._safe[entry.tag] = entry.when
        if entry.tag[0] not in 'wf' or entry.value == SAFE or entry.value in GUESTS:
            return
        row = self.world.rows.get(entry.tag)
        if entry.is_late and row is not None and row.may_rewrite:
            return  # a late write of another bit brings this one back
        self.demand(key in self.world.published, key, 'was never published')
        self._times[key].setdefault(entry.at, []).append(entry.when)
        self._demand_few(key, 'was executed too often')

    def _demand_few(self, key: tuple[str, int], text: str) -> None:
        """Demand that no packet was executed more often than there are messages for it."""
        self._asked.update(self.world.keys[self._asked.total():])
        most = max(map(len, self._times[key].values()), default=0)
        self.demand(most <= self._asked[key] - self._never[key], key, text, self._times[key])

    def told(self, result: WriteResult) -> None:
        row = result.mapping
        if result.outcome is Outcome.FALLBACK:
            came = self._safe[row.tag]
            self.demand(row.serves or came > self._looked - self.flight - self.held, row.tag,
                        'got its fallback', came)
            return
        self.demand(bool(result.request), result, 'is of no message')
        number = int(result.request)
        key = self.world.keys[number]
        self.demand(number not in self._ended, key, 'has two results')
        self._ended.add(number)
        since = self._waits.pop(number, self._looked if number >= self._seen else -math.inf)
        if result.outcome is Outcome.WRITTEN and not row.serves:
            ends = [times[-1] for times in self._times[key].values()]
            self.demand(len(ends) >= self.world.forms.packets(row) and min(ends) >= since, key,
                        'is told as written', since, ends)
        elif result.outcome in _NEVER_EXECUTED:
            self._never[key] += 1
            self._demand_few(key, f'was executed, and told as {result.outcome}')

    def over(self) -> None:
        self.demand(not self._waits, [*map(self.world.keys.__getitem__, self._waits)],
                    'have no result')

    def stand(self) -> None:
        before, now = self._looked, self.world.line.now
        self._looked = now
        new = range(self._seen, len(self.world.keys))
        self._seen = len(self.world.keys)
        if self._process != self.world.process:  # what the killed one knew is gone
            self._process = self.world.process
            self._waits.clear()
            return
        self._waits.update((number, before) for number in new if number not in self._ended)
        number, came = next(iter(self._waits.items()), (0, math.inf))
        self.demand(now - came < self._limit, self.world.keys[number:number + 1], 'has no result')


class Stands(Rule):
    text = 'what is not written again is in the PLC, as was read lately (27)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._last: dict[str, Executed] = {}  # of our own line
        self._held: dict[str, tuple[int, float]] = {}  # and when it was seen last

    def executed(self, entry: Executed) -> None:
        self._last[entry.tag] = entry
        self._held[entry.tag] = entry.value, entry.when

    def stand(self) -> None:
        for tag, row in self.world.rows.items():
            if row.write_again is not None:
                value = self.world.plcs[row.station].held(row)
                if value == self._held.get(tag, (None, 0.0))[0]:
                    self._held[tag] = value, self.world.line.now

    def told(self, result: WriteResult) -> None:
        row = result.mapping
        if result.outcome is not Outcome.STANDS:
            return
        assert row.write_again is not None
        now, again = self.world.line.now, row.write_again / 1000
        _, value = self.world.keys[int(result.request)]
        last, (held, seen) = self._last.get(row.tag), self._held.get(row.tag, (None, 0.0))
        self.demand(not self.world.may_land(row.tag, value), result, 'another value may land')
        self.demand(last is not None and last.value == held == value, result, last)
        assert last is not None
        patience = row.fallback.after / 1000 if row.fallback else self.world.plant.write_timeout
        self.demand(now - last.when < again + self.flight, result, 'confirmed at', last.when)
        self.demand(now - seen < min(again, patience) + 2 * STEP, result, 'held until', seen)


class Ages(Rule):
    text = 'no message older than write_timeout or a fallback is sent (6, 7, 9)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._fallbacks: defaultdict[str, float] = defaultdict(lambda: -math.inf)
        self._stand: set[str] = set()  # what is written again then, goes before no message (8)

    def told(self, result: WriteResult) -> None:
        if result.outcome is Outcome.FALLBACK:
            self._stand.add(result.mapping.tag)

    def sent(self, entry: Sent) -> None:
        world, tag = self.world, entry.tag
        if tag[0] not in 'wf' or entry.value in GUESTS:
            return
        if entry.value == SAFE:
            if tag not in self._stand and not entry.is_again and not entry.at:
                self._fallbacks[tag] = entry.when
            return
        published = world.published[tag, entry.value]
        limit = world.plant.write_timeout
        row = world.rows.get(tag)
        if row is None or not row.fallback:  # new files have none, and are a new start (5)
            self.demand(entry.when - published < limit + _MOMENT, entry, published)
            return
        limit = min(limit, world.plant.after / 1000)
        self.demand(entry.when - published < limit + _MOMENT, entry, published)
        fallback = self._fallbacks[tag]
        self.demand(published > fallback - self.lag, entry, published,
                    'was published before the fallback of', fallback)

    def executed(self, entry: Executed) -> None:
        if entry.value not in GUESTS and entry.value != SAFE:
            self._stand.discard(entry.tag)


class Stamps(Rule):
    text = 'no clock makes a message younger than it is, by more than is allowed (7)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._seen = 0

    def stand(self) -> None:
        new = self.world.clocks.counted[self._seen:]
        self._seen += len(new)
        for tag, published, counted in new:
            allowed = self.world.clocks.allowed[tag]
            self.demand(allowed is None or counted - published <= allowed + 1e-6, tag,
                        'was published at', published, 'and counts from', counted)


class Turns(Rule):
    text = 'no message goes before a fallback of its station that is due (11)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._holds: dict[str, int] = {}  # the last value of ours
        self._tried: dict[str, float] = {}  # when the fallback was sent last
        self._silent: dict[int, float] = {}  # when messages to it were probes

    def stand(self) -> None:
        for station in self.world.driver.stations:
            if not (station.active and station.replies_in_time):
                self._silent[station.number] = self.world.line.now

    def executed(self, entry: Executed) -> None:
        if entry.value not in GUESTS and not entry.is_late:  # that comes in its own time (10)
            self._holds[entry.tag] = entry.value

    def sent(self, entry: Sent) -> None:
        world = self.world
        if entry.tag[0] in 'wf' and entry.value != SAFE and entry.value not in GUESTS \
                and not entry.is_again and entry.when > self.flight + max(
                    world.ill[entry.station], world.ill[0],  # no probe, and no try of before
                    self._silent.get(entry.station, 0.0)):
            limit = entry.when - world.plant.after / 1000 - self.lag
            due = [row.tag for row in world.rows_of(entry.station)
                   if self._holds.get(row.tag, SAFE) != SAFE and row.tag != entry.tag
                   and self._tried.get(row.tag, 0.0) - world.plant.after / 1000
                   < world.youngest.get(row.tag, math.inf) < limit]
            self.demand(not due, entry, 'before', due)
        elif entry.value == SAFE:
            self._tried[entry.tag] = entry.when


class Values(Rule):
    text = 'each value is one that the PLC has just had, whole'

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        name = tag.partition('_')[0]
        if name not in ('clock', 'running', 'counter', 'counted'):
            return
        world = self.world
        self.demand(len({*values}) == 1, tag, values, 'of two scans')
        showed = world.plcs[station].last_showed(values[0], when)
        self.demand(showed >= when - self.flight - self.held, tag, values, showed)


class Answers(Rule):
    text = 'a value is what the PLC has answered last, and no older than its read'

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        world, row = self.world, self.world.rows[tag]
        if row.serves:
            return
        self.demand(len(values) == row.length, tag, values, 'of a Length of', row.length)
        first, watched = row.address.offset, world.plcs[station]
        found = [watched.answered(row.address, first + at, when) for at in range(row.length)]
        self.demand(None not in found, tag, 'was never answered')
        self.demand([each and each[1] for each in found] == [value & 0xFFFF for value in values],
                    tag, values, 'but it answered', found)
        oldest = min(each[0] for each in found if each)
        packets = len({each[0] for each in found if each})
        limit = packets * self.flight + MOST_LATE
        self.demand(when - oldest < limit, tag, values, 'answered at', oldest)


class ReadBack(Rule):
    text = 'what is told of an unknown write after a read is what the PLC holds'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._sent: defaultdict[tuple[str, int], list[float]] = defaultdict(list)

    def sent(self, entry: Sent) -> None:
        self._sent[entry.tag, entry.value].append(entry.when)

    def told(self, result: WriteResult) -> None:
        if _READ_BACK not in result.detail:
            return
        row, number = result.mapping, int(result.request)
        _, value = self.world.keys[number]
        published = self.world.counts_from[number]
        when = published + result.latency
        sent = [each for each in self._sent[row.tag, value] if published <= each < when]
        found = self.world.plcs[row.station].answered(row.address, row.address.offset, when)
        self.demand(found is not None and found[0] >= max(sent), result, 'not read since', sent)
        is_held = result.detail.endswith(f'{_READ_BACK} the value')
        self.demand(found is not None and is_held == (found[1] == value), result,
                    'but it answered', found)


class Repeats(Rule):
    text = 'a command that comes again is executed once'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._seen = 0
        self._when: dict[tuple[object, ...], float] = {}

    def stand(self) -> None:
        world = self.world
        for when, station, command in world.commands[self._seen:]:
            key = world.drivers, station, command
            before = self._when.get(key, -math.inf)
            self.demand(when > before + _REPEATED, command, 'at', when, 'and', before)
            self._when[key] = when
        self._seen = len(world.commands)


class Taken(Rule):
    text = 'what a master writes is taken once, and nothing of what is refused'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._seen = self._driver = 0
        self._published = 0
        self._all: set[int] = set()  # that was published
        self._may_hold = {0}  # a new table has zeros

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        if tag == 'taken':
            number = values[0]
            self.demand({*values} == {number} and self._published < number, values, 'after',
                        self._published)
            self.demand(number % 4 == 1, values, 'was refused')
            self._published = number
            self._all.add(number)

    def stand(self) -> None:
        world = self.world
        if self._driver != world.drivers:
            self._driver = world.drivers
            self._may_hold.add(0)
        for entry in world.taken[self._seen:]:
            if isinstance(entry, Said):
                self._end(entry)
            else:
                self.demand(len({*entry}) == 1 and entry[0] in self._may_hold, 'it holds', entry,
                            'not', self._may_hold)
        self._seen = len(world.taken)

    def _end(self, said: Said) -> None:
        """Take the end of a write: an answer tells what the table holds."""
        self.demand(said.is_right or said.sts != 0, said, 'was not refused')
        if said.is_right and said.sts == 0:
            self.demand(said.value in self._all, said, 'was not published')
            self._may_hold = {said.value}
        elif said.is_right:
            self._may_hold.add(said.value)


class Guards(Rule):
    text = 'guarded values come only while the program runs (13, 14)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._patience = {mapping.tag: point.patience
                          for mapping, point in world.driver.points.items()}

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        if tag.startswith(('running', 'counted')):
            world = self.world
            # The counter was read an interval after its last change at most, and so was this row.
            limit = self._patience[tag] + 2 * self.flight + self.held + 0.5
            ran = world.plcs[station].ran(when)
            self.demand(when - ran <= limit, tag, ran)


class Withheld(Rule):
    text = 'a row that is read is published, or told to be withheld (15)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._read = dict.fromkeys(world.rows, 0.0)  # when each was published last
        self._begun: dict[tuple[int, int], float] = {}  # when a driver read of a station first
        self._new: set[int] = set()  # stations that were read since the last look

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        self._read[tag] = when
        if tag.startswith('clock'):  # with which the others are read, always
            self._begun.setdefault((station, self.world.drivers), when)
            self._new.add(station)

    def stand(self) -> None:
        world = self.world
        # With the port, blocks that were divided are joined again.
        is_together = world.driver.is_online and not world.is_divided
        rows = world.rows.values() if self._new and is_together else ()
        for row in rows:
            if row.is_guarded and row.station in self._new:
                point, asked = world.driver.points[row], self._read[f'clock_{row.station}']
                # At a start that is told when it has had its time to begin.
                begun = self._begun[row.station, world.drivers]
                has_failed_since = point.withheld and point.error is not None
                self.demand(self._read[row.tag] >= asked or point.is_withheld or has_failed_since
                            or asked < begun + point.patience, row.tag, 'was read at', asked)
        self._new.clear()


class Beats(Rule):
    text = 'a heartbeat is 0 first, for its time, and counts one by one for the living (1 to 3)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._last: dict[str, int] = {}
        self._zero: dict[str, float] = {}  # since when it is 0
        self._untold: set[str] = set()  # those whose last value was not confirmed
        self._over: set[str] = set()  # those over whose 0 a guest has written
        self._driver: dict[str, int] = {}
        self._stood = max(_LEAST_ZERO, world.plant.period / 1000)
        self._sent: dict[str, Sent] = {}

    def sent(self, entry: Sent) -> None:
        """Judge what a heartbeat vouches for when it goes out (3 c, d)."""
        world, plant = self.world, self.world.plant
        if not entry.tag.startswith('beat') or entry.value in GUESTS:
            return
        before = self._sent.get(entry.tag)
        self._sent[entry.tag] = entry
        if not entry.value:
            return
        limit = max(_LEAST_LIFE_SIGN, plant.period / 1000) + _MOMENT
        self.demand(entry.when - world.executor_ran < limit, entry,
                    'while the executor stands still since', world.executor_ran)
        if world.rows[entry.tag].condition:
            topic = f'w0_{entry.station}'
            came = world.youngest.get(topic, -math.inf)
            self.demand(entry.when - came < (plant.requires or 0) / 1000 + _MOMENT, entry,
                        'without a message since', came)
            gap = world.gaps.get(topic, math.inf)
            self.demand(not before or not before.value
                        or not before.when + _MOMENT < gap < entry.when - _MOMENT,
                        entry, 'without 0 although nothing came at', gap)

    def executed(self, entry: Executed) -> None:
        if not entry.tag.startswith(('beat', 'other')) or entry.is_late:
            return
        tag, value = entry.tag, entry.value
        if value in GUESTS:
            if entry.before == 0:
                self._over.add(tag)
            return
        last = self._last.get(tag)
        self.demand(not value or bool(last) or tag not in self._over, entry,
                    'after a guest wrote over the 0')
        self._over.discard(tag)
        is_ours = tag.startswith('beat')
        if self._driver.get(tag, -1) != (entry.driver if is_ours else 0):
            self.demand(value == 0, entry, 'is the first of a driver')
            self._driver[tag] = entry.driver if is_ours else 0
            self._zero[tag] = entry.when
        elif value == 0:
            if last:
                self._zero[tag] = entry.when
        else:
            following = () if tag in self._untold else (last and last % 32_767 + 1,)
            self.demand(not last or value in (last, *following), entry, 'after', last)
            if not last:
                stood = self._stood if is_ours else _LEAST_ZERO
                self.demand(entry.when - self._zero[tag] >= stood - 1e-6, entry,
                            '0 stood since', self._zero[tag])
        if entry.is_told:
            self._untold.discard(tag)
        else:
            self._untold.add(tag)
        self._last[tag] = value


class BeatsAfterFallbacks(Rule):
    text = 'no heartbeat counts while a fallback of its station is due or written over (3 b)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._over: dict[str, float] = {}  # since when a guest's value stands over a fallback
        self._holds: dict[str, Executed] = {}  # what came last of ours

    def executed(self, entry: Executed) -> None:
        if entry.tag[0] != 'w':
            return
        if entry.value not in GUESTS:
            self._over.pop(entry.tag, None)
            if not entry.is_late:
                self._holds[entry.tag] = entry
        elif entry.before == SAFE and not entry.is_late:
            self._over[entry.tag] = entry.when

    def sent(self, entry: Sent) -> None:
        world = self.world
        if not entry.tag.startswith('beat') or entry.value in (0, *GUESTS) \
                or entry.when <= world.killed_at:  # of the process before
            return
        for tag in [row.tag for row in world.rows_of(entry.station)]:
            holds, youngest = self._holds.get(tag), world.youngest.get(tag, -math.inf)
            self.demand(holds is not None and holds.driver == world.drivers,
                        entry, tag, 'has had no fallback', holds)
            assert holds is not None
            is_due = entry.when > youngest + world.plant.after / 1000 + _MOMENT
            self.demand(holds.value == SAFE or not is_due, entry, holds, 'is due', youngest)
            over = self._over.get(tag, math.inf)
            self.demand(max(entry.when, world.opened) - self.flight < over, entry, tag,
                        'has the value of a guest since', over)


class Order(Rule):
    text = 'at first contact come 0, the fallbacks, and then all else (2, 11)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._left: dict[int, set[str]] = {}  # what has not come yet, by station
        self._driver = -1

    def executed(self, entry: Executed) -> None:
        world, station = self.world, entry.station
        if self._driver != entry.driver:
            self._driver = entry.driver
            self._left = {number: {row.tag for row in world.rows_of(number, ('w', 'beat'))}
                          for number in world.plcs}
        is_own = entry.value in (0, SAFE) and entry.tag[0] in 'wb'
        left = self._left[station]
        # Not after a port that was lost and opened again: a fresh row needs no fallback then.
        # A PLC whose replies were lost until then may have no room for another one.
        is_well = max(world.ill[station], world.ill[0], world.opened) <= world.killed_at \
            and world.heard_again < world.killed_at and not world.holds
        if not left or not is_well or entry.value in GUESTS or entry.is_late \
                or entry.tag.startswith('other') or entry.driver != world.drivers:
            return
        self.demand(is_own, entry, 'before', left)
        self.demand(entry.tag.startswith('beat') or f'beat_{station}' not in left, entry, 'first')
        left.discard(entry.tag)


class Outputs(Rule):
    text = 'no output stands longer than printed without a message (7, 8, 16)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._stood: defaultdict[str, float] = defaultdict(float)

    def told(self, result: WriteResult) -> None:
        tag = result.mapping.tag
        if result.outcome is Outcome.WRITTEN:
            when = self.world.counts_from[int(result.request)]
            self._stood[tag] = max(self._stood[tag], when)

    def executed(self, entry: Executed) -> None:
        # A message over the fallback counts once, also where its outcome is unknown; what a guest
        # or a gateway puts there is written over at once, when nothing more can come.
        if entry.tag[0] != 'w' or entry.value == SAFE:
            return
        counts_from = self.world.published.get((entry.tag, entry.value), -math.inf)
        if entry.is_late or entry.value in GUESTS and entry.before in (SAFE, 0):
            held = self.world.held_for if entry.is_late else 0.0
            counts_from = entry.when + held - self.world.plant.after / 1000
        self._stood[entry.tag] = max(self._stood[entry.tag], counts_from)

    def stand(self) -> None:
        world = self.world
        now = world.line.now
        if world.plant.is_read_only:
            return
        for station, watched, row, bound in self._rows():
            limit, tag = bound + STEP, row.tag
            calm = max(world.ill[station], world.ill[0])
            brought = watched.brought  # by a download, and seen when it runs or is written again
            if now < max(calm, brought + MODE_PERIOD + _REWRITTEN) + limit:
                continue
            value = watched.held(row)
            if value == OTHERS:  # it is seen by nobody, until the fallback is written again (8)
                after = world.plant.after / 1000
                limit += max(after, _REWRITTEN) + after
                self._stood[tag] = max(self._stood[tag], world.overwritten[tag])
            self.demand(value in (SAFE, 0) or now - self._stood[tag] < limit,
                        tag, value, 'since', self._stood[tag])

    def _rows(self) -> Iterator[tuple[int, WatchedPlc, Mapping, float]]:
        world = self.world
        for station, watched in world.plcs.items():
            for row in world.rows_of(station):
                if (bound := world.bounds[row.tag]) is not None:
                    yield station, watched, row, bound


class OneResult(Rule):
    text = 'a fallback gives one result, its repetitions give none (17)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._told: defaultdict[str, float] = defaultdict(lambda: -math.inf)
        # What is published may be written and told so much later, and wait for its fallback.
        self._spared = world.plant.write_timeout + world.plant.after / 1000 + 2 * self.flight
        self._late: defaultdict[int, float] = defaultdict(lambda: -math.inf)  # by station

    def executed(self, entry: Executed) -> None:
        if entry.is_late:  # so it had no answer; after two of them comes a first contact (2)
            self._late[entry.station] = entry.when

    def told(self, result: WriteResult) -> None:
        if result.outcome is not Outcome.FALLBACK or result.mapping.serves:
            return
        world, tag, station = self.world, result.mapping.tag, result.mapping.station
        crowd, _ = world.crowds.get(tag, [(0.0, 0.0)])[-1]
        reason = max(world.came.get(tag, 0.0), world.ill[station], world.ill[0], world.opened,
                     world.ended, crowd, self._late[station],
                     world.plcs[station].ran_again + MODE_PERIOD)
        before, self._told[tag] = self._told[tag], world.line.now
        self.demand(before - self._spared - self.held <= reason, tag, 'was told at', before)


class Crowds(Rule):
    text = 'beside another publisher no message is sent, and its output falls back at once (28)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._late: defaultdict[str, float] = defaultdict(lambda: -math.inf)

    def sent(self, entry: Sent) -> None:
        published = self.world.published.get((entry.tag, entry.value), -math.inf)
        for begun, until in self.world.crowds.get(entry.tag, ()):
            self.demand(published > until or entry.is_again or entry.when < begun + self.lag
                        or entry.value in (SAFE, *GUESTS),
                        entry, 'was published at', published, 'before the end of', begun, until)

    def executed(self, entry: Executed) -> None:
        if entry.is_late or entry.value in GUESTS:
            self._late[entry.tag] = entry.when

    def stand(self) -> None:
        world = self.world
        for tag, spans in world.crowds.items():
            bound, station, (begun, until) = world.bounds[tag], world.rows[tag].station, spans[-1]
            if bound is None or until < math.inf or world.plant.is_read_only:
                continue
            watched = world.plcs[station]
            limit = bound - world.plant.after / 1000 + STEP
            calm = max(begun, world.ill[station], world.ill[0], self._late[tag] + world.held_for,
                       max(watched.brought, world.overwritten.get(tag, 0.0)) + MODE_PERIOD
                       + _REWRITTEN)
            value = watched.held(world.rows[tag])
            self.demand(value == SAFE or world.line.now < calm + limit, tag, value, 'since',
                        begun)


class Probes(Rule):
    text = 'a station that is known to be silent gets no number but 0 (4)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._sent: dict[int, Sent] = {}
        self._silent: set[int] = set()  # at the last look

    def sent(self, entry: Sent) -> None:
        if entry.tag.startswith('beat') and entry.station in self._silent \
                and entry.value and entry.value not in GUESTS:
            self._sent[entry.station] = entry

    def stand(self) -> None:
        # One that is active again since has got what it needs.
        self._silent = {number for number in self.world.plcs
                        if not self.world.driver.stations[number].active}
        sent = [entry for number, entry in self._sent.items() if number in self._silent]
        self.demand(not sent, sent)
        self._sent.clear()


class Unheard(Rule):
    text = 'a PLC that is not heard is sent its 0 and its fallbacks, also at the end (4, 5, 11)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._last: dict[str, Sent] = {}
        self._fell: dict[str, float] = {}  # when a fallback was sent over a message

    def sent(self, entry: Sent) -> None:
        if entry.value in GUESTS:
            return
        before = self._last.get(entry.tag)
        if entry.value == SAFE and before is not None and before.value != SAFE:
            self._fell[entry.tag] = entry.when
        self._last[entry.tag] = entry

    def stand(self) -> None:
        world, now = self.world, self.world.line.now
        if not world.is_deaf or world.plant.is_read_only:
            return
        for station in world.plcs:
            tags = [row.tag for row in world.rows_of(station)]
            for tag in tags:
                since = max(world.deaf_since, world.youngest.get(tag, 0.0))
                self._demand_rest(tag, now > since + (world.bounds.get(tag) or math.inf) + STEP)
            fell = max(self._fell.get(tag, 0.0) for tag in tags)
            self._demand_rest(f'beat_{station}', world.deaf_since < fell < now - self.flight)

    def over(self) -> None:
        for tag in self._last if self.world.is_deaf else ():
            if tag[0] in 'wb':
                self._demand_rest(tag, True)

    def _demand_rest(self, tag: str, is_due: bool) -> None:
        last = self._last.get(tag)
        self.demand(not is_due or last is None or last.value in (SAFE, 0), last, 'was the last')


class Queued(Rule):
    text = 'no message goes out on a connection that has not been heard (26)'

    def sent(self, entry: Sent) -> None:
        is_message = entry.tag[0] in 'wf' and entry.value != SAFE
        since = max(self.world.opened, 0.0)
        self.demand(not is_message or not self.world.is_queued or entry.when < since, entry)


class AfterRun(Rule):
    text = 'after a change to RUN that was seen come 0 and all fallbacks (2, 8)'

    def stand(self) -> None:
        world = self.world
        now = world.line.now
        for station, watched in world.plcs.items():
            bound = world.bounds.get(f'w0_{station}')
            if bound is None:
                continue
            limit = bound - world.plant.after / 1000 + MODE_PERIOD + self.flight
            ran = watched.ran_again
            if not ran + limit <= now < ran + limit + 2 * STEP or world.plant.is_read_only:
                continue
            was_seen = ran - watched.stopped > MODE_PERIOD + self.flight
            is_calm = max(world.ill[station], world.ill[0]) <= ran + STEP
            if not was_seen or not is_calm:
                continue
            came = {entry.tag for entry in world.executed if entry.when > ran
                    and entry.station == station and entry.value in (0, SAFE)}
            missing = {row.tag for row in world.rows_of(station, ('w', 'beat'))} - came
            self.demand(not missing, missing, 'since RUN at', ran)


class Held(Rule):
    text = 'without messages of the topics that it requires a heartbeat is 0 in time (3 d)'

    def stand(self) -> None:
        world, plant = self.world, self.world.plant
        if not plant.requires or plant.is_read_only:
            return
        for station, watched in world.plcs.items():
            beat, wait = f'beat_{station}', world.bounds.get(f'w0_{station}')
            if wait is None or beat not in world.rows:
                continue
            limit = plant.requires / 1000 + wait - plant.after / 1000 + STEP
            since = max(world.ill[station], world.ill[0], world.came.get(f'w0_{station}', 0.0))
            is_ours = not watched.other and station not in world.others
            if world.line.now > since + limit + MODE_PERIOD and is_ours:
                self.demand(watched.held(world.rows[beat]) == 0, beat, 'counts since', since)


class Rungs(Rule):
    text = 'the rungs trip when the bridge fails, within the preset that is printed, and not else'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._rows = [(f'beat_{station}', station, watched)
                      for station, watched in world.plcs.items() if watched.preset]
        self._changed = {tag: 0.0 for tag, *_ in self._rows}  # when a heartbeat came last
        self._counts: dict[str, int] = {}
        self._seen = dict.fromkeys(self._changed, 0)

    def executed(self, entry: Executed) -> None:
        tag = f'beat_{entry.station}'
        if entry.tag in (tag, f'other_{entry.station}') and tag in self._changed:
            if entry.value != entry.before:
                self._changed[tag] = entry.when
            self._counts[tag] = 0 if entry.value in GUESTS else entry.value

    def stand(self) -> None:
        world, now = self.world, self.world.line.now
        scans = 3 * world.plant.scan / 1000 + STEP
        for tag, station, watched in self._rows:
            new, self._seen[tag] = watched.lamps[self._seen[tag]:], len(watched.lamps)
            ladder = watched.plc.ladder
            assert ladder is not None
            if ladder.is_on(Lamp.IN_CONTROL) and watched.plc.is_running and not watched.other:
                silent = now - self._changed[tag]
                self.demand(silent < watched.preset + scans, 'in control', silent)
                limit = max(_LEAST_LIFE_SIGN, world.plant.period / 1000) + watched.preset \
                    + self.flight + self.held + scans
                self.demand(now - world.executor_ran < limit or station in world.others,
                            'the executor ran at', world.executor_ran)
            for when, lamp, is_on in new:
                calm = max(world.ill[station], world.ill[0], world.opened, watched.ran_again)
                if lamp is not Lamp.ALIVE or is_on or watched.other or not self._counts.get(tag) \
                        or when < calm + 2 * watched.preset or station in world.others:
                    continue
                self.demand(False, tag, 'was taken for dead at', when, 'changed at',
                            self._changed[tag])


class ReadOnly(Rule):
    text = 'with read_only nothing is written (18)'

    def executed(self, entry: Executed) -> None:
        is_ours = entry.value not in GUESTS and not entry.tag.startswith('other')
        self.demand(not self.world.plant.is_read_only or not is_ours, entry)


class Guests(Rule):
    text = 'each command of a guest has one reply, and is executed once'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._waits = 0.0  # since when there was a command without a reply
        self._process = 0
        self._missing = 0
        self._by: list[tuple[float, int, int]] = []

    def executed(self, entry: Executed) -> None:
        if entry.value in GUESTS:
            times = [when for when, station, value in self._by if value == entry.value
                     and station == entry.station and entry.when - when < 30.0]
            self.demand(not times, entry, 'executed before', times)
            self._by.append((entry.when, entry.station, entry.value))

    def stand(self) -> None:
        world = self.world
        missing = len(world.asked) - len(world.answered) - self._missing
        if self._process != world.process:  # a killed one replies no more
            self._process, self._missing, missing = world.process, self._missing + missing, 0
        self.demand(missing >= 0, 'more replies than commands')
        if not missing:
            self._waits = world.line.now
        self.demand(world.line.now - self._waits < 20.0 + 2 * self.flight, missing,
                    'without a reply since', self._waits)


class GuestAges(Rule):
    text = 'no command of a guest is sent that is older than Cmd_Timeout'

    def sent(self, entry: Sent) -> None:
        if entry.value in GUESTS and not entry.is_again:
            asked = self.world.asked_at[entry.value]
            limit = self.world.network.line.cmd_timeout + self.lag
            self.demand(entry.when - asked < limit, entry, 'was asked at', asked)


class OnTheWire(Rule):
    text = 'the counters tell what the driver has put on the wire'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._driver = 0
        self._buffer = b''
        self._taken = 0
        self._counts: Counter[SymbolKind] = Counter()

    def stand(self) -> None:
        world = self.world
        if world.master:
            return
        if self._driver != world.drivers:
            self._driver, self._buffer, self._taken = world.drivers, b'', 0
            self._counts.clear()
        self._buffer += world.said[self._taken:]
        self._taken = len(world.said)
        is_half = world.network.duplex is Duplex.HALF
        while (symbol := next_symbol(self._buffer, BlockCheck.CRC, is_half)) is not None:
            self._buffer = self._buffer[len(symbol.raw):]
            self._counts[symbol.kind] += 1
        counters, counts = world.driver.counters, self._counts
        lead = [told - counts[kind] for told, kind in (
            (counters.messages_sent - counts[SymbolKind.MASTER_MESSAGE], SymbolKind.MESSAGE),
            (counters.polls_sent, SymbolKind.POLL), (counters.acks_sent, SymbolKind.ACK),
            (counters.naks_sent, SymbolKind.NAK))]
        # What is sent next may be counted before the line is free for it.
        self.demand(min(lead) >= 0 and sum(lead) <= 1, 'messages, polls, ACK and NAK too many',
                    lead)
        self.demand(counters.chars_sent == self._taken, counters.chars_sent, 'characters, not',
                    self._taken)


class View(Rule):
    text = 'a station that answers all of ours is not taken for one that does not'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._known: set[int] = set()  # that were well at the last look, and known to be
        self._changes = 0

    def stand(self) -> None:
        world, now = self.world, self.world.line.now
        changes = world.listener.changes[self._changes:]
        self._changes += len(changes)
        for number in world.plcs:
            is_known = world.driver.stations[number].replies_in_time \
                and (number, False) not in changes  # and back at once
            # A master answers in the name of a PLC that it takes for inactive.
            is_passed_on = world.master is None or world.master.stations[number].active
            # Of a station none of whose reads passes, hardly anything shows that it answers.
            passes = any(row.reads and row.tag not in world.odd_rows
                         for row in world.rows.values() if row.station == number)
            is_well = now > max(world.ill[number], world.ill[0]) + self.flight \
                and not world.holds and is_passed_on and passes
            self.demand(is_known or not is_well or number not in self._known,
                        world.driver.stations[number])
            if is_known and is_well:
                self._known.add(number)
            else:
                self._known.discard(number)


class Fresh(Rule):
    text = 'a row whose packets pass is not staler than promised because of other rows (29)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._read: dict[str, float] = {}

    def read(self, when: float, tag: str, station: int, values: list[int]) -> None:
        self._read[tag] = when

    def stand(self) -> None:
        world = self.world
        for row, point in world.driver.points.items() if world.odd_known < math.inf else ():
            if row.tag in world.odd_rows or row.serves or row.is_guarded or row.is_heartbeat:
                continue
            since = max(self._read.get(row.tag, 0.0), world.odd_known)
            # The tries of all odd rows together have an eighth, and one of them is under way.
            most = (1 + 1 / OTHERS_SHARE) * point.stale_time + self.flight
            self.demand(world.line.now - since < most, row.tag, 'was not read for more than', most,
                        'beside', sorted(world.odd_rows))


class Served(Rule):
    text = 'what we serve is a message that is young enough, or the fallback (12)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._seen = 0

    def stand(self) -> None:
        world = self.world
        for when, value in world.served[self._seen:]:
            published = world.published.get(('served', value), -math.inf)
            is_young = when - published < world.plant.after / 1000 + self.flight + self.held
            # Each driver begins with its own table: zeros, then the fallback.
            is_new = value == 0 and when - world.opened < self.flight + self.held
            is_written = not world.plant.is_read_only
            self.demand(value == SAFE or is_new or is_young or not is_written, value,
                        'was published at', published)
        self._seen = len(world.served)


class Foreign(Rule):
    text = 'no value that we have sent is told as the value of another program (19)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._seen = 0

    def stand(self) -> None:
        world = self.world
        new = world.listener.foreign[self._seen:]
        self._seen += len(new)
        for when, text, _ in new:
            found = _READ_VALUE.search(text)
            assert found is not None
            value = int(found[1])
            last = next((entry for entry in reversed(world.executed) if entry.value == value
                         and entry.when <= when and entry.tag.startswith(('beat', 'other'))), None)
            is_ours = last is not None and last.tag.startswith('beat') and last.is_late \
                and last.driver >= world.process and last.when > when - _READ_BACK_WITHIN
            self.demand(not is_ours, text, 'at', when, last)


class Noticed(Rule):
    text = 'after a foreign value was read a heartbeat is 0 before it counts (19)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._read: dict[int, float] = {}  # when one was read that no 0 has followed, by station
        self._zero: defaultdict[int, float] = defaultdict(lambda: -math.inf)

    def sent(self, entry: Sent) -> None:
        if not entry.tag.startswith('beat') or entry.value in GUESTS:
            return
        if not entry.value:
            self._zero[entry.station] = entry.when
            self._read.pop(entry.station, None)
        read = self._read.get(entry.station, math.inf)
        within = 10 * _LONGEST_REPLY / self.world.plant.baud
        self.demand(entry.when < read + within, entry, 'but one was read at', read)

    def stand(self) -> None:
        world = self.world
        for station, watched in world.plcs.items():
            row = world.rows.get(f'beat_{station}')
            if row is None or world.line.now <= max(world.ill[station], world.ill[0]):
                continue
            when, word = watched.answered(row.address, row.address.offset, world.line.now) \
                or (-math.inf, 0)
            if word == FOREIGN and when > self._zero[station]:
                self._read.setdefault(station, when)


class OneOwner(Rule):
    text = 'beside another writer of its word a heartbeat ends with 0 (19)'

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.since: dict[int, float] = {}  # when another one began, by station
        self._last: dict[str, Executed] = {}
        self._counted: defaultdict[str, float] = defaultdict(float)  # s, beside the other

    def executed(self, entry: Executed) -> None:
        world, station, tag = self.world, entry.station, entry.tag
        if world.plant.is_read_only:  # the other bridge is the only owner
            return
        if not tag.startswith(('beat', 'other')) or entry.is_late or entry.value in GUESTS:
            return
        last, self._last[tag] = self._last.get(tag), entry
        # Each opening of the port and each change to RUN begins anew; what is ill is not read.
        began = max(self.since.get(station, math.inf), world.opened, world.ill[station],
                    world.ill[0], world.plcs[station].ran_again + MODE_PERIOD)
        if last is None or last.when < began:
            self._counted[tag] = 0.0
        elif last.value and not self._is_read_rarely:
            self._counted[tag] += min(entry.when - last.when, self._period(station, tag))
            longer = max(self._period(station, name) for name in ('beat', 'other'))
            self.demand(self._counted[tag] <= max(20 * longer, 3.0), entry, 'counted',
                        self._counted[tag], 'since', began)

    @property
    def _is_read_rarely(self) -> bool:
        """Tell whether reads wait for many Periods, as by radio and on a full line."""
        plant, cycle = self.world.plant, self.world.driver.readings.reads.poll_cycle
        return plant.mode == 'Radio' or (cycle or 0.0) > plant.period / 1000

    def _period(self, station: int, tag: str) -> float:
        """Return the Period (s) of a heartbeat of ours, or of the other bridge if there is one."""
        other = self.world.others.get(station)
        if other is None or tag.startswith('beat'):
            return self.world.plant.period / 1000
        return (other.driver.mappings[0].period or 0) / 1000


RULES: tuple[type[Rule], ...] = (
    Results, Stands, Ages, Stamps, Turns, Values, Guards, Withheld, Beats, BeatsAfterFallbacks,
    Order, Outputs, OneResult, Crowds, Probes, Unheard, Queued, AfterRun, Held, ReadOnly, Guests,
    GuestAges, OnTheWire, View, Fresh, Served, Rungs, Answers, ReadBack, Repeats, Taken, Foreign,
    Noticed)


class Judge:
    """All rules, looking at a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.owner = OneOwner(world)
        self._rules = [*(rule(world) for rule in RULES), self.owner]
        # Only those that judge it: this is done at each step.
        self._judges = {name: [getattr(rule, name) for rule in self._rules
                               if getattr(type(rule), name) is not getattr(Rule, name)]
                        for name in ('sent', 'executed', 'told', 'read', 'stand')}
        self._sent = self._executed = self._results = self._reads = 0

    def look(self) -> None:
        """Look at what is new; raise Broken."""
        world, judges = self._world, self._judges
        events: list[Sent | Executed] = [
            *world.sent[self._sent:], *world.executed[self._executed:]]
        for event in sorted(events, key=attrgetter('when')):
            for judge in judges['sent' if isinstance(event, Sent) else 'executed']:
                judge(event)
        for result in world.results[self._results:]:
            for told in judges['told']:
                told(result)
        for when, mapping, values in world.reads[self._reads:]:
            assert not isinstance(values, str)
            for read in judges['read']:
                read(when, mapping.tag, mapping.station, [int(value) for value in values])
        self._sent, self._executed = len(world.sent), len(world.executed)
        self._results, self._reads = len(world.results), len(world.reads)
        for stand in judges['stand']:
            stand()

    def over(self) -> None:
        """Look at what is left after an orderly end; raise Broken."""
        self.look()
        for rule in self._rules:
            rule.over()
