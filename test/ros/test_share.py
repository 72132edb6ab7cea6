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

"""A running node shares its line: an HMI reads and writes through it, and ROS is told."""

from contextlib import suppress
from pathlib import Path
import socket
import struct
from unittest.mock import Mock

from abdf1_ros.cli.sniff import main as sniff
from abdf1_ros.client import Client
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.errors import RemoteError
from abdf1_ros.ros.bridge.guests import GuestPlaces
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.share.guest_line import GuestLine
import pytest
from std_msgs.msg import Float32MultiArray
from support.device_server import OWN_HOST
from support.driver_bench import DriverBench
from support.ethernet_ip import EthernetClient
from support.mappings import make_mapping
from support.ros import Observer, OK, Process, until_status, WARN
from support.simulator_process import make_files, OFTEN


def test_hmi_reads_and_writes_through_the_node(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files, place = make_files(tmp_path), tmp_path / 'hmi'
    with (files.start_simulator(), Observer() as observer,
          Process('node', *files.args(OFTEN, f'net.share:="pty:{place}"',
                                      'net.share_access:=Write',
                                      f'trace_file:={tmp_path}/line.cap')) as node):
        setpoints = observer.listen(Float32MultiArray, '/abdf1/read/setpoint')
        diagnostics = observer.diagnostics(files.port)
        setpoints.values([21.5])
        observer.until(place.is_symlink, 'the place')  # another thread makes it
        with Client(str(place), plc_type='SLC', station=2, timeout=3.0, cmd_timeout=3.0) as hmi:
            assert hmi.read('ST9:1') == 'Tank 4'
            assert hmi.read('N7:10', 4) == [101, 102, 103, 104]
            hmi.write('N7:60', 8)  # a word that the bridge only reads
            until_status(diagnostics, 'guests', OK)
            hmi.write('F8:4', 30.5)
            setpoints.values([30.5])
            node.wait_for('[WARN] ', f'guest pty:{place} has sent to station 2: protected typed '
                          'logical write F8:4 = 30.5, words of setpoint')
            until_status(diagnostics, 'guests', WARN,
                         lambda status: '1 write to words of this bridge' in status.message)
        node.end()
    assert not place.is_symlink()
    assert sniff([str(tmp_path / 'line.cap')]) == 0
    lines = capsys.readouterr().out.splitlines()
    guests = [line for line in lines if f'| guest pty:{place} |' in line
              and not line.endswith(('RETRANSMISSION', 'DUPLICATE'))]
    assert len(guests) == 8  # four commands of it, and their replies
    assert sum('write F8:4 = 30.5' in line for line in guests) == 1
    assert len([line for line in lines if ' command ' in line]) > 10


def test_what_is_not_allowed_and_who_is_turned_away_is_told_once(tmp_path: Path) -> None:
    files = make_files(tmp_path)
    with socket.create_server((OWN_HOST, 0)) as free:
        address = OWN_HOST, int(free.getsockname()[1])
    place = f'{OWN_HOST}:{address[1]}'
    with (files.start_simulator(), Observer() as observer,
          Process('node', *files.args(f'net.share:="tcp:{place}"', 'net.share_access:=Write',
                                      'read_only:=true')) as node):
        diagnostics = observer.diagnostics(files.port)
        observer.listen(Float32MultiArray, '/abdf1/read/setpoint').values([21.5])
        until_status(diagnostics, 'guests', OK)  # another thread opens the place
        with Client(f'socket://{place}', plc_type='SLC', station=2, timeout=3.0,
                    cmd_timeout=3.0) as hmi:
            for _ in range(2):
                with pytest.raises(RemoteError):
                    hmi.write('F8:4', 30.5)
            with socket.create_connection(address) as second, suppress(ConnectionResetError):
                assert second.recv(1) == b''
            assert hmi.read('F8:4') == 21.5
        node.wait_for('[WARN] ', f'guest tcp:{place}: command refused: 0F/AA to station 2, '
                      'protected typed logical write F8:4 = 30.5; it needs Share_Access Write, '
                      'and has Read')
        node.wait_for('[WARN] ', f'guest tcp:{place}: another program, at 127.0.0.1:',
                      ', was refused: the place takes one program at a time')
        node.end()
    assert node.text.count('command refused') == 1


def test_programs_on_the_network_read_and_write_through_the_node(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = make_files(tmp_path)
    with socket.create_server((OWN_HOST, 0)) as free:
        port = int(free.getsockname()[1])
    place = f'eip:{OWN_HOST}:{port}?station=2'
    with (files.start_simulator(), Observer() as observer,
          Process('node', *files.args(OFTEN, f'net.share:="{place}"', 'net.share_access:=Write',
                                      f'trace_file:={tmp_path}/line.cap')) as node):
        setpoints = observer.listen(Float32MultiArray, '/abdf1/read/setpoint')
        diagnostics = observer.diagnostics(files.port)
        setpoints.values([21.5])
        until_status(diagnostics, 'guests', OK)
        with EthernetClient(OWN_HOST, port) as one, EthernetClient(
                OWN_HOST, port, is_connected=True) as two:
            for client in one, two:
                assert client.execute(bytes.fromhex('0F 00 0100 A2 04 07 89 0A 00')) \
                    == bytes.fromhex('4F 00 0100 6500 6600')  # N7:10
            assert one.execute(bytes.fromhex('0F 00 0200 AA 04 08 8A 04 00') + struct.pack(
                '<f', 30.5)) == bytes.fromhex('4F 00 0200')
            setpoints.values([30.5])
            assert two.execute(bytes.fromhex('07 00 0300')) == bytes.fromhex('47 60 0300')
            status = until_status(diagnostics, 'guests', WARN,
                                  lambda status: '1 command not allowed' in status.message)
        told = {entry.key: entry.value for entry in status.values}[place]
        assert told.startswith('2 clients: 127.')
        assert '(vendor 77, serial number 12345678, 2 commands)' in told
        assert '; 4 commands, 1 not allowed, 0 outside of limits, 0 without reply' in told
        node.wait_for('[WARN] ', f'guest {place} has sent to station 2: protected typed '
                      'logical write F8:4 = 30.5, words of setpoint')
        node.end()
    assert sniff([str(tmp_path / 'line.cap')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(f'| guest {place} |' in line and 'write F8:4 = 30.5' in line
               for line in lines) == 1


def told_by(notes: Mock) -> list[str]:
    return [call.args[1] for call in notes.warning.call_args_list]


def places_of(*rows: Mapping) -> tuple[GuestPlaces, Mock]:
    """Return places that tell of guests of a map, and where they tell it."""
    notes = Mock()
    return GuestPlaces(Mock(network=Network()), Mock(mappings=rows), Mock(), notes, Mock()), notes


def test_write_that_may_be_to_words_of_the_bridge_is_told_with_its_rows() -> None:
    rows = [make_mapping('N7:9', 'Heartbeat', tag='alive'), make_mapping('N7:0'),
            *(make_mapping('N7:9', 'Write', tag=tag) for tag in 'ab'),
            make_mapping('N7:9', 'Write', tag='far', station=2),
            make_mapping('N7:8', 'Serve', tag='ours', station=0)]
    places, notes = places_of(*rows)
    guest = Guest('pty:a')
    file_write = Packet(1, 0, 15, 0, 7, bytes.fromhex('03 00 00 01 00 06 07 09 11 22'))
    text = 'guest pty:a has sent to station 1: file write 00 00 01 00 06 07 09 11 22'
    for words in ([row.extent for row in rows[1::-1]], [rows[1].extent], None):
        places.wrote(guest, file_write, Flight(1, words))
    assert (guest.collisions, told_by(notes)) == (2, [
        f'{text}, words of alive, a, b',
        f'{text}, with unknown words, which may be those of alive, a, b'])
    places.wrote(guest, file_write, Flight(255, None))
    assert told_by(notes)[-1].endswith('which may be those of alive, a, b, far')


def test_first_command_that_only_all_allows_is_told_whatever_the_right_of_the_guest() -> None:
    read = Packet(1, 9, 15, 0, 7, bytes.fromhex('A2 02 07 89 00 00'))
    write = Packet(1, 9, 15, 0, 7, bytes.fromhex('AA 02 07 89 00 00 11 22'))
    ladder = Packet(1, 9, 15, 0, 7, bytes.fromhex('A2 50 02 22 00 00'))
    queue = DriverBench([make_mapping('N7:0', plc='SLC')]).driver.guests
    places, notes = places_of()
    for access in ShareAccess:
        guest = Guest('tcp:1', access, places)
        for command in (read, write, ladder, write, ladder):
            queue.put(GuestCommand(guest, command, 0.0, Mock()))
        assert (guest.beyond, guest.refused) == (2, [4, 2, 0][[*ShareAccess].index(access)])
    refused = 'guest tcp:1: command refused: 0F/A'
    assert told_by(notes) == [
        refused + 'A to station 1, protected typed logical write N7:0 = 8721; it needs '
        'Share_Access Write, and has Read',
        refused + '2 to station 1, protected typed logical read file 2 type 22 element 0, '
        '40 words; it needs Share_Access All, and has Read',
        refused + '2 to station 1, protected typed logical read file 2 type 22 element 0, '
        '40 words; it needs Share_Access All, and has Write',
        'guest tcp:1: first command that only Share_Access All allows: 0F/A2 to station 1, '
        'protected typed logical read file 2 type 22 element 0, 40 words']
    notes.reset_mock()
    no_number = bytes.fromhex('AA 04 08 8A 00 00 FF FF FF FF')
    queue.put(GuestCommand(Guest('tcp:2', ShareAccess.ALL, places),
                           Packet(255, 9, 15, 0, 7, no_number), 0.0, Mock()))
    assert ['first command' in text for text in told_by(notes)] == [True, False]


def test_first_value_outside_of_a_limit_is_told_with_tag_and_limit() -> None:
    row = make_mapping('F8:0', 'Write', plc='SLC', tag='speed', minimum=0.0, maximum=10.0)
    queue = DriverBench([row]).driver.guests
    places, notes = places_of()
    start = 'guest tcp:1: command refused: 0F/AA to station 1, protected typed logical write F8:'
    no_number = ('value nan at index 0 is not a valid float32, a number such as -1.5 or 2e3, '
                 'at most 3.4e38')
    for data, text in (
            ('00 00 00 00 30 41', '0 = 11; speed: value 11 at index 0 is outside Min 0, Max 10'),
            ('00 00 00 00 C0 7F', f'0 = nan; speed: {no_number}'),
            ('09 00 00 00 C0 7F', f'9 = nan; {no_number}')):
        guest = Guest('tcp:1', ShareAccess.WRITE, places)
        for _ in range(2):
            queue.put(GuestCommand(guest, Packet(1, 9, 15, 0, 7, bytes.fromhex(
                f'AA 04 08 8A {data}')), 0.0, Mock()))
        assert (guest.outside, told_by(notes)) == (2, [start + text])
        notes.reset_mock()


def test_internal_error_in_the_line_of_a_guest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GuestLine, 'open_port', Mock(side_effect=KeyError('a bug')))
    line, notes = Mock(network=Network(share='tcp:4501')), Mock()
    places = GuestPlaces(line, Mock(), Mock(), notes, Mock())
    for _ in range(2):
        places.start()
    places.lines[0].link.join()
    notes.error.assert_called_with('guests', (
        "internal error in the line of a guest: KeyError('a bug'); please report it"))
