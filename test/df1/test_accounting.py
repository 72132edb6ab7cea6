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

"""What each fault of a frame is counted as and reported with."""

from dataclasses import asdict

from abdf1_ros.counters import Counters
from abdf1_ros.df1.accounting import Accounting, count_fault
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, FrameFault
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.messages import Event
import pytest
from support.cases import for_all
from support.peers import CommandTask
from support.vectors import vector


def counted(counters: Counters) -> dict[str, int]:
    """Return the counters that are not zero."""
    return {name: count for name, count in asdict(counters).items() if count}


@for_all(('fault', 'checksum', 'counter', 'event'), [
    (FrameFault.BAD_CHECK, Checksum.CRC, 'crc_errors', (2506, 0x12, 0x34, 0xAB, 0xCD)),
    (FrameFault.BAD_CHECK, Checksum.BCC, 'bcc_errors', (2507, 0x12, 0x34, 0xAB, 0xCD)),
    (FrameFault.NO_ETX, Checksum.CRC, 'invalid_messages', (2518,)),
    (FrameFault.TOO_SHORT, Checksum.BCC, 'invalid_messages', (2513, 6)),
    (FrameFault.TOO_LONG, Checksum.CRC, 'invalid_messages', (2512, 261))])
@for_all('station', [None, 7])
def test_fault_has_its_counter_and_its_event(
        fault: FrameFault, checksum: Checksum, counter: str, event: tuple[int, ...], station: int |
        None) -> None:
    counters = Counters()
    said = count_fault(Frame(b'', None, fault, 0x1234, 0xABCD), checksum, counters, station)
    assert counted(counters) == {counter: 1}
    assert (said.message.number, *said.args) == event
    assert said.station == station
    count_fault(Frame(b'', None, fault), checksum, counters)
    assert counted(counters) == {counter: 2}


def test_every_fault_is_known() -> None:
    for fault in FrameFault:
        assert count_fault(Frame(b'', None, fault), Checksum.CRC, Counters())


@pytest.mark.parametrize(('name', 'text'), [
    ('bad_crc', '2506 ERR_BAD_CRC: Response with wrong CRC'),
    ('bad_bcc', '2507 ERR_BAD_BCC: Response with wrong BCC')])
def test_texts_of_the_vectors(name: str, text: str) -> None:
    entry = vector(name)
    decoder = FrameDecoder(entry.checksum, Duplex.FULL)
    decoder.feed(entry.frame)
    frame = decoder.next_symbol()
    assert isinstance(frame, Frame)
    said = str(count_fault(frame, entry.checksum, Counters(), 3))
    actual = int.from_bytes(entry.frame[-entry.checksum.size:], 'little')
    assert said == (f'{text} (actual=0x{actual:04x}, expected=0x{entry.expected:04x}) [station 3]')


@pytest.mark.parametrize('blames', [True, False])
def test_what_a_node_on_the_way_says_to_a_guest_says_nothing_about_the_station(
        blames: bool) -> None:
    stations = ActiveStationList([1])
    accounting = Accounting(Counters(), stations, lambda event: None, 5)
    task = CommandTask(Packet(1, 9, 0x0F, 0, 7, b''), lambda: 0.0)
    task.blames = blames
    accounting.complete(task, task.command.reply(sts=0x02), keeps_others_waiting=True)
    assert (stations[1].local_status, stations[1].overdue) == ((2, 1) if blames else (0, 0))


def test_what_is_told_of_a_nak_names_the_station() -> None:
    told: list[Event] = []
    Accounting(Counters(), ActiveStationList([7]), told.append, 5).nak_received(7)
    assert [str(event).endswith('[station 7]') for event in told] == [True, True]
