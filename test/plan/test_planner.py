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

"""The read planner: everything mapped, in packets and blocks, for the fewest characters."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
import math
from unittest.mock import Mock

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.server import Server
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.partition import Candidate, cheapest, CostModel, partition, Span
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.plan.reading import read_planned
from abdf1_ros.settings.mapping import Mapping
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all, groupings
from support.mappings import make_mapping

CHARACTER = 0.001
LINE = LineModel(Checksum.CRC, Duplex.HALF, LineTiming(CHARACTER))


def plan(*mappings: Mapping) -> list[Block]:
    return Planner(LINE, 0.1).plan(mappings)  # one that knows nothing of other tests' files


def spans(blocks: Iterable[Block]) -> list[tuple[str, int]]:
    """Return what the blocks' requests read, as address and words."""
    return [(str(request.start), request.words) for block in blocks for request in block.requests]


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
        'C5:1', 'B3:0/15', 'ST9:0', 'ST9:3', 'S:4', 'R6:2.LEN', 'PD10:0.SP', 'PD10:0.KP',
        'PD10:1.PV', 'PD10:0/MO', 'MG11:1'])
    entries = draw(st.lists(st.tuples(
        texts, st.sampled_from(['PLC5', 'SLC']), st.integers(1, 2), st.integers(1, 40),
        st.sampled_from([None, 0, 100, 500])), max_size=10))
    return [make_mapping(
        text, plc=plc, station=station, period=period, tag=f'm{number}',
        length=min(length, _longest(text)))
        for number, (text, plc, station, length, period) in enumerate(entries)
        if plc == 'PLC5' or not text.startswith('PD')]


def _longest(text: str) -> int:
    """Return how many values there can be from an address on, without another kind between."""
    if text.startswith('ST'):
        return 1
    return 3 if '/' in text else 11 if text.startswith('PD') else 40


def check_plan(mappings: Sequence[Mapping], blocks: Sequence[Block]) -> None:
    """Check what every plan has to be."""
    served = [mapping for block in blocks for mapping in block.mappings]
    assert sorted(mapping.tag for mapping in served) == sorted(
        mapping.tag for mapping in mappings if mapping.reads)
    for block in blocks:
        assert block.period == min(0.1 if mapping.period is None else mapping.period / 1000
                                   for mapping in block.mappings)
        first = block.mappings[0]
        limit = first.dialect.max_read(first.address.file_type)
        at = block.start.offset
        for request in block.requests:
            assert request.start.area == first.address.area
            assert request.start.offset == at
            assert 0 < request.words <= limit
            at += request.words
        per_element = first.address.layout.words
        words = at - block.start.offset
        if words > 1 and not block.start.is_value(words):
            assert block.start.offset % per_element == at % per_element == 0
        for mapping in block.mappings:
            assert (mapping.station, mapping.address.area) == (block.station, block.start.area)
            assert block.start.offset <= mapping.address.offset
            assert mapping.address.offset + mapping.codec.words <= at
            if mapping.codec.words <= limit:
                assert len(block.requests) == 1
        if len(block.requests) > 1:
            assert len({mapping.codec.words for mapping in block.mappings}) == 1


@given(word_mappings() | mixed_mappings())
def test_every_word_is_covered_and_nothing_is_bridged_across_files_stations_and_families(
        mappings: list[Mapping]) -> None:
    blocks = plan(*mappings)
    check_plan(mappings, blocks)
    for block in blocks:
        assert {(mapping.station, mapping.address.area) for mapping in block.mappings} == {
            (block.station, block.start.area)}


@given(word_mappings(most=5))
def test_no_other_plan_is_cheaper(mappings: list[Mapping]) -> None:
    planned = plan(*mappings)
    limit = planned[0].dialect.max_read(mappings[0].address.file_type)
    long = [block for block in planned if len(block.requests) > 1]
    short = [mapping for mapping in mappings if mapping.codec.words <= limit]
    best = float('inf')
    for groups in groupings(short):
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
    cmd, body = example.dialect.read(start, words)
    command = Packet(1, 2, cmd, 0, 0x0302, body)
    reply = Server(table).serve(command)
    assert reply.sts == 0
    characters = sum(map(len, (
        frames.master_frame(1, command.encode(), checksum), frames.ACK, frames.poll_frame(1),
        frames.message_frame(reply.encode(), checksum), frames.ACK)))
    return characters * CHARACTER


