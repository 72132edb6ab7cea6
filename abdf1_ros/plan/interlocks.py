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

The numbers of rules are those of docs/heartbeats.md. T is the longest transaction that the
settings allow, with all repetitions. Times are in seconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from abdf1_ros.pccc.values import ValueType
from abdf1_ros.plan import forecast
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network

# A station that we write heartbeats or fallbacks to is asked for its mode so often (s): a change
# to RUN is a first contact (rule 2).
MODE_PERIOD = 2.0

# So many answers about the mode have to fit into the stale time of a row (rule 13).
ANSWERS_IN_TIME = 3

# A counter has to be read so often within its Heartbeat_Timeout (rule 14).
_READS_IN_TIME = 3

# A poll, and DLE EOT as the answer.
_POLL_CHARACTERS = 6

_STATUS_BYTES = 1, 26  # of the command after TNS, and of the longest usual reply


@dataclass(frozen=True, slots=True)
class Bound:
    """
    The bound of a row (rule 16), in seconds.

    For a row with Fallback: how long its outputs keep their value at most without a message; None
    where a master of the line decides that. For a heartbeat: the preset for the timer in the PLC.
    """

    mapping: Mapping
    seconds: float | None

    def __str__(self) -> str:
        """Return it in words, with times in ms."""
        tag, station = self.mapping.tag, self.mapping.station
        if self.mapping.heartbeat is not None:
            return f'heartbeat {tag}, station {station}: PLC timer preset {_ms(self.seconds)}'
        if self.seconds is None:
            return f'fallback of {tag}, station {station}: no bound, its master decides'
        return f'fallback of {tag}, station {station}: written after {_ms(self.seconds)} at most'


def _ms(seconds: float | None) -> str:
    return 'has no bound' if seconds is None else f'{seconds * 1000:.0f} ms'


def bounds(network: Network, mappings: Sequence[Mapping],
           response_time: float = forecast.USUAL_RESPONSE_TIME) -> Iterator[Bound]:
    """Yield the bound of every row with Fallback, and the preset for every heartbeat."""
    longest = longest_transaction(network, mappings, response_time)
    fallbacks = sum(write_time(network, mapping, response_time)
                    for mapping in mappings if mapping.fallback and not mapping.serves)
    beats = sum(write_time(network, mapping, response_time)
                for mapping in mappings if mapping.heartbeat)
    for mapping in mappings:
        if mapping.fallback is not None:
            after = mapping.fallback.after / 1000
            if mapping.serves:
                yield Bound(mapping, after)
            elif network.mode == 'Slave':
                yield Bound(mapping, None)
            else:
                scan = _poll_scan(network, mappings, response_time)
                yield Bound(mapping, after + longest + fallbacks + scan)
        elif mapping.heartbeat is not None and mapping.period is not None:
            period = mapping.period / 1000
            # The response time stands for the scan of the PLC.
            preset = max(3 * period, period + 2 * longest + beats + response_time)
            yield Bound(mapping, None if network.mode == 'Slave' else preset)


def remarks(network: Network, mappings: Sequence[Mapping],
            response_time: float = forecast.USUAL_RESPONSE_TIME) -> Iterator[str]:
    """Yield remarks on the times of heartbeats and fallbacks (rule 16)."""
    longest = longest_transaction(network, mappings, response_time)
    for mapping in mappings:
        if mapping.heartbeat is not None and mapping.period is not None \
                and longest > mapping.period / 1000:
            yield (f'{mapping.tag}: one transaction may take {_ms(longest)}, its Period is '
                   f'{mapping.period} ms; shorten Timeout, Cmd_Timeout or the retries')
        if mapping.fallback is not None and not mapping.serves \
                and mapping.fallback.after / 1000 < 2 * longest:
            yield (f'{mapping.tag}: Fallback_After {mapping.fallback.after} ms is shorter than '
                   f'two transactions of {_ms(longest)}; a few lost frames bring the fallback')


