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

"""Who is there: what is shown of a station, and what to look at when there is none."""

from dataclasses import replace
from pathlib import Path
import threading
import time
from types import SimpleNamespace
from typing import cast
from unittest.mock import Mock

from abdf1_ros.cli.plc import presence
from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.presence import (
    describe,
    io_access,
    look_at,
    Presence,
    scan,
    type_to_say,
)
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.diagnosis.causes import diagnose
from abdf1_ros.errors import FormatError, RemoteError, StationInactive
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.ports.descriptor import PortAround
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.gateway import SimulatedGateway
import pytest
from support.driver_bench import simulated_plc
from support.odd_device import Answer, OddDevice, Wiring
from support.plc_line import Leap, LosesPolls, LOSSY, odd_line, plc_line
from support.ptys import Pty

IDENTITY = Identity(
    'SLC', 'SLC 5/03', 'B', '3', Mode.REMOTE_PROGRAM, 'REM PROG', ('major error 0x0021',),
    ('forces active',), 'CELL_3', 0x1A2B, '16 K')


def test_everything_a_station_has_said() -> None:
    seen = Presence(2, 0.0312, IDENTITY, None, True, True)
    assert describe(seen) == [
        'station 2: SLC 5/03 series B revision 3, REM PROG', '  mode       REM PROG',
        '  faults     major error 0x0021', '  remarks    forces active', '  own name   CELL_3',
        '  program ID 0x1A2B', '  memory     16 K', '  reply      after 31 ms']
    assert describe(Presence(2, 0.0, Identity(None, 'type 7'), None, True, True)) == [
        'station 2: type 7', '  faults     none', '  reply      after 0 ms']
    assert presence.traffic(Counters(nak_retries=1, enq_retries=2)).startswith(
        'sent: 0 commands, 0 polls, 3 repetitions included; ')


@pytest.mark.parametrize('identity, option', [
    (IDENTITY, ''), (Identity(None, 'unknown processor (01)'), ' --plc-type SLC'),
    (None, ' --plc-type SLC')])
def test_next_step_for_a_plc_of_an_unknown_family_names_one(
        identity: Identity | None, option: str) -> None:
    assert type_to_say(Presence(2, 0.1, identity, None, True, True)) == option


def test_refusal_of_an_echo_proves_a_station_and_other_bytes_do_not() -> None:
    errors = None, RemoteError(0x10, None, ''), FormatError('')
    session = cast(Session, SimpleNamespace(attempt=Mock(side_effect=[(None, e) for e in errors])))
    assert [presence.understands(session, 1) for _ in errors] == [True, True, False]


@pytest.mark.parametrize(('slot', 'ways'), [(0, ['Slot', 'Flat']), (7, ['Slot', 'Flat']),
                                            (8, ['Flat'])])
def test_inputs_are_looked_for_in_the_first_slots(
        tmp_path: Path, slot: int, ways: list[str]) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic, (f'I:{slot}.0', 2))
    with plc_line(tmp_path / 'line', plc) as name, Session(
            Network(com_port=name, timeout=2000)) as session:
        assert io_access(session, look_at(session, 1)) == ways


@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_silence_and_noise(tmp_path: Path, mode: str) -> None:
    line = Pty(tmp_path / 'line')
    network = Network(com_port=str(line.name), timeout=20, mode=mode)
    with Session(network, absent=[1]) as session:
        seen = look_at(session, 1)
        assert isinstance(seen.error, StationInactive)
        sent = session.counters
        assert (sent.enq_retries, sent.commands_sent) == (0, mode == 'Peer')
        assert not seen.is_there
        assert not seen.takes_commands
        cause = str(diagnose(session.traces(1)))
        assert cause.startswith('not one character came')
        line.write(b'\x55\xaa\x00')
        assert look_at(session, 1).error is not None
        cause = str(diagnose(session.traces(1)))
        assert cause.startswith('3 characters came, and no answer that makes sense')
    line.close()


