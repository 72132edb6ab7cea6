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

"""The status ``writes``: how the writes of a node ended."""

from __future__ import annotations

from collections import Counter

from abdf1_ros.driver.kernel.fallback import FallbackCause
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.ros.diagnostics.status import Judgement, Moment, OK, WARN, with_age

# Seconds for which a failed write, a lost message or a wrong clock keeps the status at WARN.
_WRITE_MEMORY = 10.0

_FAILURES = Outcome.FAILED, Outcome.NOT_SENT, Outcome.PARTLY


def is_usual_fallback(result: WriteResult) -> bool:
    """Return True for a fallback value written at a start or an end, which is normal."""
    return result.outcome is Outcome.FALLBACK and \
        result.detail in (FallbackCause.START.value, FallbackCause.END.value)


class WriteLog:
    """
    Counts writes by their outcome.

    Only one thread changes each count: the executor's thread counts refusals and lost messages,
    the link thread counts all other results.
    """

    name = 'writes'

    def __init__(self, port: str) -> None:
        self.hardware_id = port
        self._counts: Counter[Outcome] = Counter()
        self._lost = 0
        self._last_loss: Moment | None = None
        self._last_failure: Moment | None = None
        self._last_lead: Moment | None = None

    def add(self, result: WriteResult, now: float) -> None:
        """Count a result."""
        self._counts[result.outcome] += 1
        is_good = result.outcome in (
            Outcome.WRITTEN, Outcome.STANDS, Outcome.BROADCAST, Outcome.SUPERSEDED)
        if not is_good and not is_usual_fallback(result):
            self._last_failure = f'{result.mapping.tag} {result}', now

    def lost(self, topic: str, count: int, now: float) -> None:
        """Count messages that DDS has dropped."""
        self._lost += count
        self._last_loss = f'{count} to ~/write/{topic}', now

    def ahead(self, text: str, now: float) -> None:
        """Record that the clock of a publisher is ahead."""
        self._last_lead = text, now

    def _messages(self) -> int:
        """Return the number of results of messages; fallback values do not count."""
        return self._counts.total() - self._counts[Outcome.FALLBACK]

    def judge(self, now: float) -> Judgement:
        """Return WARN for a while after a failed write, a lost message or a wrong clock."""
        total = self._messages()
        counts = self._counts
        summary = f'{counts[Outcome.WRITTEN] + counts[Outcome.STANDS]} of {total} writes confirmed'
        if self._last_failure and now - self._last_failure[1] < _WRITE_MEMORY:
            return WARN, f'{summary}; {self._last_failure[0]}'
        if self._last_loss and now - self._last_loss[1] < _WRITE_MEMORY:
            return WARN, f'{summary}; {self._lost} messages were lost on their way here'
        if self._last_lead and now - self._last_lead[1] < _WRITE_MEMORY:
            return WARN, f'{summary}; {self._last_lead[0]}'
        return OK, summary

    def values(self, now: float) -> dict[str, str]:
        """Return the counts and the last failure."""
        counts = self._counts
        numbers = {
            'accepted': self._messages() - counts[Outcome.REFUSED],
            'confirmed': counts[Outcome.WRITTEN],
            'not written again': counts[Outcome.STANDS],
            'failed': sum(counts[outcome] for outcome in _FAILURES),
            **{outcome.name.lower(): counts[outcome]
               for outcome in (Outcome.UNKNOWN, Outcome.SUPERSEDED, Outcome.REFUSED)},
            'fallback values': counts[Outcome.FALLBACK], 'lost on their way': self._lost}
        return {**{name: str(number) for name, number in numbers.items()},
                'last loss': with_age(self._last_loss, now),
                'clock ahead': with_age(self._last_lead, now),
                'last failure': with_age(self._last_failure, now)}
