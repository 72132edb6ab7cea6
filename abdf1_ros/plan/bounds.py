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
What heartbeats, fallback values and guarded reads cost, and which times they can keep.

The rules have the numbers of docs/heartbeats.md. T is the longest transaction that the settings
allow, with all repetitions. Times are in seconds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math

from abdf1_ros.df1.frames import Duplex, MAX_LINK_DATA, stuff
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, Transfer
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.steps import write_requests
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.plan import forecast
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.settings.heartbeats import (
    HAND_OVER,
    LAST_ANSWER,
    LEAST_REFRESH,
    LONGEST_END,
    READS_IN_TIME,
    STABLE,
    TIME_BASE,
)
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.map_row import CellFault
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import milliseconds

# Period (s) of the question for the mode of a station with heartbeats or fallbacks. A change to
# RUN is a first contact (rule 2).
MODE_PERIOD = 2.0

# Number of answers about the mode that have to fit into the stale time of a row (rule 13).
ANSWERS_IN_TIME = 3

# Period (s) that bounds assume for a row without a pause between its reads.
_SHORTEST = 0.01

# After this number of heartbeats and fallbacks in a row, a read has a turn (rule 11).
OWN_IN_A_ROW = 7

# After a guest's command, due checks and reads have the line this many times as long as the
# command had it.
OURS_BESIDE_GUESTS = 3

# The line may be too slow for all changes of a row. A change that has waited this long (s), or for
# half its patience if that is less, gives way to a newer change. The condition is that another
# write of the row has had the line meanwhile.
CARRIED_WITHIN = 1.0

# Default of the parameter write_timeout (s), which is not in the files.
USUAL_WRITE_TIMEOUT = 2.0

# A heartbeat with a shorter Period (ms) may count faster than the PLC scans.
_SHORT_PERIOD = 200

# Another setting is advised if it reduces the longest bound to less than this part.
_WORTH_IT = 0.9

_LONGEST_WORD = b'\x10\x10'  # the line sends each of these bytes twice

_STATUS_BYTES = 1, 26  # of the command after TNS, and of the longest usual reply


@dataclass(frozen=True, slots=True)
class Bound:
    """
    The times of a row (rule 16), in seconds.

    For a row with Fallback, ``seconds`` is the longest time that its outputs keep their value
    without a message. ``usual`` is the same time where no frame gets lost, None for a Serve row.
    Both are None if a master of the line decides when we send. For a heartbeat, ``seconds`` is the
    preset for the watchdog in the PLC.
    """

    mapping: Mapping
    seconds: float | None
    usual: float | None = None

    @property
    def presets(self) -> tuple[int, int] | None:
        """Return the presets of rungs 3 and 5 in units of 10 ms, None where there are none."""
        if not self.mapping.is_heartbeat or self.seconds is None:
            return None
        watchdog = math.ceil(round(self.seconds / TIME_BASE, 6))
        return watchdog, watchdog + STABLE

    def __str__(self) -> str:
        """Return the bound in words, with times in ms."""
        tag, station = self.mapping.tag, self.mapping.station
        if self.presets is not None:
            watchdog, stable = self.presets
            return (f'heartbeat {tag}, station {station}: PLC timer presets {watchdog} (watchdog, '
                    f'rung 3) and {stable} (rung 5), time base 0.01 s')
        kind = 'heartbeat' if self.mapping.is_heartbeat else 'fallback of'
        if self.seconds is None:
            return (f'{kind} {tag}, station {station}: no bound, because the master of the line '
                    'decides when the bridge writes')
        usual = '' if self.usual is None else \
            f', {milliseconds(self.usual)} where no frame gets lost'
        return f'{kind} {tag}, station {station}: written after ' \
            f'{milliseconds(self.seconds)} at most{usual}'


