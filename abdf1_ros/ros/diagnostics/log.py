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
The node's entries in the ROS log: all characters are visible, the number of entries is limited.

A numbered event is logged once for each cause, and its repetitions are counted. While the cause
lasts or returns, it is logged again from time to time. All other entries are limited to a few per
minute about one subject, over all reloads. So no PLC, publisher or caller of a service can fill
the disk.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
import traceback
from typing import NamedTuple

from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.pccc.address import Area
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import counted, first, printable
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.impl.rcutils_logger import RcutilsLogger

# A cause that comes back after this many quiet seconds is logged at once.
_QUIET = 60.0

# A lasting cause is logged again after this many seconds, so that each day's log shows it.
_REMINDER = 600.0

# Most causes remembered: several for each of 254 stations. Only messages with wrong senders can
# cause more. New causes are not logged while all remembered causes are recent.
MOST_CAUSES = 1000

# Most entries about one subject in a minute.
MOST_ENTRIES = 10
_MINUTE = 60.0

# Rows without a value are logged together: ``_PAUSE`` s after the last row was added, or
# ``_LONGEST`` s after the first.
_PAUSE = 1.0
_LONGEST = 10.0

# Most rows that wait for the log; /diagnostics shows all rows.
_MOST_ROWS = 10_000

# Events that every transaction has, and events that accompany another logged event.
_ROUTINE = (
    Message.NTC_REPLY_MSG_RCVD, Message.NTC_NAK_RETRY, Message.NTC_ENQ_RETRY,
    Message.NTC_ACK_EXPECTED, Message.NTC_EOT_STX_EXPECTED)


INFO, WARN, ERROR = LoggingSeverity.INFO, LoggingSeverity.WARN, LoggingSeverity.ERROR

_SEVERITIES = {Severity.CRITICAL: LoggingSeverity.FATAL, Severity.ERROR: ERROR,
               Severity.NOTICE: INFO}

# rclpy raises ValueError when one place in the code logs at two levels.
_WRITE: dict[LoggingSeverity, Callable[[RcutilsLogger, str], object]] = {
    INFO: lambda logger, text: logger.info(text),
    WARN: lambda logger, text: logger.warning(text),
    ERROR: lambda logger, text: logger.error(text),
    LoggingSeverity.FATAL: lambda logger, text: logger.fatal(text)}


class News(NamedTuple):
    """Something to be logged: its severity, its subject, and its text."""

    severity: LoggingSeverity
    about: str
    text: str


def where(mapping: Mapping) -> str:
    """Return tag, address and station of a row."""
    return f'{mapping.tag} ({mapping.address} at station {mapping.station})'


def bug_text(error: Exception) -> str:
    """Return the log text of an internal error: a line, and the traceback."""
    lines = ''.join(traceback.format_exception(error)).splitlines()
    return '\n'.join([f'{printable(repr(error))}; please report it', *map(printable, lines)])


@dataclass(slots=True)
class _Subject:
    """A subject: clock values (s) of its latest entries, and the number of entries left out."""

    written: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_ENTRIES))
    left_out: int = 0

    def has_enough(self, now: float) -> bool:
        """Return True if no more entries are allowed in this minute."""
        return len(self.written) == MOST_ENTRIES and now - self.written[0] < _MINUTE


@dataclass(slots=True)
class _LoggedCause(_Subject):
    last: float = 0.0
    is_news: bool = True

    def is_due(self, now: float) -> bool:
        """Return True if an event with this cause is to be logged now."""
        return not self.has_enough(now) and (
            self.is_news or now - self.last >= _QUIET or now - self.written[-1] >= _REMINDER)


class EventLog:
    """Write events to ``logger``; ``clock`` gives seconds."""

    def __init__(self, logger: RcutilsLogger, clock: Callable[[], float]) -> None:
        self._logger = logger
        self._clock = clock
        self._causes: dict[tuple[Message, int | None], _LoggedCause] = {}
        self._debug = logger.is_enabled_for(LoggingSeverity.DEBUG)

    def add(self, event: Event) -> None:
        """Log an event, unless its cause has been logged already."""
        if event.message in _ROUTINE:
            if self._debug:
                self._logger.debug(str(event))
            return
        now = self._clock()
        key = event.message, event.station
        cause = self._causes.get(key)
        if cause is None:
            if not self._has_room(now):
                return
            cause = self._causes[key] = _LoggedCause()
        is_due = cause.is_due(now)
        cause.last = now
        if not is_due:
            cause.left_out += 1
            return
        again = f' ({cause.left_out} more like it were not logged)' if cause.left_out else ''
        cause.left_out, cause.is_news = 0, False
        cause.written.append(now)
        _WRITE[_SEVERITIES[event.message.severity]](self._logger, str(event) + again)

    def _has_room(self, now: float) -> bool:
        """Return True if one more cause can be remembered; forget quiet causes if needed."""
        if len(self._causes) >= MOST_CAUSES:
            self._causes = {key: cause for key, cause in self._causes.items()
                            if now - cause.last < _QUIET}
        return len(self._causes) < MOST_CAUSES

    def forget(self, station: int) -> None:
        """Log the next events of a station again: its state has changed."""
        for (_, number), cause in self._causes.items():
            if number == station:
                cause.is_news = True


