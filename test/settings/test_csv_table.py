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

"""CSV files as spreadsheets, editors and accidents write them."""

import os
from pathlib import Path

from abdf1_ros.problems import ConfigurationError, Place
from abdf1_ros.settings.csv_table import read_rows, read_table, Row
import pytest
from support.cases import for_all

KNOWN = ('Tag', 'Address', 'Length')


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'table.csv'


def rows_of(path: Path, content: str | bytes) -> list[Row]:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_rows(str(path), KNOWN)


def cells_of(path: Path, content: str | bytes) -> list[list[str]]:
    return [[row.get(name) for name in KNOWN] for row in rows_of(path, content)]


def problems_of(path: Path, content: str | bytes) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        rows_of(path, content)
    return [str(problem).replace(str(path), 'FILE') for problem in caught.value.problems]


@for_all('content', [
    'Tag,Address,Length\na,N7:0,2\nb,N7:1,3\n', 'Tag,Address,Length\na,N7:0,2\nb,N7:1,3',
    '\ufeffTag,Address,Length\na,N7:0,2\nb,N7:1,3\n',
    'Tag,Address,Length\r\na,N7:0,2\r\nb,N7:1,3\r\n', 'Tag,Address,Length\ra,N7:0,2\rb,N7:1,3\r',
    'Tag;Address;Length\na;N7:0;2\nb;N7:1;3\n', 'Tag\tAddress\tLength\na\tN7:0\t2\nb\tN7:1\t3\n',
    'Tag,Address,Length,,,\na,N7:0,2,,,\nb,N7:1,3,,,\n',
    'Tag,Address,Length\na,N7:0,2,,\nb,N7:1,3\n',
    '\n\nTag,Address,Length\n\na,N7:0,2\n  \n,,\nb,N7:1,3\n\n',
    'tag,ADDRESS,length\na,N7:0,2\nb,N7:1,3\n',
    ' Tag , Address\t,Length \n a , N7:0,\t2\nb ,N7:1 , 3 \n',
    '"Tag","Address","Length"\n"a","N7:0","2"\n"b","N7:1","3"\n',
    '"Tag" , "Address" ,"Length"\n "a" , "N7:0" ,2\nb,N7:1,3\n',
    'Length,Tag,Address\n2,a,N7:0\n3,b,N7:1\n', 'Tag,,Address,Length\na,,N7:0,2\nb,,N7:1,3\n',
    '# made by hand\nTag,Address,Length\n# one\na,N7:0,2\n  # two, with; signs\nb,N7:1,3\n#\n',
    '\ufeff# a comment first\nTag,Address,Length\na,N7:0,2\nb,N7:1,3\n',
    'Tag;Address;Length\n# commas, here,,,\na;N7:0;2\nb;N7:1;3\n',
    'sep=;\nTag;Address;Length\na;N7:0;2\nb;N7:1;3\n',
    '\ufeffSEP=,\r\nTag,Address,Length\r\na,N7:0,2\r\nb,N7:1,3\r\n',
    'sep=\t\nTag\tAddress\tLength\na\tN7:0\t2\nb\tN7:1\t3\n',
    '"sep=;"\nTag;Address;Length\na;N7:0;2\nb;N7:1;3\n',
    'sep=;;;\nTag;Address;Length\na;N7:0;2\nb;N7:1;3\n',
])
def test_same_table_in_any_form(path: Path, content: str) -> None:
    assert cells_of(path, content) == [['a', 'N7:0', '2'], ['b', 'N7:1', '3']]


def test_lines_and_items_are_counted_across_comments_and_blanks(path: Path) -> None:
    content = 'sep=,\n# c\nTag,Address\n\n# c\na,1\n"",""\nb,2\n\nc,3\n# c\nd,4\n'
    assert [(row.item, row.line) for row in rows_of(path, content)] == [
        (1, 6), (2, 8), (3, 10), (4, 12)]


