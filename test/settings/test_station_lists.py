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

"""Lists of stations."""

from abdf1_ros.settings.station_lists import parse_stations
import pytest


@pytest.mark.parametrize('text, stations', [
    ('', ()), ('7', (7,)), ('0-3', (0, 1, 2, 3)), ('5, 1 - 3', (5, 1, 2, 3)),
    ('1-3,2,1', (1, 2, 3)), ('254', (254,)), (',1,,', (1,))])
def test_list_may_have_single_stations_and_ranges(text: str, stations: tuple[int, ...]) -> None:
    assert parse_stations(text) == (stations, [])


@pytest.mark.parametrize('text, part', [
    ('255', '255'), ('1 2', '1 2'), ('1 2-3', '1 2-3'), ('1-', '1-'), ('5,1- ,2', '1-'),
    ('1,x', 'x'), ('3-1', '3-1'), ('-1', '-1'), ('1-2-3', '1-2-3')])
def test_part_of_a_list_that_is_no_station_is_named(text: str, part: str) -> None:
    assert parse_stations(text)[1] == [
        f'"{part}" should be a station from 0 to 254, or a range such as 3-5; '
        'put commas between them']


def test_every_fault_is_told() -> None:
    stations, faults = parse_stations('a,1,b')
    assert stations == (1,)
    assert len(faults) == 2
