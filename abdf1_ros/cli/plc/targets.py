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

"""The targets of ``plc`` reads and writes: addresses of the command line, and rows of a map."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
import re

from abdf1_ros.cli.plc import data
from abdf1_ros.cli.plc.exports.form import Cells
from abdf1_ros.cli.plc.options import DEFAULT_STATION
from abdf1_ros.cli.terminal import RED, tell
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.errors import FormatError
from abdf1_ros.plan.usable_rows import line_problems
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command, Mapping, Publish
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import first, printable, shown

_LIKE_A_TAG = re.compile(r'(?![A-Z]{1,2}\d*$|[A-Z]{3}\d+$)[A-Z_][\w/.]*', re.ASCII | re.IGNORECASE)

# Options for addresses; a row of a map has a column for each.
_FOR_ADDRESSES = ('length', 'type', 'word_order', 'access', 'processor', 'plc_type', 'via')


@dataclass(frozen=True, slots=True)
class Targets:
    """
    Rows of a map, and addresses; ``cells`` has the values of options for addresses.

    - ``tags``: tags of the map, by address.
    - ``routes``: gateways of the stations in the map; a station on the line itself is its own.
    """

    entries: Sequence[Mapping | str]
    cells: Cells
    tags: data.Tags | None = None
    routes: dict[int, int] = field(default_factory=dict)

    @property
    def rows(self) -> list[Mapping]:
        """Return the rows of a map."""
        return [entry for entry in self.entries if isinstance(entry, Mapping)]

    @property
    def addresses(self) -> list[str]:
        """Return the addresses; the options give their station."""
        return [entry for entry in self.entries if isinstance(entry, str)]

    def check_line(self, network: Network) -> None:
        """Raise ConfigurationError if a row does not fit the line."""
        if problems := [problem for _, problem in line_problems(self.rows, network)]:
            raise ConfigurationError(problems)


def to_read(options: argparse.Namespace) -> Targets:
    """
    Return the targets of "plc read" and "plc watch".

    Raises ConfigurationError if no PLC could have the addresses.
    """
    if not options.map and not options.addresses:
        raise ConfigurationError([Problem(
            'ADDRESS', 'give an address such as N7:0, or --map FILE for all rows of a map')])
    cells = _cells(options, Command.READ, options.length)
    mappings = rows_of_map(options.map)
    rows = {row.tag: replace(row, is_on_demand=False, condition=None, publish=Publish.ALWAYS)
            for row in mappings.of_plcs if row.polls}  # nothing is withheld from the user
    entries: list[Mapping | str] = [rows.get(word, word) for word in options.addresses]
    if not entries:
        entries = [row for row in rows.values() if options.station in (None, row.station)]
        if not entries:
            of = '' if options.station is None else f' of station {options.station}'
            raise ConfigurationError([Problem(options.map, f'has no row{of} that is read')])
    routes = routes_of(mappings)
    gateway = routes.get(station := _station(options), station)
    if options.via is None and gateway != station:
        cells['Via'] = str(gateway)
    tags = data.tags_of(mappings, station) if options.map else None
    targets = Targets(entries, cells, tags, routes)
    try:
        data.check_for_some_family(targets.addresses, cells)
    except ConfigurationError as error:
        hints = _tag_hints(targets.addresses)
        if options.map:
            hints = [Problem(options.map, (
                f'tags that are read: {first(list(rows)) or "none"}'
                f'{"".join(_meant(word, rows) for word in targets.addresses)}'))]
        raise ConfigurationError([*error.problems, *hints]) from None
    _check_options(options, targets)
    return targets


def to_write(options: argparse.Namespace) -> Targets:
    """Return the target of "plc write"; raises ConfigurationError if no PLC could take it."""
    if options.map:
        mappings = rows_of_map(options.map)
        row = _row_to_write(mappings, options.map, options.address)
        targets = Targets([row], {}, routes=routes_of(mappings))
        _check_options(options, targets)
        with no_value(options.address):
            data.Writing(targets.rows[0], options.values)
        return targets
    cells = _cells(options, Command.READ_WRITE,
                   data.length_of(options.address, options.type, options.values))
    try:
        with no_value(options.address):
            data.check_for_some_family([options.address], cells, options.values)
    except ConfigurationError as error:
        raise ConfigurationError([*error.problems, *_tag_hints([options.address])]) from None
    return Targets([options.address], cells)


def _tag_hints(words: Iterable[str]) -> list[Problem]:
    return [Problem('--map', f'if {shown(word)} is a tag, give its map with --map FILE')
            for word in words if _LIKE_A_TAG.fullmatch(word)]


def rows_of_map(path: str | None) -> Rows:
    """Return the good rows of a map; print the faults of the bad rows."""
    mappings, problems = load_mappings(path) if path else (Rows(), [])
    for problem in problems:
        tell('plc', str(problem), RED)
    return mappings


@contextmanager
def no_value(address: str) -> Iterator[None]:
    """Turn a FormatError about bad values into a ConfigurationError."""
    try:
        yield
    except FormatError as error:
        raise ConfigurationError([Problem(address, str(error))]) from None


def _station(options: argparse.Namespace) -> int:
    return DEFAULT_STATION if options.station is None else options.station


def _cells(options: argparse.Namespace, command: Command, length: int | str | None) -> Cells:
    """Return the cells of a map CSV that the options give."""
    given = {'Command': command.value, 'Station': str(_station(options)),
             'Length': None if length is None else str(length), 'Type': options.type,
             'Word_Order': options.word_order, 'Access': options.access,
             'Processor': options.processor, 'PLC_Type': options.plc_type,
             'Via': None if options.via is None else str(options.via)}
    return {column: text for column, text in given.items() if text}


def routes_of(mappings: Rows) -> dict[int, int]:
    """Return the gateway of each station; a station on the line itself is its own."""
    return {row.station: row.station if row.via is None else row.via for row in mappings.of_plcs}


def _row_to_write(mappings: Rows, path: str, tag: str) -> Mapping:
    """Return the row of a map that has the tag and takes messages for one PLC."""
    rows = {row.tag: row for row in mappings.of_plcs
            if row.writes and row.station <= MAX_STATION}
    if tag in rows:
        return rows[tag]
    other = next((row for row in mappings if row.tag == tag), None)
    text = 'is not a tag of this map' if other is None else \
        f'is a {other.command.value} row of station {other.station}'
    if other is None and looks_like_address(tag):
        text = 'is an address; with --map give a tag, so that the limits of its row apply'
    raise ConfigurationError([Problem(path, f'"{shown(tag)}" {text}; tags that can be written: '
                                            f'{first(list(rows)) or "none"}'
                                            f'{_meant(tag, rows)}')])


def _meant(word: str, rows: Collection[str]) -> str:
    """Return a question with the tag that a word may mean; empty for none."""
    names = {tag.casefold(): tag for tag in rows}
    meant = get_close_matches(word.casefold(), names, 1)
    return f'; did you mean {printable(names[meant[0]])}?' if meant else ''


def _check_options(options: argparse.Namespace, targets: Targets) -> None:
    """Raise ConfigurationError if an option contradicts rows of a map, or has no effect."""
    if targets.addresses:
        check_via(options, targets.routes)
        return
    problems = [
        Problem(f'--{name.replace("_", "-")}', 'is for addresses; for tags the map has this value')
        for name in _FOR_ADDRESSES if getattr(options, name, None) is not None]
    problems += [Problem('--station', f'the map has {row.tag} at station {row.station}')
                 for row in targets.rows if options.station not in (None, row.station)]
    if problems:
        raise ConfigurationError(problems)


def check_via(options: argparse.Namespace, routes: dict[int, int]) -> None:
    """Raise ConfigurationError if the option contradicts the gateway of the station in a map."""
    station = _station(options)
    if options.via not in (None, gateway := routes.get(station, options.via)):
        where = 'on the line itself' if gateway == station else f'behind gateway {gateway}'
        raise ConfigurationError([Problem('--via', f'the map has station {station} {where}')])
