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

"""The rows of a map CSV, read and written by their tags from any program."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
import logging
from types import MappingProxyType
from typing import Literal, overload

from abdf1_ros.df1.stations import ActiveStationList, MAX_STATION
from abdf1_ros.errors import FormatError
from abdf1_ros.open_line import (
    BlockingClient,
    LOG,
    OpenLine,
    plain,
    PlcValue,
    single,
    text_of,
    values_of,
)
from abdf1_ros.pccc import steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.usable_rows import line_problems
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.readings import Reading, readings_of_rows, values_of_rows
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import load_network, Network
from abdf1_ros.text import first, shown


class TaggedClient(BlockingClient):
    """
    The line of a net CSV, whose words are read and written by the tags of a map CSV.

    ``tags`` are those that can be read, so ``read(client.tags)`` reads them all. ``rows`` are the
    Read, Write and ReadWrite rows of the map, by tag. Values are the same as on
    the topics: scaled, and written within Min and Max. This class writes nothing by itself: it has
    no heartbeat and no fallback. It withholds no value. Errors are the same as in ``Client``; the
    constructor raises ConfigurationError with every fault of the files.
    """

    __slots__ = ('rows',)

    def __init__(self, net_file: str, map_file: str, trace: str | None = None,
                 logger: logging.Logger = LOG) -> None:
        # With Standard only the stations of a driver are polled, all the time.
        try:
            network = replace(load_network(net_file), polling=Network().polling)
        except ConfigurationError as error:
            raise ConfigurationError([*error.problems, *_faults_of_map(map_file)]) from None
        mappings, problems = load_mappings(map_file)
        problems += [problem for _, problem in line_problems(mappings, network)]
        if problems:
            raise ConfigurationError(problems)
        self.rows = MappingProxyType({
            row.tag: row for row in mappings.of_plcs
            if (row.polls or row.writes) and row.station <= MAX_STATION})
        super().__init__(OpenLine(
            network.line_mode, network.line, PortSettings.of(network),
            ActiveStationList(routes={row.station: row.via for row in mappings
                                      if row.via is not None}),
            PlcType(network.plc_type), trace=trace, logger=logger))

    @property
    def tags(self) -> list[str]:
        """Return the tags of the Read and ReadWrite rows, in the order of the map."""
        return [row.tag for row in self.rows.values() if row.polls]

    @overload
    def read(self, tag: str, *, partial: Literal[False] = False) -> PlcValue: ...

    @overload
    def read(self, tag: Iterable[str], *,
             partial: Literal[False] = False) -> dict[str, PlcValue]: ...

    @overload
    def read(self, tag: Iterable[str], *, partial: Literal[True]) -> dict[str, Reading]: ...

    def read(self, tag: str | Iterable[str], *, partial: bool = False) -> PlcValue:
        """
        Return the value of a Read or ReadWrite row; a list where its Length is above 1.

        For several tags it returns the values by tag, read in as few packets as possible. The
        values do not belong to one instant: each packet is a transaction of its own.

        With ``partial`` the result has a ``Reading`` for each tag: its value or its own error,
        and the time. Then no error of a tag, a PLC or the line is raised. A PLC that has become
        silent gets no more commands of this call.
        """
        if partial:
            return self._readings([tag] if isinstance(tag, str) else tag)
        if isinstance(tag, str) or not isinstance(tag, Iterable):
            row = self._row(tag, 'read')
            with self._naming(_named(row)):
                return _shown(row, self._line.ask(row.station, steps.read(row.target)))
        rows = [self._read_once(name) for name in dict.fromkeys(tag)]
        with self._naming(first([row.tag for row in rows])):
            values = values_of_rows(self._line, rows)
        return {row.tag: _shown(row, values[row]) for row in rows}

    def write(self, tag: str, values: float | str | Sequence[float]) -> None:
        """Write to a Write or ReadWrite row; return when the PLC has confirmed all values."""
        row = self._row(tag, 'written')
        with self._naming(_named(row)):
            self._line.ask(row.station, steps.write(
                row.target, raw_values(row, values_of(values))))

    def _readings(self, tags: Iterable[str]) -> dict[str, Reading]:
        rows, found = [], {}
        names = dict.fromkeys([text_of('tag', name) for name in tags])
        for name in names:
            try:
                rows.append(self._read_once(name))
            except FormatError as error:
                found[name] = Reading.failed(error)
        with self._naming(first([*names])):
            found |= readings_of_rows(self._line, rows, _named, _shown)
        return {name: found[name] for name in names}

    def _read_once(self, tag: str) -> Mapping:
        """Return a row that is read only once, so that its Period keeps it in no block alone."""
        return replace(self._row(tag, 'read'), period=None)

    def _row(self, tag: str, what: str) -> Mapping:
        """Return a row that is ``what``: read or written."""
        row = self.rows.get(text_of('tag', tag))
        fitting = self.tags if what == 'read' else [
            row.tag for row in self.rows.values() if row.writes]
        if row is None or row.tag not in fitting:
            raise FormatError(f'tag {shown(repr(tag))} should be that of a row that is {what}: '
                              f'{first(fitting) or "the map has none"}')
        return row


def _faults_of_map(map_file: str) -> list[Problem]:
    try:
        return load_mappings(map_file)[1]
    except ConfigurationError as error:
        return error.problems


def _named(row: Mapping) -> str:
    return f'{row.tag} ({row.address} of station {row.station})'


def _shown(row: Mapping, values: Values) -> float | str | list[float]:
    """Return values as the topic of a row has them."""
    if row.scaling is not None and not isinstance(values, str):
        values = row.scaling.publish(values)
    return single(plain(values, row.type), row.length == 1)
