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
The forecast of a line: poll cycle, load and intervals, before anything is connected.

It uses the line model of the planner, and assumes how long a station takes to answer. A
transaction has two answers (M 14-2). The first is to the command. The second is to the poll, or in
full duplex it is the reply. PLCs serve the port once in a program scan.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
import math
from typing import NamedTuple

from abdf1_ros.df1.mode import LineMode
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network

USUAL_RESPONSE_TIME = 0.01
USUAL_STALE_AFTER = 3.0  # periods, after which a value counts as lost
ANSWERS = LineMode.answers

# Reads without a period get the time that reads with a period leave. Each has at least one turn in
# this number of poll cycles.
PATIENCE = 4

# Period (s) that the forecast assumes for a row that is read on demand.
_ON_DEMAND = 1.0

# Rounds in which the time of a scan is found.
_ROUNDS = 50


class OwnCommand(NamedTuple):
    """A command that goes between the reads, again and again; times in seconds."""

    seconds: float
    period: float
    station: int = 0


def line_model(network: Network) -> LineModel:
    """Return the line of a net CSV."""
    mode = network.line_mode
    return LineModel(network.checksum, mode.duplex, network.timing, mode.pause(network.line),
                     mode.idle_poll(network.line))


def block_time(block: Block, response_time: float = USUAL_RESPONSE_TIME) -> float:
    """Return the seconds that a block takes when each answer takes ``response_time`` s."""
    return block.line_time + ANSWERS * response_time * len(block.requests)


def answer_time(network: Network, blocks: Iterable[Block],
                response_time: float = USUAL_RESPONSE_TIME) -> float:
    """
    Return the seconds that the line waits for an answer that takes ``response_time`` seconds.

    By radio a transaction has one answer, and several stations may work on their answers at a
    time.
    """
    mode, line = network.line_mode, network.line
    stations = len({block.station for block in blocks})
    at_once = max(1, min(mode.most_under_way(line), stations))
    return response_time * mode.answers / ANSWERS / at_once


def poll_cycle(blocks: Iterable[Block], response_time: float = USUAL_RESPONSE_TIME) -> float:
    """Return the seconds that it takes to read every block once."""
    return sum(block_time(block, response_time) for block in blocks)


def load(blocks: Iterable[Block], response_time: float = USUAL_RESPONSE_TIME) -> float:
    """
    Return the part of the line's time that all periods need; above 1 they cannot be kept.

    Blocks without a period use the remaining time and are not counted.
    """
    return sum(block_time(block, response_time) / block.period for block in blocks if block.period)


def intervals(line: LineModel, blocks: Iterable[Block], own: Iterable[OwnCommand] = (),
              response_time: float = USUAL_RESPONSE_TIME) -> dict[Block, float]:
    """
    Return the expected seconds between two reads of each block.

    That is the period, as far as the line allows. ``own`` has the commands that go between the
    reads: see ``bounds.own_work``.
    """
    return {block: time for turns in _all_turns(line, blocks, own, response_time)
            for block, time in turns.intervals().items()}


@dataclass(frozen=True, slots=True)
class _Turns:
    """
    Commands that take turns, because only one of them can be carried out at a time.

    ``blocks`` has the seconds of each block. ``own`` has the seconds and the period (s) of each
    other command. With ``own_goes_first`` only the periods of reads become longer.
    """

    blocks: list[tuple[Block, float]] = field(default_factory=list)
    own: list[tuple[float, float]] = field(default_factory=list)
    own_goes_first: bool = False

    @property
    def needed(self) -> float:
        """Return the part of the time that all periods need."""
        return sum(time / block.period for block, time in self.blocks if block.period) \
            + sum(time / period for time, period in self.own)

    @property
    def between(self) -> float:
        """Return the seconds of the commands of ``own`` that may go between two reads."""
        times = [time for time, _ in self.own]
        reads = sum(len(block.requests) for block, _ in self.blocks)
        return min(sum(times), reads * max(times, default=0.0))

    def intervals(self) -> dict[Block, float]:
        """
        Return the expected seconds between two reads of each block.

        If the periods need too much, all become longer by the factor of the need, at most by a
        poll cycle, as in ``ReadQueue``.
        """
        once, needed = sum(time for _, time in self.blocks), self.needed
        unlimited = sum(time for block, time in self.blocks if not block.period)
        rest = PATIENCE * once
        if unlimited and needed < 1:
            rest = min(rest, unlimited / (1 - needed))
        if unlimited:
            needed += unlimited / rest
        if self.own_goes_first:
            own = sum(time / period for time, period in self.own)
            needed = (needed - own) / (1 - own) if own < 1 else math.inf
        stretch = max(1.0, needed)
        cycle = once + sum(time for time, _ in self.own)
        return {block: min(stretch * wanted, wanted + cycle)
                for block, _ in self.blocks for wanted in [block.period or rest]}

    def in_scans(self, scan: float) -> _Turns:
        """Return the same commands, if each packet takes ``scan`` seconds."""
        return _Turns([(block, scan * len(block.requests)) for block, _ in self.blocks],
                      [(scan, period) for _, period in self.own], own_goes_first=True)

    def part_of_scan(self, scan: float, poll: float) -> float:
        """Return the seconds of a scan in which the station of these commands is polled."""
        busy = self.in_scans(scan).needed
        if busy > 1:
            return self.needed * scan / busy  # a command in each scan
        free = [(time, len(block.requests)) for block, time in self.blocks if not block.period]
        rest = sum(time for time, _ in free) / sum(packets for _, packets in free) \
            if free else poll
        return self.needed * scan + (1 - busy) * rest


