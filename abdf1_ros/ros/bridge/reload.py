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

"""Judge new files for a running line: whether they would stop it, and what they change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trial import why_not
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.ros.bridge.port_owners import held_line
from abdf1_ros.ros.parameters.declared import Configuration
from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import FIELDS
from abdf1_ros.text import first, printable


def refuse_harm(before: Configuration, after: Configuration, is_open: bool,
                settings: PortSettings, judge: Callable[[PortSettings], str] = why_not) -> None:
    """
    Raise ConfigurationError for valid files that would stop a running line.

    ``settings``: of the new port. If the line ``is_open``, each device that it does not hold yet
    is opened as a trial.
    """
    problems = []
    if before.mappings and not after.mappings and not after.network.share:
        problems.append(Problem(after.parameters.map_file, (
            'it has no row, so all topics would end; only a line with Share may have no row')))
    held = {held_line(name) for name in before.held}
    for port in settings.each if is_open else ():
        if held_line(port.name) not in held and (reason := judge(port)):
            problems.append(Problem('port', f'{port.name} cannot be opened: {reason}'))
    if problems:
        raise ConfigurationError(problems)


def rows_left_behind(before: Configuration, after: Configuration) -> frozenset[Mapping]:
    """Return the rows whose words get no safe value, or another one, from new files (rule 5)."""
    safe = {_safe_words(row) for row in after.mappings.own}
    return frozenset(row for row in before.mappings.own if _safe_words(row) not in safe)


def _safe_words(row: Mapping) -> tuple[object, ...]:
    """Return the words of a row that the bridge writes by itself, and what it leaves in them."""
    return row.extent, row.codec, *(raw_values(row, row.fallback.values) if row.fallback else (0,))


def changes(before: Configuration, after: Configuration) -> str:
    """Return a text with the changes that new files make."""
    parts = [*_settings(before, after), *_rows(before, after)]
    return printable('; '.join(parts)) if parts else 'nothing has changed'


def _settings(before: Configuration, after: Configuration) -> Iterator[str]:
    if after.port != before.port:
        yield f'port {after.port} (was {before.port})'
    old = before.network.cells()
    for name, value in after.network.cells().items():
        if value != old[name] and name != 'com_port':
            yield f'{FIELDS[name].column} {_shown(value)} (was {_shown(old[name])})'


def _shown(value: object) -> str:
    return str(value) or 'empty'


def _rows(before: Configuration, after: Configuration) -> Iterator[str]:
    old, new = _cells(before), _cells(after)
    both = [tag for tag in new if tag in old]
    for tags, what in (([tag for tag in new if tag not in old], 'new'),
                       ([tag for tag in old if tag not in new], 'gone'),
                       ([tag for tag in both if new[tag] != old[tag]], 'changed')):
        if tags:
            yield f'{what}: {first(tags)}'


def _cells(configuration: Configuration) -> dict[str, Sequence[str]]:
    return {mapping.tag: [column.text(mapping) for column in MAP_COLUMNS]
            for mapping in configuration.mappings}
