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

"""The status of a station."""

from __future__ import annotations

from abdf1_ros.df1.stations import Station
from abdf1_ros.pccc.status import status_text
from abdf1_ros.ros.diagnostics.line import deaf_text, LineView, takes_in_silence
from abdf1_ros.ros.diagnostics.stations import health_values, processor_fault
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, Seen, WARN, with_age


class StationStatus:
    """Whether a station answers, and what it has reported of itself."""

    def __init__(self, line: LineView, station: Station, port: str, seen: Seen) -> None:
        self.name = f'station {station.number}'
        self.hardware_id = f'{port} {self.name}'
        self._line = line
        self._station = station
        self._seen = seen

    def judge(self, now: float) -> Judgement:
        station, line = self._station, self._line
        if not line.is_open:
            return ERROR, f'station {station.number} unknown: the port is not open'
        if line.is_deaf(station, now):
            return WARN, deaf_text(station.number)
        if not station.active:
            since = now - (station.silent_since or now)
            return ERROR, f'station {station.number} inactive since {since:.1f} s'
        if station.local_status:
            return WARN, f'commands do not get to station {station.number}: ' \
                         f'{status_text(station.local_status)}'
        if takes_in_silence(station):
            return WARN, f'station {station.number} takes commands, but does not reply in time'
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
            'last answer': 'none yet' if heard is None else f'{now - heard:.1f} s ago',
            'last TNS': 'none yet' if station.last_tns is None else f'0x{station.last_tns:04X}',
            'replies': str(station.replies),
            'transactions without reply': str(station.failures),
            'error replies': str(station.remote_errors),
            'last event': with_age(self._seen.last_events.get(station.number), now),
            **health_values(driver.checks.known(station.number), now),
        }
