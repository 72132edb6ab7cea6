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

A heartbeat tells the PLC that the bridge is alive, and that messages of the topics in Requires
still come. A fallback value is written when no message comes any more. Publish_While withholds
values of a PLC whose program does not run. None of them is a safety function. The numbers of rules
are those of docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import difflib
from typing import Protocol

from abdf1_ros.numbers import decimal_number, whole_number
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.text import shown

DEFAULT_PERIOD = 1000
"""Of a heartbeat (ms)."""

RUN = 'RUN'
"""What Publish_While says for the mode of the processor."""

READS_IN_TIME = 3
"""So often a counter has to be read within its Heartbeat_Timeout (rule 14)."""

_PERIODS = (100, 60_000)
_FALLBACK_AFTER = (200, 60_000)
_TIMEOUTS = (100, 3_600_000)

_COUNTING = (ValueType.INT16, ValueType.UINT16)
# The processor reads or writes their words itself.
_NO_COUNTING = (FileType.STATUS, FileType.INPUT, FileType.OUTPUT)


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """
    A word that counts while its conditions hold (rules 1 to 4).

    Each write topic in ``requires`` must have a message not older than ``requires_timeout`` (ms,
    None where there are no such topics).
    """

    requires: tuple[str, ...] = ()
    requires_timeout: int | None = None


@dataclass(frozen=True, slots=True)
class Fallback:
    """
    Values that are written when no good message has come for ``after`` ms (rules 7 to 12).

    ``values`` are in the unit of the topic, as many as the mapping has elements.
    """

    values: tuple[float, ...]
    after: int


@dataclass(frozen=True, slots=True)
class PublishWhile:
    """
    The condition for values to be published (rules 13 to 15).

    ``tag`` is that of a counter in the PLC's program, None for the mode RUN; ``timeout`` (ms) is
    how long the counter may stay unchanged, None for RUN.
    """

    tag: str | None
    timeout: int | None

    @property
    def text(self) -> str:
        """Return what stands in the cell."""
        return self.tag or RUN


class ReportFault(Protocol):
    """Takes the fault of a cell."""

    def __call__(self, column: str, text: str, *, is_superfluous: bool = False) -> None: ...


def number_in(row: Row, column: str, limits: tuple[int, int], fault: ReportFault) -> int | None:
    """Return a whole number of ms; report a fault where it is not within ``limits``."""
    text = row.get(column)
    value = whole_number(text)
    if value is not None and limits[0] <= value <= limits[1]:
        return value
    right = f'ms from {limits[0]} to {limits[1]}'
    fault(column, f'{column} = "{shown(text)}" should be {right}' if text
          else f'{column} is missing: {right}')
    return None


def read_heartbeat(row: Row, fault: ReportFault) -> Heartbeat:
    """Return what a row with Command Heartbeat asks for (rules 1, 3 and 4)."""
    for column in ('Topic', 'Publish', 'Min', 'Max', 'Scale', 'Offset'):
        if row.get(column):
            fault(column, f'a Heartbeat row has no {column}', is_superfluous=True)
    if row.get('Period'):
        number_in(row, 'Period', _PERIODS, fault)
    if row.get('Length') not in ('', '1'):
        fault('Length', 'a heartbeat is one word', is_superfluous=True)
    topics = tuple(row.get('Requires').split())
    if not topics:
        if row.get('Requires_Timeout'):
            fault('Requires_Timeout', 'Requires_Timeout is for a row with Requires',
                  is_superfluous=True)
        return Heartbeat()
    return Heartbeat(topics, number_in(row, 'Requires_Timeout', _TIMEOUTS, fault))


def heartbeat_type_fault(kind: ValueType, has_bit: bool) -> str:
    """Return why values of this type cannot count, empty if they can (rule 1)."""
    if kind in _COUNTING and not has_bit:
        return ''
    return 'a heartbeat is a word of type int16 or uint16, such as N7:0'


