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
Make a mistake in each rule, and see how soon the simulation finds it.

``mistakes.py`` prints a row for each: the rule, the mistake, which check has found it, after how
many plants, hours of line time and seconds of processor time. The status is 1 where one is not
found within ``--seconds``.

A simulated plant has no terminal, disk, ROS or device. So mistakes there are for other tests: a
log that the link waits for (test/ros/test_console.py, test/ports/test_trace.py), exceptions from
outside (test/ros/test_node.py, test/ros/test_lines.py), two masters on one line
(test/ports/test_serial_device.py), and how long the process lets an end take
(test/plan/test_plan_interlocks.py). Long replies at other speeds are for
test/driver/test_transactions.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
import math
from pathlib import Path
import sys
import time
from types import ModuleType
from typing import Any
from unittest import mock

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from abdf1_ros.ages import HostClock, RecentMax
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.master import HalfDuplexMaster
from abdf1_ros.df1.odd import OddCommands
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.probes import Probes
from abdf1_ros.driver.agenda import Agenda
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import GuestJob
from abdf1_ros.driver.kernel.end import OrderlyEnd
from abdf1_ros.driver.kernel.fallback import FallbackCause, FallbackRow
from abdf1_ros.driver.kernel.flights import Flight, Words
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.kernel.plc import Plc
from abdf1_ros.driver.kernel.rows import OwnRows
from abdf1_ros.driver.kernel.waiting import WaitingWrites
from abdf1_ros.driver.reads import job
from abdf1_ros.driver.reads.guards import CounterGuard, RunGuard
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.served import MappedTable
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.jobs import WriteJob
from abdf1_ros.pccc.values import Codec
from abdf1_ros.plan.bounds import Times
from abdf1_ros.plan.planner import Block
from abdf1_ros.plan.refusals import Refusals
from abdf1_ros.settings.mapping import Mapping
from simulate.rules import Broken
from simulate.run import Story

_SHORT = 2  # words of rows that have the same place in all plants


@dataclass(frozen=True, slots=True)
class Mistake:
    """``make`` gets what stands in a class or module, and returns what is put there instead."""

    rule: str
    text: str
    owner: type | ModuleType
    name: str
    make: Callable[[Any], Any]


def _counts_by_two(take: Any) -> Any:
    def take_wrongly(self: HeartbeatRow, now: float) -> Write:
        value = int(take(self, now).raw[0])
        return Write(self.mapping, [value % 32_767 + 1 if value else 0], now, is_own=True)

    return take_wrongly


def _counts_unconfirmed(take: Any) -> Any:
    def take_wrongly(self: HeartbeatRow, now: float) -> Write:
        with mock.patch.object(HeartbeatRow, 'has_confirmed', True):
            return take(self, now)  # type: ignore[no-any-return]

    return take_wrongly


def _begins_to_count(begin: Any) -> Any:
    def begin_wrongly(self: HeartbeatRow, now: float, *, is_new: bool = False) -> None:
        self.counts, self.asked = True, -math.inf

    return begin_wrongly


def _short_zero(seen_at: Any) -> Any:
    return property(lambda self: self.confirmed + 0.1)


def _always_confirmed(ended: Any) -> Any:
    return lambda self, outcome, now: ended(self, Outcome.WRITTEN, now)


def _value_before(decode: Any) -> Any:
    last: dict[int, Any] = {}

    def decode_wrongly(self: Codec, data: bytes) -> Any:
        values = decode(self, data)
        before = last.get(id(self), values)
        last[id(self)] = values
        return before

    return decode_wrongly


def _told_as_written(result: Any) -> Any:
    def tell_wrongly(self: Write, outcome: Outcome, *arguments: Any, **named: Any) -> Any:
        if outcome is Outcome.NOT_SENT:
            outcome = Outcome.WRITTEN
        return result(self, outcome, *arguments, **named)

    return tell_wrongly


def _told_as_not_sent(result: Any) -> Any:
    def tell_wrongly(self: Write, outcome: Outcome, *arguments: Any, **named: Any) -> Any:
        if outcome is Outcome.UNKNOWN:
            outcome = Outcome.NOT_SENT
        return result(self, outcome, *arguments, **named)

    return tell_wrongly


def _dropped_in_silence(drop: Any) -> Any:
    def drop_wrongly(self: WaitingWrites, reason: str, now: float, mapping: Any) -> Any:
        dropped = [write for write in self.writes if mapping in (None, write.mapping)]
        for write in dropped:
            self.writes.remove(write)
        return [write.mapping for write in dropped]

    return drop_wrongly


def _writes_in_spite(init: Any) -> Any:
    def init_wrongly(self: Driver, network: Any, mappings: Any, settings: Any,
                     listener: Any) -> None:
        init(self, network, mappings, replace(settings, read_only=False), listener)

    return init_wrongly


