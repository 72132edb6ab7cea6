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

"""The Active Station List, the time for probes of silent stations, and the faults of frames."""

from dataclasses import asdict

from abdf1_ros.counters import Counters
from abdf1_ros.df1.accounting import Accounting, count_fault
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, FrameFault
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.probes import Asker, Probes
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.messages import Event
import pytest
from support.cases import for_all
from support.peers import CommandTask
from support.vectors import vector

REPLY = Packet(dst=5, src=7, cmd=0x4F, sts=0, tns=0x0102)


def test_station_outside_of_the_list_has_a_record_and_no_place_in_it() -> None:
    told: list[Station] = []
    stations = ActiveStationList([9], told.append)
    station = stations[3]
    assert station.active and stations[3] is station
    stations.lost(3, 1.0)
    assert not station.active
    stations.heard(3, 2.0)
    assert station.active and station.last_heard == 2.0
    assert [entry.number for entry in stations] == [9]
    assert stations.words()[0] == 1 << 9
    assert told == []


def test_station_that_comes_back_twice_without_a_reply_takes_no_commands() -> None:
    stations = ActiveStationList([7])
    found = []
    for now in range(3):
        found.append(stations[7].takes_no_commands)
        stations.lost(7, now + 0.1)
        stations.heard(7, now + 0.2)
    assert found == [False, False, True]


def test_silence_counts_from_the_loss_until_the_next_answer_and_is_told_once() -> None:
    told: list[tuple[int, bool]] = []
    stations = ActiveStationList([7], lambda station: told.append(
        (station.number, station.active)))
    assert (stations[7].last_heard, stations[7].silent_since) == (None, None)
    stations.heard(7, 1.0)
    stations.lost(7, 2.0)
    stations.lost(7, 3.0)
    assert (stations[7].last_heard, stations[7].silent_since, told) == (1.0, 2.0, [(7, False)])
    stations.heard(7, 4.0)
    stations.heard(7, 5.0)
    assert (stations[7].last_heard, stations[7].silent_since) == (5.0, None)
    assert told == [(7, False), (7, True)]


@for_all(('number', 'word', 'bit'), [
    (0, 0, 0), (15, 0, 15), (16, 1, 0), (17, 1, 1), (254, 15, 14)])
def test_active_node_table_has_a_bit_for_each_station(number: int, word: int, bit: int) -> None:
    stations = ActiveStationList([number])
    stations[number].overdue = 2  # it answers polls
    table = [0] * 16
    assert stations.words() == table[:word] + [1 << bit] + table[word + 1:]
    stations.lost(number, 0.0)
    assert stations.words() == table


@for_all('other', [{'tns': 0x0103}, {'src': 8}, {'cmd': 0x41}, {'dst': 6}])
def test_only_the_last_message_counts_as_repeated(other: dict[str, int]) -> None:
    station = Station(7, last_refused=REPLY.encode())
    packets = (REPLY, REPLY, REPLY._replace(sts=0x10, data=b'other'),
               REPLY._replace(**other), REPLY)  # type: ignore[arg-type]
    assert [station.note_new(packet) for packet in packets] == [True, False, False, True, True]
    station.forget_last()
    assert station == Station(7)


def test_stations_behind_a_gateway_are_what_it_is() -> None:
    changes: list[tuple[int, bool]] = []
    stations = ActiveStationList(
        (3, 1, 2, 2), lambda station: changes.append((station.number, station.active)),
        {2: 10, 3: 10})
    assert [(each.number, each.active) for each in stations] == [
        (1, True), (2, True), (3, True), (10, True)]
    assert [stations.via(number) for number in (1, 2, 3, 10, 77)] == [1, 10, 10, 10, 77]
    assert stations.behind(10) == [10, 2, 3]
    stations.lost(10, 5.0)
    assert changes == [(10, False), (2, False), (3, False)]
    assert stations[3].silent_since == 5.0
    assert stations.words()[0] == 0b10
    stations.heard(10, 6.0)
    assert changes[3:] == [(10, True), (2, True), (3, True)]
    assert (stations[10].last_heard, stations[2].last_heard) == (6.0, None)
    for number in (2, 3):
        stations.lost(number, 7.0)
    stations.heard(2, 8.0)  # it alone, as the gateway answered all the time
    assert changes[6:] == [(2, False), (3, False), (2, True)]


def test_seven_times_as_long_is_left_to_others() -> None:
    probes = Probes(1.0)
    assert probes.next == 0.0
    probes.spent(2.0, 10.0)
    assert probes.next == 24.0
    probes.spent(1.0, 12.0)  # two at a time
    assert probes.next == 31.0


def test_station_that_has_just_died_is_asked_at_once_for_a_message_only() -> None:
    probes = Probes(1.0)
    for now in (0.0, 4.0, 8.0):
        probes.died(2.0, now)
    assert probes.next == 15.0
    assert probes.claim_message(8.0)
    probes.spent(1.0, 9.0, Asker.MESSAGE)
    assert probes.next == 16.0 and not probes.claim_message(16.0)


