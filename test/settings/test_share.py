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

"""The column Share: places, and what is wrong with one."""

from pathlib import Path

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import load_network, make_network, Network
from abdf1_ros.settings.remarks import network_remarks
from abdf1_ros.settings.share import share_places, SharePlace
import pytest


@pytest.mark.parametrize(('text', 'place'), [
    ('pty:/tmp/hmi', SharePlace('pty:/tmp/hmi', 'pty', '/tmp/hmi')),
    ('tcp:4501', SharePlace('tcp:4501', 'tcp', '4501', '127.0.0.1', 4501)),
    ('tcp:0.0.0.0:4501?check=BCC', SharePlace(
        'tcp:0.0.0.0:4501?check=BCC', 'tcp', '0.0.0.0:4501', '0.0.0.0', 4501,
        check=Checksum.BCC)),
    ('tcp:[::1]:4501', SharePlace('tcp:[::1]:4501', 'tcp', '[::1]:4501', '::1', 4501)),
    ('/dev/ttyUSB1?baud=19200&check=CRC&parity=Even', SharePlace(
        '/dev/ttyUSB1?baud=19200&check=CRC&parity=Even', 'serial', '/dev/ttyUSB1', baud=19200,
        check=Checksum.CRC, parity='Even'))])
def test_place_is_a_link_a_port_or_a_device(text: str, place: SharePlace) -> None:
    assert share_places(f' {text} ') == [place]


@pytest.mark.parametrize(('text', 'words'), [
    ('hmi', '"hmi" should be pty:/a/name, tcp:PORT'), ('pty:hmi', 'pty:/a/name'),
    ('tcp:', 'tcp:PORT (for this machine only)'), ('tcp:70000', 'tcp:PORT'),
    ('tcp:plant.example:4501', 'the address of an interface'),
    ('pty:/tmp/a?baud=9600', 'only a serial device has baud'),
    ('/dev/ttyS1?speed=9600', 'after "?" may come baud=1200|'),
    ('/dev/ttyS1?check=LRC', 'check=BCC|CRC'),
    ('pty:/tmp/a pty:/tmp/a?check=BCC', 'there twice'),
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
                       ('tcp:4501', 'tcp:[::1]:4501')]:
        with pytest.raises(ValueError, match='there twice, also as'):
            share_places(f'{one} tcp:99 {other}')
    assert len(share_places('tcp:4501 tcp:4502 tcp:10.0.0.1:4501')) == 3


@pytest.mark.parametrize(('port', 'place'), [
    ('{0}/tty', '{0}/link?baud=9600'), ('{0}/link', '{0}/tty'), ('{0}/new', 'pty:{0}//new'),
    ('socket://127.0.0.1:4501', 'tcp:4501'), ('1', '/dev/ttyS0')])
def test_port_of_the_line_is_no_place(port: str, place: str, tmp_path: Path) -> None:
    (tmp_path / 'tty').touch()
    (tmp_path / 'link').symlink_to('tty')
    port, place = port.format(tmp_path), place.format(tmp_path)
    file = tmp_path / 'net.csv'
    file.write_text(f'Com_Port,Share\n{port},tcp:4502 {place}\n')
    with pytest.raises(ConfigurationError) as error:
        load_network(str(file))
    problem, = error.value.problems
    assert str(problem.place).startswith(f'{file}:2')
    assert problem.place.column == 'Share'
    assert f'"{place}" is the port of the line' in str(problem)


def test_slave_has_nothing_to_share() -> None:
    with pytest.raises(ConfigurationError) as error:
        make_network({'mode': ('Slave', 'x'), 'share': ('tcp:4501', 'x')})
    assert 'Share needs Mode Master or Peer' in str(error.value)


def test_place_that_is_open_to_other_machines_is_told() -> None:
    remarks = [*network_remarks(Network(share='pty:/tmp/a tcp:0.0.0.0:4501'))]
    assert remarks == [
        'Share tcp:0.0.0.0:4501: whoever reaches 0.0.0.0:4501 over the network can send commands '
        'to the PLC; nothing asks who it is']
    assert [*network_remarks(Network())] == []
