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

"""One row of the map CSV: its cells checked, alone and against each other (S0, "Mapping")."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.messages import Message
from abdf1_ros.numbers import Checked, is_digits, member_of, one_of, ValueKind, whole
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.address_range import AddressRange
from abdf1_ros.pccc.families import FAMILIES, parse_range
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.spellings import family_advice, family_name, processor_name
from abdf1_ros.pccc.structures import bits_fault, order_fault, type_fault, write_fault, wrong_type
from abdf1_ros.pccc.values import types_of, ValueType
from abdf1_ros.problems import Problem
from abdf1_ros.settings.columns import COMMAND, MAP_COLUMNS, NEEDED
from abdf1_ros.settings.conditions import with_conditions
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.hints import hint
from abdf1_ros.settings.mapping import Command, Mapping, ON_DEMAND, READ_ONLY
from abdf1_ros.settings.names import MAX_LENGTH, sanitise
from abdf1_ros.settings.remarks import having, row_remarks
from abdf1_ros.settings.scaling import Scaling
from abdf1_ros.text import counted, shown

_PLC_TYPE_NAMES = tuple(entry.value for entry in FAMILIES)
_PROCESSOR = member_of(Processor)

_T = TypeVar('_T')


@dataclass(frozen=True, slots=True)
class CellFault:
    """
    The fault of a cell, in parts, because a row may come from a file or a command line.

    ``text`` is the whole fault. If ``value`` is given, ``text`` has only the words after it, such
    as "should be one of Low, High". With ``is_superfluous`` the cell should be empty. ``args``
    fill the places of the numbered ``message`` after the item number.
    """

    column: str
    text: str
    message: Message | None = None
    args: tuple[object, ...] = ()
    value: str | None = None
    is_superfluous: bool = False

    def words(self) -> str:
        """Return the fault in the words of a map file."""
        text = self.text
        if self.value is not None:
            text = f'{self.column} = "{shown(self.value)}" {text}'
        return f'{text}; leave the cell empty' if self.is_superfluous else text

    def in_file(self, row: Row) -> Problem:
        """Return the fault as a problem of the map file that contains the row."""
        text, where = self.words(), row.where(self.column)
        is_told = self.value is not None and is_digits(self.value)
        if self.message is None or (self.value is not None and not is_told):
            return Problem(where, f'Item: {row.item}, {text}', self.message)
        return Problem(where, '' if is_told else text, self.message, (row.item, *self.args))


class RowReader:
    """Check one row by itself, and collect its faults in ``faults``."""

    def __init__(self, row: Row) -> None:
        self._row = row
        self._given = [column for column in MAP_COLUMNS if row.cells.get(column.name)]
        self.faults: list[CellFault] = []

    def read(self) -> Mapping | None:
        """Return the mapping, or None when the row has faults."""
        for name in NEEDED:
            if not self._row.get(name):
                self._fault(name, f'{name} is missing')
        if self.faults:
            return None
        values = self._values()
        mapping = self._mapping(values)
        if mapping is None:
            return None
        self._check(mapping)
        for column in self._given:
            if fault := column.why_not(mapping.command):
                self._fault(column.name, fault, is_superfluous=True)
        mapping = with_conditions(self._row, values, mapping, self._fault)
        if self.faults:
            return None
        remarks = tuple(row_remarks(self._row, mapping))
        return replace(mapping, remarks=remarks) if remarks else mapping

    def _values(self) -> Checked:
        """Return the values of the cells that are not empty, by column."""
        command = self._value('Command', COMMAND)
        # 255 is a broadcast: all stations take the command, and no station answers.
        last_station = BROADCAST if command is Command.WRITE else MAX_STATION
        station = self._value('Station', whole(0, last_station),
                              Message.ERR_BAD_STATION, MAX_STATION + 1)
        plc_type = self._plc_type()
        access = self._access(plc_type, command) if plc_type else None
        place = self._place(plc_type, access) if plc_type else None
        address = place.first if isinstance(place, AddressRange) else place
        values: Checked = {
            'Tag': self._row.get('Tag'), 'Command': command, 'Station': station,
            'Via': self._via(station), 'PLC_Type': plc_type, 'Access': access,
            'Address': address, 'Processor': self._processor(plc_type, address, command)}
        for column in self._given:
            if column.kind and column.name not in values and (
                    command is None or not column.why_not(command)):
                values[column.name] = self._value(column.name, column.kind)
        if isinstance(place, AddressRange):
            values['Length'] = self._length_of(place, values.get('Type'), values.get('Length'))
        return {column: value for column, value in values.items() if value is not None}

    def _mapping(self, values: Checked) -> Mapping | None:
        """Return the mapping without its conditions, None where a cell has a fault."""
        name = self._name('Tag', self._row.get('Tag'))
        topic = self._name('Topic', self._row.get('Topic')) if self._row.get('Topic') else name
        scaling = self._scaling(values)
        if self.faults:
            return None
        # ``values`` can have more than the given cells: an address range sets the Length.
        period = values.get('Period')
        told = {'type': types_of(values['Address'])[0]} | {
            column.attribute: values[column.name] for column in MAP_COLUMNS
            if column.name in values and column.attribute in Mapping.__slots__}
        return Mapping(**told, item=self._row.item, place=self._row.where(), name=name,
                       topic=topic, access=values['Access'], scaling=scaling,
                       period=None if period == ON_DEMAND else period,
                       is_on_demand=period == ON_DEMAND,
                       is_read_only=self._is_read_only(values['Command']))

    def _fault(self, column: str, text: str, message: Message | None = None,
               *args: object, is_superfluous: bool = False) -> None:
        self.faults.append(CellFault(column, text, message, args, is_superfluous=is_superfluous))

    def _bad_value(self, column: str, text: str, message: Message | None = None,
                   *args: object) -> None:
        value = self._row.get(column)
        self.faults.append(CellFault(column, text + hint(value), message, args, value=value))

    def _name(self, column: str, text: str) -> str:
        name = sanitise(text)
        if not name:
            self._bad_value(column, 'has no letter or digit')
        elif len(name) > MAX_LENGTH:
            self._fault(column, f'{column} has {len(name)} characters, at most {MAX_LENGTH} are '
                                'allowed')
        return name

    def _value(self, column: str, kind: ValueKind[_T], message: Message | None = None,
               *args: object) -> _T | None:
        text = self._row.get(column)
        value = kind.read(text) if text else None
        if text and value is None:
            self._bad_value(column, kind.fault(text), message, shown(text), *args)
        return value

    def _scaling(self, values: Checked) -> Scaling | None:
        if not self._row.get('Scale') and not self._row.get('Offset'):
            return None
        scaling = Scaling(values.get('Scale', 1.0), values.get('Offset', 0.0))
        if scaling.scale == 0:
            self._fault('Scale', f'Scale should not be 0{self._cut_comma("Scale")}')
        return scaling

    def _cut_comma(self, column: str) -> str:
        """Return the advice for "0,1" that the delimiter has cut in two, empty for other cells."""
        number = self._row.columns.get(column, 0)  # none in a row that was not read from a file
        after = next((self._row.get(name) for name, place in self._row.columns.items()
                      if place == number + 1), '')
        text = self._row.get(column)
        return f'; write {text}.{after} instead of {text},{after}, which are two cells' \
            if is_digits(text) and is_digits(after) else ''

    def _via(self, station: int | None) -> int | None:
        """Return the gateway, None for a station that needs none."""
        via = self._value('Via', whole(0, MAX_STATION))
        if via is None or via == station:
            return None
        if station == BROADCAST:
            self._fault('Via', 'what is written to station 255 goes to the stations of this line '
                               'only', is_superfluous=True)
        return via

    def _plc_type(self) -> PlcType | None:
        text = self._row.get('PLC_Type')
        kind = next((entry for entry in FAMILIES if entry.value == family_name(text)), None)
        if kind is None:
            self._fault('PLC_Type', f'{family_advice(text)}{hint(text)}',
                        Message.ERR_BAD_PLC_TYPE, shown(text), *_PLC_TYPE_NAMES)
        return kind

    def _access(self, plc_type: PlcType, command: Command | None) -> Access | None:
        text = self._row.get('Access')
        ways = FAMILIES[plc_type].accesses
        if not text or self._is_read_only(command):
            return ways[0]
        access = one_of({way.value: way for way in ways}).read(text)
        if command is Command.SERVE:
            self._bad_value('Access', f'of a Serve row should be {READ_ONLY}, for words that the '
                                      'other end cannot write, or empty')
        elif access is None:
            right = ', '.join(way.value for way in ways)
            self._bad_value('Access', f'of a {plc_type.value} should be one of {right}')
        return access

    def _is_read_only(self, command: Command | None) -> bool:
        """Tell whether a PLC may only read the words of a Serve row."""
        return command is Command.SERVE and self._row.get('Access').lower() == READ_ONLY.lower()

    def _processor(self, plc_type: PlcType | None, address: Address | None,
                   command: Command | None) -> Processor | None:
        """Return the cell Processor, or the model that PLC_Type names."""
        if plc_type and self._row.get('Processor') and not FAMILIES[plc_type].by_processor:
            self._fault('Processor', 'Processor is for PLCs of type SLC that we read or write',
                        is_superfluous=True)
            return None
        processor = self._value('Processor', _PROCESSOR)
        if plc_type and FAMILIES[plc_type].by_processor and command is not Command.SERVE \
                and not self._row.get('Processor'):
            processor = _PROCESSOR.read(processor_name(self._row.get('PLC_Type')))
        if processor and address and not processor.has_file(address.file, address.file_type):
            self._fault('Address', f'{processor.value} has no file {address.file_type.value}'
                                   f'{address.file}; {having(address)} may have it')
        return processor

    def _place(self, plc_type: PlcType, access: Access | None) -> Address | AddressRange | None:
        text = self._row.get('Address')
        try:
            return parse_range(text, plc_type, access)
        except AddressSyntaxError as error:
            self._bad_syntax(error)
        except AddressRangeError as error:
            self._fault('Address', str(error), Message.ERR_ADDRESS_RANGE, shown(text),
                        shown(self._row.get('Length')) or 1)
        return None

    def _bad_syntax(self, error: AddressSyntaxError) -> None:
        text = self._row.get('Address')
        self._fault('Address', f'{error}{hint(text)}', Message.ERR_ADDRESS_SYNTAX, shown(text))

    def _length_of(self, place: AddressRange, kind: ValueType | None,
                   given: int | None) -> int | None:
        """Return the Length of a range; report a fault if the cell Length differs."""
        try:
            length = place.length(kind)
        except AddressSyntaxError as error:
            self._bad_syntax(error)
            return None
        if given not in (None, length):
            self._fault('Length', f'{shown(self._row.get("Address"))} has Length {length}, not '
                                  f'{given}')
        return length

    def _check(self, mapping: Mapping) -> None:
        """Check cells that depend on other columns."""
        self._check_type(mapping)
        if self.faults:
            return
        self._check_values(mapping)
        self._check_extent(mapping)
        if mapping.writes and not self.faults:
            self._check_write(mapping)
        self._check_bits(mapping)
        for column in ('Min', 'Max'):
            if mapping.type is ValueType.STRING and self._row.get(column):
                self._fault(column, f'a string has no {column}', is_superfluous=True)
        if mapping.minimum > mapping.maximum:
            self._fault('Min', 'Min is greater than Max')

    def _check_type(self, mapping: Mapping) -> None:
        if fault := wrong_type(mapping.address, mapping.type):
            self._fault('Type', fault)
        if mapping.address.file_type is FileType.STRING and mapping.length != 1:
            self._fault('Length', (
                'a string mapping has Length 1: give each string its own address'))

    def _check_bits(self, mapping: Mapping) -> None:
        names = [name for name in mapping.bits if name]
        if mapping.bits and mapping.type is not ValueType.BOOL:
            self._fault('Bits', f'Bits names the bits of a bool row, not those of '
                                f'{mapping.type.value} values', is_superfluous=True)
        elif len(mapping.bits) not in (0, mapping.length):
            self._fault('Bits', f'Bits has {counted(len(mapping.bits), "name")}, Length is '
                                f'{mapping.length}: write | between the names, and nothing '
                                'between two | for a bit without a name')
        elif twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
            self._fault('Bits', f'Bits has the name "{shown(twice[0])}" twice')

    def _check_values(self, mapping: Mapping) -> None:
        """Check the conversion of raw values to values of the topic."""
        if order := order_fault(mapping.address, mapping.type, mapping.word_order):
            self._fault('Word_Order', f'Word_Order {order}')
        fault = mapping.scaling and mapping.scaling.fault(mapping.type)
        if fault:
            self._fault('Scale' if self._row.get('Scale') else 'Offset', fault)

    def _check_extent(self, mapping: Mapping) -> None:
        address, words = mapping.address, mapping.codec.words
        column = 'Length' if self._row.get('Length') else 'Address'
        details = (self._row.get('Address'), mapping.length)
        if fault := bits_fault(address, mapping.type, mapping.length):
            self._fault(column, fault, Message.ERR_ADDRESS_RANGE, *details)
        elif address.offset + words > address.area_size:
            size = '' if mapping.codec.element_words <= address.layout.words else (
                f'{mapping.length} {mapping.type.value} from {address} on take {words} words; ')
            self._fault(column, f'{size}the last word there can be is {address.last_of_area}',
                        Message.ERR_ADDRESS_RANGE, *details)
        elif fault := type_fault(address, mapping.type, mapping.length):
            self._fault(column, fault)

    def _check_write(self, mapping: Mapping) -> None:
        address = mapping.address
        if mapping.type.is_part and not mapping.dialect.writes_bits:
            self._fault('Address', f'Access {self._row.get("Access")} has no command that '
                                   'changes single bits; write the whole word, or only read')
        # Structures of our own table may be written: there the ROS program is the processor.
        fault = None if mapping.serves else write_fault(address, mapping.type, mapping.length)
        if fault:
            self._fault('Address', fault)
