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

"""The statuses ``link`` and ``counters``."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.ports.link_thread import RELEASED
from abdf1_ros.ros.diagnostics.line import (
    LineView,
    LoadMeter,
    paces,
    poll_scans,
    takes_in_silence,
    unnumbered_counts,
)
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, Seen, WARN, with_age
from abdf1_ros.settings.network import Network
from abdf1_ros.text import counted, milliseconds

# After so many seconds without a poll of the master there is a warning.
_LONGEST_UNPOLLED = 5.0


class LinkStatus:
    """The port, who answers on it, and how busy the line is."""

    name = 'link'

    def __init__(self, line: LineView, port: str, seen: Seen) -> None:
        self.hardware_id = port
        self._line = line
        self._seen = seen
        self._rate = LoadMeter()

    def judge(self, now: float) -> Judgement:
        level, text = self._judge_line(now)
        if clash := self._seen.duplicate_name():
            return max(level, WARN), f'{text}; {clash}'
        return level, text

    def _judge_line(self, now: float) -> Judgement:
        link, driver = self._line.link, self._line.driver
        if link and link.is_released:
            return WARN, RELEASED
        if link is None or not link.state.is_open:
            return ERROR, link.state.text if link else 'not started yet'
        polled = driver.link.status().last_poll
        if polled is not None and now - polled > _LONGEST_UNPOLLED:
            return WARN, f'port open, but not polled for {now - polled:.0f} s'
        if fault := self._line.fault(now):
            return ERROR, fault
        return self._judge_stations(now)

    def _judge_stations(self, now: float) -> Judgement:
        stations = [*self._line.driver.stations]
        total, active = len(stations), sum(station.active for station in stations)
        if deaf := len(self._line.deaf_stations(now)):
            return WARN, f'port open, but {deaf} of {total} stations answer polls and no command'
        if total and not active:
            return ERROR, f'port open, but none of {total} stations answers'
        silent = sum(map(takes_in_silence, stations))
        if silent and silent == active:
            return ERROR, f'port open, but none of {total} stations replies to commands'
        if active < total:
            return WARN, f'port open, {total - active} of {total} stations do not answer'
        if silent:
            return WARN, f'port open, {silent} of {total} stations take commands and do not reply'
        heard = sum(station.last_heard is not None for station in stations)
        return OK, f'port open, {heard} of {total} stations have answered'

    def values(self, now: float) -> dict[str, str]:
        driver, opener = self._line.driver, self._line.opener
        self._rate.update(driver, now)
        return {
            'port': 'open' if self._line.is_open else 'closed',
            'settings': _settings(driver.network),
            'transactions per second': f'{self._rate.transactions:.1f}',
            'line load': f'{self._rate.load:.0f} %',
            'poll cycle': milliseconds(driver.readings.reads.poll_cycle),
            'longest poll cycle': milliseconds(driver.readings.reads.longest_poll_cycle),
            'expected poll cycle': milliseconds(driver.readings.expected_poll_cycle),
            **paces(driver.points.values()),
            **poll_scans(driver),
            **unnumbered_counts(driver),
            **{name: str(count) for name, count in (opener.errors() if opener else {}).items()},
            'files': changed_text(self._seen.changed_files) or 'as read',
            'last error': with_age(self._seen.last_error, now),
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
        # The counters themselves belong to the link thread; only their origin moves.
        self._baseline = self._counters.by_mnemonic()

    def judge(self, now: float) -> Judgement:
        # Asked for ten times a second: to look at all counters takes twenty times as long.
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


def changed_text(names: Sequence[str]) -> str:
    """Return a text about files that have changed, empty where none has."""
    return f'{", ".join(names)} changed since read; ~/reload takes it' if names else ''
