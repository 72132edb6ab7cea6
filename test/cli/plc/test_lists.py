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
Lists of any origin: each column is used, named as not used, or makes the row one that only reads.

The forms are those of public lists, their contents are made up.
"""

from pathlib import Path

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.exports.form import Wanted
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.map_file import load_mappings
import pytest
from support.cases import for_all
from support.commands import made
from support.mappings import cell_of

STRANGE = ' is not understood: made Read rows (--ignore COLUMN, if it says nothing about the ' \
        'words in the PLC)'
ORDER = 'which of its two words comes first is not in the file: made Read rows (a column Word ' \
        'Order: Low or High)'


def cells(folder: Path, *columns: str) -> list[tuple[str, ...]]:
    """Return cells of the map that was made last."""
    return [tuple(cell_of(row, column) for column in columns)
            for row in load_mappings(str(folder / 'map.csv'))[0]]


def refusal(folder: Path, text: str | bytes, wanted: Wanted | None = None,
            name: str = 'list.csv') -> str:
    """Return why a file is refused."""
    with pytest.raises(ConfigurationError) as caught:
        made(folder, text, wanted, name)
    return str(caught.value).removeprefix(str(folder / name))


@for_all(('head', 'row', 'expected', 'remark'), [
    ('Type', 'DINT', {'Type': 'int32', 'Command': 'Read'}, ORDER),
    ('Datentyp', 'REAL', {'Type': 'float32', 'Command': 'Read'}, ORDER),
    ('Type de données', 'UINT', {'Type': 'uint16', 'Command': 'ReadWrite'}, ''),
    ('Type,Word Order', 'DINT,High', {'Type': 'int32', 'Command': 'ReadWrite',
                                      'Word_Order': 'High'}, ''),
    ('Type,Word Order', 'INT,High', {'Type': 'int16', 'Command': 'ReadWrite'}, ''),
    ('Bit', '1', {'Address': 'N7:0/1', 'Type': 'bool'}, ''),
    ('Bit', '', {'Address': 'N7:0', 'Type': 'int16'}, ''),
    ('Scale,Offset', '0.1,-50', {'Scale': '0.1', 'Offset': '-50'}, ''),
    ('Scale,Offset', '"0,1",', {'Scale': '0.1', 'Offset': '0'}, ''),
    ('Raw Zero Scale,Raw Full Scale,Eng Zero Scale,Eng Full Scale', '0,32000,0,100',
     {'Scale': '0.003125', 'Command': 'ReadWrite'}, ''),
    ('Raw Low,Raw High,Eng Low,Eng High', '0,100,0,100', {'Scale': ''}, ''),
    ('Offset', '3', {'Command': 'Read', 'Offset': ''}, f'column "Offset"{STRANGE}'),
    ('Eng Low,Eng High', '0,100', {'Command': 'Read'},
     'the scale of values has no raw values: made Read rows'),
    ('Min,Max', '-5,1500', {'Min': '-5', 'Max': '1500'}, ''),
    ('Length', '20', {'Length': '20', 'Command': 'ReadWrite'}, ''),
    ('Length', '16', {'Length': '1', 'Command': 'Read'},
     'Length 16 may be the size of one value in bits, bytes or words: not used, made Read rows'),
    ('Type,Word Order,Length', 'DINT,Low,2', {'Length': '1', 'Command': 'Read'},
     'Length 2 may be the size of one value in bits, bytes or words: not used, made Read rows'),
    ('Type,Word Order,Length', 'DINT,Low,3', {'Length': '3', 'Command': 'ReadWrite'}, ''),
    ('Length', '0', {'Length': '1', 'Command': 'ReadWrite'}, ''),
    ('Invert', 'no', {'Command': 'ReadWrite'}, ''),
    ('Converter', 'x10', {'Command': 'Read'}, f'column "Converter"{STRANGE}'),
    ('Converter', '', {'Command': 'ReadWrite'}, ''),
    ('Wire No.,Drawing', '1000,7', {'Command': 'ReadWrite'}, ''),
    ('Unit', 'bar', {'Command': 'ReadWrite', 'Description': '[bar]'}, ''),
    ('Tag Address', 'N7:5', {'Command': 'Read'}, f'column "Tag Address"{STRANGE}'),
    ('Tag Address', 'N7:0', {'Command': 'ReadWrite'}, ''),
    ('Read Only', 'yes', {'Command': 'Read'}, ''),
    ('Period', '500', {'Period': '500'}, ''), ('Scan Rate (ms)', '500', {'Period': '500'}, ''),
    ('Scan Rate', '5', {'Period': ''}, ''), ('', 'lost', {'Command': 'Read'},
                                             f'column "cell 4"{STRANGE}'),
    ('Area', '7,lost', {'Command': 'Read'}, f'column "cell 5"{STRANGE}')])
def test_column_is_used_or_the_row_only_reads(
        tmp_path: Path, head: str, row: str, expected: dict[str, str], remark: str) -> None:
    result = made(tmp_path, f'Tag,Address,Access,{head}\nSpeed,N7:0,RW,{row}\n')
    assert result.left_out == [] and list(+result.remarks) == [remark] * bool(remark)
    assert cells(tmp_path, *expected) == [tuple(expected.values())]


@for_all(('head', 'row', 'fault'), [
    ('Type', 'LWORD', 'Type "LWORD" has no counterpart (--ignore COLUMN: take the type that each '
                      'address has)'),
    ('Type', '3', 'Type "3" has no counterpart (--ignore COLUMN: take the type that each address '
                  'has)'),
    ('Type', 'Bool', 'N7:0 can be int16, uint16, bcd16, bcd12, int32, uint32, float32, string; a '
                     'bool needs a bit address such as B3:0/5'),
    ('Scale', 'x10', '"x10" should be a number'), ('Max', 'much', '"much" should be a number'),
    ('Max', '"1,500"', '"1,500" could be two numbers; write 1500 or 1.500'),
    ('Invert', 'yes', 'Invert "yes" has no counterpart'),
    ('Byte Order', 'swapped', 'Byte Order "swapped" should be Low or High: the word that comes '
                              'first'),
    ('Scaling', 'Square Root', 'Scaling "Square Root" has no counterpart; Linear has'),
    ('Scale,Raw Low,Raw High,Eng Low,Eng High', '2,0,1,0,1',
     'has two scales, a factor and the ends of a line'),
    ('Bit', '16', 'bits run from 0 to 15')])
def test_column_without_a_counterpart_leaves_the_row_out(
        tmp_path: Path, head: str, row: str, fault: str) -> None:
    result = made(tmp_path, f'Tag,Address,Access,{head}\nSpeed,N7:0,RW,{row}\nGood,N7:1,RW,\n')
    assert [str(problem) for problem in result.left_out] == [
        f'{tmp_path}/list.csv:2: Speed: {fault}']
    assert cells(tmp_path, 'Tag', 'Command') == [('Good', 'ReadWrite')]


@for_all(('address', 'bit', 'plc_type', 'expected'), [
    ('B3:0/1', '1', PlcType.SLC, 'B3:0/1'), ('B3/17', '17', PlcType.SLC, 'B3:1/1'),
    ('B3:0/1', '2', PlcType.SLC, 'Bit "2" is not the bit of B3:0/1'),
    ('T4:0', 'DN', PlcType.SLC, 'T4:0/DN'), ('I:1.0', '3', PlcType.SLC, 'I:1.0/3'),
    ('I:001', '7', PlcType.PLC5, 'I:001/07'),
    ('I:001', '10', PlcType.PLC5, 'Bit "10": bits of I and O of a PLC-5 are octal, and this may '
                                  'be decimal; write the bit into the address')])
def test_bit_column_belongs_to_the_address(
        tmp_path: Path, address: str, bit: str, plc_type: PlcType, expected: str) -> None:
    result = made(tmp_path, f'Tag,Address,Bit\na,{address},{bit}\n', Wanted(plc_type))
    told = [problem.text.removeprefix('a: ') for problem in result.left_out]
    assert told + [address for address, in cells(tmp_path, 'Address')] == [expected]


PLCS = '{},Tag,Address,Access\nPLC1,Run1,B3:0/1,RW\nPLC2,Run2,B3:0/1,RW\n'


@for_all('name', [
    'PLC', 'Controller', 'Node Name', 'Device', 'I/O Device', 'Device Name', 'Connection',
    'Channel', 'Machine', 'Line', 'Steuerung', 'Station', 'IP Address', 'Unit', 'Eng Units,Unit'])
def test_rows_of_two_plcs_do_not_go_to_one(tmp_path: Path, name: str) -> None:
    text = PLCS.format(name).replace('\nPLC', '\n,PLC' if ',' in name else '\nPLC')
    assert refusal(tmp_path, text) == (
        ': has rows of several PLCs: PLC1, PLC2; choose one with --plc NAME, or give the station '
        'of each with --station-of NAME=N,NAME=N; if a column of a list names no PLCs: --ignore '
        'COLUMN')
    many = 'Line,Tag,Address\n' + ''.join(f'{row},Run{row},B3:0/{row}\n' for row in range(9))
    assert ': 0, 1, 2, 3, 4 and 4 more; choose' in refusal(tmp_path, many)
    assert 'has rows of several PLCs' in refusal(tmp_path, text, Wanted(stations=(1, 2)))
    made(tmp_path, text, Wanted(node='PLC2', stations=(7,)))
    assert cells(tmp_path, 'Tag', 'Station') == [('Run2', '7')]
    made(tmp_path, text, Wanted(station_of={'PLC1': 3, 'PLC2': 4}))
    assert cells(tmp_path, 'Tag', 'Station') == [('Run1', '3'), ('Run2', '4')]
    result = made(tmp_path, text, Wanted(station_of={'PLC2': 4}))
    assert +result.ignored == {'rows of other PLCs': 1}
    assert refusal(tmp_path, text, Wanted(station_of={'PLC3': 4})) == (
        ': has no PLC "PLC3"; it has PLC1, PLC2')


def test_tags_of_one_name_get_the_name_of_their_plc(tmp_path: Path) -> None:
    text = PLCS.format('PLC').replace('Run1', 'Run').replace('Run2', 'Run')
    made(tmp_path, text, Wanted(station_of={'PLC1': 3, 'PLC2': 4}))
    assert cells(tmp_path, 'Tag', 'Station') == [('PLC1/Run', '3'), ('PLC2/Run', '4')]
    made(tmp_path, text.replace('PLC1', '1').replace('PLC2', '2').replace('PLC', 'Station'))
    assert cells(tmp_path, 'Tag', 'Station') == [('station_1/Run', '1'), ('station_2/Run', '2')]


def test_numbers_in_a_column_station_are_used(tmp_path: Path) -> None:
    text = 'Station,Tag,Address,Access\n1,Run1,B3:0/1,RW\n2,Run2,B3:0/1,RW\n'
    made(tmp_path, text)
    assert cells(tmp_path, 'Tag', 'Station') == [('Run1', '1'), ('Run2', '2')]
    assert 'several PLCs: 1, 2; choose' in refusal(tmp_path, text, Wanted(stations=(5,)))
    assert 'several PLCs: 1, "";' in refusal(tmp_path, text.replace('2,Run2', ',Run2'))
    assert 'several PLCs: 1, two;' in refusal(tmp_path, text.replace('2,Run2', 'two,Run2'))
    made(tmp_path, text, Wanted(node='2', stations=(5,)))
    assert cells(tmp_path, 'Tag', 'Station') == [('Run2', '5')]
    result = made(tmp_path, text.replace('\n2', '\n255'))
    assert [problem.text for problem in result.left_out] == [
        'Run2: Station = "255" should be a whole number from 0 to 254']
    # Two PLCs of one station number are on two lines.
    both = 'PLC,Station,Tag,Address\nPLC1,1,Run1,B3:0/1\nPLC2,1,Run2,B3:0/1\n'
    assert 'several PLCs: PLC1, PLC2' in refusal(tmp_path, both)
    both += 'PLC1,2,Run3,B3:0/1\n'
    assert 'several PLCs: PLC1, PLC2' in refusal(tmp_path, both)
    made(tmp_path, both.replace('PLC2,1', 'PLC2,3'))
    assert cells(tmp_path, 'Tag', 'Station') == [('Run1', '1'), ('Run2', '3'), ('Run3', '2')]


def test_column_that_only_repeats_a_plc_does_not_divide_it(tmp_path: Path) -> None:
    text = ('PLC,IP,Line,Tag,Address\nPLC1,10.0.0.1,A,Run1,B3:0/1\n'
            'PLC2,10.0.0.2,B,Run2,B3:0/1\nPLC1,10.0.0.1,C,Run3,B3:0/2\n')
    assert 'several PLCs: PLC1, PLC2; choose' in refusal(tmp_path, text)
    text = 'Channel,Device,Tag,Address\nA,P,Run1,B3:0/1\nB,P,Run2,B3:0/1\nB,Q,Run3,B3:0/1\n'
    assert 'several PLCs: P/A, P/B, Q/B; choose' in refusal(tmp_path, text)
    result = made(tmp_path, 'Line,Tag,Address,Access\nA,Run1,B3:0/1,RW\nB,Run2,B3:0/2,RW\n',
                  Wanted(ignored=('line',)))
    assert cells(tmp_path, 'Command') == [('ReadWrite',)] * 2
    assert result.notes == ['columns that are not used: Line']


def test_options_for_stations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / 'list.csv'
    source.write_text(PLCS.format('PLC'), encoding='utf-8')
    options = ['import', str(source), '--into', str(tmp_path / 'new')]
    assert main([*options, '--station-of', 'PLC1=3, PLC2=4']) == 0
    assert [line.split(',')[3] for line in (tmp_path / 'new' / 'map.csv').read_text().split()] == [
        'Station', '3', '4']
    for more in (['--station', '1'], ['--plc', 'PLC1']):
        assert main([*options, '--station-of', 'PLC1=3', *more]) == 2
        assert 'not together with --station or --plc' in capsys.readouterr().err
    for text in ('PLC1', '=3', 'PLC1=x', 'PLC1=255', 'A=1,A=2'):
        with pytest.raises(SystemExit):
            main([*options, '--station-of', text])
        assert 'should be NAME=N, each name once, with a station' in capsys.readouterr().err


@for_all(('access', 'command'), [
    ('R/W', 'ReadWrite'), ('Read Write', 'ReadWrite'), ('R/W.', 'ReadWrite'), ('W', 'Write'),
    ('Lesen/Schreiben', 'ReadWrite'), ('nur lesen', 'Read'), ('Lecture/Écriture', 'ReadWrite'),
    ('write protected', 'Read'), ('yes', 'Read'), ('1', 'Read'), ('Output', 'Read'), ('', 'Read'),
    ('!RW', 'Read'), ('R (no W)', 'Read')])
def test_words_of_access(tmp_path: Path, access: str, command: str) -> None:
    made(tmp_path, f'Tag,Address,Access,Description\na,N7:0,{access},x\n')
    assert cells(tmp_path, 'Command') == [(command,)]


@for_all(('head', 'row', 'command'), [
    ('Writable', 'yes', 'ReadWrite'), ('Writable', 'no', 'Read'), ('Writable', 'x', 'Read'),
    ('Read Only', 'ja', 'Read'), ('Read Only', 'nein', 'ReadWrite'), ('Read Only', '', 'Read'),
    ('Access,Read Only', 'RW,yes', 'Read'), ('Access,Writable', 'RW,', 'Read'),
    ('Access,Writable', 'W,yes', 'Write'), ('Access,Read Only', 'RW,no', 'ReadWrite')])
def test_all_columns_about_access_have_to_allow_writes(
        tmp_path: Path, head: str, row: str, command: str) -> None:
    made(tmp_path, f'Tag,Address,{head}\na,N7:0,{row}\n')
    assert cells(tmp_path, 'Command') == [(command,)]


@for_all(('text', 'kind'), [
    ('Signed_int_16', 'int16'), ('16 bit integer', 'int16'), ('Int2', 'int16'), ('S16', 'int16'),
    ('Unsigned 32-bit', 'uint32'), ('U16', 'uint16'), ('32-bit float', 'float32'),
    ('32 bit integer unsigned', 'uint32'), ('16bit', ''), ('SINT', ''), ('int16 int32', ''),
    ('unsigned signed 16', ''), ('double', ''), ('int64', '')])
def test_words_of_types(tmp_path: Path, text: str, kind: str) -> None:
    result = made(tmp_path, f'Tag,Address,Type\na,N7:0,{text}\nb,N7:2,INT\n')
    assert [cell for cell, in cells(tmp_path, 'Type')] == [*filter(None, [kind]), 'int16']
    assert len(result.left_out) == (not kind)


@for_all(('item', 'expected'), [
    ('[PLC]N7:20', ('N7:20', '1')), ('{::[PLC]N7:0}', ('N7:0', '1')),
    ('"N7:0,L1,C1"', ('N7:0', '1')), ('"N7:0,L10,C2"', ('N7:0', '10')),
    ("\"=RSLINX|PLC!'N7:0,L1,C1'\"", ('N7:0', '1')), ('ns=1;s=[PLC]B3:0/5', ('B3:0/5', '1')),
    ('N7:10 [8]', ('N7:10', '8'))])
def test_addresses_as_other_programs_write_them(
        tmp_path: Path, item: str, expected: tuple[str, str]) -> None:
    made(tmp_path, f'Tag,Address\na,{item}\n')
    assert cells(tmp_path, 'Address', 'Length') == [expected]
    other = f'Tag,Address\na,{item}\nb,[OTHER]N7:0\n'
    assert 'several PLCs: ' in refusal(tmp_path, other)


def test_numbers_of_elements_that_differ_are_a_fault(tmp_path: Path) -> None:
    result = made(tmp_path, 'Tag,Address,Length\na,N7:0 [8],4\nb,N7:0 [8],8\nc,N7:0,\n')
    assert [problem.text for problem in result.left_out] == [
        'a: has two numbers of elements, 4 and 8']
    assert cells(tmp_path, 'Length') == [('8',), ('1',)]


def test_names_of_columns_stand_below_titles_and_come_again(tmp_path: Path) -> None:
    text = ('Machine 4711 - list of variables;;;\nDate;28.11.2026;;\n;;;\n'
            'Tag;Address;Type;Comment\nSpeed;N7:0;INT;line speed\n;;;\nConveyor 2;;;\n'
            'Tag;Address;Type;Comment\nRun;B3:0/1;BOOL;runs\n'
            'Address;Tag;Access;Comment\nN7:9;Set;RW;other order\n')
    result = made(tmp_path, text)
    assert cells(tmp_path, 'Tag', 'Address', 'Command') == [
        ('Speed', 'N7:0', 'Read'), ('Run', 'B3:0/1', 'Read'), ('Set', 'N7:9', 'ReadWrite')]
    assert +result.ignored == {'lines with one cell, such as titles': 1}
    report = ',,,,App,\n,,,TAG REPORT,,\n,Name,Data Type,,Address,Access\n,Go,Boolean,,B3:0/0,R\n'
    made(tmp_path, report)
    assert cells(tmp_path, 'Tag', 'Address') == [('Go', 'B3:0/0')]


@for_all(('text', 'commands', 'remark'), [
    ('PLC 1,,\nRun1,B3:0/1,RW\nPLC 2,,\nRun2,B3:0/2,RW\n', ['Read', 'Read'],
     'titles between the rows, such as "PLC 1", may name other PLCs: made Read rows (one file for '
     'each PLC, or no titles)'),
    ('Run1,B3:0/1,RW\nStation,7,\nRun2,B3:0/2,RW\n', ['Read', 'Read'],
     'titles between the rows, such as "Station 7", may name other PLCs: made Read rows (one file '
     'for each PLC, or no titles)'),
    ('North,,\nRun1,B3:0/1,RW\nSouth,,\nRun2,B3:0/1,RW\nRun3,B3:0/3,RW\n', ['Read'] * 3,
     'titles between the rows, such as "North", may name other PLCs: made Read rows (one file for '
     'each PLC, or no titles)'),
    ('North,,\nRun1,B3:0/1,RW\nSouth,,\nRun2,B3:0/2,RW\n', ['ReadWrite', 'ReadWrite'], ''),
    ('PLC 1,,\nRun1,B3:0/1,RW\nRun2,B3:0/2,RW\n', ['ReadWrite', 'ReadWrite'], ''),
    ('P1.Run,B3:0/1,RW\nP2.Run,b3/001,RW\nRun3,B3:0/3,RW\n', ['Read', 'Read', 'ReadWrite'],
     'its address stands in another row, too, as if it were of another PLC: made Read rows')])
def test_rows_that_may_belong_to_several_plcs_only_read(
        tmp_path: Path, text: str, commands: list[str], remark: str) -> None:
    result = made(tmp_path, f'Tag,Address,Access\n{text}')
    assert [command for command, in cells(tmp_path, 'Command')] == commands
    assert next(iter(+result.remarks), '') == remark


@for_all(('text', 'expected'), [
    ('Protocol ID,Device Name,Tag Name,Data Type,Retentive,Address\n0,<INTERNAL>,Local,Discrete,'
     'FALSE,\n400,DEV1,Flow,Floating_PT_32,FALSE,F8:0\n400,DEV1,Count,BCD_int_16,FALSE,N7:0\n',
     [('Flow', 'F8:0', 'float32', 'Read'), ('Count', 'N7:0', 'bcd16', 'Read')]),
    ("'Variables\n'ID;Varname;Connection;Address;Length;InLo;InHi;OutLo;OutHi\n"
     '5;Run;slc;B3:0/1;0;0;0;0;0\n6;Speed;slc;N7:0;0;0;100;0;10\n',
     [('Run', 'B3:0/1', 'bool', 'Read'), ('Speed', 'N7:0', 'int16', 'Read')]),
    ('#Tag,Address,Access\nSet,N7:0,RW\n', [('Set', 'N7:0', 'int16', 'ReadWrite')]),
    ('Name;Connection;Data type;Length;Address\nSpeed;C1;Int;2;N7:0\nText;C1;String;82;ST9:0\n',
     [('Speed', 'N7:0', 'int16', 'Read'), ('Text', 'ST9:0', 'string', 'Read')]),
    ('Lfd. Nr.;Symbol;Operand;Datentyp;Schreibbar\n1;Soll;N7:10;INT;ja\n2;Ist;N7:11;INT;nein\n',
     [('Soll', 'N7:10', 'int16', 'ReadWrite'), ('Ist', 'N7:11', 'int16', 'Read')]),
    ('Repère;Adresse;Désignation;Lecture/Écriture\nVitesse;N7:0;x;L/E\nArret;B3:0/2;y;L\n',
     [('Vitesse', 'N7:0', 'int16', 'ReadWrite'), ('Arret', 'B3:0/2', 'bool', 'Read')]),
    ('Alias Name,Item Path,Read Only\nSpeed,CH1.PLC1.N7:0,0\n',
     [('Speed', 'N7:0', 'int16', 'ReadWrite')]),
    ('"Address","Name","Type","Offset","Scale","Write"\n"N7:0","Speed","int16","0","1","true"\n',
     [('Speed', 'N7:0', 'int16', 'ReadWrite')]),
    ('Tag,Command,Address,Word_Order,Type\nBig,ReadWrite,N7:2,High,int32\n',
     [('Big', 'N7:2', 'int32', 'ReadWrite')])])
def test_lists_of_other_programs(
        tmp_path: Path, text: str, expected: list[tuple[str, ...]]) -> None:
    made(tmp_path, text)
    assert cells(tmp_path, 'Tag', 'Address', 'Type', 'Command') == expected


def test_row_without_a_name_is_named_by_its_address(tmp_path: Path) -> None:
    result = made(tmp_path, 'Address,Tag,Description\nN7:0,,speed\nN7:1,Level,\n')
    assert cells(tmp_path, 'Tag', 'Description') == [('N7_0', 'speed'), ('Level', '')]
    assert result.remarks['has no name: named by its address'] == 1


@for_all(('text', 'tags', 'description'), [
    ('B12:10/0,0,,"IN AUTO","LIGHT","","","",0,,,0\nN22:64,0,ACK,"","","","","",0,,,0\n',
     ['B12_10/t0', 'ACK'], 'IN AUTO LIGHT'),
    ('N22:64,,ack\nN22:135,,width\n', ['ack', 'width'], ''),
    ('B3:0/0,ESTOP,"E-Stop","cell","","",0\nN7:1,SPEED,"Line","","","",0\n', ['ESTOP', 'SPEED'],
     'E-Stop cell'),
    ('"B003:000/06","RUN","IT","RUNS","","0","1"\n"N007:012","SPEED","LINE","","","0","1"\n',
     ['RUN', 'SPEED'], 'IT RUNS')])
def test_symbols_of_rslogix_in_other_forms(
        tmp_path: Path, text: str, tags: list[str], description: str) -> None:
    made(tmp_path, text)
    assert [tag for tag, in cells(tmp_path, 'Tag')] == tags
    assert cells(tmp_path, 'Command', 'Description')[0] == ('Read', description)


OLE = bytes.fromhex('D0CF11E0A1B11AE1')


@for_all(('name', 'text', 'told'), [
    ('a.xlsx', b'PK\x03\x04\x14', 'is a workbook or an archive; save what is in it as "CSV'),
    ('a.xls', OLE, 'is a workbook, or a project of some program; save what is in it as'),
    ('a.RSS', OLE, 'is a project of RSLogix; export its symbols there (Database, ASCII Export'),
    ('a.pdf', b'%PDF-1.4', 'is a document, without cells'),
    ('a.db', b'SQLite format 3\0', 'is a database or an archive'),
    ('a.xml', b'<?xml version="1.0"?>\n<tags/>', 'is XML or a page of a browser'),
    ('a.L5X', b'<?xml version="1.0"?>\n<RSLogix5000Content>', 'is a project of a Logix contr'),
    ('a.json', b'[{"type": "pccc endpoint", "vartable": [{"addr": "N7:0", "name": "a"}]}]',
     'is a flow of Node-RED; write the variables of its endpoint as a list'),
    ('a.json', b'{"project": {"common.ALLTYPES_NAME": "x", "servermain.TAG_ADDRESS": "N7:0"}}',
     'is a project of KEPServerEX in JSON; mark the device there, and take File, Export CSV'),
    ('a.json', b'{"tags": [{"address": "N7:0"}]}', 'is JSON, but no Export Tags of Ignition'),
    ('a.md', b'| Tag | Address |\n| --- | --- |\n| a | N7:0 |\n', 'is a table of markdown'),
    ('a.txt', b'Speed   N7:0   line speed\nRun  B3:0/1\n',
     'has addresses, but blanks or other signs between its cells; put commas between them'),
    ('net.csv', b'Com_Port,Baud,Station\n/dev/x,9600,0\n',
     'is a net file: it has the settings of a line, and no tags'),
    ('a.slc', b'PROJECT "x"\nLADDER 2\n', 'is the text of a program; export its symbols')])
def test_file_of_another_kind_is_told_by_its_sentence(
        tmp_path: Path, name: str, text: bytes, told: str) -> None:
    assert refusal(tmp_path, text, name=name).startswith(f': {told}')


@for_all(('code', 'remark'), [
    ('utf-8-sig', ''), ('utf-16', ''), ('utf-16-le', 'has UTF-16 text without a mark: read so'),
    ('utf-16-be', 'has UTF-16 text without a mark: read so')])
def test_encodings_of_unicode(tmp_path: Path, code: str, remark: str) -> None:
    result = made(tmp_path, 'Tag,Address,Comment\nSpeed,N7:0,Förderer\n'.encode(code))
    assert result.notes == [*filter(None, [remark])]
    assert cells(tmp_path, 'Description') == [('Förderer',)]


@for_all(('page', 'text'), [
    ('cp1251', 'Расход газа'), ('cp1251', 'ДАВЛЕНИЕ'), ('gbk', '水泵运行'),
    ('cp932', 'ポンプ運転'), ('cp1252', 'Förderband läuft größer')])
def test_code_pages_are_guessed_with_a_remark(tmp_path: Path, page: str, text: str) -> None:
    result = made(tmp_path, f'Tag,Address,Comment\na,N7:0,{text}\n'.encode(page))
    assert cells(tmp_path, 'Description') == [(text,)]
    assert result.notes == [f'is not UTF-8: read in code page {page}, a guess; if names are '
                            'wrong, save it as "CSV UTF-8"']


def test_thousands_in_a_file_with_semicolons_are_not_taken_for_fractions(tmp_path: Path) -> None:
    result = made(tmp_path, 'Tag;Address;Access;Max\na;N7:0;RW;1.500\nb;N7:1;RW;0.125\n'
                            'c;N7:2;RW;10,5\n')
    assert [problem.text for problem in result.left_out] == [
        'a: "1.500" could be two numbers; write 1500 or 1.500']
    assert cells(tmp_path, 'Max') == [('0.125',), ('10.5',)]
    made(tmp_path, 'Tag,Address,Access,Max\na,N7:0,RW,1.500\n')
    assert cells(tmp_path, 'Max') == [('1.5',)]


@for_all(('address', 'hint'), [
    ('07.Jan', 'a spreadsheet may have made a date or time of it'),
    ('0:2/5', '"0" stands where O should; write O:2/5'),
    ('l:1/0', '"L" stands where I should; write I:1/0'),
    ('N7–3', 'character 3 is U+2013 EN DASH, not "-"'), ("'N7:0", 'write N7:0')])
def test_damaged_addresses_get_a_hint_and_are_not_repaired(
        tmp_path: Path, address: str, hint: str) -> None:
    result = made(tmp_path, f'Tag,Address\na,{address}\nb,N7:1\n')
    assert hint in result.left_out[0].text
    assert cells(tmp_path, 'Tag') == [('b',)]


def test_inputs_and_outputs_of_intouch_are_left_out(tmp_path: Path) -> None:
    text = (':IODisc,Group,Comment,DConversion,AccessName,ItemUseTagname,ItemName,ReadOnly\n'
            'Run,,,Direct,PLC1,No,B3:0/5,No\nDoor,,,Direct,PLC1,No,I:1/12,No\n'
            'Turned,,,Reverse,PLC1,No,B3:0/6,No\n')
    result = made(tmp_path, text)
    assert cells(tmp_path, 'Tag', 'Command') == [('Run', 'ReadWrite')]
    assert [problem.text for problem in result.left_out] == [
        'Door: in items of InTouch, I and O may count bits in octal, and words through the image '
        'in place of slots; the file does not say which: write this row by hand',
        'Turned: DConversion "Reverse" has no counterpart']


def test_types_of_ignition_are_not_those_of_the_plc(tmp_path: Path) -> None:
    made(tmp_path, 'TagPath,OPCItemPath,DataType,ScanClass\n'
                   '[default]Tanks/Level,[MLX]N7:20,Int4,Direct\n')
    assert cells(tmp_path, 'Tag', 'Address', 'Type') == [('Tanks/Level', 'N7:20', 'int16')]


@for_all(('head', 'cell', 'told'), [
    ('Device', 'PLC2', 'has rows of several PLCs: PLC1, PLC2'),
    ('Machine', 'Press', 'has rows of several PLCs: PLC1, Press'), ('Converter', 'x10', 'Read')])
def test_columns_that_people_add_to_an_export_count(
        tmp_path: Path, head: str, cell: str, told: str) -> None:
    kepserver = (f'{head},Tag Name,Address,Data Type,Client Access,Scan Rate\n'
                 f'PLC1,Run1,B3:0/1,Boolean,R/W,100\n{cell},Run2,B3:0/1,Boolean,R/W,100\n')
    view = (f';Tag Type,Tag Name,Read Only,Data Source,Native Type,Address,{head}\n'
            f'D,Run1,F,D,,B3:0/1,PLC1\nD,Run2,F,D,,B3:0/1,{cell}\n')
    for text in (kepserver, view):
        if told == 'Read':
            assert made(tmp_path, text).remarks[f'column "{head}"{STRANGE}'] == 2
            assert cells(tmp_path, 'Command') == [('Read',)] * 2
        else:
            assert told in refusal(tmp_path, text)


def test_columns_of_short_rows_are_compared_as_they_stand(tmp_path: Path) -> None:
    text = 'Tag,Address,Access,Channel,Device\na,N7:0,RW,1,A\nb\nc,N7:0,RW,1,B\n'
    assert 'several PLCs: A, B;' in refusal(tmp_path, text)


def test_row_whose_plc_a_merged_cell_names_is_left_out_with_the_cure(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = 'PLC,Tag,Address\nA,x,N7:0\n,y,N7:1\nB,z,N7:2\n'
    cure = 'names no PLC: fill the cells below a name that a spreadsheet has merged'
    assert refusal(tmp_path, text).endswith(f'; a row {cure}')
    source = tmp_path / 'merged.csv'
    source.write_text(text, encoding='utf-8')
    assert main(['import', str(source), '--plc', 'A', '--into', str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert f'merged.csv:3: y: {cure}\n' in said.err
    assert 'ignored: 1 rows of other PLCs\n' in said.out


def test_descriptions_in_several_columns_are_joined(tmp_path: Path) -> None:
    text = ('Address\tSymbol\tAddress Description 1\tAddress Description 2\n'
            'N7:0\tSPEED\tBELT\tSPEED\n')
    result = made(tmp_path, text)
    assert result.lines[-1].endswith(',BELT SPEED') and not result.notes


def test_print_of_a_data_file_is_no_list(tmp_path: Path) -> None:
    head = 'Offset,0,1,2,3\n'
    assert 'has values beside addresses' in refusal(
        tmp_path, f'{head}N7:0,1200,800,0,-1\nN7:4,1,2,3,4\n')
    assert 'has values beside addresses' in refusal(tmp_path, 'F8:0,1.5,2\nF8:2,0,-7e3\n')


def test_family_is_not_advised_for_a_file_that_is_not_understood(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / 'labels.csv'
    source.write_text('Name,Address type,Address\nSpeed,N7,0\nTemp,F8,4\n', encoding='utf-8')
    assert main(['import', str(source), '--into', str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert 'Address type' in said and '--plc-type' not in said


def test_family_that_could_have_the_addresses_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / 'list.csv'
    source.write_text('Tag,Address\nTotal,020\nDone,110/17\n', encoding='utf-8')
    assert main(['import', str(source), '--into', str(tmp_path)]) == 1
    assert capsys.readouterr().err.splitlines()[-1].endswith(
        'no row can be used, 2 left out; nothing was written; --plc-type PLC2 can use 2 rows')


def test_input_of_a_list_without_its_word_is_only_read(tmp_path: Path) -> None:
    made(tmp_path, 'Tag,Address,Access\na,O:3/1,RW\nb,O:3.0/2,RW\n')
    assert cells(tmp_path, 'Tag', 'Command') == [('a', 'Read'), ('b', 'ReadWrite')]
