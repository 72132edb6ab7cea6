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

"""What the driver tells: results on their topic, the rest in the log and in the statuses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.pccc.values import Values
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.log import EventLog, LimitedLog, UnreadableRows, where
from abdf1_ros.ros.diagnostics.status import ERROR, message_of, OK, Seen, WARN
from abdf1_ros.ros.diagnostics.writes import is_usual_fallback, WriteLog
from abdf1_ros.settings.mapping import Mapping
from rclpy.impl.rcutils_logger import RcutilsLogger

_RESULT_LEVELS = {
    Outcome.WRITTEN: OK, Outcome.STANDS: OK, Outcome.BROADCAST: WARN, Outcome.SUPERSEDED: WARN,
    Outcome.FALLBACK: WARN}


_SHOWN_NODES = 4


class LineEvents:
    """
    The listener of a driver.

    ``read`` gets values, ``results`` publishes what came of writes, ``answer`` gets that too.
    ``table_changed`` is called when a station has come or gone. ``stations`` are those that we
    talk to; ``scans`` where "plc scan" finds others.
    """

    def __init__(self, logger: RcutilsLogger, port: str, stations: Collection[int], *,
                 scans: bool, seen: Seen, read: Callable[[Mapping, Values], None], results: Any,
                 table_changed: Callable[[], None],
                 answer: Callable[[WriteResult], None] = lambda result: None,
                 clock: Callable[[], float] = line_time) -> None:
        self.read = read
        self._clock = clock
        self.notes = LimitedLog(logger, clock)
        self.unreadable_rows = UnreadableRows(self.notes)
        self.writes = WriteLog(port)
        self._log = EventLog(logger, clock)
        self._port = port
        self._stations = stations
        self._scans = scans
        self.seen = seen
        self._results, self._answer = results, answer
        self._table_changed = table_changed
        # A station may have a reply ready for a command from before.
        self._may_have_left_over = set(stations)
        self._has_told_tools = False

    def port_changed(self) -> None:
        """Take note that stations may answer commands from before."""
        self._may_have_left_over = set(self._stations)

    def lost(self, topic: str, count: int) -> None:
        """Tell of messages to a write topic that never came."""
        self.writes.lost(topic, count, self._clock())
        self.notes.warning(f'lost writes to {topic}', f'~/write/{topic}: {count} messages were '
                           'lost on their way here, and have no result: they come faster than '
                           'they can be taken, or the network was cut')

    def ahead(self, topic: str, seconds: float, nodes: Sequence[str]) -> None:
        """Tell of nodes that publish of which the clock of one is ahead of ours."""
        shown = ' or '.join(nodes[:_SHOWN_NODES]) or 'a node that is gone'
        text = f'the clock of {shown} is {seconds:.2f} s ahead of the clock here'
        self.writes.ahead(f'~/write/{topic}: {text}', self._clock())
        self.notes.warning(
            f'clock of {topic}', f'~/write/{topic}: {text}, so old messages look new')

    def written(self, result: WriteResult) -> None:
        """Publish the result of a write."""
        now, mapping = self._clock(), result.mapping
        self.writes.add(result, now)
        if result.outcome is Outcome.FALLBACK:
            self.seen.last_fallbacks[mapping.station] = f'{mapping.tag}: {result.detail}', now
        level = _RESULT_LEVELS.get(result.outcome, ERROR)
        if level == ERROR or result.outcome is Outcome.FALLBACK:
            tell = self.notes.info if is_usual_fallback(result) else self.notes.warning
            tell(f'writes to {mapping.tag}', f'write to {mapping.tag} {result.value}: {result}')
        values = {'address': str(mapping.address), 'station': str(mapping.station),
                  'value': result.value, 'latency_ms': f'{result.latency * 1000:.1f}',
                  'request': result.request}
        self._results.publish(message_of(mapping.tag, level, str(result), self._port, values))
        self._answer(result)

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Have it logged why a read of a station that answers has no value."""
        self.unreadable_rows.add(line_time(), mapping, reason)

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Log that a row is not withheld any more, nor are those that depend on the same."""
        self.unreadable_rows.tell()
        self.notes.info(mapping.tag, f'{where(mapping)}: published again after {seconds:.1f} s')

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Log that a heartbeat is not the one that we have written (rule 19)."""
        log = self.notes.error if is_conflict else self.notes.warning
        if is_conflict:
            self.seen.conflicts[mapping.tag] = f'{mapping.address}: {text}'
        log(mapping.tag, f'{where(mapping)}: {text}')

    def happened(self, event: Event) -> None:
        """Log a numbered event and remember it for the diagnostics."""
        if self._took_left_over(event):
            self.notes.info(
                f'station {event.station}',
                f'{event}; it may answer a command from before the port was opened')
            return
        is_inactive = event.message is Message.ERR_INACTIVE_STATION
        if event.message is not Message.NTC_REPLY_MSG_RCVD:
            moment = event, self._clock()
            if not is_inactive:  # it has values of its own, but the reason is only in the event
                self.seen.last_events[event.station] = moment
            if event.message.severity is not Severity.NOTICE:
                self.seen.last_error = moment
        if not (is_inactive and event.station in self._stations):  # logged by station_changed
            self._log.add(event)

    def _took_left_over(self, event: Event) -> bool:
        """Tell whether a station gives us, first of all, what it had ready for an earlier run."""
        is_wrong = event.message is Message.ERR_WRONG_MESSAGE
        if event.station not in self._may_have_left_over or not (
                is_wrong or event.message is Message.NTC_REPLY_MSG_RCVD):
            return False
        self._may_have_left_over.discard(event.station)
        return is_wrong

    def station_changed(self, station: Station) -> None:
        """Publish the Active Node Table and log the change."""
        self._table_changed()
        if station.takes_no_commands:
            return  # it comes and goes, and that is reported once
        self._log.forget(station.number)
        about = f'station {station.number}'
        if station.active:
            self.notes.info(about, f'{about} answers again')
        else:
            self.notes.error(about, Message.ERR_INACTIVE_STATION.entry(station.number))
            if station.last_heard is None:
                self._tell_tools(about)

    def _tell_tools(self, about: str) -> None:
        """Name, once, what finds out why a station has never been heard."""
        if self._has_told_tools:
            return
        self._has_told_tools = True
        scan = ', "plc scan" which stations answer' if self._scans else ''
        self.notes.info(about, (
            f'{about} has never been heard: with the node stopped, "plc detect" finds the '
            f'settings of the line{scan}'))
