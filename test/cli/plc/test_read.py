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

"""The command ``plc read`` on a simulated line."""

from pathlib import Path
import signal

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.parser import make_parser
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.plc.targets import to_read
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import Network
import pytest
from support.commands import call, FAST, Output, PATIENT, Plc, running_simulator, Said
from support.ptys import Pty, wait_until
from support.ros import Process, write_csv


@pytest.mark.parametrize('station, address, options, lines', [
    (1, 'B3:0/2', ('--length', '6'), ['B3:0/2 /2=1 /3=0 /4=0 /5=1 /6=1 /7=0']),
    (1, 'I:017/12', (), ['I:017/12 1']), (1, 'I:017', (), ['I:017 1024']),
    (1, 'N7:0', ('--length', '2'), ['N7:0 1200 -800']),
    (1, 'F8:0', ('--length', '3'), ['F8:0 12.5 40.25 -3.5']),
    (1, 'A10:0', ('--type', 'string', '--length', '3'), ["A10:0 'abc'"]),
    (1, 'N7:6', ('--type', 'uint32', '--word-order', 'high'), ['N7:6 65538']),
    (1, 'T4:0-1', (), ['T4:0 0', 'T4:0.PRE 0', 'T4:0.ACC 0', 'T4:1 8192 DN', 'T4:1.PRE 500',
                       'T4:1.ACC 120']),
    (1, 'T4:1', (), ['T4:1 8192 DN', 'T4:1.PRE 500', 'T4:1.ACC 120']),
    (1, 'T4:1.ACC', (), ['T4:1.ACC 120']),
    (1, 'N7:0-1', ('--radix', 'bin'), ['N7:0 0000010010110000 /4 /5 /7 /10',
                                       'N7:1 1111110011100000 /5 /6 /7 /10 /11 /12 /13 /14 /15']),
    (1, 'T4:1', ('--length', '2'), ['T4:1 8192 DN', 'T4:1.PRE 500']),
    (1, 'I:017', ('--radix', 'bin'), ['I:017 0000010000000000 /12']),
    (1, 'T4:1/DN', (), ['T4:1/DN 1']), (2, 'C5:2.ACC', (), ['C5:2.ACC -17']),
    (2, 'I:1.0', ('--length', '2'), ['I:1.0 5 40960']), (2, 'O:2.0/4', (), ['O:2.0/4 1']),
    (2, 'L10:0', ('--length', '2'), ['L10:0 -70000 2000000000']),
    (2, 'N7:40', ('--type', 'int32'), ['N7:40 131071']),
    (2, 'N7:30', ('--type', 'bcd16', '--length', '2'), ['N7:30 1234 99']),
    (2, 'N7:10', ('--length', '3', '--radix', 'HEX'), ['N7:10 0065 0066 0067']),
    (2, 'ST9:1', (), ["ST9:1 'Tank 4'"]), (2, 'F8:4', (), ['F8:4 21.5'])])
def test_read_shows_address_and_values(
        plc: Plc, station: int, address: str, options: tuple[str, ...], lines: list[str]) -> None:
    said = plc('read', address, '--station', str(station), *options)
    assert (said.status, said.lines, said.err) == (0, lines, '')


@pytest.mark.parametrize(('args', 'hint'), [
    (('2', 'N7:0'), '; a station is given with --station 2'),
    (('N7:0', '2'), '; a station is given with --station 2'),
    (('N7:0,N7:1',), '; several addresses stand apart: N7:0 N7:1'),
    (('N7:0;N7:1',), '; several addresses stand apart: N7:0 N7:1'),
    (('N7:0 B3:0/1',), '; several addresses stand apart: N7:0 B3:0/1'),
    (('line_speed',), 'if line_speed is a tag, give its map'), (('N7',), ''),
    (('N7:0,x',), ''), (('--csv', 'N7:0'), 'plc read: error: "plc watch --csv --count 1" prints '
                        'values for programs'),
    (('N7:0', '--format', 'json'), 'plc read: error: "plc log --format jsonl --count 1" prints '
     'values for programs'),
    (('N7:0', '--json'), 'plc read: error: "plc log --format jsonl --count 1" prints values for '
     'programs')])