@for_all('checksum', list(Checksum))
@for_all(('plc', 'text', 'length'), [
    ('PLC5', 'N7:0', 1), ('PLC5', 'N7:0', 110), ('PLC5', 'N7:3', 4), ('PLC5', 'F8:0', 58),
    ('PLC5', 'F8:2', 1), ('PLC5', 'T4:0', 3), ('PLC5', 'T4:2.ACC', 1), ('PLC5', 'T4:0', 69),
    ('PLC5', 'PD9:0.PV', 1), ('PLC5', 'MG9:0', 112),
    ('PLC5', 'ST9:0', 1), ('PLC5', 'C5:1', 30), ('SLC', 'N7:0', 1), ('SLC', 'N7:3', 118),
    ('SLC', 'F8:0', 9), ('SLC', 'T4:4', 9), ('SLC', 'ST9:1', 1), ('SLC', 'I:1.0', 4),
    ('SLC', 'L10:0', 20), ('PLC5', 'N7:300', 5)])
def test_line_time_is_that_of_the_real_frames(
        checksum: Checksum, plc: str, text: str, length: int) -> None:
    mapping = make_mapping(text, plc=plc, length=length)
    block, = Planner(replace(LINE, checksum=checksum, wait=0.25), 0.1).plan([mapping])
    assert len(block.requests) == 1
    assert block.line_time == pytest.approx(0.25 + _frames_time(
        mapping, mapping.address.offset, block.requests[0].words, checksum))


@for_all(('texts', 'length', 'expected'), [
    ('1.SP', 1, [('PD9:1.SP', 2)]), ('1.SP 7.SP', 1, [('PD9:1.SP', 2), ('PD9:7.SP', 2)]),
    ('1.SP 1.KP', 1, [('PD9:1.KP', 2), ('PD9:1.SP', 2)]), ('1.SP 1.SP', 1, [('PD9:1.SP', 2)]),
    ('1.SP 1.KP 1.KI 1.KD 1.PV 1.ERR 1.OUT', 1, [('PD9:1', 82)]), ('1.SP', 4, [('PD9:1', 82)])])
def test_float_of_a_pid_is_read_alone_or_with_its_whole_element(
        texts: str, length: int, expected: list[tuple[str, int]]) -> None:
    rows = [make_mapping(f'PD9:{text}', length=length, tag=f'{number}')
            for number, text in enumerate(texts.split())]
    assert sorted(spans(plan(*rows))) == expected


def test_halves_of_a_block_with_a_float_are_the_floats() -> None:
    planner = Planner(LINE, 0.1)
    block, = planner.plan([
        make_mapping(f'PD9:1.{name}', tag=tag) for name, tag in (
            ('SP', 'a'), ('KP', 'b'), ('SP', 'c'), ('KD', 'd'), ('PV', 'e'))])
    halves = planner.split(block)
    assert sorted(map(len, (half.mappings for half in halves))) == [2, 3]
    assert [spans(planner.split(half)) for half in halves] == [
        [(f'PD9:1.{name}', 2) for name in names.split()] for names in ('SP KP', 'KD PV')]


@pytest.mark.parametrize('name, limit', [
    ('5/01', 41), ('ML1000', 41), ('ML1400', 103), ('5/05', 118)])
def test_blocks_are_as_long_as_the_processor_takes_them(name: str, limit: int) -> None:
    words = [make_mapping(f'N7:{n}', plc='SLC', processor=name) for n in range(limit + 1)]
    assert spans(plan(*words[:limit])) == [('N7:0', limit)]
    assert max(length for _, length in spans(plan(*words))) <= limit
    planner = Planner(LINE, 0.1)  # the map says one, the PLC the other, and the shorter one counts
    for told in (Processor.SLC_5_05, Processor.SLC_5_01):
        assert max(length for _, length in spans(planner.plan(words))) <= limit
        planner.processors[1] = told
    assert all(len(block.requests) == 1 and block.words <= 41 for block in planner.plan(words))
    assert spans(planner.plan([make_mapping('N7:0', length=110)])) == [('N7:0', 110)]  # a PLC-5


def test_words_that_are_no_value_are_told_with_their_place() -> None:
    rows = [make_mapping(), make_mapping('N7:1', kind='bcd16', tag='level')]
    line = Mock(ask=Mock(return_value=b'\x00\x00\xCD\xAB'))
    with pytest.raises(FormatError, match=r'^level \(N7:1 of station 1\): word ABCD is not BCD'):
        list(read_planned(Planner(LINE, 0.1), rows, line))


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


@for_all(('one', 'other'), [
    (make_mapping('N7:0'), make_mapping('N10:1')),
    (make_mapping('N7:0'), make_mapping('N7:1', station=2)),
    (make_mapping('N7:0', period=100), make_mapping('N7:25', period=10_000)),
    (make_mapping('N7:0'), make_mapping('N7:1', plc='SLC')),
    (make_mapping('I:1.0', plc='SLC'), make_mapping('I:2.0', plc='SLC')),
    (make_mapping('I:000'), make_mapping('O:001')),
    (make_mapping('N7:0'), make_mapping('N7:1', access='WordRange')),
    (make_mapping('000', plc='PLC2'), make_mapping('001', plc='PLC2', access='CIF'))])
