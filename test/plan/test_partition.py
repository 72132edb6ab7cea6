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

"""The cheapest way to put stretches of words into blocks."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
import math

from abdf1_ros.plan.partition import Candidate, cheapest, CostModel, partition, Span
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import groupings

COMMAND, WORD, LIMIT = 50.0, 2.0, 110
COSTS = [COMMAND + WORD * words for words in range(LIMIT + 1)]
MODEL = CostModel(COSTS)

SPANS = st.builds(lambda first, words: Span(first, first + words),
                  st.integers(0, 150), st.sampled_from([1, 1, 1, 2, 5, 20]))


def load(candidates: Iterable[Candidate], model: CostModel = MODEL) -> float:
    return sum(model.cost(entry.span) / entry.period for entry in candidates)


def least_load(wanted: Sequence[Candidate], model: CostModel = MODEL) -> float:
    """Return the least load there can be, by trying everything."""
    def joined(group: Sequence[Candidate]) -> Candidate:
        span = Span(min(entry.span.first for entry in group),
                    max(entry.span.end for entry in group))
        if len(group) > 1:
            span = span.aligned(model.per_element)
        return Candidate(span, min(entry.period for entry in group))
    return min(load(map(joined, groups), model) for groups in groupings(wanted))


@given(st.lists(st.tuples(SPANS, st.sampled_from([0.1, 0.5, 1.0])), min_size=1, max_size=6,
                unique=True))
def test_plan_of_several_periods_serves_all_and_is_never_worse_than_apart(
        wanted: list[tuple[Span, float]]) -> None:
    needed = defaultdict(list)
    for span, period in wanted:
        needed[period].append(span)
    candidates = partition(needed, MODEL, 0.0)
    for span, period in wanted:
        assert any(entry.span.holds(span) and entry.period <= period for entry in candidates)
    apart = sum(load(Candidate(span, period) for span in cheapest(spans, MODEL))
                for period, spans in needed.items())
    best = least_load([Candidate(span, period) for span, period in wanted])
    assert best * (1 - 1e-9) <= load(candidates) <= apart * (1 + 1e-9)


def test_plan_of_two_periods_is_the_best_there_is() -> None:
    """A slow one beside a fast block, one within it, and one far from it."""
    needed = {0.1: [Span(0, 10), Span(14, 16)], 1.0: [Span(12, 13), Span(16, 17), Span(60, 61)]}
    candidates = partition(needed, MODEL, 0.0)
    assert candidates == [Candidate(Span(0, 17), 0.1), Candidate(Span(60, 61), 1.0)]
    wanted = [Candidate(span, period) for period, spans in needed.items() for span in spans]
    assert load(candidates) == pytest.approx(least_load(wanted))


@given(st.lists(SPANS, min_size=1, max_size=30), st.lists(SPANS, max_size=5))
def test_blocks_hold_all_that_is_needed_within_the_limit_and_around_what_was_refused(
        spans: list[Span], refused: list[Span]) -> None:
    model = CostModel(COSTS, refused=refused)
    needed = [span for span in spans if not any(map(span.holds, refused))]
    found = cheapest(needed, model)
    assert all(any(block.holds(span) for block in found) for span in needed)
    for block in found:
        assert block.words <= LIMIT
        assert not any(map(block.holds, refused))


def test_block_that_cannot_be_has_no_price() -> None:
    model = CostModel(COSTS, refused=[Span(5, 7)])
    assert model.cost(Span(0, LIMIT)) == math.inf
    assert model.cost(Span(6, LIMIT)) < math.inf
    assert model.cost(Span(0, 6)) < math.inf
    assert model.cost(Span(10, 11 + LIMIT)) == math.inf