class Times:
    """
    The times that heartbeats and fallbacks of a line can keep.

    - ``blocks``: the blocks that are read again and again; reads on demand are in ``mappings``.
    - ``response_time``: usual seconds of a station for an answer.
    - ``longest``: T (s).
    """

    def __init__(self, network: Network, mappings: Rows, blocks: Sequence[Block] = (),
                 response_time: float = forecast.USUAL_RESPONSE_TIME) -> None:
        self._network = network
        self._mappings = mappings
        self._blocks = blocks
        self._response_time = response_time
        self._mode, self._line = network.line_mode, network.line
        model = forecast.line_model(network)
        on_demand = map(Planner(model, default_period=0.0).alone, mappings.on_demand)
        # The blocks may have been planned for another line: see ``advice``.
        reads = [model.read_time(block.dialect, request, block.station)
                 for block in (*blocks, *on_demand) for request in block.requests]
        usual = {mapping: _packets(model, mapping, mapping.dialect)
                 for mapping in mappings.written}
        # Where the station names a processor with shorter packets, a row has more of them.
        self._written = {mapping: _packets(model, mapping, _shortest(mapping))
                         for mapping in usual}
        # The command of a guest that is under way may be the longest that exists.
        guest = model.transaction_time(MAX_LINK_DATA, MAX_LINK_DATA) if network.share else 0.0
        written = map(max, usual.values())
        self.any_frames = max(*reads, *written, guest, _question_time(model, 0.0))
        served = [2 * mapping.codec.words for mapping in mappings.served]
        self._serves = bool(served)
        self._reply = model.transaction_time(0, min(max(served, default=0), MAX_LINK_DATA))
        self._longest_reply = model.transaction_time(0, MAX_LINK_DATA)
        self.longest = self._repeated(self.any_frames)

    def bounds(self) -> Iterator[Bound]:
        """Yield the bound of every row with Fallback, and the preset for every heartbeat."""
        return (self._bound(mapping) for mapping in self._mappings
                if mapping.is_alone)

    def _bound(self, mapping: Mapping) -> Bound:
        if mapping.fallback is None:
            return Bound(mapping, None if self._mode.is_polled else self._preset(mapping))
        after = mapping.fallback.after / 1000
        if mapping.serves:
            return Bound(mapping, after)
        if self._mode.is_polled:
            return Bound(mapping, None)
        at_most, undisturbed = self._waits[self._turn(mapping)]
        return Bound(mapping, after + at_most, after + undisturbed)

    def _preset(self, mapping: Mapping) -> float:
        """
        Return the longest time (s) between two counts of a heartbeat, with a scan of the PLC.

        It is at least three Periods.
        """
        assert mapping.period is not None
        period, turn = mapping.period / 1000, self._turn(mapping)
        beats, fallbacks = (
            [packet for own in rows if self._turn(own) == turn for packet in self._written[own]]
            for rows in (self._mappings.heartbeats, [
                own for own in self._mappings.fallbacks
                if not own.serves and own.station != mapping.station]))
        count = len(beats) + len(fallbacks)
        reads = self._reads_between(count) if count > 1 else 0
        # The transaction under way, the reads with a turn in between, all heartbeats, and the
        # fallbacks of other PLCs. The response time is used as the scan time of the PLC.
        wait = (1 + reads) * self.at_most(self.any_frames) + sum(map(self.at_most, beats)) \
            + sum(map(self._undisturbed, fallbacks)) + self._response_time
        return max(3 * period, period + wait)

    def of_message(self, mapping: Mapping) -> float:
        """Return the seconds of a message of a row alone on the line, with no frame lost."""
        return _with_answers(self._written[mapping], self._response_time)

    @cached_property
    def end(self) -> float | None:
        """Return the seconds of an orderly end where no frame gets lost, None for no bound."""
        if self._mode.is_polled:
            return None
        writes = self._own_packets
        return sum(map(self._undisturbed, [self.any_frames, *writes])) if writes else 0.0

    @property
    def end_in_silence(self) -> float | None:
        """Return the seconds of an orderly end where no PLC answers, None for no bound."""
        if self._mode.is_polled:
            return None
        writes = self._own_packets
        return self._mode.last_tries(self._line, writes, LAST_ANSWER) if writes else 0.0

    @property
    def _own_packets(self) -> list[float]:
        return [packet for own in self._mappings.own for packet in self._written[own]]

    def _turn(self, mapping: Mapping) -> int:
        """Return the station of a row where stations take turns, else 0 for the whole line."""
        return mapping.station if self._mode.takes_turns else 0

    @cached_property
    def _waits(self) -> dict[int, tuple[float, float]]:
        """Return the seconds until a due fallback is written: at most, and with no frame lost."""
        # In standard polling the turns of all other stations are part of each transaction's time.
        turns: defaultdict[int, list[float]] = defaultdict(list)
        for own in self._mappings.own:
            turns[self._turn(own)] += self._written[own]
        found = {}
        for turn, writes in turns.items():
            reads = self._reads_between(len(writes))
            # The transaction under way, the reads with a turn in between, and all our own writes.
            at_most, usual = ((1 + reads) * time(self.any_frames) + sum(map(time, writes))
                              for time in (self.at_most, self._undisturbed))
            found[turn] = at_most, usual
        return found

    def _reads_between(self, writes: int) -> int:
        """Return how many reads at most have a turn between ``writes`` own writes (rule 11)."""
        return writes if self._is_apart else 1 + (writes - 1) // OWN_IN_A_ROW

    @cached_property
    def _is_apart(self) -> bool:
        """Tell whether several stations have turns: then a read may go before each own write."""
        return self._mode.most_under_way(self._line) > 1 or len(
            {self._turn(own) for own in self._mappings.own}) > 1

    def at_most(self, frames: float) -> float:
        """Return the most seconds of a transaction, with one reply of ours in between."""
        reply = self._mode.longest_reply(self._line, self._longest_reply) \
            if self._serves or self._mode.answers_by_itself else 0.0
        return reply + self._repeated(frames)

    def _repeated(self, frames: float) -> float:
        return self._mode.longest_transaction(
            self._line, frames, self.any_frames, len(self._mappings.stations))

    def _undisturbed(self, frames: float) -> float:
        """Return the seconds of a transaction in which no frame gets lost."""
        reply = self._reply + self._response_time if self._serves else 0.0
        return reply + self._mode.undisturbed(
            self._line, frames, self._response_time, self.any_frames,
            len(self._mappings.stations))

    def advice(self) -> Iterator[str]:
        """Yield the setting that would shorten bounds and presets most, if that pays."""
        network = self._network
        ways = {'Timeout 100': replace(network, timeout=100),
                'Cmd_Timeout 500': replace(network, cmd_timeout=500),
                'NAK_Retries 1': replace(network, nak_retries=1),
                'ENQ_Retries 1': replace(network, enq_retries=1),
                'Baud 19200': replace(network, baud=19200),
                'Polling Message': replace(network, polling='Message')}
        least, way = min(
            (Times(other, self._mappings, self._blocks, self._response_time).worst, way)
            for way, other in ways.items())
        if least < _WORTH_IT * self.worst:
            yield (f'{way} would shorten the longest of these times most, from '
                   f'{milliseconds(self.worst)} to {milliseconds(least)}')

    @property
    def worst(self) -> float:
        """Return the longest bound (s), 0 where there is none."""
        return max((self._bound(mapping).seconds or 0.0 for mapping in self._mappings.own),
                   default=0.0)


