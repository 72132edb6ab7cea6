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

"""The map CSV as a whole: all good rows, and every fault of the others."""

from __future__ import annotations

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.errors import Problem
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.settings.columns import COLUMNS
from abdf1_ros.settings.csv_table import read_good_rows, shown
from abdf1_ros.settings.map_row import Fault, RowReader
from abdf1_ros.settings.mapping import Mapping


def load_mappings(path: str) -> tuple[list[Mapping], list[Problem]]:
    """
    Read a map CSV: the good rows, and every fault of the bad ones.

    Raises ConfigurationError when the file as a whole cannot be used.
    """
    mappings: list[Mapping] = []
    rows, problems = read_good_rows(path, COLUMNS)
    clashes = _Clashes()
    for row in rows:
        reader = RowReader(row)
        mapping = reader.read()
        faults = reader.faults if mapping is None else clashes.add(mapping)
        if mapping is not None and not faults:
            mappings.append(mapping)
        problems += [fault.in_file(row) for fault in faults]
    return mappings, problems


def _processor(mapping: Mapping) -> Processor | None:
    """Return which SLC a mapping goes to, None for anything else."""
    if mapping.plc_type is not PlcType.SLC or mapping.serves or mapping.station == BROADCAST:
        return None
    return mapping.processor or USUAL


class _Clashes:
    """Find what cannot stand beside the rows before it; each fault names both rows."""

    def __init__(self) -> None:
        self._names: dict[str, Mapping] = {}
        self._readers: dict[str, Mapping] = {}
        self._writers: dict[str, Mapping] = {}
        self._slcs: dict[int, Mapping] = {}

    def add(self, mapping: Mapping) -> list[Fault]:
        """Return the clashes of ``mapping``; without any, it counts for the rows after it."""
        faults: list[Fault] = []

        def clash(column: str, other: Mapping, text: str) -> None:
            faults.append(Fault(column, f'{text} of item {other.item} (line {other.line}, tag '
                                        f'"{shown(other.tag)}")'))

        if other := self._names.get(mapping.name):
            same = 'is already the tag' if mapping.tag == other.tag \
                else f'becomes "{mapping.name}", the name'
            clash('Tag', other, f'tag "{shown(mapping.tag)}" {same}')
        # A topic that has its name from the tag gets another with it.
        is_named = not faults or mapping.topic != mapping.name
        if is_named and mapping.reads and (other := self._readers.get(mapping.topic)):
            clash('Topic', other, f'read topic "{mapping.topic}" is the topic')
        if is_named and mapping.writes and (other := self._writers.get(mapping.topic)) \
                and (other.message_type, other.length) != (mapping.message_type, mapping.length):
            clash('Topic', other, f'write topic "{mapping.topic}" needs the message type '
                                  f'({other.message_type.value}) and Length ({other.length})')
        here, other = _processor(mapping), self._slcs.get(mapping.station)
        if here and other and (there := _processor(other)) and there is not here:
            clash('Processor', other, f'Processor of station {mapping.station} is {here.value} '
                                      f'here, but {there.value} in the row')
        if not faults:
            self._names[mapping.name] = mapping
            if here:
                self._slcs.setdefault(mapping.station, mapping)
            if mapping.reads:
                self._readers[mapping.topic] = mapping
            if mapping.writes:
                self._writers[mapping.topic] = mapping
        return faults