@pytest.mark.parametrize('separator', ['\x0b', '\x0c', '\x1c', '\x85', '\u2028', '\u2029'])
def test_only_line_ends_end_a_line(path: Path, separator: str) -> None:
    rows = rows_of(path, f'Tag,Address\na{separator}b,1\nc,2\n')
    assert [(row.get('Tag'), row.line) for row in rows] == [(f'a{separator}b', 2), ('c', 3)]


def test_where_names_file_line_cell_and_column(path: Path) -> None:
    row, = rows_of(path, '# c\nLength,Tag\n1,a\n')
    assert row.where('Tag') == Place(str(path), 3, 2, 'Tag')
    assert row.where('Length') == Place(str(path), 3, 1, 'Length')
    assert row.where('Address') == Place(str(path), 3, None, 'Address')


def test_row_that_cannot_be_read_leaves_the_others_as_they_are(path: Path) -> None:
    path.write_bytes(b'# f\xfcr alle\nTag,Address\na,1\nb\xe4,2\nc,"3\nd,4,5\ne,5\nf,6\n')
    table = read_table(str(path), KNOWN)
    assert [(row.item, row.get('Tag')) for row in table.rows] == [(1, 'a'), (5, 'e'), (6, 'f')]
    assert [str(problem).removeprefix(f'{path}:').partition(': ')[0]
            for problem in table.row_faults] == ['4', '5:2', '6:3']


def test_file_of_which_most_rows_are_shifted_cannot_be_used(path: Path) -> None:
    path.write_text('Tag,Address\na,1\nb,2,5\nc,3,5\n', encoding='utf-8')
    table = read_table(str(path), KNOWN)
    assert (len(table.faults), len(table.row_faults), table.is_usable) == (0, 2, False)
    path.write_text('Tag,Address\na,1\nb,2,5\n', encoding='utf-8')
    assert read_table(str(path), KNOWN).is_usable


def test_line_that_is_much_too_long_is_refused(path: Path) -> None:
    longest = 'x' * (131_072 - 1)
    assert cells_of(path, f'Tag\n{longest}\n') == [[longest, '', '']]
    assert problems_of(path, f'Tag\na\nx{longest}\n"x{longest}\n') == [
        'FILE:3: this line has 131073 characters, at most 131072 are allowed',
        'FILE:4: this line has 131074 characters, at most 131072 are allowed']


@for_all(('content', 'cells'), [
    ('Tag,Address\n"a, ""b""",N7:0\nd,N7:1\n', [['a, "b"', 'N7:0', ''], ['d', 'N7:1', '']]),
    ('Tag,Address\nsep=,1\n', [['sep=', '1', '']]), ('Tag;Address\nsep=;\n', [['sep=', '', '']]),
    ('Tag,Length\na\n', [['a', '', '']]), ('Tag,Address\na\n', [['a', '', '']]),
    ('Tag\na;b\n', [['a;b', '', '']]), ('Tag\nTag\n', [['Tag', '', '']]),
    ('Tag,Address\n\n# nothing yet\n', [])])
def test_cells_are_those_of_the_columns(path: Path, content: str, cells: list[list[str]]) -> None:
    assert cells_of(path, content) == cells


NO_COLUMN = 'FILE:1: no column is named here'
BETWEEN = ('; the first row names them, with comma, semicolon or tab between: Tag, Address, '
           'Length')
RSLOGIX = (', it has an address, as in an export of symbols from RSLogix ("plc import" makes a '
           'map of it) or a map without its first row')
OUTSIDE = '"5" has no column; quote a cell that contains the delimiter'
ONE_CELL = 'this row is one cell; its cells need a {} between them, outside of quotes'
OPEN = 'the quote that opens this cell is not closed on this line'
AFTER = 'text follows the quote that closes this cell; write "" for a quote inside of quotes'
EMPTY = 'FILE:1: the file is empty; its first row names columns: Tag, Address, Length'
LONG = 'x' * 100


