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

"""How a map CSV asks for heartbeats, fallback values and guarded reads (docs/heartbeats.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import difflib
from typing import Protocol

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.errors import FormatError
from abdf1_ros.numbers import Checked, decimal_number
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.columns import BY_NAME, milliseconds_from
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.heartbeats import (
    counts,
    DEFAULT_PERIOD,
    Fallback,
    RUN,
    While,
)
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.mapping import Mapping, ON_DEMAND, Publish
from abdf1_ros.text import counted, shown

_PERIODS = milliseconds_from(100, 60_000)

_NO_NUMBERS = (ValueType.BOOL, ValueType.STRING)

# Files whose words the processor itself reads or writes.
_NO_COUNTING = (FileType.STATUS, FileType.INPUT, FileType.OUTPUT)


class ReportFault(Protocol):
    """Report the fault of a cell."""

    def __call__(self, column: str, text: str, *, is_superfluous: bool = False) -> None: ...


_NEEDS_READS = 'Alarm', 'Confirms'


def with_conditions(row: Row, values: Checked, mapping: Mapping, fault: ReportFault) -> Mapping:
    """Return a mapping with its fallback and its condition."""
    if mapping.is_on_demand:
        _check_on_demand(row, mapping, fault)
    if mapping.is_heartbeat:
        _check_heartbeat(row, mapping, fault)
        mapping = replace(mapping, period=mapping.period or DEFAULT_PERIOD)
    if mapping.confirms and (mapping.type, mapping.length) != (ValueType.BOOL, 1):
        fault('Confirms', 'Confirms is for a Read row of one bit (bool, Length 1)')
    for column, value in (('Deadband', mapping.deadband), ('Max_Silence', mapping.max_silence)):
        if value is not None and mapping.publish is not Publish.CHANGE:
            fault(column, f'{column} is for rows with Publish Change')
    if mapping.deadband is not None and (mapping.deadband < 0 or mapping.type in _NO_NUMBERS):
        fault('Deadband', 'Deadband should be a number from 0 on, for values that are numbers')
    if mapping.write_again is not None and mapping.station == BROADCAST:
        fault('Write_Again', 'no station confirms what is written to 255', is_superfluous=True)
    if mapping.alarm is not None and mapping.type is not ValueType.BOOL:
        fault('Alarm', 'Alarm is for bits (bool), such as B3:0/0')
    if mapping.single_publisher and not row.get('Fallback'):
        fault('Single_Publisher', 'Single_Publisher is for rows with Fallback: without one the '
                                  'last value would stand while messages are refused')
    return replace(mapping, fallback=_fallback(values, mapping, fault),
                   condition=_condition(values, mapping, fault))


def _check_on_demand(row: Row, mapping: Mapping, fault: ReportFault) -> None:
    """Report settings that a row must not have if it is read only on demand."""
    if not mapping.polls:
        fault('Period', f'Period "{ON_DEMAND}" is for Read and ReadWrite rows')
    if mapping.publish is not Publish.ALWAYS:
        fault('Publish', f'a row with Period "{ON_DEMAND}" is published each time it is read',
              is_superfluous=True)
    for column in _NEEDS_READS:
        if row.get(column):
            fault(column, f'{column} needs a row that is read again and again, not one with '
                          f'Period "{ON_DEMAND}"')


def _needed(values: Checked, column: str, fault: ReportFault) -> int | None:
    """Return a needed number; report a fault where it is missing."""
    value: int | None = values.get(column)
    if value is None and (kind := BY_NAME[column].kind):
        fault(column, f'{column} is missing: {kind.right}')
    return value


def _check_heartbeat(row: Row, mapping: Mapping, fault: ReportFault) -> None:
    """Check the cells of a row with Command Heartbeat (rules 1 and 4)."""
    if row.get('Period') and _PERIODS.read(row.get('Period')) is None:
        fault('Period', f'Period = "{row.get("Period")}" should be {_PERIODS.right}')
    if mapping.length != 1:
        has_length = bool(row.get('Length'))
        fault('Length' if has_length else 'Address', 'a heartbeat is one word',
              is_superfluous=has_length)
    address = mapping.address
    if not counts(mapping.type, 1):
        fault('Type' if row.get('Type') else 'Address',
              'a heartbeat is a word of type int16 or uint16, such as N7:0')
    elif address.file_type.is_structure or address.file_type in _NO_COUNTING:
        fault('Address', f'{address} has a meaning to the processor, and a heartbeat counts '
                         'through all values; take a word of its own in an N or B file, such as '
                         'N7:0')


def _fallback(cells: Checked, mapping: Mapping, fault: ReportFault) -> Fallback | None:
    """Return the fallback of a row, None where it has none (rule 12)."""
    given = [column for column in ('Fallback', 'Fallback_After') if column in cells]
    if not given:
        return None
    if mapping.type is ValueType.STRING:
        fault(given[0], 'a string has no Fallback', is_superfluous=True)
        return None
    after = _needed(cells, 'Fallback_After', fault)
    values = tuple(_fallback_values(cells.get('Fallback', ()), mapping, fault))
    if after is None or len(values) != mapping.length:
        return None
    if mapping.station == BROADCAST:
        fault('Fallback', 'no station confirms what is written to 255', is_superfluous=True)
    try:
        raw_values(mapping, values)
    except FormatError as error:
        fault('Fallback', f'Fallback cannot be written: {error}')
    return Fallback(values, after)


def _fallback_values(texts: Sequence[str], mapping: Mapping,
                     fault: ReportFault) -> Iterator[float]:
    length = mapping.length
    if len(texts) != length:
        fault('Fallback', f'Fallback has {counted(len(texts), "value")}, Length is {length}; '
                          'separate them by spaces' if texts else
              'Fallback is missing: the values to write')
        return
    low, high = mapping.limits
    low, high = max(low, mapping.minimum), min(high, mapping.maximum)
    for text in texts:
        value = decimal_number(text)
        if mapping.type is ValueType.BOOL and value != 0:
            fault('Fallback', f'Fallback "{shown(text)}" should be 0: a bool falls back to 0, '
                              'because a 1 may be the pulse that starts something')
        elif value is None or not low <= value <= high:
            fault('Fallback', f'Fallback "{shown(text)}" should be a number from {low:.10g} '
                              f'to {high:.10g}')
        else:
            yield value


def _condition(cells: Checked, mapping: Mapping, fault: ReportFault) -> While | None:
    """Return the condition of a row, None for none (rules 3, 13 and 14)."""
    text, timeout = cells.get('While', ''), cells.get('While_Timeout')
    if not text:
        if timeout:
            fault('While_Timeout', 'While_Timeout is for a row with While', is_superfluous=True)
        return None
    if mapping.is_heartbeat:
        names = tuple(text.split())
        if RUN in map(str.upper, names):
            fault('While', 'RUN is the mode of a PLC, and a heartbeat depends on topics whose '
                           'messages we get')
        return While(names, _needed(cells, 'While_Timeout', fault))
    if mapping.publish is not Publish.ALWAYS:
        fault('While', 'While needs Publish Always: with Change a silent topic would look normal')
    if text.upper() == RUN:
        if timeout:
            fault('While_Timeout', 'RUN has no While_Timeout: the age of the mode is bounded by '
                                   'the stale time', is_superfluous=True)
        return While((RUN,))
    if text == mapping.tag:
        fault('While', 'a row cannot depend on itself; name the tag of a counter')
    if not timeout and difflib.get_close_matches(text.upper(), [RUN]):
        fault('While', f'"{text}" is not {RUN}: did you mean {RUN}? The tag of a counter needs a '
                       'While_Timeout')
    elif not timeout:
        fault('While_Timeout', f'While_Timeout is missing: ms that the counter "{shown(text)}" '
                               f'may stand still; for the mode of the processor While is {RUN}')
    return While((text,), timeout)
