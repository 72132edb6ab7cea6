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

"""What is odd about valid settings, and where it stands."""

from pathlib import Path

from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import load_network, Network
from abdf1_ros.settings.remarks import network_remarks
import pytest

HEADER = 'Tag,Command,Address,Station,PLC_Type,Type,Topic,Min,Max,Scale'
GOOD = Network(timeout=300)


@pytest.mark.parametrize(('network', 'expected'), [
    (GOOD, []),
    (Network(timeout=300, data_bits=7), [
        'Data_Bits 7: DF1 sends bytes of 8 bits; with less the check of nearly every message '
        'fails']),
    # 20 ms, and two characters of 10 bits.
    (Network(timeout=22, baud=9600), [
        'Timeout 22 ms: an ACK takes 22 ms on this line, 20 ms until a station answers and two '
        'characters at 9600 baud; answers may come too late']),
    (Network(timeout=23, baud=9600), []),
    (Network(timeout=36, baud=1200), [
        'Timeout 36 ms: an ACK takes 37 ms on this line, 20 ms until a station answers and two '
        'characters at 1200 baud; answers may come too late']),
    (Network(), []),  # S0's own; retries are never cut short by Cmd_Timeout
    (Network(timeout=300, tx_delay=500), [
        'TX_Delay 500 ms comes twice before a reply can come, which is all of Cmd_Timeout 1000 '
        'ms']),
    (Network(timeout=300, tx_delay=499), []),
    (Network(timeout=300, tx_delay=999, mode='Peer'), []),
    (Network(timeout=300, tx_delay=1000, mode='Peer'), [
        'TX_Delay 1000 ms comes once before a reply can come, which is all of Cmd_Timeout 1000 '
        'ms']),
    (Network(timeout=0, tx_delay=5000, mode='Slave'), []),
    (Network(mode='Radio', store_forward='1,2', collision_avoidance=True), []),
    (Network(store_forward='1,2', collision_avoidance=True), [
        'Store_Forward is for Mode Radio; in Mode Master it does nothing',
        'Collision_Avoidance is for Mode Radio; in Mode Master it does nothing']),
    (Network(mode='Peer', polling='Standard'), [
        'Polling is for Mode Master; in Mode Peer it does nothing']),
    (Network(mode='Radio', store_forward='5,6'), [
        'Store_Forward names our own Station 5; it is for nodes that hear each other only through '
        'us']),
    (Network(share_access='Write'), [
        'Share_Access is for a line with Share; without it it does nothing']),
    (Network(share='pty:/tmp/hmi', share_access='Write'), []),
    (Network(share='pty:/tmp/hmi', share_access='All'), [
        'Share_Access All: guests may change modes, download and reset, too']),
    (Network(timeout=10_000), []),
    (Network(timeout=36_000), [
        'Timeout 36000 is in ms: the line stands still for 36 s whenever an answer gets lost'])])
def test_settings_that_leave_no_room_or_do_nothing(network: Network, expected: list[str]) -> None:
    assert list(network_remarks(network)) == expected


@pytest.mark.parametrize(('station', 'octal'), [('017', 15), ('010', 8)])
def test_station_with_a_leading_zero_in_either_file(
        tmp_path: Path, station: str, octal: int) -> None:
    net = tmp_path / 'net.csv'
    net.write_text(f'Com_Port,Station\n1,{station}\n', encoding='utf-8')
    network = load_network(str(net))
    text = (f'Station = "{station}" is {int(station)}, decimal; an octal {station} would be '
            f'{octal}')
    assert network.station == int(station)
    assert list(network_remarks(network)) == [f'{net}:2:2 (Station): {text}']
    row = f'speed,Read,N7:0,{station},PLC5,,,,,'
    assert remarks_of(tmp_path, row) == [f':2:4 (Station): {text}']


def remarks_of(folder: Path, row: str) -> list[str]:
    """Return the remarks about a row without the name of the file, of which it is the first."""
    path = folder / 'map.csv'
    path.write_text(f'{HEADER}\n{row}\n', encoding='utf-8')
    (mapping,), problems = load_mappings(str(path))
    assert not problems
    return [str(remark).removeprefix(str(path)) for remark in mapping.remarks]


@pytest.mark.parametrize(('row', 'expected'), [
    ('lamp,Write,I:1.0/3,1,SLC,,,,,', [
        ':2:2 (Command): I:1.0/3 is an input: the PLC overwrites what is written there with its '
        'next scan']),
    ('lamp,Read,I:1.0/3,1,SLC,,,,,', []),
    ('total,Read,L10:0,1,SLC,,,,,', [
        ':2:3 (Address): L10:0: a 5/03, for which an empty Processor stands, has no such file; '
        'ML1100, ML1200, ML1400, ML1500 may have it']),
    ('mode,ReadWrite,S:1,1,PLC5,,,,,', [
        ':2:2 (Command): S2:1 is in the status file: a write may change how the processor runs']),
    ('ours,Serve,S:1,5,PLC5,,,,,', []),
    ('level,Write,N7:0,1,SLC,,,-40000,40000,', [
        ':2:8 (Min): Min -40000 is below -32768, the least that int16 can hold here',
        ':2:9 (Max): Max 40000 is above 32767, the most that int16 can hold here']),
    ('level,Write,N7:0,1,SLC,,,-32768,32767,', []),
    ('level,Write,N7:0,1,SLC,uint16,,0,40000,', []),
    ('level,Write,N7:0,1,SLC,,,,4000,0.1', [
        ':2:9 (Max): Max 4000 is above 3276.7, the most that int16 can hold here']),
    ('level,Read,N7:0,1,SLC,,,,40000,', [':2:9 (Max): Max has no effect in a Read row']),
    ('N7:0,Read,N7:0,1,SLC,,,,,', [':2:1 (Tag): Tag "N7:0" becomes the topic N7_0']),
    ('N7:0,Read,N7:0,1,SLC,,a b,,,', [':2:7 (Topic): Topic "a b" becomes the topic a_b']),
    ('N7:0,Read,N7:0,1,SLC,,/cell/speed,,,', [
        ':2:7 (Topic): Topic "/cell/speed" becomes the topic cell/speed, below ~/read/ and '
        '~/write/']),
    ('speed,Read,N7:0,07,SLC,,,,,', []),
    ('speed,Read,N7:0,018,SLC,,,,,', [])])
def test_row_that_is_valid_and_odd(tmp_path: Path, row: str, expected: list[str]) -> None:
    assert remarks_of(tmp_path, row) == expected
