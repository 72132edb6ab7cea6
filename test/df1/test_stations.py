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

"""The Active Station List."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.stations import ActiveStationList, Station
import pytest
from support.cases import for_all

REPLY = Packet(dst=5, src=7, cmd=0x4F, sts=0, tns=0x0102)


def test_every_station_counts_as_active_at_start() -> None:
    stations = ActiveStationList([9, 3, 3])
    assert [(station.number, station.active) for station in stations] == [(3, True), (9, True)]
    assert [(station.replies, station.failures, station.remote_errors, station.overdue)
            for station in stations] == 2 * [(0, 0, 0, 0)]


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


def test_changes_are_told_once() -> None:
    told: list[tuple[int, bool]] = []
    stations = ActiveStationList([7], lambda station: told.append(
        (station.number, station.active)))
    stations.heard(7, 1.0)
    assert told == []
    stations.lost(7, 2.0)
    stations.lost(7, 3.0)
    assert told == [(7, False)]
    stations.heard(7, 4.0)
    stations.heard(7, 5.0)
    assert told == [(7, False), (7, True)]


def test_station_that_comes_back_twice_without_a_reply_takes_no_commands() -> None:
    stations = ActiveStationList([7])
    found = []
    for now in range(3):
        found.append(stations[7].takes_no_commands)
        stations.lost(7, now + 0.1)
        stations.heard(7, now + 0.2)
    assert found == [False, False, True]


def test_silence_counts_from_the_loss_until_the_next_answer() -> None:
    stations = ActiveStationList([7])
    assert (stations[7].last_heard, stations[7].silent_since) == (None, None)
    stations.heard(7, 1.0)
    stations.lost(7, 2.0)
    stations.lost(7, 3.0)
    assert (stations[7].last_heard, stations[7].silent_since) == (1.0, 2.0)
    stations.heard(7, 4.0)
    assert (stations[7].last_heard, stations[7].silent_since) == (4.0, None)


@for_all(('number', 'word', 'bit'), [
    (0, 0, 0), (15, 0, 15), (16, 1, 0), (17, 1, 1), (254, 15, 14)])
def test_active_node_table_has_a_bit_for_each_station(number: int, word: int, bit: int) -> None:
    stations = ActiveStationList([number])
    table = [0] * 16
    assert stations.words() == table[:word] + [1 << bit] + table[word + 1:]
    stations.lost(number, 0.0)
    assert stations.words() == table


def test_repeated_message_is_not_accepted() -> None:
    station = Station(7)
    assert station.note_new(REPLY)
    assert not station.note_new(REPLY)
    assert not station.note_new(Packet(5, 7, 0x4F, 0x10, 0x0102, b'other'))


@pytest.mark.parametrize('other', [
    Packet(5, 7, 0x4F, 0, 0x0103), Packet(5, 8, 0x4F, 0, 0x0102), Packet(5, 7, 0x41, 0, 0x0102)])
def test_only_the_last_message_counts_as_repeated(other: Packet) -> None:
    station = Station(7)
    assert station.note_new(REPLY)
    assert station.note_new(other)
    assert station.note_new(REPLY)


def test_station_may_be_absent_beside_another_that_has_replied() -> None:
    stations = ActiveStationList((1, 2))
    assert not stations.is_new(1)
    stations[2].replies = 1
    assert (stations.is_new(1), stations.is_new(2)) == (True, False)


def test_one_late_reply_is_an_accident_and_two_are_not() -> None:
    station = Station(7)
    assert station.replies_in_time
    station.overdue = 1
    assert station.replies_in_time
    station.overdue = 2
    assert not station.replies_in_time
    assert not Station(7, active=False).replies_in_time


def test_stations_behind_a_gateway_are_what_it_is() -> None:
    changes: list[tuple[int, bool]] = []
    stations = ActiveStationList(
        (1, 2, 3), lambda station: changes.append((station.number, station.active)),
        {2: 10, 3: 10})
    assert [station.number for station in stations] == [1, 2, 3, 10]
    assert [stations.via(number) for number in (1, 2, 3, 10, 77)] == [1, 10, 10, 10, 77]
    assert stations.behind(10) == [10, 2, 3]
    stations.lost(10, 5.0)
    assert changes == [(10, False), (2, False), (3, False)]
    assert stations[3].silent_since == 5.0
    assert stations.words()[0] == 0b10
    stations.heard(10, 6.0)
    assert changes[3:] == [(10, True), (2, True), (3, True)]
    assert (stations[10].last_heard, stations[2].last_heard) == (6.0, None)
