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

"""Mistakes and oddities in both files, and what is told of each with its place."""

from pathlib import Path

from abdf1_ros.plan.report import make_report, setting_remarks
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import load_network, Network
from abdf1_ros.settings.remarks import network_remarks
import pytest
from support.cases import for_all

HEAD = 'Tag,Command,Address,Station,PLC_Type'


def told_of_map(folder: Path, text: str) -> list[str]:
    """Return all that is told of a map, faults first; what begins with "!" is a fault."""
    path = folder / 'map.csv'
    path.write_text(text, encoding='utf-8')
    try:
        mappings, problems = load_mappings(str(path))
    except ConfigurationError as error:
        mappings, problems = [], error.problems
    report = make_report(Network(com_port='1'), mappings, 1.0)
    remarks = [remark.text for remark in report.remarks()] if mappings else []
    return [text.replace(f'{path}:', '') for text in [
        *(f'!{problem}' for problem in problems), *remarks]]


def told_of_net(folder: Path, text: str) -> list[str]:
    """Return all that is told of a net file."""
    path = folder / 'net.csv'
    path.write_text(text, encoding='utf-8')
    try:
        told = [remark.text for remark in setting_remarks(load_network(str(path)), ())]
    except ConfigurationError as error:
        told = [f'!{problem}' for problem in error.problems]
    return [text.replace(f'{path}:', '') for text in told]


ADDRESS = '!2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax '
FORM = 'write type, file, ":", element, as in N7:0, B3:1/5, T4:0.ACC or I:1.0/3'
SPREADSHEET = ('; a spreadsheet may have made a date or time of it: give the column the format '
               '"text", and write the cell again')


@for_all(('address', 'expected'), [
    *((text, FORM + SPREADSHEET) for text in (
        '07:00:00', '7:00 PM', '05. Mrz', 'Mrz 05', '3-1', '05.03.2026', '3-Jan', '3-Feb', '3-Mar',
        '3-Mär', '3-Apr', '3-May', '3-Mai', '3-Jun', '3-Jul', '3-Aug', '3-Sep', '3-Oct', '3-Okt',
        '3-Nov', '3-Dec', '3-Dez')),
    ('"=""N7:0"""', FORM + '; signs that only a spreadsheet needs: write N7:0'),
    ("'N7:0", FORM + '; signs that only a spreadsheet needs: write N7:0'),
    ('N7:0 L10', 'write N7:0, and Length 10'), ('N7:10 [10]', 'write N7:10, and Length 10'),
    ('N7:10 [' + 5000 * '9' + ']', 'an address has at most 100 characters'),
    ('N7:10 [' + 80 * '9' + ']', 'write type, file, ":", element, as in N7:0, '
     'B3:1/5, T4:0.ACC or I:1.0/3'),
    ('Ν7:0', FORM + '; character 1 is U+039D GREEK CAPITAL LETTER NU, not "N"'),
    ('В3:0', FORM + '; character 1 is U+0412 CYRILLIC CAPITAL LETTER VE, not "B"'),
    ('N７:0', FORM + '; character 2 is U+FF17 FULLWIDTH DIGIT SEVEN, not "7"'),
    ('N7：0', FORM + '; character 3 is U+FF1A FULLWIDTH COLON, not ":"'),
    ('N7:0–9', FORM + '; character 5 is U+2013 EN DASH, not "-"'), ('7:00h', FORM),
    ('N7:\x7f0', FORM + '; character 4 is U+007F'),
    ('N7:\u200b0', FORM + '; character 4 is U+200B ZERO WIDTH SPACE'),
    ('N7:\u00a00', FORM + '; character 4 is U+00A0 NO-BREAK SPACE, not " "')])
def test_address_that_cannot_be_used(tmp_path: Path, address: str, expected: str) -> None:
    told, = told_of_map(tmp_path, f'{HEAD}\na,Read,{address},1,SLC\n')
    assert told.startswith(ADDRESS)
    assert told.endswith(f'); {expected}')


