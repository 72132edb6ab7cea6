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
from hypothesis import given
from hypothesis import strategies as st
import pytest

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


@pytest.mark.parametrize('content', [
    'Tag,Address,Length\na,N7:0,2\nb,N7:1,3\n',
    'Tag,Address,Length\na,N7:0,2\nb,N7:1,3',
    '\ufeffTag,Address,Length\na,N7:0,2\nb,N7:1,3\n',
    'Tag,Address,Length\r\na,N7:0,2\r\nb,N7:1,3\r\n',
    'Tag,Address,Length\ra,N7:0,2\rb,N7:1,3\r',
    'Tag;Address;Length\na;N7:0;2\nb;N7:1;3\n',
    'Tag\tAddress\tLength\na\tN7:0\t2\nb\tN7:1\t3\n',
    'Tag,Address,Length,,,\na,N7:0,2,,,\nb,N7:1,3,,,\n',
    'Tag,Address,Length\na,N7:0,2,,\nb,N7:1,3\n',
    '\n\nTag,Address,Length\n\na,N7:0,2\n  \n,,\nb,N7:1,3\n\n',
    'tag,ADDRESS,length\na,N7:0,2\nb,N7:1,3\n',
    ' Tag , Address\t,Length \n a , N7:0,\t2\nb ,N7:1 , 3 \n',
    '"Tag","Address","Length"\n"a","N7:0","2"\n"b","N7:1","3"\n',
    '"Tag" , "Address" ,"Length"\n "a" , "N7:0" ,2\nb,N7:1,3\n',
    'Length,Tag,Address\n2,a,N7:0\n3,b,N7:1\n',
    'Tag,,Address,Length\na,,N7:0,2\nb,,N7:1,3\n',
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


def test_quoted_cell_holds_delimiter_and_quotes(path: Path) -> None:
    content = 'Tag,Address\n"a, ""b""",N7:0\nd,N7:1\n'
    assert cells_of(path, content) == [['a, "b"', 'N7:0', ''], ['d', 'N7:1', '']]


def test_lines_and_items_are_counted_across_comments_and_blanks(path: Path) -> None:
    content = 'sep=,\n# c\nTag,Address\n\n# c\na,1\n"",""\nb,2\n\nc,3\n# c\nd,4\n'
    assert [(row.item, row.line) for row in rows_of(path, content)] == [
        (1, 6), (2, 8), (3, 10), (4, 12)]


def test_only_the_first_line_tells_the_separator(path: Path) -> None:
    assert cells_of(path, 'Tag,Address\nsep=,1\n') == [['sep=', '1', '']]
    assert cells_of(path, 'Tag;Address\nsep=;\n') == [['sep=', '', '']]


def test_lines_are_counted_with_any_line_ends(path: Path) -> None:
    for end in ('\n', '\r\n', '\r'):
        content = end.join(['# c', 'Tag,Address', '', 'a,1', '# c', 'b,2', ''])
        assert [row.line for row in rows_of(path, content)] == [4, 6], repr(end)


@pytest.mark.parametrize('separator', ['\x0b', '\x0c', '\x1c', '\x85', '\u2028', '\u2029'])
def test_only_line_ends_end_a_line(path: Path, separator: str) -> None:
    rows = rows_of(path, f'Tag,Address\na{separator}b,1\nc,2\n')
    assert [(row.get('Tag'), row.line) for row in rows] == [(f'a{separator}b', 2), ('c', 3)]


def test_where_names_file_line_cell_and_column(path: Path) -> None:
    row, = rows_of(path, '# c\nLength,Tag\n1,a\n')
    assert row.where('Tag') == Place(str(path), 3, 2, 'Tag')
    assert row.where('Length') == Place(str(path), 3, 1, 'Length')
    assert row.where('Address') == Place(str(path), 3, None, 'Address')


def test_cells_that_are_missing_are_empty(path: Path) -> None:
    assert cells_of(path, 'Tag,Length\na\n') == [['a', '', '']]


def test_unknown_column_comes_with_a_suggestion(path: Path) -> None:
    assert problems_of(path, '# c\nTag,Adress\na,1\n') == [
        'FILE:2:2: unknown column "Adress"; did you mean Address?']


def test_unknown_column_that_resembles_none_comes_with_all_names(path: Path) -> None:
    assert problems_of(path, 'Zq9,Tag\n1,a\n') == [
        'FILE:1:1: unknown column "Zq9"; known: Tag, Address, Length']


def test_all_names_are_told_once(path: Path) -> None:
    assert problems_of(path, 'Adress,Zq9,,Tag,Lenght,Wx8\n') == [
        'FILE:1:1: unknown column "Adress"; did you mean Address?',
        'FILE:1:2: unknown column "Zq9"; known: Tag, Address, Length',
        'FILE:1:5: unknown column "Lenght"; did you mean Length?',
        'FILE:1:6: unknown column "Wx8"']


def test_file_of_another_kind_is_one_problem(path: Path) -> None:
    assert problems_of(path, 'Station,Mode,Address,Baud,Com_Port\n') == [
        'FILE:1: 4 of 5 columns are not known here, such as "Station": is this the right file? '
        'Known: Tag, Address, Length']


@pytest.mark.parametrize('name', ['Lengths', 'Note'])
def test_column_that_is_there_is_not_suggested(path: Path, name: str) -> None:
    assert problems_of(path, f'Tag,Length,{name}\n') == [
        f'FILE:1:3: unknown column "{name}"; known: Tag, Address, Length']


def test_every_fault_of_the_header_is_reported(path: Path) -> None:
    assert problems_of(path, 'Tag,tag,Lenght,TAG\na,b,c,d\n') == [
        'FILE:1:2: column Tag stands twice, first in cell 1',
        'FILE:1:3: unknown column "Lenght"; did you mean Length?',
        'FILE:1:4: column Tag stands twice, first in cell 1']


@pytest.mark.parametrize('content', [
    'a,b,2\nb,c,3\n', 'Tag|Address\na|N7:0\n', '"Tag,Address"\n"a,N7:0"\n',
    '<!DOCTYPE html>\n<html>\n', 'Tag Address Length\na N7:0 2\n'])
def test_file_without_a_header_is_one_fault(path: Path, content: str) -> None:
    assert problems_of(path, content) == [
        'FILE:1: no column is named here; the first row names them, with comma, semicolon or tab '
        'between: Tag, Address, Length']


@pytest.mark.parametrize('content', [
    'N7:0,"SPEED","Line speed"\n', 'a,n7:0/3,2\n', 'I:1.0/3,Global\n'])
def test_export_of_symbols_is_told_from_a_map(path: Path, content: str) -> None:
    problem, = problems_of(path, content)
    assert problem.startswith(
        'FILE:1: no column is named here, it has an address, as in an export of symbols from '
        'RSLogix ("plc import" makes a map of it) or a map without its first row; the first row')


@pytest.mark.parametrize('head', [b'PK\x03\x04\x14\0', b'\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0'])
def test_workbook_that_is_called_csv(path: Path, head: bytes) -> None:
    assert problems_of(path, head + bytes(100)) == [
        'FILE: is a workbook or a project of some program, not text; save what is in it as "CSV '
        'UTF-8"']


def test_comment_of_another_language_is_told(path: Path) -> None:
    assert problems_of(path, 'Tag,Address\na,N7:0\n// pumps, all of them\n') == [
        'FILE:3: a comment begins with #']
    problem, = problems_of(path, '// made by hand\nTag,Address\na,N7:0\n')
    assert problem.startswith('FILE:1: no column is named here, and a comment begins with #; ')


def test_header_that_stands_there_twice(path: Path) -> None:
    assert problems_of(path, 'Tag,Address\na,1\ntag,ADDRESS\nb,2\n') == [
        'FILE:3: the names of the columns stand here again; once is enough']
    assert cells_of(path, 'Tag\nTag\n') == [['Tag', '', '']]


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


@pytest.mark.parametrize('content, places', [
    ('Tag,Address\na,N7:0,5\n', ['2:3']),
    ('Tag,,Address\na,5,N7:0\n', ['2:2']),
    ('Tag,Address\nb,N7:1\n# c\na,N7:0,,5,6\nc,N7:2,5\n', ['4:4', '5:3']),
])
def test_cell_outside_the_columns(path: Path, content: str, places: list[str]) -> None:
    assert problems_of(path, content) == [
        f'FILE:{place}: "5" has no column; quote a cell that contains the delimiter'
        for place in places]


@pytest.mark.parametrize('header, row, name', [
    ('Tag,Address', 'a;N7:0', 'comma'), ('Tag,Address', '"a,N7:0"', 'comma'),
    ('Tag;Address', 'a,N7:0', 'semicolon'), ('Tag\tAddress', 'a,N7:0', 'tab')])
def test_row_that_is_not_divided_as_the_header(
        path: Path, header: str, row: str, name: str) -> None:
    text = f'this row is one cell; its cells need a {name} between them, outside of quotes'
    assert problems_of(path, f'{header}\n{row}\n\n{row}\n') == [
        f'FILE:2: {text}', f'FILE:4: {text}']


def test_only_cell_of_a_row_and_of_a_file(path: Path) -> None:
    assert cells_of(path, 'Tag,Address\na\n') == [['a', '', '']]
    assert cells_of(path, 'Tag\na;b\n') == [['a;b', '', '']]


def test_file_that_is_missing_is_named(path: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read_rows(str(path), KNOWN)
    assert str(caught.value) == f'{path}: cannot be read: No such file or directory'


def test_folder_in_place_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read_rows(str(tmp_path), KNOWN)
    assert str(caught.value) == f'{tmp_path}: cannot be read: Is a directory'


@pytest.mark.parametrize('content, where, byte', [
    (b'Tag,Address\na\xe4,N7:0\n', '2:2', 'E4'),
    (b'\xff\n', '1:1', 'FF'),
    (b'Tag\r\n\r\nab\x80\r\n', '3:3', '80'),
    (b'Tag\r\rab\x80\r', '3:3', '80'),
    (b'\xef\xbb\xbfTag,Address\na,b\xfc\n', '2:4', 'FC'),
    (b'\xef\xbb\xbfT\xe4g\n', '1:2', 'E4'),
    (b'Tag\nab\0\n', '2:3', '00'),
    ('Tag,Address\na,N7:0\n'.encode('utf-16-le'), '1:2', '00'),
    ('Tag,Address\na,N7:0\n'.encode('utf-16-be'), '1:1', '00'),
    (b'\xff\xfe' + 'Tag,Address\na,N7:0\n'.encode('utf-16-le'), '1:1', 'FF'),
])
def test_byte_that_is_no_text(path: Path, content: bytes, where: str, byte: str) -> None:
    line, number = where.split(':')
    assert problems_of(path, content) == [
        f'FILE:{line}: byte {number} of this line, 0x{byte}, is not text in UTF-8; save the file '
        'as "CSV UTF-8"']


@pytest.mark.parametrize('content', [
    b'', b'\n\n', b'\xef\xbb\xbf', b'# only\n# comments\n', b',,,\n;\n\t\n', b'  \r\n'])
def test_file_without_a_header_is_told_which_columns_there_are(path: Path, content: bytes) -> None:
    assert problems_of(path, content) == [
        'FILE:1: the file is empty; its first row names columns: Tag, Address, Length']


def test_header_only_is_a_table_without_rows(path: Path) -> None:
    assert rows_of(path, 'Tag,Address\n\n# nothing yet\n') == []


@pytest.mark.parametrize('content, places', [
    ('Tag,Address\na,1\n"b,2\nc,3\n', ['3:1']),
    ('"Tag,Address\na,1\n', ['1:1']),
    ('Tag,Address\na,"1', ['2:2']),
    ('Tag,Address\na,"', ['2:2']),
    ('Tag,Address\r\na,"1\r\n# c\r\n', ['2:2']),
    ('Tag,Address\na, "1""\n', ['2:2']),
    ('Tag,Address\n"a,1\nb,2\n"c,3\nd,4\n', ['2:1', '4:1']),
    ('Tag,Address\n"a\nb",1\n', ['2:1']),
])
def test_quote_that_is_not_closed_does_not_swallow_the_rows_behind_it(
        path: Path, content: str, places: list[str]) -> None:
    assert problems_of(path, content) == [
        f'FILE:{place}: the quote that opens this cell is not closed on this line'
        for place in places]


def test_line_that_is_much_too_long_is_refused(path: Path) -> None:
    longest = 'x' * (131_072 - 1)
    assert cells_of(path, f'Tag\n{longest}\n') == [[longest, '', '']]
    assert problems_of(path, f'Tag\na\nx{longest}\n"x{longest}\n') == [
        'FILE:3: this line has 131073 characters, at most 131072 go',
        'FILE:4: this line has 131074 characters, at most 131072 go']


def test_long_cell_is_shown_without_its_end(path: Path) -> None:
    cell = 'x' * 101
    assert problems_of(path, f'Tag\na,{cell}\nb,{cell[1:]}\n') == [
        f'FILE:2:2: "{cell[1:]}..." has no column; quote a cell that contains the delimiter',
        f'FILE:3:2: "{cell[1:]}" has no column; quote a cell that contains the delimiter']
    assert problems_of(path, f'Tag,{cell}\n') == [
        f'FILE:1:2: unknown column "{cell[1:]}..."; known: Tag, Address, Length']


def test_endless_file_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='larger than 10 MB; is it a CSV file'):
        read_rows('/dev/zero', KNOWN)


@given(content=st.one_of(
    st.binary(max_size=200),
    st.binary(max_size=100).map(lambda tail: b'Tag,Address,Length\n' + tail),
    st.text('Tag,;\t\n\r"# ', max_size=60).map(str.encode)))
def test_any_bytes_give_rows_or_a_configuration_error(
        tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / 'any.csv'
    try:
        rows = rows_of(path, content)
    except ConfigurationError as error:
        assert error.problems and str(path) in str(error)
    else:
        assert [row.item for row in rows] == list(range(1, len(rows) + 1))
        assert all(row.cells.keys() <= set(KNOWN) for row in rows)
        assert all(before.line < after.line for before, after in zip(rows, rows[1:]))


def test_pipe_is_no_file(tmp_path: Path) -> None:
    path = tmp_path / 'pipe'
    os.mkfifo(path)
    with pytest.raises(ConfigurationError, match='is a pipe, not a file'):
        read_rows(str(path), KNOWN)
