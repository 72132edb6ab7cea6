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

"""Mappings without a file, and files without a folder."""

from pathlib import Path
import tempfile
from typing import Any

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.values import types_of, ValueType, WordOrder
from abdf1_ros.problems import Place, Problem
from abdf1_ros.settings.columns import BY_NAME, COLUMNS
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command, Mapping, Publish
from abdf1_ros.settings.rows import Rows

HEADER = ','.join(COLUMNS)

_TYPES = {kind.value: kind for kind in ValueType}


def make_mapping(
        text: str = 'N7:0', command: str = 'Read', *, station: int = 1, plc: str = 'PLC5',
        length: int = 1, kind: str | None = None, publish: str = 'Always', tag: str | None = None,
        topic: str | None = None, item: int = 1, word_order: str = 'Low',
        access: str | None = None, processor: str | None = None, **others: Any) -> Mapping:
    """Return what a row becomes, named by its address; ``others``: attributes of the mapping."""
    way = Access(access) if access else None
    address = parse_address(text, PlcType(plc), way)
    name = tag or f'{text}_{station}_{command}_{length}'
    return Mapping(
        item=item, place=Place('map.csv', item + 1), tag=name, name=name, command=Command(command),
        address=address, station=station, plc_type=PlcType(plc), length=length,
        type=_TYPES[kind] if kind else types_of(address)[0], topic=topic or name,
        publish=Publish(publish), word_order=WordOrder(word_order), access=way,
        processor=Processor(processor) if processor else None, **others)


def cell_of(mapping: Mapping, column: str) -> str:
    """Return a column's value as text, defaults filled in."""
    return BY_NAME[column].text(mapping)


def load_text(text: str | bytes, name: str = 'map.csv') -> tuple[Rows, list[Problem]]:
    """Return what ``load_mappings`` makes of a file with this content."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return load_mappings(str(path))


def load_rows(*rows: str) -> tuple[Rows, list[Problem]]:
    """Return what ``load_mappings`` makes of data rows with all columns in their order."""
    return load_text('\n'.join([HEADER, *rows]))


GOOD = {'Tag': 'a', 'Command': 'ReadWrite', 'Address': 'N7:0', 'Station': '1', 'PLC_Type': 'PLC5'}


def row(**cells: str) -> str:
    """Return a row of these cells beside good ones."""
    return ','.join((GOOD | cells).get(column, '') for column in COLUMNS)


def one(**cells: str) -> Mapping:
    """Return the mapping of such a row, which has to be good."""
    mappings, problems = load_rows(row(**cells))
    assert problems == []
    return mappings[0]


def faults(*rows: str) -> list[str]:
    """Return the faults of rows as text, without the name of the file."""
    _, problems = load_rows(*rows)
    return [str(problem).split('map.csv:', 1)[1] for problem in problems]


def fault(**cells: str) -> str:
    """Return the one fault of a row."""
    text, = faults(row(**cells))
    return text


def slc(**cells: str) -> str:
    """Return a row of an SLC."""
    return row(**{'PLC_Type': 'SLC', 'Command': 'Read'} | cells)
