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

from collections.abc import Iterable, Sequence

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


def line_model(network: Network) -> LineModel:
    """Return the line of a net CSV."""
    mode = network.line_mode
    return LineModel(network.checksum, mode.duplex, network.timing, mode.pause(network.line))


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


def intervals(blocks: Iterable[Block], own: Iterable[tuple[float, float]] = (),
              response_time: float = USUAL_RESPONSE_TIME) -> dict[float, float]:
    """
    Return the expected seconds between two reads of a block, by its period (s).

    That is the period, as far as the line allows. On a full line all periods become longer by the
    factor of the load, at most by a poll cycle, as in ``ReadQueue``. ``own`` holds the seconds and
    the period of each command that goes between the reads: see ``bounds.own_work``.
    """
    blocks, own = list(blocks), list(own)
    once = poll_cycle(blocks, response_time)
    needed = load(blocks, response_time) + sum(seconds / period for seconds, period in own)
    unlimited = poll_cycle((block for block in blocks if not block.period), response_time)
    wanted = {block.period: block.period or PATIENCE * once for block in blocks}
    if unlimited and needed < 1:
        wanted[0.0] = min(wanted[0.0], unlimited / (1 - needed))
    stretch = max(1.0, needed + unlimited / wanted[0.0] if unlimited else needed)
    cycle = once + sum(seconds for seconds, _ in own)
    return {period: min(stretch * time, time + cycle) for period, time in wanted.items()}


def longest_wait(blocks: Iterable[Block], response_time: float = USUAL_RESPONSE_TIME) -> float:
    """Return the seconds that the longest single transaction takes."""
    return max((time for block in blocks for time in block.line_times), default=0.0) \
        + ANSWERS * response_time


def stale_times(blocks: Iterable[Block], default_period: float, stale_after: float,
                own: Sequence[tuple[float, float]] = (), *,
                is_heard: bool = False) -> dict[Mapping, float]:
    """
    Return after how many seconds a value of each mapping that is read counts as lost.

    Topics promise this time: ``stale_after`` times the expected interval, plus the longest wait
    for the line. Where many commands of ``own`` are due together, one may go after each read: then
    it is at least the interval and the time of these. ``default_period`` is in seconds; ``own`` is
    described at ``intervals``. With ``is_heard`` another master reads the words, at least once in
    a Period. Then Period takes the place of the interval, and there is no wait.
    """
    blocks, times = list(blocks), [seconds for seconds, _ in own]
    expected, wait = ({}, 0.0) if is_heard else (intervals(blocks, own), longest_wait(blocks))
    reads = sum(len(block.requests) for block in blocks)
    between = 0.0 if is_heard else min(sum(times), reads * max(times, default=0.0))

    def stale_time(interval: float) -> float:
        return max(stale_after * interval, interval + between) + wait

    return {mapping: stale_time(max(period_of(mapping, default_period),
                                    expected.get(block.period, 0.0)))
            for block in blocks for mapping in block.mappings if mapping.polls}


def period_of(mapping: Mapping, default_period: float) -> float:
    """Return the seconds from one read of a mapping to the next, as Period or the default asks."""
    if mapping.is_on_demand:
        return _ON_DEMAND
    return default_period if mapping.period is None else mapping.period / 1000
