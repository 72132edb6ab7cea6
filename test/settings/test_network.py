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

"""The net CSV: ranges, defaults, numbered texts, places of Share, and lists of stations."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.messages import Severity
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings import BAUD_RATES
from abdf1_ros.settings.network import (
    FIELDS,
    load_network,
    make_network,
    MODE_NAMES,
    Network,
    share_problems,
)
from abdf1_ros.settings.remarks import network_remarks
from abdf1_ros.settings.share import share_places, SharePlace, station_of
from abdf1_ros.settings.station_lists import parse_stations
import pytest
from support.cases import for_all

# Column, field, default, good values, bad values (S0, network table).
NUMBERS = [
    ('Station', 'station', 5, ('0', '1', '254'), ('-1', '255', '1.5', 'x')),
    ('NAK_Retries', 'nak_retries', 3, ('0', '10'), ('-1', '11', 'x')),
    ('ENQ_Retries', 'enq_retries', 3, ('0', '10'), ('-1', '11', 'x')),
    ('Cmd_Timeout', 'cmd_timeout', 1000, ('500', '5000'), ('499', '5001', 'x')),
    ('Baud', 'baud', 9600, tuple(map(str, BAUD_RATES)), ('0', '9601', '301', '230400', 'x')),
    ('Data_Bits', 'data_bits', 8, ('5', '6', '7', '8'), ('4', '9', 'x')),
    ('Stop_Bits', 'stop_bits', 1, ('1', '2'), ('0', '3', '1.5')),
    ('Timeout', 'timeout', 1000, ('0', '360000'), ('-1', '360001', '1 s')),
    ('TX_Delay', 'tx_delay', 0, ('0', '65535'), ('-1', '65536', '0.5'))]
CHOICES = [
    ('Mode', 'mode', 'Master', MODE_NAMES),
    ('PLC_Type', 'plc_type', 'PLC5', ('PLC2', 'PLC3', 'PLC5', 'SLC')),
    ('Error_Code', 'error_code', 'CRC', ('BCC', 'CRC')),
    ('Parity', 'parity', 'None', ('None', 'Even', 'Odd')),
    ('Handshake', 'handshake', 'No', ('Yes', 'No'))]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'net.csv'


def load(path: Path, header: str, row: str) -> Network:
    path.write_text(f'{header}\n{row}\n', encoding='utf-8')
    return load_network(str(path))


def faults(path: Path, header: str, row: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        load(path, header, row)
    return [str(problem).replace(str(path), 'FILE') for problem in caught.value.problems]


def test_columns_are_those_of_the_specification_polling_and_radio() -> None:
    assert [entry.column for entry in FIELDS.values()] == [
        'Station', 'Mode', 'PLC_Type', 'Error_Code', 'NAK_Retries', 'ENQ_Retries', 'Cmd_Timeout',
        'Com_Port', 'Baud', 'Data_Bits', 'Stop_Bits', 'Parity', 'Timeout', 'TX_Delay', 'Handshake',
        'Polling', 'Share', 'Share_Access', 'Store_Forward', 'Collision_Avoidance', 'Listen_Port']


@for_all(('column', 'field', 'default', 'good', 'bad'), NUMBERS)
def test_number_and_its_range(path: Path, column: str, field: str, default: int,
                              good: tuple[str, ...], bad: tuple[str, ...]) -> None:
    assert getattr(load(path, f'{column},Handshake', ',Yes'), field) == default
    for text in good:
        assert getattr(load(path, column, text), field) == int(text)
    for text in bad:
        fault, = faults(path, f'Handshake,{column}', f'No,{text}')
        assert fault.startswith(f'FILE:2:2 ({column}): ')
        assert fault.count(' should be ') + fault.count(' must be ') == 1  # said once
        assert f'"{text}"' in fault or f'({text})' in fault


@for_all(('column', 'field', 'default', 'good'), CHOICES)
def test_choice_in_any_letter_case(path: Path, column: str, field: str, default: str,
                                   good: tuple[str, ...]) -> None:
    assert FIELDS[field].parameter == f'net.{column.lower()}'
    assert load(path, f'{column},Station', ',7').cells()[field] == default
    for text in good:
        for written in (text, text.lower(), text.upper()):
            assert load(path, column, written).cells()[field] == text


def test_left_out_is_as_empty(path: Path) -> None:
    assert load(path, 'Com_Port,Station', ',7') == load(path, 'Station', '7') == replace(
        Network(), station=7)
    assert Network().com_port == '1'
    assert load(path, 'Parity', '-').parity == 'None'  # as the specification prints it


@for_all(('column', 'text', 'expected'), [
    ('Station', '255',
     '2552 CRT_BAD_STATION_ID: Invalid station number (255) must be less than 255'),
    ('Station', 'abc', '2552 CRT_BAD_STATION_ID: '
     'Station = "abc" should be a whole number from 0 to 254'),
    ('Mode', 'Boss',
     '2553 CRT_BAD_DRIVER_MODE: Invalid Driver Mode (Boss), should be one of Master, Slave, '
     'Peer, Radio, or Listen'),
    ('PLC_Type', 'PLC4',
     '2555 CRT_BAD_PLC_TYPE: Invalid or Unsupported PLC Type (PLC4) should be one of PLC2, '
     'PLC3, PLC5, SLC'),
    ('Error_Code', 'XOR',
     '2556 CRT_BAD_ERROR_CODE: Invalid Error Code (XOR), should be either BCC, or CRC'),
    ('NAK_Retries', '11',
     '2557 CRT_BAD_NAK_RETRIES: Invalid NAK Retries (11) should be in range [0, 10]'),
    ('ENQ_Retries', '-1',
     '2558 CRT_BAD_ENQ_RETRIES: ENQ_Retries = "-1" should be a whole number from 0 to 10'),
    ('Cmd_Timeout', '499',
     '2559 CRT_BAD_CMD_TIMEOUT: Invalid Cmd Timeout (499) should be in range [500, 5000]'),
    ('Baud', '9601',
     'Baud = "9601" should be one of 300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, '
     '115200'),
    ('Data_Bits', '9', 'Data_Bits = "9" should be a whole number from 5 to 8'),
    ('Data_Bits', '9 ~', 'Data_Bits = "9 ~" should be a whole number from 5 to 8'),
    ('Parity', 'Mark', 'Parity = "Mark" should be one of None, Even, Odd'),
    ('Handshake', 'Mars', 'Handshake = "Mars" should be one of Yes, No'),
    ('Polling', 'Mars', 'Polling = "Mars" should be one of Message, Standard'),
    ('Com_Port', 'COM1',
     'Com_Port = "COM1" should be a number from 1, a device path such as /dev/ttyUSB0, '
     'socket://host:port or rfc2217://host:port; "plc ports" lists the devices'),
    ('Com_Port', 'socket://192.168.0..9:4001',
     'Com_Port = "socket://192.168.0..9:4001" should be a number from 1, a device path such as '
     '/dev/ttyUSB0, socket://host:port or rfc2217://host:port; "192.168.0..9" is not the name of '
     'a host'),
])
def test_fault_of_a_cell_is_told_word_for_word(
        path: Path, column: str, text: str, expected: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load(path, column, text)
    problem, = caught.value.problems
    assert str(problem) == f'{path}:2:1 ({column}): {expected}'
    assert problem.message is None or problem.message.severity is Severity.CRITICAL


@for_all(('column', 'text'), [
    ('Station', 'x' * 5000), ('Mode', 'x' * 5000), ('Com_Port', 'x' * 5000),
    ('Baud', 'x' * 5000), ('Share', 'x' * 5000), ('Share', f'tcp:{"1" * 5000}'),
    ('Share', f'pty:/{"x" * 5000}?x=1'), ('Share', f'pty:/{"x" * 5000}?baud=9600'),
    ('Share', ' '.join(2 * [f'pty:/{"x" * 5000}'])), ('Store_Forward', '1' * 5000),
    ('Baud', f"'{'9' * 5000}")])
def test_long_cell_is_shown_without_its_end(path: Path, column: str, text: str) -> None:
    fault, = faults(path, column, text)
    assert (text[:90] in fault or text[:1] == "'") and '...' in fault
    assert len(fault) < 500


@for_all(('mode', 'meant'), [
    ('Full Duplex', 'Peer'), ('full-duplex', 'Peer'), ('DF1 Full Duplex', 'Peer'),
    ('Half Duplex', 'Master, or Slave where another is the master'),
    ('DF1 HALF-DUPLEX SLAVE', 'Slave')])
def test_mode_in_the_words_of_other_programs_is_translated(
        path: Path, mode: str, meant: str) -> None:
    problem, = faults(path, 'Mode', mode)
    assert problem.startswith('FILE:2:1 (Mode): 2553 CRT_BAD_DRIVER_MODE: ')
    assert problem.endswith(f'Peer, Radio, or Listen; "{mode}" is {meant}')


@for_all(('text', 'port'), [
    ('1', '/dev/ttyS0'), ('8', '/dev/ttyS7'), ('32', '/dev/ttyS31'),
    ('/dev/ttyUSB0', '/dev/ttyUSB0'),
    ('/dev/serial/by-id/usb-FTDI_x-if00', '/dev/serial/by-id/usb-FTDI_x-if00'),
    ('socket://10.0.0.7:4001', 'socket://10.0.0.7:4001'),
    ('rfc2217://host:2217', 'rfc2217://host:2217'),
    ('RFC2217://host:2217', 'RFC2217://host:2217')])
def test_com_port_may_be_a_number_a_device_or_a_url(path: Path, text: str, port: str) -> None:
    assert load(path, 'Com_Port', text).port == port


@for_all('text', ['0', '-1', '1.0', 'ttyS0', 'COM3', '²', 'a b', '1 2', '³³',
                  'socket://', 'socket://host', 'rfc2217://host:99999',
                  'socket://:4001', 'sokket://host:4001', 'loop://',
                  '://host:1', 'hwgrep://0403:6001', 'spy:///dev/ttyUSB0',
                  'alt://x:1', 'cp2110://x:1', 'socket://host:1?logging=debug',
                  'rfc2217://host:1/x', 'rfc2217://host:1#x'])
def test_com_port_that_is_no_port_is_refused(path: Path, text: str) -> None:
    fault, = faults(path, 'Com_Port', text)
    assert fault.startswith(f'FILE:2:1 (Com_Port): Com_Port = "{text}" should be a number')


@for_all(('options', 'bits'), [
    ({}, 10), ({'parity': 'Even'}, 11), ({'parity': 'Odd', 'stop_bits': 2}, 12),
    ({'data_bits': 7}, 9), ({'data_bits': 5, 'stop_bits': 2}, 8)])
def test_times_are_in_seconds(options: dict[str, Any], bits: int) -> None:
    timing = Network(baud=19200, tx_delay=40, **options).timing
    assert (timing.char_time, timing.tx_delay) == pytest.approx((bits / 19200, 0.04))
    assert Network().checksum is Checksum.CRC
    assert Network(error_code='BCC').checksum is Checksum.BCC


@pytest.mark.parametrize('content, text', [
    ('Station\n', ': a net file has one data row, this one has 0'),
    ('Station\n1\n\n2\n', ':4: a net file has one data row, this one has 2'),
    ('Station\n1\n2\n3\n', ':3: a net file has one data row, this one has 3')])
def test_file_without_exactly_one_row_is_refused(path: Path, content: str, text: str) -> None:
    path.write_text(content, encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        load_network(str(path))
    assert str(caught.value) == f'{path}{text}'


def test_overrides_keep_the_rest_of_the_base() -> None:
    remark = Problem(Place('net.csv', 2, 1, 'Com_Port'), 'Com_Port is empty')
    base = Network(station=9, baud=1200, remarks=(remark,))
    changed = make_network({'baud': ('57600', 'net.baud'), 'mode': ('master', 'net.mode')}, base)
    assert (changed, changed.remarks) == (Network(station=9, baud=57600), (remark,))
    assert make_network({}, base) == base
    assert make_network({'com_port': ('2', 'net.com_port')}, base).remarks == ()


def test_fault_of_an_override_names_the_parameter() -> None:
    with pytest.raises(ConfigurationError) as caught:
        make_network({'baud': ('1', 'net.baud'), 'station': ('-1', 'net.station')})
    assert [str(problem).split(' should')[0] for problem in caught.value.problems] == [
        'net.baud: Baud = "1"', 'net.station: 2552 CRT_BAD_STATION_ID: Station = "-1"']


def test_radio_modem_and_what_it_sends_on(path: Path) -> None:
    network = load(path, 'Mode,Store_Forward', 'Radio,"1-3, 7, 255"')
    assert (network.duplex, network.line.store_forward) == (Duplex.RADIO, (1, 2, 3, 7, 255))
    assert not network.line.avoids_collisions
    assert load(path, 'Mode,Collision_Avoidance', 'Radio,yes').line.avoids_collisions
    assert not load(path, 'Mode,Collision_Avoidance', 'Peer,Yes').line.avoids_collisions
    with pytest.raises(ConfigurationError, match='Store_Forward = "256" should be a station from'):
        load(path, 'Mode,Store_Forward', 'Radio,"1,256,x"')


@for_all(('text', 'place'), [
    ('pty:/tmp/hmi', SharePlace('pty:/tmp/hmi', 'pty', '/tmp/hmi')),
    ('tcp:4501', SharePlace('tcp:4501', 'tcp', '4501', '127.0.0.1', 4501)),
    ('tcp:0.0.0.0:4501?check=BCC', SharePlace(
        'tcp:0.0.0.0:4501?check=BCC', 'tcp', '0.0.0.0:4501', '0.0.0.0', 4501,
        check=Checksum.BCC)),
    ('tcp:[::1]:4501', SharePlace('tcp:[::1]:4501', 'tcp', '[::1]:4501', '::1', 4501)),
    ('/dev/ttyUSB1?baud=19200&check=CRC&parity=Even', SharePlace(
        '/dev/ttyUSB1?baud=19200&check=CRC&parity=Even', 'serial', '/dev/ttyUSB1', baud=19200,
        check=Checksum.CRC, parity='Even')),
    ('eip:44818', SharePlace('eip:44818', 'eip', '44818', '127.0.0.1', 44818)),
    ('eip:10.0.0.5:44818?station=0', SharePlace(
        'eip:10.0.0.5:44818?station=0', 'eip', '10.0.0.5:44818', '10.0.0.5', 44818, station=0))])
def test_place_is_a_link_a_port_or_a_device(text: str, place: SharePlace) -> None:
    assert share_places(f' {text} ') == [place]


@for_all(('text', 'words'), [
    ('hmi', '"hmi" should be pty:/a/name, tcp:PORT'), ('pty:hmi', 'pty:/a/name'),
    ('tcp:', 'tcp:PORT (for this machine only)'), ('tcp:70000', 'tcp:PORT'),
    ('tcp:0', 'tcp:PORT'), ('tcp::4501', 'tcp:PORT'),
    ('tcp:plant.example:4501', 'the address of an interface'),
    *((text, 'only a serial device has baud') for text in (
        'pty:/tmp/a?baud=9600', 'tcp:99?parity=Odd')),
    ('/dev/ttyS1?speed=9600', 'after "?" may come baud=300|'),
    ('eip:', '"eip:" should be eip:PORT (for this machine only) or eip:ADDRESS:PORT'),
    ('eip:plant.example:44818', 'eip:ADDRESS:PORT, with the address of an interface'),
    *((f'eip:44818?{option}', 'after "?" may come station=N, the PLC that answers there, 0-254')
      for option in ('baud=9600', 'check=BCC', 'parity=Odd', 'station=255', 'station=',
                     'station=x', 'station=1&baud=9600')),
    ('tcp:4501?station=1', 'after "?" may come baud=300|'),
    ('eip:44818?station=1 eip:44818?station=2', '"eip:44818" is there twice; '),
    ('/dev/ttyS1?check=LRC', 'check=BCC|CRC'), ('tcp:99?check=', 'after "?" may come'),
    ('pty:/tmp/a pty:/tmp/a?check=BCC', 'there twice; '),
    (' '.join(f'tcp:{port}' for port in range(4000, 4017)), 'the most are 16')])
def test_fault_says_what_would_be_right(text: str, words: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        make_network({'share': (text, 'net.csv:2')})
    problem, = error.value.problems
    assert words in str(problem)
    assert str(problem).startswith('net.csv:2: Share: ')


def test_place_is_one_however_it_is_written(tmp_path: Path) -> None:
    (tmp_path / 'tty').touch()
    (tmp_path / 'link').symlink_to('tty')
    (tmp_path / 'same').symlink_to('.')
    for one, other in [(f'pty:{tmp_path}/a', f'pty:{tmp_path}//a'),
                       (f'pty:{tmp_path}/a', f'pty:{tmp_path}/same/a'),
                       (f'{tmp_path}/tty', f'{tmp_path}/link?baud=9600'),
                       ('tcp:4501', 'tcp:127.0.0.1:4501'), ('tcp:4501', 'tcp:0.0.0.0:4501'),
                       ('tcp:4501', 'tcp:[::1]:4501'), ('tcp:4501', 'eip:4501?station=1'),
                       ('eip:4501', 'eip:[::1]:4501?station=2')]:
        with pytest.raises(ValueError, match='there twice, also as'):
            share_places(f'{one} tcp:99 {other}')
    assert len(share_places('tcp:4501 tcp:4502 tcp:10.0.0.1:4501')) == 3
    assert len(share_places(' '.join(f'tcp:{port}' for port in range(4000, 4016)))) == 16


@pytest.mark.parametrize(('port', 'place'), [
    ('{0}/tty', '{0}/link?baud=9600'), ('{0}/link', '{0}/tty'), ('{0}/new', 'pty:{0}//new'),
    ('{0}/link', 'pty:{0}/link'),
    ('socket://127.0.0.1:4501', 'tcp:4501'), ('socket://127.0.0.1:4501', 'eip:4501'),
    ('1', '/dev/ttyS0')])
def test_port_of_the_line_is_no_place(port: str, place: str, tmp_path: Path) -> None:
    (tmp_path / 'tty').touch()
    (tmp_path / 'link').symlink_to('tty')
    port, place = port.format(tmp_path), place.format(tmp_path)
    file = tmp_path / 'net.csv'
    file.write_text(f'Com_Port,Share\n{port},tcp:4502 {place}\n')
    with pytest.raises(ConfigurationError) as error:
        load_network(str(file))
    problem, = error.value.problems
    assert str(problem).startswith(f'{file}:2:2 (Share): Share: "{place}" is the port of the line')


@for_all(('base', 'name', 'text', 'fault'), [
    (Network(share='tcp:4501'), 'mode', 'Listen', 'Share: Share needs Mode Master or Peer: in '),
    (Network(mode='Slave'), 'share', 'tcp:4501', 'x: Share needs Mode Master or Peer: '),
    (Network(share='tcp:4501'), 'com_port', 'socket://127.0.0.1:4501', 'Share: Share: "tcp:4501"'),
    (Network(com_port='rfc2217://h:1'), 'mode', 'Listen', 'Com_Port: Com_Port: RFC 2217 '),
    (Network(mode='Listen'), 'com_port', 'rfc2217://h:1', 'x: Com_Port: RFC 2217 '),
    (Network(mode='Listen', listen_port='2'), 'com_port', '/dev/ttyS1', 'Listen_Port: Listen_P')])
def test_parameter_has_to_go_with_the_rest_of_the_file(
        base: Network, name: str, text: str, fault: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{fault}'):
        make_network({name: (text, 'x')}, base)


@for_all(('text', 'stations', 'found'), [
    ('eip:44818', (3,), 3), ('eip:44818?station=3', (3,), 3), ('eip:44818?station=2', (1, 2), 2),
    ('eip:44818?station=9', (), 9),
    ('eip:44818', (1, 2), 'which station answers there? the map has rows of 1, 2; write '
     'eip:44818?station=1'),
    ('eip:44818', (), 'which station answers there? the map has no rows; write '
     'eip:44818?station=1'),
    ('eip:44818?station=3', (1, 2), 'no row has station 3; the map has rows of 1, 2'),
    ('eip:44818?station=99', tuple(range(20)), 'has rows of 0, 1, 2, 3, 4, 5, 6, 7, ...')])
def test_ethernet_place_answers_for_one_station_of_the_map(
        text: str, stations: tuple[int, ...], found: int | str) -> None:
    network = Network(share=f'pty:/tmp/a {text}', share_at='net.csv:2')
    place = share_places(text)[0]
    if isinstance(found, int):
        assert station_of(place, stations) == found
        assert [*share_problems(network, stations)] == []
    else:
        problem, = share_problems(network, stations)
        assert str(problem).startswith(f'net.csv:2: Share: "{text}": ')
        assert found in str(problem)


def test_place_that_is_open_to_other_machines_is_told() -> None:
    places = 'tcp:0.0.0.0:4501', 'eip:10.0.0.1:9?station=1'
    remarks = network_remarks(Network(
        share=f'{places[0]} pty:/tmp/a tcp:127.0.0.2:1 {places[1]}'))
    assert [*remarks] == [
        f'Share {place}: every program that reaches {place[4:].split("?")[0]} over the network '
        'can send commands to the PLC, without a password' for place in places]
    assert [*network_remarks(Network())] == []


@for_all(('text', 'stations'), [
    ('', ()), ('7', (7,)), ('0-3', (0, 1, 2, 3)), ('5, 1 - 3', (5, 1, 2, 3)),
    ('1-3,2,1', (1, 2, 3)), ('254', (254,)), (',1,,', (1,))])
def test_list_may_have_single_stations_and_ranges(text: str, stations: tuple[int, ...]) -> None:
    assert parse_stations(text) == (stations, [])


@for_all(('text', 'part'), [
    ('255', '255'), ('1 2', '1 2'), ('1;3', '1;3'), ('1-', '1-'), ('5,1- ,2', '1-'),
    ('1,x', 'x'), ('3-1', '3-1'), ('-1', '-1'), ('1-2-3', '1-2-3'), ('a,1,b', 'a|b')])
def test_parts_of_a_list_that_are_no_station_are_named(text: str, part: str) -> None:
    assert parse_stations(text)[1] == [
        f'"{each}" should be a station from 0 to 254, or a range such as 3-5; '
        'put commas between them' for each in part.split('|')]


LISTENING = {'Com_Port': '/dev/ttyS0', 'Mode': 'Listen'}


@for_all(('cells', 'text'), [
    ({'Listen_Port': 'COM4'}, 'net.csv:2:3 (Listen_Port): Listen_Port = "COM4" should be a number '
     'from 1 or a device path such as /dev/ttyUSB1'),
    ({'Listen_Port': '0'}, 'Listen_Port = "0" should be a number from 1'),
    ({'Listen_Port': '²'}, 'Listen_Port = "²" should be a number from 1'),
    ({'Listen_Port': '1'}, '2:3 (Listen_Port): Listen_Port: 1 is the device of Com_Port, too'),
    ({'Com_Port': '1', 'Listen_Port': '/dev//ttyS0'}, '/ttyS0 is the device of Com_Port, too'),
    ({'Com_Port': 'RFC2217://h:1'}, 'RFC 2217 sets the lines of the far port'),
    ({'Com_Port': 'socket://h:1', 'Listen_Port': '/dev/ttyS1'},
     'both ports must be devices of this machine')])
def test_ports_that_cannot_be_listened_to(tmp_path: Path, cells: dict[str, str],
                                          text: str) -> None:
    columns = LISTENING | cells
    path = tmp_path / 'net.csv'
    path.write_text(f'{",".join(columns)}\n{",".join(columns.values())}\n', encoding='utf-8')
    with pytest.raises(ConfigurationError) as error:
        load_network(str(path))
    assert text in str(error.value), str(error.value)
    assert 'net.csv:2' in str(error.value)


def test_second_port_is_for_mode_listen() -> None:
    network = Network(listen_port='2', com_port='/dev/ttyS0')
    assert network.ports == ('/dev/ttyS0',)
    assert 'Listen_Port is for Mode Listen; in Mode Master it has no effect' in [
        *network_remarks(network)]
    listening = replace(network, mode='Listen')
    assert listening.ports == ('/dev/ttyS0', '/dev/ttyS1')
    assert not [*network_remarks(listening)]
    assert make_network({'com_port': ('socket://h:1', 'x')}, Network(mode='Listen'))
