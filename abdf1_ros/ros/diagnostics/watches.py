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

"""Watches: they look ten times a second for faults, and return news for the log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from abdf1_ros.messages import Message
from abdf1_ros.ros.diagnostics.line import deaf_text, LineView
from abdf1_ros.ros.diagnostics.link import changed_text
from abdf1_ros.ros.diagnostics.log import ERROR, INFO, News, WARN
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.share.guest_line import GuestPlace
from rclpy.impl.logging_severity import LoggingSeverity


class Watch(Protocol):
    """Something that looks for news again and again."""

    def look(self, now: float) -> Iterable[News]:
        """Return the news at the clock value ``now`` (s)."""


class NewFaults:
    """Reports each fault when ``find`` begins to return its text."""

    def __init__(self, severity: LoggingSeverity, about: str,
                 find: Callable[[float], Sequence[str]]) -> None:
        self._severity = severity
        self._about = about
        self._find = find
        self._told: Sequence[str] = ()

    def look(self, now: float) -> list[News]:
        """Return the faults that were not there at the last look."""
        texts, before = self._find(now), self._told
        self._told = texts
        return [News(self._severity, self._about, text) for text in texts if text not in before]


class DeafStations:
    """Reports once that a station takes no commands, and once what becomes of this station."""

    def __init__(self, line: LineView) -> None:
        self._line = line
        self._told: dict[int, News] = {}

    def look(self, now: float) -> list[News]:
        """Return what has changed since the last look."""
        deaf, news = self._line.deaf_stations(now), []
        for station in self._line.driver.stations:
            number, about = station.number, f'commands to {station.number}'
            if number in deaf:
                found = News(WARN, about, f'{deaf_text(number)} Stop the node and run '
                             '"plc detect" to find out')
            elif station.takes_no_commands and not station.active:
                found = News(ERROR, about, Message.ERR_INACTIVE_STATION.entry(number))
            elif number in self._told and station.active and not station.takes_no_commands:
                found = News(INFO, about, f'station {number} answers commands')
            else:
                continue
            if found != self._told.get(number):
                news.append(found)
            self._told[number] = found
        return news


def watches_of(line: LineView, port: str, seen: Seen, guests: Sequence[GuestPlace],
               changed_files: Callable[[float], Sequence[str]],
               crowded_topics: Callable[[float], Sequence[str]],
               refused_topics: Callable[[float], Mapping[str, str]],
               dds_fault: Callable[[float], str]) -> list[Watch]:
    """Return the watches of a session; they put findings for the statuses into ``seen``."""
    def changed(now: float) -> list[str]:
        seen.changed_files = changed_files(now)
        return [changed_text(seen)] if seen.changed_files else []

    def crowded(now: float) -> list[str]:
        seen.crowded = crowded_topics(now)
        return [f'~/write/{topic} has more than one publisher: its fallback value is not written '
                'while any of them goes on (a forgotten "ros2 topic pub -r"?)'
                for topic in seen.crowded]

    def refused(now: float) -> list[str]:
        seen.refused = refused_topics(now)
        return [f'~/write/{topic} has more than one publisher: {names}. All messages of its rows '
                'with Single_Publisher are refused, and their fallback values are written, until '
                'only one is left' for topic, names in seen.refused.items()]

    def unheard(now: float) -> list[str]:
        seen.dds_fault = dds_fault(now)
        return [seen.dds_fault] if seen.dds_fault else []

    def fault(now: float) -> list[str]:
        text = line.fault(now)
        return [f'{port}: {text}'] if text else []

    return [
        NewFaults(WARN, 'the files', changed),
        NewFaults(WARN, 'publishers', crowded),
        NewFaults(ERROR, 'publishers', refused),
        NewFaults(WARN, 'DDS', unheard),
        NewFaults(ERROR, 'guests', lambda now: [
            f'guest {guest.guest.name}: {guest.fault}' for guest in guests if guest.fault]),
        NewFaults(WARN, 'commands to us', lambda now: [
            f'refused a command of {text}' for text in line.driver.refused.lately(now)]),
        NewFaults(WARN, 'replies', lambda now: line.evidence()),
        NewFaults(WARN, 'types of PLCs', lambda now: line.wrong_types()),
        DeafStations(line),
        NewFaults(ERROR, 'line', fault)]
