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
The cells of a file, in the encodings and with the delimiters of Windows.

A file of another kind, such as a workbook, is refused with what to do instead.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass
import io
from pathlib import Path
import re

from abdf1_ros.numbers import decimal_number
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.hints import looks_like_address, WORKBOOKS

_BYTE_ORDERS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DELIMITERS = ',;\t'
_LOOKED_AT = 50  # lines

_SYMBOLS = ('export its symbols there (Database, ASCII Export, CSV), or list them below a first '
            'row such as Address,Tag')
_SAVE = 'save what is in it as "CSV UTF-8", below a first row such as Address,Tag'
# The beginnings of files that are no lists, and the name of each kind.
_BYTES = (
    (br'PK\x03\x04', f'is a workbook or an archive; {_SAVE}'),
    (re.escape(WORKBOOKS[1]), f'is a workbook, or a project of some program; {_SAVE}'),
    (br'%PDF|\{\\rtf', f'is a document, without cells; {_SAVE}'),
    (br'SQLite format 3|\x1f\x8b', f'is a database or an archive; {_SAVE}'))
_TEXTS = (
    (r'\s*<\?xml[^<]*(?:<!--[^<]*)?<RSLogix5000Content|\s*<RSLogix5000Content',
     'is a project of a Logix controller, whose tags are not addresses; over DF1 it has only the '
     'addresses of its "Map PLC/SLC Messages": write these rows by hand'),
    (r'\s*<', f'is XML or a page of a browser; {_SAVE}'),
    (r'[\s\S]*servermain\.|[\s\S]*"common\.ALLTYPES', (
        'is a project of KEPServerEX in JSON; mark the device there, and take File, Export CSV')),
    (r'[\s\S]*"type"\s*:\s*"pccc', (
        'is a flow of Node-RED; write the variables of its endpoint as a list, below a first row '
        'such as Address,Tag')),
    (r'\s*[\[{]\s*["\[{]', (
        'is JSON, but no Export Tags of Ignition with opcItemPath; write a list, below a first '
        'row such as Address,Tag')))
