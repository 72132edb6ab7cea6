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

"""The read planner: everything mapped, in packets, for the fewest characters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import itertools

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.mapping import Mapping
from abdf1_ros.driver.planner import Block, Planner
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialects import DIALECTS
from abdf1_ros.pccc.server import Server
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.mappings import make_mapping
from support.properties import PROPERTY

CHARACTER = 0.001
PLANNER = Planner(Checksum.CRC, Duplex.HALF, CHARACTER, 0.1)


def plan(*mappings: Mapping) -> list[Block]:
    return PLANNER.plan(mappings)


def spans(blocks: Iterable[Block]) -> list[tuple[str, int]]:
    """Return what the blocks' requests read, as address and words."""
    return [(str(request.start), request.words)
            for block in blocks for request in block.requests]


def cost(blocks: Iterable[Block]) -> float:
    return sum(block.line_time for block in blocks)


@st.composite
def word_mappings(draw: st.DrawFn, most: int = 8, last: int = 250) -> list[Mapping]:
    plc = draw(st.sampled_from(['PLC5', 'SLC']))
    places = draw(st.lists(
        st.tuples(st.integers(0, last), st.sampled_from([1, 1, 1, 2, 5, 30, 109, 119, 240])),
        min_size=1, max_size=most))
    return [make_mapping(f'N7:{first}', plc=plc, length=min(length, 256 - first),
                         tag=f'm{number}')
            for number, (first, length) in enumerate(places)]


@st.composite
def mixed_mappings(draw: st.DrawFn) -> list[Mapping]:
    texts = st.sampled_from([
        'N7:3', 'N7:9/4', 'N10:3', 'F8:0', 'F8:7', 'T4:0', 'T4:0.ACC', 'T4:3.PRE', 'T4:2/DN',
        'C5:1', 'B3:0/15', 'ST9:0', 'ST9:3', 'S:4', 'R6:2.LEN'])
    entries = draw(st.lists(st.tuples(
        texts, st.sampled_from(['PLC5', 'SLC']), st.integers(1, 2), st.integers(1, 40),
        st.sampled_from([None, 0, 100, 500])), max_size=10))
    return [make_mapping(
        text, plc=plc, station=station, period=period, tag=f'm{number}',
        length=1 if text.startswith('ST') else min(length, 3) if '/' in text else length)
        for number, (text, plc, station, length, period) in enumerate(entries)]


def check_plan(mappings: Sequence[Mapping], blocks: Sequence[Block]) -> None:
    """Check what every plan has to be."""
    served = [mapping for block in blocks for mapping in block.mappings]
    assert sorted(mapping.tag for mapping in served) == sorted(
        mapping.tag for mapping in mappings if mapping.reads)
    for block in blocks:
        first = block.mappings[0]
        limit = DIALECTS[first.plc_type].max_read(first.address.file_type)
        at = block.start.offset
        for request in block.requests:
            assert request.start.area == first.address.area
            assert request.start.offset == at
            assert 0 < request.words <= limit
            at += request.words
        per_element = first.address.file_type.layout.words
        if at - block.start.offset > 1:
            assert block.start.offset % per_element == at % per_element == 0
        for mapping in block.mappings:
            assert (mapping.station, mapping.address.area) == (block.station, block.start.area)
            assert block.start.offset <= mapping.address.offset
            assert mapping.address.offset + mapping.codec.words <= at
            assert block.period == (0.1 if mapping.period is None else mapping.period / 1000)
            if mapping.codec.words <= limit:
                assert len(block.requests) == 1
        if len(block.requests) > 1:
            assert len(block.mappings) == 1


@PROPERTY
@given(word_mappings())
def test_every_word_is_covered_within_the_limits(mappings: list[Mapping]) -> None:
    check_plan(mappings, plan(*mappings))


@PROPERTY
@given(mixed_mappings())
def test_nothing_is_bridged_across_files_stations_and_periods(mappings: list[Mapping]) -> None:
    blocks = plan(*mappings)
    check_plan(mappings, blocks)
    for block in blocks:
        assert len({(mapping.station, mapping.address.area, 100
                     if mapping.period is None else mapping.period)
                    for mapping in block.mappings}) == 1


def _partitions(items: list[Mapping]) -> Iterable[list[list[Mapping]]]:
    """Yield every way to put items into groups."""
    if not items:
        yield []
        return
    head, *rest = items
    for size in range(len(rest) + 1):
        for others in itertools.combinations(rest, size):
            left = [item for item in rest if item not in others]
            for groups in _partitions(left):
                yield [[head, *others], *groups]


