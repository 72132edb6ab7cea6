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

"""The statuses ``link`` (with the speed and load of the line) and ``counters``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from operator import attrgetter
from statistics import fmean

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.link_counters import NO_MEMORY, UNSENT
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.port_thread import RELEASED
from abdf1_ros.ros.diagnostics.line import LineView, takes_in_silence
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, period_of, Seen, WARN, with_age
from abdf1_ros.settings.network import Network
from abdf1_ros.text import age_text, counted, milliseconds

# The status warns after this many seconds without a poll of the master.
_LONGEST_UNPOLLED = 5.0

LOAD_BY_TOPIC = 'line load by topic'
_MOST_TOPICS = 40  # a map may have thousands
_MOST_CARRIED = 30  # most reads of other nodes in the status: the latest


class LinkStatus:
    """The port, the stations that answer on it, and the load of the line."""

    name = 'link'

    def __init__(self, line: LineView, port: str, seen: Seen) -> None:
        self.hardware_id = port
        self._line = line
        self._seen = seen
        self._rate = _LoadMeter()

    def judge(self, now: float) -> Judgement:
        level, text = self._judge_line(now)
        for fault in filter(None, (self._seen.duplicate_name(), self._seen.dds_fault)):
            level, text = max(level, WARN), f'{text}; {fault}'
        return level, text

    def _judge_line(self, now: float) -> Judgement:
        link, driver = self._line.link, self._line.driver
        if link and link.is_released:
            return WARN, RELEASED
        if why := self._line.why_closed:
            return ERROR, why
        polled = driver.link.status().last_poll
        if polled is not None and now - polled > _LONGEST_UNPOLLED:
            return WARN, f'port open, but not polled for {now - polled:.0f} s'
        if fault := self._line.fault(now):
            return ERROR, fault
        return self._judge_stations(now)

    def _judge_stations(self, now: float) -> Judgement:
        stations = [*self._line.driver.stations]
        total, active = len(stations), sum(station.active for station in stations)
        deaf, garbled = self._line.deaf_stations(now), self._line.garbled_stations(now)
        if deaf or garbled:
            is_any_good = any(station.active and not takes_in_silence(station)
                              and station.number not in (*deaf, *garbled) for station in stations)
            return WARN if is_any_good else ERROR, (
                f'port open, but {len(deaf)} of {total} stations answer polls and no command'
                if deaf else
                f'port open, but no reply of {len(garbled)} of {total} stations arrives whole')
        if total and not active:
            if self._line.driver.overheard is not None:
                return ERROR, f'port open, but none of {total} stations is heard'
            return ERROR, f'port open, but none of {total} stations answers' + (
                ', or the device server keeps this connection waiting' if '://' in self.hardware_id
                else '')
        silent = sum(map(takes_in_silence, stations))
        shown = ''.join(f'; {text}' for text in self._line.evidence()[:1])
        if silent and silent == active:
            return ERROR, f'port open, but none of {total} stations replies to commands{shown}'
        if active < total:
            return WARN, f'port open, {total - active} of {total} stations do not answer'
        if unreached := sum(station.local_status != 0 for station in stations):
            return WARN if unreached < total else ERROR, (
                f'port open, {unreached} of {total} stations are not reached by their gateway')
        if silent:
            return WARN, (
                f'port open, {silent} of {total} stations take commands and do not reply{shown}')
        if shown:
            return WARN, f'port open{shown}'
        heard = sum(station.last_heard is not None for station in stations)
        if refused := self._line.driver.refused.lately(now):
            return WARN, f'port open, but the bridge has refused a command of {refused[-1]}'
        return OK, f'port open, {heard} of {total} stations have answered'

    def values(self, now: float) -> dict[str, str]:
        driver, opener = self._line.driver, self._line.opener
        found = self._line.diagnosis(now)
        self._rate.update(driver, now)
        return {
            'port': 'closed' if self._line.why_closed else 'open',
            'settings': _settings(driver.network),
            'transactions per second': f'{self._rate.transactions:.1f}',
            'line load': f'{self._rate.load:.0f} %',
            'poll cycle with Periods': milliseconds(driver.readings.reads.poll_cycle),
            'longest poll cycle with Periods': milliseconds(
                driver.readings.reads.longest_poll_cycle),
            'expected poll cycle, 10 ms an answer': milliseconds(
                driver.readings.expected_poll_cycle),
            LOAD_BY_TOPIC: load_by_topic(driver.readings.reads.jobs),
            **_paces(driver.points.values()),
            **_poll_scans(driver),
            **_unnumbered_counts(driver),
            **_carried(driver, now),
            **{f'refused: {text}': f'{count} times'
               for text, count in driver.refused.counted().items()},
            **{name: str(count) for name, count in (opener.errors() if opener else {}).items()},
            **period_of(self._seen),
            'files': changed_text(self._seen) or 'as read',
            'last error': with_age(self._seen.last_error, now),
            **({} if found is None else {'cause': found.cause, 'next step': found.step}),
        }


class CountersStatus:
    """The numbered counters, since the start or the last reset."""

    name = 'counters'

    def __init__(self, line: LineView, port: str) -> None:
        self.hardware_id = port
        self._counters = line.driver.counters
        self._baseline = dict.fromkeys(self._counters.by_mnemonic(), 0)

    def reset(self) -> None:
        """Show every counter from zero again."""
        # The link thread owns the counters, so a reset only changes the baseline.
        self._baseline = self._counters.by_mnemonic()

    def judge(self, now: float) -> Judgement:
        # This runs ten times a second, so it reads only two counters: reading all of them takes 20
        # times as long.
        counters, before = self._counters, self._baseline
        sent = counters.commands_sent - before['CNT_CMD_MSGS_SENT']
        received = counters.replies_received - before['CNT_REPLY_MSGS_RCVD']
        return OK, f'{counted(sent, "command")} sent, {counted(received, "reply")} received'

    def values(self, now: float) -> dict[str, str]:
        counts = self._counters.by_mnemonic()
        return {name: str(count - self._baseline[name]) for name, count in counts.items()}


def _settings(network: Network) -> str:
    return (f'{network.baud} baud, {network.data_bits} data bits, parity {network.parity}, '
            f'{network.stop_bits} stop bits, {network.error_code}')


def changed_text(seen: Seen) -> str:
    """Return a text that names changed files, empty if none has changed."""
    # a spare does not offer ~/reload
    cure = 'restart this bridge' if seen.is_waiting() else 'call ~/reload to read again'
    return f'{", ".join(names)} changed since read; {cure}' if (names := seen.changed_files) \
        else ''


class _LoadMeter:
    """Transactions per second and line load since the last status."""

    def __init__(self) -> None:
        self.transactions = 0.0
        self.load = 0.0
        self._seen = (line_time(), 0, 0)

    def update(self, driver: Driver, now: float) -> None:
        """Measure since the last call, at the clock value ``now`` (s)."""
        before, transactions, characters = self._seen
        total = driver.counters.chars_sent + driver.counters.chars_received
        if now > before:
            self.transactions = (driver.tasks.transactions - transactions) / (now - before)
            on_line = (total - characters) * driver.network.timing.char_time
            self.load = min(100.0, 100 * on_line / (now - before))
            self._seen = now, driver.tasks.transactions, total


def load_by_topic(jobs: Iterable[ReadJob]) -> str:
    """
    Return the share of the line time that the reads of each topic take, largest first.

    Rows that are read together share the time by their number of words.
    """
    loads: defaultdict[str, float] = defaultdict(float)
    for job in jobs:
        if interval := job.intervals.usual:
            load = job.block.line_time / interval
            words = sum(mapping.codec.words for mapping in job.block.mappings)
            for mapping in job.block.mappings:
                loads[mapping.topic] += load * mapping.codec.words / words
    largest = sorted(loads.items(), key=lambda item: (-item[1], item[0]))[:_MOST_TOPICS]
    return ', '.join(f'{topic} {load:.1%}' for topic, load in largest)


def _paces(points: Iterable[ReadPoint]) -> dict[str, str]:
    """Return the wanted and the measured time between reads, for each period of periodic rows."""
    found: defaultdict[float, list[float]] = defaultdict(list)
    for point in points:
        if point.mapping.polls and not point.mapping.is_on_demand:
            found[point.period] += [] if point.interval is None else [point.interval]
    return {f'period {milliseconds(period)}': _pace(period, found[period])
            for period in sorted(found)}


def _pace(period: float, intervals: Sequence[float]) -> str:
    wanted = f'wanted {milliseconds(period)}' if period else 'as often as the line allows'
    if not intervals:
        return f'{wanted}, not yet read twice'
    return f'{wanted}, kept {milliseconds(fmean(intervals))}'


def _unnumbered_counts(driver: Driver) -> dict[str, str]:
    """Return the counts of a radio modem node that have no number, by name."""
    counters = driver.counters
    return {} if driver.network.duplex is not Duplex.RADIO else {
        UNSENT: str(counters.unsent_messages), NO_MEMORY: str(counters.refused_for_memory)}


def _carried(driver: Driver, now: float) -> dict[str, str]:
    """Return the reads of other nodes, if the bridge only listens."""
    if driver.overheard is None:
        return {}
    known = sorted(driver.overheard.carried.values(), key=attrgetter('last'))[-_MOST_CARRIED:]
    return {f'heard of station {read.station}: {read.text}':
            f'{read.count} times, last {age_text(read.last, now)} ago'
            for read in sorted(known, key=attrgetter('station', 'text'))}


def _poll_scans(driver: Driver) -> dict[str, str]:
    """Return the last and longest poll cycle of each poll list, if any."""
    return {
        f'{name} poll scan': f'last {milliseconds(times.last)}, '
                             f'longest {milliseconds(times.longest)}'
        for name, times in driver.link.status().scans.items() if times.last is not None}
