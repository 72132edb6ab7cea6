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
A kernel by itself, with PLCs of a word for each row, and the judge of what it decides.

A story is a list of choices: which event comes, and how each write ends. The judge looks from
outside, by the rules of docs/heartbeats.md. Two demands need no rule: what a PLC holds is among
what the kernel believes it may hold (soundness), and what must not stand is replaced in time
(progress).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.driver.kernel.fallback import FallbackRow, FallbackState
from abdf1_ros.driver.kernel.flights import Words
from abdf1_ros.driver.kernel.gate import Rank, Turn
from abdf1_ros.driver.kernel.kernel import ForeignValue, Kernel, News, Refused
from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.driver.kernel.plc import OwnRow
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.errors import CommandTimeout, LinkError, PortLost, RemoteError
from abdf1_ros.plan.forecast import line_model
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from support.clock import StillClock
from support.mappings import make_mapping

TICK = 0.25  # s, a step of a story
SETTLE = 1.0  # s for which a gateway may hold a write
PATIENCE = 2.0  # s, ``write_timeout``
SAFE, OTHERS, OLD = 7, 99, 1  # a Fallback, a guest's value, a command that a download brings back

_LEAST_ZERO = 0.5  # s
_MOST_WRITES = 8  # in a step
_HAND_OVER = 2.0  # s, the longest end before ~/reload
_LONGEST_END = 6.0  # s
_REST = 8.0  # s until all is at rest if nothing happens
_LONGEST_PAUSE = 8 * TICK  # s to the next try: seven times the last one, and a step
_NEVER_EXECUTED = {Outcome.NOT_SENT, Outcome.REFUSED, Outcome.SUPERSEDED, Outcome.FAILED}

OK, LOST, UNANSWERED, REFUSED, SLOW, LATE = 'ok', 'lost', 'unanswered', 'refused', 'slow', 'late'
KEPT = 'kept last', 'kept 1', 'kept 2'


class Broken(AssertionError):
    """A demand does not hold."""


@dataclass(frozen=True, slots=True)
class Plant:
    """
    A tiny plant.

    - ``rows``: its rows, each of one word.
    - ``events``: what may happen, at most ``most_events`` of it in a story.
    - ``ends``: how a write may end, at most ``most_faults`` times not ``ok``.
    - ``steps``: length of a story.
    - ``has_gateway``: its stations are known to be behind gateways; ``may_store``: the connection
      has to be heard (rule 26); ``is_read``: all words are read in each second step.
    - ``is_refreshed``: Fallbacks that stand are written again (rule 8), which hides for seconds
      what a word must not hold.
    """

    rows: tuple[Mapping, ...]
    events: tuple[str, ...]
    ends: tuple[str, ...] = (OK, LOST, UNANSWERED)
    steps: int = 4
    most_events: int = 2
    most_faults: int = 1
    has_gateway: bool = False
    may_store: bool = False
    is_read: bool = False
    is_refreshed: bool = False


class _Copy(NamedTuple):
    """A write that a gateway keeps ``until`` a time, or until so many ``writes`` came after it."""

    tag: str
    value: int
    until: float
    writes: int = 0


@dataclass(slots=True)
class _UnderWay:
    """
    A write that ends in the next step, after its event.

    ``is_late``: the PLC executes it only then; ``is_answered``: its reply comes.
    """

    turn: Turn
    is_late: bool
    is_answered: bool


@dataclass(slots=True)
class _Facts:
    """What a row has been through, for the judge."""

    held: int = 0
    zero_since: float = 0.0
    fed: float = -math.inf  # publication of the last confirmed message
    is_safe: bool = False  # our Fallback was confirmed last
    is_overwritten: bool = False  # by a guest, since then
    safe_sent: float = -math.inf
    is_due: bool = False  # a Fallback went out, and was not confirmed since
    is_unsure: float = -math.inf  # until when a late value may come
    sent: int = 0  # our last write of a heartbeat
    is_confirmed: bool = False