def test_mistaken_words_lead_to_the_right_ones(
        capsys: Output, args: tuple[str, ...], hint: str) -> None:
    said = call(main, capsys, 'read', *args, '--port', '/dev/ttyNOWHERE',
                '--plc-type', 'SLC')  # of a PLC-2 a number is an address
    assert said.status == 2 and hint in said.err
    assert bool(hint) == any(
        lead in said.err for lead in ('; a station', 'apart', '"plc ', ' is a tag'))


def test_read_shows_rows_with_their_addresses(plc: Plc) -> None:
    said = plc('read', 'N7:9', 'B3:0/15', '--length', '18', '--station', '2')
    assert [line.split()[0] for line in said.lines] == ['N7:9', 'N7:19', 'B3:0/15', 'B3:1/15']
    assert said.out.splitlines()[:2] == [
        'N7:9     0  101  102  103  104    0    0    0    0    0',
        'N7:19    0    0    0    0    0    0    0    0']


def test_tags_of_a_map_stand_beside_addresses(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
                     ['speed,Read,N7:0,1,PLC5', 'wrong,Read,N7:999999,1,PLC5'])
    said = plc('read', 'N7:0', '--map', str(path))
    assert (said.status, said.lines) == (0, ['N7:0 speed 1200'])
    assert said.err.startswith(f'plc: {path}:3:3 (Address): ')
    said = plc('watch', 'N7:0', '--count', '1', '--map', str(path))
    assert said.lines[-1].split()[1:] == ['N7:0', 'speed', '1200']
    assert plc('read', 'N7:0', '--map', str(tmp_path / 'none.csv')).status == 2


MAP_OF_TAGS = ('Tag,Command,Address,Station,PLC_Type,Length,Scale,Min,Max,Description', [
    'speed,Read,N7:0-1,1,PLC5,,0.1,,,Hall 3', 'level,ReadWrite,N7:30,2,SLC,,0.5,0,10,Tank 4 [%]',
    'order,Write,N7:31,2,SLC,,,,,'])


def test_rows_of_a_map_are_read_by_their_tags(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_OF_TAGS)
    capture = tmp_path / 'line.cap'
    said = plc('read', 'speed', 'N7:0', '--map', str(path), '--record', str(capture))
    assert (said.status, said.lines) == (0, ['N7:0 speed[0] 120 Hall 3', 'N7:1 speed[1] -80',
                                             'N7:0 speed[0] (raw) 1200'])
    assert capture.read_text('ascii').startswith('# abdf1_ros capture 1\n')
    for verb in ('read', 'watch'):
        said = plc(verb, 'N7:0', '--record', str(tmp_path / 'no' / 'line.cap'))
        assert said == Said(2, '', f'plc: {tmp_path}/no/line.cap: No such file or directory\n')
    assert [line.split()[:2] for line in plc('read', '--map', str(path)).lines] == [
        ['N7:0', 'speed[0]'], ['N7:1', 'speed[1]'], ['N7:30', 'level']]
    said = plc('watch', 'speed', '--count', '1', '--map', str(path))
    assert [line.split()[1:] for line in said.lines] == [
        ['N7:0', 'speed[0]', '120'], ['N7:1', 'speed[1]', '-80']]
    said = plc('read', 'sped', '--map', str(path))
    assert said.status == 2 and f'{path}: tags that are read: speed, level' in said.err
    said = plc('read')
    assert said.status == 2 and 'ADDRESS: give an address such as N7:0' in said.err


def test_map_says_of_each_tag_what_options_say_of_addresses(plc: Plc, tmp_path: Path) -> None:
    path = str(write_csv(tmp_path / 'map.csv', *MAP_OF_TAGS))
    assert plc('read', 'level', '--length', '2', '--via', '0', '--station', '1', '--map', path
               ).err == ''.join(
        f'plc: --{name}: is for addresses; for tags the map has this value\n'
        for name in ('length', 'via')) + 'plc: --station: the map has level at station 2\n'
    assert plc('read', 'level', 'speed', '--station', '2', '--map', path).err == (
        'plc: --station: the map has speed at station 1\n')
    assert plc('read', '--station', '2', '--map', path).lines == ['N7:30 level 2330 % Tank 4 [%]']
    assert plc('read', '--station', '0', '--map', path).err == (
        f'plc: {path}: has no row of station 0 that is read\n')
    assert plc('read', 'LEVEL', '--map', path).err.endswith(
        'tags that are read: speed, level; did you mean level?\n')
    assert plc('read', 'level', '--map', path, '--own-station', '2').err == (
        f'plc: {path}:3: Item: 2, Station 2 is our own Station in the net file; write the '
        'station of the PLC here\n')