def test_what_differs_in_period_station_or_file_is_not_read_together(
        one: Mapping, other: Mapping) -> None:
    assert len(plan(one, other)) == 2


@pytest.mark.parametrize('plc, limit', [('PLC5', 110), ('SLC', 118)])
def test_mapping_that_fills_a_packet_is_one_request_and_one_longer_two(
        plc: str, limit: int) -> None:
    assert spans(plan(make_mapping('N7:0', plc=plc, length=limit))) == [('N7:0', limit)]
    assert spans(plan(make_mapping('N7:0', plc=plc, length=limit + 1))) == [
        ('N7:0', limit), (f'N7:{limit}', 1)]


def test_mapping_is_never_torn_when_neighbours_overlap_the_limit() -> None:
    blocks = plan(make_mapping('N7:0', length=60), make_mapping('N7:50', length=60),
                  make_mapping('N7:100', length=60))
    assert sorted(spans(blocks)) in (
        [('N7:0', 110), ('N7:100', 60)], [('N7:0', 60), ('N7:50', 110)])


def test_long_structures_are_split_between_elements() -> None:
    block, = plan(make_mapping('T4:0', length=100))
    assert spans([block]) == [('T4:0', 69), ('T4:23', 33)]


@pytest.mark.parametrize('kind, requests', [
    ('int32', [('N7:1', 102), ('N7:103', 18)]), ('float32', [('N7:1', 102), ('N7:103', 18)]),
    ('uint16', [('N7:1', 103), ('N7:104', 17)])])