def test_poll_that_is_answered_is_a_station_though_it_takes_no_command(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    network = Network(com_port=str(line.name), timeout=1000, nak_retries=0)
    answer = threading.Thread(target=lambda: (line.read(4), line.write(b'\x10\x04')))
    answer.start()
    seen, = scan(network, [1])
    answer.join()
    line.close()
    assert seen.is_there
    assert not seen.takes_commands


def test_time_of_an_answer_begins_when_the_line_takes_commands(
        monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow:
        now = 0.0
        network = Network()
        stations = ActiveStationList()

        def settle(self) -> None:
            self.now += 0.1

        def ask(self, station: int, work: object) -> None:
            self.now += 0.01

        def attempt(self, station: int, work: object) -> tuple[None, FormatError]:
            return self.ask(station, work), FormatError('')

    session = Slow()
    monkeypatch.setattr(presence, 'time', SimpleNamespace(monotonic=lambda: session.now))
    assert presence.ping(cast(Session, session), 1) == pytest.approx(0.01)
    assert look_at(cast(Session, session), 1).seconds == pytest.approx(0.01)


def test_scan_behind_a_gateway_finds_only_who_is_there(tmp_path: Path) -> None:
    plcs = [simulated_plc(1, 'PLC5', time.monotonic), simulated_plc(2, 'SLC', time.monotonic)]
    for plc in plcs:
        plc.via = 10
    with plc_line(tmp_path / 'line', *plcs) as name:
        found = list(scan(Network(com_port=name, timeout=2000), [1, 2, 3], via=10))
    assert [seen.is_there for seen in found] == [True, True, False]
    assert [str(seen.identity)[:5] for seen in found[:2]] == ['PLC-5', 'SLC 5']
    assert 'STS 02' in str(found[2].error)


class AnswersDiagnostics(SimulatedGateway):
    """A 1770-KF2 with "execute received diagnostic commands" on: it answers 06 for every node."""

    identity = b''

    def _serve(self, command: Packet) -> Packet:
        if command.cmd == 0x06:
            return command.reply(self.identity)
        return super()._serve(command)


GATEWAYS = {
    'says what it is': bytes.fromhex('00 FE 19 00 00 00 10 00 20 00'),
    'plays an SLC': bytes.fromhex('00ee344900') + b'5/03       ' + bytes.fromhex(
        '0000260036820100')}


@pytest.mark.parametrize(('gateway', 'stations', 'expected'), [
    ('says what it is', [3, 8, 9], [(3, False, 'None'), (8, True, '1785-KE'), (9, True, 'None')]),
    ('plays an SLC', [3, 9], [(3, False, 'None'), (9, True, 'SLC 5/0')])])
def test_node_behind_a_gateway_that_answers_diagnostics_itself_is_proven_by_a_read(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gateway: str, stations: list[int],
        expected: list[tuple[int, bool, str]]) -> None:
    monkeypatch.setattr('abdf1_ros.simulator.gateway.SimulatedGateway', AnswersDiagnostics)
    monkeypatch.setattr(AnswersDiagnostics, 'identity', GATEWAYS[gateway])
    plc = simulated_plc(9, 'SLC', time.monotonic)
    plc.via = 8
    with plc_line(tmp_path / 'line', plc) as name:
        found = list(scan(Network(com_port=name, timeout=2000), stations, via=8))
    assert [(seen.station, seen.is_there, str(seen.identity)[:7]) for seen in found] == expected
    assert 'STS 02' in str(found[0].error)
    assert found[-1].identity or str(found[-1]) == (
        'answers, but does not identify itself: the gateway answers for this station, as '
        '1785-KE series B revision A')


def test_scan_asks_silent_stations_again(tmp_path: Path, leap: Leap) -> None:
    plcs = [simulated_plc(1, 'SLC', time.monotonic), simulated_plc(2, 'SLC', time.monotonic)]
    with plc_line(tmp_path / 'line', *plcs,
                  around=lambda port: LosesPolls(port, [2], leap)) as name:
        shown: list[str] = []
        found = list(scan(replace(LOSSY, com_port=name), [1, 2], show=shown.append))
    assert [(there.station, there.is_there, there.asked) for there in found] == [
        (1, True, 1), (2, True, 2)]
    assert shown == ['station 1 of 2', 'station 2 of 2', 'station 1 of 1, asked 2 times']


class Damages(PortAround):
    """A line on which each message of a station comes with a wrong check."""

    def write(self, data: bytes) -> None:
        start = data.find(b'\x10\x02')
        super().write(data if start < 0 else data[:-1] + bytes([data[-1] ^ 1]))


def test_scan_asks_more_often_while_frames_come_damaged(tmp_path: Path) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic)
    with plc_line(tmp_path / 'line', plc, around=Damages) as name:
        ended: list[Session] = []
        seen, = scan(Network(com_port=name, timeout=1000, enq_retries=0), [1],
                     ended=ended.append)
    assert (seen.is_there, seen.takes_commands, seen.asked) == (True, False, 4)
    assert [(session.silent, session.counters.damaged_frames) for session in ended] == [(1, 4)]


class DamagesOnce(Damages):
    """A line on which the first message comes with a wrong check, and no other comes."""

    is_first = True

    def write(self, data: bytes) -> None:
        if b'\x10\x02' not in data or self.is_first:
            super().write(data)
            self.is_first = b'\x10\x02' not in data


class Echoes(PortAround):
    """A line on which no station is, and our own bytes come back."""

    def read(self, timeout: float | None, wake: int) -> bytes:
        self.write(super().read(timeout, wake))
        return b''


def test_scan_takes_our_own_bytes_for_no_loss(tmp_path: Path) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic)
    with plc_line(tmp_path / 'line', plc, around=Echoes) as name:
        seen, = scan(Network(com_port=name, timeout=300, nak_retries=0, enq_retries=0), [1])
    assert (seen.is_there, seen.asked) == (False, 2)


