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

"""The bundle for a report, and what an anonymous one leaves out."""

import json
from pathlib import Path
from zipfile import ZipFile

from abdf1_ros.cli import sniff_report
from abdf1_ros.cli.sniff import main
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
import pytest
from support.captures import write_capture
from support.vectors import pair

READ = Packet(2, 5, 0x0F, 0, 0x1234, bytes.fromhex('A2 04 07 89 00 00'))
WRITE = Packet(2, 5, 0x0F, 0, 0x1235, bytes.fromhex('AA 02 07 89 01 00 B7 2A'))


def _frames() -> list[tuple[str, bytes]]:
    said: list[tuple[str, bytes]] = []
    for command, data in ((READ, bytes.fromhex('D2 04 FE FF')), (WRITE, b'')):
        said += [('>', frames.master_frame(2, command.encode(), Checksum.CRC)),
                 ('<', frames.ACK), ('>', frames.poll_frame(2)),
                 ('<', frames.message_frame(command.reply(data).encode(), Checksum.CRC)),
                 ('>', frames.ACK)]
    return said


@pytest.fixture
def capture(tmp_path: Path) -> str:
    return write_capture(tmp_path / 'line.cap', _frames())


def unpacked(path: str | Path) -> dict[str, str]:
    """Return the text of each file of a bundle."""
    with ZipFile(path) as bundle:
        return {name: bundle.read(name).decode() for name in bundle.namelist()}


def bundle_of(tmp_path: Path, capture: str, *options: str) -> dict[str, str]:
    """Return the files of a bundle."""
    (tmp_path / 'map.csv').write_text(
        '# line of the paint shop\nTag,Command,Address,Station,PLC_Type,Topic\n'
        'paint_booth,Read,N7:0,2,SLC,booth\n', encoding='utf-8')
    (tmp_path / 'slave.json').write_text('{"target": "slave"}', encoding='utf-8')
    path = str(tmp_path / 'report.zip')
    assert main([capture, '--summary', '--report', path, '--settings', str(tmp_path / 'map.csv'),
                 '--conformance', str(tmp_path / 'slave.json'), *options]) == 0
    assert not Path(path).stat().st_mode & 0o007
    return unpacked(path)