class LimitedLog:
    """
    Write entries to ``logger``, at most ``MOST_ENTRIES`` a minute about one subject.

    ``about`` names the subject; use only names of the configuration, whose number is limited.
    ``clock`` gives seconds.
    """

    def __init__(self, logger: RcutilsLogger, clock: Callable[[], float]) -> None:
        self._logger = logger
        self._clock = clock
        self._subjects: dict[str, _Subject] = {}

    def info(self, about: str, text: str) -> None:
        self.tell(News(INFO, about, text))

    def warning(self, about: str, text: str) -> None:
        self.tell(News(WARN, about, text))

    def error(self, about: str, text: str) -> None:
        self.tell(News(ERROR, about, text))

    def tell(self, news: News) -> None:
        subject, now = self._subjects.setdefault(news.about, _Subject()), self._clock()
        if subject.has_enough(now):
            subject.left_out += 1
            return
        subject.written.append(now)
        count, subject.left_out = subject.left_out, 0
        more = f' ({count} more about {printable(news.about)} were not logged)' if count else ''
        _WRITE[news.severity](self._logger, printable(news.text) + more)


class NodeLog:
    """
    The log of a node, which a reload keeps: ``events``, and ``notes`` for all other entries.

    ``clock`` gives seconds.
    """

    def __init__(self, logger: RcutilsLogger, clock: Callable[[], float]) -> None:
        self.events = EventLog(logger, clock)
        self.notes = LimitedLog(logger, clock)
        self._logger = logger
        self._clock = clock
        self._about_files: list[tuple[LoggingSeverity, str]] = []
        self._told = _Subject()

    def tell_files(self, entries: Sequence[tuple[LoggingSeverity, str]]) -> None:
        """Write all that there is to say about both files, in one entry if that is known."""
        entries, now = list(entries), self._clock()
        if entries == self._about_files or self._told.has_enough(now):
            self.notes.info('the files', f'the files were read again: {first_line(entries)}')
            return
        self._about_files = entries
        self._told.written.append(now)
        for severity, text in entries:
            _WRITE[severity](self._logger, printable(text))


def first_line(entries: Sequence[tuple[LoggingSeverity, str]]) -> str:
    """Return the first of several entries, and how many more there are."""
    if not entries:
        return 'nothing to say'
    others = len(entries) - 1
    return entries[0][1] + (f' (and {counted(others, "other line")})' if others else '')


class UnreadableRows:
    """
    Logs why rows have no value: one entry for all rows of a file with the same reason.

    If a PLC lacks a file, it refuses all rows of the file one by one, because we divide a refused
    block and ask again. Only the thread of the link calls ``add``; any thread may call ``tell``.
    """

    def __init__(self, log: LimitedLog) -> None:
        self._log = log
        self._rows: dict[tuple[Mapping, str], None] = {}  # with reasons, oldest first
        self._first = self._last = 0.0

    def add(self, now: float, mapping: Mapping, reason: str) -> None:
        """Record a row without a value at the clock value ``now`` (s)."""
        if len(self._rows) < _MOST_ROWS:
            self._last = now
            self._first = self._first if self._rows else now
            self._rows[mapping, reason] = None

    def look(self, now: float) -> None:
        """Write the entries if no row was added for a while, or the first row has waited long."""
        if self._rows and (now - self._last >= _PAUSE or now - self._first >= _LONGEST):
            self.tell()

    def tell(self) -> None:
        """Write the entries."""
        found = []
        with suppress(KeyError):  # until it is empty; another thread may empty it too
            while True:
                found.append(self._rows.popitem()[0])
        groups: defaultdict[tuple[int, Area, str], list[Mapping]] = defaultdict(list)
        for mapping, reason in reversed(found):
            groups[mapping.station, mapping.address.area, reason].append(mapping)
        for (station, _, reason), rows in groups.items():
            rows.sort(key=lambda row: row.address.offset)
            about, begin = rows[0].tag, rows[0].address
            self._log.error(about, f'{where(rows[0])}: {reason}' if len(rows) == 1 else (
                f'{len(rows)} rows from {begin} to {rows[-1].address} at station {station} '
                f'({first([row.tag for row in rows])}): {reason}'))
