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

"""The parts of a PLC family."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Addressing
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.diagnostics import MAX_ECHO
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.file_search import FileSearch
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.link_counters import CounterLayout
from abdf1_ros.pccc.notation import CommandCode, KnownCommand
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.serving import ServedFamily
from abdf1_ros.pccc.status import Meanings, USUAL_MEANINGS


class Examples(NamedTuple):
    """Addresses to begin with; only the words of ``status`` are in every processor."""

    status: str = 'S:0'
    words: str = 'N7:0'
    bits: str = 'B3:0/0'
    setpoint: str = 'N7:100'
    heartbeat: str = 'N7:101'


@dataclass(frozen=True, slots=True)
class Family:
    """
    A PLC family: its addresses, its commands for us as a client, and its emulation as a server.

    - ``dialects``: by access, the usual access first.
    - ``decode_identity``: returns None for the reply of another family to 06/03.
    - ``encode_identity``: makes the reply of an emulated processor.
    - ``described``: its commands in words; ``meanings``: its own error codes.
    - ``by_processor``: empty unless its processors accept packets of different lengths.
    - ``served_counters``: the counter layout of a port in a mode (Master, Slave, Peer, Radio),
      None if its counters are not emulated.
    - ``counters_anywhere``: a read of the counters may name any address.
    - ``is_spoken_by_all``: PLCs of other families know its commands, too.
    - ``file_search``: finds the files of a PLC, None if there is no way.
    - ``clock``: address of the first of six words: year, month, day, hour, minute, second.
    - ``examples``: addresses of the first rows and commands that we propose.
    """

    addressing: Addressing
    dialects: Mapping[Access, Dialect]
    commands: Callable[[DataTable, EmulatedProcessor], ServedFamily]
    decode_identity: Callable[[bytes], Identity | None]
    encode_identity: Callable[[EmulatedProcessor], bytes]
    described: Mapping[CommandCode, KnownCommand]
    meanings: Meanings = USUAL_MEANINGS
    by_processor: Mapping[Processor, Dialect] = field(default_factory=dict)
    served_counters: Callable[[str], CounterLayout] | None = None
    counters_anywhere: bool = False
    max_echo: int = MAX_ECHO
    is_spoken_by_all: bool = False
    file_search: FileSearch | None = None
    clock: str = ''
    examples: Examples = Examples()

    @property
    def plc_type(self) -> PlcType:
        """Return the name of the family in the CSV files."""
        return self.addressing.plc_type

    @property
    def accesses(self) -> tuple[Access, ...]:
        """Return the ways to its words, the usual one first."""
        return tuple(self.dialects)

    @property
    def file_types(self) -> tuple[FileType, ...]:
        """Return the file types that it can have."""
        return tuple(kind for kind in FileType if kind in self.addressing.files)

    def longest_reply(self, file_type: FileType) -> int:
        """Return the most words that a reply can have, whichever read another node sends."""
        return max(dialect.max_read(file_type) for dialect in self.dialects.values())

    def layout(self, file_type: FileType) -> Layout:
        """Return the layout of the elements of such a file; KeyError if the family has none."""
        return self.addressing.files[file_type]