@pytest.mark.parametrize(('cells', 'args'), [
    ('on demand,,,', ('read',)), ('on demand,,,', ('read', 'recipe')),
    ('on demand,,,', ('watch', '--count', '1')), *(
        (row, ('watch', 'recipe', '--count', '3')) for row in ('50,,,Change', '50,alive,1000,'))])
def test_row_that_a_bridge_does_not_always_read_or_publish_is_shown(
        plc: Plc, tmp_path: Path, cells: str, args: tuple[str, ...]) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Period,While,'
                     'While_Timeout,Publish', [
                         f'recipe,Read,N7:0,1,PLC5,{cells}',
                         *['alive,Read,N7:2,1,PLC5,,,,'] * ('alive' in cells)])
    assert plc(*args, '--map', str(path)).lines[-1].split()[-3:] == ['N7:0', 'recipe', '1200']


@pytest.mark.parametrize(('args', 'begin'), [
    (('read', 'far'), '10 01 09 10 02 07 05'),  # to 9, for 7
    (('read', 'N7:1', '--station', '7', '--plc-type', 'SLC'), '10 01 09 10 02 07 05'),
    # Our number is that of no station and of no gateway in the map.
    (('read', 'N7:1', '--station', '5', '--via', '12'), '10 01 0C 10 02 05 0D'),
    (('watch', 'N7:1', '--station', '7', '--plc-type', 'SLC'), '10 01 09 10 02 09 05'),  # an echo
    (('write', 'far', '1', '--yes'), '10 01 09 10 02 07 05')])
def test_row_behind_a_gateway_is_asked_through_it(
        tmp_path: Path, args: tuple[str, ...], begin: str) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Via',
                     ['far,ReadWrite,N7:0,7,SLC,9', 'other,Read,N7:0,10,SLC,11'])
    line = Pty(tmp_path / 'line')
    with Process('plc', *args, '--map', str(path), '--port', str(line.name), '--timeout',
                 '9000') as process:
        assert line.read(7) == bytes.fromhex(begin)
        wait_until(lambda: process.catches(signal.SIGTERM))
        process.send(signal.SIGTERM)
        process.result()
    line.close()


@pytest.mark.parametrize(('map_row', 'args', 'routes'), [
    ('near,Read,N7:0,3,SLC,', ('near', 'N7:1', '--station', '7', '--via', '9'), {3: 3, 7: 9}),
    ('far,Read,N7:0,3,SLC,0', ('far', 'N7:1', '--station', '7', '--via', '9'), {3: 0, 7: 9}),
    ('far,Read,N7:0,7,SLC,8', ('N7:1', '--station', '7', '--via', '9'),
     'the map has station 7 behind gateway 8'),
    ('near,Read,N7:0,7,SLC,', ('N7:1', '--station', '7', '--via', '9'),
     'the map has station 7 on the line itself')])
def test_gateway_of_addresses_is_not_that_of_rows(
        tmp_path: Path, map_row: str, args: tuple[str, ...], routes: dict[int, int] | str) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Via', [map_row])
    options = make_parser('').parse_args(['read', *args, '--map', str(path)])
    if isinstance(routes, str):
        with pytest.raises(ConfigurationError, match=f'--via: {routes}'):
            to_read(options)
        return
    line = Pty(tmp_path / 'line')
    with Session(Network(com_port=str(line.name)), via=9,
                 routes=to_read(options).routes) as session:
        assert {number: session.stations.via(number) for number in routes} == routes
        assert [session.stations.via(number) for number in (0, 9, 254)] == [9, 9, 9]
    line.close()


