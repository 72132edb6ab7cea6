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

"""The turns of those who ask silent stations, on a clock that the test moves."""

from abdf1_ros.df1.probes import Asker, Probes
from abdf1_ros.df1.stations import ActiveStationList
import pytest


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
    assert probes.next == 15.0
    assert probes.claim_message(8.0)
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
    stations = ActiveStationList((1, 2), probe_time=1.0)
    stations.lost(1, 0.0)
    stations.tried(1, 0.0, 1.0, was_silent=False)
    assert stations.probes.next == 8.0
    stations.lost(2, 2.0)
    stations.tried(2, 1.0, 2.0, was_silent=False)
    assert stations.probes.next == 2.0
    assert stations.claim_message(1, 2.0) and stations.claim_message(2, 2.0)


def test_station_that_replies_too_late_is_silent_and_one_that_is_polled_is_not_asked() -> None:
    stations = ActiveStationList((1, 2, 3), probe_time=1.0)
    stations[1].overdue = 2
    stations.tried(1, 3.0, 5.0, was_silent=True)
    assert stations.probes.next == 19.0
    stations.add((2,), are_polled=True)
    stations.lost(2, 20.0)
    assert stations.claim_message(1, 20.0) and not stations.claim_message(2, 20.0)
