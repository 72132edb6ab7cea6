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

"""Blocks that a station refuses: divided, learned, and joined again around what is bad."""

from collections.abc import Sequence
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import RemoteError
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.plan.reading import read_planned
from abdf1_ros.plan.refusals import Refusals
from abdf1_ros.settings.mapping import Mapping
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.driver_bench import simulated_plc
from support.mappings import make_mapping

LINE = LineModel(Checksum.CRC, Duplex.HALF, LineTiming(0.001))


def words(*elements: int) -> list[Mapping]:
    return [make_mapping(f'N7:{element}') for element in elements]


class Plc:
    """A PLC that lacks some words, and a driver that reads what is planned round by round."""

    def __init__(self, mappings: Sequence[Mapping], *missing: int, packet: int = 118) -> None:
        self.missing = set(missing)
        self.packet = packet
        self.refused = 0
        self.asked: list[Block] = []
        self.failed: set[str] = set()
        self._good: set[Block] = set()
        self._mappings = mappings
        self._planner = Planner(LINE, 0.1)
        self._refusals = Refusals(self._planner)
        self.blocks = self._planner.plan(mappings)

    def refuses(self, block: Block) -> bool:
        """Tell whether a word is not there, or a request is too long."""
        return any(block.span.first <= word < block.span.end for word in self.missing) \
            or any(request.words > self.packet for request in block.requests)

    def read(self, block: Block) -> bool:
        """Read a block; return whether other blocks take its place."""
        self.asked.append(block)
        tags = {mapping.tag for mapping in block.mappings}
        if self.refuses(block):
            self.refused += 1
            self.failed |= tags
            self._good.discard(block)
            change = self._refusals.refused(block, self.blocks)
        else:
            self.failed -= tags
            change = (self._refusals.read_again if block in self._good
                      else self._refusals.recovered)(block, self.blocks)
            self._good.add(block)
        if change is None:
            return False
        assert set(change.old) <= set(self.blocks)
        self.blocks = [other for other in self.blocks if other not in change.old]
        self.blocks += change.new
        self._good &= {*self.blocks}
        return True

    def settle(self) -> None:
        """Read until nothing changes any more."""
        quiet = 0
        for _ in range(1000):
            has_changed = any([block in self.blocks and self.read(block)  # noqa: C419
                               for block in list(self.blocks)])
            quiet = 0 if has_changed else quiet + 1
            if quiet == 2:  # what recovers is planned when it is read once more
                return
        raise AssertionError('it never ends')

    def spans(self) -> list[tuple[int, int]]:
        """Return first word and end of the blocks."""
        return sorted((block.span.first, block.span.end) for block in self.blocks)

    def is_as_planned(self) -> bool:
        """Tell whether the blocks are those of a plan around all that was refused."""
        return set(self.blocks) == set(self._planner.plan(self._mappings))


@for_all(('rows', 'missing', 'spans', 'refused'), [
    (words(0, 1, 2, 9, 10, 11), [5], [(0, 3), (9, 12)], 1),
    (words(0, 1, 8, 9, 16, 17, 24, 25), [20], [(0, 18), (24, 26)], 2),  # two gaps exist
    (words(0, 1, 8, 9, 16, 17, 24, 25), [4, 20], [(0, 2), (8, 18), (24, 26)], 3)])
def test_gap_that_does_not_exist_is_not_bridged_again(
        rows: list[Mapping], missing: list[int], spans: list[tuple[int, int]],
        refused: int) -> None:
    plc = Plc(rows, *missing)
    assert len(plc.blocks) == 1
    plc.settle()
    assert plc.spans() == spans
    assert not plc.failed
    plc.settle()
    assert plc.refused == refused


def test_bits_of_one_bad_word_stay_in_one_block() -> None:
    bits = [make_mapping(f'B3:4/{bit}') for bit in range(16)]
    plc = Plc([*bits, make_mapping('B3:3'), make_mapping('B3:5')], 4)
    plc.settle()
    assert plc.spans() == [(3, 4), (4, 5), (5, 6)]


