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
The rows of a file and their columns: which form it has, where its row of names stands.

A column is used, or it is named as not used, or rows with text in it do not write.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
import re

from abdf1_ros.cli.plc.exports.form import Form, heading, Ignored, ListRow, ONE, Role, Wanted
from abdf1_ros.cli.plc.exports.forms import (
    FACTORYTALK,
    IGNITION,
    INTOUCH,
    KEPSERVER,
    LIST,
    RSLOGIX,
)
from abdf1_ros.cli.plc.exports.records import other_file, Record, Sheet, without_names
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.text import shown

FORMS = (KEPSERVER, FACTORYTALK, INTOUCH, IGNITION)
_TITLES = '; '.join(form.title for form in (*FORMS, LIST, RSLOGIX))

# Roles of which each column counts; of the other roles only the best column does.
_ALL = (*ONE, Role.DESCRIPTION, Role.UNUSED)
# Roles that say the same twice, or nothing about words: a second column does no harm.
_HARMLESS = (Role.TAG, Role.DESCRIPTION, Role.UNIT, Role.UNUSED, Role.PERIOD)
_OURS = {'tag', 'command', 'address', 'station', 'plctype'}
_NOTHING = ('', '-')
_LOOKED_AT = 100  # records among which the row of names has to be

_NAMES_PLC = re.compile(r'\d+|[A-Za-z]{3,}[ _-]?\d+')  # in a column Unit
# Titles that may say that the rows below them belong to another PLC.
_PLC_TITLE = re.compile(
    r'\b(?:plc|sps|cpu|slc|micrologix|controller|processor|device|station|node|steuerung|automate|'
    r'machine|maschine|line|linie|ligne|cell|zelle|unit|panel)(?:\b|_|\d)', re.IGNORECASE)
_DOUBLE = ('its address stands in another row, too, as if it were of another PLC: made Read rows')
_SCOPE = re.compile(r'0?|global|local.*', re.IGNORECASE)
_SYMBOL = re.compile(r'[A-Za-z_]\w{0,31}|', re.ASCII)
_OTHER_ROWS = re.compile(r'(?P<what>DFILE|PFILE|LAD|RUNG)', re.IGNORECASE)


