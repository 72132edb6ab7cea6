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

"""Numbered events in the ROS log: each cause once, its repetitions counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from abdf1_ros.messages import Event, Message, Severity
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.impl.rcutils_logger import RcutilsLogger

# A cause that has been quiet for so long (s) is news again.
_QUIET = 60.0

# What every transaction brings, and what goes with an event that is logged itself.
_ROUTINE = (
    Message.NTC_REPLY_MSG_RCVD, Message.NTC_NAK_RETRY, Message.NTC_ENQ_RETRY,
    Message.NTC_ACK_EXPECTED, Message.NTC_EOT_STX_EXPECTED)


@dataclass(slots=True)
class _Cause:
    last: float
    repeats: int = 0


class EventLog:
    """Write events to ``logger``; ``clock`` gives seconds."""

    def __init__(self, logger: RcutilsLogger, clock: Callable[[], float]) -> None:
        self._logger = logger
        self._clock = clock
        self._causes: dict[tuple[Message, int | None], _Cause] = {}
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
        if cause is not None and now - cause.last < _QUIET:
            cause.last = now
            cause.repeats += 1
            return
        again = f' ({cause.repeats} more like it were not logged)' if cause else ''
        self._causes[key] = _Cause(now)
        self._write(event.message.severity, str(event) + again)

    def _write(self, severity: Severity, text: str) -> None:
        # rclpy raises ValueError when one place in the code logs at two levels.
        if severity is Severity.CRITICAL:
            self._logger.fatal(text)
        elif severity is Severity.ERROR:
            self._logger.error(text)
        else:
            self._logger.info(text)

    def forget(self, station: int) -> None:
        """Log the next events of a station anew: its state has changed."""
        for key in [key for key in self._causes if key[1] == station]:
            del self._causes[key]