def remarks(network: Network, mappings: Rows, blocks: Sequence[Block],
            response_time: float = forecast.USUAL_RESPONSE_TIME) -> Iterator[str]:
    """Yield remarks on the times of heartbeats and fallbacks (rules 2 and 16)."""
    times = Times(network, mappings, blocks, response_time)
    longest, end = times.longest, times.end or 0.0
    silent = times.end_in_silence or 0.0
    if end > LONGEST_END:
        yield (f'an orderly end needs {milliseconds(end)} and has {milliseconds(LONGEST_END)}: '
               'the last rows keep their values. Use fewer rows, a higher Baud or several lines')
    elif end > HAND_OVER:
        yield (f'an orderly end needs {milliseconds(end)}; ~/polling has '
               f'{milliseconds(HAND_OVER)}, and the last rows keep their values')
    if end <= LONGEST_END < silent:
        yield (f'an orderly end where no PLC answers needs {milliseconds(silent)} and has '
               f'{milliseconds(LONGEST_END)}: the bridge does not try the last rows; shorten '
               'Timeout or Cmd_Timeout, or use fewer rows')
    elif end <= HAND_OVER < silent <= LONGEST_END:
        yield (f'an orderly end where no PLC answers needs {milliseconds(silent)}; ~/polling and '
               f'~/reload have {milliseconds(HAND_OVER)}, and the bridge does not try the last '
               'rows')
    for mapping in mappings:
        if mapping.is_heartbeat and mapping.period is not None:
            if longest > mapping.period / 1000:
                yield (f'{mapping.tag}: one transaction may take {milliseconds(longest)}, its '
                       f'Period is {mapping.period} ms; shorten Timeout, Cmd_Timeout or the '
                       'retries')
            if mapping.period < _SHORT_PERIOD:
                yield (f'{mapping.tag}: a Period of {mapping.period} ms may be shorter than a '
                       'scan of the PLC, which then misses values')
        if mapping.fallback is None or mapping.serves:
            continue
        after = mapping.fallback.after / 1000
        write = times.of_message(mapping)
        if after < write:
            # A message may have to wait for the one before it.
            yield (f'{mapping.tag}: Fallback_After {milliseconds(after)} is shorter than a write '
                   f'of all its words, {milliseconds(write)}, so the fallback comes in the middle '
                   f'of each message; {milliseconds(2 * max(write, longest))} would be enough')
        elif after < 2 * longest:
            yield (f'{mapping.tag}: Fallback_After {milliseconds(after)} is shorter than '
                   f'two transactions of {milliseconds(longest)}; a few lost frames bring the '
                   'fallback')
    yield from _late_states(network, mappings, response_time)


