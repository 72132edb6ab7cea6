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

"""Reading and writing addresses that are given on the command line."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import replace
from enum import Enum
from functools import partial
import re
import time
from typing import TypeAlias

from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.terminal import EXIT_FAILED, EXIT_UNKNOWN, is_port
from abdf1_ros.driver.write import Outcome, show, Write, WriteResult
from abdf1_ros.driver.writes.packets import carry_out
from abdf1_ros.errors import Abdf1Error, FormatError, LinkError, PortLost, RemoteError
from abdf1_ros.numbers import decimal_number, two_readings, whole_number
from abdf1_ros.open_line import Pending
from abdf1_ros.pccc import steps
from abdf1_ros.pccc.address import Address, BITS
from abdf1_ros.pccc.address_range import AddressRange, is_element
from abdf1_ros.pccc.families import FAMILIES, parse_range
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.status import STS_ILLEGAL_COMMAND
from abdf1_ros.pccc.strings import is_string_element
from abdf1_ros.pccc.structures import named_runs
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.settings.map_row import CellFault, RowReader
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import printable, value_text

# The argument of the command line for each column of a map CSV.
_ARGUMENTS = {'Address': 'ADDRESS', 'Length': '--length', 'Type': '--type',
              'Word_Order': '--word-order', 'Access': '--access', 'Processor': '--processor',
              'Via': '--via'}

_WITH_BASE = re.compile('0(?:x[0-9a-f]+|b[01]+|o[0-7]+)', re.IGNORECASE)
_RACK_AND_GROUP = re.compile(r'[#$]?[IOio]\d?[:;]\d{3}(?!\d)', re.ASCII)  # of a PLC-5
_UNIT = re.compile(r'\[(?P<unit>[^][]{1,12})\]$')
_VALUES_IN_ROW = 10
_BITS_IN_ROW = 16
_BETWEEN = '  '

_UNCERTAIN = (Outcome.UNKNOWN, Outcome.PARTLY)

# Tags of a map, by address.
Tags: TypeAlias = MappingType[str, str]

_UNSIGNED = {ValueType.INT16: ValueType.UINT16, ValueType.INT32: ValueType.UINT32}
_BITS = {ValueType.INT16: 16, ValueType.UINT16: 16, ValueType.INT32: 32, ValueType.UINT32: 32}


class Radix(Enum):
    """The base of whole numbers in the output; the value is the letter in a Python format."""

    DECIMAL = 'd'
    HEXADECIMAL = 'X'
    OCTAL = 'o'
    BINARY = 'b'


def mapping_of(address: str, cells: MappingType[str, str], item: int = 1) -> Mapping:
    """
    Return the mapping of an address; ``cells`` are the other columns of a map CSV.

    Raises ConfigurationError with every fault; each names its argument.
    """
    row = Row('', item, item, {'Tag': f'address_{item}', 'Address': address, **cells}, {})
    reader = RowReader(row)
    mapping = reader.read()
    if mapping is None:
        raise ConfigurationError([_in_arguments(fault, row) for fault in reader.faults])
    return mapping


def mappings_of(address: str, cells: MappingType[str, str], item: int = 1) -> list[Mapping]:
    """
    Return the mappings of an address: several if one read cannot cover it.

    An element of a structure without a word, such as T4:0 or PD10:0-1, stands for all its named
    words. Raises ConfigurationError like ``mapping_of``.
    """
    elements = [] if {'Length', 'Type'} & {*cells} else _elements(address, cells)
    runs = [run for element in elements for run in named_runs(element)]
    if not runs:
        return [mapping_of(address, cells, item)]
    first = elements[0]
    if len(runs) == len(elements) and runs[0][1] == first.layout.words:
        runs = [(first, len(elements) * first.layout.words, 1)]
    wide = ValueType.INT32 if first.file_type.is_function else ValueType.FLOAT32
    return [replace(mapping_of(str(place), {
        **cells, 'Length': str(count), 'Type': (wide if words > 1 else ValueType.INT16).value},
        item), remarks=()) for place, count, words in runs]


def _elements(text: str, cells: MappingType[str, str]) -> list[Address]:
    """Return the whole structure elements that an address names; empty for any other address."""
    plc_type = PlcType(cells.get('PLC_Type', PlcType.SLC.value))
    ways = {way.value.lower(): way for way in FAMILIES[plc_type].accesses}
    try:
        found = parse_range(text, plc_type, ways.get(cells.get('Access', '').lower()))
    except FormatError:
        return []  # ``mapping_of`` reports the fault
    if isinstance(found, AddressRange):
        numbers = range(found.first.element, found.last.element + 1) if found.is_whole else ()
        return [replace(found.first, element=number) for number in numbers]
    return [found] if is_element(found, text) else []


def check_for_some_family(addresses: Sequence[str], cells: MappingType[str, str],
                          texts: Sequence[str] = ()) -> None:
    """
    Check addresses and values before the family of the PLC is known.

    Raises ConfigurationError or FormatError if they fit no family.
    """
    for item, address in enumerate(addresses, 1):
        errors: dict[str, Abdf1Error] = {}
        for family in FAMILIES:
            try:
                for mapping in mappings_of(address, {'PLC_Type': family.value, **cells}, item):
                    parse_values(mapping, texts)
            except (ConfigurationError, FormatError) as error:
                errors[family.value] = error
        if len(errors) == len(FAMILIES):
            meant = PlcType.PLC5 if _RACK_AND_GROUP.match(address) else PlcType.SLC
            raise errors[cells.get('PLC_Type', meant.value)]


def _in_arguments(fault: CellFault, row: Row) -> Problem:
    """Return a fault of a row as a problem of a command line argument."""
    argument, text = _ARGUMENTS.get(fault.column, fault.column), fault.text
    if fault.value is not None:
        text = f'"{fault.value}" {text}'
    if fault.is_superfluous:
        text += f'; leave {argument} out'
    if fault.column == 'Length':
        if fault.message is not None:  # the text of the specification does not name the argument
            text = f'{row.get("Length")} elements do not fit at {row.get("Address")}; {text}'
        elif fault.value is None:
            argument += f' of {row.get("Address")}'
        if row.get('Command') != Command.READ.value:  # a write: Length is the number of values
            argument = 'VALUE'
    elif fault.column == 'Address':
        address = row.get('Address')
        argument, text = f'{argument} "{address}"', text + _meant(address)
    return Problem(argument, text)


def _meant(address: str) -> str:
    """Return what a user may have meant by a bad address."""
    if address.isdigit():
        return f'; a station is given with --station {address}'
    if is_port(address):
        return f'; a port is given with --port {address}'
    if re.fullmatch('COM[0-9]+', address, re.IGNORECASE):
        return '; a port is given with --port, as in --port /dev/ttyUSB0'
    parts = listed_addresses(address)
    return f'; several addresses stand apart: {" ".join(parts)}' if len(parts) > 1 else ''


def listed_addresses(text: str) -> list[str]:
    """Return the addresses of a list with commas or blanks; any other text as it stands."""
    parts = re.split('[,; ]+', text.strip(',; '))
    return parts if all(map(looks_like_address, parts)) else [text]


def length_of(address: str, kind: str | None, texts: Sequence[str]) -> int:
    """Return the Length of a write; in A and N files a string has two characters per word."""
    if is_string_element(address):
        return 1
    is_packed = kind == ValueType.STRING.value
    return max(1, (len(texts[0]) + 1) // 2) if is_packed else len(texts)


def processor_cell(processor: Processor | None) -> str:
    """Return the Processor cell of a map file; empty for the usual one."""
    return '' if processor is None or processor is USUAL else processor.value


def read(session: Session, mapping: Mapping) -> Values:
    """Return the values of a mapping; raises LinkError, RemoteError or FormatError."""
    return scaled(mapping, session.ask(mapping.station, steps.read(mapping.target)))


def scaled(mapping: Mapping, values: Values) -> Values:
    """Return values in the unit of the row's topic."""
    if mapping.scaling is None or isinstance(values, str):
        return values
    return mapping.scaling.publish(values)