def _all_turns(line: LineModel, blocks: Iterable[Block], own: Iterable[OwnCommand],
               response_time: float) -> Collection[_Turns]:
    """
    Return the commands that take turns: all of the line, or in standard polling of each station.

    In standard polling a station has one command at a time. Its reply is fetched when the station
    is polled (1766-RM001, "Standard polling"), so each packet takes a scan. Of these turns
    heartbeats take theirs first. The forecast knows no poll lists: it assumes that each station
    with a command is polled once in a scan.
    """
    blocks = list(blocks)
    gateways = {block.station: via for block in blocks
                if (via := block.mappings[0].via) is not None}

    def polled(station: int) -> int:
        return gateways.get(station, station) if line.idle_poll else 0

    found: defaultdict[int, _Turns] = defaultdict(_Turns)
    for block in blocks:
        found[polled(block.station)].blocks.append((block, block_time(block, response_time)))
    for command in own:
        found[polled(command.station)].own.append((command.seconds, command.period))
    if not line.idle_poll:
        return found.values()
    scan = _scan(found.values(), line.idle_poll + response_time)
    return [turns.in_scans(scan) for turns in found.values()]


def _scan(stations: Collection[_Turns], poll: float) -> float:
    """Return the seconds of a scan, in which a poll without a reply takes ``poll`` seconds."""
    # More than any scan takes. Each round comes nearer to the true time, from above.
    scan = sum(poll + sum(time for _, time in turns.blocks) + sum(time for time, _ in turns.own)
               for turns in stations)
    for _ in range(_ROUNDS):
        scan = sum(turns.part_of_scan(scan, poll) for turns in stations)
    return scan


def longest_wait(blocks: Iterable[Block], response_time: float = USUAL_RESPONSE_TIME) -> float:
    """Return the seconds that the longest single transaction takes."""
    return max((time for block in blocks for time in block.line_times), default=0.0) \
        + ANSWERS * response_time


def stale_times(line: LineModel, blocks: Collection[Block], default_period: float,
                stale_after: float, own: Iterable[OwnCommand] = (), *,
                is_heard: bool = False) -> dict[Mapping, float]:
    """
    Return after how many seconds a value of each mapping that is read counts as lost.

    Topics promise this time: ``stale_after`` times the expected interval, plus the longest wait
    for the line. Where many commands of ``own`` are due together, one may go after each read: then
    it is at least the interval and the time of these. ``default_period`` is in seconds; ``own`` is
    described at ``intervals``. With ``is_heard`` another master reads the words, at least once in
    a Period. Then Period takes the place of the interval, and there is no wait.
    """
    if is_heard:
        return {mapping: stale_after * period_of(mapping, default_period)
                for block in blocks for mapping in block.mappings if mapping.polls}
    wait, found = longest_wait(blocks), {}
    for turns in _all_turns(line, blocks, own, USUAL_RESPONSE_TIME):
        for block, expected in turns.intervals().items():
            for mapping in block.mappings:
                if mapping.polls:
                    interval = max(period_of(mapping, default_period), expected)
                    found[mapping] = max(
                        stale_after * interval, interval + turns.between) + wait
    return found


def period_of(mapping: Mapping, default_period: float) -> float:
    """Return the seconds from one read of a mapping to the next, as Period or the default asks."""
    if mapping.is_on_demand:
        return _ON_DEMAND
    return default_period if mapping.period is None else mapping.period / 1000