def _read_of(row: Mapping) -> Mapping:
    """Return a row that reads the word of a row; a heartbeat is read by its own row."""
    return row if row.is_heartbeat else make_mapping(
        str(row.address), station=row.station, tag=f'read {row.tag}', period=500)


class Tiny:
    """A story of a plant as it goes; ``choose`` decides where it may go another way."""

    def __init__(self, plant: Plant, choose: Callable[[str, Sequence[str]], str]) -> None:
        self.plant, self._choose = plant, choose
        self.rows = Rows(plant.rows)
        self.line = StillClock(100.0)
        self.is_heard = True
        self.facts = {row.tag: _Facts() for row in self.rows}
        self.copies: list[_Copy] = []
        self.under_way: dict[int, _UnderWay] = {}  # by station
        self.asks: dict[str, float] = {}
        self.executed: set[str] = set()
        self.said: list[str] = []  # the results, without their numbers
        self.down: set[int] = set()
        self.events = self.faults = self.step_number = self._names = 0
        self.hung_until = self.ends_at = -math.inf
        self.reloads_at = math.inf
        self.is_crowded = False
        self._published: dict[str, float] = {}  # by topic, the youngest
        self.stations = ActiveStationList(self.rows.stations, self._station_changed)
        for station in self.stations:
            station.has_gateway = plant.has_gateway
        self.kernel = self._make()
        self._blocks = Planner(line_model(Network()), 1.0).plan(
            [_read_of(row) for row in self.rows.of_plcs]) if plant.is_read else []
        self.kernel.executor_ran(self.now)
        self._open()

    def _make(self) -> Kernel:
        return Kernel(self.rows, self.rows, self.stations, self.line, self, self,
                      settle_time=SETTLE, patience=PATIENCE)

    @property
    def now(self) -> float:
        return self.line.now

    # Our table, for the kernel

    def store(self, mapping: Mapping, values: Sequence[float] | str) -> None:
        self.facts[mapping.tag].held = int(values[0])

    def clear(self) -> None:
        for row in self.rows.served:
            self.facts[row.tag].held = 0

    # A step

    def step(self) -> None:
        """Let one event happen, or none; then all writes that are wanted, and a moment pass."""
        self.step_number += 1
        event = self._choose('event', ('', *self._allowed()))
        if event:
            self.events += 1
            self._happen(event)
        for station in [*self.under_way]:
            self._answer(self.under_way.pop(station))
        self._write()
        if self.plant.is_read and self.step_number % 2:
            self._read()
        self._judge()
        self._pass()
        self._exchange()
        self._judge()

    def _allowed(self) -> Iterator[str]:
        end = self.kernel.end
        if self.events >= self.plant.most_events:
            return
        for event in self.plant.events:
            kind, _, what = event.partition(' ')
            row = next((row for row in self.rows if row.tag == what), None)
            is_down = row is not None and row.station in self.down
            if not (kind in ('message', 'old', 'same') and end.is_asked
                    or kind == 'guest' and (end.is_asked or is_down or not self.is_heard)
                    or kind in ('end', 'reload') and end.is_asked
                    or event == 'silent' and self.down or event == 'answers' and not self.down
                    or event == 'RUN' and self.down
                    or event == 'crowd' and self.is_crowded):
                yield event

    def _happen(self, event: str) -> None:
        kind, _, what = event.partition(' ')
        now, kernel = self.now, self.kernel
        if kind in ('message', 'old', 'same'):
            self._publish(next(row for row in self.rows if row.tag == what), kind)
        elif kind == 'guest':
            row = next(row for row in self.rows if row.tag == what)
            flight = kernel.guest(row.station, (row.extent,))
            facts, other = self.facts[what], self.under_way.get(row.station)
            is_message = other is not None and not other.turn.write.is_own \
                and other.turn.write.mapping is row  # from its first packet no Fallback stands
            facts.is_overwritten = facts.is_safe and not is_message
            self._execute(row, OTHERS)
            kernel.ended(flight, Outcome.WRITTEN)
        elif kind == 'silent':
            self.down.add(1)
            self.stations.lost(1, now)
        elif kind == 'answers':
            self.down.clear()
            self.stations.heard(1, now)
        elif kind == 'RUN':
            self._download()
        elif kind == 'reopen':
            self._lose('unplugged')
            self._open()
        elif kind == 'hung':
            self.hung_until = now + 2.0
        elif kind == 'crowd':
            self.is_crowded = True
            kernel.crowd(self._crowded_topic, Crowd('two publishers'))
            list(kernel.new_crowds(now))
        elif kind == 'end':
            kernel.end.wind_down(is_final=True)
            self.ends_at = now
        else:
            kernel.end.wind_down()
            self.reloads_at = now + _HAND_OVER
        self._hear()

    @property
    def _crowded_topic(self) -> str:
        return next(row.topic for row in self.rows if row.single_publisher)

    def _publish(self, row: Mapping, kind: str) -> None:
        self._names += 1
        name = f'{row.tag} {self._names}'
        published = self.now - (0.75 if kind == 'old' else 0.0)
        value = 2 if kind == 'same' else 2 + self._names % 3
        self.asks[name] = published
        self._published[row.topic] = max(published, self._published.get(row.topic, -math.inf))
        self.kernel.asked(Write(row, [value], published, name), self.now)

    def _download(self) -> None:
        """Bring an old command back, while the mode is seen to change to RUN."""
        for station in self.rows.stations:
            self.kernel.mode_seen(station, self.now, is_running=False)
        for row in self.rows.of_plcs:
            facts = self.facts[row.tag]
            facts.held, facts.zero_since = (0 if row.is_heartbeat else OLD), self.now
            facts.is_safe = facts.is_overwritten = False
        for station in self.rows.stations:
            self.kernel.mode_seen(station, self.now, is_running=True)

    def _lose(self, why: str) -> None:
        for under_way in self.under_way.values():
            self._end(under_way.turn, Outcome.UNKNOWN, PortLost(why))
        self.under_way.clear()
        self.kernel.lost((), why, self.now)
        self._hear()

    def _open(self) -> None:
        self.is_heard = not self.plant.may_store
        self.kernel.opened(self.now)
        for facts in self.facts.values():
            facts.is_safe = False
        self._hear()

    def _station_changed(self, station: Station) -> None:
        self.kernel.station_changed(station.number, self.now, is_active=station.active)

    def _pass(self) -> None:
        """Let a moment pass; deliver what gateways have kept until then."""
        self.line.now += TICK
        if self.now >= self.hung_until:
            self.kernel.executor_ran(self.now)
        for copy in [copy for copy in self.copies if copy.until <= self.now]:
            self.copies.remove(copy)
            if not copy.writes:
                self._execute(self._row(copy.tag), copy.value)
        self.kernel.expire(self.now)
        self._hear()

    def _exchange(self) -> None:
        """Take new files when their end is over: the same rows once more."""
        end = self.kernel.end
        if self.reloads_at < math.inf and (end.is_over or self.now >= self.reloads_at):
            before, self.reloads_at = self.kernel, math.inf
            self._lose('the files have been read again')
            for facts in self.facts.values():
                facts.safe_sent = -math.inf
            self.kernel = self._make()
            self.kernel.take_over(before)
            self.kernel.executor_ran(self.now)
            self._open()

    # Writes

    def _write(self) -> None:
        """Let all writes go that are wanted now, in the order of the agenda."""
        for _ in range(_MOST_WRITES):
            for rank in self._ranks():
                if (turn := self.kernel.next(
                        self.now, rank, self.under_way)) is not None:
                    break
            else:
                self._hear()
                return
            self._hear()
            self._judge_sent(turn.write, rank)
            self._carry_out(turn)
        raise Broken(f'{_MOST_WRITES} writes at {self.now - 100:g}')

    def _ranks(self) -> Iterator[Rank]:
        yield Rank.OWN
        if self.is_heard and not self.kernel.end.is_asked:
            yield Rank.MESSAGE
        if self.plant.is_refreshed:
            yield Rank.REFRESH

    def _carry_out(self, turn: Turn) -> None:
        write = turn.write
        row, value, facts = write.mapping, int(write.raw[0]), self.facts[write.mapping.tag]
        end = self._choose(f'{row.tag}={value}', self._ends(row))
        self.faults += end != OK and row.station not in self.down
        if end in (OK, UNANSWERED, SLOW):
            self._execute(row, value, write)
        if end == OK:
            self._end(turn, Outcome.WRITTEN)
            return
        if end == REFUSED:
            self._end(turn, Outcome.FAILED, RemoteError(0x10, None, 'refused'))
            return
        is_answered = end in (SLOW, LATE)
        self.under_way[row.station] = _UnderWay(turn, end == LATE, is_answered)
        if not is_answered:
            facts.is_unsure = self.now + TICK + SETTLE
            for origin in write.origins:  # it may have been executed, or may be
                self.executed.add(origin.request)
        if end in KEPT:
            self.copies.append(_Copy(row.tag, value, facts.is_unsure, KEPT.index(end)))

    def _ends(self, row: Mapping) -> Sequence[str]:
        if row.station in self.down:
            return (LOST,)
        return self.plant.ends if self.faults < self.plant.most_faults else (OK,)

    def _answer(self, under_way: _UnderWay) -> None:
        write = under_way.turn.write
        if under_way.is_late:
            self._execute(write.mapping, int(write.raw[0]), write)
        if under_way.is_answered and write.mapping.station not in self.down:
            self._end(under_way.turn, Outcome.WRITTEN)
        else:
            self._end(under_way.turn, Outcome.UNKNOWN, CommandTimeout())

    def _end(self, turn: Turn, outcome: Outcome, error: LinkError | RemoteError | None = None
             ) -> None:
        write, station = turn.write, turn.write.mapping.station
        self.is_heard |= outcome is not Outcome.UNKNOWN
        if not write.is_own:
            self.kernel.told(turn.flight, write.result(outcome, '', error),
                             is_read=self.plant.is_read)
        if not (turn.is_free and write.is_probe):
            self.stations.tried(station, turn.flight.begun, self.now, was_silent=write.is_probe,
                                asker=Asker.OWN if write.is_own else Asker.MESSAGE)
        facts = self.facts[write.mapping.tag]
        facts.is_confirmed = outcome is Outcome.WRITTEN
        if outcome is Outcome.WRITTEN:
            facts.is_safe, facts.is_overwritten, facts.is_due = write.is_own, False, False
            if not write.is_own:
                facts.fed = max(facts.fed, write.requested)
        elif outcome is Outcome.UNKNOWN and not write.is_own:
            if facts.is_safe:  # its time counts once (7)
                facts.fed = max(facts.fed, write.requested)
            facts.is_safe = False
        self.kernel.ended(turn.flight, outcome, error)
        self._hear()

    def _execute(self, row: Mapping, value: int, write: Write | None = None) -> None:
        """Let the PLC execute a write; a gateway may deliver a copy after it."""
        facts = self.facts[row.tag]
        if row.is_heartbeat:
            if write is not None:
                self._judge_count(facts, value)
            if not value and facts.held:  # a late 0 of ours may come while we count
                facts.zero_since = self.now if write is not None else -math.inf
        facts.held = value
        if write is None:
            return
        self.executed.update(origin.request for origin in write.origins)
        for copy in [copy for copy in self.copies if copy.tag == row.tag and copy.writes]:
            self.copies.remove(copy)
            if copy.writes > 1:
                self.copies.append(copy._replace(writes=copy.writes - 1))
            else:
                facts.held = copy.value

    def _read(self) -> None:
        for block in self._blocks:
            if block.station not in self.down:
                self.kernel.read(block, self._words_of(block), self.now)
        self._hear()

    def _words_of(self, block: Block) -> bytes:
        words = {row.address.offset: self.facts[row.tag.removeprefix('read ')].held
                 for row in block.mappings}
        first, *_ = sorted(words)
        return b''.join(words.get(first + number, 0).to_bytes(2, 'little')
                        for number in range(block.words))

    def _row(self, tag: str) -> Mapping:
        return next(row for row in self.rows if row.tag == tag)

    # The judge

    def _demand(self, is_so: bool, *what: object) -> None:
        if not is_so:
            raise Broken(f'{" ".join(map(str, what))} at {self.now - 100:g}')

    def _hear(self) -> None:
        """Judge what has come of the events: each message has one result, which is true."""
        while self.kernel.out:
            self._judge_news(self.kernel.out.popleft())

    def _judge_news(self, news: News) -> None:
        if isinstance(news, Refused | ForeignValue):
            self.said.append(type(news).__name__)
            return
        self.said.append(f'{news.outcome.name}: {news.detail.split(" ")[0]}')
        if news.outcome is Outcome.FALLBACK:
            return
        self._demand(news.request in self.asks, 'a second result', news)
        published = self.asks.pop(news.request)
        if news.outcome is Outcome.WRITTEN and not news.mapping.serves:
            self._demand(news.request in self.executed, 'told as written', news)
        if news.outcome in _NEVER_EXECUTED:
            self._demand(news.request not in self.executed, 'executed, and told as', news)
        if news.outcome is Outcome.STANDS:
            facts, held = self.facts[news.mapping.tag], self.facts[news.mapping.tag].held
            facts.fed = max(facts.fed, published)
            self._demand(news.value == f'[{held}]', 'does not stand', news, held)

    def _judge_sent(self, write: Write, rank: Rank) -> None:
        """Judge a write that goes out."""
        now, row, facts = self.now, write.mapping, self.facts[write.mapping.tag]
        if not write.is_own:
            limit = min(PATIENCE, row.fallback.after / 1000 if row.fallback else math.inf)
            self._demand(now < write.requested + limit, row.tag, 'is too old (7)')
            self._demand(write.requested > facts.safe_sent, row.tag, 'is older than the sent '
                         'fallback (9)')
            self._demand(not facts.is_due or self.stations[row.station].active, row.tag,
                         'goes to a silent PLC beside its fallback (4)')
            self._demand(self.is_heard, row.tag, 'goes out unheard (26)')
            self._demand(not (row.single_publisher and self.is_crowded), row.tag,
                         'goes out in spite of two publishers (28)')
        elif row.fallback is not None:
            if rank is Rank.OWN and not self.kernel.end.is_asked:
                facts.safe_sent, facts.is_due = now, not facts.is_safe
        else:
            value = int(write.raw[0])
            if value:
                self._judge_number(row)
                expected = facts.sent + 1 if facts.is_confirmed or not facts.sent else facts.sent
                self._demand(value == expected, value, 'follows', facts.sent, '(1, 3 a)')
            facts.sent, facts.is_confirmed = value, False

    def _judge_number(self, row: Mapping) -> None:
        """Judge a number of a heartbeat that goes out."""
        now = self.now
        self._demand(not self.kernel.end.is_asked, 'counts at the end (5)')
        self._demand(self.stations[row.station].active, 'counts at a silent PLC (4)')
        self._demand(now <= self.hung_until - 2.0 + 1.0 or now >= self.hung_until,
                     'counts while the executor stands still (3 c)')
        condition = row.condition
        for topic in condition.names if condition else ():
            assert condition is not None and condition.timeout is not None
            self._demand(now < self._published.get(topic, -math.inf) + condition.timeout / 1000,
                         f'counts without {topic} (3 d)')
        for other in self.rows.fallbacks.of_plcs:
            facts = self.facts[other.tag]
            if other.station != row.station:
                continue
            self._demand(not facts.is_overwritten, 'counts over a guest (3 b)')
            assert other.fallback is not None
            is_fresh = now < facts.fed + other.fallback.after / 1000
            waits = any(name.startswith(f'{other.tag} ') for name in self.asks)
            self._demand(facts.is_safe or is_fresh or waits or now < facts.is_unsure,
                         'counts beside a fallback that is due (3 b)')

    def _judge_count(self, facts: _Facts, value: int) -> None:
        """Judge a number that a PLC gets: it has seen a 0 long enough (2)."""
        if value and value != OTHERS and not facts.held and self.now >= facts.is_unsure:
            stood = self.now - facts.zero_since
            self._demand(stood >= _LEAST_ZERO, f'the 0 stood for {stood:g} s (2)')

    def _judge(self) -> None:
        """Judge how things stand: soundness, the age of asks, a next try."""
        for name, published in self.asks.items():
            self._demand(self.now < published + 2 * PATIENCE + 1.0, name, 'has no result')
        for row in self.kernel.rows.plc_of:
            self._judge_belief(row)
        due = self.kernel.turns.next_due()
        for row in self.kernel.rows.fallbacks:
            mapping = row.mapping
            if row.cause is not None and not mapping.serves and not row.is_under_way \
                    and not self.down and not self.under_way:
                self._demand(due <= self.now + _LONGEST_PAUSE, mapping.tag, 'is not tried again')

    def _judge_belief(self, row: OwnRow) -> None:
        """Demand that a word holds what the kernel believes it may hold."""
        believed, held = self.believed(row), self.facts[row.mapping.tag].held
        self._demand(believed is None or held in believed, row.mapping.tag, 'holds', held,
                     'and may hold', believed)

    def believed(self, row: OwnRow) -> set[int] | None:
        """Return what the kernel believes that a word may hold, None for anything."""
        is_due = row.cause is not None if isinstance(row, FallbackRow) \
            else not row.counts and not row.is_at_rest
        words: Words = row.words
        last = words.last
        opened = self.kernel.flights.opened_until if self.plant.has_gateway else -math.inf
        if is_due or last is None or opened > last.begun:
            return None
        found: set[int] = set()
        for flight in words.flights:
            if flight.write is None:
                return None
            found.add(int(flight.write.raw[0]))
        return found

    # The end of a story

    def rest(self) -> None:
        """Let nothing happen any more, and PLCs answer; then demand safe words."""
        self.events, self.faults = self.plant.most_events, self.plant.most_faults
        if self.down and not self.ends_at > -math.inf:
            self.down.clear()
            self.stations.heard(1, self.now)
        give_up = self.now + _REST
        while self.now < give_up and not (self.ends_at > -math.inf and self.kernel.end.is_over):
            self.step()
        if self.ends_at > -math.inf:
            self._judge_end()
            return
        self._demand(not self.asks, 'no result for', *self.asks)
        for row in self.kernel.rows.plc_of:
            held, tag = self.facts[row.mapping.tag].held, row.mapping.tag
            believed = self.believed(row)
            if isinstance(row, FallbackRow):
                self._demand(held == SAFE and (row.state is FallbackState.STANDS), tag, 'holds',
                             held, 'at rest,', row.state.value)
                self._demand(believed == {held}, tag, 'may hold', believed, 'at rest')
            elif row.topics:
                self._demand(held == 0, tag, 'holds', held, 'at rest')
            else:
                self._demand(held > 0, tag, 'does not count at rest')

    def _judge_end(self) -> None:
        """Demand that each word is safe at the end, or named (5)."""
        end = self.kernel.end
        named = {text.split(' ')[0] for text in (*end.unconfirmed(self.now), *end.not_repeated())}
        self._demand(end.is_over or self.now >= self.ends_at + _LONGEST_END, 'the end is not over')
        for row in self.rows.own:
            held = self.facts[row.tag].held
            self._demand(held in (0, SAFE) and (held == SAFE or row.is_heartbeat)
                         or row.tag in named, row.tag, 'holds', held, 'at the end (5)')
