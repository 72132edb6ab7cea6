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

"""The status of each station, with data of its PLC; the service ~/read_link_counters."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.checks import StationHealth
from abdf1_ros.driver.driver import Driver
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.status import status_text
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.line import deaf_text, LineView, takes_in_silence
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, Seen, WARN, with_age
from abdf1_ros.text import age_text
from rclpy.task import Future
from std_srvs.srv import Trigger

# How long (s) the service waits for all stations.
_PATIENCE = 5.0


def processor_fault(identity: Identity | None) -> str | None:
    """Return the fault of a processor that answers but does not run; None if none is known."""
    if identity is None:
        return None
    if identity.faults:
        return f'{", ".join(identity.faults)} ({identity.mode_text})'
    if identity.mode is None or identity.mode.is_running:
        return None
    return f'in {identity.mode.words} mode ({identity.mode_text})'


def health_values(health: StationHealth, now: float) -> dict[str, str]:
    """Return the values that the PLC has reported, at the clock value ``now`` (s)."""
    values = {'processor': health.processor, 'mode': 'unknown', 'faults': 'unknown'}
    identity = health.identity
    if identity is not None and health.told is not None:
        values['mode'] = f'{identity.mode_text or "none"} ({age_text(health.told, now)} ago)'
        values['faults'] = '; '.join((*identity.faults, *identity.remarks)) or 'none'
    if health.no_counters:
        values['link counters'] = health.no_counters
    return values | {f'link counter {name}': value for name, value in health.counters.items()}


class StationStatus:
    """Whether a station answers, and what its PLC has reported."""

    def __init__(self, line: LineView, station: Station, port: str, seen: Seen) -> None:
        self.name = f'station {station.number}'
        self.hardware_id = f'{port} {self.name}'
        self._line = line
        self._station = station
        self._seen = seen

    def judge(self, now: float) -> Judgement:
        station, line = self._station, self._line
        if line.why_closed:
            return ERROR, f'station {station.number} unknown: the port is not open'
        if line.is_garbled(station, now):
            return WARN, line.evidence_of(station)
        if line.is_deaf(station, now):
            return WARN, deaf_text(station.number)
        if not station.active:
            since = age_text(station.silent_since or now, now)
            via = line.driver.stations.via(station.number)
            is_passed_on = via != station.number and line.driver.stations[via].active
            but = f'; its gateway, station {via}, answers' if is_passed_on else ''
            if line.is_refused:
                but = '; it answers DLE NAK to all: is Error_Code right?'
            return ERROR, f'station {station.number} inactive for {since}{but}'
        if station.local_status:
            return WARN, f'commands do not get to station {station.number}: ' \
                         f'{status_text(station.local_status)}'
        if takes_in_silence(station):
            return WARN, line.evidence_of(station) or (
                f'station {station.number} takes commands, but does not reply in time')
        if station.last_heard is None:
            return OK, f'station {station.number} not heard yet'
        why = processor_fault(line.driver.checks.known(station.number).identity)
        if why is not None:
            return WARN, f'station {station.number} active, but {why}'
        if (wrong := line.wrong_type(station.number)) is not None:
            return WARN, wrong
        return OK, f'station {station.number} active'

    def values(self, now: float) -> dict[str, str]:
        station, driver = self._station, self._line.driver
        heard, via = station.last_heard, driver.stations.via(station.number)
        return {
            **({} if via == station.number else {'gateway': str(via)}),
            'active': 'yes' if station.active else 'no',
            'last answer': 'none yet' if heard is None else f'{age_text(heard, now)} ago',
            'last TNS': 'none yet' if station.last_tns is None else f'0x{station.last_tns:04X}',
            'replies': str(station.replies),
            'transactions without reply': str(station.failures),
            'error replies': str(station.remote_errors),
            'last event': with_age(self._seen.last_events.get(station.number), now),
            **health_values(driver.checks.known(station.number), now),
        }


class LinkCounterService:
    """
    The service ~/read_link_counters: asks every active station for the counters of its port.

    ``answer`` is the callback. It has a callback group of its own and does not block the executor.
    It continues when ``check`` finds that all stations have answered, that the port is closed, or
    that five seconds have passed. Any thread may call ``check``. If ``check`` ends the waiting, it
    calls ``wake_executor``.
    """

    def __init__(self, driver: Driver, wake_link: Callable[[], None],
                 wake_executor: Callable[[], None] = lambda: None) -> None:
        self._driver = driver
        self._checks = driver.checks
        self._wake_link = wake_link
        self._wake_executor = wake_executor
        self._asked: list[int] = []
        self._give_up = 0.0
        self._done: Future | None = None

    async def answer(self, request: Trigger.Request,
                     response: Trigger.Response) -> Trigger.Response:
        """Request the counters, wait, and fill in the response."""
        if self._driver.network.line_mode.only_listens:
            response.success, response.message = False, 'Mode Listen: nothing is sent'
            return response
        self._asked = [station.number for station in self._driver.stations if station.active]
        if not self._driver.is_online or not self._asked:
            what = 'no station is active' if self._driver.is_online else 'the port is not open'
            response.success, response.message = False, f'no station to ask: {what}'
            return response
        for station in self._asked:
            self._checks.request_counters(station)
        self._wake_link()
        self._give_up = line_time() + _PATIENCE
        self._done = Future()
        await self._done
        response.success = self._checks.counters_wanted.isdisjoint(self._asked) and all(
            self._checks.known(station).counters for station in self._asked)
        response.message = '; '.join(map(self._text, self._asked))
        return response

    def check(self, now: float) -> None:
        """End the waiting if all stations have answered, the port is closed, or time is over."""
        if now >= self._give_up or not self._driver.is_online \
                or self._checks.counters_wanted.isdisjoint(self._asked):
            self.end()

    def end(self) -> None:
        """End the waiting."""
        if self._done is not None and not self._done.done():
            self._done.set_result(None)
            self._wake_executor()

    def _text(self, station: int) -> str:
        health = self._checks.known(station)
        text = 'no answer yet' if station in self._checks.counters_wanted else (
            health.no_counters or ', '.join(
                f'{name} {value}' for name, value in health.counters.items()) or 'no answer')
        return f'station {station}: {text}'