def test_bundle_has_all_that_a_report_needs(
        tmp_path: Path, capture: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / 'line.html'
    files = bundle_of(tmp_path, capture, '--html', str(page))
    assert 'TNS 1234' in page.read_text('utf-8')
    assert set(files) == {
        'README.txt', 'summary.txt', 'summary.json', 'processors.txt', 'versions.json',
        'entries.txt', 'capture/line.cap', 'settings/map.csv', 'conformance/slave.json'}
    assert files['capture/line.cap'].startswith('# abdf1_ros capture 1\n')
    assert '1234 -2' in files['entries.txt']
    assert 'paint_booth' in files['settings/map.csv']
    assert files['conformance/slave.json'] == '{"target": "slave"}\n'
    assert files['processors.txt'] == 'no diagnostic status was seen\n'
    assert set(json.loads(files['versions.json'])) == {'abdf1_ros', 'python', 'system'}
    for name in ('capture/', 'entries.txt', 'settings/'):
        assert name in files['README.txt']
    assert '--anonymous leaves all these out' in files['README.txt']
    assert 'look through the bundle' in capsys.readouterr().err


def test_anonymous_bundle_has_no_values_and_no_names(
        tmp_path: Path, capture: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('platform.release', lambda: '6.8.0-paint')
    files = bundle_of(tmp_path, capture, '--anonymous')
    assert not any(name.startswith('capture/') or name == 'entries.txt' for name in files)
    everything = '\n'.join(files.values())
    # The values that were read and written, as numbers and as bytes; and what people call them.
    for secret in ('1234 -2', 'd204', 'feff', '10935', 'b72a', 'paint', 'booth'):
        assert secret not in everything.lower(), secret
    assert 'tag_1,Read,N7:0,2,SLC,topic_1' in files['settings/map.csv']
    told = [json.loads(line) for line in files['entries.json'].splitlines()]
    assert [(entry['command'], entry['data']) for entry in told if 'data' in entry] == [
        ('0F/A2', 'a2'), ('0F', ''), ('0F/AA', 'aa'), ('0F', '')]
    assert 'numbered' in files['README.txt']


NET = """\
# Joe's line, ask jdoe
Com_Port,Station,Baud,Mode,Share,Store_Forward,Timeout,Listen_Port
rfc2217://plc-gw.acme.example:4001,5,9600,Master,pty:/home/jdoe/hmi tcp:10.1.2.3:4,jdoe,jdoe,/acme
"""
MAP = """\
sep=,
   # paint shop of jdoe
Tag,Command,Address,Station,PLC_Type,Topic,While,Confirms,Fallback,Description,Min,Via
booth_alive,Read,N7:0,2,SLC,,,,,alive of the booth,,
booth_speed,Read,N7:1,2,SLC,acme/speed,booth_alive,,,ask jdoe,,
booth_ros,Heartbeat,plc-gw:9,2,SLC,,acme/setpoint acme/door,,,,,
booth_control,Read,B3:0/1,2,SLC,,Run,Booth_ROS,,,,
run,Write,N7:3-4,2,SLC,acme/setpoint,,,acme jdoe,,jdoe,plc-gw
door,Read,plc-gw.acme.example,10.1.2.3,/home/jdoe,,,,,,,
"""
RESULT = {
    'target': 'slave', 'processor': 'PRESS_ACME', 'station': '2', 'check': 'CRC', 'port': 'jdoe',
    'baud': '/dev/ttyACME', 'abdf1_ros': '0.2.0', 'cases': [{
        'case': 'slave-ack', 'verdict': 'PASS', 'rule': 'an ACK', 'source': 'M 3-4',
        'seconds': 0.1, 'expected': 'acme', 'got': 'jdoe', 'transcript': ['> 10 02 b7 2a']}]}
NAMES = ('jdoe', 'joe', 'acme', 'plc-gw', '10.1.2.3', '4001', '4002', 'home', 'hmi', 'booth',
         'paint', 'press', 'door', 'speed', 'alive', 'b7 2a', 'tty')


def test_anonymous_bundle_has_no_name_of_a_host_user_path_or_port(
        tmp_path: Path, capture: str) -> None:
    folder = tmp_path / 'home' / 'jdoe'
    folder.mkdir(parents=True)
    files = {'acme_net.csv': NET, 'net2.csv': NET.replace('rfc2217://', 'jdoe://'),
             'booth_map.csv': MAP, 'map2.csv': MAP.replace(',', ';'),
             'plc-gw.txt': 'Port of jdoe\n',
             'export.csv': 'Tag Name,Address,Client Access\njdoe,,\n',
             'empty.csv': 'Tag,Command\n', 'jdoe.json': json.dumps(RESULT),
             'issue.md': '- port: /dev/ttyACME\n', 'list.json': '["/dev/ttyACME"]'}
    for name, text in files.items():
        (folder / name).write_text(text, encoding='utf-8')
    recorded = folder / 'acme.cap'
    recorded.write_text(Path(capture).read_text('ascii').replace(
        '# baud: 9600', '# port: rfc2217://plc-gw.acme.example:4001\n# guest: /home/jdoe/hmi'),
        'ascii')
    report = tmp_path / 'report.zip'
    paths = [str(folder / name) for name in files]
    assert main([str(recorded), '--summary', '--report', str(report), '--anonymous',
                 '--settings', *paths[:7], '--conformance', *paths[7:]]) == 0
    found = unpacked(report)
    everything = '\n'.join([*found, *found.values()]).lower()
    assert [name for name in NAMES if name in everything] == []
    assert found['settings/net.csv'] == (
        'Station,Mode,Com_Port,Baud,Timeout,Share,Store_Forward,Listen_Port\n'
        '5,Master,rfc2217,9600,?,2 places,?,device\n')
    assert found['settings/map.csv'] == found['settings/1_map.csv'] == (
        'Tag,Command,Address,Station,PLC_Type,Topic,Min,While,Confirms,Via\n'
        'tag_1,Read,N7:0,2,SLC,,,,,\n'
        'tag_2,Read,N7:1,2,SLC,topic_1,,tag_1,,\n'
        'tag_3,Heartbeat,?,2,SLC,,,topic_2 topic_3,,\n'
        'tag_4,Read,B3:0/1,2,SLC,,,Run,tag_3,\n'
        'tag_5,Write,N7:3-4,2,SLC,topic_2,?,,,?\n'
        'tag_6,Read,?,?,?,,,,,\n')
    assert found['settings/2_map.csv'] == '\n'
    assert found['settings/unread.txt'].startswith('left out: ')
    assert json.loads(found['conformance/result.json']) == {
        'target': 'slave', 'check': 'CRC', 'station': '2', 'abdf1_ros': '0.2.0', 'cases': [{
            'case': 'slave-ack', 'verdict': 'PASS', 'rule': 'an ACK', 'source': 'M 3-4',
            'seconds': '0.1'}]}
    assert found['conformance/1_result.json'].startswith('left out: ')


def test_result_of_brackets_alone_is_left_out(tmp_path: Path, capture: str) -> None:
    report, result = tmp_path / 'report.zip', tmp_path / 'result.json'
    result.write_text(200_000 * '[')
    assert main([capture, '--summary', '--report', str(report), '--anonymous',
                 '--conformance', str(result)]) == 0
    assert unpacked(report)['conformance/result.json'].startswith('left out: ')


def test_processor_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                            monkeypatch: pytest.MonkeyPatch) -> None:
    asked, told = pair('diag_status_slc504')
    halted = told.data[:18] + b'\x5E\x20' + told.data[20:]
    said = [asked._replace(dst=4), told._replace(src=4, data=halted), asked, told,
            asked._replace(dst=5), told._replace(src=5, data=b'\xEE'),
            asked._replace(dst=6), told._replace(src=6, data=b'\xEE\x34'),
            asked._replace(dst=7), told._replace(src=7, data=b'\0\xEE\x34\x99\x41JDOES_PLC  '
                                                 + told.data[16:])]
    for number, station in enumerate((9, told.src), 1):  # they refuse the question
        said.append(asked._replace(dst=station, tns=asked.tns + number))
        said.append(said[-1].reply(b'')._replace(sts=0x10))
    path = write_capture(tmp_path / 'status.cap', [
        ('><'[count % 2], frames.message_frame(packet.encode(), Checksum.CRC))
        for count, packet in enumerate(said)], 1.0, ('check: CRC', 'duplex: full'))
    report = tmp_path / 'report.zip'
    assert main([path, '--summary', '--report', str(report)]) == 0
    text = unpacked(report)['processors.txt']
    assert [line.partition('; status ')[0] for line in text.splitlines()] == [
        'station 1: SLC 5/04 series B revision 3, RUN',
        'station 4: SLC 5/04 series B revision 3, RUN; major error 0x0000, processor halted; '
        'forces installed', 'station 5: ee (a diagnostic status of 1 bytes)',
        'station 6: unknown processor (EE 34)', 'station 7: JDOES_PLC series C revision 2']
    assert main([path, '--summary', '--report', str(report), '--anonymous']) == 0
    told = unpacked(report)['processors.txt']
    assert 'EE' not in told.upper() and 'JDOE' not in told
    assert told.endswith('of 1 bytes\nstation 6: unknown processor\n'
                         'station 7: unknown processor series C revision 2\n')
    monkeypatch.setattr(sniff_report, 'MOST_ENTRIES', 1)
    assert main([path, '--summary', '--report', str(report)]) == 0
    files = unpacked(report)
    assert files['processors.txt'] == text
    assert files['entries.txt'].strip().startswith('13.000000 <')
    assert 'last of the recording; 13 before them are only' in files['README.txt']
    capsys.readouterr()


@pytest.mark.parametrize('options', [
    ('--report', '/dev/full'), ('--report', 'x.zip', '--settings', '/nowhere/net.csv')])
def test_file_that_cannot_be_had_is_named(
        capture: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str], options: tuple[str, ...]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([capture, '--summary', *options]) == 2
    told, = capsys.readouterr().err.splitlines()  # and not what is in the bundle
    assert options[-1] in told


def test_only_a_bundle_is_replaced(tmp_path: Path, capture: str,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    bundle_of(tmp_path, capture)
    assert 'capture/line.cap' in bundle_of(tmp_path, capture)
    foreign = tmp_path / 'foreign.zip'
    with ZipFile(foreign, 'w') as bundle:
        bundle.writestr('README.txt', 'mine')
    (tmp_path / 'empty').touch()
    for path in (capture, str(tmp_path / 'map.csv'), str(foreign)):
        before = Path(path).read_bytes()
        with pytest.raises(SystemExit) as end:
            main([capture, '--summary', '--report', path])
        assert end.value.code == 2 and Path(path).read_bytes() == before
        assert f'{path} exists and was not made by --report' in capsys.readouterr().err
    assert main([capture, '--summary', '--report', str(tmp_path / 'empty')]) == 0


def test_files_of_one_name_are_all_in_the_bundle(tmp_path: Path, capture: str) -> None:
    names = []
    for folder in ('one', 'two', 'three'):
        (tmp_path / folder).mkdir()
        names.append(str(tmp_path / folder / 'net.csv'))
        Path(names[-1]).write_bytes(b'Station\n%d\xFF\n' % len(names))
    report, other = tmp_path / 'report.zip', tmp_path / 'one' / 'line.cap'
    other.write_text('1.0 > 10 05\n', encoding='ascii')
    assert main([capture, str(other), '--summary', '--report', str(report),
                 '--settings', *names]) == 0
    files = unpacked(report)
    assert files['capture/1_line.cap'] == '1.0 > 10 05\n'
    assert [files[f'settings/{name}'][:9] for name in ('net.csv', '1_net.csv', '2_net.csv')] == [
        'Station\n1', 'Station\n2', 'Station\n3']