@pytest.mark.parametrize(('numbers', 'missing'), [(range(20), 7), ((3,), 3)])
def test_mapping_that_has_recovered_is_read_with_its_neighbours_again(
        numbers: Sequence[int], missing: int) -> None:
    plc = Plc(words(*numbers), missing)
    plc.settle()
    assert (missing, missing + 1) in plc.spans()
    plc.missing.clear()
    plc.settle()
    assert plc.spans() == [(numbers[0], numbers[-1] + 1)]
    assert not plc.failed


def test_long_mapping_that_is_not_there_is_asked_for_in_the_shortest_packets() -> None:
    plc = Plc([make_mapping('N7:10', length=118, plc='SLC')], 11)
    plc.settle()
    assert plc.failed
    assert plc.refused < 6
    assert max(request.words for block in plc.blocks for request in block.requests) == 41


def test_what_recovers_while_a_block_is_divided_leaves_its_parts_alone() -> None:
    plc = Plc(words(*range(20)), 7)
    plc.settle()
    plc.missing = {12}
    whole = next(block for block in plc.blocks if block.span.end == 20)
    assert plc.read(whole)  # refused, and divided
    for first in (14, 7, 7):
        plc.read(next(block for block in plc.blocks if block.span.first == first))
    assert (14, 20) in plc.spans()
    plc.settle()
    assert plc.spans() == [(0, 12), (12, 13), (13, 20)]


@for_all(('places', 'packet', 'blocks'), [
    ([(0, 80), (0, 40), (40, 40)], 118, 1), ([(0, 60), (59, 59), (59, 1)], 80, 2),
    ([(0, 100), (30, 20)], 50, 2), ([(9, 1), (11, 60), (13, 1), (46, 80)], 80, 2)])
@for_all('refused', range(12))
def test_row_that_fits_is_read_in_one_packet_also_after_its_file_was_missing(
        places: list[tuple[int, int]], packet: int, blocks: int, refused: int) -> None:
    plc = Plc(rows := [make_mapping(f'N7:{first}', length=words, plc='SLC')
                       for first, words in places], packet=packet)
    for _ in range(2):  # after the second time as after the first
        for number in range(refused):
            plc.missing = {*range(118)}
            plc.read(plc.blocks[number % len(plc.blocks)])
        plc.missing.clear()
        plc.settle()
        assert {mapping: len(block.requests) for block in plc.blocks
                for mapping in block.mappings} == {row: 1 + (row.length > packet) for row in rows}
        assert refused or len(plc.blocks) == blocks


def test_processor_that_is_exchanged_has_its_own_packets() -> None:
    refusals = Refusals(planner := Planner(LINE, 0.1))
    blocks = planner.plan([make_mapping('N7:110', plc='SLC', period=10_000), *(
        make_mapping(text, plc='SLC') for text in (
            'ST9:0', *(f'N7:{word}' for word in range(100)))),  # a 5/01 has no string file
        *(make_mapping(f'N{file}:0', station=2, length=100) for file in range(10, 60))])
    assert refusals.processor_told(1, Processor.SLC_5_05, blocks) is None  # the line is as full
    change = refusals.processor_told(1, Processor.SLC_5_01, blocks)
    assert change and max(block.words for block in change.new) <= 41


def test_word_that_was_refused_alone_is_not_read_with_others_after_a_search() -> None:
    plc = Plc(words(*range(110), 115), 50, 115)
    assert plc.spans() == [(0, 110), (115, 116)]
    plc.settle()
    assert plc.spans() == [(0, 50), (50, 51), (51, 110), (115, 116)]
    assert all(block.words == 1 for block in plc.asked if block.span.end == 116)
    plc = Plc(words(*range(110)))
    plc.packet = 80  # both halves are good, and stay apart
    plc.settle()
    assert (plc.spans(), plc.refused) == ([(0, 55), (55, 110)], 1)


