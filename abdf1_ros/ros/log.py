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
What the node writes to the ROS log: every line visible as it is, and never a flood of them.

Numbered events are logged once a cause, their repetitions counted; while a cause lasts, or a
station comes and goes with it, there is a line now and then. Of all else there are a few
lines a minute about one thing, so that neither a PLC nor whoever publishes to the node can fill
the disk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.text import printable
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.impl.rcutils_logger import RcutilsLogger

# A cause that has been quiet for so long (s) is news again.
_QUIET = 60.0

# A cause that lasts is logged again after so long (s): who looks at today's log has to see it.
_REMINDER = 600.0

# Causes remembered at a time, which is some for each of 254 stations. Only messages with forged
# senders make more; those are not logged while all of these are recent.
MOST_CAUSES = 1000

# Lines about one thing in a minute.
MOST_LINES = 10
_MINUTE = 60.0

# What every transaction brings, and what goes with an event that is logged itself.
_ROUTINE = (
    Message.NTC_REPLY_MSG_RCVD, Message.NTC_NAK_RETRY, Message.NTC_ENQ_RETRY,
    Message.NTC_ACK_EXPECTED, Message.NTC_EOT_STX_EXPECTED)


@dataclass(slots=True)
class _Subject:
    """What lines are about: when (s) the latest of them were written, and how many were not."""

    written: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_LINES))
    left_out: int = 0

    def has_enough(self, now: float) -> bool:
        """Tell whether this minute has had all the lines it may have."""
        return len(self.written) == MOST_LINES and now - self.written[0] < _MINUTE


@dataclass(slots=True)
class _LoggedCause(_Subject):
    last: float = 0.0
    is_news: bool = True

    def is_due(self, now: float) -> bool:
        """Tell whether its next event is to be logged."""
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
        self._write(event.message.severity, str(event) + again)

    def _has_room(self, now: float) -> bool:
        """Tell whether one more cause can be remembered; quiet ones make room."""
        if len(self._causes) >= MOST_CAUSES:
            self._causes = {key: cause for key, cause in self._causes.items()
                            if now - cause.last < _QUIET}
        return len(self._causes) < MOST_CAUSES

    def _write(self, severity: Severity, text: str) -> None:
        # rclpy raises ValueError when one place in the code logs at two levels.
        if severity is Severity.CRITICAL:
            self._logger.fatal(text)
        elif severity is Severity.ERROR:
            self._logger.error(text)
        else:
            self._logger.info(text)

    def forget_all(self) -> None:
        """Log everything anew: the files have been read again."""
        for cause in self._causes.values():
            cause.is_news = True

    def forget(self, station: int) -> None:
        """Log the next events of a station anew: its state has changed."""
        for (_, number), cause in self._causes.items():
            if number == station:
                cause.is_news = True


class LineLog:
    """
    Write lines to ``logger``, at most ``MOST_LINES`` a minute about one thing.

    ``about`` names the thing; there have to be no more names than the configuration has.
    ``clock`` gives seconds.
    """

    def __init__(self, logger: RcutilsLogger, clock: Callable[[], float]) -> None:
        self._logger = logger
        self._clock = clock
        self._subjects: dict[str, _Subject] = {}

    def info(self, about: str, text: str) -> None:
        """Log what is well."""
        if self._may_write(about):
            self._logger.info(self._line(about, text))

    def warning(self, about: str, text: str) -> None:
        """Log what somebody should know."""
        if self._may_write(about):
            self._logger.warning(self._line(about, text))

    def error(self, about: str, text: str) -> None:
        """Log what does not work."""
        if self._may_write(about):
            self._logger.error(self._line(about, text))

    def _may_write(self, about: str) -> bool:
        subject = self._subjects.setdefault(about, _Subject())
        now = self._clock()
        if subject.has_enough(now):
            subject.left_out += 1
            return False
        subject.written.append(now)
        return True

    def _line(self, about: str, text: str) -> str:
        subject = self._subjects[about]
        count, subject.left_out = subject.left_out, 0
        return printable(text) + (f' ({count} more about {printable(about)} were not logged)'
                                  if count else '')