def named(mapping: Mapping) -> str:
    """Return the name of a mapping in errors: the address, for a row also the tag."""
    return f'{printable(mapping.tag)} ({mapping.address})' if is_row(mapping) \
        else str(mapping.address)


def is_row(mapping: Mapping) -> bool:
    """Return True for a row of a map, False for an address of the command line."""
    return bool(mapping.place.file)


def remarks_of_write(mapping: Mapping) -> Iterator[str]:
    """Yield warnings about side effects of a write."""
    for remark in mapping.remarks:
        yield remark.text
    if mapping.address.file_type is FileType.BINARY and mapping.address.bit is None:
        yield (f'{mapping.address} is a word: this writes its 16 bits; a bit is '
               f'{mapping.address.with_bit(0)}')
    if mapping.address.file_type is FileType.OUTPUT:
        yield f'{mapping.address} is an output: this write may move a machine'
    if mapping.fallback is not None:
        yield (f'{named(mapping)} has a Fallback, which only the bridge writes: no '
               'Fallback follows this write')


def status_of(result: WriteResult) -> int:
    """Print why a write is not confirmed; return the exit status, 0 if it is."""
    if result.outcome is Outcome.WRITTEN:
        return 0
    complain(f'{named(result.mapping)} of station {result.mapping.station}: {result}')
    if _may_lack_bit_writes(result):
        complain('SLC 5/01, 5/02 and MicroLogix 1000 may not know the command that writes bits: '
                 'name the processor with --processor, or in the column Processor of the map')
    return EXIT_UNKNOWN if result.outcome in _UNCERTAIN else EXIT_FAILED


