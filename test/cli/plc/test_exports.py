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
Maps made of exports; the contents of the rows are made up, their forms are not.

KEPServerEX: its 17 columns as Kepware ("CSV Import/Export"), Software Toolbox ("Comma Separated
Variable File Support") and PTC's Kepware.Api (CsvTagSerializer) list them; arrays and data types
as in the help of its drivers for Allen-Bradley ("Integer Files", "Data Types Description").
RSView32 and FactoryTalk View, InTouch: the first lines that programs which write such files use.

RSLogix 500: no header; address, scope, symbol, descriptions, and rows DFILE:, as two programs
read them: FactoryTalk Optix (RSLogix500_TagImporter) and a parser of exports of an SLC
(SLCTagParser).
"""

from collections.abc import Callable
import math
from pathlib import Path

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.exports.form import scaling, Unusable, Wanted, whole_length
from abdf1_ros.cli.plc.exports.imported import import_map
from abdf1_ros.paths import called
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import load_network
import pytest
from support.cases import for_all
from support.commands import call, made, Output, Said
from support.mappings import cell_of

KEPSERVER = (
    'Tag Name,Address,Data Type,Respect Data Type,Client Access,Scan Rate,Scaling,Raw Low,'
    'Raw High,Scaled Low,Scaled High,Scaled Data Type,Clamp Low,Clamp High,Eng Units,Description,'
    'Negate Value\n')
RSLOGIX = (
    '"I:1.0/3","Global","DOOR_CLOSED","Guard door","cell 2","","",""\n'
    '"N7:0","Global","LINE_SPEED","Conveyor","speed","","",""\n'
    '"T4:0","Global","","Cycle timer","","","",""\n'
    '"T4:1.ACC","Global","WAIT","","","","",""\n')

STATION_2 = Wanted(stations=(2,))


def imported(folder: Path, text: str | bytes,
             wanted: Wanted = STATION_2) -> tuple[list[Mapping], list[str]]:
    """Return the mappings of the map that is made, which has to be good, and what is left out."""
    result = made(folder, text, wanted, 'export.csv')
    mappings, _ = load_mappings(str(folder / 'map.csv'))
    return mappings, [str(problem).removeprefix(f'{folder / "export.csv"}:')
                      for problem in result.left_out]


@for_all(('row', 'expected'), [
    ('"Speed","N7:0",Short,1,R/W,100,,,,,,,,,,"",',
     {'Tag': 'Speed', 'Command': 'ReadWrite', 'Address': 'N7:0', 'Type': 'int16',
      'Period': '100'}),
    ('"Press.Motor.Run","B3:0/5",Boolean,1,RO,250,,,,,,,,,,"motor runs",',
     {'Tag': 'Press/Motor/Run', 'Topic': 'Press/Motor/Run', 'Type': 'bool', 'Period': '250',
      'Command': 'Read', 'Description': 'motor runs'}),
    ('"Recipe","N7:10 [8]",Word Array,1,WO,100,,,,,,,,,,"",',
     {'Address': 'N7:10', 'Length': '8', 'Type': 'uint16', 'Command': 'Write', 'Period': ''}),
    ('"Grid","N15:0 [4][5]",Short Array,1,RO,100,,,,,,,,,,"",', {'Length': '20'}),
    ('"Blanks","N15:0 [4] [5]",Short Array,1,RO,100,,,,,,,,,,"",', {'Length': '20'}),
    ('"Bits","N7/12 [9]",Boolean Array,1,RO,100,,,,,,,,,,"",',
     {'Address': 'N7:0/12', 'Length': '9'}),
    ('"Levels","F8:10 [16]",Float Array,1,Read Only,100,,,,,,,,,,"",',
     {'Length': '16', 'Type': 'float32', 'Command': 'Read'}),
    ('"Total","N7:10",DWord,1,RO,100,,,,,,,,,,"",', {'Type': 'uint32', 'Word_Order': 'Low'}),
    ('"Plain","ST9:1",String,1,RO,100,,,,,,,,,,"",', {'Type': 'string'}),
    ('"Tank","N7:20",Word,1,RO,100,Linear,0,32767,0,3276.7,Float,1,1,V,"level",',
     {'Scale': '0.1', 'Offset': '0', 'Min': '', 'Description': 'level [V]'}),
    ('"Set","N7:21",Short,1,R/W,100,Linear,4000,20000,-10,50,Float,0,1,degC,"",0',
     {'Scale': '0.00375', 'Offset': '-25', 'Min': '', 'Max': '50', 'Description': '[degC]'}),
    ('"Down","N7:22",Short,1,RO,100,Linear,0,100,2,12,Float,0,0,,"",1',
     {'Scale': '-0.1', 'Offset': '-2'}),
    ('"Back","N7:24",Short,1,R/W,100,Linear,0,100,0,10,Float,1,1,,"",1',
     {'Scale': '-0.1', 'Min': '-10', 'Max': '0'}),
    ('"Comma","N7:27",Short,1,R/W,100,Linear,0,100,"0,5","10,5",Float,0,1,,"",',
     {'Scale': '0.1', 'Offset': '0.5', 'Max': '10.5'}),
    ('"#1 pump","N7:25",Short,1,RO,100,,,,,,,,,,"",', {'Tag': '#1 pump', 'Topic': 't1_pump'}),
    ('"\x1b[1mBold\0","N7:26",Short,1,RO,100,,,,,,,,,,"a\x1bb",',
     {'Tag': '[1mBold', 'Description': 'a b'}),
    ('"Turned","N7:23",Short,1,RO,100,,,,,,,,,,"",1', {'Scale': '-1'})])
def test_tag_of_kepserver_becomes_a_row(
        tmp_path: Path, row: str, expected: dict[str, str]) -> None:
    (mapping,), left_out = imported(tmp_path, f'{KEPSERVER}{row}\n')
    assert left_out == []
    assert {column: cell_of(mapping, column) for column in expected} == expected
    assert (mapping.station, mapping.plc_type) == (2, PlcType.SLC)


@for_all(('row', 'expected'), [
    ('"Root","N7:0",Word,1,RO,100,Square Root,0,100,0,10,Float,0,0,,"",',
     'Scaling "Square Root" has no counterpart; Linear has'),
    ('"Flat","N7:0",Word,1,RO,100,Linear,5,5,0,10,Float,0,0,,"",',
     'the ends of its scale should be numbers, and both raw ones differ: 5, 5, 0, 10'),
    ('"Long","N7:0",Short,1,RO,100,Linear,0,"32,767",0,100,Float,0,0,,"",',
     '"32,767" could be two numbers; write 32767 or 32.767'),
    ('"Still","N7:0",Word,1,RO,100,Linear,0,100,7,7,Float,0,0,,"",', 'Scale should not be 0'),
    ('"Char","N7:0",Char,1,RO,100,,,,,,,,,,"",', 'Data Type "Char" has no counterpart'),
    (f'"Long","N7:0 [{"9" * 5000}]",Word Array,1,RO,100,,,,,,,,,,"",',
     'an address has at most 100 characters'),
    (f'"Word","N7:0",{"x" * 100},1,RO,100,,,,,,,,,,"",',
     f'Data Type "{"x" * 100}" has no counterpart'),
    (f'"Word","N7:0",{"x" * 5000},1,RO,100,,,,,,,,,,"",',
     f'Data Type "{"x" * 100}..." has no counterpart'),
    ('"Meter","400101",Word,1,RO,100,,,,,,,,,,"",',
     'write type, file, ":", element, as in N7:0, B3:1/5, T4:0.ACC or I:1.0/3'),
    ('"Empty","",Word,1,RO,100,,,,,,,,,,"",', 'Address is missing'),
    ('"---","N7:0",Word,1,RO,100,,,,,,,,,,"",', 'Tag = "---" has no letter or digit'),
    ('"Speed%","N7:5",Word,1,RO,100,,,,,,,,,,"",', 'the name Speed is that of line 2')])
def test_tag_that_cannot_be_used_is_left_out_and_stays_as_a_comment(
        tmp_path: Path, row: str, expected: str) -> None:
    first = '"Speed","N7:0",Short,1,R/W,100,,,,,,,,,,"",\n'
    mappings, left_out = imported(tmp_path, f'{KEPSERVER}{first}{row}\n')
    assert [mapping.tag for mapping in mappings] == ['Speed']
    tag = row.split(',')[0].strip('"')
    assert left_out == [f'3: {tag}: {expected}']
    assert f'# line 3: {row.split(",")[0].strip(chr(34))},' in (tmp_path / 'map.csv').read_text()


@pytest.mark.parametrize('head', [
    'time,station,address,tag,value,reason', 'time,topic,address,values'])
def test_log_of_values_is_no_list(tmp_path: Path, capsys: Output, head: str) -> None:
    path = tmp_path / 'shift.csv'
    path.write_text(f'{head}\n2026-03-01T14:05:09.250+01:00,1,N7:0,"speed",1200,\n')
    said = call(main, capsys, 'import', str(path), '--into', str(tmp_path))
    assert said == Said(
        2, '', f'plc: {path}:1: values, not a list of tags: "plc plot" draws them\n')


@for_all('ends', [
    ('', '5', '0', '9'), ('0', 'x', '0', '9'), ('0', '5', '-', '9'), ('0', '5', '0', '')])
def test_scale_has_four_numbers(ends: tuple[str, ...]) -> None:
    with pytest.raises(Unusable, match='the ends of its scale should be numbers, .* differ: 0?,'):
        scaling(ends)
    assert scaling(('0', '5', '0', '9'), -1.0) == {'Scale': '-1.8', 'Offset': '0'}  # not -0


def test_each_row_of_a_name_says_where_it_is_used(tmp_path: Path) -> None:
    rows = ''.join(f'"Speed","N7:{number}",Short,1,R/W,100,,,,,,,,,,"",\n' for number in range(3))
    fault = ': the name Speed is that of line 2'
    assert imported(tmp_path, KEPSERVER + rows)[1] == [f'{line}: Speed{fault}' for line in (3, 4)]
    assert (tmp_path / 'map.csv').read_bytes().decode().split('\n') == [
        'Tag,Command,Address,Station,PLC_Type,Length,Type,Period,Scale,Offset,Min,Max,Description',
        'Speed,ReadWrite,N7:0,2,SLC,,int16,100,,,,,',
        *(f'# line {row + 2}: Speed,N7:{row},Short,1,R/W,100,,,,,,,,,,,{fault}' for row in (1, 2)),
        '']


def test_symbols_of_rslogix_become_rows_and_the_rest_is_told(tmp_path: Path) -> None:
    rows = RSLOGIX + ('"DFILE:N7","files","","Numbers"\n"PLS10:0","Global","CAM"\n'
                      '"","Global","LOST"\n"PLS11:0","Global",""\n')
    mappings, left_out = imported(tmp_path, rows)
    assert [(mapping.tag, mapping.name, str(mapping.address), mapping.length, mapping.description)
            for mapping in mappings] == [
        ('DOOR_CLOSED', 'DOOR_CLOSED', 'I:1.0/3', 1, 'Guard door cell 2'),
        ('LINE_SPEED', 'LINE_SPEED', 'N7:0', 1, 'Conveyor speed'),
        ('T4_0', 'T4_0', 'T4:0', 3, 'Cycle timer'), ('WAIT', 'WAIT', 'T4:1.ACC', 1, '')]
    assert [text.split(': ')[:2] for text in left_out] == [
        ['6', 'CAM'], ['7', 'LOST'], ['8', 'PLS11:0']]
    assert left_out[1] == '7: LOST: Address is missing'
    assert not any(mapping.remarks for mapping in mappings)


def test_what_is_not_about_an_address_is_counted(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = RSLOGIX + ('"DFILE:N7","","","Numbers"\n"S:1/15","Global","","First Pass"\n'
                      '"S:4","Global","CLOCK","Free running clock"\n')
    mappings, left_out = imported(tmp_path, rows)
    assert [mapping.tag for mapping in mappings][4:] == ['CLOCK']
    source = str(tmp_path / 'export.csv')
    assert (left_out, import_map(source, STATION_2).ignored) == ([], {
        'DFILE rows': 1, 'rows of the status file without a symbol (--status takes them)': 1})
    assert main(['import', source, '--into', str(tmp_path / 'new'), '--status']) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        'ignored: 1 DFILE rows', f'written: {tmp_path}/new/map.csv: 6 rows']


def test_octal_addresses_are_for_a_plc5(tmp_path: Path) -> None:
    row = '"I:017/12","Global","DOOR"\n'
    (mapping,), left_out = imported(tmp_path, row, Wanted(PlcType.PLC5, (2,)))
    assert (str(mapping.address), left_out) == ('I:017/12', [])
    assert 'octal form of a PLC-5' in imported(tmp_path, row)[1][0]


@for_all(('rows', 'hint'), [
    ('a,I:001/00\nb,O:017/07\nc,N7:2\n', True), ('a,I:001/00\nb,I:1.0/3\nc,N7:2\n', False),
    ('a,I:008/00\nc,N7:2\n', False), ('a,N7:2\nb,N7:x\n', False)])
def test_family_that_can_use_the_rows_left_out_is_named(
        tmp_path: Path, capsys: Output, rows: str, hint: bool) -> None:
    source, into = tmp_path / 'plant.csv', tmp_path / str(len([*tmp_path.iterdir()]))
    source.write_text(f'Tag,Address\n{rows}', encoding='utf-8')
    assert main(['import', str(source), '--into', str(into)]) == 1
    said = capsys.readouterr().err
    assert (f'{source}: --plc-type PLC3 or PLC5 can use 3 rows\n' in said) is hint
    assert hint or 'can use' not in said


def test_text_of_windows_with_line_ends_in_cells_and_semicolons(tmp_path: Path) -> None:
    (mapping,), _ = imported(tmp_path, (
        KEPSERVER.replace(',', ';').replace('Eng ', 'Engineering ')
        + '"Höhe";"N7:0";Short;1;RO;100;;;;;;;;;mm;"Höhe\nlinks";\n'
    ).encode('cp1252').replace(b'ks', b'ks\x8F'))
    assert (mapping.tag, mapping.name, mapping.description) == (
        'Höhe', 'H_he', 'Höhe links\N{REPLACEMENT CHARACTER} [mm]')
    rows = ('"Up","N7:0",Short,1,RO,100,,,,,,,,,,"Up\nleft",\n'
            '"Down","?",Short,1,RO,100,,,,,,,,,,"Down\nleft",\n')
    assert imported(tmp_path, KEPSERVER + rows)[1][0].startswith('4: Down: ')


@pytest.mark.parametrize('code', [
    lambda text: text.encode('utf-16'), lambda text: text.replace(',', ', ').encode('utf-8-sig'),
    lambda text: text.replace('\n', '\r').encode(), lambda text: f'{text},,,\n'.encode(),
    lambda text: text.replace(',""\n', ',"; ; ; ; ; ; ; ; ;"\n').encode(),
    lambda text: text.replace('I:1.0/3', 'B3/5').encode(),
    lambda text: ('\ufeff' + text).encode('utf-16-be')])
def test_other_forms_of_text_are_read_as_well(
        tmp_path: Path, code: Callable[[str], bytes]) -> None:
    mappings, left_out = imported(tmp_path, code(RSLOGIX))
    assert ([mapping.name for mapping in mappings], left_out) == (
        ['DOOR_CLOSED', 'LINE_SPEED', 'T4_0', 'WAIT'], [])


def test_read_only_rows_of_several_stations_with_a_longer_period(tmp_path: Path) -> None:
    rows = ('"Speed","N7:0",Short,1,R/W,100,Linear,0,100,0,10,Float,1,1,,"",\n'
            '"Slow","N7:1",Short,1,RO,5000,,,,,,,,,,"",\n'
            '"Out","N7:2",Short,1,WO,100,,,,,,,,,,"",\n'
            '"Slow","N7:3",Short,1,RO,100,,,,,,,,,,"",\n')
    mappings, left_out = imported(
        tmp_path, KEPSERVER + rows, Wanted(stations=(1, 3), read_only=True, period=2000))
    assert [(row.topic, row.station, row.period) for row in mappings] == [
        ('station_1/Speed', 1, 2000), ('station_3/Speed', 3, 2000),
        ('station_1/Slow', 1, 5000), ('station_3/Slow', 3, 5000)]
    assert {(row.command.value, row.maximum) for row in mappings} == {('Read', math.inf)}
    assert left_out == ['4: Out: cannot be read, and --read-only is given',
                        '5: Slow: the name station_1/Slow is that of line 3']


def test_command_suggests_a_period_that_the_line_can_keep(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, net = tmp_path / 'tags.csv', tmp_path / 'net.csv'
    source.write_text(KEPSERVER + ''.join(
        f'"t{file}","N{file}:0 [100]",Short Array,1,RO,100,,,,,,,,,,"",\n'
        for file in range(10, 20)), encoding='utf-8')
    net.write_text('Com_Port,Baud\n/dev/x,9600\n', encoding='utf-8')
    options = ['import', str(source), '--into', str(tmp_path)]
    assert main(options) == 0
    told = capsys.readouterr().out.splitlines()[-1]
    assert told.startswith('these rows need ') and told.endswith('--period 5000 would be enough')
    (tmp_path / 'map.csv').unlink()
    assert main([*options, '--period', '5000']) == 0
    assert 'would be enough' not in capsys.readouterr().out
    (tmp_path / 'map.csv').unlink()
    assert main(['import', str(source), '--into', str(source)]) == 2
    assert f'{source} is not a folder' in capsys.readouterr().err


def test_command_writes_a_map_once_and_says_how_to_go_on(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    source, target = tmp_path / 'symbols.csv', tmp_path / 'line' / 'map.csv'
    source.write_text(f'{RSLOGIX}"DFILE:N7","","","Numbers"\n', encoding='utf-8')
    options = ['import', str(source), '--into', str(target.parent), '--station', '3']
    assert main(options) == 0
    assert capsys.readouterr().out.splitlines() == [
        'ignored: 1 DFILE rows', f'written: {target}: 4 rows',
        f'next: {called("check")} net.csv {target}',
        f'net.csv is not there yet: {called("plc")} init --into ANOTHER_FOLDER makes one']
    assert {mapping.station for mapping in load_mappings(str(target))[0]} == {3}
    assert main(options) == 2
    assert f'{target}: exists already' in capsys.readouterr().err
    source.write_text(f'{RSLOGIX}"N7:999",,"FAR"\n', encoding='utf-8')
    other = tmp_path / 'other' / 'map.csv'
    assert main([*options[:3], str(tmp_path / 'third')]) == 1
    capsys.readouterr()
    (tmp_path / 'net.csv').write_text('Station\n5\n', encoding='utf-8')
    assert main([*options[:3], str(other.parent)]) == 1
    said = capsys.readouterr()
    assert f'{source}:5: ' in said.err
    assert said.out.splitlines()[1:] == [
        f'next: {called("check")} net.csv {other}',
        'these rows need 205% of the time of the line in net.csv; --period 500 would be enough']


@for_all(('text', 'expected'), [
    ('a,b\n1,2\n', 'is none of these: tags of KEPServerEX '), ('', 'the file is empty'),
    # What the columns of a list without a header mean is not guessed.
    ('N7:0,SPEED OF LINE,x\n', 'has addresses, but no first row with names: write one, such as '),
    ('N7:0,Global,SPEED\nN7:1,2,LEVEL\n', 'has addresses, but no first row with names'),
    ('N7:0,RUN\nN7:1,RUN\n', 'has addresses, but no first row with names'),
    *(('"N7:0"X"Débit, eau"X""X"l; mm"\n"N7:1"X"Niveau"X""X""\n'.replace('X', sign),
       'has addresses, but no first row with names') for sign in ',;\t'),
    ('Tag,Command,Address,Station,PLC_Type\na,Read,N7:0,1,SLC\n', 'is a map already'),
    ('Tag,Command,Address,Station,PLC_Type,Via\na,Read,N7:0,1,SLC,\n', 'is a map already'),
    (f'Tag,Address\n{"x" * 200_000},N7:0\n', 'export.csv:2: field larger than field limit'),
    ('Address,Function\nN7:0,Speed\n', 'which column is the tag. Say --tag COLUMN; columns: '
                                       'Address, Function'),
    ('Name,Place\nSpeed,N7:0\n', 'which column is the address. Say --address COLUMN')])
def test_what_is_no_export(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(ConfigurationError, match=expected):
        imported(tmp_path, text)


def told(mappings: list[Mapping]) -> list[tuple[str, ...]]:
    return [(row.tag, row.command.value, str(row.address), row.description) for row in mappings]


def test_columns_of_a_list_are_found_by_their_names(tmp_path: Path) -> None:
    symbols = 'Address,Symbol,Description\nN7:0,SPEED,a;b;c;d;e;f;g;h\nB3:0/5,RUN,\n'
    assert told(imported(tmp_path, symbols)[0]) == [
        ('SPEED', 'Read', 'N7:0', 'a;b;c;d;e;f;g;h'), ('RUN', 'Read', 'B3:0/5', '')]
    drawing = ('sep=;\nAddress;Description 1;Description 2;Wire No;Name;Device Tag;Comment\n'
               'I:1.0/0;START;;1000;Button;PB100;CONVEYOR\n')
    assert told(imported(tmp_path, drawing)[0]) == [('PB100', 'Read', 'I:1.0/0', 'START CONVEYOR')]
    access = ('Tag Name,Data Type,Address,Read Only\na,INT,N7:0,no\nb,DINT,N7:2,Yes\n'
              'c,Real,F8:0,R/W\nd,Word,N7:4,perhaps\ne,LWORD,N7:5,no\n')
    mappings, left_out = imported(tmp_path, access)
    assert [(row.tag, row.command.value, row.type.value) for row in mappings] == [
        ('a', 'ReadWrite', 'int16'), ('b', 'Read', 'int32'), ('c', 'ReadWrite', 'float32'),
        ('d', 'Read', 'uint16')]
    assert len(left_out) == 1 and left_out[0].startswith(
        '6: e: Data Type "LWORD" has no counterpart (--ignore ')
    assert +import_map(str(tmp_path / 'export.csv'), STATION_2).remarks == {
        'Read Only "perhaps" says nothing of access: made Read rows': 1,
        'which of its two words comes first is not in the file: made Read rows (a column Word '
        'Order: Low or High)': 1}
    assert len(+import_map(str(tmp_path / 'export.csv'), Wanted(read_only=True)).remarks) == 1


def test_list_that_says_nothing_of_access_is_only_read(tmp_path: Path) -> None:
    text = 'Tag Name,Data Type,Address,Comment\nSPEED,Short,N7:0,read by the panel\n'
    assert told(imported(tmp_path, text)[0]) == [('SPEED', 'Read', 'N7:0', 'read by the panel')]
    assert import_map(str(tmp_path / 'export.csv'), Wanted()).remarks == {
        'the file has no column about access: made Read rows (--access COLUMN)': 1}
    empty = KEPSERVER + '"Speed","N7:0",Short,1,,100,,,,,,,,,,"",\n'
    assert told(imported(tmp_path, empty)[0]) == [('Speed', 'Read', 'N7:0', '')]
    assert import_map(str(tmp_path / 'export.csv'), Wanted()).remarks == {
        'Client Access is empty: made Read rows': 1}


# Lists of public reports, which test/lab/field.md names.
@for_all(('text', 'rows'), [
    ('name;type;memaddress;scaleMin\nSpeed;INT;N7:0;0\n', [('Speed', 'Read', 'N7:0', '')]),
    ('Tag Name,Address\na,N7:0\nb,N7:0\n',
     [('a', 'Read', 'N7:0', ''), ('b', 'Read', 'N7:0', '')]),
    ('Tag Name,Address,Description\na,N7:0,"say ""stop"",\nthen go"\nb,N7:1,\n',
     [('a', 'Read', 'N7:0', 'say "stop", then go'), ('b', 'Read', 'N7:1', '')])])
def test_lists_of_public_reports_become_rows(
        tmp_path: Path, text: str, rows: list[tuple[str, ...]]) -> None:
    mappings, left_out = imported(tmp_path, text)
    assert (told(mappings), left_out) == (rows, [])


@for_all(('cell', 'cure'), [
    ('"=""I:017"""', 'signs that only a spreadsheet needs: write I:017'),
    ("'I:017", 'signs that only a spreadsheet needs: write I:017'), ('1F', 'as in N7:0')])
