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

"""Addresses and values of the command line."""

from array import array
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from abdf1_ros.cli.plc import data
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.errors import FormatError, PortLost, RemoteError
from abdf1_ros.open_line import Pending
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.scaling import Scaling
import pytest
from support.cases import for_all
from support.mappings import make_mapping


def make(address: str, **cells: str) -> Mapping:
    common = {'Command': 'ReadWrite', 'Station': '1', 'PLC_Type': 'SLC'}
    return data.mapping_of(address, common | cells)


def test_columns_are_those_of_a_map_file() -> None:
    mapping = make('N7:0', Length='4', Type='int32', Word_Order='High', Station='7')
    assert (mapping.length, mapping.type.value, mapping.word_order.value, mapping.station) == (
        4, 'int32', 'High', 7)


@for_all(('address', 'cells', 'text'), [
    ('N7', {}, 'ADDRESS "N7": an element is missing, as in N7:0'),
    ('B3/4096', {}, 'ADDRESS "B3/4096": bits of B3 run from 0 to 4095'),
    ('N7:0', {'Length': '0', 'Command': 'Read'},
     '--length: "0" should be a whole number from 1 to 65535'),
    ('N7:0', {'Length': '1_0', 'Command': 'Read'},
     '--length: "1_0" should be a whole number from 1 to 65535'),
    ('N7:250', {'Length': '9', 'Command': 'Read'},
     '--length: 9 elements do not fit at N7:250; the last word there can be is N7:255'),
    ('N7:250', {'Length': '9'},
     'VALUE: 9 elements do not fit at N7:250; the last word there can be is N7:255'),
    ('N7:0', {'Type': 'bool'}, '--type: N7:0 can be int16, uint16, bcd16, bcd12, int32, '
     'uint32, float32, string; a bool needs a bit address such as B3:0/5'),
    ('N7:0', {'Length': '0', 'Access': 'x', 'Command': 'Read'},
     '--access: "x" of a SLC should be one of Slot, Flat\n'
     '--length: "0" should be a whole number from 1 to 65535'),
    ('N7:0', {'Access': 'Typed'}, '--access: "Typed" of a SLC should be one of Slot, Flat'),
    ('N7:0', {'Station': 'x'}, 'Station: "x" should be a whole number from 0 to 254'),
    ('N7:0', {'PLC_Type': 'PLC5', 'Processor': '5/02'}, '--processor: Processor is for PLCs of '
     'type SLC that we read or write; leave --processor out')])