def test_scan_says_what_was_lost_at_first_and_does_not_go_on_for_it(tmp_path: Path) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic)
    with plc_line(tmp_path / 'line', plc, around=DamagesOnce) as name:
        ended: list[Session] = []
        seen, = scan(Network(com_port=name, timeout=300, nak_retries=0, enq_retries=0), [1],
                     ended=ended.append)
    assert seen.asked == 2
    assert [(session.silent, session.counters.damaged_frames) for session in ended] == [(1, 1)]


def test_scan_says_what_came_where_noise_makes_symbols_of_the_answers(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device = OddDevice(Wiring.HALF, 1)
    device.say = lambda data: b'\x10' + bytes((data[1] ^ 0x55,)) + data[2:]
    with odd_line(tmp_path / 'line', device) as name:
        assert main(['scan', '1-2', '--port', name]) == 1
    said = capsys.readouterr()
    assert '0 of 2 stations answer; silent stations were asked 4 times' in said.out
    assert 'received: 8 characters, 0 damaged frames, 0 NAK; first bytes 10 51 ' in said.err


def passthru(station: int = 9) -> OddDevice:
    """Return an SLC of this number with passthru: it acknowledges commands for all stations."""
    device = OddDevice(Wiring.FULL, station)
    device.takes = lambda data: Answer.ACK if data[0] == station else Answer.LOSES
    return device


def test_acknowledgement_of_an_slc_with_passthru_is_no_answer_of_a_station(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    device, asked, takes = passthru(), list[int](), passthru().takes
    device.takes = lambda data: (asked.append(data[0]), takes(data))[1]
    with odd_line(tmp_path / 'line', device) as name:
        assert main(['scan', '8-10', '--peer', '--port', name]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[:1] for line in said[1:-1]] == [['9']]
    assert said[-1] == (
        '1 of 3 stations answer; of 2 only an ACK came, which a gateway, an SLC with passthru or '
        'a PLC with another number may have sent')
    assert asked == [8, 9, 10]  # each question without a reply may cost a buffer of the SLC


@pytest.mark.parametrize(('options', 'last'), [((), 24), (('--all',), 40)])
def test_scan_ends_after_five_stations_of_which_only_an_ack_came(
        options: tuple[str, ...], last: int, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    device, asked = passthru(19), list[int]()
    takes = device.takes
    device.takes = lambda data: (asked.append(data[0]), takes(data))[1]
    with odd_line(tmp_path / 'line', device) as name:
        assert main(['scan', '17-40', '--peer', '--port', name, *options]) == 0
    said = capsys.readouterr().out
    assert asked == [*range(17, last + 1)]
    assert ('16 stations were not asked' in said) == (not options)
    assert f'1 of {len(asked)} stations answer; of {len(asked) - 1} only an ACK came' in said


def test_acknowledgement_of_a_gateway_is_no_answer_of_its_node(tmp_path: Path) -> None:
    device = OddDevice(Wiring.HALF, 8, (9,))
    device.takes = lambda data: Answer.ACK if data[0] == 9 else Answer.LOSES
    with odd_line(tmp_path / 'line', device) as name:
        found = list(scan(Network(com_port=name, timeout=300, cmd_timeout=500), [9, 10], via=8))
    assert [(seen.station, seen.is_there, seen.is_only_acknowledged) for seen in found] == [
        (9, True, False), (10, False, True)]


def far_gateway() -> OddDevice:
    """Return a KF3 in full duplex: the replies of its PLC come to its own number, 8."""
    device = OddDevice(Wiring.FULL, 8, (1,))
    device.replies_to = 8
    return device


@pytest.mark.parametrize('command', [
    ('scan', '0-31'), ('read', 'N7:0', '--plc-type', 'SLC'), ('ping', '1')])
def test_number_to_which_a_gateway_replies_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], command: tuple[str, ...]) -> None:
    with odd_line(tmp_path / 'line', far_gateway()) as name:
        line = (*command, '--peer', '--port', name)
        assert main(line) == 1
        said = capsys.readouterr()
        assert 'replies come to number 8, not to ours' in said.err
        assert '--own-station 8' in said.err
        assert main([*line, '--own-station', '8']) == 0
