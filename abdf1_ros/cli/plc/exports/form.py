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
What the columns of a file mean: the description of each form as data, and the one reader of rows.

A row may write to the PLC only if the file says so, and if everything in the row is understood.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
import re

from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.errors import FormatError
from abdf1_ros.numbers import decimal_number, two_readings, whole_number
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.values import types_of, ValueType
from abdf1_ros.settings.names import sanitise
from abdf1_ros.text import shown

Cells = dict[str, str]

READ, WRITE, READ_WRITE = 'Read', 'Write', 'ReadWrite'


class Role(Enum):
    """What a column says of a row; five may be given by options of ``plc import``."""

    TAG = 'tag'
    ADDRESS = 'address'
    TYPE = 'type'
    DESCRIPTION = 'description'
    ACCESS = 'access'
    READ_ONLY = 'yes or no: a program may only read'
    WRITABLE = 'yes or no: a program may write'
    PLC = 'name of the PLC'
    PLACE = 'name of a machine, which may have a PLC of its own'
    STATION = 'station of the PLC'
    BIT = 'bit of the word at the address'
    LENGTH = 'number of elements'
    WORD_ORDER = 'which word of two is first'
    INVERT = 'yes or no: a bit is turned'
    NEGATE = 'yes or no: the sign is turned'
    SCALING = 'kind of scaling'
    SCALE = 'factor'
    OFFSET = 'what is added to the product'
    RAW_LOW = 'least raw value'
    RAW_HIGH = 'greatest raw value'
    LOW = 'value for the least raw value'
    HIGH = 'value for the greatest raw value'
    MIN = 'least value that may be written'
    MAX = 'greatest value that may be written'
    CLAMP_LOW = '1: LOW is a limit'
    CLAMP_HIGH = '1: HIGH is a limit'
    PERIOD = 'ms between reads'
    UNIT = 'unit'
    UNUSED = 'nothing that a mapping has'