def test_faults_name_the_argument(address: str, cells: dict[str, str], text: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        make(address, **cells)
    assert str(caught.value) == text


def test_word_pairs_of_a_function_file_are_whole_numbers() -> None:
    cells = {'Command': 'Read', 'Station': '1', 'PLC_Type': 'SLC'}
    assert [(str(part.address), part.type.value, part.length)
            for address in ('HSC:0', 'T4:0.PRE-T4:0.ACC', 'T4:0/13-15')
            for part in data.mappings_of(address, cells)] == [
        ('HSC:0', 'int16', 2), ('HSC:0.MOD', 'int16', 1), ('HSC:0.ACC', 'int32', 5),
        ('HSC:0.OMB', 'int16', 3), ('T4:0.PRE', 'int16', 2), ('T4:0/DN', 'bool', 3)]


@for_all(('address', 'kind', 'number', 'expected'), [
    ('N7:5', '', 3, 'N7:8'), ('N7:5', 'int32', 3, 'N7:11'), ('F8:2', '', 2, 'F8:4'),
    ('B3:0/5', '', 3, 'B3:0/8'), ('B3:0/5', '', 11, 'B3:1/0'), ('I:1.0/15', '', 1, 'I:1.1/0'),
    ('T4:0.PRE', '', 1, 'T4:0.ACC')])
def test_address_of_an_element(address: str, kind: str, number: int, expected: str) -> None:
    assert str(make(address, Type=kind, Command='Read').place_of(number)) == expected


def test_rows_of_values() -> None:
    mapping = make('N7:3', Length='12')
    assert [*data.rows(mapping, array('h', [*range(11), -100]), data.labels(mapping, None))] == [
        ('N7:3', '   0     1     2     3     4     5     6     7     8     9'),
        ('N7:13', '  10  -100')]
    words = data.rows(make('N7:0', Length='2'), array('h', [5, 0]), 'ab', data.Radix.BINARY)
    assert [*words] == [('a', '0000000000000101  /0 /2'), ('b', f'{"0" * 16}       ')]
    assert list(data.rows(make('F8:0'), array('f', [0.1]), ['F8:0'])) == [('F8:0', '0.1')]
    scaled = replace(make('T4:1', Length='2', Command='Read'), scaling=Scaling(0.5, 0))
    assert [*data.rows(scaled, [8192, 60], 'ab')] == [('a', '8192    60')]
    assert list(data.rows(make('ST9:0'), 'a\nb', ['ST9:0'])) == [('ST9:0', r"'a\nb'")]


def test_values_have_the_tags_of_their_own_addresses() -> None:
    tags = data.tags_of(Rows([
        make_mapping('N7:1', tag='speed'), make_mapping('N7:1', tag='speed'),
        make_mapping('N7:1', tag='a\nb'), make_mapping('N7:2', length=2, tag='words'),
        make_mapping('N7:4', length=2, kind='string', tag='text'),
        make_mapping('N7:0', station=2, tag='other'), make_mapping('N7:0/3', tag='bit'),
        make_mapping('N7:0', command='Serve', tag='ours')]), 1)
    mapping = make('N7:0', Length='6')
    assert list(data.rows(mapping, array('h', range(6)), data.labels(mapping, tags))) == [
        ('N7:0', '0'), (r'N7:1 speed, a\nb', '1'), ('N7:2 words[0]', '2'),
        ('N7:3 words[1]', '3'), ('N7:4 text', '4'), ('N7:5', '5')]
    bits = make('N7:0/2', Length='2')
    assert list(data.rows(bits, [1, 0], data.labels(bits, tags))) == [
        ('N7:0/2', '1'), ('N7:0/3 bit', '0')]


def test_bit_of_a_row_has_its_name() -> None:
    row = make_mapping('B3:0/0', length=3, tag='cell', bits=('closed', '', 'drive 3 fault'))
    tags = data.tags_of(Rows([row, make_mapping('B3:0/2', tag='drive 3 fault')]), 1)
    assert [*data.rows(row, [1, 0, 1], data.labels(row, tags))] == [
        ('B3:0/0 closed', '1'), ('B3:0/1 cell[1]', '0'), ('B3:0/2 drive 3 fault', '1')]
    bits = make('B3:0/1', Length='2')
    assert data.labels(bits, tags) == ['B3:0/1 cell[1]', 'B3:0/2 drive 3 fault']


@for_all(('address', 'kind', 'texts', 'values'), [
    ('N7:0', '', ['5', '-6', '0x1F', '0b11', '0o17', '007'], [5, -6, 31, 3, 15, 7]),
    ('F8:0', '', ['1.5', '1e3', '2,5'], [1.5, 1000, 2.5]), ('B3:0/0', '', ['1', '0'], [1, 0]),
    ('ST9:0', '', ['a b'], 'a b'), ('N7:0', 'bcd16', ['1234'], [1234])])
def test_text_becomes_values_of_the_type(
        address: str, kind: str, texts: list[str], values: object) -> None:
    assert data.parse_values(make(address, Type=kind), texts) == values


@for_all(('address', 'texts'), [
    ('N7:0', ['x']), ('N7:0', ['']), ('N7:0', ['0x']), ('N7:0', ['1.0']), ('F8:0', ['1.5.2']),
    ('ST9:0', ['a', 'b']), ('N7:0', ['1_000']), ('N7:0', ['0x1_0']), ('N7:0', ['\u0661']),
    ('N7:0', ['\uff11']), ('N7:0', [' 1']), ('F8:0', ['1_0.5']), ('F8:0', ['\u0661']),
    ('F8:0', ['nan']), ('F8:0', ['1e39']), ('F8:0', ['1,000'])])
def test_text_that_is_no_value_is_a_format_error(address: str, texts: list[str]) -> None:
    with pytest.raises(FormatError):
        data.parse_values(make(address), texts)


@for_all(('address', 'text', 'right'), [
    ('N7:0', '1_000', '"1_000" is not a valid int16, a whole number from -32768 to 32767'),
    ('N7:0', '0xFFFF', '"0xFFFF" is not a valid int16, a whole number from -32768 to 32767; '
                       '--type uint16 allows it'),
    ('N7:0', '65536', '"65536" is not a valid int16, a whole number from -32768 to 32767'),
    ('N7:0', '-32769', '"-32769" is not a valid int16, a whole number from -32768 to 32767'),
    ('B3:0/1', '2', '"2" is not a valid bool, 0 or 1'),
    ('F8:0', '1_000', '"1_000" is not a valid float32, a number such as -1.5 or 2e3, '
                      'at most 3.4e38'),
    ('F8:0', '1,000', '"1,000" could be two numbers; write 1000 or 1.000')])
def test_value_that_is_none_says_what_would_be_right(address: str, text: str, right: str) -> None:
    with pytest.raises(FormatError) as caught:
        data.parse_values(make(address), [text])
    assert str(caught.value) == right


class InterruptedSession:
    """A session that breaks off when its command is on the line already, or before."""

    def __init__(self, end: Callable[[Pending[WriteResult]], None], why: BaseException) -> None:
        self._end, self._why = end, why

    def start(self, station: int, steps: object, pending: Pending[WriteResult]) -> None:
        self._pending = pending
        raise self._why

    def close(self) -> None:
        self._end(self._pending)


@for_all('why', [KeyboardInterrupt(), PortLost('gone')])
@for_all(('end', 'outcome', 'detail'), [
    (lambda pending: pending.fail(PortLost('closed')), Outcome.UNKNOWN, 'port lost: closed'),
    (lambda pending: pending.fail(PortLost('closed', sent=False)), Outcome.NOT_SENT,
     'port lost: closed'),
    (lambda pending: None, Outcome.UNKNOWN, ''),
    (lambda pending: pending.succeed(WriteResult(make('N7:0'), Outcome.WRITTEN, 'ok', '5')),
     Outcome.WRITTEN, 'ok')])
def test_write_that_is_interrupted_is_unknown_if_it_was_sent_and_has_no_result(
        why: BaseException, end: Callable[[Pending[WriteResult]], None], outcome: Outcome,
        detail: str) -> None:
    session = cast(Session, InterruptedSession(end, why))
    result = data.Writing(make('N7:0'), ['5']).carry_out(session)
    assert (result.outcome, result.detail) == (outcome, detail or str(why))


@for_all(('processor', 'cell'), [
    (None, ''), (Processor.SLC_5_02, '5/02'), (Processor.SLC_5_03, ''),
    (Processor.ML1500, 'ML1500')])
def test_processor_that_says_what_it_is(processor: Processor | None, cell: str) -> None:
    assert data.processor_cell(processor) == cell


@for_all(('text', 'unit'), [
    ('Tank level [%]', '%'), ('speed [m/min]', 'm/min'), ('[bar]', 'bar'), ('[%] of tank', ''),
    ('a [\x1b]', r'\x1b'), ('b []', ''), ('a [plant with halls]', '')])
def test_unit_of_a_description(text: str, unit: str) -> None:
    assert data.unit_of(make('N7:0', Description=text)) == unit


@for_all(('address', 'kind', 'texts', 'length'), [
    ('N7:0', None, ['1', '2'], 2), ('ST9:0', 'string', ['Tank 5'], 1),
    ('N7:0', 'string', ['abcde'], 3), ('A10:0', 'string', [''], 1), ('st9:0', None, ['a', 'b'], 1)
])
def test_length_of_a_write(address: str, kind: str | None, texts: list[str], length: int) -> None:
    assert data.length_of(address, kind, texts) == length


@for_all(('kind', 'value', 'radix', 'text'), [
    ('int16', -2, data.Radix.HEXADECIMAL, 'FFFE'), ('int16', 10, data.Radix.HEXADECIMAL, '000A'),
    ('int16', -1, data.Radix.OCTAL, '177777'), ('int16', -2, data.Radix.DECIMAL, '-2'),
    ('uint16', 5, data.Radix.BINARY, '0000000000000101'),
    ('int32', -1, data.Radix.HEXADECIMAL, 'FFFFFFFF'),
    ('float32', 1.5, data.Radix.HEXADECIMAL, '1.5')])
def test_values_are_written_in_another_radix(
        kind: str, value: float, radix: data.Radix, text: str) -> None:
    mapping = make_mapping('F8:0' if kind == 'float32' else 'N7:0', kind=kind)
    assert data.value_texts(mapping, [value], radix) == [text]
    scaled = replace(mapping, scaling=Scaling(0.5, 0))
    assert data.value_texts(scaled, [value], radix) == [f'{value:g}']


@for_all(('address', 'said'), [
    ('O:051/18', 'PLC-5 I/O bits are octal, 0 to 17'), ('I:017/18', 'PLC-5 I/O bits are octal'),
    ('i:118/3', 'PLC-5 I/O words are octal, as in I:017'), ('O:51/18', 'slots of O run from 0 to'),
    ('I:1/18', 'bits run from 0 to 15')])
def test_address_of_rack_and_group_is_refused_in_the_words_of_a_plc5(
        address: str, said: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        data.check_for_some_family([address], {'Command': 'Read', 'Station': '1'})
    assert said in str(caught.value)


@for_all(('address', 'places'), [
    ('T4:0/ACC', ['T4:0.ACC']), ('C5:1/PRE', ['C5:1.PRE']), ('R6:0/LEN', ['R6:0.LEN']),
    ('T4:0', ['T4:0', 'T4:0.PRE', 'T4:0.ACC']), ('T4:1/DN', ['T4:1/DN'])])
def test_only_an_element_without_a_word_stands_for_all_its_words(
        address: str, places: list[str]) -> None:
    found = data.mappings_of(address, {'Command': 'Read', 'Station': '1', 'PLC_Type': 'SLC'})
    assert [str(mapping.place_of(number)) for mapping in found
            for number in range(mapping.length)] == places


def test_refused_bit_write_leads_to_the_column_processor(
        capsys: pytest.CaptureFixture[str]) -> None:
    for processor, sts, is_told in (('', 0x10, True), ('5/03', 0x10, False), ('', 0x50, False)):
        row = make('B3:1/3', **({'Processor': processor} if processor else {}))
        data.status_of(WriteResult(row, Outcome.REFUSED, 'refused', '1',
                                   error=RemoteError(sts, None, '')))
        assert ('name the processor' in capsys.readouterr().err) == is_told, (processor, sts)
