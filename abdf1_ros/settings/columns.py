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

"""The columns of the map CSV: their contents, the attributes that they set, and their rows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
import math
from operator import attrgetter

from abdf1_ros.numbers import (
    decimal_number,
    member_of,
    one_of,
    TEXT,
    two_readings,
    ValueKind,
    whole,
    YES_OR_NO,
)
from abdf1_ros.pccc.spellings import type_name
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.settings.alarms import ALARM
from abdf1_ros.settings.mapping import (
    Command,
    Mapping,
    MESSAGES,
    ON_DEMAND,
    Publish,
    PUBLISHED,
)
from abdf1_ros.text import shown

MAX_PERIOD = 86_400_000  # ms

_TOPICS = (Command.READ, *MESSAGES)
_PLCS = (Command.READ, Command.WRITE, Command.READ_WRITE, Command.HEARTBEAT)


def milliseconds_from(low: int, high: int) -> ValueKind[int]:
    """Return the kind of times in a range."""
    return replace(whole(low, high), right=f'ms from {low} to {high}')


def _number(text: str) -> float | None:
    return None if two_readings(text) else decimal_number(text.replace(',', '.'))


def _clear_number(text: str) -> str:
    """Return what to write instead of a number that can be read in two ways."""
    right = two_readings(text)
    return right and f'could be two numbers; write {shown(right)}'


def _period(text: str) -> int | str | None:
    """Return ms, or ON_DEMAND for a row that is read on demand only."""
    return ON_DEMAND if ' '.join(text.lower().split()) == ON_DEMAND else _TIMES.read(text)


_TIMES = whole(0, MAX_PERIOD, 'ms')
_PERIOD = ValueKind(_period, f'{_TIMES.right}, or "{ON_DEMAND}"', 0, MAX_PERIOD)

_WORDS = ValueKind(lambda text: tuple(text.split()))
BETWEEN_NAMES = ' | '
_NAMES = ValueKind(lambda text: tuple(
    ' '.join(name.split()) for name in text.split(BETWEEN_NAMES.strip())))
_READ_WRITE = {'r/w', 'rw', 'read/write'}
_TYPE = one_of({kind.value: kind for kind in ValueType}, type_name)
_NUMBER = ValueKind(_number, 'a number', why_not=_clear_number)


def _command_name(text: str) -> str:
    name = text.lower()
    return Command.READ_WRITE.value.lower() if name in _READ_WRITE else name


COMMAND = one_of({command.value: command for command in Command}, _command_name)


@dataclass(frozen=True, slots=True)
class Column:
    """
    One column of the map CSV.

    - ``default``: meaning of an empty cell; None if the cell must not be empty.
    - ``attribute``: attribute of a mapping that has the value; by default the name in small
      letters.
    - ``kind``: kind of the value; None if the value depends on other cells, too.
    - ``commands``: commands of the rows that may have the column.
    - ``idle``: commands of the rows in which the column has no effect. A cell there gives a
      remark, not a fault.
    - ``between``: what stands between the parts of a value.
    """

    name: str
    default: str | None
    description: str
    kind: ValueKind[object] | None = None
    attribute: str = ''
    commands: tuple[Command, ...] = tuple(Command)
    idle: tuple[Command, ...] = ()
    between: str = ' '

    def __post_init__(self) -> None:
        """Find the attribute."""
        object.__setattr__(self, 'attribute', self.attribute or self.name.lower())

    def text(self, mapping: Mapping) -> str:
        """Return the value of a mapping as text, defaults filled in."""
        value = _value_of(mapping, self.attribute)
        return self.between.join(map(_text, value)) if isinstance(value, tuple) else _text(value)

    def why_not(self, command: Command) -> str:
        """Return why rows with this command must not have the column; empty if they may."""
        if command in self.commands or command in self.idle:
            return ''
        return f'a {command.value} row has no {self.name}: it is for {_rows(self.commands)} rows'


def _rows(commands: Iterable[Command]) -> str:
    *others, last = (command.value for command in commands)
    return f'{", ".join(others)} and {last}' if others else last


def _value_of(mapping: Mapping, attribute: str) -> object:
    """Return the attribute of a mapping; None if a part of its path is None."""
    part, _, rest = attribute.partition('.')
    value: object = getattr(mapping, part)
    return value if value is None or not rest else attrgetter(rest)(value)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return 'Yes' if value else ''
    if isinstance(value, float):
        return '' if math.isinf(value) else f'{value:.15g}'
    return '' if value is None else str(value.value if isinstance(value, Enum) else value)


MAP_COLUMNS = (
    Column('Tag', None, 'unique name'),
    Column('Command', None,
           'Read, Write, ReadWrite; Serve: words in our own table, for PLCs to read and write; '
           'Heartbeat: a counter that we write into the PLC while its conditions hold',
           kind=COMMAND),
    Column('Address', None,
           'PLC address of the first element, or a range such as N7:0-9 or B3:1/0-7'),
    Column('Station', None,
           '0-254; Write: also 255 for all stations, but no station confirms; Serve: our own '
           'Station'),
    Column('PLC_Type', None, 'PLC2, PLC3, PLC5 or SLC; a MicroLogix is SLC; a model such as '
           'MicroLogix 1400 is its Processor, too'),
    Column('Length', '1; the size of a range',
           'number of elements: bits, words, floats; timers, counters, control and strings in N '
           'or A files: number of words',
           kind=whole(1, 65535)),
    Column('Type', 'natural type of the file',
           'bool, int16, uint16, int32, uint32, float32, bcd16, bcd12 or string',
           kind=_TYPE),
    Column('Topic', 'Tag', 'name below ~/read/ and ~/write/',
           commands=_TOPICS),
    Column('Period', 'parameter default_period',
           'ms between reads; 0: as often as the line allows; "on demand": only when '
           '~/read_now/<topic> is called; Serve: the PLC should write at least this often; '
           'Heartbeat: ms between counts, 100-60000, default 1000',
           kind=_PERIOD, attribute='period_cell',
           commands=(*PUBLISHED, Command.HEARTBEAT), idle=(Command.WRITE,)),
    Column('Publish', 'Always',
           'Always: publish after every good read. Change: publish only new values, and the first '
           'after an outage',
           kind=member_of(Publish), commands=PUBLISHED, idle=(Command.WRITE,)),
    Column('Min', 'none', 'least value that may be written, in the unit of the topic',
           kind=_NUMBER, attribute='minimum', commands=MESSAGES, idle=(Command.READ,)),
    Column('Max', 'none', 'greatest value that may be written, in the unit of the topic',
           kind=_NUMBER, attribute='maximum', commands=MESSAGES, idle=(Command.READ,)),
    Column('Word_Order', 'Low',
           'Low or High: which word of an int32, uint32 or float32 over 16-bit words comes first',
           kind=member_of(WordOrder)),
    Column('Scale', '1',
           'topic value = raw value x Scale + Offset, as float32; not for bool and string',
           kind=_NUMBER, attribute='scaling.scale', commands=_TOPICS),
    Column('Offset', '0', 'see Scale',
           kind=_NUMBER, attribute='scaling.offset', commands=_TOPICS),
    Column('Access', 'the first in the list',
           'commands that reach the words. PLC5: Typed, WordRange. SLC: Slot, Flat. PLC2: '
           'Unprotected, Protected, CIF. Serve: Read, so that a PLC cannot write',
           attribute='access_cell'),
    Column('Processor', '5/03',
           'SLC: 5/01, 5/02, 5/03, 5/04, 5/05, ML1000, ML1100, ML1200, ML1400 or ML1500; it '
           'limits packets and files; the same in all rows of a station',
           commands=_PLCS),
    Column('Fallback', 'none',
           'Write or Serve: values, separated by spaces, that the bridge writes when no good '
           'message has come for Fallback_After; for bool only 0',
           kind=_WORDS, attribute='fallback.values', commands=(Command.WRITE, Command.SERVE)),
    Column('Fallback_After', 'none', 'ms from the last good message to the Fallback, 200-60000',
           kind=milliseconds_from(200, 60_000),
           attribute='fallback.after', commands=(Command.WRITE, Command.SERVE)),
    Column('While', 'none',
           'Read: RUN, or the tag of a counter in the PLC program; values are published only '
           'while the PLC runs, or the counter changes. Heartbeat: write topics, separated by '
           'spaces, that must have messages',
           kind=TEXT, attribute='condition.names', commands=(Command.READ, Command.HEARTBEAT)),
    Column('While_Timeout', 'none',
           'longest time (ms) without a change of the counter, or without a good message on each '
           'topic; not with RUN', kind=milliseconds_from(100, 3_600_000),
           attribute='condition.timeout', commands=(Command.READ, Command.HEARTBEAT)),
    Column('Confirms', 'none',
           'Read of the single bit "ROS in control": the tag of its Heartbeat row',
           kind=TEXT, commands=(Command.READ,)),
    Column('Via', 'Station',
           'Mode Master: if Station is behind a gateway (KF2, KF3, KE), the station of the '
           'gateway on this line',
           commands=_PLCS),
    Column('Description', 'none',
           'meaning in the plant, as text; the unit in brackets at the end: Tank level [%]',
           kind=TEXT),
    Column('Alarm', 'none',
           'bits: WARN or ERROR is the level on /diagnostics while a bit is 1; "WARN 0" or '
           '"ERROR 0" while a bit is 0',
           kind=ALARM, commands=PUBLISHED),
    Column('Deadband', '0',
           'Publish Change: differences up to this value, in the unit of the topic, do not count '
           'as a change',
           kind=_NUMBER, commands=PUBLISHED),
    Column('Max_Silence', 'none',
           'Publish Change: ms after which an unchanged value is published again, 100-3600000; '
           'the topic then promises a deadline',
           kind=milliseconds_from(100, 3_600_000), commands=PUBLISHED),
    Column('Write_Again', 'each message is written',
           'Write or ReadWrite: ms, 100-3600000; while reads show that the PLC holds the value of '
           'a message, the value is written again only after this time',
           kind=milliseconds_from(100, 3_600_000),
           commands=(Command.WRITE, Command.READ_WRITE)),
    Column('Single_Publisher', 'No',
           'Yes: while the topic of a row with Fallback has more than one publisher, all its '
           'messages are refused, and the Fallback is written',
           kind=YES_OR_NO, commands=(Command.WRITE, Command.SERVE)),
    Column('Bits', 'none',
           'bool: a name for each bit, with | between, as many as Length; nothing between two | '
           'for a bit without a name: doors closed | | drive 3 fault',
           kind=_NAMES, commands=_TOPICS, between=BETWEEN_NAMES),
)

BY_NAME = {column.name: column for column in MAP_COLUMNS}

COLUMNS = tuple(BY_NAME)

RENAMED = {'Publish_While': 'While', 'Heartbeat_Timeout': 'While_Timeout', 'Requires': 'While',
           'Requires_Timeout': 'While_Timeout'}
"""Present names of columns, by their names in earlier versions."""

NEEDED = tuple(column.name for column in MAP_COLUMNS if column.default is None)
