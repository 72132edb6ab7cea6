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

from __future__ import annotations

import os
from pathlib import Path

from abdf1_ros.driver.csv_table import read_rows, Row
from abdf1_ros.errors import ConfigurationError
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.properties import PROPERTY

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
])
def test_same_table_in_any_form(path: Path, content: str) -> None:
    assert cells_of(path, content) == [['a', 'N7:0', '2'], ['b', 'N7:1', '3']]


def test_quoted_cell_holds_delimiter_newline_and_quotes(path: Path) -> None:
    content = 'Tag,Address\n"a, ""b""\nc",N7:0\nd,N7:1\n'
    assert cells_of(path, content) == [['a, "b"\nc', 'N7:0', ''], ['d', 'N7:1', '']]


def test_lines_and_items_are_counted_across_comments_blanks_and_long_cells(path: Path) -> None:
    content = '\n# c\nTag,Address\n\n# c\na,1\n"b\nb",2\n\nc,3\n# c\nd,4\n'
    assert [(row.item, row.line) for row in rows_of(path, content)] == [
        (1, 6), (2, 7), (3, 10), (4, 12)]


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
    assert row.where('Tag') == f'{path}:3:2 (Tag)'
    assert row.where('Length') == f'{path}:3:1 (Length)'
    assert row.where('Address') == f'{path}:3 (Address)'


def test_cells_that_are_missing_are_empty(path: Path) -> None:
    assert cells_of(path, 'Tag,Length\na\n') == [['a', '', '']]


def test_unknown_column_comes_with_a_suggestion(path: Path) -> None:
    assert problems_of(path, '# c\nTag,Adress\na,1\n') == [
        'FILE:2:2: unknown column "Adress"; did you mean Address?']


def test_unknown_column_that_resembles_none_comes_with_all_names(path: Path) -> None:
    assert problems_of(path, 'Zq9,Tag\n1,a\n') == [
        'FILE:1:1: unknown column "Zq9"; known: Tag, Address, Length']


def test_every_fault_of_the_header_is_reported(path: Path) -> None:
    assert problems_of(path, 'Tag,tag,Lenght,TAG\na,b,c,d\n') == [
        'FILE:1:2: column Tag stands twice',
        'FILE:1:3: unknown column "Lenght"; did you mean Length?',
        'FILE:1:4: column Tag stands twice']


@pytest.mark.parametrize('content, where', [
    ('Tag,Address\na,N7:0,5\n', 'FILE:2:3'),
    ('Tag,,Address\na,5,N7:0\n', 'FILE:2:2'),
    ('Tag,Address\nb,N7:1\n# c\na,N7:0,,5\nc,N7:2,5\n', 'FILE:4:4'),
])
def test_cell_outside_the_columns(path: Path, content: str, where: str) -> None:
    assert problems_of(path, content) == [
        f'{where}: "5" stands in no column; quote a cell that contains the delimiter']


def test_missing_file(path: Path) -> None:
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
])
def test_byte_that_is_not_utf8(path: Path, content: bytes, where: str, byte: str) -> None:
    assert problems_of(path, content) == [
        f'FILE:{where}: byte 0x{byte} is not UTF-8; save the file as "CSV UTF-8"']


@pytest.mark.parametrize('content', [
    b'', b'\n\n', b'\xef\xbb\xbf', b'# only\n# comments\n', b',,,\n;\n\t\n', b'  \r\n'])
def test_empty_file(path: Path, content: bytes) -> None:
    assert problems_of(path, content) == [
        'FILE:1: the file is empty; its first row names columns: Tag, Address, Length']


def test_header_only_is_a_table_without_rows(path: Path) -> None:
    assert rows_of(path, 'Tag,Address\n\n# nothing yet\n') == []


def test_nul_byte_is_no_crash(path: Path) -> None:
    assert cells_of(path, b'Tag\na\0b\n') == [['a\0b', '', '']]


@pytest.mark.parametrize('content, line', [
    ('Tag,Address\na,1\n"b,2\nc,3\n', 3),
    ('"Tag,Address\na,1\n', 1),
    ('Tag,Address\na,"1', 2),
    ('Tag,Address\na,"1\n# c\n', 2),
])
def test_quote_that_is_not_closed_does_not_swallow_the_rows_behind_it(
        path: Path, content: str, line: int) -> None:
    assert problems_of(path, content) == [f'FILE:{line}: a quote in this row never ends']


def test_cell_that_is_much_too_long_is_refused(path: Path) -> None:
    problem, = problems_of(path, 'Tag\n' + 'x' * 200_000 + '\n')
    assert problem.startswith('FILE: not a CSV file: field larger than field limit')


def test_endless_file_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='larger than 10 MB; is it a CSV file'):
        read_rows('/dev/zero', KNOWN)


@PROPERTY
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
