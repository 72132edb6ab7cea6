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

"""Reading mappings once, in the blocks that the planner makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar

from abdf1_ros.errors import Abdf1Error, FormatError, RemoteError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import is_address_fault
from abdf1_ros.pccc.steps import AddressedValues, read_packets
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.planner import Planner
from abdf1_ros.problems import Place
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.text import first

_Result = TypeVar('_Result')


class Asking(Protocol):
    """A line whose ``ask`` carries out steps with a station, and returns their result."""

    def ask(self, station: int, work: Steps[_Result]) -> _Result: ...


def read_planned(planner: Planner, mappings: Iterable[Mapping],
                 line: Asking) -> Iterator[tuple[Mapping, Values]]:
    """
    Yield each mapping with its values.

    Raises the errors of ``line`` and of the steps; ``about`` names the mappings that it concerns.
    """
    for mapping, found in read_each(planner, mappings, line):
        if isinstance(found, Abdf1Error):
            raise found
        yield mapping, found


def read_each(planner: Planner, mappings: Iterable[Mapping],
              line: Asking) -> Iterator[tuple[Mapping, Values | Abdf1Error]]:
    """
    Yield each mapping with its values, or with the error of ``line`` or of the steps.

    If a station refuses a block, its parts are read, so that an error concerns as few mappings as
    possible. ``about`` names those mappings.
    """
    waiting = planner.plan(mappings)
    while waiting:
        block = waiting.pop(0)
        try:
            data = line.ask(block.station, read_packets(
                block.requests, block.transfer, block.dialect))
        except Abdf1Error as error:
            parts = planner.split(block) \
                if isinstance(error, RemoteError) and is_address_fault(error) else []
            if parts:
                waiting[:0] = parts
                continue
            error.about = f'{first([row.tag for row in block.mappings])} ' \
                          f'({block.start} of station {block.station})'
            yield from ((mapping, error) for mapping in block.mappings)
        else:
            for mapping in block.mappings:
                yield mapping, _decoded(mapping, data[block.slice_of(mapping)])


def _decoded(mapping: Mapping, data: bytes) -> Values | FormatError:
    try:
        return mapping.codec.decode(data)
    except FormatError as error:
        error.about = f'{mapping.tag} ({mapping.address} of station {mapping.station})'
        return error


def row_of(text: str, item: int, station: int, target: AddressedValues, access: Access | None,
           processor: Processor | None) -> Mapping:
    """Return a Read row for values in a PLC, ``text`` as its tag."""
    return Mapping(
        item=item, place=Place(text), tag=text, name=text, topic=text, command=Command.READ,
        address=target.address, station=station, plc_type=target.address.plc_type,
        length=target.codec.length, type=target.codec.type, access=access, processor=processor)