STRUCTURES = """\
Station,PLC_Type,Address,Length,Values
1,PLC5,PD10:0,164,
1,PLC5,PD10:0/EN,1,1
1,PLC5,PD10:0.SP,2,350 1.5
1,PLC5,PD10:1.TIE,1,7.5
1,PLC5,MG11:0,56,
1,PLC5,MG11:0.ERR,1,-3
2,SLC,PD10:0,23,
2,SLC,PD10:0.SPS,1,12
"""


def test_element_of_a_structure_is_a_block_of_its_named_words(
        tmp_path: Path, capsys: Output) -> None:
    (tmp_path / 'data.csv').write_text(STRUCTURES)
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--data', str(tmp_path / 'data.csv')):
        def read(*args: str) -> list[str]:
            return call(main, capsys, 'read', *args, '--port', port, *PATIENT).lines
        lines = read('PD10:0-1')
        assert lines[:4] == ['PD10:0 -32768 EN', 'PD10:0.1 0', 'PD10:0.SP 350', 'PD10:0.KP 1.5']
        assert len(lines) == 2 * 26 and lines[-1] == 'PD10:1.TIE 7.5'
        assert read('MG11:0') == ['MG11:0 0', 'MG11:0.ERR -3', 'MG11:0.RLEN 0', 'MG11:0.DLEN 0']
        assert read('PD10:0', '--station', '2')[:3] == ['PD10:0 0', 'PD10:0.SPS 12', 'PD10:0.KC 0']
        watched = call(main, capsys, 'watch', 'MG11:0', '--count', '1', '--port', port, *PATIENT)
        assert [line.split()[1:] for line in watched.lines] == [
            ['MG11:0', '0'], ['MG11:0.ERR', '-3'], ['MG11:0.RLEN', '0'], ['MG11:0.DLEN', '0']]


def test_family_that_is_given_is_compared_with_what_the_plc_says(plc: Plc) -> None:
    said = plc('read', 'N7:0', '--plc-type', 'plc5')
    assert (said.lines, said.err) == (['N7:0 1200'], '')
    told = 'plc: station 2 is SLC 5/03 series A revision 1, REM RUN; --plc-type says PLC5\n'
    said = plc('read', 'N7:10', 'N7:11', '--plc-type', 'PLC5', '--station', '2')
    assert (said.status, said.lines, said.err) == (0, ['N7:10 101', 'N7:11 102'], told)
    said = plc('write', 'N7:19', '4', '--plc-type', 'PLC5', '--station', '2', '--yes')
    assert (said.status, said.err) == (0, told)
    said = plc('write', 'N7:1999', '4', '--plc-type', 'PLC5', '--station', '2', '--yes')
    assert (said.status, said.err.endswith(told)) == (1, True)


def test_type_that_is_not_that_of_the_plc_is_named_once(plc: Plc) -> None:
    said = plc('read', 'N7:0', 'N7:1', '--plc-type', 'SLC')
    assert (said.status, said.lines) == (1, [])
    assert [said.err.count(f'plc: N7:{word} of station 1: STS ') for word in (0, 1)] == [1, 1]
    assert said.err.count('plc: station 1 is PLC-5/40') == 1
    assert said.err.splitlines()[1].endswith('; --plc-type says SLC')


def test_read_goes_on_after_a_refusal(plc: Plc, tmp_path: Path) -> None:
    said = plc('read', 'N99:0', 'N7:0')
    assert (said.status, said.lines) == (1, ['N7:0 1200'])
    assert said.err.startswith('plc: N99:0 of station 1: STS F0 EXT STS')
    assert '"plc files 1" lists its data files and their lengths' in said.err
    said = plc('read', 'N99:0', 'N98:0')
    assert said.err.count('of station 1: STS F0') == 2 and said.err.count('"plc files 1"') == 1
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
                     ['gone,Read,N7:0,9,PLC5', 'far,Read,N99:0,2,SLC'])
    said = plc('read', 'far', '--map', str(path))
    assert said.err.startswith('plc: far (N99:0) of station 2: STS ')
    *lines, last = plc('read', '--map', str(path), *FAST).err.splitlines()
    assert '; sent: ' in last and [line[5:29] for line in lines] == [
        'gone (N7:0) of station 9', 'far (N99:0) of station 2', '"plc files 2" lists its ',
        'station 9 is silent, and']