ONE = (Role.READ_ONLY, Role.WRITABLE, Role.ACCESS)
"""Roles about access: each of their columns counts."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """
    The rows to make of each row of a file: one for each station.

    - ``period``: the least Period (ms) of a row.
    - ``stations``: if there are several, the tags begin with ``station_N/``; if there is none, the
      file says them, else it is 1.
    - ``read_only``: all rows are Read rows.
    - ``columns``: names of columns that the user gives by options, by the value of their role.
    - ``node``: the PLC to take if a file has several.
    - ``has_status``: take words of the status file without a symbol, too.
    - ``station_of``: stations by the name of their PLC.
    - ``ignored``: names of columns that say nothing about the words in the PLC.
    """

    plc_type: PlcType = PlcType.SLC
    stations: Sequence[int] = ()
    read_only: bool = False
    period: int = 0
    columns: Cells = field(default_factory=dict)
    node: str | None = None
    has_status: bool = False
    station_of: Mapping[str, int] = field(default_factory=dict)
    ignored: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class FoundRow:
    """
    The cells of a row, or the ``fault`` for which it is left out.

    ``node`` is the PLC that the file names for it, None if that is not known; ``station`` the
    station. ``remarks`` are for the user.
    """

    cells: Cells
    node: str | None = ''
    station: str = ''
    remarks: Sequence[str] = ()
    fault: str = ''


@dataclass(frozen=True, slots=True)
class Ignored:
    """A row that is skipped; ``what`` is its kind, empty for a row that is not counted."""

    what: str = ''


class Unusable(ValueError):
    """The reason why a row that should have an address cannot be used."""


@dataclass(frozen=True, slots=True)
class ListRow:
    """
    A record, its columns by role: their names and texts.

    ``strange`` names the columns with text that are not understood. ``unclear`` has other reasons
    why the row must not write.
    """

    record: Record
    cells: Mapping[Role, Sequence[tuple[str, str]]]
    node: str = ''
    strange: Sequence[str] = ()
    unclear: Sequence[str] = ()
    is_dot_unclear: bool = False

    def __getitem__(self, role: Role) -> str:
        """Return the first text of a role that is not empty, else an empty text."""
        return next((text for _, text in self.cells.get(role, ()) if text), '')

    def named(self, role: Role) -> str:
        """Return the name and the text of a column, for a fault."""
        name, text = next(((name, text) for name, text in self.cells[role] if text), ('', ''))
        return f'{name} "{shown(text)}"'

    def number(self, text: str) -> str:
        """Return a number as a map writes it; raise Unusable if the text is not a number."""
        if (value := number_of(text, self.is_dot_unclear)) is None:
            raise Unusable(f'"{shown(text)}" should be a number')
        return f'{value:.12g}'


@dataclass(frozen=True, slots=True)
class Form:
    """
    A form of file, as data.

    - ``needed``: headings (see ``heading``) that a row of names of this form has, or others.
    - ``mark``: the sign before each row of names, if there are several with different names.
    - ``comments``: how lines begin that are passed over.
    - ``names``: headings by role, the best first.
    - ``types``: Type by the words of the file; None if its types say nothing about the PLC.
    - ``prepare``: returns the kind of a record without an address, else None; it gets the texts
      by heading, and may change them.
    - ``adapt``: returns address, Type (None: unknown) and Length by the program's own rules.
    - ``folders``: the sign between folders and tags.
    - ``path``: an example of an address, if each has to name its PLC.
    - ``is_open``: the columns may come from anywhere, so an unknown one may change the meaning.
    - ``has_clear_slots``: O:1 is slot 1. Elsewhere it may be word 1 of a MicroLogix.
    - ``says_access``: some column says which rows may write.
    - ``names_all``: each row has a name; else an address stands for it.
    """

    title: str
    needed: Sequence[Collection[str]]
    names: Mapping[Role, Sequence[str]]
    types: Callable[[str], str | None] | None = None
    prepare: Callable[[dict[str, str]], str | None] = lambda _: None
    adapt: Callable[[str, str | None, str], tuple[str, str | None, str]] = lambda *place: place
    mark: str = ''
    comments: tuple[str, ...] = ()
    folders: str = '/'
    path: str = ''
    is_open: bool = False
    has_clear_slots: bool = True
    says_access: bool = True
    names_all: bool = True


# Of RSLinx: =RSLINX|PLC1!'N7:0,L10,C1'; of OPC: ns=1;s=[PLC1]N7:0, CH1.PLC1.N7:0.
_ITEM = re.compile(
    r"""(?:=?\w+\|(?P<topic>[^!]+)!'?)?(?:ns=\d+;s=)?\{?(?:::)?(?:\[(?P<node>[^]]+)\])?"""
    r"""(?:(?P<device>[\w.\- ]+)[.:!](?=[A-Z]{1,3}\d{0,3}:\d))?(?P<address>[^{}']+?)"""
    r"""(?:,L(?P<length>\d{1,5})(?:,C\d{1,5})?)?\}?'?""", re.IGNORECASE)
_PROVIDER = re.compile(r'\[[A-Za-z]\w*\](?=\w)')  # of Ignition: [default]Tanks/Level
_ARRAY = re.compile(r'(?P<address>[^\[]+?)\s*(?P<sizes>(?:\s*\[\d{1,5}\])+)')
# For a MicroLogix the number may name a word of the file, for an SLC a slot.
_SLOT_OR_WORD = re.compile(r'[IO]\d?:\d+(?:/\d+)?', re.IGNORECASE)
_UNSURE = ('an input or output without its word, such as I:4, is slot 4 of an SLC; of a '
           'MicroLogix it may be word 4: made a Read row, compare its value with the PLC')
_OCTAL = re.compile(r'[IO]\d?:\d+', re.IGNORECASE)

_ACCESS = {word: command for command, words in {
    READ: 'r ro read readonly rd rdonly get readsubscribe writeprotected lesen nurlesen nurlesend '
          'lesend schreibgeschützt lecture lectureseule lectura sololectura lettura solalettura '
          'leitura l',
    READ_WRITE: 'rw wr readwrite readandwrite writeread rdwr readwritesubscribe lesenschreiben '
                'lesenundschreiben schreibenlesen lectureécriture lectureecriture '
                'lecturaescritura letturascrittura leituraescrita le ls',
    WRITE: 'w wo write writeonly wr_only schreiben nurschreiben écriture ecriture escritura '
           'scrittura escrita'}.items() for word in words.split()}