def _lives_longer(init: Any) -> Any:
    def init_wrongly(self: GuestJob, *args: Any) -> None:
        init(self, *args)
        self.expires += 60.0

    return init_wrongly


def _refused_refreshes(ended: Any) -> Any:
    return lambda self, requested, outcome, **named: ended(
        self, requested, Outcome.WRITTEN, **named)


def _requires_nothing(init: Any) -> Any:
    def init_wrongly(self: HeartbeatRow, *arguments: Any, **named: Any) -> None:
        init(self, *arguments, **named)
        self.topics = ()

    return init_wrongly


def _sees_no_guest(guest_done: Any) -> Any:
    return lambda self, *, is_known: -math.inf


def _meets_one_station(meets: Any) -> Any:
    return lambda self, extent: self.station == extent.station and meets(self, extent)


def _beats_are_told(ended: Any) -> Any:
    def end_wrongly(self: Kernel, flight: Flight, outcome: Outcome, error: Any = None) -> None:
        ended(self, flight, outcome, error)
        if flight.write is not None and flight.write.mapping.is_heartbeat:
            self.out.append(flight.write.result(outcome, ''))

    return end_wrongly


def _told_each_time(ended: Any) -> Any:
    def end_wrongly(self: FallbackRow, *arguments: Any) -> Any:
        self.cause = self.cause or FallbackCause.TIMEOUT
        return ended(self, *arguments)

    return end_wrongly


def _never_too_old(init: Any) -> Any:
    def init_wrongly(self: WriteJob, *arguments: Any, **named: Any) -> None:
        init(self, *arguments, **named)
        self.expires = self.expires if self.is_own else math.inf

    return init_wrongly


def _messages_first(first: Any) -> Any:
    def take_wrongly(self: Agenda, now: float, busy: Any) -> Any:
        return self._messages and self._usual(now, busy) or first(self, now, busy)

    return take_wrongly


def _fallbacks_first(rank: Any) -> Any:
    def rank_wrongly(self: Plc, row: Any, now: float) -> Any:
        found = rank(self, row, now)
        return found if not found or found[0] else (0, found[1], isinstance(row, HeartbeatRow))

    return rank_wrongly


def _polls_before(carry_out: Any) -> Any:
    def carry_out_wrongly(self: HalfDuplexMaster, task: Any) -> Any:
        task.is_own = False
        return carry_out(self, task)

    return carry_out_wrongly


def _awaits_those_that_answer(before: Any) -> Any:
    return property(lambda self: not self._plc_of or self._conditions.are_all_due and not any(
        row.mapping.station in self._awaited for row in self._plc_of if not row.is_confirmed))


def _waits_for_no_port(has_to_wait: Any) -> Any:
    return lambda self, *, is_open, **named: is_open and has_to_wait(
        self, is_open=is_open, **named)


def _lets_stand(make_all_due: Any) -> Any:
    def make_due_wrongly(self: OrderlyEnd, now: float) -> None:
        make_all_due(self, now)
        self._standing = ()

    return make_due_wrongly


def _stores_nothing(init: Any) -> Any:
    def init_wrongly(self: Kernel, *arguments: Any, **named: Any) -> None:
        *others, table = arguments
        init(self, *others, mock.Mock(wraps=table, store=mock.Mock()), **named)

    return init_wrongly


def _told_twice(init: Any) -> Any:
    def init_wrongly(self: WaitingWrites, stations: Any, flights: Any, patience: Any, report: Any,
                     *arguments: Any) -> None:
        init(self, stations, flights, patience, lambda result: (report(result), report(result)),
             *arguments)

    return init_wrongly


def _undisturbed(at_most: Any) -> Any:
    return lambda self, frames: self._undisturbed(frames)


def _preset_of_a_period(preset: Any) -> Any:
    return lambda self, mapping: mapping.period / 1000


def _keeps_places(slice_of: Any) -> Any:
    kept: dict[str, slice] = {}

    def find_wrongly(self: Block, mapping: Mapping) -> slice:
        found: slice = slice_of(self, mapping)
        return kept.setdefault(mapping.tag, found) if mapping.length <= _SHORT else found

    return find_wrongly


def _undoes_one_word(take_back: Any) -> Any:
    def take_back_wrongly(self: MappedTable) -> None:
        del self.changed[1:]
        take_back(self)

    return take_back_wrongly


def _proves_itself(ended: Any) -> Any:
    def end_wrongly(self: Words, flight: Flight) -> None:
        ended(self, flight)
        if flight.outcome is Outcome.WRITTEN:
            flight.shown = flight.done

    return end_wrongly