def test_message_that_came_too_early_has_the_next_turn_and_the_round_the_one_after() -> None:
    probes = Probes(1.0)
    probes.spent(1.0, 1.0)
    assert probes.next == 8.0
    assert not probes.claim_message(7.9)
    assert probes.claim_message(8.0) and probes.next == 15.0
    probes.spent(1.0, 9.0, Asker.MESSAGE)
    assert probes.next == 16.0
    assert not probes.claim_message(22.9) and probes.claim_message(23.0)
    assert probes.next == 16.0  # kept for nobody: it was not the turn of a message
    probes.spent(1.0, 17.0)
    assert probes.claim_message(24.0)


def test_own_writes_take_turns_with_all_others() -> None:
    probes = Probes(1.0)
    probes.spent(1.0, 1.0, Asker.OWN)
    assert (probes.next, probes.next_own) == (8.0, 15.0)  # a read may have its turn
    probes.spent(1.0, 9.0)
    assert (probes.next, probes.next_own) == (16.0, 16.0)
    assert (probes.claim_message(15.0), probes.next_own) == (False, 23.0)
    probes.keep_none_waiting(20.0, Asker.OWN)
    assert (probes.next, probes.next_own) == (20.0, 27.0)


def test_silence_that_was_told_quickly_costs_what_it_took() -> None:
    probes = Probes(1.0)
    probes.died(0.01, 0.0)
    assert probes.next == pytest.approx(0.07)
    probes.spent(0.01, 1.0)
    assert probes.next == pytest.approx(1.07)
    assert not probes.claim_message(1.06)
    assert probes.next == pytest.approx(1.14)  # kept for a message


def test_where_none_waits_nobody_is_put_off() -> None:
    stations = ActiveStationList(  # 10 has no rows; half of the time this process stood still
        (1, 2), routes={1: 10, 2: 10}, probe_time=1.0, took=lambda begun, now: (now - begun) / 2)
    stations.lost(1, 0.0)
    stations.tried(1, 0.0, 1.0, was_silent=False)
    assert stations.probes.next == 4.5
    stations.lost(2, 2.0)
    stations.tried(2, 1.0, 2.0, was_silent=False)
    assert stations.probes.next == 2.0
    assert stations.claim_message(1, 2.0) and stations.claim_message(2, 2.0)
    stations[9].replies = 1  # only a guest asks it
    assert not stations.is_new(1)
    stations[2].replies = 1  # so 1 may be absent
    assert (stations.is_new(1), stations.is_new(2)) == (True, False)


def test_station_that_replies_too_late_is_silent_and_one_that_is_polled_is_not_asked() -> None:
    stations = ActiveStationList((1, 2, 3, 4), routes={4: 2}, probe_time=1.0,
                                 took=lambda begun, now: (now - begun) / 2)
    for number in (1, 3, 4):  # only 2 waits, which has rows and is a gateway
        stations[number].overdue = 2
    stations.tried(1, 3.0, 5.0, was_silent=True)
    assert stations.probes.next == 12.0
    stations.polled_silent(5.0, 6.0)
    assert stations.probes.next == 15.5
    stations[3].overdue = 0
    stations.add((2,), are_polled=True)
    for lost, polled in ((4, [2]), (2, [2, 4])):  # who answers for 4 shows that it is back
        stations.lost(lost, 20.0)
        assert [number for number in (1, 2, 3, 4) if stations.is_polled(number)] == polled
        assert [stations.claim_message(number, now) for now in (15.0, 20.0)
                for number in (1, 2, 4)] == [False, lost == 4, False, True, lost == 4, lost == 4]
    for asker, free in ((Asker.IN_TURN, 19.0), (Asker.OWN, 23.5)):  # kept for a message
        stations.tried(2, 19.0, 20.0, was_silent=True, asker=asker)
        assert stations.probes.next == free


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
def test_fault_has_its_counter_and_its_event(fault: FrameFault, checksum: Checksum, counter: str,
                                             event: tuple[int, ...], station: int | None) -> None:
    counters = Counters()
    said = count_fault(Frame(b'', None, fault, 0x1234, 0xABCD), checksum, counters, station)
    assert counted(counters) == {counter: 1}
    assert (said.message.number, *said.args) == event
    assert said.station == station
    count_fault(Frame(b'', None, fault), checksum, counters)
    assert counted(counters) == {counter: 2}


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
    stations[1].unanswered = 3
    told: list[Event] = []
    accounting = Accounting(Counters(), stations, told.append, 5)
    for waits in (True, False):
        task = CommandTask(Packet(1, 9, 0x0F, 0, 7, b''), lambda: 0.0)
        task.blames = blames
        accounting.complete(task, task.command.reply(sts=0x02), keeps_others_waiting=waits)
    echo = CommandTask(Packet(1, 9, 0x06, 0, 8, b''), lambda: 0.0)  # the node may execute it
    accounting.complete(echo, echo.command.reply(), keeps_others_waiting=True)
    station = stations[1]
    assert (station.local_status, station.overdue, station.unanswered) == (2 * blames, blames, 0)
    for now, sts, heard in ((1.0, 0x02, None), (2.0, 0x10, 2.0)):
        accounting.unexpected(Packet(5, 1, 0x4F, sts, 9), now)
        assert stations[1].last_heard == heard
    accounting.nak_received(1)
    assert len(told) == 7 and {event.station for event in told} == {1}