_YES = ('yes', 'true', 't', 'y', '1', 'ja', 'j', 'oui', 'si', 'sí', 'sim', 'vrai', 'wahr')
_NO = ('no', 'false', 'f', 'n', '0', 'nein', 'non', 'não', 'falsch', 'faux', 'falso')
_TWO_WORDS = [kind.value for kind in ValueType if kind.words == 2]
_UNSCALED = ('none', 'off', 'noscale', 'noscaling', 'unscaled', 'raw', *_NO)
_ORDERS = {'': '', 'low': 'Low', 'lowfirst': 'Low', 'lowwordfirst': 'Low', 'lowhigh': 'Low',
           'high': 'High', 'highfirst': 'High', 'highwordfirst': 'High', 'highlow': 'High'}


def squeezed(text: str) -> str:
    """Return a word of a cell without letter case, and without signs between its parts."""
    return re.sub(r'[\s/_,.&+-]', '', text).casefold()


def heading(text: str) -> str:
    """Return the name of a column as forms have it: "Scan Rate (ms)" is scanrate."""
    plain = re.sub(r'\([^()]*\)|\[[^][]*\]', '', text)
    return re.sub(r'[\W_]', '', plain).casefold() or text.casefold()


def number_of(text: str, is_dot_unclear: bool = False) -> float | None:
    """
    Return a number, which may have a decimal comma; None for other texts.

    Raises Unusable for 1,500 which may be 1500; if ``is_dot_unclear`` for 1.500, too.
    """
    right = two_readings(text.replace('.', ',') if is_dot_unclear else text)
    if right and not (is_dot_unclear and text.startswith('0.')):
        raise Unusable(f'"{shown(text)}" could be two numbers; write {right}')
    return decimal_number(text.replace(',', '.'))


def read_row(form: Form, entry: ListRow, wanted: Wanted) -> FoundRow:
    """Return the row of a map that an entry becomes, or why it becomes none."""
    tag = _PROVIDER.sub('', entry[Role.TAG]) if form.is_open else entry[Role.TAG]
    tag, node = tag.replace(form.folders, '/'), entry.node
    address, length = entry[Role.ADDRESS], ''
    match = _ITEM.fullmatch(address)
    if match:
        address, length = match['address'].strip(), match['length'] or ''
        node = match['topic'] or match['node'] or match['device'] or node
    remarks: list[str] = []
    if not tag and not form.names_all:
        tag = sanitise(address)
        remarks += ['has no name: named by its address'] if form.is_open else []
    try:
        if not address:
            raise Unusable('Address is missing')
        if form.path and not (match and match['node']):
            raise Unusable(f'{entry.named(Role.ADDRESS)} has no address, as in {form.path}')
        cells = _cells(form, entry, (address, length), wanted, remarks)
    except Unusable as error:
        return FoundRow({'Tag': tag, 'Address': address}, node or None, fault=str(error))
    return FoundRow({'Tag': tag, **cells}, node, entry[Role.STATION], remarks)


def _cells(form: Form, entry: ListRow, place: tuple[str, str], wanted: Wanted,
           remarks: list[str]) -> Cells:
    """Return the cells of a row but its Tag; ``remarks`` gets what the user should know."""
    address, length = _counted(*place, entry)
    address, kind, length = form.adapt(
        _with_bit(address, entry, wanted),
        form.types(entry[Role.TYPE]) if form.types and entry.cells.get(Role.TYPE) else '',
        length)
    if kind is None:
        raise Unusable(f'{entry.named(Role.TYPE)} has no counterpart' + (
            ' (--ignore COLUMN: take the type that each address has)' if form.is_open else ''))
    command = _command(form, entry, remarks)
    if wanted.read_only:
        if command == WRITE:
            raise Unusable('cannot be read, and --read-only is given')
        command, remarks[:] = READ, []
    unclear = [*entry.unclear, *_unclear_parts(form, entry, (address, length, kind), wanted)]
    words = _words(address, kind, wanted)
    if form.is_open and entry[Role.LENGTH] and words and whole_number(length) in (
            words, 2 * words, 16 * words):
        unclear.append(f'Length {length} may be the size of one value in bits, bytes or words: '
                       'not used, made Read rows')
        length = ''
    elif form.is_open and length and _is_string(address, wanted):
        remarks.append('Length of a string in an ST file is not used')
        length = ''
    if command != READ:
        unclear += [f'column "{shown(name)}" is not understood: made Read rows (--ignore COLUMN, '
                    'if it says nothing about the words in the PLC)' for name in entry.strange]
    if unclear:
        command = READ
        remarks += unclear
    if squeezed(entry[Role.INVERT]) not in ('', 'direct', *_NO):
        raise Unusable(f'{entry.named(Role.INVERT)} has no counterpart')
    order = _ORDERS.get(squeezed(entry[Role.WORD_ORDER]))
    if order is None:
        raise Unusable(f'{entry.named(Role.WORD_ORDER)} should be Low or High: the word that '
                       'comes first')
    numbers = _scaling(entry)
    unit = entry[Role.UNIT]
    texts = (*(text for _, text in entry.cells.get(Role.DESCRIPTION, ())), unit and f'[{unit}]')
    cells = {
        'Command': command, 'Address': address, 'Type': kind,
        'Length': length or ('' if kind else whole_length(address, wanted.plc_type)),
        'Word_Order': order if words == 2 else '',
        'Period': '' if command == WRITE else _period(entry, wanted),
        'Description': ' '.join(filter(None, texts)), **numbers,
        **(_limits(entry) if command != READ else {})}
    return {column: text for column, text in cells.items() if text}


