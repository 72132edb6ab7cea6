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

"""
Check a net CSV and a map CSV before anything is connected.

Every fault of both files is shown with file, line and column. Then follows the plan of the node:
tags that are read together, their time on the line, and remarks.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
import json
import math
import os
from pathlib import Path
import shutil
import sys
from typing import TypedDict

from abdf1_ros.cli.terminal import (
    colour,
    command_parser,
    EXIT_INTERRUPTED,
    EXIT_USAGE,
    GREEN,
    number_option,
    page_option,
    prepare_output,
    reason_of,
    RED,
    run_command,
    table,
    tell,
    YELLOW,
)
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.paths import expanded
from abdf1_ros.plan.bounds import Bound
from abdf1_ros.plan.forecast import USUAL_RESPONSE_TIME
from abdf1_ros.plan.planner import Block
from abdf1_ros.plan.report import last_address, make_report, Remark, Report
from abdf1_ros.plan.usable_rows import usable_rows
from abdf1_ros.ports.ownership import line_of
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.columns import MAX_PERIOD
from abdf1_ros.settings.heartbeats import LONGEST_END
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.network import load_network, Network, share_problems
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.scaling import Scaling
from abdf1_ros.settings.share import share_places
from abdf1_ros.text import by_number, counted, cut, first, in_ms, printable

_MOST_ROWS = 40  # rows of a table; JSON has all rows
_SHOWN_TAGS = 8  # tags of a block in the table; JSON has all tags
_ENDS = 'net.csv', 'map.csv'
_EPILOG = """\
exit status: 0 if both files are good, also with warnings; 2 for errors;
             130 if interrupted by Ctrl-C

examples:
  check net.csv map.csv
  check --response-time 25 net.csv map.csv    the PLC needs 25 ms for each answer
  check --json net.csv map.csv | jq .load
  check --html cycle.html net.csv map.csv     the poll cycle as a picture
  check nets/                                 a line of text for each pair in the folder
