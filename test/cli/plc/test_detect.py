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

"""The search for settings: what is tried, in which order, and when it ends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import MagicMock, Mock

from abdf1_ros import settings
from abdf1_ros.cli.plc import detect
from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.detect import BAUD_RATES, conclusion, LineSettings, Search
from abdf1_ros.cli.plc.init import net_csv
from abdf1_ros.cli.plc.line import network_of
from abdf1_ros.cli.plc.parser import make_parser
from abdf1_ros.cli.plc.presence import Presence, scan
from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, Frame
from abdf1_ros.df1.machine import Machine, Procedure
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.radio import RadioNode
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.diagnosis.traces import Traces
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import simulated_plc
from support.odd_device import Answer, OddDevice, Wiring
from support.plc_line import machine_line, odd_line
from support.ptys import Pty


class Trying(list[str]):
    """What a search has shown."""

    def __call__(self, text: str) -> None:
        self.append(text.removeprefix('trying '))


@contextmanager
def plc_on(path: Path, check: str, duplex: Duplex,
           kind: type[FullDuplexPeer | RadioNode] = FullDuplexPeer) -> Iterator[Network]:
    """Put an SLC that is station 1 on a pseudo-terminal."""
    plc = simulated_plc(1, 'SLC', lambda: 0.0, ('N7:0', 10), checksum=check)
    checksum = Network(error_code=check).checksum
    procedure = multidrop([plc]) if duplex is Duplex.HALF \
        else _everybody_sends(plc, checksum, kind)
    with machine_line(path, Machine(procedure, checksum=checksum, duplex=duplex)):
        yield Network(com_port=str(path), timeout=1500)


def _everybody_sends(plc: SimulatedPlc, checksum: Checksum,
                     kind: type[FullDuplexPeer | RadioNode]) -> Callable[[Machine], Procedure]:
    def run(machine: Machine) -> Procedure:
        if issubclass(kind, FullDuplexPeer):
            timeout = 0.1 if issubclass(kind, Unheard) else 1.0  # until it asks with ENQ
            return kind(machine, LinkSettings(station=None, checksum=checksum, timeout=timeout),
                        ActiveStationList(), plc.serve).run(plc)
        return RadioNode(
            machine, LinkSettings(station=1, checksum=checksum), ActiveStationList(),
            plc.serve).run(plc)
    return run


def test_usual_baud_rates_come_first_and_only_the_slowest_are_left_out() -> None:
    assert BAUD_RATES[:3] == (19200, 9600, 38400)
    assert sorted((300, 600, *BAUD_RATES)) == sorted(settings.BAUD_RATES)


def test_everything_is_tried_on_a_silent_line(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    trying = Trying()
    search = Search(Network(com_port=str(line.name), timeout=20), [0, 3, 1], trying)
    assert search.run((19200, 9600)) is None
    line.close()
    one_speed = ['full duplex, CRC, station 3', 'full duplex, CRC, station 0',
                 'full duplex, BCC, station 3', 'full duplex, BCC, station 0',
                 *(f'half duplex, CRC, station {number}' for number in (0, 3, 1))]
    assert trying == 2 * [f'{baud} baud, {text}' for baud in (19200, 9600) for text in one_speed]
    assert {seen.characters for seen in search.traces.values()} == {0}


@pytest.mark.parametrize('duplex, check, mode, tried', [
    (Duplex.FULL, 'BCC', 'Peer', 2), (Duplex.HALF, 'BCC', 'Master', 7)])
def test_search_ends_with_the_first_answer(tmp_path: Path, duplex: Duplex, check: str, mode: str,
                                           tried: int, request: pytest.FixtureRequest) -> None:
    if duplex is Duplex.HALF:
        request.getfixturevalue('half_duplex_only')
    trying = Trying()
    with plc_on(tmp_path / 'line', check, duplex) as network:
        # In half duplex nobody is at 4; with the second check only who was heard is tried.
        found = Search(network, [1] if duplex is Duplex.FULL else [4, 1], trying).run(BAUD_RATES)
    assert found is not None
    assert found.settings == LineSettings(19200, mode, check)
    assert found.presence.station == 1
    assert len(trying) == tried


class Particular(FullDuplexPeer):
    """A full-duplex port that passes over what is not for its own station."""

    station = 1

    def _message(self, frame: Frame) -> bytes:
        return super()._message(frame) if frame.data[:1] == bytes((self.station,)) else b''


class Other(Particular):
    """One whose own station is 0."""

    station = 0


def test_full_duplex_port_with_station_0_is_found_and_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.overhear.LISTENED', 0.05)
    for kind, stations, best in ((Other, '0-7', 0), (FullDuplexPeer, '0', 1)):  # answers to all
        with plc_on(tmp_path / f'line{best}', 'CRC', Duplex.FULL, kind) as network:
            for verb in (['detect'], ['init', '--into', str(tmp_path / f'new{best}')]):
                assert main([*verb, '--port', network.port, '--baud', '9600', '--duplex', 'full',
                             '--check', 'CRC', '--timeout', '100', '--stations', stations]) == 0
        said = capsys.readouterr().out
        assert '--peer --station 0 --port' in said and f'watch S:0 --station {best} --net' in said


def test_radio_modem_is_found_by_replies_without_ack(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detect, 'ENQ_TIME', 0.5)
    trying = Trying()
    with plc_on(tmp_path / 'line', 'BCC', Duplex.FULL, RadioNode) as network:
        found = Search(network, [1], trying).run([9600])
        assert found is not None
        assert (found.settings, found.presence.station) == (LineSettings(9600, 'Radio', 'BCC'), 1)
        assert 'radio modem (replies come without ACK), ' in trying[-1]
        assert ',Radio,' in net_csv(network, found, [1])
        assert found.settings.on(network).mode == 'Radio'


class Unheard(FullDuplexPeer):
    """A full-duplex port whose ACKs are lost."""

    def _respond(self, response: bytes) -> bytes:
        response = super()._respond(response)
        return b'' if response == ACK else response


def test_full_duplex_port_whose_acks_are_lost_is_not_radio(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detect, 'ENQ_TIME', 2.5)  # it asks after 0.1 s
    with plc_on(tmp_path / 'line', 'CRC', Duplex.FULL, Unheard) as network:
        found = Search(network, [1]).run([9600])
    assert found is not None
    assert found.settings.mode == 'Peer'
    for at, later, mode in ((1, 'polls', 'Peer'), (0, 'acks', 'Peer'), (0, 'naks', 'Peer'),
                            (0, 'enqs', 'Peer'), (0, 'polls', 'Radio')):
        sessions = [Mock(echoes=False, counters=Counters()) for _ in range(2)]
        sessions[0].counters.acks_received = at
        setattr(sessions[1].counters, f'{later}_received', 1)
        monkeypatch.setattr(detect, 'Session', MagicMock(**{
            'return_value.__enter__.side_effect': sessions}))
        monkeypatch.setattr(detect, 'ENQ_TIME', 0)
        monkeypatch.setattr(detect, 'look_at', lambda _, station: Presence(
            station, 0.0, None, None, is_there=True, takes_commands=True))
        monkeypatch.setattr(detect, 'understands', lambda *_: True)
        found = Search(Network(), [1]).run([9600])
        assert found is not None and found.settings.mode == mode


def test_full_duplex_port_with_another_station_is_heard_all_the_same(tmp_path: Path) -> None:
    with plc_on(tmp_path / 'line', 'CRC', Duplex.FULL, Particular) as network:
        search = Search(network, [5])
        assert search.run([9600], ['Peer'], ['CRC']) is None
    seen, = search.traces.values()
    assert (seen.characters, seen.enquiries, seen.naks) == (2, 1, 0)
    assert [*conclusion(search.traces)] == [
        '9600 baud, full duplex, CRC: a full-duplex port answers, but takes no command for '
        'station 5. Next: "plc scan 0-63 --peer" shows which stations reply; then try '
        'Error_Code BCC']


def test_full_duplex_port_is_named_where_only_half_duplex_was_tried(tmp_path: Path) -> None:
    with plc_on(tmp_path / 'line', 'CRC', Duplex.FULL) as network:
        search = Search(network, [1, 2])
        assert search.run([9600], ['Master'], ['CRC']) is None
    assert [*conclusion(search.traces)] == [
        '9600 baud, half duplex, CRC: DLE NAK comes, which no slave sends: the channel of the PLC '
        'is set to full duplex. Next: use Mode Peer, --peer of "plc"']


def test_characters_of_before_an_echo_was_seen_are_no_trace(
        monkeypatch: pytest.MonkeyPatch) -> None:
    class EchoedSession:
        """Characters come back too late to be known, at 19200 baud in time."""

        counters = Counters()
        stations = ActiveStationList()

        def __init__(self, network: Network, absent: object = ()) -> None:
            self.echoes = network.baud == 19200
            assert network.cmd_timeout == max(500, network.timeout)
            assert (network.nak_retries, network.enq_retries) == (0, 1)
            self.counters.chars_received = 4

        def __enter__(self) -> 'EchoedSession':
            return self

        def __exit__(self, *exception: object) -> None:
            """Close nothing."""

        def traces(self, station: int) -> Traces:
            return Traces(characters=4)

    absent = Presence(1, 0.0, None, None, is_there=False, takes_commands=True)  # ACKs, no reply
    monkeypatch.setattr(detect, 'Session', EchoedSession)
    monkeypatch.setattr(detect, 'look_at', lambda session, station: absent)
    monkeypatch.setattr(detect, 'understands', lambda *_: False)
    assert Search(Network(timeout=800), [1]).run([9600]) is None
    search = Search(Network(timeout=100), [1])
    assert search.run([9600]) is None
    assert len(search.traces) == 3
    assert search.run([9600, 19200]) is None
    assert search.traces == {}


def test_only_options_and_urls_keep_a_search_from_trying_all(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detect, 'overhear', heard := Mock(return_value=None))
    monkeypatch.setattr(detect, 'Search', search := Mock(**{'return_value.echoes': False}))
    (net := tmp_path / 'net.csv').write_text(
        'Com_Port,Baud,Error_Code,Mode\n/x,2400,BCC,Master\n', 'utf-8')
    for more, bauds, modes, checks in (
            ((), BAUD_RATES, ['Peer', 'Master'], ('CRC', 'BCC')),
            (('--baud', '9600', '--duplex', 'full'), [9600], ['Peer'], ('CRC', 'BCC')),
            (('--port', 'socket://h:1', '--check', 'crc'), [2400], ['Peer', 'Master'], ['CRC'])):
        options = make_parser('').parse_args(['detect', '--net', str(net), *more])
        detect.found_settings(options, line := network_of(options))
        assert search.return_value.run.call_args[0] == (bauds, modes, checks)
        assert heard.call_args[0][:2] == (line, bauds)


KE = bytes.fromhex('00 FE 19 00 00 00 10 00 20 00')
DETECT = ('--baud', '19200', '--check', 'CRC', '--timeout', '1000')


def gateway_of(wiring: Wiring, *nodes: int, identity: bytes = KE) -> OddDevice:
    """Return a gateway, station 8 in half duplex, with SLCs behind it."""
    device = OddDevice(wiring, 8, nodes)
    device.identities[8] = identity
    return device


def detected(path: Path, device: OddDevice, capsys: pytest.CaptureFixture[str],
             *options: str) -> str:
    """Return what detect says of a line, and the options that it proposes for the next command."""
    with odd_line(path, device) as name:
        assert main(['detect', '--port', name, *DETECT, *options]) == 0
        said = capsys.readouterr().out
        task = said.partition('next: ')[2].partition('plc ')[2].partition('\n')[0]
        assert main([*task.split(), '--timeout', '1000']) == 0
    return said + capsys.readouterr().out


def test_gateway_in_half_duplex_is_named_with_the_way_to_its_nodes(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = detected(tmp_path / 'line', gateway_of(Wiring.HALF, 1, 9), capsys,
                    '--duplex', 'half', '--stations', '6-9')
    assert '19200 baud, half duplex, CRC: station 8 1785-KE series B' in said
    assert 'plc scan 0-63 --via 8 --port' in said and 'read N7:0' not in said
    assert '\n      1 ' in said and '\n      9 ' in said and '3 of 64 stations answer' in said


def test_gateway_in_full_duplex_proves_the_settings_though_no_node_is_asked_that_is_there(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = detected(tmp_path / 'line', OddDevice(Wiring.FULL, 9), capsys, '--duplex', 'full')
    assert 'station 1 not reached, a gateway answers for it: STS 02' in said
    assert 'plc scan 0-63 --peer --port' in said
    assert '\n      9 ' in said and '1 of 64 stations answer' in said


@pytest.mark.usefixtures('half_duplex_only')
def test_plc_on_the_line_goes_before_a_gateway(tmp_path: Path) -> None:
    device = gateway_of(Wiring.HALF)
    device.stations = device.nodes = frozenset((8, 11, 12))  # 11 and 12 are slaves of their own
    device.takes = lambda data: Answer.NOTHING if data[0] == 12 else Answer.ACK
    with odd_line(tmp_path / 'line', device) as name:
        for stations, best in (([8, 11], 11), ([8, 12], 8)):
            found = Search(Network(com_port=name, timeout=1000), stations).run([19200])
            assert found is not None and found.presence.station == best


def test_nodes_that_are_stations_of_the_line_are_found_without_via(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Remote mode of a 1747-KE (1747-UM005B 3-8): node 9 of group 1 is station 41."""
    device = OddDevice(Wiring.HALF, 41)
    device.stations = frozenset(range(32, 64))
    said = detected(tmp_path / 'line', device, capsys, '--duplex', 'half', '--stations', '38-43')
    assert 'station 41 SLC 5/03' in said and 'plc read N7:0 --station 41' in said


