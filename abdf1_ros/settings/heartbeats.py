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
Heartbeats, fallback values and reads that depend on a running PLC, as a map CSV asks for them.

A heartbeat tells the PLC that the bridge is alive, and that messages on the topics in While still
arrive. A fallback value is written when no message arrives any more. With While, values of a PLC
whose program does not run are not published. None of them is a safety function. The rules have the
numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.pccc.values import ValueType

DEFAULT_PERIOD = 1000
"""Period (ms) of a heartbeat row whose cell Period is empty."""

RUN = 'RUN'
"""The word of the column While for the mode of the processor."""

READS_IN_TIME = 3
"""Number of reads of a counter that its While_Timeout has to allow (rule 14)."""

TIME_BASE = 0.01
"""Time base of the timers in the PLC (s)."""

STABLE = 100
"""Difference between the presets of rung 5 and rung 3, in units of the time base."""

LONGEST_END = 6.0
"""Longest time (s) of an orderly end, until all writes are confirmed (rule 5)."""

LAST_ANSWER = 0.1
"""
Time (s) to wait for each silent station at an orderly end.

It is short, so that there is time to try each station.
"""

HAND_OVER = 2.0
"""
Longest time (s) of an orderly end if the process goes on.

It is short, because a caller of ~/polling or ~/reload waits.
"""

LEAST_REFRESH = 5.0
"""Least time (s) after which a confirmed fallback value is written again (rule 8)."""

LONGEST_LEASE = 2.0
"""Longest liveliness lease (s) of a publisher whose death counts after this lease (rule 28)."""

NODE_LEASE = 20
"""Time (s) after which DDS drops a killed node, and its publishers that offer no such lease."""

_COUNTING = (ValueType.INT16, ValueType.UINT16)


@dataclass(frozen=True, slots=True)
class Fallback:
    """
    Values that are written when no good message has come for ``after`` ms (rules 7 to 12).

    ``values`` are in the unit of the topic, one for each element of the mapping.
    """

    values: tuple[float, ...]
    after: int


@dataclass(frozen=True, slots=True)
class While:
    """
    A condition for values to be published, or for a heartbeat to count.

    ``names`` holds RUN, or the tag of a counter in the PLC's program (rules 13 to 15); for a
    heartbeat it holds write topics (rule 3). ``timeout`` (ms) is the longest time that the counter
    may stay unchanged, or the greatest age that the last message of each topic may have. It is
    None for RUN.
    """

    names: tuple[str, ...]
    timeout: int | None = None

    @property
    def is_run(self) -> bool:
        """Tell whether the condition is the mode of the processor."""
        return self.names == (RUN,)


def counts(kind: ValueType, length: int) -> bool:
    """Tell whether a row can be the counter of a While: it has one integer word (rule 13)."""
    return kind in _COUNTING and length == 1
