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

"""A log of values, row by row: ``plc log``, and ``plc watch --csv``."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import partial
import sys

from abdf1_ros.cli.plc.asking import ask, mappings_of
from abdf1_ros.cli.plc.data import tag_of, Tags
from abdf1_ros.cli.plc.inquiry import concluded
from abdf1_ros.cli.plc.line import network_of
from abdf1_ros.cli.plc.log_file import (
    ANSWERS_AGAIN,
    Cell,
    HEARD_AGAIN,
    Log,
    LogFile,
    LogLost,
    LogRow,
)
from abdf1_ros.cli.plc.reading import NoValue, RepeatedReads, WatchedRead
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.plc.targets import Targets
from abdf1_ros.cli.plc.watch import lost_reads
from abdf1_ros.cli.terminal import EXIT_FAILED, is_terminal, Progress
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.plan.usable_rows import usable_rows
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import counted, printable, value_text

# Without a reason a row is this late (s, and periods) only if the host or the program stood still.
_STOOD_STILL = 5.0


class ValueLog(RepeatedReads):
    """
    Write each read to ``output``, a row for each value, and the reason of each gap.

    A terminal shows the progress of a file. Raises LogLost if the log cannot be written.
    """

    def __init__(self, network: Network, mappings: Sequence[Mapping], period: float,
                 output: Log, tags: Tags | None = None,
                 record: str | None = None) -> None:
        self._output = output
        self._progress = Progress() if is_terminal(sys.stderr) else None
        self._heads = {mapping: [*_heads(mapping, tags)] for mapping in mappings}
        self._gaps: dict[Mapping, datetime] = {}
        self._latest: dict[Mapping, datetime] = {}
        super().__init__(network, mappings, period, record)
        self._again = HEARD_AGAIN if self._is_listening else ANSWERS_AGAIN
        self._patience = {point.mapping: max(_STOOD_STILL, _STOOD_STILL * point.period)
                          for point in self._points}

    def run(self, count: int | None) -> int:
        """Log; see ``RepeatedReads``."""
        try:
            return super().run(count)
        finally:
            if self._progress:
                self._progress.clear()

    def begin(self) -> None:
        """Write what stands before the first row."""
        self._output.begin()

    def show(self, news: Sequence[WatchedRead], lost: int) -> None:
        """Write rows."""
        rows = [row for each in news for row in self._rows(each)]
        if lost:
            rows.insert(0, LogRow(news[0].when, None, '', '', Cell.NONE, '', lost_reads(lost)))
        self._output.write(rows)
        if self._progress and isinstance(self._output, LogFile):
            missing = f', {len(self._gaps)} of {len(self._heads)} addresses without a value' \
                if self._gaps else ''
            self._progress.show(f'{self._output.path}: '
                                f'{counted(self._output.count, "row")}{missing}; Ctrl-C ends')

    def _rows(self, read: WatchedRead) -> Iterator[LogRow]:
        when, mapping, what = read
        if isinstance(what, NoValue):
            self._gaps.setdefault(mapping, when)
            yield from self._reasons(when, mapping, what.error)
            return
        late = (when - self._latest.get(mapping, when)).total_seconds()
        self._latest[mapping] = when
        since = self._gaps.pop(mapping, None)
        if since is None and late > self._patience[mapping]:
            yield from self._reasons(when, mapping, (
                f'not read for {late:.0f} s: this computer or program stood still, or its clock '
                'was set'))
            since = when
        reason = '' if since is None else self._again
        cell, texts = _cells(mapping, what)
        for head, text in zip(self._heads[mapping], texts, strict=False):
            yield LogRow(when, mapping.station, *head, cell, text, reason)

    def _reasons(self, when: datetime, mapping: Mapping, reason: str) -> Iterator[LogRow]:
        for head in self._heads[mapping]:
            yield LogRow(when, mapping.station, *head, Cell.NONE, '', printable(reason))


def _heads(mapping: Mapping, tags: Tags | None) -> Iterator[tuple[str, str]]:
    """Yield address and tag of each value."""
    count = 1 if mapping.message_type is ValueType.STRING else mapping.length
    for number in range(count):
        yield str(mapping.place_of(number)), tag_of(mapping, number, tags)


def _cells(mapping: Mapping, values: Values) -> tuple[Cell, list[str]]:
    if isinstance(values, str):
        return Cell.TEXT, [values]
    cell = Cell.FLOAT if mapping.message_type is ValueType.FLOAT32 else Cell.INTEGER
    return cell, [*map(value_text, values)]


def log_values(options: argparse.Namespace, targets: Targets,
               output: Log, may_listen: bool = False) -> int:
    """
    Log until Ctrl-C, or until --count reads; return the exit status.

    With ``may_listen`` it takes the values of Mode Listen too.
    """
    try:
        network = network_of(options)
        if may_listen and network.line_mode.only_listens:
            return _log(options, network, _heard_rows(options, targets, network), targets, output)
        return ask(options, partial(_ask, targets=targets, output=output), targets)
    except LogLost as error:
        complain(str(error))
        return EXIT_FAILED
    finally:
        output.close()


def _ask(options: argparse.Namespace, session: Session, targets: Targets,
         output: Log) -> int:
    mappings = mappings_of(options, session, targets)
    session.close()  # the driver opens the port itself
    return _log(options, session.network, mappings, targets, output)


def _heard_rows(options: argparse.Namespace, targets: Targets, network: Network) -> list[Mapping]:
    """Return the rows that the traffic of another master can fill, by the rules of the node."""
    if targets.addresses:
        raise ConfigurationError([Problem(
            '--map', 'in Mode Listen give a map with --map FILE; "plc init" makes one of the '
                     "master's reads")])
    rows, problems = usable_rows(Rows(targets.rows), network, options.period)
    if not rows:
        raise ConfigurationError(problems)
    for problem in problems:
        complain(str(problem))
    return [*rows]


def _log(options: argparse.Namespace, network: Network, mappings: Sequence[Mapping],
         targets: Targets, output: Log) -> int:
    log = ValueLog(network, mappings, options.period, output, targets.tags,
                   options.record)
    return concluded(log, log.run(options.count))
