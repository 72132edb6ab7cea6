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

"""Show the driver's events: write results on their topic, all other events in log and statuses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.pccc.values import Values
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.log import NodeLog, UnreadableRows, where
from abdf1_ros.ros.diagnostics.status import ERROR, message_of, OK, Seen, WARN
from abdf1_ros.ros.diagnostics.writes import is_usual_fallback, WriteLog
from abdf1_ros.ros.untyped import RosPublisher
from abdf1_ros.settings.mapping import Mapping

_RESULT_LEVELS = {
    Outcome.WRITTEN: OK, Outcome.STANDS: OK, Outcome.BROADCAST: WARN, Outcome.SUPERSEDED: WARN,
    Outcome.FALLBACK: WARN}


_SHOWN_NODES = 4


class LineEvents:
    """
    The listener of a driver: it publishes, logs, and keeps events for the statuses.

    - ``stations``: the stations that the map names
    - ``scans``: True if "plc scan" works on this line
    - ``read``: is called with the values of each good read
    - ``results``: publisher for the results of writes
    - ``answer``: is also called with each result
    - ``table_changed``: is called when a station has become active or inactive
    """

    def __init__(self, log: NodeLog, port: str, stations: Collection[int], *,
                 scans: bool, seen: Seen, read: Callable[[Mapping, Values], None],
                 results: RosPublisher, table_changed: Callable[[], None],
                 answer: Callable[[WriteResult], None] = lambda result: None,
                 clock: Callable[[], float] = line_time) -> None:
        self.read = read
        self._clock = clock
        self.notes = log.notes
        self.unreadable_rows = UnreadableRows(self.notes)
        self.writes = WriteLog(port)
        self._log = log.events
        self._port = port
        self._stations = stations
        self._scans = scans
        self.seen = seen
        self._results, self._answer = results, answer
        self._table_changed = table_changed
        # These stations may still hold a reply to a command of an earlier run.
        self._may_have_left_over = set(stations)
        self._has_told_tools = False

    def port_changed(self) -> None:
        """Expect that stations may answer commands sent before the port was opened."""
        self._may_have_left_over = set(self._stations)

    def lost(self, topic: str, count: int) -> None:
        """Log that DDS has dropped messages to a write topic."""
        self.writes.lost(topic, count, self._clock())
        self.notes.warning(f'lost writes to {topic}', f'~/write/{topic}: {count} messages were '
                           'lost on their way here and have no result: the publisher is too '
                           'fast for this node, or the network was cut')

    def ahead(self, topic: str, seconds: float, nodes: Sequence[str]) -> None:
        """Log that the clock of a publisher among ``nodes`` is ahead of ours."""
        shown = ' or '.join(nodes[:_SHOWN_NODES]) or 'a node that is gone'
        text = f'the clock of {shown} is {seconds:.2f} s ahead of the clock here'
        self.writes.ahead(f'~/write/{topic}: {text}', self._clock())
        self.notes.warning(
            f'clock of {topic}', f'~/write/{topic}: {text}, so old messages look new')

    def written(self, result: WriteResult) -> None:
        """Publish the result of a write; log it if the write failed or was a fallback."""
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
        """Collect for the log why a row has no value although its station answers."""
        self.unreadable_rows.add(self._clock(), mapping, reason)

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Log that a row, and all rows with the same condition, are published again."""
        self.unreadable_rows.tell()  # first, because these entries are older
        self.notes.info(mapping.tag, f'{where(mapping)}: published again after {seconds:.1f} s')

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Log that a heartbeat word holds a value that we have not written (rule 19)."""
        log = self.notes.error if is_conflict else self.notes.warning
        if is_conflict:
            self.seen.conflicts[mapping.tag] = f'{mapping.address}: {text}'
        log(mapping.tag, f'{where(mapping)}: {text}')

    def happened(self, event: Event) -> None:
        """Log a numbered event and remember it for the diagnostics."""
        if self._took_left_over(event):
            self.notes.info(
                f'station {event.station}',
                f'{event}; it may answer a command sent before the port was opened')
            return
        is_inactive = event.message is Message.ERR_INACTIVE_STATION
        if event.message is not Message.NTC_REPLY_MSG_RCVD:
            moment = event, self._clock()
            # Other values of the status say that a station is inactive; its last event says why.
            if not is_inactive:
                self.seen.last_events[event.station] = moment
            if event.message.severity is not Severity.NOTICE:
                self.seen.last_error = moment
        if not (is_inactive and event.station in self._stations):  # station_changed logs this
            self._log.add(event)

    def _took_left_over(self, event: Event) -> bool:
        """Return True if the first message of a station is a reply to an earlier run's command."""
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
            return  # its state changes again and again; DeafStations reports it once
        self._log.forget(station.number)
        about = f'station {station.number}'
        if station.active:
            self.notes.info(about, f'{about} answers again')
        else:
            self.notes.error(about, Message.ERR_INACTIVE_STATION.entry(station.number))
            if station.last_heard is None:
                self._tell_tools(about)

    def _tell_tools(self, about: str) -> None:
        """Name, once, the tools that find out why a station was never heard."""
        if self._has_told_tools:
            return
        self._has_told_tools = True
        scan = ', or "plc scan" to find the stations that answer' if self._scans else ''
        self.notes.info(about, (
            f'{about} has never been heard: stop the node and run "plc detect" to find the '
            f'settings of the line{scan}'))