@for_all(('text', 'expected'), [
    (f'{HEAD},Scale,Offset\na,Read,N7:0,1,SLC,0,1\n', [
        '!2:6 (Scale): Item: 1, Scale should not be 0; write 0.1 instead of 0,1, which are two '
        'cells']),
    (f'{HEAD},Scale,Offset\na,Read,N7:0,1,SLC,0,\n', [
        '!2:6 (Scale): Item: 1, Scale should not be 0']),
    (f'{HEAD}\n#N/A,Read,N7:0,1,SLC\n', [
        '!2:1: "#N/A" is what a spreadsheet writes where it has no value']),
    *((f'{HEAD}\n#REF!{sign}x\na,Read,N7:0,1,SLC\n', [
        '!2: this row is one cell; its cells need a comma between them, outside of quotes'])
      for sign in ';\t'),
    (f'{HEAD}\n# N/A stays a comment\n#TODO!\n#N/A yet\na,Read,N7:0,1,SLC\n', []),
    *((f'{HEAD}\na,Read,{mark},1,SLC\nb,Read,N7:1,1,SLC\n', [
        f'!2:3: "{mark}" is what a spreadsheet writes where it has no value']) for mark in (
            '#NAME?', '#NOM?', '#NV', '#DIV/0!', '#REF!', '#VALUE!', '#NULL!', '#NUM!', '#BEZUG!',
            '#WERT!', '#ZAHL!', '#VALEUR!', '#VALOR!')),
    (f'{HEAD}\na,Read\tN7:0,N7:0,1,SLC\n', [
        r'!2:2 (Command): Item: 1, Command = "Read\tN7:0" should be one of Read, Write, ReadWrite,'
        ' Serve, Heartbeat; character 5 is a tab, which divides no cells here']),
    (f'{HEAD}\na,Reаd,N7:0,1,SLC\n', [
        '!2:2 (Command): Item: 1, Command = "Reаd" should be one of Read, Write, ReadWrite, '
        'Serve, Heartbeat; character 3 is U+0430 CYRILLIC SMALL LETTER A, not "a"']),
    (f'{HEAD}\na,Read,N7:0,１,SLC\n', [
        '!2:4 (Station): 2501 ERR_BAD_STATION: Item: 1, Station = "１" should be a whole number '
        'from 0 to 254; character 1 is U+FF11 FULLWIDTH DIGIT ONE, not "1"']),
    ('Tag,Command,Address,PLC_Type\na,Read,N7:0,SLC\nb,Read,N7:1,SLC\nc,Rad,N7:2,SLC\n', [
        '!1: column Station is missing, and each row needs it']),
    ('Tag,Command,Address,Statoin,PLC_Type\na,Read,N7:0,1,SLC\n', [
        '!1:4: unknown column "Statoin"; did you mean Station?']),
    (f'{HEAD},Тype\na,Read,N7:0,1,SLC,\n', [
        '!1:6: unknown column "Тype"; character 1 is U+0422 CYRILLIC CAPITAL LETTER TE, not "T"']),
    (f'{HEAD},Lenght\na,Rad,N7:0,1,SLC,2\nb,Read,N7:0,256,SLC,\n', [
        '!1:6: unknown column "Lenght"; did you mean Length?',
        '!2:2 (Command): Item: 1, Command = "Rad" should be one of Read, Write, ReadWrite, Serve, '
        'Heartbeat',
        '!3:4 (Station): 2501 ERR_BAD_STATION: Item: 2, Invalid station number (256) must be less '
        'than 255']),
    (f'{HEAD}\na,Read,N7:0,1.0,SLC\nb,Read,ST9:0/20,1,SLC\n', [
        '!2:4 (Station): 2501 ERR_BAD_STATION: Item: 1, Station = "1.0" should be a whole number '
        'from 0 to 254: 1',
        '!3:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 2, Invalid Address Syntax (ST9:0/20); ST '
        'files have no bits to address; the length of a string is not written here']),
    (f'{HEAD},Type\na,Read,N7:255,1,SLC,int32\n', [
        '!2:3 (Address): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range (N7:255, '
        'len=1); 1 int32 from N7:255 on take 2 words; the last word there can be is N7:255']),
    (f'{HEAD},Period\na,Read,N7:0,1,SLC,0.5\n', [
        '!2:6 (Period): Item: 1, Period = "0.5" should be a whole number from 0 to 86400000 ms, '
        'or "on demand"'])])
