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

"""The data files of a PLC: found, as rows of a map, and compared with a map."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace

from abdf1_ros.cli.plc.data import processor_cell
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import dialect_of, FAMILIES
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.structures import named_runs, type_fault
from abdf1_ros.pccc.values import types_of
from abdf1_ros.problems import Problem
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import counted

# Period of the proposed rows (ms): reading all files of a PLC is a lot for a slow line.
_DRAFT_PERIOD = 5000

USUAL_NUMBERS = tuple(range(32))
"""Numbers of the files to look for, one by one, if no option gives numbers."""


def find_files(session: Session, station: int, plc_type: PlcType, processor: Processor | None,
               numbers: Collection[int] | None = None,
               show: Callable[[str], None] = lambda text: None,
               warn: Callable[[str], None] = lambda text: None) -> Iterator[DataFile]:
    """
    Yield the files among ``numbers``: from the processor's own list, or found by reads.

    ``show`` gets a text about the present file, ``warn`` the reason why no list is used. Raises
    LinkError, RemoteError of a refusal that does not tell whether a file is there, and FormatError
    for a family without a way to find files.
    """
    family = FAMILIES[plc_type]
    search = family.file_search
    if search is None:
        raise FormatError(f'we know no way to find the files of a {family.addressing.title}')
    steps = search.directory(processor)
    if steps is not None:
        try:
            for entry in session.ask(station, steps):
                if numbers is None or entry.number in numbers:
                    yield entry
            return
        except (RemoteError, FormatError) as error:
            warn(f'its file directory cannot be read ({error}); we try every file number')
    for number in USUAL_NUMBERS if numbers is None else numbers:
        show(f'file {number}')
        with session.naming(f'file {number}'):
            found = session.ask(station, search.look_for(number))
        if found is not None:
            yield found


def listed(session: Session, station: int, identity: Identity | None) -> list[DataFile]:
    """Return the files of the processor's own list; empty if no list is known or readable."""
    search = FAMILIES[identity.plc_type].file_search if identity and identity.plc_type else None
    steps = search.directory(identity.processor) if search and identity else None
    try:
        return session.ask(station, steps) if steps else []
    except (RemoteError, LinkError, FormatError):
        return []


def in_files(mappings: Rows, station: int) -> list[Mapping]:
    """Return the rows of a station whose addresses name a file by its number."""
    return [mapping for mapping in mappings.of_plcs if mapping.station == station and not (
        mapping.address.file_type.is_function or mapping.address.file_type.is_io)]


def outside(found: Sequence[DataFile], mappings: Sequence[Mapping]) -> Iterator[Problem]:
    """Yield a problem for each row that lies outside the files of its station."""
    files = {entry.number: entry for entry in found if not entry.type.is_function}
    for mapping in mappings:
        address = mapping.address
        entry, fault = files.get(address.file), ''
        if entry is None:
            fault = f'there is no file {address.file}'
        # A read does not show which of the types with one layout it is: N or B of a PLC-5.
        elif address.addressing.files.get(entry.type) != address.layout:
            fault = f'file {address.file} is {entry}'
        elif mapping.extent.end > entry.elements * address.layout.words:
            fault = f'{entry} has only {counted(entry.elements, "element")}'
        if fault:
            yield Problem(replace(mapping.place, column='Address'),
                          f'{address}, Length {mapping.length}: {fault}')


def map_rows(found: Sequence[DataFile], station: int, plc_type: PlcType,
             processor: Processor | None, via: int | None = None) -> Iterator[str]:
    """Yield a map row of one packet for each file; a comment if no row is possible."""
    for entry in found:
        kind = entry.type
        if kind.is_io or kind.is_function:
            yield (f'# {entry}: addressed by ' + ('rack or slot' if kind.is_io else
                                                  'the names of its words'))
            continue
        per_element = FAMILIES[plc_type].layout(kind).words
        packet = dialect_of(plc_type, processor=processor).max_read(kind)
        elements = 1 if kind is FileType.STRING else min(entry.elements, packet // per_element)
        # Length counts words of structures, and elements of other files.
        length = elements * (per_element if kind.is_structure else 1)
        start = Address(FAMILIES[plc_type].addressing, kind, entry.number, 0)
        if type_fault(start, types_of(start)[0], length):
            runs = ', '.join(str(run) for run, *_ in named_runs(start))
            yield f'# {entry}: values of several types, at {runs}'
            continue
        if elements < entry.elements:
            yield (f'# {entry} has {entry.elements} elements; this row of one packet reads '
                   f'{elements}')
        number = '' if kind is FileType.STATUS else entry.number
        yield (f'{kind.value.lower()}{entry.number},Read,{kind.value}{number}:0,{station},'
               f'{plc_type.value},{processor_cell(processor)},{length},{_DRAFT_PERIOD}'
               f'{"" if via is None else f",{via}"}')