def _late_states(network: Network, mappings: Rows, response_time: float) -> Iterator[str]:
    """Yield a remark on the first row that may lose its newest state if messages are too many."""
    model = forecast.line_model(network)
    rows = [mapping for mapping in mappings.messages if not mapping.serves]
    a_write_each = sum(_with_answers(_packets(model, mapping, mapping.dialect), response_time)
                       for mapping in rows)
    for mapping in rows:
        after = mapping.fallback.after / 1000 if mapping.fallback else math.inf
        patience = min(USUAL_WRITE_TIMEOUT, after)
        if min(CARRIED_WITHIN, patience / 2) + a_write_each > patience:
            yield (f'{mapping.tag}: if programs publish all write topics faster than the line '
                   'can carry, a message waits for a write of each, '
                   f'{milliseconds(a_write_each)}; so even the newest value may be older than '
                   f'{milliseconds(patience)} and is not '
                   'sent. Publish less often, or fewer rows')
            return


def _with_answers(packets: Sequence[float], response_time: float) -> float:
    """Return the seconds that transactions take, answers included."""
    return sum(packets) + len(packets) * forecast.ANSWERS * response_time


def _shortest(mapping: Mapping) -> Dialect:
    """Return the dialect with the shortest packets that the station of a row may need."""
    found = [mapping.dialect]
    if mapping.processor is None:
        found += FAMILIES[mapping.plc_type].by_processor.values()
    return min(found, key=lambda dialect: dialect.max_write(FileType.INTEGER))


def _packets(model: LineModel, mapping: Mapping, dialect: Dialect) -> list[float]:
    """Return the line time (s) of each transaction of a write of a row: of its Fallback, or 0."""
    zeros = '' if mapping.type is ValueType.STRING else [0] * mapping.length
    values = raw_values(mapping, mapping.fallback.values) if mapping.fallback else zeros
    codec = mapping.codec
    requests = write_requests(mapping.address, codec, values, dialect)
    rewritten: list[Address] = []
    if mapping.may_rewrite and not isinstance(values, str):
        # After the refusal each word is read and written back; what is in it is not known here.
        rewritten += (word for word, _, _ in codec.bit_changes(mapping.address, values))
        requests += (dialect.write(word, _LONGEST_WORD) for word in rewritten)
    return [*(model.transaction_time(len(stuff(body)), 0) for _, body in requests),
            *(model.read_time(dialect, Transfer(word, 1)) for word in rewritten)]