_MARKDOWN = re.compile(r'^\s*\|?(?:\s*:?-{3,}:?\s*\|)+', re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Record:
    """The cells of a record, and the line that it begins on."""

    line: int
    cells: tuple[str, ...]

    @property
    def first(self) -> str:
        """Return the first cell."""
        return self.cells[0]


@dataclass(frozen=True, slots=True)
class Sheet:
    """
    The records of a file that are not empty.

    With ``is_dot_unclear`` no comma divides cells, as where 1.500 may be 1500. ``remark`` says
    what had to be guessed.
    """

    path: str
    text: str
    records: Sequence[Record]
    is_dot_unclear: bool = False
    remark: str = ''


def read_sheet(path: str) -> Sheet:
    """Return the cells of a CSV file; raises ConfigurationError, as for a file of another kind."""
    text, remark = _text_of(path)
    delimiter = _delimiter(text)
    return Sheet(path, text, list(_records(path, text, delimiter)), delimiter != ',', remark)


def _records(path: str, text: str, delimiter: str) -> Iterator[Record]:
    reader = csv.reader(io.StringIO(text, newline=None), delimiter=delimiter,
                        skipinitialspace=True)
    line = 1
    try:
        for record in reader:
            cells = tuple(map(one_line, record))
            if any(cells):
                yield Record(line, cells)
            line = reader.line_num + 1
    except csv.Error as error:
        raise ConfigurationError([Problem(Place(path, line), str(error))]) from None


def one_line(cell: str) -> str:
    """Return a cell with a blank for each run of blanks, line ends and control characters."""
    return ' '.join(re.sub('[\0-\x1f\x7f]', ' ', cell).split())


def _text_of(path: str) -> tuple[str, str]:
    """Return the text of a file, in the encodings of Windows too, and what was guessed."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ConfigurationError([Problem(
            path, f'cannot be read: {error.strerror or error}')]) from None
    if Path(path).suffix.lower() in ('.rss', '.rsp') and raw.startswith(WORKBOOKS):
        raise ConfigurationError([Problem(path, f'is a project of RSLogix; {_SYMBOLS}')])
    for beginning, what in _BYTES:
        if re.match(beginning, raw):
            raise ConfigurationError([Problem(path, what)])
    if raw.startswith(_BYTE_ORDERS):
        return raw.decode('utf-16', 'replace'), ''
    zeros = (raw[::2].count(0), raw[1::2].count(0))
    if sum(zeros) > len(raw) / 4:
        name = 'utf-16-be' if zeros[0] > zeros[1] else 'utf-16-le'
        return raw.decode(name, 'replace'), 'has UTF-16 text without a mark: read so'
    try:
        return raw.decode('utf-8-sig'), ''
    except UnicodeDecodeError:
        page = _code_page(raw)
        return raw.decode(page, 'replace'), (
            f'is not UTF-8: read in code page {page}, a guess; if names are wrong, save it as '
            '"CSV UTF-8"')


def _code_page(raw: bytes) -> str:
    """
    Return the code page of a text that is not UTF-8, by a guess.

    In western text a letter above 127 stands alone between others, elsewhere words are made of
    them. Russian letters are C0 to FF. A Chinese character is two bytes, from A1 on; in Japanese
    text many begin with 82 or 83.
    """
    runs = re.findall(rb'[\x80-\xff]+', raw)
    total, alone = sum(map(len, runs)), sum(len(run) == 1 for run in runs)
    if len(re.findall(rb'[\x82\x83][\x40-\xfc]', raw)) * 4 > total:
        return 'cp932'
    if alone * 2 >= total:
        return 'cp1252'
    is_chinese = all(len(run) % 2 == 0 for run in runs) and 7 * sum(
        byte < 0xC0 for run in runs for byte in run) > total
    return 'gbk' if is_chinese else 'cp1251'


def _delimiter(text: str) -> str:
    """Return the delimiter that most lines have; a comment may begin with a semicolon."""
    lines = [re.sub('"[^"]*"', '""', line).lstrip().lstrip(';')
             for line in text[:100_000].splitlines()[:_LOOKED_AT]]
    return max(_DELIMITERS, key=lambda sign: (
        sum(sign in line for line in lines), sum(line.count(sign) for line in lines)))


def other_file(sheet: Sheet) -> str:
    """Return the kind of a text that is not a list, and what to do; empty for a list."""
    for beginning, what in _TEXTS:
        if re.match(beginning, sheet.text):
            return what
    if sheet.records and sheet.records[0].first.lower() == 'remark':
        return ('has tags of a Logix controller, which are not addresses. Over DF1 the '
                'controller has only the addresses of its "Map PLC/SLC Messages": write these '
                'rows by hand')
    if any(cell.lower() == 'com_port' for record in sheet.records[:1] for cell in record.cells):
        return 'is a net file: it has the settings of a line, and no tags'
    if _MARKDOWN.search(sheet.text):
        return 'is a table of markdown; write it with commas between the cells'
    if re.search(r'^\s*(?:PROJECT|LADDER|START\b.*\bEND$)', sheet.text, re.MULTILINE):
        return f'is the text of a program; {_SYMBOLS}'
    return ''


def without_names(sheet: Sheet) -> str:
    """Return what is missing in a list of addresses whose columns are not known."""
    with_address = [cell for record in sheet.records for cell in record.cells
                    if any(map(looks_like_address, re.split(r'[\s|]+', cell)))]
    if not with_address:
        return ''
    if not any(map(looks_like_address, with_address)):
        return ('has addresses, but blanks or other signs between its cells; put commas between '
                'them, or copy the table into a spreadsheet and save it as "CSV UTF-8"')
    if len(with_address) > 1 and all(map(_is_of_values, sheet.records[-len(with_address):])):
        return ('has values beside addresses, as a print of a data file, and no names; "plc files '
                '--map" makes rows for the files of a PLC')
    return 'has addresses, but no first row with names: write one, such as Address,Tag'


def _is_of_values(record: Record) -> bool:
    """Return True if a record has an address, and then at least two values."""
    return len(record.cells) > 2 and looks_like_address(record.first) and all(
        decimal_number(cell) is not None for cell in record.cells[1:] if cell)