def test_address_with_signs_of_a_spreadsheet_is_left_out(
        tmp_path: Path, cell: str, cure: str) -> None:
    mappings, (fault,) = imported(tmp_path, f'Tag Name,Address\na,{cell}\n')
    assert not mappings and cure in fault


def test_columns_of_a_list_are_given_by_options(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / 'list.csv'
    source.write_text('Place,What,Kind,Text,May,Tag\nN7:0,speed,INT,Speed of 1,RW,7\n'
                      'N7:1,up,INT,,yes,8\n', 'utf-8')
    options = ['import', str(source), '--into', str(tmp_path), '--address', 'Place',
               '--type', 'Kind', '--access', 'may']
    assert main([*options, '--tag', 'Name']) == 2
    assert '--tag "Name" is not a column; columns: Place, What' in capsys.readouterr().err
    assert main([*options, '--tag', 'what', '--description', 'Text']) == 0
    assert capsys.readouterr().err == (
        f'plc: {source}: columns that are not used: Tag\n'
        'plc: 1 row: May "yes" says nothing of access: made Read rows\n')
    assert told(load_mappings(str(tmp_path / 'map.csv'))[0]) == [
        ('speed', 'ReadWrite', 'N7:0', 'Speed of 1'), ('up', 'Read', 'N7:1', '')]


def test_characters_of_an_a_file_are_not_taken_for_words(tmp_path: Path) -> None:
    rows = [('"a","A62:4/32",String', ''), ('"b","A62:0/5",String', 'or an even number'),
            ('"c","A27:10 [80]",Char Array', 'read A27:5 as uint16 instead'),
            ('"d","A9:20",Default', 'A9:20 counts characters, two in a word; read A9:10'),
            ('"e","A9:21/4",String', 'read A9:10 as uint16')]
    text = KEPSERVER + ''.join(f'{row},1,R/W,100,,,,,,,,,,"",\n' for row, _ in rows)
    (mapping,), left_out = imported(tmp_path, text)
    assert (str(mapping.address), mapping.length, mapping.type.value) == ('A62:2', 16, 'string')
    assert len(left_out) == 4 and all(
        text in fault for (_, text), fault in zip(rows[1:], left_out, strict=True))


def test_input_or_output_that_may_be_of_a_micrologix_is_only_read(tmp_path: Path) -> None:
    text = KEPSERVER + '"Out","O:1",Word,1,R/W,500,,,,,,,,,,"",\n' \
        '"Bit","O:2/3",Boolean,1,R/W,500,,,,,,,,,,"",\n' \
        '"Sure","O:2.0",Word,1,R/W,500,,,,,,,,,,"",\n'
    assert [row[1] for row in told(imported(tmp_path, text)[0])] == ['Read', 'Read', 'ReadWrite']
    result = import_map(str(tmp_path / 'export.csv'), Wanted())
    assert [(text.partition(',')[0], count) for text, count in result.remarks.items() if text] == [
        ('an input or output without its word', 2)]
    text = KEPSERVER + '"Out","O:001",Word,1,R/W,500,,,,,,,,,,"",\n'
    assert told(imported(tmp_path, text, Wanted(PlcType.PLC5))[0])[0][1] == 'ReadWrite'


VIEW = (';Tag Type, Tag Name, Tag Description, Read Only, Data Source, Security Code, Alarmed, {} '
        'Native Type, Value Type, Min Analog, Max Analog, Initial Analog, Scale, Offset, '
        'DeadBand, Units, Off Label Digital, On Label Digital, Initial Digital, Length String, '
        'Initial String, {} Address\n;###001 - VERSION\n\n;Folders Section\n'
        '"F","Press","","F"\n\n')


@for_all('text', [
    VIEW.format('Data Logged,', 'Node Name,')
    + '"A","Press\\Speed","Speed, left","F","D","*","F","F","D","F",0,100,0,0.1,-5,0,"1/min",,,,,,'
      '"PLC1","N7:0","A"\n"D","Press\\Run","","T","D","*","F","F",,,,,,,,,,"Off","On","Off",,,'
      '"PLC1","B3:0/5","A"\n"A","mem","","F","M","*","F","F","D","F",0,1,0,1,0,0,,,,,,,,,\n'
      '"A","Level","","","D","*","F","F","D","F",0,100,0,1,0,0,,,,,,,"PLC1","N7:1","A"\n',
    VIEW.format('', 'Retentive,')
    + '"a","Press\\Speed","Speed, left","F","D","*","F","D","F",0,100,0,0.1,-5,0,"1/min",,,,,,0,'
      '"::[PLC1]N7:0"\nD,"Press\\Run",,"T","D","*","F",,,,,,,,,,"Off","On","Off",,,,'
      '"{[PLC1]B3:0/5}"\n"S","mem","","F","M","*","F",,,,,,,,,,,,,82,"",0,\n'
      '"A","Level","","","D","*","F","D","F",0,100,0,1,0,0,,,,,,,0,"[PLC1]N7:1"\n'])
def test_tags_of_rsview_and_factorytalk(tmp_path: Path, text: str) -> None:
    mappings, left_out = imported(tmp_path, text)
    assert (told(mappings), left_out) == ([
        ('Press/Speed', 'ReadWrite', 'N7:0', 'Speed, left [1/min]'),
        ('Press/Run', 'Read', 'B3:0/5', ''), ('Level', 'Read', 'N7:1', '')], [])
    assert (mappings[2].scaling, mappings[2].remarks) == (None, ())
    assert {column: cell_of(mappings[0], column) for column in ('Scale', 'Offset', 'Min', 'Max')
            } == {'Scale': '0.1', 'Offset': '-5', 'Min': '0', 'Max': '100'}
    result = import_map(str(tmp_path / 'export.csv'), Wanted(period=700))
    assert +result.ignored == {'tags without a PLC (memory and system)': 1}
    assert result.lines[1] == 'Press/Run,Read,B3:0/5,1,SLC,,,700,,,,,'
    bad = text.replace(',0.1,', ',ten,').replace('"D","F",0,100,0,1,', '"X","F",0,100,0,1,')
    assert imported(tmp_path, bad)[1] == ['7: Press/Speed: "ten" should be a number',
                                          '10: Level: Native Type "X" has no counterpart']
    text = text.replace('"PLC1","N7:1"', '"PLC2","N7:1"').replace('[PLC1]N7:1', '[PLC2]N7:1')
    with pytest.raises(ConfigurationError, match='rows of several PLCs: PLC1, PLC2'):
        imported(tmp_path, text)
    bad = bad.replace('"PLC1","N7:1"', '"PLC2","N7:1"').replace('[PLC1]N7:1', '[PLC2]N7:1')
    assert len(imported(tmp_path, bad, Wanted(node='PLC1'))[1]) == 1


INTOUCH = (
    ':mode=ask\n:IOAccess,Application,Topic\n"PLC1","DASABCIP","Line1"\n'
    ':MemoryInt,Group,Comment\n"Count","$System","in memory"\n'
    ':IODisc,Group,Comment,AccessName,ItemUseTagname,ItemName,ReadOnly\n'
    '"Run","$System","motor runs","PLC1",No,"B3:0/5",No\n'
    ':IOInt,Group,Comment,MinEU,MaxEU,MinRaw,MaxRaw,Conversion,AccessName,ItemUseTagname,ItemName,'
    'ReadOnly\n"Speed","$System","speed",0,100,0,1000,Linear,"PLC1",No,"N7:0",No\n'
    '"N7:1","$System","","0",10,0,10,,"PLC1",Yes,"",Yes\n')


def test_tags_of_intouch(tmp_path: Path) -> None:
    for kind in ('Disc', 'Int', 'Real', 'Msg'):
        text = INTOUCH.replace('IODisc', f'IO{kind}').replace('IOInt', f'IO{kind}')
        mappings, left_out = imported(tmp_path, text.replace(',', ';'))
        assert (told(mappings), left_out) == ([
            ('Run', 'ReadWrite', 'B3:0/5', 'motor runs'), ('Speed', 'ReadWrite', 'N7:0', 'speed'),
            ('N7:1', 'Read', 'N7:1', '')], [])
        assert [cell_of(mappings[1], column) for column in ('Scale', 'Max')] == ['0.1', '100']
        assert mappings[2].scaling is None
        assert [str(remark)[-5:] for remark in mappings[2].remarks] == [' N7_1']
    unknown, _ = imported(tmp_path, INTOUCH.replace(',No\n', ',\n'), Wanted(period=700))
    assert {(row.command.value, row.period) for row in unknown} == {('Read', 700)}
    assert imported(tmp_path, INTOUCH.replace('Linear', 'Square Root'))[1] == [
        '9: Speed: Conversion "Square Root" has no counterpart; Linear has']
    assert imported(tmp_path, INTOUCH.replace('100,0,1000', '100,,1000'))[1] == [
        '9: Speed: the ends of its scale should be numbers, and both raw ones differ: '
        ', 1000, 0, 100']
    assert cell_of(imported(tmp_path, INTOUCH.replace('Yes\n', 'No\n'))[0][2], 'Max') == '10'
    assert +import_map(str(tmp_path / 'export.csv'), Wanted()).ignored == {
        'tags without a PLC (memory, groups, trends)': 1}


def test_rows_of_several_plcs_are_not_mixed(tmp_path: Path) -> None:
    text = INTOUCH.replace('Linear', 'Square Root') \
        + '"Other","$System","",0,1,0,1,Linear,"PLC2",No,"N7:0",No\n'
    with pytest.raises(ConfigurationError, match='rows of several PLCs: PLC1, PLC2; .* --plc'):
        imported(tmp_path, text)
    (mapping,), left_out = imported(tmp_path, text, Wanted(node='PLC2'))
    assert (mapping.tag, left_out) == ('Other', [])
    ignored = import_map(str(tmp_path / 'export.csv'), Wanted(node='PLC2')).ignored
    assert ignored['rows of other PLCs'] == 3
    assert main(['import', str(tmp_path / 'export.csv'), '--into', str(tmp_path / 'new'), '--plc',
                 'PLC2', '--read-only', '--period', '900', '--station', '2-3']) == 0
    assert (tmp_path / 'new' / 'map.csv').read_text('utf-8').splitlines()[1:] == [
        f'station_{number}/Other,Read,N7:0,{number},SLC,,,900,,,,,' for number in (2, 3)]
    for node in ('X', ''):
        with pytest.raises(ConfigurationError, match=f'has no PLC "{node}"; it has PLC1, PLC2'):
            imported(tmp_path, text, Wanted(node=node))
    text = INTOUCH + '"None","$System","",0,1,0,1,Linear,"",No,"N7:0",No\n'
    with pytest.raises(ConfigurationError, match='rows of several PLCs: PLC1, "";'):
        imported(tmp_path, text)
    assert 'None' not in [row.tag for row in imported(tmp_path, text, Wanted(node='PLC1'))[0]]


def test_nothing_is_left_behind_where_no_row_can_be_used(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, target = tmp_path / 'tags.csv', tmp_path / 'map.csv'
    source.write_text('Tag,Address\na,DB1.DBW0\n', encoding='utf-8')
    assert main(['import', str(source), '--into', str(tmp_path)]) == 1
    assert 'no row can be used, 1 left out; nothing was written' in capsys.readouterr().err
    assert not target.exists()
    target.write_text('x', encoding='utf-8')
    assert main(['import', str(tmp_path / 'nothere.csv'), '--into', str(tmp_path)]) == 2
    assert 'nothere.csv: cannot be read' in capsys.readouterr().err


def test_export_in_place_of_a_map_or_net_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / 'tags.csv'
    path.write_text(f'{KEPSERVER}"Speed","N7:0",Short,1,R/W,100,,,,,,,,,,"",\n', encoding='utf-8')
    for load in (load_mappings, load_network):
        with pytest.raises(ConfigurationError) as caught:
            load(str(path))
        assert str(caught.value) == (
            f'{path}: is an export of KEPServerEX; "plc import {path}" makes a map of it')
    path.write_text(RSLOGIX, encoding='utf-8')
    with pytest.raises(ConfigurationError, match='export of symbols from RSLogix .*plc import'):
        load_mappings(str(path))


IGNITION = """\
{"tagType": "Provider", "tags": [
  {"name": "Line 1", "tagType": "Folder", "tags": [
    {"name": "Speed", "tagType": "AtomicTag", "valueSource": "opc", "dataType": "Int4",
     "opcServer": "Ignition OPC UA Server", "opcItemPath": "ns=1;s=[MLX]N7:0", "readOnly": false,
     "documentation": "Conveyor\\nnorth", "engUnit": "m/min", "scaleMode": "Linear", "rawLow": 0,
     "rawHigh": 100, "scaledLow": 0.0, "scaledHigh": 10.0},
    {"name": "Shown", "tagType": "AtomicTag", "valueSource": "expr", "value": 1},
    {"name": "Dry", "tags": [{"name": "Wait", "valueSource": "opc", "scaleMode": "Off",
                              "opcItemPath": "[MLX]T4:1.ACC"}]}]},
  {"name": "Root", "valueSource": "opc", "scaleMode": "SquareRoot", "opcItemPath": "[MLX]N7:1"},
  {"name": "Any", "valueSource": "opc", "opcItemPath": {"bindType": "parameter"}}]}
"""


def test_tags_of_ignition(tmp_path: Path) -> None:
    other = IGNITION.replace('[MLX]N7:1', '[SLC]N7:1').replace('  {', '\t{').replace(
        '"rawHigh": 100', '"rawHigh": 16.384')
    assert 'Line 1/Speed' in imported(tmp_path, other, Wanted(node='MLX'))[0][0].tag
    assert [text[:3] for text in imported(tmp_path, other, Wanted(node='MLX'))[1]] == ['11:']
    (speed, wait), left_out = imported(tmp_path, IGNITION)
    assert [cell_of(speed, column) for column in (
        'Tag', 'Command', 'Address', 'Type', 'Scale', 'Offset', 'Description')] == [
            'Line 1/Speed', 'ReadWrite', 'N7:0', 'int16', '0.1', '0', 'Conveyor north [m/min]']
    assert [cell_of(wait, column) for column in ('Tag', 'Command', 'Address')] == [
        'Line 1/Dry/Wait', 'Read', 'T4:1.ACC']
    assert left_out == [
        '10: Root: scaleMode "SquareRoot" has no counterpart; Linear has',
        '11: Any: opcItemPath "{"bindType": "parameter"}" has no address, as in ns=1;s=[PLC]N7:0']
    result = import_map(str(tmp_path / 'export.csv'), Wanted(read_only=True, period=700))
    assert result.lines[0] == 'Line 1/Speed,Read,N7:0,1,SLC,,,700,0.1,0,,,Conveyor north [m/min]'
    assert +result.ignored == {'tags that are not of a PLC': 1}
    result = import_map(str(tmp_path / 'export.csv'), Wanted())
    assert +result.remarks == {'readOnly is empty: made Read rows': 1}


def test_json_of_something_else_is_no_file_of_ignition(tmp_path: Path) -> None:
    for text in ('{"opcItemPath"', '[' * 100_000 + '"opcItemPath"', '{"tags": []}'):
        with pytest.raises(ConfigurationError, match='is JSON, but no Export Tags of Ignition'):
            imported(tmp_path, text)


def test_tags_in_too_many_folders_are_passed_over(tmp_path: Path) -> None:
    tag = '{"name": "a", "valueSource": "opc", "opcItemPath": "[P]N7:0"}'
    for folders, tags in ((49, ['a']), (50, []), (300, [])):
        text = '[' + '{"tags": [' * folders + tag + ']}' * folders + ']'
        assert [row.tag for row in imported(tmp_path, text)[0]] == tags


def test_list_with_comments_and_whole_timers(tmp_path: Path) -> None:
    rows, left_out = imported(tmp_path, (
        9 * '; of the press\n' + 'Symbol,Address,Description,DataType,Scope\n# global\n'
        'SPEED,N7:0,Conveyor,INT,Global\nMIX,T4:0,,TIMER,Global\nWAIT,T4:1.ACC,,,\n'
        'LEVEL,F8:0,,,\n'), Wanted(period=700))
    assert left_out == [] and [
        (row.tag, str(row.address), row.length, row.period) for row in rows] == [
            ('SPEED', 'N7:0', 1, 700), ('MIX', 'T4:0', 3, 700), ('WAIT', 'T4:1.ACC', 1, 700),
            ('LEVEL', 'F8:0', 1, 700)]
    # A PD element of a PLC-5 has floats, too.
    assert [whole_length('PD9:0', kind) for kind in (PlcType.SLC, PlcType.PLC5)] == ['23', '']


@pytest.mark.parametrize('text, told', [
    ('N7:35,Speed of line\nB3:0/0,Start\n', 'has addresses, but no first row with names: write '
                                            'one, such as Address,Tag'),
    ('remark,"CSV-Import-Export"\n0.3\nTYPE,SCOPE,NAME\nTAG,,Speed\n',
     'has tags of a Logix controller, which are not addresses')])
def test_file_that_is_not_known_is_told_with_a_cure(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        imported(tmp_path, text)
    assert told in str(caught.value)


def test_file_with_more_rows_than_a_map_may_have_is_refused(tmp_path: Path) -> None:
    rows = [f'tag_{number},N7:{number % 200}' for number in range(5001)]
    path = tmp_path / 'list.csv'
    path.write_text('\n'.join(['Tag,Address', *rows[:5000]]))
    assert import_map(str(path), Wanted()).count == 5000
    path.write_text('\n'.join(['Tag,Address', *rows]))
    with pytest.raises(ConfigurationError, match='list.csv:5002: .* more than 5000 rows of a map'):
        import_map(str(path), Wanted())