@PROPERTY
@given(word_mappings(most=5))
def test_no_other_plan_is_cheaper(mappings: list[Mapping]) -> None:
    planned = plan(*mappings)
    dialect = planned[0].dialect
    limit = dialect.max_read(mappings[0].address.file_type)
    long = [block for block in planned if len(block.requests) > 1]
    short = [mapping for mapping in mappings if mapping.codec.words <= limit]
    best = float('inf')
    for groups in _partitions(short):
        total = 0.0
        for group in groups:
            first = min(mapping.address.offset for mapping in group)
            end = max(mapping.address.offset + mapping.codec.words for mapping in group)
            if end - first > limit:
                break
            total += _frames_time(group[0], first, end - first)
        else:
            best = min(best, total)
    # The planner takes a word's cost as constant; descriptors that grow are off by this much.
    slack = 3 * len(planned) * CHARACTER
    assert cost(planned) - cost(long) <= best + slack


def _frames_time(example: Mapping, first: int, words: int,
                 checksum: Checksum = Checksum.CRC) -> float:
    """Return the time of the frames of a real transaction."""
    table = DataTable(example.plc_type)
    start = example.address.at_offset(first)
    table.create(start, words)
    dialect = DIALECTS[example.plc_type]
    command = Packet(1, 2, dialect.cmd, 0, 0x0302, dialect.read(start, words))
    reply = Server(table).serve(command)
    assert reply.sts == 0
    characters = sum(map(len, (
        frames.master_frame(1, command.encode(), checksum), frames.ACK, frames.poll_frame(1),
        frames.message_frame(reply.encode(), checksum), frames.ACK)))
    return characters * CHARACTER


@pytest.mark.parametrize('checksum', list(Checksum))
@pytest.mark.parametrize('plc, text, length', [
    ('PLC5', 'N7:0', 1), ('PLC5', 'N7:0', 110), ('PLC5', 'N7:3', 4), ('PLC5', 'F8:0', 55),
    ('PLC5', 'F8:2', 1), ('PLC5', 'T4:0', 3), ('PLC5', 'T4:2.ACC', 1), ('PLC5', 'T4:0', 66),
    ('PLC5', 'ST9:0', 1), ('PLC5', 'C5:1', 30), ('SLC', 'N7:0', 1), ('SLC', 'N7:3', 118),
    ('SLC', 'F8:0', 9), ('SLC', 'T4:4', 9), ('SLC', 'ST9:1', 1), ('SLC', 'I:1.0', 4),
    ('SLC', 'L10:0', 20), ('PLC5', 'N7:300', 5)])
def test_line_time_is_that_of_the_real_frames(
        checksum: Checksum, plc: str, text: str, length: int) -> None:
    mapping = make_mapping(text, plc=plc, length=length)
    block, = Planner(checksum, Duplex.HALF, CHARACTER, 0.1).plan([mapping])
    assert len(block.requests) == 1
    assert block.line_time == pytest.approx(_frames_time(
        mapping, mapping.address.offset, block.requests[0].words, checksum))


def test_neighbours_are_read_together() -> None:
    assert spans(plan(*(make_mapping(f'N7:{n}') for n in range(10)))) == [('N7:0', 10)]


def test_ten_words_alone_cost_about_seven_times_as_much_as_together() -> None:
    together = cost(plan(make_mapping('N7:0', length=10)))
    alone = 10 * cost(plan(make_mapping('N7:0')))
    assert 5 < alone / together < 10


@pytest.mark.parametrize('plc', ['PLC5', 'SLC'])
def test_gap_is_bridged_exactly_while_that_is_cheaper(plc: str) -> None:
    apart = 2 * cost(plan(make_mapping('N7:0', plc=plc)))
    bridged = [len(plan(make_mapping('N7:0', plc=plc), make_mapping(f'N7:{gap}', plc=plc))) == 1
               for gap in range(1, 60)]
    cheaper = [cost(plan(make_mapping('N7:0', plc=plc, length=gap + 1))) <= apart
               for gap in range(1, 60)]
    # Off by one word at the most: the planner takes a word's cost as constant.
    assert sorted(bridged, reverse=True) == bridged
    assert abs(sum(bridged) - sum(cheaper)) <= 1
    assert 10 < sum(bridged) < 40