@dataclass(slots=True)
class Listing:
    """The rows of a file, and the names of columns with texts that are not used."""

    form: Form
    rows: list[tuple[Record, ListRow | Ignored]] = field(default_factory=list)
    unused: dict[str, None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Columns:
    """
    The columns below a row of names.

    Each has a key, its heading. ``names`` has the names of the file by key, ``roles`` the keys by
    role. Keys without a role are not understood.
    """

    form: Form
    names: dict[str, str]
    roles: dict[Role, list[str]]

    def entry(self, sheet: Sheet, record: Record) -> tuple[ListRow | Ignored, list[str]]:
        """Return what a record says, and the names of columns with text that are not used."""
        keys = [*self.names, *(f'. {number}' for number in range(
            len(self.names) + 1, len(record.cells) + 1))]
        texts = dict(zip(keys, record.cells, strict=False))
        if (what := self.form.prepare(texts)) is not None:
            return Ignored(what), []
        known = {key for keys in self.roles.values() for key in keys}
        strange = [key for key in keys if key not in known and (
            self.form.is_open or key in self.names)]
        unused = self.roles[Role.UNUSED] if self.form.is_open else []
        cells: dict[Role, list[tuple[str, str]]] = {
            role: [(self.names[key], texts.get(key, '')) for key in keys]
            for role, keys in self.roles.items() if role is not Role.UNUSED}
        node = '/'.join(filter(None, (text for _, text in cells.pop(Role.PLC, ()))))
        told = {key: self.names.get(key, key.replace('.', 'cell'))
                for key in (*strange, *unused)
                if texts.get(key, '') not in _NOTHING}
        return (ListRow(record, cells, node, [told[key] for key in strange if key in told],
                        (), sheet.is_dot_unclear), list(told.values()))


def table_of(sheet: Sheet, wanted: Wanted) -> Listing:
    """Return the rows of a file; raises ConfigurationError if its form is not known."""
    for form in FORMS:
        if any(_is_head(form, record) for record in sheet.records):
            return _read(form, sheet, wanted)
    if what := other_file(sheet):
        raise ConfigurationError([Problem(sheet.path, what)])
    if (head := _head_of_list(sheet, wanted)) is not None:
        return _read(LIST, sheet, wanted, head)
    if table := _symbols(sheet, wanted):
        return table
    raise ConfigurationError([Problem(
        sheet.path, without_names(sheet) or (
            f'is none of these: {_TITLES}' if sheet.records else 'the file is empty'))])


def _headings(record: Record) -> list[str]:
    return list(map(heading, record.cells))


def _is_head(form: Form, record: Record) -> bool:
    names = set(_headings(record))
    return any(names >= set(needed) for needed in form.needed)


def _read(form: Form, sheet: Sheet, wanted: Wanted, head: Record | None = None) -> Listing:
    """Read the records below the first row of names, which may come again with others."""
    table, columns, title = Listing(form), None, ''
    sections: dict[str, set[str]] = {}
    for record in sheet.records:
        if head is not None:
            is_next = record is head or (columns is not None and _is_again(record))
        else:
            is_next = record.first.startswith(form.mark) if form.mark else _is_head(form, record)
        found: ListRow | Ignored = Ignored()
        if is_next:
            columns = _columns(form, sheet, record, wanted)
        elif columns is None or record.first.lower().startswith(form.comments):
            pass
        elif form.is_open and _is_title(columns, record):
            found, title = Ignored('lines with one cell, such as titles'), max(record.cells)
        else:
            found, unused = columns.entry(sheet, record)
            table.unused |= dict.fromkeys(unused)
            if isinstance(found, ListRow):
                if not looks_like_address(found[Role.ADDRESS]) and _PLC_TITLE.search(record.first):
                    title = ' '.join(record.cells).strip()
                sections.setdefault(title, set()).add(found[Role.ADDRESS])
        table.rows.append((record, found))
    return _with_doubles(table, _mixed(sections), wanted) if form.is_open else table


def _with_doubles(table: Listing, reason: str, wanted: Wanted) -> Listing:
    """Return the rows; ``reason`` is why none may write, and a row like another has its own."""
    def place(row: ListRow) -> tuple[str, ...]:
        text = '/'.join(filter(None, (row[Role.ADDRESS], row[Role.BIT])))
        with suppress(FormatError):
            text = str(parse_address(text, wanted.plc_type))
        return row.node, row[Role.STATION], text.upper()

    count = Counter(place(row) for _, row in table.rows if isinstance(row, ListRow))
    for number, (record, row) in enumerate(table.rows):
        if isinstance(row, ListRow):
            double = _DOUBLE if count[place(row)] > 1 else ''
            table.rows[number] = record, replace(
                row, unclear=[*filter(None, [reason, double])])
    return table


def _mixed(sections: dict[str, set[str]]) -> str:
    """Return why rows below titles may belong to several PLCs; empty if nothing says so."""
    told = [title for title in sections if _PLC_TITLE.search(title)]
    count = sum(map(len, sections.values()))
    if len(sections) < 2 or not (told or len(set().union(*sections.values())) < count):
        return ''
    name = shown((told or [title for title in sections if title])[0])
    return (f'titles between the rows, such as "{name}", may name other PLCs: made Read rows '
            '(one file for each PLC, or no titles)')


def _is_again(record: Record) -> bool:
    """Tell whether a record of a list is another row of names."""
    if any(map(looks_like_address, record.cells)):
        return False
    roles = _roles(LIST, _headings(record))
    return Role.TAG in roles and Role.ADDRESS in roles


def _is_title(columns: _Columns, record: Record) -> bool:
    filled = [key for key, text in zip(columns.names, record.cells, strict=False) if text]
    return len(filled) < 2 and filled != columns.roles[Role.ADDRESS]


def _roles(form: Form, keys: Sequence[str]) -> dict[Role, list[str]]:
    """Return the keys by role, the best first."""
    found: dict[Role, list[str]] = {}
    for role, patterns in form.names.items():
        for pattern in patterns:
            found.setdefault(role, []).extend(
                key for key in keys if fnmatchcase(key.partition(' ')[0], pattern))
    if Role.ADDRESS in found:  # an IP Address is none of a word
        others = {key for role in (Role.PLC, Role.STATION) for key in found.get(role, ())}
        found[Role.ADDRESS] = [key for key in found[Role.ADDRESS] if key not in others]
    return {role: [key for key in keys if key in found[role]] if role in _ALL else
            list(dict.fromkeys(found[role])) for role in found if found[role]}


def _columns(form: Form, sheet: Sheet, head: Record, wanted: Wanted) -> _Columns:
    """Return the columns below a row of names; raises ConfigurationError for a missing one."""
    names: dict[str, str] = {}
    for number, name in enumerate(head.cells, 1):
        key = heading(name) or f'. {number}'
        names[key if key not in names else f'{key} {number}'] = name or f'cell {number}'
    roles: dict[Role, list[str]] = {Role.UNUSED: []} | _roles(form, list(names))
    if form.mark:
        return _Columns(form, names, roles)
    if form.is_open:
        _give(sheet, head, names, roles, wanted)
    for role in (Role.TAG, Role.ADDRESS):
        if role not in roles:
            raise ConfigurationError([Problem(Place(sheet.path, head.line), (
                f'which column is the {role.value}? Say --{role.value} COLUMN; columns: '
                f'{_listed(head)}'))])
    texts = {key: [''.join(record.cells[number:number + 1]) for record in sheet.records
                   if record.line > head.line] for number, key in enumerate(names)}
    if form.is_open:
        _mistrust(names, texts, roles)
    _choose(texts, roles)
    return _Columns(form, names, roles)


def _listed(head: Record) -> str:
    return ', '.join(map(shown, filter(None, head.cells)))


def _give(sheet: Sheet, head: Record, names: dict[str, str], roles: dict[Role, list[str]],
          wanted: Wanted) -> None:
    """Give columns the roles that the user says."""
    def key_of(option: str, name: str) -> str:
        keys = [key for key, known in names.items() if known.lower() == name.lower()]
        if not keys:
            raise ConfigurationError([Problem(Place(sheet.path, head.line), (
                f'--{option} "{shown(name)}" is not a column; columns: {_listed(head)}'))])
        for others in roles.values():
            others[:] = [key for key in others if key != keys[0]]
        return keys[0]

    for option, name in wanted.columns.items():
        key, role = key_of(option, name), Role(option)
        roles[Role.UNUSED] += roles.get(role, [])
        if role is Role.ACCESS:
            for other in ONE:
                roles[Role.UNUSED] += roles.pop(other, [])
        roles[role] = [key]
    for name in wanted.ignored:
        roles[Role.UNUSED].append(key_of('ignore', name))
    for role in [role for role, keys in roles.items() if not keys and role is not Role.UNUSED]:
        del roles[role]


def _mistrust(names: dict[str, str], texts: Mapping[str, Sequence[str]],
              roles: dict[Role, list[str]]) -> None:
    """Take the role from columns of a list whose names may also mean something else."""
    if roles[Role.ADDRESS][0] == 'opcitempath':  # types of Ignition, not of the PLC
        roles[Role.UNUSED] += roles.pop(Role.TYPE, [])
    units = roles.get(Role.UNIT, [])
    if len(units) > 1 or any(map(_NAMES_PLC.fullmatch, (
            text for key in units[-1:] for text in texts[key]))):
        roles.setdefault(Role.PLC, []).append(units.pop())
    if Role.SCALE not in roles:
        roles.pop(Role.OFFSET, None)  # of an address, perhaps
    period = ''.join(names[key] for key in roles.get(Role.PERIOD, []))
    if period and 'ms' not in period and period.lower() != 'period':
        roles[Role.UNUSED] += roles.pop(Role.PERIOD)


def _choose(texts: Mapping[str, Sequence[str]], roles: dict[Role, list[str]]) -> None:
    """Keep the best column of each role; another column has no role, or is not used."""
    places = roles.pop(Role.PLACE, [])
    if Role.PLC in roles or Role.STATION in roles:
        roles[Role.UNUSED] += places
    else:
        roles[Role.PLC] = places
    for role, keys in roles.items():
        if role is Role.PLC:
            roles[role] = _telling(keys, texts)
            roles[Role.UNUSED] += [key for key in keys if key not in roles[role]]
        elif role not in _ALL:
            same = [key for key in keys[1:] if role in _HARMLESS or texts[key] == texts[keys[0]]]
            roles[Role.UNUSED] += same
            del keys[1:]


def _telling(keys: Sequence[str], texts: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the columns that tell PLCs apart which the columns before do not; at least one."""
    kept: list[str] = []
    parts = 1
    for key in keys:
        count = len(set(zip(*(texts[other] for other in (*kept, key)), strict=True)))
        if count > parts:
            kept.append(key)
            parts = count
    return kept or list(keys[:1])


def _head_of_list(sheet: Sheet, wanted: Wanted) -> Record | None:
    """Return the row that names the columns of a list, below titles and comments, or None."""
    def rank(record: Record) -> int:
        given = {name.lower() for name in wanted.columns.values()}
        names = {cell.lower() for cell in record.cells}
        roles = _roles(LIST, _headings(record))
        return 10 * len(given & names) + 5 * sum(
            role in roles for role in (Role.TAG, Role.ADDRESS)) + bool(roles)

    heads: list[Record] = []
    for record in sheet.records[:_LOOKED_AT]:
        if any(map(looks_like_address, record.cells)):
            break
        if not record.first.lower().startswith(LIST.comments) and len(
                [cell for cell in record.cells if cell]) > 1:
            heads.append(record)
    head = max(heads, key=rank, default=None)
    if head is None or rank(head) < 5:
        head = next((record for record in sheet.records[:_LOOKED_AT] if rank(record) > 10), None)
    if head is None or rank(head) < 5:
        return None
    if set(_headings(head)) >= _OURS:
        raise ConfigurationError([Problem(sheet.path, 'is a map already')])
    return head


def _symbols(sheet: Sheet, wanted: Wanted) -> Listing | None:
    """Return the symbols of RSLogix, None if the columns may mean anything else."""
    with_address = [record for record in sheet.records
                    if looks_like_address(record.first.replace('/', ':'))]
    seconds = [record.cells[1] for record in with_address if len(record.cells) > 1]
    symbols = [text for text in seconds if text]
    if not with_address:
        return None
    if all(map(_SCOPE.fullmatch, seconds)) and any(len(record.cells) > 2
                                                   for record in with_address):
        keys = ['address', 'scope', 'symbol']
    elif symbols and all(map(_SYMBOL.fullmatch, seconds)) and len(set(symbols)) == len(symbols) \
            and not any(_SCOPE.fullmatch(text) for text in symbols):
        keys = ['address', 'symbol']
    else:
        return None
    names = dict.fromkeys((*keys, *RSLOGIX.names[Role.DESCRIPTION]), '')
    roles = {role: [key for key in keys if key in names]
             for role, keys in RSLOGIX.names.items()} | {Role.UNUSED: []}
    columns = _Columns(RSLOGIX, names, roles)
    return Listing(RSLOGIX, [(record, _symbol(columns, sheet, record, wanted))
                             for record in sheet.records])


def _symbol(columns: _Columns, sheet: Sheet, record: Record, wanted: Wanted) -> ListRow | Ignored:
    if match := _OTHER_ROWS.match(record.first):
        return Ignored(f'{match["what"].upper()} rows')
    cells = list(record.cells)
    while len(cells) > 3 and cells[-1] in ('', '0', '1'):  # numbers after the description
        cells.pop()
    entry, _ = columns.entry(sheet, replace(record, cells=tuple(cells)))
    try:
        place = parse_address(record.first, wanted.plc_type)
    except FormatError:
        return entry
    if place.file_type is FileType.STATUS and not wanted.has_status \
            and isinstance(entry, ListRow) and not entry[Role.TAG]:
        return Ignored('rows of the status file without a symbol (--status takes them)')
    return entry