@for_all(('content', 'problems'), [
    # The header.
    ('# c\nTag,Adrs\na,1,5\n', [
        'FILE:2:2: unknown column "Adrs"; did you mean Address?', f'FILE:3:3: {OUTSIDE}']),
    ('Zq9,Tag\n1,a\n', ['FILE:1:1: unknown column "Zq9"; known: Tag, Address, Length']),
    ('Adress,Zq9,,Tag,Lenght,Wx8\n', [
        'FILE:1:1: unknown column "Adress"; did you mean Address?',
        'FILE:1:2: unknown column "Zq9"; known: Tag, Address, Length',
        'FILE:1:5: unknown column "Lenght"; did you mean Length?',
        'FILE:1:6: unknown column "Wx8"']),
    ('Tag,Length,Lengths\n', [
        'FILE:1:3: unknown column "Lengths"; known: Tag, Address, Length']),
    ("Tag,Length,'x,Note\n", [
        'FILE:1:3: unknown column "\'x"; signs that only a spreadsheet needs: write x',
        'FILE:1:4: unknown column "Note"; known: Tag, Address, Length']),
    ('Tag,tag,Lenght,TAG\na,b,c,d\n', [
        'FILE:1:2: column Tag stands twice, first in cell 1',
        'FILE:1:3: unknown column "Lenght"; did you mean Length?',
        'FILE:1:4: column Tag stands twice, first in cell 1']),
    ('Station,Mode,Address,Baud,Com_Port\n', [
        'FILE:1: 4 of 5 columns are not known here, such as "Station": is this the right file? '
        'Known: Tag, Address, Length']),
    (f'Tag,{LONG}x\n', [f'FILE:1:2: unknown column "{LONG}..."; known: Tag, Address, Length']),
    *((content, [NO_COLUMN + BETWEEN]) for content in (
        'a,b,2\nTag,c,3\nb,c,3\n', 'Tag|Address\na|N7:0\n', '"Tag,Address"\n"a,N7:0"\n',
        '<!DOCTYPE html>\n<html>\n', 'Tag Address Length\na N7:0 2\n')),
    *((content, [NO_COLUMN + RSLOGIX + BETWEEN]) for content in (
        'N7:0,"SPEED","Line speed"\n', 'a,n7:0/3,2\n', 'I:1.0/3,Global\n')),
    *((content, [f'FILE:1: the names of the columns stand in line {line}, and belong into the '
                 'first row; has a spreadsheet sorted the rows?']) for content, line in (
        ('a,N7:0,2\n# c\nb,N7:1,3\ntag,Address,LENGTH\nz,N7:3,4\n', 4),
        ('a;N7:0\nTag;Address\n', 2), ('// made by hand\nTag,Address\na,N7:0\n', 2))),
    ('// made by hand\nTag\na\n', [f'{NO_COLUMN}, and a comment begins with #{BETWEEN}']),
    *((content, [EMPTY]) for content in (
        '', '\n\n', '\ufeff', '# only\n# comments\n', ',,,\n;\n\t\n', '  \r\n')),
    # Rows.
    ('Tag,Address\na,N7:0\n// pumps, all of them\n', ['FILE:3: a comment begins with #']),
    ('Tag,Address\na,1\ntag,ADDRESS\nb,2\n', [
        'FILE:3: the names of the columns stand here again; once is enough']),
    ('Tag,Address\na,N7:0,5\n', [f'FILE:2:3: {OUTSIDE}']),
    *((content, [f'FILE:2:{cell}: "5": this column has no name in the first row; name it, or '
                 'leave it out (in pandas index=False)'])
      for content, cell in (('Tag,,Address\na,5,N7:0\n', 2), (',Tag,Address\n5,a,N7:0\n', 1))),
    ('Tag,Address\nb,N7:1\n# c\na,N7:0,,5,6\nc,N7:2,5\n', [
        f'FILE:4:4: {OUTSIDE}', f'FILE:5:3: {OUTSIDE}']),
    (f'Tag\na,{LONG}x\n', [
        f'FILE:2:2: "{LONG}..." has no column; quote a cell that contains the delimiter']),
    (f'Tag\na,{LONG}\n', [
        f'FILE:2:2: "{LONG}" has no column; quote a cell that contains the delimiter']),
    *((f'{header}\n{row}\n\n{row}\n', [
        f'FILE:2: {ONE_CELL.format(name)}', f'FILE:4: {ONE_CELL.format(name)}'])
      for header, row, name in (
          ('Tag,Address', 'a;N7:0', 'comma'), ('Tag,Address', '"a,N7:0"', 'comma'),
          ('Tag;Address', 'a,N7:0', 'semicolon'), ('Tag\tAddress', 'a,N7:0', 'tab'))),
    # A quote that is not closed does not swallow the rows after it.
    ('Tag,Address\na,1\n"b,2\nc,3\n', [f'FILE:3:1: {OPEN}']),
    ('#\n"Tag,Address\na,1\n', [f'FILE:2:1: {OPEN}']),
    *((content, [f'FILE:2:2: {OPEN}']) for content in ('Tag,Address\na,"1', 'Tag,Address\na,"')),
    *((f'Tag{mark}Length\n"x{mark}""y""" {mark} "5 ""in"" {mark} "\u2002\n{row}\n', [
        f'FILE:3:2: {AFTER}'])
      for mark in ',;\t' for row in (f'a{mark}"1"0', f'"a" {mark} "5" pipe', f'{mark}"5""" "')),
    ('Tag,Address\r\na,"1\r\n# c\r\n', [f'FILE:2:2: {OPEN}']),
    ('Tag,Address\na, "1""\n', [f'FILE:2:2: {OPEN}']),
    ('Tag,Address\n"a,1\nb,2\n"c,3\nd,4\n', [f'FILE:2:1: {OPEN}', f'FILE:4:1: {OPEN}']),
    ('Tag,Address\n"a\nb",1\n', [f'FILE:2:1: {OPEN}'])])
