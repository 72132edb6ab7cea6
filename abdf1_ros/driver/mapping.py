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

"""The map CSV: which PLC addresses become which topics, one row a mapping (S0, "Mapping")."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math
import re
from typing import TypeVar

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.driver.csv_table import read_rows, Row, whole_number
from abdf1_ros.driver.names import MAX_LENGTH, sanitise
from abdf1_ros.driver.values import Codec, types_of, ValueType
from abdf1_ros.errors import Problem
from abdf1_ros.messages import Message
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.dialects import DIALECTS
from abdf1_ros.pccc.file_types import PlcType

COLUMNS = ('Tag', 'Command', 'Address', 'Station', 'PLC_Type', 'Length', 'Type', 'Topic',
           'Period', 'Publish', 'Min', 'Max')
_NEEDED = COLUMNS[:5]
_MAX_STATION = 254
_MAX_PERIOD = 86_400_000
_PLC_TYPE_NAMES = tuple(entry.value for entry in PlcType)

_Choice = TypeVar('_Choice', bound=Enum)


class Command(Enum):
    """What a mapping does."""

    READ = 'Read'
    WRITE = 'Write'
    READ_WRITE = 'ReadWrite'
    SERVE = 'Serve'


class Publish(Enum):
    """When a read value is published."""

    ALWAYS = 'Always'
    CHANGE = 'Change'


@dataclass(frozen=True, slots=True)
class Mapping:
    """
    One checked row.

    ``item`` counts data rows from 1, ``line`` lines of the file. ``name`` is the tag and
    ``topic`` the topic as ROS takes them. ``period`` is ms between reads, 0 for as often as the
    line allows, None for the node's default. ``minimum`` and ``maximum`` bound what is written.
    """

    item: int
    line: int
    tag: str
    name: str
    command: Command
    address: Address
    station: int
    plc_type: PlcType
    length: int
    type: ValueType
    topic: str
    period: int | None = None
    publish: Publish = Publish.ALWAYS
    minimum: float = -math.inf
    maximum: float = math.inf

    @property
    def serves(self) -> bool:
        """Tell whether the words are ours, for the PLC to read and write."""
        return self.command is Command.SERVE

    @property
    def polls(self) -> bool:
        """Tell whether we read the words from the PLC."""
        return self.command in (Command.READ, Command.READ_WRITE)

    @property
    def reads(self) -> bool:
        """Tell whether values are published."""
        return self.command is not Command.WRITE

    @property
    def writes(self) -> bool:
        """Tell whether values are written."""
        return self.command is not Command.READ

    @property
    def codec(self) -> Codec:
        """Return what turns its words into values and back."""
        return Codec(self.type, self.length, self.address.bit or 0)

    def cell(self, column: str) -> str:
        """Return a column's value as text, defaults filled in."""
        limits = {'Min': self.minimum, 'Max': self.maximum}
        if column in limits:
            return '' if math.isinf(limits[column]) else f'{limits[column]:.15g}'
        value = getattr(self, column.lower())
        return '' if value is None else str(value.value if isinstance(value, Enum) else value)


def load_mappings(path: str) -> tuple[list[Mapping], list[Problem]]:
    """
    Read a map CSV: the good rows, and every fault of the bad ones.

    Raises ConfigurationError when the file as a whole cannot be used.
    """
    mappings: list[Mapping] = []
    problems: list[Problem] = []
    clashes = _Clashes()
    for row in read_rows(path, COLUMNS):
        reader = _RowReader(row)
        mapping = reader.read()
        if mapping is not None:
            reader.problems += clashes.add(mapping, row)
            if not reader.problems:
                mappings.append(mapping)
        problems += reader.problems
    return mappings, problems