@pytest.mark.parametrize('one, other', [
    (make_mapping('N7:0'), make_mapping('N10:1')),
    (make_mapping('N7:0'), make_mapping('N7:1', station=2)),
    (make_mapping('N7:0'), make_mapping('N7:1', period=200)),
    (make_mapping('N7:0'), make_mapping('N7:1', plc='SLC')),
    (make_mapping('I:1.0', plc='SLC'), make_mapping('I:2.0', plc='SLC')),
    (make_mapping('I:000'), make_mapping('O:001')),
])
def test_never_read_together(one: Mapping, other: Mapping) -> None:
    assert len(plan(one, other)) == 2


def test_default_period_and_the_same_given_are_one() -> None:
    assert len(plan(make_mapping('N7:0'), make_mapping('N7:1', period=100))) == 1


def test_plc5_io_is_bridged_across_racks_and_groups() -> None:
    assert spans(plan(make_mapping('I:007/3'), make_mapping('I:011'))) == [('I:007', 3)]


@pytest.mark.parametrize('plc, limit', [('PLC5', 110), ('SLC', 118)])
def test_mapping_that_fills_a_packet_is_one_request_and_one_longer_two(
        plc: str, limit: int) -> None:
    assert spans(plan(make_mapping('N7:0', plc=plc, length=limit))) == [('N7:0', limit)]
    assert spans(plan(make_mapping('N7:0', plc=plc, length=limit + 1))) == [
        ('N7:0', limit), (f'N7:{limit}', 1)]


@pytest.mark.parametrize('plc, limit', [('PLC5', 110), ('SLC', 118)])
def test_packet_is_filled_to_its_last_word_and_no_further(plc: str, limit: int) -> None:
    first = make_mapping('N7:0', plc=plc, length=60)
    assert len(plan(first, make_mapping('N7:60', plc=plc, length=limit - 60))) == 1
    assert len(plan(first, make_mapping('N7:60', plc=plc, length=limit - 59))) == 2


def test_mapping_is_never_torn_when_neighbours_overlap_the_limit() -> None:
    blocks = plan(make_mapping('N7:0', length=60), make_mapping('N7:50', length=60),
                  make_mapping('N7:100', length=60))
    assert sorted(spans(blocks)) in (
        [('N7:0', 110), ('N7:100', 60)], [('N7:0', 60), ('N7:50', 110)])


def test_long_mapping_is_a_block_of_its_own() -> None:
    long, short = make_mapping('N7:0', length=200), make_mapping('N7:10')
    assert [block.mappings for block in plan(long, short)] == [(long,), (short,)]


def test_long_structures_are_split_between_elements() -> None:
    mapping = make_mapping('T4:0', length=100)
    block, = plan(mapping)
    assert spans([block]) == [('T4:0', 66), ('T4:22', 36)]


def test_one_member_is_read_alone_and_two_as_the_whole_element() -> None:
    assert spans(plan(make_mapping('T4:3.ACC'))) == [('T4:3.ACC', 1)]
    assert spans(plan(make_mapping('T4:3.ACC'), make_mapping('T4:3.PRE'))) == [('T4:3', 3)]


def test_mapping_inside_another_costs_nothing() -> None:
    whole, part, bit = (make_mapping('N7:0', length=20), make_mapping('N7:5', length=2),
                        make_mapping('N7:19/15'))
    block, = plan(part, whole, bit)
    assert spans([block]) == [('N7:0', 20)]
    assert set(block.mappings) == {whole, part, bit}


def test_mapping_that_only_writes_is_not_read() -> None:
    assert plan(make_mapping('N7:0', 'Write')) == []
    assert len(plan(make_mapping('N7:0', 'ReadWrite'))) == 1


def test_words_of_a_mapping_in_the_data_of_its_block() -> None:
    first, last = make_mapping('F8:1', length=2), make_mapping('F8:5')
    block, = plan(last, first)
    data = bytes(range(2 * block.requests[0].words))
    assert block.words_of(first, data) == data[:8]
    assert block.words_of(last, data) == data[16:20]


@PROPERTY
@given(word_mappings())
def test_split_halves_a_block_until_every_mapping_is_alone(mappings: list[Mapping]) -> None:
    todo = [block for block in plan(*mappings) if len(block.mappings) > 1]
    for block in todo:
        halves = PLANNER.split(block)
        assert [len(half.mappings) for half in halves] == [
            len(block.mappings) // 2, -(-len(block.mappings) // 2)]
        check_plan(block.mappings, halves)
        assert all(half.period == block.period for half in halves)
        todo += [half for half in halves if len(half.mappings) > 1]
