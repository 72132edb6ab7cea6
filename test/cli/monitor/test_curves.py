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

"""Small curves of values: what is drawn, and where nothing is known."""

import math

from abdf1_ros.cli.monitor.curves import ASCII, Curve, WIDTH
from abdf1_ros.text import BARS
import pytest

NOW = 1000.0  # the beginning of a step of two seconds


def drawn(*values: tuple[float, list[float]], is_bits: bool = False, now: float = NOW,
          promised: float | None = 3.0, bars: str = BARS) -> str:
    """Return the curve of values that came so many seconds before ``NOW``."""
    curve = Curve(is_bits)
    for ago, elements in values:
        curve.take(elements, NOW - ago)
    return curve.draw(now, promised, bars)


def ramp(count: int) -> list[tuple[float, list[float]]]:
    return [(2.0 * ago, [count - ago]) for ago in reversed(range(count))]


def test_newest_value_stands_last_and_the_range_is_that_of_the_curve() -> None:
    assert drawn(*ramp(8)) == ' ' * (WIDTH - 8) + BARS
    assert drawn(*ramp(20))[0] == BARS[0]
    assert drawn(*ramp(6), bars=ASCII) == ' ' * (WIDTH - 6) + ASCII


def test_time_without_a_good_value_is_blank() -> None:
    assert drawn((20, [1]), (18, [2]), (2, [1]), (0, [2])).strip() == '▁██      ▁█'
    # Good for 5 s, from the end of its step on.
    assert drawn((0.1, [1]), promised=5.0, now=NOW + 6).strip() == '▁▁▁▁'


def test_topic_that_promises_nothing_keeps_its_value() -> None:
    assert drawn((2000, [1]), (4, [2]), promised=None) == '▁' * (WIDTH - 3) + '███'
    assert drawn((2000, [1]), promised=3.0) == ' ' * WIDTH


def test_bit_is_drawn_between_0_and_1() -> None:
    assert drawn((2, [1]), (0, [1]), is_bits=True).strip() == '██'
    assert drawn((2, [0]), (0, [0]), is_bits=True).strip() == '▁▁'
    assert drawn((2, [7]), (0, [7])).strip() == '▁▁'


def test_bit_that_blinks_faster_than_the_steps_is_seen() -> None:
    blinking = [(second / 4, [0, second % 2]) for second in reversed(range(40))]
    assert set(drawn(*blinking, is_bits=True).strip()) == {'▁', '█'}


def test_peak_within_a_step_is_seen() -> None:
    assert drawn((3, [5]), (1.9, [4]), (1.5, [9]), (1, [8])).strip() == '▁█▆'
    assert drawn((3, [9]), (1.9, [9]), (1.5, [1]), (1, [2])).strip() == '█▁▂'


def test_value_that_comes_late_in_a_step_holds_from_then_on() -> None:
    # Both come in the first of five steps.
    assert drawn((7.5, [0]), (7, [9]), promised=12.0).strip() == '▁████'


def test_first_element_that_changes_is_drawn() -> None:
    rows = [(2.0 * ago, [5, 8 - ago, ago]) for ago in reversed(range(8))]
    assert drawn(*rows).strip() == BARS


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_blank(value: float) -> None:
    assert drawn((6, [1]), (4, [value]), (2, [2]), (0, [3]), promised=2.0).strip()[0] == '▁'
    assert ' ' in drawn((6, [1]), (4, [value]), (2, [2]), (0, [3]), promised=2.0).strip()


def test_nothing_that_came_is_a_blank_curve() -> None:
    assert drawn() == drawn((0, [])) == ' ' * WIDTH


def test_rows_of_any_length_are_taken() -> None:
    assert len(drawn((4, [1] * 1000), (2, [1]), (1, []), (0, [2, 3]))) == WIDTH