class _RowReader:
    """Check one row, collecting every fault of it."""

    def __init__(self, row: Row) -> None:
        self._row = row
        self.problems: list[Problem] = []

    def read(self) -> Mapping | None:
        """Return the mapping, or None when the row has faults."""
        for column in _NEEDED:
            if not self._row.get(column):
                self._fault(column, f'{column} is missing')
        if self.problems:
            return None
        name = self._name('Tag', self._row.get('Tag'))
        topic = self._name('Topic', self._row.get('Topic')) if self._row.get('Topic') else name
        command = self._choice('Command', Command, None)
        # 255 is everybody, who may be written to but cannot answer.
        last_station = BROADCAST if command is Command.WRITE else _MAX_STATION
        station = self._number('Station', 0, last_station, None, Message.ERR_BAD_STATION,
                               _MAX_STATION + 1)
        plc_type = self._plc_type()
        length = self._number('Length', 1, 65535, 1)
        period = self._number('Period', 0, _MAX_PERIOD, None)
        publish = self._choice('Publish', Publish, Publish.ALWAYS)
        minimum = self._limit('Min', -math.inf)
        maximum = self._limit('Max', math.inf)
        value_type = self._choice('Type', ValueType, None) if self._row.get('Type') else None
        address = self._address(plc_type) if plc_type else None
        if (self.problems or not name or not topic or not command or not publish
                or not plc_type or not address or station is None or length is None):
            return None
        mapping = Mapping(
            self._row.item, self._row.line, self._row.get('Tag'), name, command, address,
            station, plc_type, length, value_type or _natural_type(address), topic,
            period, publish, minimum, maximum)
        self._check(mapping)
        return None if self.problems else mapping

    def _fault(self, column: str, text: str, message: Message | None = None,
               *args: object) -> None:
        full = (self._row.item, *args) if message else ()
        head = f'Item: {self._row.item}, ' if message is None else ''
        self.problems.append(
            Problem(self._row.where(column), f'{head}{text}', message, full))

    def _name(self, column: str, text: str) -> str:
        name = sanitise(text)
        if not name:
            self._fault(column, f'{column} = "{text}" has no letter, digit or underscore')
        elif len(name) > MAX_LENGTH:
            self._fault(column, f'{column} has {len(name)} characters, at most {MAX_LENGTH} go')
        return name

    def _choice(self, column: str, kind: type[_Choice],
                default: _Choice | None) -> _Choice | None:
        text = self._row.get(column)
        if not text and default is not None:
            return default
        for entry in kind:
            if entry.value.lower() == text.lower():
                return entry
        right = ', '.join(entry.value for entry in kind)
        self._fault(column, f'{column} = "{text}" should be one of {right}')
        return None

    def _number(self, column: str, low: int, high: int, default: int | None,
                message: Message | None = None, *args: object) -> int | None:
        text = self._row.get(column)
        if not text:
            return default
        value = whole_number(text)
        if value is not None and low <= value <= high:
            return value
        right = f'{column} = "{text}" should be a whole number from {low} to {high}'
        self._fault(column, right, message, text, *args)
        return None

    def _limit(self, column: str, default: float) -> float:
        text = self._row.get(column)
        try:
            value = float(text.replace(',', '.')) if text else default
        except ValueError:
            value = math.nan
        if re.fullmatch(r'[+-]?[0-9]+,[0-9]{3}', text):
            self._fault(column, f'{column} = "{text}" could be two numbers; write '
                                f'{text.replace(",", "")} or {text.replace(",", ".")}')
        elif math.isnan(value) or (text and math.isinf(value)):
            self._fault(column, f'{column} = "{text}" should be a number')
        return value

    def _plc_type(self) -> PlcType | None:
        text = self._row.get('PLC_Type')
        kind = next((entry for entry in PlcType if entry.value == text.upper()), None)
        if kind in DIALECTS:
            return kind
        known = ', '.join(entry.value for entry in DIALECTS)
        self._fault('PLC_Type', f'this version has {known}', Message.ERR_BAD_PLC_TYPE, text,
                    *_PLC_TYPE_NAMES)
        return None

    def _address(self, plc_type: PlcType) -> Address | None:
        text = self._row.get('Address')
        try:
            return Address.parse(text, plc_type)
        except AddressSyntaxError as error:
            self._fault('Address', str(error), Message.ERR_ADDRESS_SYNTAX, text)
        except AddressRangeError as error:
            self._fault('Address', str(error), Message.ERR_ADDRESS_RANGE, text,
                        self._row.get('Length') or 1)
        return None

    def _check(self, mapping: Mapping) -> None:
        """Check what concerns more than one column."""
        self._check_type(mapping)
        if self.problems:
            return
        self._check_extent(mapping)
        if mapping.writes:
            self._check_write(mapping)
        if mapping.minimum > mapping.maximum:
            self._fault('Min', 'Min is greater than Max')

    def _check_type(self, mapping: Mapping) -> None:
        is_bit = mapping.address.bit is not None
        types = (ValueType.BOOL,) if is_bit else types_of(mapping.address.file_type)
        if mapping.type not in types:
            right = ', '.join(entry.value for entry in types)
            hint = '; a bool needs a bit address such as B3:0/5' \
                if mapping.type is ValueType.BOOL else ''
            self._fault('Type', f'{mapping.address} can be {right}{hint}')
        if mapping.type is ValueType.STRING and mapping.length != 1:
            self._fault('Length', 'a string mapping has Length 1')

    def _check_extent(self, mapping: Mapping) -> None:
        address, words = mapping.address, mapping.codec.words
        details = (self._row.get('Address'), mapping.length)
        if address.file_type.is_structure and mapping.type is ValueType.BOOL and words > 1:
            self._fault('Length', 'bits of a structure end with their word',
                        Message.ERR_ADDRESS_RANGE, *details)
        elif address.offset + words > address.area_size:
            last = address.at_offset(address.area_size - 1)
            self._fault('Length', f'the last word there can be is {last}',
                        Message.ERR_ADDRESS_RANGE, *details)

    def _check_write(self, mapping: Mapping) -> None:
        address = mapping.address
        layout = address.file_type.layout
        if not layout.control_words:
            return
        if mapping.type is not ValueType.BOOL:
            words = range(address.word, address.word + mapping.length)
            if any(word % layout.words in layout.control_words for word in words):
                self._fault('Address', f'the control word of {address} belongs to the '
                            'processor; write members such as PRE, or single named bits')
        elif address.word in layout.control_words:
            named = {member.bit for member in layout.members.values()}
            first = address.bit or 0
            if not named.issuperset(range(first, first + mapping.length)):
                self._fault('Address', f'the bits at {address} are internal to the processor')