def _may_lack_bit_writes(result: WriteResult) -> bool:
    """Tell whether a processor that is not named may have refused the masked write."""
    row, error = result.mapping, result.error
    return isinstance(error, RemoteError) and error.sts == STS_ILLEGAL_COMMAND \
        and row.address.bit is not None and row.plc_type is PlcType.SLC and row.processor is None


class Writing:
    """
    One write to one mapping; ``str`` returns the values to write.

    Raises FormatError if ``texts`` are not values of the mapping.
    """

    def __init__(self, mapping: Mapping, texts: Sequence[str]) -> None:
        self.mapping = mapping
        self._write = Write(mapping, parse_values(mapping, texts), time.monotonic())

    def __str__(self) -> str:
        """Return the values, with raw values if the row is scaled."""
        if self.mapping.scaling is None:
            return self._write.value
        return f'{self._write.value} (raw {show(self._write.raw)})'

    def carry_out(self, session: Session) -> WriteResult:
        """Write and return the result, also after KeyboardInterrupt or PortLost."""
        pending = Pending[WriteResult]()
        try:
            # Inside the try block: an interrupt may come while the command is on the line.
            session.start(self.mapping.station, carry_out(self._write), pending)
            result = session.wait(pending)
            if isinstance(result.error, LinkError) and not isinstance(result.error, PortLost):
                session.silent = self.mapping.station
            return result
        except (KeyboardInterrupt, PortLost) as error:
            session.close()
            if pending.is_done and pending.error is None:
                return pending.result()
            failure = pending.error or error
            is_sent = getattr(failure, 'sent', True)
            outcome = Outcome.UNKNOWN if is_sent else Outcome.NOT_SENT
            return self._write.result(outcome, str(failure))


def parse_values(mapping: Mapping, texts: Sequence[str]) -> Sequence[float] | str:
    """Return the values of texts; whole numbers also as 0x, 0b. FormatError for bad texts."""
    if texts and mapping.message_type is ValueType.STRING:
        if len(texts) != 1:
            raise FormatError('takes one text; quote it if it has spaces')
        return texts[0]
    return [_number(mapping, text) for text in texts]


def _number(mapping: Mapping, text: str) -> float:
    kind = mapping.message_type
    low, high = kind.range
    value: float | None
    if kind is not ValueType.FLOAT32:
        value = int(text, 0) if _WITH_BASE.fullmatch(text) else whole_number(text)
    elif right := two_readings(text):
        raise FormatError(f'"{text}" could be two numbers; write {right}')
    else:
        value = decimal_number(text.replace(',', '.'))
    if value is None or not low <= value <= high:
        unsigned = _UNSIGNED.get(kind)
        hint = f'; --type {unsigned.value} allows it' if unsigned and value is not None and (
            high < value <= unsigned.range[1]) else ''
        if text in ('=', ':='):
            hint = '; the values follow the address without it'
        elif looks_like_address(text.partition('=')[0]):
            hint = '; a write has one address, and the values of the places after it follow'
        raise FormatError(f'"{text}" is not a valid {kind.value}, {kind.form}{hint}')
    return value


def tags_of(mappings: Rows, station: int) -> Tags:
    """Return the tags of a station's rows by address; numbered if a row has several values."""
    tags: dict[str, list[str]] = defaultdict(list)
    for row in mappings.of_plcs:
        if row.station != station:
            continue
        for number in range(1 if row.type is ValueType.STRING else row.length):
            tag = name_in(row, number)
            tag += ' (raw)' if row.scaling else ''
            if tag not in (names := tags[str(row.place_of(number))]):
                names.append(tag)
    return {place: printable(', '.join(names)) for place, names in tags.items()}


def tag_of(mapping: Mapping, number: int, tags: Tags | None) -> str:
    """Return the tag of a value: the tag of its row, or the tags at its address."""
    if tags is None or not is_row(mapping):
        return (tags or {}).get(str(mapping.place_of(number)), '')
    return printable(name_in(mapping, number))