def _proves_for_long(proof: Any) -> Any:
    def prove_wrongly(self: Words, write: Write, now: float, patience: float) -> str:
        last = self.last
        return str(proof(
            self, write, min(now, last.shown, last.done) if last else now, patience))

    return prove_wrongly


def _looks_too_late(spare_time: Any) -> Any:
    def spare_wrongly(self: Machine) -> float:
        deadline, self.deadline = self.deadline, None
        try:
            return spare_time.fget(self)  # type: ignore[no-any-return]
        finally:
            self.deadline = deadline

    return property(spare_wrongly)


def _always(value: Any) -> Callable[[Any], Any]:
    return lambda before: lambda *arguments, **named: value


MISTAKES = (
    Mistake('1', 'the heartbeat counts by two', HeartbeatRow, 'take', _counts_by_two),
    Mistake('2', 'no 0 at first contact', HeartbeatRow, 'begin', _begins_to_count),
    Mistake('2', 'the 0 stands for 0.1 s', HeartbeatRow, '_seen_at', _short_zero),
    Mistake('3 a', 'it counts on without a confirmation', HeartbeatRow, 'take',
            _counts_unconfirmed),
    Mistake('3 b', 'it counts beside a fallback that is due', Plc, '_why_held',
            _always('')),
    Mistake('3 c', 'it counts while the executor stands still', HeartbeatRow, 'executor_until',
            lambda before: property(lambda self: math.inf)),
    Mistake('3 d', 'it counts without the topics that it requires', HeartbeatRow, '__init__',
            _requires_nothing),
    Mistake('4', 'heartbeats have results', Kernel, 'ended', _beats_are_told),
    Mistake('4', 'a silent station is probed with heartbeats', Plc, 'is_active',
            lambda before: property(lambda self: True)),
    Mistake('4', 'a silent PLC is polled before its fallback', HalfDuplexMaster, 'carry_out',
            _polls_before),
    Mistake('5', 'the end does not wait for silent PLCs', OrderlyEnd, 'is_over',
            _awaits_those_that_answer),
    Mistake('5', 'the end does not wait for a lost port', OrderlyEnd, 'has_to_wait',
            _waits_for_no_port),
    Mistake('5', 'what stands is not written at the end', OrderlyEnd, 'begin',
            _lets_stand),
    Mistake('6', 'a message is not too old when it is sent', WriteJob, '__init__',
            _never_too_old),
    Mistake('11', 'messages go before heartbeats and fallbacks', Agenda, '_own_first',
            _messages_first),
    Mistake('11', 'fallbacks go before the 0', Plc, 'rank', _fallbacks_first),
    Mistake('12', 'the fallback of a Serve row is not stored', Kernel, '__init__',
            _stores_nothing),
    Mistake('15', 'rows are withheld in silence', ReadPoint, 'withhold', _always(False)),
    Mistake('16', 'the bound is Fallback_After alone', Times, 'at_most', _always(0.0)),
    Mistake('16', 'the bound counts no repetitions', Times, 'at_most', _undisturbed),
    Mistake('16', 'the preset is a Period', Times, '_preset', _preset_of_a_period),
    Mistake('26', 'messages go out before the connection was heard', Driver, '_connect',
            _always(None)),
    Mistake('17', 'each writing of a fallback has a result', FallbackRow, 'ended',
            _told_each_time),
    Mistake('results', 'equal messages have a turn each', Write, 'equals', _always(False)),
    Mistake('results', 'no change gives way to a newer one', WaitingWrites, 'gives_way',
            _always(False)),
    Mistake('results', 'the first of equal messages has the only result', WriteResult, 'of',
            lambda of: lambda self, origins, now: of(self, origins[:1], now)),
    Mistake('results', 'rows that share words pass each other', Mapping, 'shares_words',
            lambda before: lambda self, other: self is other),
    Mistake('results', 'a result comes twice', WaitingWrites, '__init__', _told_twice),
    Mistake('5', 'no fallbacks at the end', FallbackRow, 'end', _always(True)),
    Mistake('7', 'a refused message refreshes its row', FallbackRow, 'message_ended',
            _refused_refreshes),
    Mistake('7', 'a clock that is ahead is forgotten', RecentMax, 'add',
            lambda before: lambda self, number, now: number),
    Mistake('7', 'nobody sees that the process stood still', HostClock, 'least_age',
            _always(0.0)),
    Mistake('7', 'messages wait for ever', WaitingWrites, 'patience_of', _always(60.0)),
    Mistake('8', 'no fallback after the timeout', FallbackRow, 'deadline', _always(math.inf)),
    Mistake('8', 'a change to RUN is not seen', Kernel, 'mode_seen', _always(None)),
    Mistake('8', 'a fallback that stands is not written again', Plc, '_refresh_at',
            lambda before: staticmethod(lambda row: math.inf)),
    Mistake('9', 'a message from before the fallback is sent after it', OwnRows,
            'is_overruled', _always(False)),
    Mistake('10', 'a fallback is tried once', FallbackRow, 'ended', _always_confirmed),
    Mistake('13', 'RUN guards nothing', RunGuard, 'why_not', _always('')),
    Mistake('14', 'the counter guards nothing', CounterGuard, 'why_not', _always('')),
    Mistake('28', 'messages of two publishers are sent', OwnRows, 'why_refused', _always('')),
    Mistake('28', 'a second publisher ends nothing that waits or stands', Kernel,
            'new_crowds', _always(())),
    Mistake('18', 'read_only is ignored', Driver, '__init__', _writes_in_spite),
    Mistake('19', 'nobody looks for another writer', HeartbeatRow, 'read_back', _always('')),
    Mistake('5', 'the end does not wait for what may land', Words, 'lands_until',
            lambda before: property(lambda self: -math.inf)),
    Mistake('10', 'nothing is written again after what a gateway may hold', Words, 'again_at',
            _always(math.inf)),
    Mistake('8', 'a guest over a fallback is not seen', Words, '_guest_done',
            _sees_no_guest),
    Mistake('29', 'each failure is one of the station', OddCommands, 'is_suspect', _always(False)),
    Mistake('29', 'odd rows have no share', Probes, 'spent', _always(None)),
    Mistake('29', 'a block with an odd row stays whole', Refusals, 'refused', _always(None)),
    Mistake('guests', 'a command of a guest lives 60 s longer', GuestJob, '__init__',
            _lives_longer),
    Mistake('guests', 'a guest is blamed for the station', GuestJob, 'blames',
            lambda before: True),
    Mistake('guests', 'its broadcast has the words of one station', Flight, 'meets',
            _meets_one_station),
    Mistake('results', 'not sent is told as written', Write, 'result', _told_as_written),
    Mistake('results', 'unknown is told as not sent', Write, 'result', _told_as_not_sent),
    Mistake('results', 'messages are dropped in silence', WaitingWrites, 'drop',
            _dropped_in_silence),
    Mistake('values', 'a value is that of the read before', Codec, 'decode', _value_before),
    Mistake('values', 'a read that stood still is published', job, 'MOST_LATE',
            lambda before: math.inf),
    Mistake('values', 'a reload keeps the Length of before', Block, 'slice_of', _keeps_places),
    Mistake('link', 'a long reply is looked at after its deadline', Machine, 'spare_time',
            _looks_too_late),
    Mistake('link', 'what comes again is not known', Packet, 'duplicate_key',
            lambda before: property(lambda self: object())),
    Mistake('served', 'a refused command is undone in its first word', MappedTable, 'take_back',
            _undoes_one_word),
    Mistake('results', 'no read-back shows the value', Write, 'is_held', _always(False)),
    Mistake('27', 'a confirmation alone is the proof', Words, 'ended', _proves_itself),
    Mistake('27', 'a proof never becomes too old', Words, 'proof', _proves_for_long))