def _natural_type(address: Address) -> ValueType:
    return ValueType.BOOL if address.bit is not None else types_of(address.file_type)[0]


class _Clashes:
    """Find what cannot stand beside the rows before it; each problem names both rows."""

    def __init__(self) -> None:
        self._names: dict[str, Mapping] = {}
        self._readers: dict[str, Mapping] = {}
        self._writers: dict[str, Mapping] = {}

    def add(self, mapping: Mapping, row: Row) -> list[Problem]:
        """Return the clashes of ``mapping``; without any, it counts for the rows after it."""
        problems: list[Problem] = []

        def clash(column: str, other: Mapping, text: str) -> None:
            problems.append(Problem(
                row.where(column), f'Item: {mapping.item}, {text} of item {other.item} '
                                   f'(line {other.line}, tag "{other.tag}")'))

        if other := self._names.get(mapping.name):
            clash('Tag', other, f'tag "{mapping.tag}" becomes "{mapping.name}", the name')
        if mapping.reads and (other := self._readers.get(mapping.topic)):
            clash('Topic', other, f'read topic "{mapping.topic}" is the topic')
        if mapping.writes and (other := self._writers.get(mapping.topic)) \
                and (other.type, other.length) != (mapping.type, mapping.length):
            clash('Topic', other, f'write topic "{mapping.topic}" needs the Type and Length')
        if not problems:
            self._names[mapping.name] = mapping
            if mapping.reads:
                self._readers[mapping.topic] = mapping
            if mapping.writes:
                self._writers[mapping.topic] = mapping
        return problems
