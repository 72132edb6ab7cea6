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

"""What of the messages to write topics has been dropped on its way."""

from collections.abc import Sequence

from abdf1_ros.ros.topics.writes import LossCounter
import pytest


def losses(numbers: Sequence[int | None], publishers: int = 1) -> list[int]:
    """Return how many messages are missing before each of those with these numbers."""
    counter = LossCounter(lambda: publishers)
    return [counter.lost_before(number) for number in numbers]


def test_numbers_without_a_gap() -> None:
    assert losses([1, 2, 3, 4]) == [0, 0, 0, 0]


def test_publisher_that_has_published_before_we_came_has_lost_nothing() -> None:
    assert losses([51, 52, 53]) == [0, 0, 0]


def test_gap_is_what_was_lost() -> None:
    assert losses([1, 2, 5, 6, 10]) == [0, 0, 2, 0, 3]


def test_publisher_that_begins_anew_has_lost_nothing() -> None:
    assert losses([7, 8, 9, 1, 2, 3, 5]) == [0, 0, 0, 0, 0, 0, 1]


def test_publishers_do_not_disturb_each_other() -> None:
    assert losses([1, 101, 2, 102, 103, 3], publishers=2) == [0] * 6


def test_gap_of_one_among_several_publishers() -> None:
    assert losses([1, 101, 2, 105, 3, 106], publishers=2) == [0, 0, 0, 3, 0, 0]


def test_middleware_without_numbers_tells_nothing() -> None:
    assert losses([None, None]) == [0, 0]


@pytest.mark.parametrize('publishers', [1, 1000])
def test_numbers_of_a_few_publishers_only_are_kept(publishers: int) -> None:
    counter = LossCounter(lambda: publishers)
    for number in range(10_000, 0, -3):
        assert counter.lost_before(number) == 0
    assert len(counter._latest) == 16
