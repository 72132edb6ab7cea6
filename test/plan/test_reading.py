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

"""Rows that are read once, in blocks that a station may refuse."""

from collections.abc import Sequence
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import RemoteError
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Planner
from abdf1_ros.plan.reading import read_planned
import pytest
from support.driver_bench import simulated_plc
from support.mappings import make_mapping

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
    with pytest.raises(RemoteError):
        [*read_planned(PLANNER, ROWS, line)]
    assert line.asked == 1