def test_problems_of_a_file(path: Path, content: str, problems: list[str]) -> None:
    assert problems_of(path, content) == problems


@for_all(('content', 'line', 'number', 'byte'), [
    (b'Tag,Address\na\xe4,N7:0\n', 2, 2, 'E4'), (b'\xff\n', 1, 1, 'FF'),
    (b'Tag\r\n\r\nab\x80\r\n', 3, 3, '80'), (b'Tag\r\rab\x80\r', 3, 3, '80'),
    (b'\xef\xbb\xbfTag,Address\na,b\xfc\n', 2, 4, 'FC'), (b'\xef\xbb\xbfT\xe4g\n', 1, 2, 'E4'),
    (b'Tag\nab\0\n', 2, 3, '00'), ('Tag,Address\na,N7:0\n'.encode('utf-16-le'), 1, 2, '00'),
    ('Tag,Address\na,N7:0\n'.encode('utf-16-be'), 1, 1, '00')])
def test_byte_that_is_no_text(path: Path, content: bytes, line: int, number: int,
                              byte: str) -> None:
    assert problems_of(path, content) == [
        f'FILE:{line}: byte {number} of this line, 0x{byte}, is not text in UTF-8; save the file '
        'as "CSV UTF-8"']


def test_what_is_no_file_of_text(path: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    workbook = 'is a workbook or a project of some program, not text; save what is in it as ' \
        '"CSV UTF-8"'
    for head in (b'PK\x03\x04\x14\0', b'\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0'):
        assert problems_of(path, head + bytes(100)) == [f'FILE: {workbook}']
    (tmp_path / 'long').write_bytes(b'\xef\xbb\xbf' + bytes(9_999_998))
    for name, right in (
            (tmp_path / 'long', 'larger than 10 MB; is it a CSV file?'),
            (tmp_path / 'missing', 'cannot be read: No such file or directory'),
            (tmp_path, 'cannot be read: Is a directory'),
            (tmp_path / 'pipe', 'is a pipe, not a file'),
            ('/dev/zero', 'larger than 10 MB; is it a CSV file?')):
        with pytest.raises(ConfigurationError) as caught:
            read_rows(str(name), KNOWN)
        assert str(caught.value) == f'{name}: {right}'


def test_folder_of_a_relative_path_is_named(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, reason in (('net.csv', f'No such file or directory in the folder {tmp_path}'),
                         ('.', 'Is a directory')):
        with pytest.raises(ConfigurationError) as caught:
            read_table(name, ['Baud'])
        assert str(caught.value) == f'{name}: cannot be read: {reason}'