def find(mistake: Mistake, seed: int, limit: float) -> tuple[str, int, float, float]:
    """Return which check has found it, plants, hours of line time, and seconds it took."""
    begun, hours, plants = time.process_time(), 0.0, 0
    with ExitStack() as stack:
        made = mistake.make(getattr(mistake.owner, mistake.name))
        stack.enter_context(mock.patch.object(mistake.owner, mistake.name, made))
        while time.process_time() - begun < limit:
            story = Story(seed + plants)
            plants += 1
            try:
                story.run()
            except Broken as broken:
                hours += story.world.line.now / 3600
                return broken.check, plants, hours, time.process_time() - begun
            hours += story.world.line.now / 3600
    return '', plants, hours, time.process_time() - begun


def main() -> int:
    """Make each mistake; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--seconds', type=float, default=600.0, help='for each, of a processor')
    parser.add_argument('--only', default='', help='rules or texts that hold this')
    wanted = parser.parse_args()
    print('| rule | mistake | found by | plants | line time | processor |\n'
          '| --- | --- | --- | --- | --- | --- |')
    missed = 0
    for mistake in MISTAKES:
        if wanted.only not in f'{mistake.rule} {mistake.text}':
            continue
        check, plants, hours, seconds = find(mistake, wanted.seed, wanted.seconds)
        missed += not check
        print(f'| {mistake.rule} | {mistake.text} | {check or "NOT FOUND"} | {plants} | '
              f'{3600 * hours:.0f} s | {seconds:.1f} s |', flush=True)
    return int(missed > 0)


if __name__ == '__main__':
    sys.exit(main())
