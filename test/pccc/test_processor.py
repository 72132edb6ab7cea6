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

"""What the SLC and MicroLogix processors take and have."""

from abdf1_ros.pccc.families import dialect_of, FAMILIES
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor, USUAL
import pytest

SLC_FILES = FAMILIES[PlcType.SLC].file_types
FUNCTION = ('HSC', 'PTO', 'PWM', 'STI', 'EII')


def missing(name: str, file: int = 7) -> set[str]:
    """Return the letters of the files that a processor cannot have as number ``file``."""
    return {kind.value for kind in SLC_FILES if not Processor(name).has_file(file, kind)}


def test_names_are_those_of_the_map_file() -> None:
    assert [processor.value for processor in Processor] == [
        '5/01', '5/02', '5/03', '5/04', '5/05', 'ML1000', 'ML1100', 'ML1200', 'ML1400', 'ML1500']
    assert USUAL is Processor('5/03')


@pytest.mark.parametrize(('names', 'letters'), [
    ('5/01 5/02', {'F', 'ST', 'A', 'D', 'L', *FUNCTION}), ('5/03 5/04 5/05', {'L', *FUNCTION}),
    ('ML1100 ML1200 ML1400 ML1500', set())])
def test_files_that_are_missing(names: str, letters: set[str]) -> None:
    for name in names.split():
        assert missing(name) == missing(name, 255) == set(letters)


def test_files_of_a_micrologix_1000_are_fixed() -> None:
    kinds = {file: {kind.value for kind in SLC_FILES} - missing('ML1000', file)
             for file in range(10)}
    assert kinds == {0: {'O'}, 1: {'I'}, 2: {'S'}, 3: {'B'}, 4: {'T'}, 5: {'C'}, 6: {'R'},
                     7: {'N'}, 8: set(), 9: set()}
    assert not Processor.ML1000.has_file(10, FileType.INTEGER)


def test_only_old_processors_may_lack_the_masked_write() -> None:
    assert {processor.value for processor in Processor if processor.may_lack_masked_write} == {
        '5/01', '5/02', 'ML1000'}


def test_every_file_fits_into_a_packet_of_the_processors_that_have_it() -> None:
    for processor in Processor:
        dialect = dialect_of(PlcType.SLC, None, processor)
        for kind in SLC_FILES:
            if any(processor.has_file(file, kind) for file in range(256)):
                assert dialect.max_read(kind) > 0 and dialect.max_write(kind) > 0
