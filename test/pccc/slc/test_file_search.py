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

"""The file directory of an SLC or MicroLogix: recorded, emulated, and of strange bytes."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc.file_search import SlcFileSearch
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.processors import ML1400

ALL_SLC = ('O:2.0', 2), ('I:1.0', 1), ('I:3.0', 4), ('S:0', 33), ('N7:0', 90), ('ST20:0', 84)


def steps_of(processor: Processor) -> Steps[list[DataFile]]:
    steps = SlcFileSearch().directory(processor)
    assert steps is not None
    return steps


def carried_out(steps: Steps[list[DataFile]], replies: dict[bytes, Packet]) -> list[DataFile]:
    """Answer each command with what was recorded for it."""
    asked = 0
    request = next(steps)
    while True:
        asked += 1
        assert asked <= 10
        try:
            request = steps.send(replies[request[1]])
        except StopIteration as done:
            files: list[DataFile] = done.value
            return files


def served(steps: Steps[list[DataFile]], server: Server) -> list[DataFile]:
    request = next(steps)
    while True:
        try:
            request = steps.send(server.serve(Packet(1, 0, request[0], 0, 7, request[1])))
        except StopIteration as done:
            files: list[DataFile] = done.value
            return files


def test_files_of_a_recorded_micrologix_1400() -> None:
    replies = {exchange.command.data: exchange.reply for exchange in ML1400}
    files = carried_out(steps_of(Processor.ML1400), replies)
    assert {str(entry): entry.elements for entry in files} == {
        'O0': 6, 'I1': 8, 'S2': 66, 'B3': 1, 'T4': 1, 'C5': 1, 'R6': 1, 'N7': 1, 'F8': 1,
        'HSC': 6, 'PTO': 3, 'PWM': 3, 'STI': 1, 'EII': 8}


def test_files_of_an_emulated_slc() -> None:
    table = DataTable(PlcType.SLC)
    for text, words in ALL_SLC:
        table.create(parse_address(text, PlcType.SLC), words)
    files = served(steps_of(Processor.SLC_5_03), Server(table))
    assert {str(entry): entry.elements for entry in files} == {
        'O0': 2, 'I1': 5, 'S2': 33, 'N7': 90, 'ST20': 2}


@pytest.mark.parametrize('processor', [None, *(
    Processor(name) for name in ('5/01', '5/02', 'ML1000'))])
def test_processors_without_a_known_directory(processor: Processor | None) -> None:
    assert SlcFileSearch().directory(processor) is None


@given(st.sampled_from([Processor.ML1400, Processor.SLC_5_05, Processor.ML1100]),
       st.lists(st.binary(max_size=90), min_size=1, max_size=8))
def test_strange_replies_are_files_or_a_format_error(processor: Processor,
                                                     parts: list[bytes]) -> None:
    steps = steps_of(processor)
    request = next(steps)
    for data in parts:
        size = request[1][1]
        try:
            request = steps.send(Packet(0, 1, 0x4F, 0, 7, data.ljust(size, b'\3')[:size]))
        except FormatError:
            return
        except StopIteration as done:
            assert all(isinstance(entry, DataFile) for entry in done.value)
            return


def test_refused_directory_is_a_remote_error() -> None:
    steps = steps_of(Processor.ML1200)
    next(steps)
    with pytest.raises(RemoteError):
        steps.send(Packet(0, 1, 0x4F, 0x10, 7, b''))
