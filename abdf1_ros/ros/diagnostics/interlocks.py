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

"""The status ``interlocks``: which PLCs ROS controls, and why it does not control other PLCs."""

from __future__ import annotations

from enum import IntEnum
from operator import itemgetter

from abdf1_ros.driver.kernel.fallback import FallbackRow, FallbackState
from abdf1_ros.driver.kernel.heartbeat import BeatState, HeartbeatRow
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.plan.bounds import Bound, Times
from abdf1_ros.ros.diagnostics.line import LineView
from abdf1_ros.ros.diagnostics.stations import processor_fault
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, Seen, WARN, with_age
from abdf1_ros.text import age_text, milliseconds


class _InControl(IntEnum):
    """Whether ROS controls a PLC, as far as one heartbeat shows; the worst state comes first."""

    NOT_IN_CONTROL = 0
    UNKNOWN = 1
    COUNTS = 2
    IN_CONTROL = 3


class InterlockStatus:
    """The status of the heartbeats and fallbacks of a driver; judged ten times a second."""

    name = 'interlocks'

    def __init__(self, line: LineView, port: str, seen: Seen) -> None:
        self.hardware_id = port
        self._line = line
        self._watched = seen
        driver = line.driver
        self._beats = driver.kernel.rows.heartbeats
        self._fallbacks = driver.kernel.rows.fallbacks
        self._checks = driver.checks
        self._bounds = [*Times(driver.network, driver.mappings, driver.readings.blocks).bounds()]
        # Rows that confirm a heartbeat, by the tag of the heartbeat. All other rows share the key
        # ''.
        self._bits = {point.mapping.confirms: point for point in driver.points.values()}
        # Clock values (s), by tag: since when a heartbeat counts, or a bit is 1.
        self._since: dict[str, float] = {}

    def judge(self, now: float) -> Judgement:
        """Return WARN if ROS is not in control, ERROR if a heartbeat or topic has two owners."""
        at_rest = [beat.mapping.tag for beat in self._beats if self._why_not(beat, now)]
        unconfirmed = [beat.mapping.tag for beat in self._beats if beat.mapping.tag not in at_rest
                       and self._control(beat, now)[0] <= _InControl.UNKNOWN]
        due = [row.mapping.tag for row in self._fallbacks if row.cause is not None]
        guests = [row.mapping.tag for row in self._fallbacks
                  if row.state is FallbackState.OVERWRITTEN]
        notes = [f'{", ".join(tags)}: {what}' for tags, what in (
            (at_rest, 'heartbeat does not count'),
            (unconfirmed, 'the PLC does not confirm that ROS is in control'),
            (due, 'fallback value is due'),
            (guests, FallbackState.OVERWRITTEN.value),
            (self._watched.crowded, 'more than one publisher'),
            (self._watched.refused, 'messages are refused: more than one publisher')) if tags]
        counting = len(self._beats) - len(at_rest)
        text = f'{counting} of {len(self._beats)} heartbeats count'
        is_shared = self._watched.refused or any(map(_is_taken, self._beats))
        level = OK if not notes else ERROR if is_shared else WARN
        return level, '; '.join([text, *notes])

    def _why_not(self, beat: HeartbeatRow, now: float) -> str:
        reason = self._line.why_closed or beat.why_not(now)
        if _is_taken(beat):
            reason = self._watched.conflicts.get(beat.mapping.tag, reason)
        self._seen(beat.mapping.tag, not reason, now)
        return reason

    def _seen(self, tag: str, is_good: bool, now: float) -> None:
        if is_good:
            self._since.setdefault(tag, now)
        else:
            self._since.pop(tag, None)

    def _control(self, beat: HeartbeatRow, now: float) -> tuple[_InControl, str]:
        """Return the state of a PLC as one heartbeat shows it; also how long, or why not."""
        if reason := self._why_not(beat, now):
            return _InControl.NOT_IN_CONTROL, f'not in control: {reason}'
        begun, point = self._since[beat.mapping.tag], self._bits.get(beat.mapping.tag)
        if point is None:
            return _InControl.COUNTS, f'heartbeat counts (for {age_text(begun, now)})'
        tag, (control, reason) = point.mapping.tag, self._confirmed(point, begun, now)
        self._seen(tag, control is _InControl.IN_CONTROL, now)
        return control, reason or f'in control for {age_text(max(begun, self._since[tag]), now)}'

    def _confirmed(self, point: ReadPoint, begun: float, now: float) -> tuple[_InControl, str]:
        """Return if a bit confirms a heartbeat that counts since ``begun`` (s); if not, why."""
        tag, freshness = point.mapping.tag, point.freshness(now)
        bit, why = self._watched.latest.get(point.mapping.topic), point.error or point.withheld
        if bit is None or not freshness.is_usable:
            return _InControl.UNKNOWN, f'unknown: {tag} is {freshness.value}' + (
                f': {why}' if why else '')
        if (point.last_good or 0.0) < begun:
            return _InControl.UNKNOWN, \
                f'unknown: {tag} has not been read since the heartbeat counts'
        if not bit[0]:
            return _InControl.NOT_IN_CONTROL, (
                f'not in control: the heartbeat counts, but {tag} is 0: '
                'a person has to press reset (docs/tutorials/heartbeats.md)')
        if fault := processor_fault(self._checks.known(point.mapping.station).identity):
            return _InControl.NOT_IN_CONTROL, f'not in control: {tag} is 1, but the PLC is {fault}'
        return _InControl.IN_CONTROL, ''

    def values(self, now: float) -> dict[str, str]:
        """Return the state of each PLC, of each heartbeat and fallback, and their bounds."""
        stations: dict[int, tuple[_InControl, str]] = {}  # the worst of each station's heartbeats
        for beat in self._beats:
            control, number = self._control(beat, now), beat.mapping.station
            stations[number] = min(stations.get(number, control), control, key=itemgetter(0))
        return {
            **{f'station {number}': text for number, (_, text) in stations.items()},
            **{f'station {number} last fallback': with_age(moment, now)
               for number, moment in [*self._watched.last_fallbacks.items()]},
            **{beat.mapping.tag: self._beat(beat, now) for beat in self._beats},
            **{row.mapping.tag: self._fallback(row) for row in self._fallbacks},
            **{f'bound of {bound.mapping.tag}': _bound(bound) for bound in self._bounds}}

    def _beat(self, beat: HeartbeatRow, now: float) -> str:
        age = '' if beat.confirmed is None else f', {age_text(beat.confirmed, now)} ago'
        reason = self._why_not(beat, now)
        return f'heartbeat {beat.value}{age}; ' \
            + (f'does not count: {reason}' if reason else 'counts')

    def _fallback(self, row: FallbackRow) -> str:
        cause = row.cause  # once: the link's thread may change it meanwhile
        names = row.mapping.single_publisher and self._watched.refused.get(row.mapping.topic)
        why = f'; more than one publisher: {names}' if names else ''
        if cause is None:
            return row.state.value + why
        refusal = f': {row.refusal}' if row.refusal else ''
        return f'{row.state.value} ({cause.value}){refusal}{why}'


def _is_taken(beat: HeartbeatRow) -> bool:
    return beat.state is BeatState.CONFLICT


def _bound(bound: Bound) -> str:
    if bound.presets is not None:
        return 'PLC timer presets {} and {}, time base 0.01 s'.format(*bound.presets)
    if bound.seconds is None:
        return 'none: the master of the line decides'
    usual = f', {milliseconds(bound.usual)} where no frame gets lost' if bound.usual else ''
    return f'written after {milliseconds(bound.seconds)} at most{usual}'