def own_work(model: LineModel, mappings: Rows, default_period: float,
             stale_after: float = forecast.USUAL_STALE_AFTER,
             response_time: float = forecast.USUAL_RESPONSE_TIME) -> list[forecast.OwnCommand]:
    """
    Return the commands that go between the reads.

    These are heartbeats, questions for a mode, and fallbacks that stand and are written again.
    """
    question = _question_time(model, response_time)
    periods = {mapping: mapping.period / 1000 for mapping in mappings.heartbeats if mapping.period}
    periods |= {mapping: max(mapping.fallback.after / 1000, LEAST_REFRESH)
                for mapping in mappings.fallbacks if mapping.fallback and not mapping.serves}
    return [*(forecast.OwnCommand(_with_answers([packet], response_time), period, mapping.station)
              for mapping, period in periods.items()
              for packet in _packets(model, mapping, mapping.dialect)),
            *(forecast.OwnCommand(question, period, station) for station, period in
              mode_periods(mappings, default_period, stale_after).items())]


def mode_periods(mappings: Rows, default_period: float, stale_after: float) -> dict[int, float]:
    """
    Return the stations that are asked for their mode, and the period (s) on a free line.

    A change to RUN is a first contact for heartbeats and fallbacks (rule 2). Several answers have
    to fit into the stale time of each row with While RUN (rule 13).
    """
    periods = dict.fromkeys((mapping.station for mapping in mappings.own), MODE_PERIOD)
    for mapping in mappings.guarded:
        if mapping.needs_run:
            period = max(forecast.period_of(mapping, default_period), _SHORTEST) \
                * stale_after / ANSWERS_IN_TIME
            periods[mapping.station] = min(period, periods.get(mapping.station, period))
    return periods


def _question_time(model: LineModel, response_time: float) -> float:
    """Return the seconds that it takes to ask a station for its mode."""
    return _with_answers([model.transaction_time(*_STATUS_BYTES)], response_time)


def costs(network: Network, mappings: Rows, default_period: float,
          response_time: float = forecast.USUAL_RESPONSE_TIME) -> Iterator[str]:
    """Yield what While RUN costs or needs, for each station."""
    question = _question_time(forecast.line_model(network), response_time)
    periods = mode_periods(mappings, default_period, forecast.USUAL_STALE_AFTER)
    for station in sorted({mapping.station for mapping in mappings.guarded if mapping.needs_run}):
        if network.line_mode.only_listens:
            yield (f'While RUN: rows have values only if the master asks station {station} for '
                   'its diagnostic status')
        else:
            yield (f'While RUN: asking station {station} for its mode about every '
                   f'{milliseconds(periods[station])} takes '
                   f'{question / periods[station]:.0%} of the time')


def conditions(network: Network, mappings: Rows) -> Iterator[str]:
    """Yield the conditions of the bounds that are not in the settings of the line."""
    if network.duplex is not Duplex.RADIO or not mappings.own:
        return
    yield ('bounds by radio: NAK_Retries makes up for lost commands. It does not for lost replies '
           'of a PLC that drops repetitions, as SLC and MicroLogix do: that PLC then counts as '
           'silent until it answers a probe')
    if network.store_forward:
        yield ('bounds by radio: a node that stores and forwards drops repetitions, so behind '
               'such a node no bound holds after a lost packet')


def guard_faults(model: LineModel, mappings: Rows,
                 default_period: float) -> Iterator[tuple[Mapping, CellFault]]:
    """Yield the guarded rows whose counter is not read often enough (rule 14), and why."""
    counters = {mapping: (condition.names[0], condition.timeout) for mapping in mappings.guarded
                if (condition := mapping.condition) and condition.timeout is not None}
    blocks = Planner(model, default_period).plan(mappings.repeated) if counters else []
    expected = forecast.intervals(model, blocks, own_work(model, mappings, default_period))
    found = {mapping.tag: expected[block] for block in blocks for mapping in block.mappings}
    for mapping, (tag, timeout) in counters.items():
        needed = math.ceil(round(1000 * READS_IN_TIME * found.get(tag, 0.0), 6))
        if timeout < needed:
            yield mapping, CellFault(
                'While_Timeout', f'While_Timeout {timeout} ms is shorter than '
                f'{READS_IN_TIME} reads of {tag} on this line; {needed} ms would be enough')
