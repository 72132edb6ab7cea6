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

"""The status ``interlocks``: which PLC is under control of ROS, and why another is not."""

from __future__ import annotations

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.interlocks.fallback import FallbackRow
from abdf1_ros.driver.interlocks.heartbeat import BeatState, HeartbeatRow
from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.bounds import Bound, Times
from abdf1_ros.ros.diagnostics.status import (
    ERROR,
    Judgement,
    milliseconds,
    Moment,
    OK,
    WARN,
    with_age,
)

# How the states of a station begin; the worst of its heartbeats is told.
_WORST_FIRST = ('not', 'unknown:', 'heartbeat', 'in')


class InterlockStatus:
    """
    What is told of the heartbeats and fallbacks of a driver; asked ten times a second.

    ``crowded`` are topics with a Fallback and more than one publisher; ``conflicts`` say what
    another program has written over a heartbeat, by its tag. ``latest`` are the last values that
    were published, by topic.
    """

    def __init__(self, driver: Driver) -> None:
        self.crowded: tuple[str, ...] = ()
        self._beats = driver.interlocks.heartbeats
        self._fallbacks = driver.interlocks.fallbacks
        self._bounds = [*Times(driver.network, driver.mappings, driver.blocks).bounds()]
        self.conflicts: dict[str, str] = {}  # by tag of the heartbeat
        self.latest: dict[str, Values] = {}
        # By tag of the heartbeat, and all others at ''.
        self._bits = {point.mapping.confirms: point for point in driver.points.values()}
        self._since: dict[str, float] = {}  # by tag of a heartbeat that counts, a bit that is 1
        self._last: dict[int, Moment] = {}  # fallback value by station

    def written(self, result: WriteResult, now: float) -> None:
        """Remember a fallback value that was written."""
        if result.outcome is Outcome.FALLBACK:
            self._last[result.mapping.station] = f'{result.mapping.tag}: {result.detail}', now

    def judge(self, now: float) -> Judgement:
        """Return WARN where ROS is not in control, ERROR where another program writes."""
        at_rest = [beat.mapping.tag for beat in self._beats if self._why_not(beat, now)]
        unconfirmed = [beat.mapping.tag for beat in self._beats if beat.mapping.tag not in at_rest
                       and self._control(beat, now).startswith(_WORST_FIRST[:2])]
        due = [row.mapping.tag for row in self._fallbacks if row.cause is not None]
        notes = [f'{", ".join(tags)}: {what}' for tags, what in (
            (at_rest, 'heartbeat does not count'),
            (unconfirmed, 'the PLC does not confirm that ROS is in control'),
            (due, 'fallback value is due'), (self.crowded, 'more than one publisher')) if tags]
        counting = len(self._beats) - len(at_rest)
        text = f'{counting} of {len(self._beats)} heartbeats count'
        level = OK if not notes else ERROR if any(map(_is_taken, self._beats)) else WARN
        return level, '; '.join([text, *notes])

    def _why_not(self, beat: HeartbeatRow, now: float) -> str:
        reason = beat.why_not(now)
        if _is_taken(beat):
            reason = self.conflicts.get(beat.mapping.tag, reason)
        self._seen(beat.mapping.tag, not reason, now)
        return reason

    def _seen(self, tag: str, is_good: bool, now: float) -> None:
        if is_good:
            self._since.setdefault(tag, now)
        else:
            self._since.pop(tag, None)

    def _control(self, beat: HeartbeatRow, now: float) -> str:
        """Return since when ROS is in control, or why not, as far as one heartbeat tells."""
        if reason := self._why_not(beat, now):
            return f'not in control: {reason}'
        begun, point = self._since[beat.mapping.tag], self._bits.get(beat.mapping.tag)
        if point is None:
            return f'heartbeat counts since {now - begun:.1f} s'
        tag, reason = point.mapping.tag, self._why_not_confirmed(point, begun, now)
        self._seen(tag, not reason, now)
        return reason or f'in control since {now - max(begun, self._since[tag]):.1f} s'

    def _why_not_confirmed(self, point: ReadPoint, begun: float, now: float) -> str:
        """Return what a bit says against a heartbeat that counts since ``begun``, or nothing."""
        tag, freshness = point.mapping.tag, point.freshness(now)
        bit, why = self.latest.get(point.mapping.topic), point.error or point.withheld
        if bit is None or freshness not in (Freshness.FRESH, Freshness.LATE):
            return f'unknown: {tag} is {freshness.value}' + (f': {why}' if why else '')
        if (point.last_good or 0.0) < begun:
            return f'unknown: {tag} has not been read since the heartbeat counts'
        return '' if bit[0] else f'not in control: the heartbeat counts, but {tag} is 0: ' \
            'somebody has to press reset (docs/tutorials/heartbeats.md)'

    def values(self, now: float) -> dict[str, str]:
        """Return the state of each PLC, of each heartbeat and fallback, and their bounds."""
        stations: dict[int, str] = {}
        for beat in self._beats:
            text, number = self._control(beat, now), beat.mapping.station
            stations[number] = min(stations.get(number, text), text,
                                   key=lambda text: _WORST_FIRST.index(text.split()[0]))
        return {
            **{f'station {number}': text for number, text in stations.items()},
            **{f'station {number} last fallback': with_age(moment, now)
               for number, moment in self._last.items()},
            **{beat.mapping.tag: self._beat(beat, now) for beat in self._beats},
            **{row.mapping.tag: _fallback(row) for row in self._fallbacks},
            **{f'bound of {bound.mapping.tag}': _bound(bound) for bound in self._bounds}}

    def _beat(self, beat: HeartbeatRow, now: float) -> str:
        age = '' if beat.confirmed is None else f', {now - beat.confirmed:.1f} s ago'
        reason = self._why_not(beat, now)
        return f'heartbeat {beat.value}{age}; ' \
            + (f'does not count: {reason}' if reason else 'counts')


def _is_taken(beat: HeartbeatRow) -> bool:
    return beat.state is BeatState.CONFLICT


def _fallback(row: FallbackRow) -> str:
    if row.cause is None:
        return row.state.value
    return f'{row.state.value} ({row.cause.value})' + (f': {row.refusal}' if row.refusal else '')


def _bound(bound: Bound) -> str:
    if bound.presets is not None:
        return 'PLC timer presets {} and {}, time base 0.01 s'.format(*bound.presets)
    if bound.seconds is None:
        return 'none: the master of the line decides'
    usual = f', {milliseconds(bound.usual)} where no frame gets lost' if bound.usual else ''
    return f'written after {milliseconds(bound.seconds)} at most{usual}'