def heartbeat_file_fault(address: Address) -> str:
    """Return why no heartbeat may count in this file, empty if one may (rule 1)."""
    kind = address.file_type
    if not kind.is_structure and kind not in _NO_COUNTING:
        return ''
    return f'{address} has a meaning to the processor, and a heartbeat counts through all ' \
        'values; take a word of its own in an N or B file, such as N7:0'


def read_fallback(row: Row, command: str, kind: ValueType, length: int,
                  limits: tuple[float, float], fault: ReportFault) -> Fallback | None:
    """Return the fallback of a row, None where it has none (rule 12)."""
    columns = ('Fallback', 'Fallback_After')
    given = [column for column in columns if row.get(column)]
    if not given:
        return None
    reason = _without_fallback(command, kind)
    if reason:
        fault(given[0], reason, is_superfluous=True)
        return None
    after = number_in(row, 'Fallback_After', _FALLBACK_AFTER, fault)
    values = list(_fallback_values(row, kind, length, limits, fault))
    return None if after is None or len(values) != length else Fallback(tuple(values), after)


def _without_fallback(command: str, kind: ValueType) -> str:
    if command == 'ReadWrite':
        return 'a ReadWrite row has no Fallback; write a Write row and a Read row'
    if command not in ('Write', 'Serve'):
        return f'a {command} row has no Fallback: it is for Write and Serve rows'
    return 'a string has no Fallback' if kind is ValueType.STRING else ''


def _fallback_values(row: Row, kind: ValueType, length: int, limits: tuple[float, float],
                     fault: ReportFault) -> Iterator[float]:
    texts = row.get('Fallback').split()
    if len(texts) != length:
        fault('Fallback', f'Fallback has {len(texts)} values, Length is {length}; separate them '
                          'by spaces' if texts else 'Fallback is missing: the values to write')
        return
    low, high = limits
    for text in texts:
        value = decimal_number(text)
        if value is None or not low <= value <= high:
            fault('Fallback', f'Fallback "{shown(text)}" should be a number from {low:.10g} '
                              f'to {high:.10g}')
        elif kind is ValueType.BOOL and value:
            fault('Fallback', 'a bool falls back to 0: a 1 may be the pulse that starts something')
        else:
            yield value


def read_publish_while(row: Row, command: str, publishes_always: bool,
                       fault: ReportFault) -> PublishWhile | None:
    """Return the condition for a row's values, None for none (rules 13 and 14)."""
    condition, timeout = row.get('Publish_While'), row.get('Heartbeat_Timeout')
    if not condition:
        if timeout:
            fault('Heartbeat_Timeout', 'Heartbeat_Timeout is for a row with Publish_While',
                  is_superfluous=True)
        return None
    if command != 'Read':
        fault('Publish_While', 'Publish_While is for Read rows', is_superfluous=True)
    elif not publishes_always:
        fault('Publish_While', 'Publish_While needs Publish Always: with Change a silent topic '
                               'would look normal')
    if condition.upper() != RUN:
        if timeout:
            return PublishWhile(condition, number_in(row, 'Heartbeat_Timeout', _TIMEOUTS, fault))
        if difflib.get_close_matches(condition.upper(), [RUN]):
            fault('Publish_While', f'"{condition}" is not {RUN}: did you mean {RUN}? The tag of a '
                                   'counter needs a Heartbeat_Timeout')
        else:
            fault('Heartbeat_Timeout', 'Heartbeat_Timeout is missing: ms that the counter '
                  f'"{shown(condition)}" may stand still; for the mode of the processor '
                  f'Publish_While is {RUN}')
        return PublishWhile(condition, None)
    if timeout:
        fault('Heartbeat_Timeout', 'RUN has no Heartbeat_Timeout: the age of the mode is bounded '
                                   'by the stale time', is_superfluous=True)
    return PublishWhile(None, None)


def counts(kind: ValueType, length: int) -> bool:
    """Tell whether Publish_While may name this mapping: one integer word (rule 13)."""
    return kind in _COUNTING and length == 1


def values_text(values: Sequence[float]) -> str:
    """Return values as they stand in a cell."""
    return ' '.join(f'{value:.15g}' for value in values)