def test_no_packet_ends_within_a_value(
        kind: str, requests: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(make_mapping(plc='SLC').dialect, 'max_read', lambda file_type: 103)
    length = 60 if kind != 'uint16' else 120
    mapping = make_mapping('N7:1', plc='SLC', length=length, kind=kind)
    assert spans(plan(mapping)) == requests
    assert set(spans(plan(make_mapping('N7:1', plc='SLC', length=120), mapping))) >= set(requests)


def test_one_member_is_read_alone_and_two_as_the_whole_element() -> None:
    assert spans(plan(make_mapping('T4:3.ACC'))) == [('T4:3.ACC', 1)]
    assert spans(plan(make_mapping('T4:3.ACC'), make_mapping('T4:3.PRE'))) == [('T4:3', 3)]


def test_words_of_a_mapping_in_the_data_of_its_block() -> None:
    first, last = make_mapping('F8:1', length=2), make_mapping('F8:5')
    block, = plan(last, first)
    data = bytes(range(2 * block.requests[0].words))
    assert data[block.slice_of(first)] == data[:8]
    assert data[block.slice_of(last)] == data[16:20]


@given(word_mappings())
def test_split_halves_a_block_until_all_its_mappings_are_the_same_words(
        mappings: list[Mapping]) -> None:
    planner = Planner(LINE, 0.1)
    todo = planner.plan(mappings)
    for block in todo:
        places = {(mapping.address.offset, mapping.codec.words) for mapping in block.mappings}
        halves = planner.split(block)
        if len(places) == 1:
            sure = block.dialect.sure_read(block.start.file_type)
            assert len(halves) == (max(request.words for request in block.requests) > sure)
        else:
            assert len(halves) == 2
            check_plan(block.mappings, halves)
            left, right = ({(mapping.address.offset, mapping.codec.words)
                            for mapping in half.mappings} for half in halves)
            assert len(left) == len(places) // 2
            assert left.isdisjoint(right)
            assert max(left) < min(right)
        todo += halves


# periods


def test_string_that_is_refused_is_not_tried_in_packets_that_hold_no_string() -> None:
    planner = Planner(LINE, 0.1)
    for length, packets in ((1, []), (2, [42, 42])):
        (block,) = planner.plan([make_mapping('ST9:1', plc='SLC', length=length)])
        assert [request.words for half in planner.split(block)
                for request in half.requests] == packets


def test_slow_mapping_beside_a_fast_one_is_read_with_it_while_that_is_cheaper() -> None:
    """At a tenth of the rate, its words may cost a tenth of another transaction."""
    def blocks(gap: int, period: int) -> int:
        return len(plan(make_mapping('N7:0', period=100),
                        make_mapping(f'N7:{gap}', period=period)))

    def words(period: int) -> int:
        return sum(blocks(gap, period) == 1 for gap in range(1, 60))

    assert blocks(1, 10_000) == 2
    rows = [make_mapping('N7:1', period=200, tag='beside'), make_mapping('N7:0', period=100),
            make_mapping('N7:0', period=90_000, length=90, tag='around'),
            make_mapping('N7:0', period=95_000, tag='slow'),
            make_mapping('N7:99', period=200, tag='alone')]
    check_plan(rows, plan(*rows))
    assert sorted((block.period, len(block.mappings)) for block in plan(*rows)) == [
        (0.1, 2), (0.2, 1), (90, 2)]
    assert 1 < words(1000) < words(500) < words(200) < words(100) < 40


def test_slow_row_within_a_fast_block_is_served_by_it_and_not_by_its_slow_neighbour() -> None:
    near, within, fast = (make_mapping(f'N7:{first}', length=length, period=period) for
                          first, length, period in ((0, 1, 2000), (100, 1, 2000), (100, 20, 100)))
    assert [block.mappings for block in plan(near, within, fast)] == [(near,), (within, fast)]


def test_line_that_is_full_anyhow_reads_a_slow_mapping_with_a_fast_one() -> None:
    pair = [make_mapping('N7:0', period=100), make_mapping('N7:20', period=10_000)]
    planner = Planner(LINE, 0.1)
    for period, reads in (100, 1), (100_000, 2):  # the line can keep the longer Periods
        others = [make_mapping(f'N{file}:0', length=100, period=period) for file in range(9, 59)]
        assert len(planner.plan([*pair, *others])) == reads + len(others)


# refusals


@given(word_mappings(last=60), st.lists(st.tuples(st.integers(0, 80), st.integers(1, 4)),
                                        min_size=1, max_size=4))
def test_no_plan_holds_what_was_refused(mappings: list[Mapping],
                                        refused: list[tuple[int, int]]) -> None:
    planner = Planner(LINE, 0.1)
    area = plan(mappings[0])[0].station_area
    bad = [Span(first, first + words) for first, words in refused]
    for span in bad:
        planner.refuse(area, span)
    blocks = planner.plan(mappings)
    check_plan(mappings, blocks)
    for block in blocks:
        if any(block.span.holds(span) for span in bad):
            assert len({(mapping.address.offset, mapping.codec.words)
                        for mapping in block.mappings}) == 1
    for span in bad:
        planner.allow(area, span)
    assert planner.plan(mappings) == plan(*mappings)


def test_good_mappings_are_read_together_on_both_sides_of_a_bad_one() -> None:
    mappings = [make_mapping(f'N7:{n}') for n in range(10)]
    planner = Planner(LINE, 0.1)
    planner.refuse(plan(*mappings)[0].station_area, Span(4, 5))
    assert sorted(spans(planner.plan(mappings))) == [('N7:0', 4), ('N7:4', 1), ('N7:5', 5)]


def test_allowing_is_news_only_for_what_was_refused() -> None:
    planner = Planner(LINE, 0.1)
    area = plan(make_mapping())[0].station_area
    planner.refuse(area, Span(4, 6))
    assert not planner.allow(area, Span(5, 9))
    assert planner.allow(area, Span(3, 6))
    assert not planner.allow(area, Span(4, 6))
    rows = [make_mapping(f'N7:{first}', plc='SLC', length=109) for first in (20, 129)]
    area = plan(*rows)[0].station_area
    for block in planner.plan(rows):
        planner.shorten(planner.split(block)[0])
    planner.refuse(area, Span(20, 129))
    planner.allow(area, Span(20, 129))  # what is known of the other row stays
    assert sorted(spans(planner.plan([*rows, make_mapping('N7:238', plc='SLC')]))) == [
        ('N7:129', 54), ('N7:183', 54), ('N7:20', 109), ('N7:237', 1), ('N7:238', 1)]


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
    needed = {0.1: [Span(200, 210), Span(214, 216)],
              1.0: [Span(212, 213), Span(216, 217), Span(260, 261)]}
    candidates = partition(needed, MODEL, 0.0)
    assert candidates == [Candidate(Span(200, 217), 0.1), Candidate(Span(260, 261), 1.0)]
    wanted = [Candidate(span, period) for period, spans in needed.items() for span in spans]
    assert load(candidates) == pytest.approx(least_load(wanted))
    assert partition({0.1: [Span(0, 109)], 0.2: [Span(109, LIMIT)]}, MODEL, 0.0) == [
        Candidate(Span(0, LIMIT), 0.1)]
    needed = {1.0: [Span(225, 230)], 0.5: [Span(238, 240), Span(360, 361)], 0.1: [Span(233, 235)]}
    assert partition(needed, MODEL, 0.0) == [  # of the pair that saves most, not of the last
        Candidate(Span(225, 240), 0.5), Candidate(Span(233, 235), 0.1),
        Candidate(Span(360, 361), 0.5)]


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
    model = CostModel(COSTS, refused=[Span(5, 7), Span(0, 9)])
    assert model.cost(Span(1, LIMIT)) == math.inf
    assert model.cost(Span(6, LIMIT)) < math.inf
    assert model.cost(Span(0, 6)) < math.inf
    assert model.cost(Span(10, 11 + LIMIT)) == math.inf
