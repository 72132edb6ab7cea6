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

"""First files of a line, the data files of a PLC, and the ports of this machine."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
import time
from unittest.mock import MagicMock, Mock

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.detect import Found, LineSettings
from abdf1_ros.cli.plc.files import find_files
from abdf1_ros.cli.plc.files import map_rows as draft_rows
from abdf1_ros.cli.plc.init import files_of, map_rows, NewFiles
from abdf1_ros.cli.plc.presence import Presence
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.plc.verbs import init
from abdf1_ros.cli.plc.verbs import ports as ports_verb
from abdf1_ros.pccc import gateways
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.ports.listing import SerialPortInfo
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import load_network, Network
from abdf1_ros.settings.rows import Rows
import pytest
from support.commands import Output
from support.driver_bench import simulated_plc, store, stored
from support.mappings import cell_of
from support.odd_device import OddDevice, Wiring
from support.plc_line import Leap, LosesPolls, LOSSY, odd_line, plc_line
from support.ptys import no_file_longer_than

PATIENT = ('--timeout', '2000', '--duplex', 'half')  # ms; a busy host may be late

PLC5 = (('O:000', 2), ('S:0', 32), ('B3:0', 5), ('T4:0', 120), ('N7:0', 256), ('F8:0', 20),
        ('ST9:0', 84), ('A12:0', 7), ('D13:0', 2000), ('C20:0', 3), ('B40:0', 3))
SLC = (('I:3.0', 2), ('S:0', 64), ('B3:0', 1), ('N7:0', 100), ('F10:0', 8), ('L40:0', 4))


@pytest.fixture(scope='module')
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Return a line with a PLC-5 as station 1 and an SLC as station 2."""
    plcs = (simulated_plc(1, 'PLC5', time.monotonic, *PLC5),
            simulated_plc(2, 'SLC', time.monotonic, *SLC))
    with plc_line(tmp_path_factory.mktemp('line') / 'plc', *plcs) as name:
        yield name


@pytest.mark.usefixtures('half_duplex_only')
def test_init_writes_files_that_the_node_takes(port: str, tmp_path: Path, capsys: Output) -> None:
    assert main(['init', '--port', port, '--into', str(tmp_path), '--baud', '19200',
                 '--stations', '1,2', *PATIENT]) == 0
    assert capsys.readouterr().out.splitlines()[:3] == [
        '19200 baud, half duplex, CRC', 'station 1: PLC-5/40 series A revision A, REM RUN',
        'station 2: SLC 5/03 series A revision 1, REM RUN']
    network = load_network(str(tmp_path / 'net.csv'))
    assert (network.port, network.baud, network.mode, network.error_code, network.station) == (
        port, 19200, 'Master', 'CRC', Network().station)
    mappings, problems = load_mappings(str(tmp_path / 'map.csv'))
    assert problems == []
    assert [(mapping.tag, mapping.plc_type.value, mapping.station) for mapping in mappings] == [
        ('status_1', 'PLC5', 1), ('status_2', 'SLC', 2)]
    mappings = with_comments_used(tmp_path / 'map.csv')
    assert len(mappings) == 15
    # What the SLC lists of its files; the PLC-5 has no such list.
    assert [(row.tag, cell_of(row, 'Address')) for row in mappings if row.station == 2][5:] == [
        (f'{name.lower()}_2', f'{name}:0') for name in ('S2', 'B3', 'N7', 'F10', 'L40')]
    guarded = [mapping.tag for mapping in mappings if mapping.is_guarded]
    assert guarded == ['interlocks_1', 'interlocks_2']


def with_comments_used(path: Path) -> Rows:
    """Return the rows of a map, also those that are comments; all have to be good."""
    rows = [line.removeprefix('# ') if line.count(',') == 10 else line
            for line in path.read_text(encoding='utf-8').splitlines()]
    path.write_text('\n'.join(rows), encoding='utf-8')
    mappings, problems = load_mappings(str(path))
    assert problems == []
    return mappings


def test_every_family_gets_rows_that_it_can_have(tmp_path: Path) -> None:
    there = [Presence(number, 0.1, Identity(kind, '', mode=Mode.RUN), None, True, True)
             for number, kind in enumerate(FAMILIES, 1)]
    found = Found(LineSettings(9600, 'Master', 'CRC'), there[0])
    (tmp_path / 'map.csv').write_text(files_of(Network(), found, there, {})[1], encoding='utf-8')
    assert len(with_comments_used(tmp_path / 'map.csv')) == 5 * len(FAMILIES)


