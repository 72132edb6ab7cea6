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

from collections.abc import Iterator
from dataclasses import replace
import difflib
from typing import Protocol

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.errors import FormatError
from abdf1_ros.numbers import decimal_number, Kind, whole
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.heartbeats import (
    counts,
    DEFAULT_PERIOD,
    Fallback,
    Heartbeat,
    PublishWhile,
    RUN,
)
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.mapping import Command, Mapping, Publish
from abdf1_ros.text import counted, shown


def _ms(low: int, high: int) -> Kind[int]:
    return replace(whole(low, high), right=f'ms from {low} to {high}')


_PERIODS = _ms(100, 60_000)
_FALLBACK_AFTER = _ms(200, 60_000)
_TIMEOUTS = _ms(100, 3_600_000)

# The processor reads or writes their words itself.
_NO_COUNTING = (FileType.STATUS, FileType.INPUT, FileType.OUTPUT)


class ReportFault(Protocol):
    """Takes the fault of a cell."""

    def __call__(self, column: str, text: str, *, is_superfluous: bool = False) -> None: ...


def with_conditions(row: Row, mapping: Mapping, fault: ReportFault) -> Mapping:
    """Return a mapping with its heartbeat, fallback and condition for values."""
    heartbeat = None
    if mapping.command is Command.HEARTBEAT:
        heartbeat = _heartbeat(row, mapping, fault)
        mapping = replace(mapping, period=mapping.period or DEFAULT_PERIOD)
    else:
        for column in ('Requires', 'Requires_Timeout'):
            if row.get(column):
                fault(column, f'{column} is for Heartbeat rows', is_superfluous=True)
    fallback = _fallback(row, mapping, fault)
    publish_while = _publish_while(row, mapping, fault)
    if mapping.confirms and (mapping.command, mapping.type, mapping.length) != (
            Command.READ, ValueType.BOOL, 1):
        fault('Confirms', 'Confirms is for a Read row of one bit (bool, Length 1)')
    return replace(mapping, heartbeat=heartbeat, fallback=fallback, publish_while=publish_while)


def _number_in(row: Row, column: str, kind: Kind[int], fault: ReportFault) -> int | None:
    """Return a needed number; report a fault where it is none of this kind."""
    text = row.get(column)
    value = kind.read(text)
    if value is None:
        fault(column, f'{column} = "{shown(text)}" should be {kind.right}' if text
              else f'{column} is missing: {kind.right}')
    return value


def _heartbeat(row: Row, mapping: Mapping, fault: ReportFault) -> Heartbeat:
    """Return what a row with Command Heartbeat asks for (rules 1, 3 and 4)."""
    for column in ('Topic', 'Publish', 'Min', 'Max', 'Scale', 'Offset'):
        if row.get(column):
            fault(column, f'a Heartbeat row has no {column}', is_superfluous=True)
    if row.get('Period'):
        _number_in(row, 'Period', _PERIODS, fault)
    if row.get('Length') not in ('', '1'):
        fault('Length', 'a heartbeat is one word', is_superfluous=True)
    address = mapping.address
    if not counts(mapping.type, 1) or address.bit is not None:
        fault('Type' if row.get('Type') else 'Address',
              'a heartbeat is a word of type int16 or uint16, such as N7:0')
    elif address.file_type.is_structure or address.file_type in _NO_COUNTING:
        fault('Address', f'{address} has a meaning to the processor, and a heartbeat counts '
                         'through all values; take a word of its own in an N or B file, such as '
                         'N7:0')
    topics = tuple(row.get('Requires').split())
    if not topics:
        if row.get('Requires_Timeout'):
            fault('Requires_Timeout', 'Requires_Timeout is for a row with Requires',
                  is_superfluous=True)
        return Heartbeat()
    return Heartbeat(topics, _number_in(row, 'Requires_Timeout', _TIMEOUTS, fault))


def _fallback(row: Row, mapping: Mapping, fault: ReportFault) -> Fallback | None:
    """Return the fallback of a row, None where it has none (rule 12)."""
    given = [column for column in ('Fallback', 'Fallback_After') if row.get(column)]
    if not given:
        return None
    if reason := _without_fallback(mapping.command, mapping.type):
        fault(given[0], reason, is_superfluous=True)
        return None
    after = _number_in(row, 'Fallback_After', _FALLBACK_AFTER, fault)
    values = tuple(_fallback_values(row, mapping, fault))
    if after is None or len(values) != mapping.length:
        return None
    if mapping.station == BROADCAST:
        fault('Fallback', 'no station confirms what is written to 255', is_superfluous=True)
    try:
        raw_values(mapping, values)
    except FormatError as error:
        fault('Fallback', f'Fallback cannot be written: {error}')
    return Fallback(values, after)


def _without_fallback(command: Command, kind: ValueType) -> str:
    if command is Command.READ_WRITE:
        return 'a ReadWrite row has no Fallback; write a Write row and a Read row'
    if command not in (Command.WRITE, Command.SERVE):
        return f'a {command.value} row has no Fallback: it is for Write and Serve rows'
    return 'a string has no Fallback' if kind is ValueType.STRING else ''


def _fallback_values(row: Row, mapping: Mapping, fault: ReportFault) -> Iterator[float]:
    length = mapping.length
    texts = row.get('Fallback').split()
    if len(texts) != length:
        fault('Fallback', f'Fallback has {counted(len(texts), "value")}, Length is {length}; '
                          'separate them by spaces' if texts else
              'Fallback is missing: the values to write')
        return
    low, high = mapping.limits
    low, high = max(low, mapping.minimum), min(high, mapping.maximum)
    for text in texts:
        value = decimal_number(text)
        if value is None or not low <= value <= high:
            fault('Fallback', f'Fallback "{shown(text)}" should be a number from {low:.10g} '
                              f'to {high:.10g}')
        elif mapping.type is ValueType.BOOL and value:
            fault('Fallback', 'a bool falls back to 0: a 1 may be the pulse that starts something')
        else:
            yield value


def _publish_while(row: Row, mapping: Mapping, fault: ReportFault) -> PublishWhile | None:
    """Return the condition for a row's values, None for none (rules 13 and 14)."""
    condition, timeout = row.get('Publish_While'), row.get('Heartbeat_Timeout')
    if not condition:
        if timeout:
            fault('Heartbeat_Timeout', 'Heartbeat_Timeout is for a row with Publish_While',
                  is_superfluous=True)
        return None
    if mapping.command is not Command.READ:
        fault('Publish_While', 'Publish_While is for Read rows', is_superfluous=True)
    elif mapping.publish is not Publish.ALWAYS:
        fault('Publish_While', 'Publish_While needs Publish Always: with Change a silent topic '
                               'would look normal')
    if condition.upper() != RUN:
        if condition == mapping.tag:
            fault('Publish_While', 'a row cannot depend on itself; name the tag of a counter')
        if timeout:
            return PublishWhile(condition, _number_in(row, 'Heartbeat_Timeout', _TIMEOUTS, fault))
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
