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

"""The topic ~/snapshot: all values of a map in one message, with address, age and description."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Mapping as MappingType
import time

from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.write import show
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.ros.diagnostics.status import WORDS
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import age_text, printable, utc_text, value_text
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

# Arrays with more values are shown as one text, cut short.
_MOST_KEYS = 32

_LEVELS = {
    Freshness.FRESH: DiagnosticStatus.OK, Freshness.LATE: DiagnosticStatus.OK,
    Freshness.WAITING: DiagnosticStatus.STALE, Freshness.STALE: DiagnosticStatus.STALE,
    Freshness.FAILED: DiagnosticStatus.ERROR, Freshness.WITHHELD: DiagnosticStatus.ERROR}


class Snapshot:
    """
    One message with the last values of all ``points``, also of those that were not published.

    Texts that never change are made once: a map may have five thousand rows.
    """

    def __init__(self, points: MappingType[Mapping, ReadPoint]) -> None:
        names = {(mapping.station, str(mapping.address)): mapping.tag
                 for mapping in points if mapping.length == 1}
        self._rows = [_ValueRow(mapping, point, names) for mapping, point in points.items()]

    def message(self, now: float) -> DiagnosticArray:
        """Return the values at the clock value ``now`` (s); the caller sets the stamp."""
        begun = time.time() - now
        return DiagnosticArray(status=[row.status(now, begun) for row in self._rows])


class _ValueRow:
    """A row of the snapshot; ``names``: tags of single-value rows by station and address."""

    def __init__(self, mapping: Mapping, point: ReadPoint,
                 names: MappingType[tuple[int, str], str]) -> None:
        self._point = point
        self._tag = printable(mapping.tag)
        self._place = f'station {mapping.station} {mapping.address}'
        self._keys = _keys(mapping, names)
        self._facts = [KeyValue(key=key, value=printable(value)) for key, value in (
            ('address', str(mapping.address)), ('type', mapping.type.value),
            ('topic', mapping.topic), ('description', mapping.description))]

    def status(self, now: float, begun: float) -> DiagnosticStatus:
        """Return the row's status; the clock of ``now`` was 0 at ``begun`` (s since 1970)."""
        point = self._point
        freshness = point.freshness(now)
        level, read, values = _LEVELS[freshness], point.last_good, point.values
        why = point.error or point.withheld if level == DiagnosticStatus.ERROR else ''
        texts = [why] if why else []
        pairs: list[tuple[str, str]] = []
        if values is None or read is None:
            texts = texts or [freshness.value]
        else:
            texts.append(f'{_text(values)}, {age_text(read, now)} ago')
            pairs = [*self._values(values), ('stamp', utc_text(begun + read)),
                     ('age_ms', f'{max(0.0, now - read) * 1000:.0f}')]
        return DiagnosticStatus(
            level=level, name=self._tag, hardware_id=self._place,
            message=f'{WORDS[level]}: {printable("; ".join(texts))}',
            values=[*(KeyValue(key=key, value=value) for key, value in pairs), *self._facts])

    def _values(self, values: Values) -> Iterable[tuple[str, str]]:
        if isinstance(values, str) or len(values) != len(self._keys):
            return [('value', _text(values))]
        return zip(self._keys, map(value_text, values), strict=True)


def _text(values: Values) -> str:
    if isinstance(values, str):
        return printable(values)
    return value_text(values[0]) if len(values) == 1 else show(values)


def _keys(mapping: Mapping, names: MappingType[tuple[int, str], str]) -> Sequence[str]:
    """Return a key for each value; no keys if the row is shown as one text."""
    if mapping.type is ValueType.STRING or mapping.length > _MOST_KEYS and not mapping.bits:
        return ()
    if mapping.length == 1:
        return ('value',)
    return [f'value {printable(names.get(place, name))}' for place, name in zip(
        ((mapping.station, str(mapping.place_of(number))) for number in range(mapping.length)),
        mapping.named_places(), strict=True)]