"""


@dataclass(slots=True)
class Findings:
    """The contents and faults of both files; ``network`` is None if the net file has faults."""

    network: Network | None = None
    mappings: Rows = Rows()
    problems: list[Problem] = field(default_factory=list)


def examine(net_file: str, map_file: str,
            default_period: float = DriverSettings().default_period) -> Findings:
    """Read both files, collecting every fault; ``default_period`` in seconds."""
    found = Findings()
    try:
        found.network = load_network(net_file)
    except ConfigurationError as error:
        found.problems += error.problems
    try:
        found.mappings, problems = load_mappings(map_file)
        found.problems += problems
    except ConfigurationError as error:
        found.problems += error.problems
    if found.network is not None:
        found.mappings, problems = usable_rows(found.mappings, found.network, default_period)
        found.problems += [*problems, *share_problems(found.network, found.mappings.stations)]
    return found


def main(args: Sequence[str] | None = None) -> int:
    """Print the findings; return 2 when there are errors, otherwise 0."""
    prepare_output()
    options = _parse(args)
    text, is_good = _folder(options) if options.map is None else _pair(options)
    status = 0 if is_good else EXIT_USAGE

    def show() -> int:
        print(text)
        return status
    return run_command('check', show, EXIT_INTERRUPTED, unread=status)


def _pair(options: argparse.Namespace) -> tuple[str, bool]:
    """Return the output for two files, and whether they have no error."""
    found = examine(options.net, options.map, options.default_period / 1000)
    report = _report(found, options)
    heard = _heard(found, options.heard) if options.heard else None
    is_drawn = not options.html or _draw(options, found, report)
    if options.json:
        content = _content(found, report)
        return json.dumps(content | ({'heard': heard} if heard else {}), indent=2), \
            is_drawn and not found.problems
    return _text(found, report, heard) + ('' if heard is None else _heard_text(heard)), \
        is_drawn and not found.problems


def _draw(options: argparse.Namespace, found: Findings, report: Report | None) -> bool:
    """Write the page of --html; return True on success."""
    from abdf1_ros.cli.check_picture import check_parts
    from abdf1_ros.cli.lanes import write_page
    facts = [] if report is None else _line_text(report).splitlines()
    if report is not None and not report.network.line_mode.only_listens:
        facts += _times_text(report).splitlines()
    try:
        write_page(options.html, f'The plan of {options.net} and {options.map}',
                   check_parts(report, found.problems, facts))
    except OSError as error:
        tell('check', f'--html: {reason_of(options.html, error)}', RED)
        return False
    return True


class _Heard(TypedDict):
    """
    What Mode Listen would get from recordings.

    ``rows`` has the tag of each Read row, with the reason why no recording fills it (empty if a
    recording does); ``reads`` has the reads of the recordings.
    """

    rows: dict[str, str]
    reads: list[str]


def _heard(found: Findings, files: Sequence[str]) -> _Heard | None:
    """Return what Mode Listen would get from recordings; None if a file cannot be read."""
    from abdf1_ros.cli.overhearing import overheard
    network = found.network or Network()
    rows = Rows(row for row in found.mappings if row.command is Command.READ)
    try:
        carried, unread = overheard(network, rows, files)
    except (Problem, OSError) as error:
        found.problems.append(error if isinstance(error, Problem) else Problem(
            error.filename, error.strerror or str(error)))
        return None
    return {'rows': {row.tag: unread.get(row, '') for row in rows}, 'reads': carried}


def _heard_text(heard: _Heard) -> str:
    rows = heard['rows']
    texts = [f'warning: {printable(tag)} is not filled: {why}' for tag, why in rows.items() if why]
    if len(reasons := {*rows.values()}) == 1 and all(reasons):
        texts = [f'warning: no row is filled: {reasons.pop()}']
    filled = sum(not why for why in rows.values())
    has = '; it has:' if heard['reads'] else ', and has no read that was answered'
    return '\n'.join(['', '', *(colour(text, YELLOW, sys.stdout) for text in texts),
                      f'the recording fills {filled} of {counted(len(rows), "row")}{has}',
                      *(f'  {printable(text)}' for text in heard['reads'])])


def _report(found: Findings, options: argparse.Namespace) -> Report | None:
    if found.network is None:
        return None
    return make_report(found.network, found.mappings, options.default_period / 1000,
                       options.response_time / 1000)


def pairs(folder: Path) -> tuple[list[tuple[str, Path, Path]], list[str]]:
    """
    Return name, net and map file of each line below a folder, and all other CSV files.

    The files of a line are NAME_net.csv and NAME_map.csv, or net.csv and map.csv in a folder NAME.
    One file of a line may be missing. Lines are in the order of their names, line2 before line10.
    """
    found: dict[str, dict[str, Path]] = {}
    others = []
    for path in sorted(folder.rglob('*.csv')):
        name, end = str(path.relative_to(folder)), path.name[-len(_ENDS[0]):]
        line = name[:-len(end)].rstrip('/_-. ') or folder.resolve().name
        if end in _ENDS and end not in found.get(line, ()):
            found.setdefault(line, {})[end] = path
        else:
            others.append(name)
    lines = []
    for line, files in sorted(found.items(), key=lambda item: by_number(item[0])):
        known = next(iter(files.values()))
        net, map_file = (files.get(end, known.with_name(known.name[:-len(end)] + end))
                         for end in _ENDS)
        lines.append((line, net, map_file))
    return lines, others


def _folder(options: argparse.Namespace) -> tuple[str, bool]:
    """Return a text or an object for each line of a plant, and True if no line has an error."""
    contents: dict[str, object] = {}
    texts = []
    bad = warned = 0
    owners: dict[str, str] = {}
    lines, others = pairs(Path(options.net))
    for name, net, map_file in lines:
        found = examine(str(net), str(map_file), options.default_period / 1000)
        # If the net file has no port, a parameter gives it.
        if found.network is not None and found.network.names_port:
            uses = [(line_of(port), f'{port} is the port of') for port in found.network.ports]
            uses += [(place.line, f'{place.text} (Share) is used by')
                     for place in share_places(found.network.share)]
            for line, text in uses:
                owner = owners.setdefault(line, name)
                if owner != name:
                    found.problems.append(Problem(str(net), f'{text} {owner} too'))
        report = _report(found, options)
        bad += bool(found.problems)
        warned += not found.problems and report is not None and bool(report.remarks())
        contents[name] = _content(found, report)
        texts.append(_summary(name, found, report))
    if contents:
        good = len(contents) - bad
        texts.append(f'{counted(len(contents), "line")}: {good} good ({warned} of them with '
                     f'warnings), {bad} with errors'
                     + (f'; not part of a line: {first(others)}' if others else ''))
    else:
        texts.append(f'{printable(options.net)}: no files NAME_net.csv and NAME_map.csv, nor '
                     'folders with net.csv and map.csv')
    text = '\n'.join(texts) if not options.json else \
        json.dumps({'lines': contents, 'others': others}, indent=2)
    return text, bool(contents) and not bad


def _summary(name: str, found: Findings, report: Report | None) -> str:
    """Return one line of text, and a line for each error."""
    errors = [f'{printable(name)}: {colour(f"error: {problem}", RED, sys.stdout)}'
              for problem in found.problems]
    if report is None:
        return '\n'.join(errors)
    text = (f'{printable(name)}: {counted(len(found.mappings), "row")}, port '
            f'{printable(report.network.port)}, '
            + (f'poll cycle {report.poll_cycle * 1000:.0f} ms, ' if report.is_timed else '')
            + ('nothing is sent' if report.network.line_mode.only_listens
               else f'load {report.load:.0%}'))
    if warnings := len(report.remarks()):
        text += colour(f', {counted(warnings, "warning")}', YELLOW, sys.stdout)
    return '\n'.join([*errors, text])


def _parse(args: Sequence[str] | None) -> argparse.Namespace:
    parser = command_parser('check', __doc__, _EPILOG)
    parser.add_argument('net', metavar='NET', type=expanded,
                        help='the net CSV, or a folder with the files of many lines: '
                             'NAME_net.csv and NAME_map.csv')
    parser.add_argument('map', metavar='MAP', nargs='?', type=expanded, help='the map CSV')
    parser.add_argument('--json', action='store_true',
                        help='print one JSON object, with every tag of every block')
    parser.add_argument('--html', metavar='FILE', type=page_option,
                        help='also draw the poll cycle and the time that the Periods need, for a '
                             'browser')
    duration = number_option(f'ms from 0 to {MAX_PERIOD}', 0, MAX_PERIOD)
    parser.add_argument('--default-period', type=duration, metavar='MS',
                        default=DriverSettings().default_period * 1000,
                        help="the node's parameter default_period (default: %(default)g)")
    parser.add_argument('--response-time', type=duration, metavar='MS',
                        default=USUAL_RESPONSE_TIME * 1000,
                        help='time that a PLC needs for each answer (default: %(default)g)')
    parser.add_argument('--heard', metavar='FILE', action='append', default=[], type=expanded,
                        help='list the rows that a recording of the line ("sniff --save") would '
                        'fill in Mode Listen; may be repeated')
    options = parser.parse_args(args)
    if options.map is None and options.heard:
        parser.error('--heard is for one line: give its net CSV and map CSV')
    if options.map is None and not os.path.isdir(options.net):
        parser.error(f'{printable(options.net)} is not a folder: give both files of a line, as in '
                     '"check net.csv map.csv"')
    if options.html and options.map is None:
        parser.error('--html is for one net CSV and one map CSV')
    return options


def _text(found: Findings, report: Report | None, heard: _Heard | None) -> str:
    """Return the output as text, without the recordings; only they may have warnings."""
    parts = [colour(f'error: {problem}', RED, sys.stdout) for problem in found.problems]
    if report is None:
        return '\n'.join([*parts, 'no plan without a good net file'])
    if found.mappings and parts:
        parts.append('this plan has only the rows without errors')
    remarks = report.remarks()
    parts += [colour(f'warning: {printable(remark.text)}', YELLOW, sys.stdout)
              for remark in remarks]
    if found.mappings:
        parts += ['', _line_text(report), '', _folded(_rows_text(report))]
        if bits := _bits_text(report.mappings):
            parts += ['', _folded(bits)]
        if not report.network.line_mode.only_listens:
            parts += ['', _folded(_plan_text(report)), '', _times_text(report)]
    parts += [f'note: {printable(note)}' for note in report.notes()]
    if not found.problems and not remarks and not (heard and any(heard['rows'].values())):
        parts.append(colour('no errors, no warnings', GREEN, sys.stdout))
    return '\n'.join(parts).lstrip('\n')


def _folded(text: str) -> str:
    """Return a table, cut to the width of a terminal and to a number of rows."""
    lines = text.split('\n')
    if (more := len(lines) - 1 - _MOST_ROWS) > 0:
        lines = [*lines[:1 + _MOST_ROWS], f'... and {more} more; --json has them all']
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        lines = [cut(line, width) for line in lines]
    return '\n'.join(lines)


def _line_text(report: Report) -> str:
    network = report.network
    mappings = len({row for block in report.blocks for row in block.mappings})
    if network.line_mode.only_listens:
        return _listening_text(report)
    return (f'{printable(network.port)}: Mode {network.mode}, {network.baud} baud, '
            f'{network.data_bits} data bits, parity {network.parity}, {network.stop_bits} stop, '
            f'{network.error_code}; our own Station is {network.station}\n'
            f'{mappings} {"mapping is" if mappings == 1 else "mappings are"} read with '
            f'{counted(len(report.blocks), "block")}')


def _listening_text(report: Report) -> str:
    network, count = report.network, len(report.mappings)
    ports = ' and '.join(network.ports)
    return (f'{printable(ports)}: Mode Listen, {network.baud} baud, {network.data_bits} data '
            f'bits, parity {network.parity}, {network.stop_bits} stop, {network.error_code}; '
            f'nothing is sent\n{counted(count, "row")} to be filled from the reads of another '
            'master')


def _rows_text(report: Report) -> str:
    """Return a table of the rows, with topic and message type of each."""
    rows = [[_cell(value) for name, value in row.items() if name not in ('command', 'bits')]
            for row in _rows(report.mappings, report)]
    last = 'description' if any(row[-1] for row in rows) else ''
    head = 'tag', 'address', 'station', 'topic', 'message', 'Length', 'value', 'stale ms', last
    return table(head, rows, right=(2, 5, 7))


def _rows(mappings: Sequence[Mapping], report: Report | None) -> list[dict[str, object]]:
    promised = report.promises() if report else {}
    return [_row(mapping, promised.get(mapping)) for mapping in mappings]


def _row(mapping: Mapping, stale: float | None) -> dict[str, object]:
    """
    Return the cells of a row by name, for the table and for JSON.

    A heartbeat has no topics. ``stale``: the deadline (s) that the topic promises; None if it
    promises none.
    """
    topics = [f'~/{what}/{mapping.topic}' for what, is_there in (
        ('read', mapping.reads), ('write', mapping.writes)) if is_there]
    return {
        'tag': mapping.tag, 'command': mapping.command.value, 'address': str(mapping.address),
        'station': mapping.station, 'topics': topics,
        'message': mapping.message_type.message if topics else '', 'length': mapping.length,
        'value': mapping.type.value + _formula(mapping.scaling),
        'stale_ms': None if stale is None else math.ceil(stale * 1000),
        'description': mapping.description} | ({
            'bits': {str(mapping.place_of(number)): name
                     for number, name in enumerate(mapping.bits) if name}} if mapping.bits else {})


def _bits_text(mappings: Sequence[Mapping]) -> str:
    """Return a table of the bits with names; empty if there are none."""
    rows = [(printable(name), str(mapping.place_of(number)), str(mapping.station),
             printable(mapping.tag))
            for mapping in mappings for number, name in enumerate(mapping.bits) if name]
    return table(('bit', 'address', 'station', 'of the row'), rows, right=(2,)) if rows else ''


def _formula(scaling: Scaling | None) -> str:
    if scaling is None:
        return ''
    return f' * {scaling.scale:.10g}' + (f' {scaling.offset:+.10g}' if scaling.offset else '')


def _plan_text(report: Report) -> str:
    """Return the read plan as a table."""
    head = ('station', 'PLC_Type', 'from', 'to', 'words', 'bytes', 'packets', 'line ms',
            'total ms', 'period ms', 'tags')
    rows = []
    for block in report.blocks:
        *cells, _ = _entry(report, block).values()
        rows.append([*map(_cell, cells), first(
            [mapping.tag for mapping in block.mappings], _SHOWN_TAGS)])
    return table(head, rows, right=(0, 4, 5, 6, 7, 8, 9))


def _cell(value: object) -> str:
    """Return a value of JSON as the cell of a table."""
    if isinstance(value, list):
        return ' '.join(map(str, value))
    return '' if value is None else \
        f'{value:.1f}' if isinstance(value, float) else printable(str(value))


def _entry(report: Report, block: Block) -> dict[str, object]:
    """Return the facts of a block by name, times in ms."""
    last = last_address(block.start, block.span.end - 1)
    return {
        'station': block.station, 'plc_type': block.mappings[0].plc_type.value,
        'first': str(block.start), 'last': str(last), 'words': block.words,
        'bytes': 2 * block.words, 'packets': len(block.requests),
        'line_ms': in_ms(block.line_time), 'total_ms': in_ms(report.time(block)),
        'period_ms': in_ms(block.period), 'tags': [mapping.tag for mapping in block.mappings]}


def _times_text(report: Report) -> str:
    if not report.is_timed:
        return ('the master of this line decides when we read and write, so no time is known; '
                f'the periods need {report.load:.0%} of the line at least')
    response, times = report.response_time * 1000, report.times
    return (f'expected poll cycle: {report.poll_cycle * 1000:.1f} ms for everything once, with '
            f'{response:g} ms for each answer of a PLC\n'
            f'load of the line: {report.load:.0%} of the time is needed to keep the periods\n'
            f'longest transaction: {times.longest * 1000:.0f} ms with all repetitions'
            + ''.join(f'\n{printable(str(line))}' for line in (*times.bounds(), *times.advice()))
            + (f'\norderly end: {times.end * 1000:.0f} ms where no frame gets lost, '
               f'{(times.end_in_silence or 0.0) * 1000:.0f} ms where no PLC answers, '
               f'{LONGEST_END * 1000:.0f} ms at most' if times.end else ''))


def _content(found: Findings, report: Report | None) -> dict[str, object]:
    """Return the content for JSON; every key is always present, times are in ms."""
    content: dict[str, object] = {
        'errors': [_problem(problem) for problem in found.problems],
        'warnings': [], 'notes': [], 'network': None, 'mappings': len(found.mappings),
        'rows': _rows(found.mappings, report), 'blocks': [],
        'scan_time_ms': None, 'load': None, 'longest_transaction_ms': None, 'needed_baud': None,
        'bounds': [], 'end_ms': None, 'end_in_silence_ms': None,
        'response_time_ms': None}
    if report is not None:
        content |= {
            'network': report.network.cells(),
            'warnings': [*map(_remark, report.remarks())], 'notes': report.notes(),
            'blocks': [_entry(report, block) for block in report.blocks],
            'scan_time_ms': in_ms(report.poll_cycle if report.is_timed else None),
            'load': round(report.load, 4),
            'longest_transaction_ms': in_ms(report.times.longest if report.is_timed else None),
            'needed_baud': report.needed_baud(),
            'bounds': [_bound(bound) for bound in report.times.bounds()],
            'end_ms': in_ms(report.times.end),
            'end_in_silence_ms': in_ms(report.times.end_in_silence),
            'response_time_ms': in_ms(report.response_time)}
    return content


def _problem(problem: Problem) -> dict[str, object]:
    return {
        **asdict(problem.place), 'number': problem.message.number if problem.message else None,
        'mnemonic': problem.message.name if problem.message else None, 'text': str(problem)}


def _bound(bound: Bound) -> dict[str, object]:
    return {'tag': bound.mapping.tag, 'command': bound.mapping.command.value,
            'ms': in_ms(bound.seconds), 'usual_ms': in_ms(bound.usual),
            'presets': bound.presets}


def _remark(remark: Remark) -> dict[str, object]:
    return {'kind': remark.kind.value, 'station': remark.station, 'text': remark.text}


if __name__ == '__main__':
    raise SystemExit(main())
