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

"""The statuses of the node on /diagnostics, readable with a plain ``ros2 topic echo``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.write import WriteResult
from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.status import status_text
from abdf1_ros.ports.link_thread import LinkThread, RELEASED
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.problems import Problem
from abdf1_ros.ros.diagnostics.interlocks import InterlockStatus
from abdf1_ros.ros.diagnostics.line import (
    LoadMeter,
    paces,
    poll_scans,
    unnumbered_counts,
)
from abdf1_ros.ros.diagnostics.stations import health_values, processor_fault, wrong_type
from abdf1_ros.ros.diagnostics.status import (
    ERROR,
    Judgement,
    milliseconds,
    Moment,
    OK,
    WARN,
    with_age,
    WORDS,
)
from abdf1_ros.ros.diagnostics.writes import WriteLog
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.share.guest_line import GuestLine
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

# After so many seconds without a poll of the master there is a warning.
_LONGEST_UNPOLLED = 5.0

# For so long (s) another node with our number is told after its last packet.
_SAME_NUMBER_TOLD = 60.0

# A station that takes no commands and has not been heard for so long (s) is silent.
_HEARD_LATELY = 10.0

# So many faults of rows that were left out are repeated with every status; check has them all.
_MOST_LEFT_OUT = 20

_FRESHNESS_LEVELS = {
    Freshness.FRESH: OK, Freshness.LATE: WARN, Freshness.WAITING: WARN,
    Freshness.STALE: ERROR, Freshness.FAILED: ERROR, Freshness.WITHHELD: ERROR}


@dataclass(frozen=True, slots=True)
class Section:
    """
    One status: ``judge`` gives level and text and is cheap, ``values`` gives the details.

    Both get the clock value (s).
    """

    name: str
    hardware_id: str
    judge: Callable[[float], Judgement]
    values: Callable[[float], dict[str, str]]


class Diagnostics:
    """
    All statuses of one node, named ``<node>: <section>``.

    ``node_name`` is the full name, or nodes of one name in two namespaces would be one here.
    ``has_duplicate_name`` is to be set when another node has its name. ``left_out`` are the
    faults of the rows that the map was read without.
    ``changed_files`` are the names of files that have changed since they were read.
    """

    def __init__(self, node_name: str, driver: Driver, port: str,
                 left_out: Sequence[Problem] = ()) -> None:
        self.has_duplicate_name = False
        self._left_out = left_out
        self._rows_by_type = _rows_by_type(driver.mappings)
        self._driver = driver
        self._port = port
        self._link: LinkThread | None = None
        self._opener: PortOpener | None = None
        self._last_error: Moment | None = None
        self._last_events: dict[int | None, Moment] = {}
        self._writes = WriteLog()
        self.changed_files: list[str] = []
        self.interlocks = InterlockStatus(driver)
        self._baseline = dict.fromkeys(driver.counters.by_mnemonic(), 0)
        self._rate = LoadMeter()
        self._sections = [
            Section('link', port, self._judge_link, self._link_values),
            Section('counters', port, self._judge_counters, lambda now: self._counters()),
            *(self._station_section(station, port) for station in driver.stations),
            Section('mappings', port, self._judge_mappings, self._mapping_values),
            Section('writes', port, self._writes.judge, self._writes.values),
        ]
        if driver.interlocks:
            self._sections.append(
                Section('interlocks', port, self.interlocks.judge, self.interlocks.values))
        self._node_name = node_name

    def show_guests(self, lines: Sequence[GuestLine]) -> None:
        """Add the status of guests, where there may be any."""
        if lines:
            self._sections.append(Section(
                'guests', self._port, lambda now: _judge_guests(lines),
                lambda now: _guest_values(lines)))

    def attach(self, link: LinkThread, opener: PortOpener) -> None:
        """Set the thread whose port is reported, and what opens it."""
        self._link = link
        self._opener = opener

    def happened(self, event: Event, now: float) -> None:
        """Remember the last numbered error, and the last thing unusual at each station."""
        if event.message is Message.NTC_REPLY_MSG_RCVD:
            return
        # Inactive stations have keys of their own, but the reason is only in the event.
        if event.message is not Message.ERR_INACTIVE_STATION:
            self._last_events[event.station] = event, now
        if event.message.severity is not Severity.NOTICE:
            self._last_error = event, now

    def written(self, result: WriteResult, now: float) -> None:
        """Count a write."""
        self._writes.add(result, now)
        self.interlocks.written(result, now)

    def lost(self, topic: str, count: int, now: float) -> None:
        """Count messages to a write topic that never came."""
        self._writes.lost(topic, count, now)

    def reset_counters(self) -> None:
        """Show every counter from zero again."""
        # The counters themselves belong to the link thread; only their origin moves.
        self._baseline = self._driver.counters.by_mnemonic()

    def levels(self, now: float) -> list[bytes]:
        """Return the level of every status."""
        return [section.judge(now)[0] for section in self._sections]

    def statuses(self, now: float) -> list[DiagnosticStatus]:
        """Return every status."""
        self._rate.update(self._driver, now)
        return [self._status(section, now) for section in self._sections]

    def _status(self, section: Section, now: float) -> DiagnosticStatus:
        level, text = section.judge(now)
        return DiagnosticStatus(
            level=level, name=f'{self._node_name}: {section.name}',
            message=f'{WORDS[level]}: {printable(text)}',
            hardware_id=printable(section.hardware_id),
            values=[KeyValue(key=printable(key), value=printable(value))
                    for key, value in section.values(now).items()])

    def _judge_link(self, now: float) -> Judgement:
        level, text = self._judge_line(now)
        if self.has_duplicate_name:
            return max(level, WARN), f'{text}; another node is called {self._node_name} too'
        return level, text

    def _judge_line(self, now: float) -> Judgement:
        state = self._link.state if self._link else None
        if self._link and self._link.is_released:
            return WARN, RELEASED
        if state is None or not state.is_open:
            return ERROR, state.text if state else 'not started yet'
        polled = self._driver.link.status().last_poll
        if polled is not None and now - polled > _LONGEST_UNPOLLED:
            return WARN, f'port open, but not polled for {now - polled:.0f} s'
        active = sum(station.active for station in self._driver.stations)
        total = sum(1 for _ in self._driver.stations)
        if fault := self.line_fault(now):
            return ERROR, fault
        if deaf := len(self.deaf_stations(now)):
            return WARN, f'port open, but {deaf} of {total} stations answer polls and no command'
        if total and not active:
            return ERROR, f'port open, but none of {total} stations answers'
        if active < total:
            return WARN, f'port open, {total - active} of {total} stations do not answer'
        heard = sum(station.last_heard is not None for station in self._driver.stations)
        return OK, f'port open, {heard} of {total} stations have answered'

    def line_fault(self, now: float) -> str:
        """Return what is wrong with who is on the line, mostly nothing: an echo, or our number."""
        told = self._driver.link.status().same_number
        if told is not None and now - told < _SAME_NUMBER_TOLD:
            return (f'another node on the air has our number, {self._driver.network.station}: its '
                    'replies and ours cannot be told apart; give each node its own Station')
        mode = self._driver.network.mode  # by radio a node that sends on gives our packets back
        nobody_answers = not any(station.active for station in self._driver.stations)
        does_harm = self._driver.machine.echoes and mode != 'Radio' and (
            mode == 'Peer' or nobody_answers)
        return COMES_BACK if does_harm else ''

    def _link_values(self, now: float) -> dict[str, str]:
        state = self._link.state if self._link else None
        opener, network = self._opener, self._driver.network
        values = {
            'port': f'{"open" if state and state.is_open else "closed"}',
            'settings': f'{network.baud} baud, {network.error_code}',
            'transactions per second': f'{self._rate.transactions:.1f}',
            'line load': f'{self._rate.load:.0f} %',
            'poll cycle': milliseconds(self._driver.poll_cycle),
            'longest poll cycle': milliseconds(self._driver.longest_poll_cycle),
            'expected poll cycle': milliseconds(self._driver.expected_poll_cycle),
            **paces(self._driver.points.values()),
            **poll_scans(self._driver),
            **unnumbered_counts(self._driver),
            **{name: str(count) for name, count in (opener.errors() if opener else {}).items()},
            'files': changed_text(self.changed_files) or 'as read',
            'last error': with_age(self._last_error, now),
        }
        return values

    def _counters(self) -> dict[str, str]:
        counts = self._driver.counters.by_mnemonic()
        return {name: str(count - self._baseline[name]) for name, count in counts.items()}

    def _judge_counters(self, now: float) -> Judgement:
        # Asked for ten times a second: to look at all counters takes twenty times as long.
        counters, before = self._driver.counters, self._baseline
        sent = counters.commands_sent - before['CNT_CMD_MSGS_SENT']
        received = counters.replies_received - before['CNT_REPLY_MSGS_RCVD']
        return OK, f'{sent} commands sent, {received} replies received'

    def _station_section(self, station: Station, port: str) -> Section:
        return Section(
            f'station {station.number}', f'{port} station {station.number}',
            lambda now: self._judge_station(station, now),
            lambda now: self._station_values(station, now))

    def wrong_types(self) -> list[str]:
        """Return which PLCs are of another family than the map says."""
        found = (self._wrong_type(station.number) for station in self._driver.stations)
        return [text for text in found if text is not None]

    def _wrong_type(self, station: int) -> str | None:
        identity = self._driver.checks.known(station).identity
        return wrong_type(station, identity, self._rows_by_type[station].values())

    def _judge_station(self, station: Station, now: float) -> Judgement:
        if self._link is None or not self._link.state.is_open:
            return ERROR, f'station {station.number} unknown: the port is not open'
        if self._is_deaf(station, now):
            return WARN, deaf_text(station.number)
        if not station.active:
            since = now - (station.silent_since or now)
            return ERROR, f'station {station.number} inactive since {since:.1f} s'
        if station.local_status:
            return WARN, f'commands do not get to station {station.number}: ' \
                         f'{status_text(station.local_status)}'
        if not station.replies_in_time or station.has_no_replies:
            return WARN, f'station {station.number} takes commands, but does not reply in time'
        if station.last_heard is None:
            return OK, f'station {station.number} not heard yet'
        why = processor_fault(self._driver.checks.known(station.number).identity)
        if why is not None:
            return WARN, f'station {station.number} active, but {why}'
        if (wrong := self._wrong_type(station.number)) is not None:
            return WARN, wrong
        return OK, f'station {station.number} active'

    def deaf_stations(self, now: float) -> list[int]:
        """Return the stations of a master that are heard, but not with replies to commands."""
        return [station.number for station in self._driver.stations if self._is_deaf(station, now)]

    def _is_deaf(self, station: Station, now: float) -> bool:
        return (station.takes_no_commands and station.last_heard is not None
                and now - station.last_heard < _HEARD_LATELY
                and self._driver.network.mode == 'Master')

    def _station_values(self, station: Station, now: float) -> dict[str, str]:
        heard, via = station.last_heard, self._driver.stations.via(station.number)
        return {
            **({} if via == station.number else {'gateway': str(via)}),
            'active': 'yes' if station.active else 'no',
            'last answer': 'none yet' if heard is None else f'{now - heard:.1f} s ago',
            'last TNS': 'none yet' if station.last_tns is None else f'0x{station.last_tns:04X}',
            'replies': str(station.replies),
            'transactions without reply': str(station.failures),
            'error replies': str(station.remote_errors),
            'last event': with_age(self._last_events.get(station.number), now),
            **health_values(self._driver.checks.known(station.number), now),
        }

    def _judge_mappings(self, now: float) -> Judgement:
        level, text = self._judge_reads(now)
        if not self._left_out:
            return level, text
        rows = len({(problem.place.file, problem.place.line) for problem in self._left_out})
        return max(level, WARN), (f'{text}; {rows} {"row" if rows == 1 else "rows"} left out of '
                                  f'the map, the first at {self._left_out[0].place}')

    def _judge_reads(self, now: float) -> Judgement:
        found = self._freshness(now)
        if not found:
            return OK, 'no mapping reads'
        states = [f'{count} {state.value}' for state, count in found.items()]
        return (max(_FRESHNESS_LEVELS[state] for state in found),
                f'of {sum(found.values())} mappings {", ".join(sorted(states))}')

    def _freshness(self, now: float) -> dict[Freshness, int]:
        """Return the number of mappings in each state."""
        # Called ten times a second: counting in a list takes a third of the time of a Counter.
        states = [point.freshness(now) for point in self._driver.points.values()]
        return {state: states.count(state) for state in Freshness if state in states}

    def _mapping_values(self, now: float) -> dict[str, str]:
        points, found = self._driver.points.values(), self._freshness(now)
        values = {'total': str(len(points))}
        values |= {state.name.lower(): str(found.get(state, 0)) for state in Freshness}
        left_out = self._left_out[:_MOST_LEFT_OUT]
        values |= {f'left out {number}': str(problem)
                   for number, problem in enumerate(left_out, 1)}
        if more := len(self._left_out) - len(left_out):
            values['left out, more'] = f'{more} more faults; the log and "check" have them all'
        for point in points:
            tag = point.mapping.tag
            if point.freshness(now) is not Freshness.FRESH:
                values[f'tag {tag}' if tag in values else tag] = _describe(point, now)
        return values


def _judge_guests(lines: Sequence[GuestLine]) -> Judgement:
    guests = [line.guest for line in lines]
    connected = sum(guest.is_connected for guest in guests)
    notes = [f'{count} {what}' for count, what in (
        (sum(guest.refused for guest in guests), 'commands not allowed'),
        (sum(guest.collisions for guest in guests), 'writes to words of ours')) if count]
    text = f'{connected} of {len(guests)} places are open'
    faults = [f'{line.guest.name}: {line.fault}' for line in lines if line.fault]
    if faults:
        return ERROR, '; '.join(faults)
    return (WARN, '; '.join([text, *notes])) if notes else (OK, text)


def _guest_values(lines: Sequence[GuestLine]) -> dict[str, str]:
    return {line.guest.name: (
        f'{line.state}; {line.guest.commands} commands, {line.guest.refused} not '
        f'allowed, {line.guest.unanswered} without reply, {len(line.guest.waiting)} waiting, '
        f'slowest {milliseconds(line.guest.slowest or None)}') for line in lines}


def _rows_by_type(mappings: Iterable[Mapping]) -> dict[int, dict[PlcType, Mapping]]:
    """Return the first row of each PLC type at each station."""
    rows: defaultdict[int, dict[PlcType, Mapping]] = defaultdict(dict)
    for mapping in mappings:
        if not mapping.serves:
            rows[mapping.station].setdefault(mapping.plc_type, mapping)
    return rows


def deaf_text(station: int) -> str:
    """Return what is wrong with a station that is heard, but not with replies to commands."""
    return f'station {station} answers polls, but no command: is Error_Code right?'


def changed_text(names: Sequence[str]) -> str:
    """Return a text about files that have changed, empty where none has."""
    return f'{", ".join(names)} changed since read; ~/reload takes it' if names else ''


def _describe(point: ReadPoint, now: float) -> str:
    age = point.age(now)
    text = f'{point.freshness(now).value}: {point.mapping.address} at station ' \
           f'{point.mapping.station}'
    text += ', never read' if age is None else f', last read {age:.1f} s ago'
    if point.withheld:
        text += f'; {point.withheld}, since {now - point.withheld_since:.1f} s; ' \
                f'times withheld: {point.withholdings}'
    return f'{text}; {point.error}' if point.error else text
