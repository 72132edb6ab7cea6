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

"""Entries and summaries as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
import json

from abdf1_ros.df1.listener import LineKind
from abdf1_ros.pccc.describe import command_name
from abdf1_ros.sniffer.capture import Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.summary import Counts, Summary
from abdf1_ros.text import counted, in_ms, printable

_RED, _YELLOW, _FAINT, _PLAIN = '\x1b[31m', '\x1b[33m', '\x1b[2m', '\x1b[0m'
_BAD = (Kind.DAMAGED, Kind.UNANSWERED, Kind.UNKNOWN, Kind.NOISE)
_ROUTINE = (Kind.POLL, Kind.ACK, Kind.EOT)


def text_line(entry: Entry, colour: bool = False) -> str:
    """Return time, direction, station, kind, and the ``words`` of an entry."""
    time = '-' if entry.time is None else f'{entry.time:.6f}'
    station = '' if entry.station is None else str(entry.station)
    line = (f'{time:>13} {entry.direction.value} {station:>3} {entry.kind.value:<8} '
            f'{words(entry)}').rstrip()
    shade = _shade(entry) if colour else ''
    return f'{shade}{line}{_PLAIN}' if shade else line


def words(entry: Entry) -> str:
    """Return text, guest, check, latency and marks of an entry."""
    guest = f'guest {printable(entry.guest)}' if entry.guest else ''
    latency = '' if entry.latency is None else f'{entry.latency * 1000:.1f} ms'
    marks = (mark.value.upper() for mark in entry.marks)
    return ' | '.join(filter(None, (entry.text, guest, _check(entry), latency, *marks)))


def _check(entry: Entry) -> str:
    if entry.valid is None:
        return ''
    name = entry.checksum.value if entry.checksum else 'check'
    return f'{name} {"good" if entry.valid else "BAD"}'


def _shade(entry: Entry) -> str:
    is_error = entry.kind is Kind.REPLY and entry.packet is not None and entry.packet.sts
    if entry.kind in _BAD or entry.valid is False or is_error:
        return _RED
    if entry.marks or entry.kind in (Kind.SILENCE, Kind.NAK):
        return _YELLOW
    return _FAINT if entry.kind in _ROUTINE else ''


def json_line(entry: Entry) -> str:
    """Return an entry as a JSON object, without unknown values."""
    fields: dict[str, object] = {
        'time': None if entry.time is None else round(entry.time, 6),
        'direction': entry.direction.value, 'kind': entry.kind.value,
        'station': entry.station, 'text': entry.text or None, 'guest': entry.guest or None,
        'check': entry.checksum.value if entry.checksum else None, 'valid': entry.valid,
        'latency_ms': in_ms(entry.latency),
        'marks': [mark.value for mark in entry.marks] or None, 'bytes': entry.size or None}
    packet = entry.packet
    if packet is not None:
        fields |= {
            'dst': packet.dst, 'src': packet.src, 'command': command_name(packet),
            'sts': packet.sts, 'tns': packet.tns, 'data': packet.data.hex()}
    return json.dumps({name: value for name, value in fields.items() if value is not None})


def summary_json(summary: Summary, kind: LineKind) -> str:
    """Return the summary as one JSON object of the kind "summary"."""
    load = summary.load(kind.duplex)
    return json.dumps({
        'kind': 'summary', 'seconds': summary.seconds,
        'bytes': {direction.value: count for direction, count in summary.bytes.items()},
        'check': kind.checksum.value if kind.checksum else None,
        'duplex': kind.duplex.name.lower() if kind.duplex else None, 'baud': summary.baud,
        'load': None if load is None else round(load, 4),
        **({'one_sided': True} if summary.is_one_sided else {}),
        **_counts(summary.all),
        'stations': {str(station): _counts(counts)
                     for station, counts in sorted(summary.stations.items())}})


def _counts(counts: Counts) -> dict[str, object]:
    return {
        'counts': {kind.value: counts.kinds[kind] for kind in Kind if counts.kinds[kind]},
        'marks': {mark.value: counts.marks[mark] for mark in Mark if counts.marks[mark]},
        'errors': counts.errors, 'damaged': counts.damaged, 'noise': counts.noise,
        'latency_ms': {
            'mean': in_ms(counts.latency.mean),
            'max': in_ms(counts.latency.longest)} if counts.latency.count else None}


def summary_lines(summary: Summary, kind: LineKind) -> Iterator[str]:
    """Yield the lines of a summary."""
    counts = summary.all
    yield f'summary: {", ".join(_line_facts(summary, kind))}'
    yield '  seen: ' + _listed(
        (counts.kinds[Kind.COMMAND], 'command'), (counts.kinds[Kind.REPLY], 'reply'),
        (counts.errors, 'of them with an error'), (counts.kinds[Kind.POLL], 'poll'),
        (counts.kinds[Kind.EOT], 'EOT'), (counts.kinds[Kind.ACK], 'ACK'),
        (counts.kinds[Kind.NAK], 'NAK'), (counts.kinds[Kind.ENQ], 'ENQ'),
        (counts.marks[Mark.FORWARDED], 'forwarded'))
    yield '  faults: ' + _listed(
        (counts.damaged, 'damaged'), (counts.noise, 'byte of noise'),
        (counts.marks[Mark.RETRANSMISSION], 'retransmission'),
        (counts.marks[Mark.DUPLICATE], 'duplicate'),
        (counts.kinds[Kind.UNANSWERED], 'command without reply'),
        (counts.kinds[Kind.SILENCE], 'polls and messages without answer'))
    if summary.is_one_sided:
        yield '  only one side of the line was recorded, so missing answers are not counted'
    if counts.latency.count:
        yield (f'  replies after: mean {counts.latency.mean * 1000:.1f} ms, '
               f'max {counts.latency.longest * 1000:.1f} ms')
    yield from _station_table(summary)


def _line_facts(summary: Summary, kind: LineKind) -> Iterator[str]:
    if summary.seconds is not None:
        yield f'{summary.seconds:.1f} s'
    ways = [f'{summary.bytes[way]} {way.value}' for way in Direction if summary.bytes[way]]
    sizes = f' ({", ".join(ways)})' if len(ways) > 1 else ''
    yield counted(summary.bytes.total(), 'byte') + sizes
    if kind.duplex is not None:
        yield kind.duplex.value
    if kind.checksum is not None:
        yield kind.checksum.value
    load = summary.load(kind.duplex)
    if load is not None:
        yield f'line load {load:.1%} at {summary.baud} baud'


_NOUNS = 'command', 'reply', 'poll', 'byte', 'retransmission', 'duplicate'


def _listed(*entries: tuple[int, str]) -> str:
    return ', '.join(_counted(count, *name.split(' ', 1)) for count, name in entries if count) \
        or 'none'


def _counted(count: int, noun: str, rest: str = '') -> str:
    text = counted(count, noun) if noun in _NOUNS else f'{count} {noun}'
    return f'{text} {rest}'.rstrip()


_COLUMNS = ('station', 'polls', 'silent', 'commands', 'replies', 'errors', 'damaged',
            'repeated', 'no reply', 'mean ms', 'max ms')


def _station_table(summary: Summary) -> Iterator[str]:
    if summary.stations:
        yield '  ' + ' '.join(f'{name:>8}' for name in _COLUMNS)
    for station, counts in sorted(summary.stations.items()):
        kinds, latency = counts.kinds, counts.latency
        cells = [station, kinds[Kind.POLL], kinds[Kind.SILENCE], kinds[Kind.COMMAND],
                 kinds[Kind.REPLY], counts.errors, counts.damaged,
                 counts.marks[Mark.RETRANSMISSION] + counts.marks[Mark.DUPLICATE],
                 kinds[Kind.UNANSWERED]]
        times = [f'{value * 1000:.1f}' if latency.count else '-'
                 for value in (latency.mean, latency.longest)]
        yield '  ' + ' '.join(f'{cell:>8}' for cell in (*map(str, cells), *times))