def test_each_file_that_comes_back_is_planned_once() -> None:
    plc = Plc([make_mapping(f'N{file}:{word}') for word in range(50) for file in (7, 9)],
              *range(50))
    plc.settle()
    assert len(plc.blocks) == 100
    plc.missing.clear()
    first, second, *rest = plc.blocks  # others may be read twice before the last has recovered
    changes = [plc.read(block) for block in (first, second, first, *rest, *plc.blocks)
               if block in plc.blocks]
    assert changes.count(True) == 2
    assert plc.spans() == [(0, 50), (0, 50)]


@given(st.lists(st.tuples(st.integers(0, 80), st.sampled_from([1, 1, 1, 2, 5])), min_size=1,
                max_size=25), st.sets(st.integers(0, 90), max_size=6))
def test_only_mappings_that_are_not_there_fail_and_the_rest_is_read_as_planned(
        places: list[tuple[int, int]], missing: set[int]) -> None:
    mappings = [make_mapping(f'N7:{first}', length=length, tag=f'm{number}', item=number)
                for number, (first, length) in enumerate(places)]
    plc = Plc(mappings, *missing)
    plc.settle()
    assert plc.is_as_planned()
    bad = {mapping.tag for mapping in mappings if missing.intersection(
        range(mapping.address.offset, mapping.address.offset + mapping.length))}
    assert plc.failed == bad
    read = [mapping.tag for block in plc.blocks for mapping in block.mappings]
    assert sorted(read) == sorted(mapping.tag for mapping in mappings)
    for block in plc.blocks:
        if plc.refuses(block):
            assert len({(mapping.address, mapping.length) for mapping in block.mappings}) == 1
    plc.missing.clear()
    plc.settle()
    assert not plc.failed and plc.is_as_planned()


PLANNER = Planner(LineModel(Checksum.CRC, Duplex.HALF, LineTiming(0.001)), 1.0)
ROWS = [make_mapping(text) for text in ('N7:0', 'N7:1', 'N7:2', 'N9:0')]


class Line:
    """A line to a PLC that refuses some of what it is asked for, counted from 1."""

    def __init__(self, refused: Sequence[int], sts: int) -> None:
        self.asked = 0
        self._refused, self._sts = refused, sts
        self._plc = simulated_plc(1, 'PLC5', lambda: 0.0, ('N7:0', 3), ('N9:0', 1))

    def ask(self, station: int, work: Steps[Any]) -> Any:
        """Carry out the steps."""
        self.asked += 1
        if self.asked in self._refused:
            raise RemoteError(self._sts, None, 'refused')
        request = next(work)
        try:
            while True:
                cmd, data = request
                request = work.send(self._plc.serve(Packet(station, 0, cmd, 0, 1, data)))
        except StopIteration as end:
            return end.value


def test_rows_after_a_refused_block_are_read_all_the_same() -> None:
    line = Line([1, 3], 0x10)
    found = read_planned(PLANNER, ROWS, line)
    assert [(str(row.address), [*values]) for row, values in found] == [
        (text, [0]) for text in ('N7:0', 'N7:1', 'N7:2', 'N9:0')]
    assert line.asked == 6  # one half of the block is refused, too


def test_row_that_is_refused_by_itself_is_named() -> None:
    with pytest.raises(RemoteError) as error:
        [*read_planned(PLANNER, ROWS, Line(range(1, 9), 0x10))]
    assert str(error.value) == f'{ROWS[0].tag} (N7:0 of station 1): refused'


def test_block_that_is_refused_for_another_reason_is_not_divided() -> None:
    line = Line([1], 0xF0)
    with pytest.raises(RemoteError, match=r'^N7:2.*, N7:1.*, N7:0.* \(N7:0 of station 1\)'):
        [*read_planned(PLANNER, ROWS[2::-1], line)]
    assert line.asked == 1