def test_what_is_told_of_a_map(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert told_of_map(tmp_path, text) == expected


@for_all(('text', 'expected'), [
    (f'{HEAD}\na,Write,N7:0,1,SLC\nb,Write,N7:0,1,SLC\n', [
        '3: b writes N7:0, of which a also writes some or all: each row '
        'overwrites values of the other row']),
    (f'{HEAD},Length\na,Write,N7:0,1,SLC,5\nb,ReadWrite,N7:4,1,SLC,\nc,Write,N7:5,1,SLC,\n', [
        '3: b writes N7:4, of which a also writes some or all: each row '
        'overwrites values of the other row']),
    (f'{HEAD}\nword,Write,B3:0,1,SLC\nbit,Write,B3:0/5,1,SLC\nsame,Write,B3:1/5,1,SLC\n'
     'next,Write,B3:1/6,1,SLC\n', [
        '3: bit writes B3:0/5, of which word also writes some or all: each '
        'row overwrites values of the other row']),
    (f'{HEAD},Min,Max\na,Read,N7:0,1,SLC,1,5\n', [
        '2:6 (Min): Min has no effect in a Read row', '2:7 (Max): Max has no effect in a Read row',
    ]),
    (f'{HEAD},Period,Publish\na,Write,N7:0,1,SLC,100,Change\nb,Write,N7:1,1,SLC,,always\n', [
        '2:6 (Period): Period has no effect in a Write row',
        '2:7 (Publish): Publish has no effect in a Write row']),
    (f'{HEAD},Topic\na,Read,N7:0,1,SLC,/cell/x\n', [
        '2:6 (Topic): Topic "/cell/x" becomes the topic cell/x, below ~/read/ and ~/write/']),
    (f'{HEAD},Topic\na,Read,N7:0,1,SLC,Füßæøåt/éöäÄÖÜ\n', [
        '2:6 (Topic): Topic "Füßæøåt/éöäÄÖÜ" becomes the topic F_t; ROS takes A to Z, digits '
        'and _: Fuessaeoeaat/eoeaeAeOeUe in Topic reads better']),
    (f'{HEAD}\na,Read,T4:0,1,SLC\nb,Read,T4:0.ACC,1,SLC\nc,Read,T4:0/DN,1,SLC\n', [
        '2:3 (Address): T4:0 is the control word of the element; its values are T4:0.PRE, '
        'T4:0.ACC']),
    (f'{HEAD},Length\na,Read,C5:0,1,PLC5,6\n', []),
    (f'{HEAD},Length\na,Read,T4:0.PRE,1,SLC,2\n', []),
    (f'{HEAD},Length\na,Read,T4:1.ACC,1,SLC,7\n', [
        '2:6 (Length): 7 words from T4:1.ACC on are also the control word T4:2; whole elements '
        'are T4:1, and Length 9']),
    (f'{HEAD},Length,Processor\na,Read,HSC:0.LPO,1,SLC,2,ML1400\n', [
        '2:6 (Length): 2 words from HSC:0.LPO on are also the control word HSC:1']),
    (f'{HEAD}\na,Write,T4:0/DN,1,SLC\nb,Write,C5:0/CU,1,SLC\nc,Serve,C5:0/CU,5,PLC5\n'
     'd,Write,C5:0.ACC,1,SLC\n', [
         '2:2 (Command): T4:0/DN is set anew by the instruction of the timer with each scan',
         '3:2 (Command): C5:0/CU is set anew by the instruction of the counter with each scan']),
    (f'{HEAD}\nSpeed,Read,N7:0,1,SLC\nspeed,Read,N7:1,1,SLC\nspeeds,Read,N7:2,1,SLC\n', [
        'tags that differ only in capital and small letters: Speed, speed']),
    (f'{HEAD}\na,Read,L9:0,1,SLC\n', [
        '2:3 (Address): L9:0: a 5/03, the default of Processor, has no such file; '
        'ML1100, ML1200, ML1400, ML1500 may have it'])])
def test_what_is_odd_in_a_map(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert told_of_map(tmp_path, text) == expected


def test_period_that_was_meant_as_seconds(tmp_path: Path) -> None:
    told = told_of_map(tmp_path, f'{HEAD},Period\na,Read,N7:0,1,SLC,9\nb,Read,N7:1,1,SLC,10\n')
    assert told[0] == '2:6 (Period): Period 9 is in ms; 9 s would be 9000'
    assert '3:6 (Period)' not in ' '.join(told)


BEAT = f'{HEAD},Topic,While,While_Timeout\n'
NO_TOPIC = '!2:7 (While): Item: 1, no good Write, ReadWrite or Serve row has the topic '


@for_all(('requires', 'expected'), [
    *((f'"speed{sign}lamp"', f'"speed{sign}lamp"; put spaces between topics') for sign in ',;|'),
    ('level', '"level": the bridge publishes it; name topics whose messages the bridge '
     'gets'),
    ('~/write/lamp', '"~/write/lamp"; did you mean lamp?'),
    ('lamp_1', '"lamp_1"; did you mean lamp?'), ('/lamp', '"/lamp"; did you mean lamp?'),
    ('door', '"door"')])
def test_requires_that_names_no_write_topic(tmp_path: Path, requires: str, expected: str) -> None:
    told = told_of_map(tmp_path, (
        f'{BEAT}beat,Heartbeat,N10:0,1,SLC,,{requires},1000\nspeed,Write,N7:0,1,SLC,,,\n'
        'lamp_1,Write,B3:0/1,1,SLC,lamp,,\nlevel,Read,N7:1,1,SLC,,,\n'))
    assert [text for text in told if text.startswith('!')] == [NO_TOPIC + expected]


PORT = ('should be a number from 1, a device path such as /dev/ttyUSB0, socket://host:port or '
        'rfc2217://host:port')


@for_all(('text', 'expected'), [
    ('Com_Port,BaudRate\n1,9600\n', ['!1:2: unknown column "BaudRate"; did you mean Baud?']),
    ('Com_Port,Station No\n1,5\n', ['!1:2: unknown column "Station No"; did you mean Station?']),
    ('Com_Port,CmdTimeout of this line\n1,5\n', [
        '!1:2: unknown column "CmdTimeout of this line"; did you mean Cmd_Timeout?']),
    ('Station,5\nMode,Peer\nBaud,19200\n', [
        '!1: the names of the columns stand below each other here; they belong side by side into '
        'one row, and the values into the row below it']),
    ('Name;Value\nStation;5\nMode;Peer\n', [
        '!1: the names of the columns stand below each other here; they belong side by side into '
        'one row, and the values into the row below it']),
    ('Station\n5\n', [
        '2 (Com_Port): Com_Port is empty: the port is /dev/ttyS0, unless the parameter port or '
        'net.com_port names a port']),
    ('Station,Com_Port\n5,\n', [
        '2:2 (Com_Port): Com_Port is empty: the port is /dev/ttyS0, unless the parameter port '
        'or net.com_port names a port']),
    ('Station,Com_Port,Baud,Mode\n5,\n', [
        '2: the row ends before Baud, Mode: the defaults apply',
        '2:2 (Com_Port): Com_Port is empty: the port is /dev/ttyS0, unless the parameter port '
        'or net.com_port names a port']),
    ('Com_Port,Timeout\n1,1 s\n', [
        '!2:2 (Timeout): Timeout = "1 s" should be a whole number from 0 to 360000 ms']),
    ('Com_Port\n192.168.0.9:4001\n', [f'!2:1 (Com_Port): Com_Port = "192.168.0.9:4001" {PORT}; '
                                      'write socket://192.168.0.9:4001']),
    ('Com_Port\ntcp://plc:65535\n', [f'!2:1 (Com_Port): Com_Port = "tcp://plc:65535" {PORT}; '
                                     'write socket://plc:65535']),
    ('Com_Port\nsocket://plc:65536\n', [
        f'!2:1 (Com_Port): Com_Port = "socket://plc:65536" {PORT}; a port is at most 65535']),
    ('Com_Port\nsocket://192.168.0.9\n', [
        f'!2:1 (Com_Port): Com_Port = "socket://192.168.0.9" {PORT}; the port is missing, as in '
        'socket://192.168.0.9:4001']),
    ('Com_Port\nsocket://plc:４001\n', [
        f'!2:1 (Com_Port): Com_Port = "socket://plc:４001" {PORT}; "plc ports" lists the devices; '
        'character 14 is U+FF14 FULLWIDTH DIGIT FOUR, not "4"']),
    ('Com_Port\ntcp:4001\n', [
        f'!2:1 (Com_Port): Com_Port = "tcp:4001" {PORT}; "plc ports" lists the devices']),
    ('Com_Port,Share\n1,tcp:+4501\n', [
        '!2:2 (Share): Share: "tcp:+4501" should be tcp:PORT (for this machine only) or '
        'tcp:ADDRESS:PORT, with the address of an interface']),
    ('Com_Port,Mode\n1,Half\n', [
        '!2:2 (Mode): 2553 CRT_BAD_DRIVER_MODE: Invalid Driver Mode (Half), should be one of '
        'Master, Slave, Peer, Radio, or Listen']),
    ('Com_Port,Mode\n1,Peеr\n', [
        '!2:2 (Mode): 2553 CRT_BAD_DRIVER_MODE: Invalid Driver Mode (Peеr), should be one of '
        'Master, Slave, Peer, Radio, or Listen; character 3 is U+0435 CYRILLIC SMALL LETTER IE, '
        'not "e"'])])
def test_what_is_told_of_a_net_file(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert told_of_net(tmp_path, text) == expected


def test_every_fault_of_a_net_file_is_told_whatever_else_is_wrong(tmp_path: Path) -> None:
    text = ('Station,Colour,Mode,Baud,Parity,Baud\n999,red,Boss,1,x,5\n6,red,Slave,2,None,5\n'
            '7,red,Slave,9600,None,5,6\n')
    assert [told.partition(': ')[0] for told in told_of_net(tmp_path, text)] == [
        '!1:2', '!1:6', '!4:7', '!2:1 (Station)', '!2:3 (Mode)', '!2:4 (Baud)', '!2:5 (Parity)',
        '!3:4 (Baud)']


HEADER = 'Tag,Command,Address,Station,PLC_Type,Type,Topic,Min,Max,Scale'
GOOD = Network(timeout=300)


@for_all(('network', 'expected'), [
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
    (Network(store_forward='1,5'), [
        'Store_Forward is for Mode Radio; in Mode Master it has no effect']),
    (Network(collision_avoidance=True), [
        'Collision_Avoidance is for Mode Radio; in Mode Master it has no effect']),
    (Network(mode='Peer', polling='Standard'), [
        'Polling is for Mode Master; in Mode Peer it has no effect']),
    (Network(mode='Radio', station=1, store_forward='10-12'), []),
    (Network(mode='Radio', station=11, store_forward='10-12'), [
        'Store_Forward names our own Station 11; it is for nodes that hear each other only '
        'through us']),
    (Network(mode='Radio', store_forward='5,6'), [
        'Store_Forward names our own Station 5; it is for nodes that hear each other only through '
        'us']),
    *((Network(share_access=access), [
        'Share_Access is for a line with Share; it has no effect without Share'])
      for access in ('Write', 'All')),
    (Network(share='pty:/tmp/hmi', share_access='Write'), []),
    (Network(share='pty:/tmp/hmi', share_access='All'), [
        'Share_Access All: guests may change programs, passwords, modes and settings, too']),
    (Network(timeout=10_000), []),
    (Network(timeout=10_001), [
        'Timeout 10001 is in ms: the line stands still for 10 s whenever an answer gets lost'])])
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


def remarks_of(folder: Path, row: str, header: str = HEADER) -> list[str]:
    """Return the remarks about a row without the name of the file, of which it is the first."""
    path = folder / 'map.csv'
    path.write_text(f'{header}\n{row}\n', encoding='utf-8')
    (mapping,), problems = load_mappings(str(path))
    assert not problems
    return [str(remark).removeprefix(str(path)) for remark in mapping.remarks]


@for_all(('row', 'expected'), [
    ('lamp,Write,I:1.0/3,1,SLC,,,,,', [
        ':2:2 (Command): I:1.0/3 is an input: the PLC overwrites what is written there with its '
        'next scan']),
    ('lamp,Read,I:1.0/3,1,SLC,,,,,', []),
    ('mode,ReadWrite,S:1,1,PLC5,,,,,', [
        ':2:2 (Command): S2:1 is in the status file: a write may change how the processor runs']),
    ('ours,Serve,S:1,5,PLC5,,,,,', []), ('ours,Serve,L9:0,5,SLC,,,,,', []),
    ('level,Write,N7:0,1,SLC,,,-40000,40000,', [
        ':2:8 (Min): Min -40000 is below -32768, the least that int16 can hold here',
        ':2:9 (Max): Max 40000 is above 32767, the most that int16 can hold here']),
    ('level,Write,N7:0,1,SLC,,,-32768,32767,', []),
    ('level,Write,N7:0,1,SLC,uint16,,0,40000,', []),
    ('level,Serve,N7:0,5,SLC,,,,4000,0.1', [
        ':2:9 (Max): Max 4000 is above 3276.7, the most that int16 can hold here']),
    ('N7:0,Read,N7:0,1,SLC,,,,,', [':2:1 (Tag): Tag "N7:0" becomes the topic N7_0']),
    ('N7:0,Read,N7:0,1,SLC,,a b,,,', [':2:7 (Topic): Topic "a b" becomes the topic a_b']),
    ('wheel,Read,D11:0,1,PLC5,,,,,', [
        ':2:6 (Type): D11:0 holds BCD, so an empty Type is bcd16; uint16 shows its words as they '
        'are']),
    ('far,Read,N7:999-1000,1,PLC5,,,,,', [
        ':2:3 (Address): N7:1000: files of most PLC-5 end with element 999; those of a 5/40 to '
        '5/80 may have more']),
    ('far,Read,N7:999,1,PLC5,,,,,', []), ('far,Serve,N7:1200,5,PLC5,,,,,', []),
    ('wheel,Read,D11:0,1,PLC5,uint16,,,,', []), ('wheel,Read,D11:0/3,1,PLC5,,,,,', []),
    ('timer,Read,030,1,PLC2,bcd16,,,,', [
        ':2:6 (Type): 030: a PLC-2 has three digits in a word, and status bits above them: bcd12 '
        'reads and writes the digits alone']),
    ('timer,Read,030,1,PLC2,bcd12,,,,', []), ('speed,Read,N7:0,07,SLC,,,,,', []),
    ('speed,Read,N7:0,018,SLC,,,,,', [])])
def test_row_that_is_valid_and_odd(tmp_path: Path, row: str, expected: list[str]) -> None:
    assert remarks_of(tmp_path, row) == expected


HEAD_OF_WORDS = 'Tag,Command,Address,Station,PLC_Type,Length,Type,Max,Fallback,Fallback_After,' \
    'Description'


@for_all(('row', 'expected'), [
    ('door,Read,B3:0,1,SLC,12,,,,,', [
        ':2:6 (Length): Length 12 from B3:0 on is 12 words; 12 bits are B3:0/0 with Length 12. If '
        'words are meant, say so with Type uint16']),
    ('door,Read,B3:0,1,SLC,12,uint16,,,,', []), ('door,Read,B3:0,1,SLC,20,,,,,', []),
    ('door,Read,B3:0-11,1,SLC,,,,,,', []), ('door,Read,B3:0/0,1,SLC,12,,,,,', []),
    ('door,Read,B3:0/0,1,SLC,,,,,,12 bits of the cell', [
        ':2:6 (Length): Length is 1, and the Description says "12 bits"']),
    ('door,Read,B3:0/0,1,SLC,12,,,,,12 bits of the cell', []),
    ('door,Read,B3:0,1,SLC,,,,,,a word of 12 bits', []),
    ('recipe,Write,N7:0,1,SLC,,,,,,10 words', [
        ':2:6 (Length): Length is 1, and the Description says "10 words"']),
    ('recipe,Write,N7:0,1,SLC,5,float32,,,,10 words', []),
    ('job_request,Write,N7:0,1,SLC,,,,1,500,', [
        ':2:9 (Fallback): by its name this row requests something; after the last message its '
        'Fallback goes on requesting, and 0 would not']),
    ('job_request,Write,N7:0,1,SLC,,,,0,500,', []),
    ('restart_level,Write,N7:0,1,SLC,,,,5,500,', []),
    ('level,Write,N7:0,1,SLC,,,1000,,,Level [%]', [
        ':2:8 (Max): Max 1000 is in the unit of the topic, where the Description ends at 100']),
    ('speed,Write,N7:0,1,SLC,,,1500,,,0 to 15.5 m/s', [
        ':2:8 (Max): Max 1500 is in the unit of the topic, where the Description ends at 15.5']),
    ('speed,Write,N7:0,1,SLC,,,100,,,"Level 0-100 [%], zone 3-5"', []),
    ('speed,Write,N7:0,1,SLC,,,100,,,zones 3 to 5', []), ('speed,Read,N7:0,1,SLC,,,,,,[%]', [])])
def test_row_that_does_not_fit_its_own_words(
        tmp_path: Path, row: str, expected: list[str]) -> None:
    assert remarks_of(tmp_path, row, HEAD_OF_WORDS) == expected