def name_in(row: Mapping, number: int) -> str:
    """Return the name of a value of a row of a map: its name in Bits, or the tag of the row."""
    is_alone = row.length == 1 or row.type is ValueType.STRING
    return row.tag if is_alone else row.name_of(number) or f'{row.tag}[{number}]'


def labels(mapping: Mapping, tags: Tags | None) -> list[str]:
    """Return the address of each value, followed by its tag."""
    return [f'{mapping.place_of(number)} {tag_of(mapping, number, tags)}'.rstrip()
            for number in range(mapping.length)]


def rows(mapping: Mapping, values: Values, names: Sequence[str], radix: Radix = Radix.DECIMAL,
         room: int | None = None) -> Iterator[tuple[str, str]]:
    """
    Yield values in rows of up to ``room`` characters, each with the name of its first value.

    ``names`` are the ``labels`` of all values. If any value has a tag, each value has a row of its
    own. Each bit has its number in the file, and each value the unit of its row.
    """
    if isinstance(values, str):
        yield names[0], repr(values)
        return
    has_tags = any(' ' in name for name in names)
    texts = value_texts(mapping, values, radix)
    if mapping.type is ValueType.BOOL and len(texts) > 1 and not has_tags:
        texts = [f'{_bit(mapping.place_of(number))}={text}' for number, text in enumerate(texts)]
    if radix is Radix.BINARY and mapping.type in (ValueType.INT16, ValueType.UINT16):
        texts = [f'{text}  {_bits_set(mapping.place_of(number), value)}'.rstrip()
                 for number, (text, value) in enumerate(zip(texts, values, strict=True))]
    if unit := unit_of(mapping):
        texts = [f'{text} {unit}' for text in texts]
    width = max(map(len, texts))
    has_members = mapping.address.file_type.is_structure and mapping.address.bit is None
    if has_members and not mapping.scaling:
        yield from zip(names, map(partial(_with_bits, mapping), range(len(texts)), values, texts),
                       strict=True)
        return
    step = 1 if has_tags or any('  ' in text for text in texts) else \
        _BITS_IN_ROW if mapping.type is ValueType.BOOL else _VALUES_IN_ROW
    if room is not None:
        step = min(step, max(1, (room + len(_BETWEEN)) // (width + len(_BETWEEN))))
    for first in range(0, len(texts), step):
        pad = str.ljust if radix is Radix.BINARY else str.rjust
        shown = (pad(text, width) for text in texts[first:first + step])
        yield names[first], _BETWEEN.join(shown)


def unit_of(mapping: Mapping) -> str:
    """Return the unit at the end of a Description such as "Tank level [%]"; empty for none."""
    match = _UNIT.search(mapping.description)
    return printable(match['unit']) if match else ''


def _bit(place: Address) -> str:
    return '/' + str(place).rpartition('/')[2]


def _bits_set(place: Address, value: float) -> str:
    return ' '.join(_bit(place.with_bit(bit)) for bit in range(BITS) if int(value) >> bit & 1)


def _with_bits(mapping: Mapping, number: int, value: float, text: str) -> str:
    """Return a value of a structure; for a word of bits with the names of the set bits."""
    place = mapping.place_of(number)
    named = [name for name, member in place.layout.members.items()
             if member.bit is not None and member.word == place.word
             and int(value) >> member.bit & 1]
    return f'{text}  {" ".join(named)}' if named else text


def value_texts(mapping: Mapping, values: Sequence[float], radix: Radix) -> list[str]:
    """
    Return each value as text.

    In any radix except ten, whole numbers have all digits of their type. Floats, single bits and
    scaled values look the same in every radix.
    """
    if radix is Radix.DECIMAL or mapping.type not in _BITS or mapping.scaling:
        return [*map(value_text, values)]
    bits = _BITS[mapping.type]
    digits = len(f'{(1 << bits) - 1:{radix.value}}')
    return [f'{int(value) & (1 << bits) - 1:0{digits}{radix.value}}' for value in values]


def print_values(mapping: Mapping, values: Values, radix: Radix = Radix.DECIMAL,
                 tags: Tags | None = None) -> None:
    """Print the values of a mapping, each with its address."""
    lines = list(rows(mapping, values, labels(mapping, tags), radix))
    width = max(len(address) for address, _ in lines)
    note = mapping.description if is_row(mapping) else ''
    for address, text in lines:
        print(printable(f'{address:{width}}  {text}  {note}'.rstrip()))
        note = ''