def write_time(network: Network, mapping: Mapping,
               response_time: float = forecast.USUAL_RESPONSE_TIME) -> float:
    """Return the seconds that a write of a row takes, answers included."""
    model, dialect = forecast.line_model(network), mapping.dialect
    address, words = mapping.address, mapping.codec.words
    bodies: list[bytes] = []
    if mapping.type is ValueType.BOOL:
        bodies += [dialect.write_bits(address.at_offset(address.offset + number), 0, 0)[1]
                   for number in range(words)]
    else:
        step = dialect.max_write(address.file_type)
        bodies += [dialect.write(address.at_offset(address.offset + first),
                                 bytes(2 * min(step, words - first)))[1]
                   for first in range(0, words, step)]
    return sum(_time(model, len(body), 0, response_time) for body in bodies)


def _time(model: LineModel, command: int, reply: int, response_time: float) -> float:
    return model.transaction_time(command, reply) + forecast.ANSWERS * response_time


def own_load(network: Network, mappings: Iterable[Mapping], default_period: float,
             response_time: float = forecast.USUAL_RESPONSE_TIME) -> float:
    """Return the part of the line's time for heartbeats and for questions for the mode."""
    mappings = list(mappings)
    beats = sum(write_time(network, mapping, response_time) / (mapping.period / 1000)
                for mapping in mappings if mapping.heartbeat is not None and mapping.period)
    return beats + sum(_question_time(network, response_time) / period
                       for period in _asked(mappings, default_period).values())


def _asked(mappings: Iterable[Mapping], default_period: float) -> dict[int, float]:
    """Return the seconds between two questions for the mode, by station."""
    asked: dict[int, float] = {}

    def ask(station: int, period: float) -> None:
        asked[station] = min(period, asked.get(station, period))

    for mapping in mappings:
        if (mapping.heartbeat or mapping.fallback) and not mapping.serves:
            ask(mapping.station, MODE_PERIOD)
        if mapping.needs_run:
            ask(mapping.station, max(forecast.period_of(mapping, default_period), 0.01))
    return asked


def _question_time(network: Network, response_time: float) -> float:
    """Return the seconds that it takes to ask a station for its mode."""
    return _time(forecast.line_model(network), *_STATUS_BYTES, response_time)


def costs(network: Network, mappings: Sequence[Mapping], default_period: float,
          response_time: float = forecast.USUAL_RESPONSE_TIME) -> Iterator[str]:
    """Yield what Publish_While RUN costs, for each station."""
    guarded = {mapping.station for mapping in mappings if mapping.needs_run}
    for station, period in sorted(_asked(mappings, default_period).items()):
        if station in guarded:
            part = _question_time(network, response_time) / period
            yield (f'Publish_While RUN: asking station {station} for its mode about every '
                   f'{_ms(period)} takes {part:.0%} of the time')


def longest_transaction(network: Network, mappings: Iterable[Mapping],
                        response_time: float = forecast.USUAL_RESPONSE_TIME) -> float:
    """Return T: the longest transaction of the settings plus the time of our longest write."""
    return forecast.longest_transaction(network) + max(
        (write_time(network, mapping, response_time) for mapping in mappings
         if mapping.heartbeat or mapping.fallback), default=0.0)


def _poll_scan(network: Network, mappings: Iterable[Mapping], response_time: float) -> float:
    """Return the seconds of one poll of every station, where these are polled in turns."""
    if network.mode != 'Master' or network.polling != 'Standard':
        return 0.0
    stations = {mapping.station for mapping in mappings if not mapping.serves}
    poll = _POLL_CHARACTERS * network.timing.char_time + network.timing.tx_delay + response_time
    return len(stations) * poll


def guard_faults(mappings: Sequence[Mapping], planner: Planner,
                 response_time: float = forecast.USUAL_RESPONSE_TIME
                 ) -> Iterator[tuple[Mapping, str]]:
    """Yield the guarded rows whose counter is not read often enough (rule 14), and why."""
    counters = {mapping: (condition.text, condition.timeout) for mapping in mappings
                if (condition := mapping.publish_while) and condition.timeout is not None}
    blocks = planner.plan(mappings) if counters else []
    expected = forecast.intervals(blocks, response_time)
    found = {mapping.tag: expected[block.period] for block in blocks for mapping in block.mappings}
    for mapping, (tag, timeout) in counters.items():
        needed = _READS_IN_TIME * found.get(tag, 0.0)
        if timeout / 1000 < needed:
            yield mapping, (
                f'Heartbeat_Timeout {timeout} ms is shorter than {_READS_IN_TIME} reads of {tag} '
                f'on this line; {needed * 1000:.0f} ms would do')