def _counted(address: str, length: str, entry: ListRow) -> tuple[str, str]:
    """Return an address without a number of elements, and this number."""
    told = [length, entry[Role.LENGTH]]
    if match := _ARRAY.fullmatch(address):
        address, count = match['address'], 1
        for size in re.findall(r'\d+', match['sizes']):
            count *= int(size)
        told.append(str(count))
    if len(different := {text for text in told if text} - {'0', '1'}) > 1:
        raise Unusable(f'has two numbers of elements, {" and ".join(sorted(different))}')
    return address, next(iter(different), '')


def _with_bit(address: str, entry: ListRow, wanted: Wanted) -> str:
    """Return an address with the bit of another column."""
    bit = entry[Role.BIT]
    if not bit:
        return address
    before, _, after = address.rpartition('/')
    if before:
        if after.upper() == bit.upper() or (whole_number(after) == whole_number(bit) is not None):
            return address
        raise Unusable(f'{entry.named(Role.BIT)} is not the bit of {shown(address)}')
    if wanted.plc_type == PlcType.PLC5 and _OCTAL.fullmatch(address) and len(bit) > 1:
        raise Unusable(f'{entry.named(Role.BIT)}: bits of I and O of a PLC-5 are octal, and this '
                       'may be decimal; write the bit into the address')
    return f'{address}/{bit}'


def whole_length(address: str, plc_type: PlcType) -> str:
    """Return the Length of a whole element, such as a timer, at an address; otherwise empty."""
    if re.search('[./-]', address):
        return ''
    try:
        place = parse_address(address, plc_type)
    except FormatError:
        return ''
    is_plain = place.file_type.is_structure and all(
        member.words == 1 for member in place.layout.members.values())
    return str(place.layout.words) if is_plain else ''


def _unclear_parts(form: Form, entry: ListRow, place: tuple[str, str, str],
                   wanted: Wanted) -> list[str]:
    """Return why the meaning of a row is not certain, though its columns are known."""
    address, length, kind = place
    unclear: list[str] = []
    if not form.has_clear_slots and _SLOT_OR_WORD.fullmatch(address) \
            and wanted.plc_type == PlcType.SLC:
        unclear.append(_UNSURE)
    if not form.is_open:
        return unclear
    words = _words(address, kind, wanted)
    if words == 2 and not entry[Role.WORD_ORDER] and _words(address, '', wanted) < 2:
        unclear.append('which of its two words comes first is not in the file: made Read rows '
                       '(a column Word Order: Low or High)')
    if not entry[Role.RAW_LOW] + entry[Role.RAW_HIGH] and entry[Role.LOW] + entry[Role.HIGH]:
        unclear.append('the scale of values has no raw values: made Read rows')
    return unclear


def _words(address: str, kind: str, wanted: Wanted) -> int:
    """Return the words of a value; without a type, of the natural type of the address."""
    if kind:
        return 0 if kind == ValueType.BOOL.value else 1 + (kind in _TWO_WORDS)
    try:
        return types_of(parse_address(address, wanted.plc_type))[0].words
    except FormatError:
        return 1