def test_full_disk_leaves_no_file_but_those_of_others(tmp_path: Path) -> None:
    files = NewFiles(tmp_path / 'plant' / 'line_1', 'net.csv', 'map.csv')
    with no_file_longer_than(10), pytest.raises(ConfigurationError,
                                                match='map.csv: cannot be written: File too'):
        files.write('short', 'x' * 20_000)  # more than a buffer
    assert not any(path.exists() for path in files.paths)
    files.paths[1].write_text('mine', encoding='utf-8')  # while we searched
    with pytest.raises(ConfigurationError, match='map.csv: cannot be written: File exists'):
        files.write('net', 'map')
    assert [path.name for path in files.paths[0].parent.iterdir()] == ['map.csv']
    assert files.paths[1].read_text(encoding='utf-8') == 'mine'


def test_plc_of_an_unknown_family_leaves_no_later_one_out() -> None:
    unknown = Identity(None, 'type 0x77')
    known = Identity(PlcType.SLC, 'SLC 5/03')
    stopped = replace(known, mode=Mode.PROGRAM, processor=Processor.SLC_5_02)
    rows = ''.join(map_rows([Presence(number, 0.1, identity, None, True, True) for number, identity
                             in enumerate((unknown, known, stopped), 1)],
                            {3: [DataFile(FileType.INTEGER, 7, 256)]}))
    assert '# words_1,' in rows and '\nstatus_2,Read,S:0,2,SLC,' in rows
    # a PLC that does not tell its mode is not guarded by it
    assert '/0,2,SLC,,8,250,,,\n' in rows and '/0,3,SLC,5/02,8,250,RUN,,\n' in rows
    assert rows.endswith('\n# n7_3,Read,N7:0,3,SLC,5/02,41,5000,,,\n')


KE = gateways.decode(bytes.fromhex('00 FE 19 00 00 00 10 00 20 00'))


def test_gateway_leads_to_the_nodes_behind_it() -> None:
    there = [Presence(number, 0.0, identity, None, True, True)
             for number, identity in ((8, KE), (9, None))]
    for mode, scan, via in (
            ('Master', '0-63 --via 8', 'Via 8'), ('Radio', '0-63', 'an empty Via')):
        rows = ''.join(map_rows(there, {}, mode))
        assert f'plc scan {scan} --net net.csv' in rows and f' have {via} and' in rows
        assert 'words_8' not in rows and 'words_9' in rows


@pytest.mark.parametrize(('wiring', 'options', 'scan'), [
    (Wiring.HALF, ('--duplex', 'half', '--stations', '64'), 'scan 0-63 --via 64'),
    (Wiring.FULL, ('--duplex', 'full'), 'scan 0-63')])
def test_line_with_nothing_but_a_gateway_leads_to_the_nodes_behind_it(
        wiring: Wiring, options: tuple[str, ...], scan: str, tmp_path: Path,
        capsys: Output) -> None:
    device = OddDevice(wiring, 64, (9,))
    device.identities[64] = bytes.fromhex('00 FE 19 00 00 00 10 00 20 00')
    with odd_line(tmp_path / 'plc', device) as name:
        assert main(['init', '--port', name, '--into', str(tmp_path), '--baud', '19200',
                     '--check', 'CRC', '--timeout', '2000', *options]) == 0
        said = capsys.readouterr().out
        assert f'plc {scan} --net' in said and 'watch' not in said
        assert main([*scan.split(), '--net', str(tmp_path / 'net.csv'), '--timeout', '2000']) == 0
    assert '\n      9 ' in capsys.readouterr().out
    assert 64 not in {command[1] for command in device.executed}  # our number is not the gateway's
    rows = (tmp_path / 'map.csv').read_text(encoding='utf-8')
    assert f'#   plc {scan} --net net.csv' in rows and 'words_' not in rows


@pytest.mark.usefixtures('half_duplex_only')
def test_plc_that_has_our_usual_number_is_found(tmp_path: Path, capsys: Output) -> None:
    (tmp_path / 'net.csv').touch()  # as a pipe that failed leaves it
    with plc_line(tmp_path / 'plc', simulated_plc(5, 'SLC', time.monotonic, *SLC)) as name:
        assert main(['init', '--port', name, '--into', str(tmp_path), '--baud', '19200',
                     '--stations', '5', *PATIENT]) == 0
        assert 'station 5: SLC 5/03' in capsys.readouterr().out
        assert main(['read', 'N7:1', '--station', '5', '--port', name, *PATIENT]) == 0
    assert load_network(str(tmp_path / 'net.csv')).station != 5


