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

"""Which rows of a map can be used on a line, and the faults of all other rows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.plan.bounds import guard_faults
from abdf1_ros.plan.forecast import line_model
from abdf1_ros.problems import Problem
from abdf1_ros.settings.map_file import broken_links
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows


def line_problems(mappings: Iterable[Mapping], network: Network) -> list[tuple[Mapping, Problem]]:
    """Return the rows that clash with ``network`` or an earlier Serve row, and why."""
    table = DataTable(PlcType(network.plc_type))
    return [(mapping, _problem(mapping, *fault)) for mapping in mappings
            if (fault := _fault(mapping, network, table))]


def _problem(mapping: Mapping, column: str | None, text: str) -> Problem:
    return Problem(replace(mapping.place, column=column), f'Item: {mapping.item}, {text}')


def _fault(mapping: Mapping, network: Network,
           table: DataTable) -> tuple[str | None, str] | None:
    """Return the column, if there is one, and the fault of a row; None for a row without fault."""
    mode, text = network.line_mode, None
    if mode.only_listens:
        return _listen_fault(mapping)
    if mapping.serves:
        text = _serve_fault(mapping, network, table)
    elif mapping.station == BROADCAST and mode.has_one_plc:
        text = 'Station 255 is for a line with many stations, not for Mode Peer'
    elif mapping.station == network.station and not mode.has_one_plc:
        text = (f'Station {mapping.station} is our own Station in the net file; write the '
                'station of the PLC here')
    elif mapping.via == network.station and mode.is_master:
        text = f'Via {mapping.via} is our own Station in the net file, not a gateway'
    return (None, text) if text else None


def usable_rows(mappings: Rows, network: Network,
                default_period: float) -> tuple[Rows, list[Problem]]:
    """
    Return the rows that can be used on this line, and the faults of all other rows.

    ``default_period`` (s) is for rows without Period. A row cannot be used if its counter is not
    read often enough for While_Timeout (rule 14 of docs/heartbeats.md). Nor can a row that depends
    on an unusable row (rule 15).
    """
    found = line_problems(mappings, network)
    problems = [problem for _, problem in found]
    left = mappings.without(mapping for mapping, _ in found)
    # In Mode Listen nothing is planned; ``broken_links`` compares While_Timeout with the Period.
    planned = [] if network.line_mode.only_listens else [
        *guard_faults(line_model(network), left, default_period)]
    faults = planned or [*broken_links(left)]
    while faults:
        for mapping, fault in faults:
            problems.append(_problem(mapping, fault.column, fault.text))
        left = left.without(mapping for mapping, _ in faults)
        faults = [*broken_links(left)]
    return left, problems


def _listen_fault(mapping: Mapping) -> tuple[str, str] | None:
    """Return the column and the fault of a row that no traffic can fill, None for none."""
    most = FAMILIES[mapping.plc_type].longest_reply(mapping.address.file_type)
    if mapping.command is not Command.READ:
        return 'Command', (f'{mapping.command.value} sends commands, and Mode Listen sends '
                           'nothing; only Read rows are possible')
    if not mapping.period:
        return 'Period', ('Mode Listen needs a Period above 0: the longest time (ms) between two '
                          'reads of these words by the other master')
    if mapping.access in (Access.CIF, Access.FLAT):
        return 'Access', (f'Mode Listen does not understand reads with Access '
                          f'{mapping.access.value}')
    if mapping.codec.words > most:
        return 'Length', (f'{mapping.codec.words} words never come in one reply, which has '
                          f'{most} at most; divide the row')
    return None


def _serve_fault(mapping: Mapping, network: Network, table: DataTable) -> str | None:
    if mapping.plc_type.value != network.plc_type:
        return (f'a Serve row has the PLC_Type we emulate, which is {network.plc_type} '
                'in the net file')
    if mapping.station != network.station:
        return f'a Serve row has our own Station, which is {network.station} in the net file'
    try:
        table.create(mapping.address.at_offset(mapping.address.offset), mapping.codec.words)
    except NoSuchFile as error:
        return f'{mapping.address} does not fit an earlier Serve row: {error}'
    return None