def _is_string(address: str, wanted: Wanted) -> bool:
    try:
        return parse_address(address, wanted.plc_type).file_type is FileType.STRING
    except FormatError:
        return False


def _command(form: Form, entry: ListRow, remarks: list[str]) -> str:
    """Return the Command that all columns about access allow."""
    told: list[str] = []
    for role in ONE:
        for name, text in entry.cells.get(role, ()):
            word = squeezed(text)
            is_yes = True if word in _YES else False if word in _NO else None
            if role is Role.ACCESS or is_yes is None:
                command = _ACCESS.get(word)
            else:
                command = READ if is_yes is (role is Role.READ_ONLY) else READ_WRITE
            if command is None:
                remarks.append(f'{name} is empty: made Read rows' if not text else
                               f'{name} "{shown(text)}" says nothing of access: made Read rows')
            told.append(command or READ)
    if not told and form.says_access:
        remarks.append('the file has no column about access: made Read rows (--access COLUMN)')
    return next((command for command in (READ, WRITE, READ_WRITE) if command in told), READ)


def _period(entry: ListRow, wanted: Wanted) -> str:
    """Return the Period of the file, or the longer one that is wanted."""
    text = entry[Role.PERIOD].removesuffix('ms').rstrip()
    number_of(text, entry.is_dot_unclear)  # raises Unusable if it could be two numbers
    return text if (whole_number(text) or 0) >= wanted.period else str(wanted.period)


def _scaling(entry: ListRow) -> Cells:
    """Return Scale and Offset, as the file has them or for a straight line through both ends."""
    mode, sign = squeezed(entry[Role.SCALING]), 1.0
    if squeezed(entry[Role.NEGATE]) not in ('', *_NO):
        sign = -1.0
    if mode not in ('', *_UNSCALED, 'linear'):
        raise Unusable(f'{entry.named(Role.SCALING)} has no counterpart; Linear has')
    ends = [entry[role] for role in _ENDS]
    is_line = mode == 'linear' or (
        not mode and any(ends[:2]) and {number_of(end) for end in ends} != {0.0})
    factors = {'Scale': entry[Role.SCALE], 'Offset': entry[Role.OFFSET]}
    cells = {column: entry.number(text) for column, text in factors.items() if text}
    plain = {'Scale': '1', 'Offset': '0'}
    if is_line:
        line = scaling(ends, sign, entry.is_dot_unclear)
        if cells and line != plain | cells:
            raise Unusable('has two scales, a factor and the ends of a line')
        return {} if line == plain else line
    return {'Scale': '-1'} if sign < 0 else dict(cells.items() - plain.items())


_ENDS = (Role.RAW_LOW, Role.RAW_HIGH, Role.LOW, Role.HIGH)


def scaling(ends: Sequence[str], sign: float = 1.0, is_dot_unclear: bool = False) -> Cells:
    """Return Scale and Offset that make raw low and raw high the values low and high."""
    raw_low, raw_high, low, high = (number_of(end, is_dot_unclear) for end in ends)
    if raw_low is None or raw_high is None or low is None or high is None or raw_low == raw_high:
        raise Unusable('the ends of its scale should be numbers, and both raw ones differ: '
                       f'{", ".join(map(shown, ends))}')
    scale = sign * (high - low) / (raw_high - raw_low)
    return {'Scale': f'{scale:.12g}', 'Offset': f'{sign * low - raw_low * scale + 0.0:.12g}'}


def _limits(entry: ListRow) -> Cells:
    """Return Min and Max of a row that writes."""
    is_turned = squeezed(entry[Role.NEGATE]) not in ('', *_NO)
    ends = [entry[Role.MIN], entry[Role.MAX]]
    for index, (clamp, end) in enumerate(
            ((Role.CLAMP_LOW, Role.LOW), (Role.CLAMP_HIGH, Role.HIGH))):
        if entry[clamp] == '1' and entry[Role.SCALING].casefold() == 'linear':
            ends[index] = entry[end]
    numbers = [text and entry.number(text) for text in ends]
    if is_turned:
        numbers = [text and f'{-float(text) + 0.0:.12g}' for text in reversed(numbers)]
    return dict(zip(('Min', 'Max'), numbers, strict=True))