@pytest.mark.usefixtures('half_duplex_only')
def test_plc_that_falls_silent_after_it_was_found(
        port: str, tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.presence.scan', lambda *_, **options: [])
    _with_ports(monkeypatch, SerialPortInfo('/dev/ttyUSB0', port, 'the only adapter', True))
    assert main(['init', '--into', str(tmp_path), '--baud', '19200',
                 '--stations', '1', *PATIENT]) == 0
    assert 'watch S:0 --station 1 --net' in capsys.readouterr().out
    assert load_network(str(tmp_path / 'net.csv')).port == port  # the name that stays
    mappings, _ = load_mappings(str(tmp_path / 'map.csv'))
    assert [mapping.station for mapping in mappings] == [1]  # not a map for nobody


@pytest.mark.usefixtures('half_duplex_only')
def test_lost_poll_leaves_no_station_out(tmp_path: Path, capsys: Output, leap: Leap) -> None:
    plcs = [simulated_plc(number, 'SLC', time.monotonic, *SLC) for number in (1, 2)]
    with plc_line(tmp_path / 'plc', *plcs,
                  around=lambda port: LosesPolls(port, [2] + 99 * [3], leap)) as name:
        assert main(['init', '--port', name, '--into', str(tmp_path), '--baud', '19200',
                     '--stations', '1-3', '--duplex', 'half',
                     '--timeout', f'{LOSSY.timeout}']) == 0
    said = capsys.readouterr().out
    assert '2 of 3 stations answer; silent stations were asked 3 times\n' in said
    assert 'station 1: SLC 5/03' in said
    assert 'station 2: SLC 5/03 series A revision 1, REM RUN, asked 2 times' in said
    mappings, _ = load_mappings(str(tmp_path / 'map.csv'))
    assert [mapping.station for mapping in mappings] == [1, 2]


def test_stations_of_a_radio_line_are_asked_too_and_stand_in_order(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    gateway, *plcs = (Presence(number, 0.1, identity, None, True, True) for number, identity in (
        (3, KE), (5, None), (4, Identity(PlcType.SLC, 'SLC 5/03'))))
    silent = replace(plcs[0], station=9, is_there=False, asked=2)
    monkeypatch.setattr(init, 'found_settings', lambda *_: Found(
        LineSettings(9600, 'Radio', 'BCC'), plcs[0]))
    monkeypatch.setattr('abdf1_ros.cli.plc.presence.scan', scan := Mock(
        return_value=[plcs[1], silent, gateway]))
    monkeypatch.setattr('abdf1_ros.cli.plc.files.listed', lambda *_: [])
    monkeypatch.setattr(init, 'Session', session := MagicMock())
    assert main(['init', '--port', '/x', '--into', str(tmp_path), '--stations', '2-4,9']) == 0
    line = session.call_args[0][0]
    assert (line.baud, line.mode, line.error_code) == (9600, 'Radio', 'BCC')
    assert scan.call_args[0] == (line, (2, 3, 4, 9))
    said = capsys.readouterr().out.splitlines()
    assert said[1] == '3 of 5 stations answer; silent stations were asked 2 times'
    assert [text[:16] for text in said[2:5]] == [f'station {number}: {text}' for number, text in (
        (3, '1785-'), (4, 'SLC 5'), (5, 'answe'))]
    assert 'plc watch S:0 --station 4 --net' in said[7]


def test_init_leaves_files_alone_that_are_there(port: str, tmp_path: Path, capsys: Output) -> None:
    (tmp_path / 'map.csv').write_text('mine', encoding='utf-8')
    assert main(['init', '--port', port, '--into', str(tmp_path)]) == 2
    assert 'map.csv: exists already' in capsys.readouterr().err
    assert not (tmp_path / 'net.csv').exists()
    assert main(['init', '--port', port, '--into', str(tmp_path / 'map.csv')]) == 2
    assert 'map.csv is not a folder, or you may not write to it' in capsys.readouterr().err


def test_init_that_finds_nothing_leaves_no_folder(tmp_path: Path, capsys: Output) -> None:
    into = tmp_path / 'plant' / 'line_1'
    assert main(['init', '--port', str(tmp_path / 'unplugged'), '--into', str(into)]) != 0
    assert 'unplugged' in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(('station', 'found'), [
    ('1', 'O0 by rack or slot, S2 32, B3 5, T4 40, N7 256, F8 10, ST9 2, A12 7, D13 2000, C20 1, '
     'N40 3'),
    ('2', 'I1 2 words, S2 64, B3 1, N7 100, F10 4, L40 2')])
def test_files_are_found_with_type_and_length(
        port: str, station: str, found: str, capsys: Output) -> None:
    assert main(['files', station, '--port', port, '--files', '0-40']) == 0
    lines = [' '.join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert ', '.join(lines).replace(' elements', '') == found


@pytest.mark.parametrize(('station', 'rows', 'comments'), [
    ('1', 's2 S2:0 32, b3 B3:0 5, t4 T4:0 69, n7 N7:0 110, f8 F8:0 10, st9 ST9:0 1, a12 A12:0 7, '
     'd13 D13:0 110', ['O0: addressed by rack or slot', *(
         f'{name} elements; this row of one packet reads {count}' for name, count in (
             ('T4 has 40', 23), ('N7 has 256', 110), ('ST9 has 2', 1), ('D13 has 2000', 110)))]),
    ('2', 's2 S2:0 64, b3 B3:0 1, n7 N7:0 100, f10 F10:0 4', ['I1: addressed by rack or slot'])])
def test_files_become_rows_of_a_map(port: str, station: str, rows: str, comments: list[str],
                                    tmp_path: Path, capsys: Output) -> None:
    assert main(['files', station, '--port', port, '--files', '0-13', '--map']) == 0
    path, text = tmp_path / 'map.csv', capsys.readouterr().out
    path.write_text(text, encoding='utf-8')
    mappings, problems = load_mappings(str(path))
    assert problems == [] and rows == ', '.join(
        f'{row.tag} {row.address} {row.length}' for row in mappings)
    assert {(str(row.station), row.period) for row in mappings} == {(station, 5000)}
    assert [line[2:] for line in text.splitlines() if line[0] == '#'] == comments


def test_row_of_a_file_is_one_packet_of_one_type() -> None:
    pid, integers = DataFile(FileType.PID, 30, 1), DataFile(FileType.INTEGER, 7, 256)
    for entry, family, processor, row in (
            (DataFile(FileType.HSC, 0, 1), PlcType.SLC, None, '# HSC: addressed by the names of'),
            (pid, PlcType.PLC5, None, '# PD30: values of several types, at PD30:0, PD30:0.SP'),
            (integers, PlcType.SLC, Processor.ML1400, 'n7,Read,N7:0,1,SLC,ML1400,103,')):
        assert [*draft_rows([entry], 1, family, processor)][-1].startswith(row)


def test_rows_of_a_map_that_lie_outside_of_the_files(
        port: str, tmp_path: Path, capsys: Output) -> None:
    path = tmp_path / 'map.csv'
    header = 'Tag,Command,Address,Station,PLC_Type,Length\n'
    path.write_text(header + 'a,Read,N7:90,2,SLC,10\nb,Read,F10:3,2,SLC,1\nc,Read,N7:200,1,PLC5,\n'
                    'd,Read,I:3.0,2,SLC,9\ne,Read,HSC:0.ACC,2,SLC,\n', encoding='utf-8')
    line = ('--map', str(path), '--port', port)
    assert main(['files', '2', *line]) == 0
    assert capsys.readouterr().out == 'all rows of station 2 lie inside\n'
    path.write_text(header + 'a,Read,N7:90,2,SLC,11\nb,Read,N10:0,2,SLC,1\n'
                    'c,Read,B12:0,2,SLC,\nd,Read,N7,2,SLC,\ne,Read,F10:3,2,SLC,2\n',
                    encoding='utf-8')
    assert main(['files', '2', *line]) == 1
    said = capsys.readouterr()
    assert f'{path}:5:3 (Address): 2503' in said.err
    assert said.out.splitlines() == [
        f'{path}:2 (Address): N7:90, Length 11: N7 has only 100 elements',
        f'{path}:3 (Address): N10:0, Length 1: file 10 is F10',
        f'{path}:4 (Address): B12:0, Length 1: there is no file 12',
        f'{path}:6 (Address): F10:3, Length 2: F10 has only 4 elements']
    path.write_text(header + 'a,Read,L40:1,2,SLC,\nb,Read,B40:0,1,PLC5,3\nc,Read,B12:0,1,PLC5,\n',
                    encoding='utf-8')  # the list of neither PLC is read
    for args, told in ((('2', '--plc-type', 'SLC'), 'all rows of station 2 lie inside\n'), (
            ('1',), f'{path}:4 (Address): B12:0, Length 1: file 12 is A12\n'), (
            ('1', '--files', '31-40'), 'all rows of station 1 in these files lie inside\n')):
        assert main(['files', *args, *line]) == ('file 12' in told)
        assert capsys.readouterr().out == told
    assert main(['files', '9', *line]) == 2
    assert capsys.readouterr().err == f'plc: {path}: has no row of a file of station 9\n'


def test_directory_takes_few_reads(port: str, capsys: Output) -> None:
    with Session(Network(com_port=port, baud=19200, timeout=300)) as session:
        found = [*find_files(session, 2, PlcType.SLC, Processor.SLC_5_03)]
        assert session.counters.commands_sent <= 10
        by_reads = [*find_files(session, 2, PlcType.SLC, None, (7, 40))]
        assert session.counters.commands_sent > 20
        warned: list[str] = []  # a PLC-5, which refuses that
        assert not [*find_files(session, 1, PlcType.SLC, Processor.SLC_5_03, (7,),
                                warn=warned.append)]
        assert [text[:38] for text in warned] == ['its file directory cannot be read (STS']
    assert {str(entry) for entry in by_reads} <= {str(entry) for entry in found}


def test_plc_behind_a_gateway(tmp_path: Path, capsys: Output) -> None:
    plc = simulated_plc(5, 'SLC', time.monotonic, *SLC)
    plc.via = 10
    store(plc, 'N7:1', [42])
    with plc_line(tmp_path / 'plc', plc) as name:
        line = ('--port', name, '--via', '10')
        assert main(['read', 'N7:1', '--station', '5', *line]) == 0
        said = capsys.readouterr()
        assert '42' in said.out and said.err == ''
        assert main(['write', 'N7:1', '43', '--station', '5', '--yes', *line]) == 0
        assert stored(plc, 'N7:1') == b'\x2B\0'
        capsys.readouterr()
        assert main(['files', '5', '--files', '2-10', '--map', *line]) == 0
        path = tmp_path / 'map.csv'
        path.write_text(capsys.readouterr().out, encoding='utf-8')
        assert main(['files', '5', '--map', str(path), '--port', name]) == 0
        assert main(['files', '5', '--map', str(path), '--port', name, '--via', '9']) == 2
        assert '--via: the map has station 5 behind gateway 10\n' in capsys.readouterr().err
    mappings, problems = load_mappings(str(path))
    assert problems == []
    assert {(mapping.station, mapping.via) for mapping in mappings} == {(5, 10)}


def test_plc_that_answers_for_a_gateway_it_is_not(port: str, capsys: Output) -> None:
    assert main(['read', 'N7:0', '--station', '3', '--via', '2', '--port', port, *PATIENT]) == 0
    assert 'plc: stations 3 and 2 are both "SLC 5/03 series A revision 1, REM RUN": if 2 is ' \
           'not a gateway, it answers itself' in capsys.readouterr().err


def test_station_without_files_is_an_error(port: str, capsys: Output) -> None:
    assert main(['files', '1', '--port', port, '--files', '30-31']) == 1
    assert main(['files', '1', '--port', port, '--plc-type', 'PLC2']) == 1
    assert 'we know no way to find the files of a' in capsys.readouterr().err


ADAPTER = SerialPortInfo('/dev/ttyUSB0', '/dev/serial/by-id/usb-FTDI', 'FT232R', True)
OTHER = SerialPortInfo('/dev/ttyS0', '', '', False)


def _with_ports(monkeypatch: pytest.MonkeyPatch, *ports: SerialPortInfo) -> None:
    for verb in (init, ports_verb):
        monkeypatch.setattr(verb, 'serial_ports', lambda: list(ports))


def test_ports_are_listed_with_what_keeps_one_from_opening_them(
        monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    _with_ports(monkeypatch, ADAPTER, OTHER)
    assert main(['ports']) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[1].split() == ['/dev/ttyUSB0', 'FT232R', ADAPTER.stable]
    assert said.out.splitlines()[2].endswith('no access for this user')
    assert 'usermod -aG dialout' in said.err


def test_machine_without_ports_says_so(monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    _with_ports(monkeypatch)
    assert main(['ports']) == 1
    assert 'no serial port' in capsys.readouterr().err


@pytest.mark.parametrize(('ports', 'told'), [
    ((), 'this machine has none'), ((ADAPTER, OTHER), '/dev/ttyUSB0, /dev/ttyS0')])
def test_init_asks_for_the_port_where_it_is_not_plain(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Output,
        ports: tuple[SerialPortInfo, ...], told: str) -> None:
    _with_ports(monkeypatch, *ports)
    assert main(['init', '--into', str(tmp_path)]) == 2
    assert capsys.readouterr().err == f'plc: --port: name the port: {told}\n'


def test_port_that_is_not_there_leads_to_the_list(capsys: Output) -> None:
    assert main(['read', 'N7:0', '--port', '/dev/ttyUSB99']) == 1
    assert '"plc ports" lists the ports' in capsys.readouterr().err