def test_gateway_in_full_duplex_that_answers_diagnostics_for_all_has_the_nodes_that_a_read_finds(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device = OddDevice(Wiring.FULL, 9)
    device.executes_diagnostics = True
    device.identities.update(dict.fromkeys(range(64), KE))
    said = detected(tmp_path / 'line', device, capsys, '--duplex', 'full')
    assert 'station 1 not reached, a gateway answers for it: STS 02' in said
    assert '1 of 64 stations answer' in said
    assert 'the gateway answers for this station, as 1785-KE' in said.partition('      9 ')[2]
    device.wiring = Wiring.RADIO
    with odd_line(tmp_path / 'radio', device) as name:
        found = scan(Network(com_port=name, mode='Radio', cmd_timeout=2000), [1, 9])
        assert [seen.is_there for seen in found] == [False, True]


def test_port_that_only_acknowledges_has_these_settings_and_another_station(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device = OddDevice(Wiring.FULL, 9)  # an SLC with passthru to Data Highway Plus
    device.takes = lambda data: Answer.ACK if data[0] == 9 else Answer.LOSES
    with odd_line(tmp_path / 'line', device) as name:
        assert main(['detect', '--port', name, '--timeout', '300']) == 1
        said = capsys.readouterr()
        assert said.err.splitlines()[-1] == (
            'plc: 19200 baud, full duplex, CRC: commands to station 1 are acknowledged, and no '
            'reply comes: is the number right? An SLC with passthru, or a gateway, acknowledges '
            'commands for all stations. Next: "plc scan 0-63" shows which stations reply; if it '
            'is the PLC itself, raise Cmd_Timeout')
        assert 'nothing answers' not in said.err
        assert main(['detect', '--port', name, '--timeout', '300', '--stations', '9']) == 0


def test_number_to_which_a_gateway_replies_becomes_our_station(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device = OddDevice(Wiring.FULL, 8, (0, 1))
    device.replies_to = 8
    said = detected(tmp_path / 'line', device, capsys)
    assert '--own-station 8' in said
    assert 'net.csv:\nStation,Mode,Error_Code,Com_Port,Baud,Parity,Timeout\n8,Peer,CRC' in said
