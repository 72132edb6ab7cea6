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

"""The map CSV as a whole: all good rows, and every fault of the bad rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
import difflib
import re

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.columns import COLUMNS, NEEDED, RENAMED
from abdf1_ros.settings.csv_table import read_table, Row
from abdf1_ros.settings.heartbeats import counts, READS_IN_TIME, RUN
from abdf1_ros.settings.map_row import CellFault, RowReader
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.names import sanitise
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.shared_words import SharedWords
from abdf1_ros.text import shown

# The largest map that was measured; each row is at least one topic.
MOST_ROWS = 5000
# The faults of a file for which a similar tag is looked for among all tags.
_MOST_ADVICE = 20

Clash = Callable[[str, Mapping, str], None]
"""Reports a conflict; its arguments are the column, the other row and the text of the fault."""


def load_mappings(path: str) -> tuple[Rows, list[Problem]]:
    """
    Read a map CSV: the good rows, and every fault of the bad ones.

    Raises ConfigurationError when the file as a whole cannot be used.
    """
    mappings: list[Mapping] = []
    table = read_table(path, COLUMNS, NEEDED, RENAMED)
    if len(table.rows) > MOST_ROWS:
        raise ConfigurationError([Problem(table.rows[MOST_ROWS].where(), (
            f'a map has at most {MOST_ROWS} rows, this one has {len(table.rows)}; divide it '
            'among several nodes, or read neighbouring words as one row with Length'))])
    problems = table.faults + table.row_faults
    clashes = _Clashes()
    kept: dict[int, Row] = {}
    tags = _Tags(row.get('Tag') for row in table.rows)
    for row in table.rows:
        reader = RowReader(row)
        mapping = reader.read()
        faults = clashes.names(row)
        faults += [*reader.faults, *_unknown_counter(row, reader.faults, tags)] \
            if mapping is None else clashes.add(mapping, is_named=not faults)
        if mapping is not None and not faults:
            mappings.append(mapping)
            kept[mapping.item] = row
        problems += [fault.in_file(row) for fault in faults]
    rows = Rows(mappings)
    while broken := list(broken_links(rows)):
        problems += [fault.in_file(kept[mapping.item]) for mapping, fault in broken]
        rows = rows.without(mapping for mapping, _ in broken)
    if not table.is_usable:
        raise ConfigurationError(problems)
    return rows.with_bit_names(), problems


def broken_links(mappings: Rows) -> Iterator[tuple[Mapping, CellFault]]:
    """
    Yield the rows that depend on a missing row, with the fault.

    If a row was left out, the rows that depend on it are left out, too (docs/heartbeats.md, rule
    15).
    """
    tags = {mapping.tag: mapping for mapping in mappings}
    known, topics_meant = _Tags(tags), _topics_meant(mappings)
    runs = {mapping.tag.upper(): mapping for mapping in mappings if mapping.tag.upper() == RUN}
    topics = {mapping.topic for mapping in mappings.messages}
    for mapping in mappings:
        if mapping.confirms and (text := _no_confirmation(mapping, tags, mappings)):
            yield mapping, CellFault('Confirms', f'"{shown(mapping.confirms)}" {text}')
        condition = mapping.condition
        for name in condition.names if condition else ():
            named = (runs if name == RUN else tags).get(name)
            if named and (text := _two_meanings(name, named, topics)):
                yield mapping, CellFault('While', f'"{shown(name)}" {text}')
            elif mapping.is_heartbeat and name not in topics:
                yield mapping, CellFault('While', _no_topic(name, topics_meant))
            elif mapping.is_guarded and not mapping.needs_run:
                if named is None:
                    yield mapping, CellFault('While', known.fault_of(name))
                elif text := _no_counter(mapping, named, mappings):
                    yield mapping, CellFault('While', f'"{shown(name)}" {text}')
                elif text := _too_rare(mapping, named):
                    yield mapping, CellFault('While_Timeout', text)


def _unknown_counter(row: Row, faults: Collection[CellFault],
                     tags: _Tags) -> Iterator[CellFault]:
    """Yield the fault of an unknown tag in While, for a row that has other faults, too."""
    name = row.get('While')
    is_read = row.get('Command').lower() == Command.READ.value.lower()
    if is_read and name and name.upper() != RUN and name not in tags and all(
            fault.column != 'While' for fault in faults):
        yield CellFault('While', tags.fault_of(name))


class _Tags:
    """The tags of a map; similar tags are looked for a limited number of times."""

    def __init__(self, tags: Iterable[str]) -> None:
        self._tags = {*tags}
        self._alike = {tag.lower(): tag for tag in self._tags}
        self._left = _MOST_ADVICE

    def __contains__(self, tag: str) -> bool:
        return tag in self._tags

    def fault_of(self, name: str) -> str:
        """Return the fault of a counter's tag that no row has, and the tag that may be meant."""
        self._left -= 1
        close = difflib.get_close_matches(name.lower(), self._alike, 1) if self._left >= 0 else []
        meant = f'; did you mean {shown(self._alike[close[0]])}?' if close else ''
        return f'should be RUN or the tag of one good Read row; "{shown(name)}" is neither{meant}'


def _two_meanings(name: str, row: Mapping, topics: Collection[str]) -> str:
    """Return the second meaning of a name in While besides the tag of ``row``, empty for none."""
    its_tag = f'the tag of item {row.item} (line {row.place.line})'
    if name == RUN:
        return f'is the mode of the PLC, and {its_tag}; give that row another tag'
    if name in topics and row.topic != name:
        return f'is a write topic, and {its_tag}; give that row another tag'
    return ''


def _too_rare(mapping: Mapping, counter: Mapping) -> str:
    """Return why the Period of a counter is too long, empty if it is not (rule 14)."""
    timeout = mapping.condition and mapping.condition.timeout
    if not (timeout and counter.period) or timeout >= READS_IN_TIME * counter.period:
        return ''
    return f'While_Timeout {timeout} is less than {READS_IN_TIME} x {counter.period} ms, the ' \
        f'Period of {shown(counter.tag)}'


def _topics_meant(mappings: Rows) -> dict[str, str]:
    """Return the topic that each wrong name may mean; empty for a topic that we publish."""
    meant: dict[str, str] = {}
    for row in mappings.messages:
        for name in (row.tag, f'/{row.topic}', f'~/write/{row.topic}'):
            meant.setdefault(name, row.topic)
    return meant | {row.topic: '' for row in mappings}


def _no_topic(topic: str, topics_meant: dict[str, str]) -> str:
    """Return why a heartbeat cannot require messages on ``topic``."""
    text = f'no good Write, ReadWrite or Serve row has the topic "{shown(topic)}"'
    if re.search('[,;|]', topic):
        return f'{text}; put spaces between topics'
    meant = topics_meant.get(topic)
    if meant is None:
        return text
    return f'{text}; did you mean {meant}?' if meant \
        else f'{text}: the bridge publishes it; name topics whose messages the bridge gets'


def _no_confirmation(mapping: Mapping, tags: dict[str, Mapping], mappings: Rows) -> str:
    """Return why a row cannot confirm a heartbeat's control, empty if it can (rules 21, 22)."""
    beat = tags.get(mapping.confirms)
    first = next(other for other in mappings if other.confirms == mapping.confirms)
    if not (beat and beat.is_heartbeat and beat.station == mapping.station and first is mapping):
        return 'should be the tag of a good Heartbeat row of station ' \
            f'{mapping.station} that no row before it confirms'
    ours = next((row for row in mappings if row.changes and row.shares_words(mapping)), None)
    return f'cannot be confirmed by {mapping.address}, which {shown(ours.tag)} writes: no ' \
        'heartbeat confirms itself; name a bit that the program of the PLC sets' if ours else ''


def _no_counter(mapping: Mapping, counter: Mapping, mappings: Rows) -> str:
    """Return why values cannot depend on ``counter``, empty if they can (rule 13)."""
    if counter.command is not Command.READ:
        return 'is not a Read row'
    if counter.is_on_demand:
        return 'is read only on demand'
    if counter.station != mapping.station:
        return f'is of station {counter.station}; a counter of the same PLC is needed'
    if not counts(counter.type, counter.length):
        return 'is not one int16 or uint16 word'
    if any(beat.shares_words(counter) for beat in mappings.heartbeats):
        return 'reads our own heartbeat, so both sides would wait for each other'
    return 'depends on something itself' if counter.condition else ''


def _processor(mapping: Mapping) -> Processor | None:
    """Return the SLC processor of a mapping; None for other PLCs, Serve rows and broadcasts."""
    has_processors = bool(FAMILIES[mapping.plc_type].by_processor)
    if not has_processors or mapping.serves or mapping.station == BROADCAST:
        return None
    return mapping.processor or USUAL


class _Clashes:
    """Find rows that clash with rows before them; each fault names both rows."""

    def __init__(self) -> None:
        self._names: dict[str, Row] = {}  # also of rows that have faults
        self._readers: dict[str, Mapping] = {}
        self._writers: dict[str, Mapping] = {}
        self._slcs: dict[int, Mapping] = {}
        self._changing = SharedWords()
        self._alone = SharedWords()  # rows whose words belong to no other row
        self._routed: dict[int, Mapping] = {}
        self._gateways: dict[int, Mapping] = {}

    def names(self, row: Row) -> list[CellFault]:
        """Return the clash of the tag of ``row``, which may have other faults; remember it."""
        tag, name = row.get('Tag'), sanitise(row.get('Tag'))
        if not name or (other := self._names.setdefault(name, row)) is row:
            return []
        same = 'is already the tag' if tag == other.get('Tag') else f'becomes "{name}", the name'
        return [CellFault('Tag', f'tag "{shown(tag)}" {same} of item {other.item} '
                                 f'(line {other.line}, tag "{shown(other.get("Tag"))}")')]

    def add(self, mapping: Mapping, is_named: bool) -> list[CellFault]:
        """
        Return the clashes of ``mapping``; if there are none, remember it for later rows.

        Without ``is_named`` its tag has a fault: a topic named after the tag is not reported
        again.
        """
        faults: list[CellFault] = []

        def clash(column: str, other: Mapping, text: str) -> None:
            faults.append(CellFault(column, (
                f'{text} of item {other.item} (line {other.place.line}, tag '
                f'"{shown(other.tag)}")')))

        is_told = is_named or mapping.topic != mapping.name
        if is_told and mapping.reads and (other := self._readers.get(mapping.topic)):
            clash('Topic', other, f'read topic "{mapping.topic}" is the topic')
        if is_told and mapping.writes and (other := self._writers.get(mapping.topic)) \
                and (other.message_type, other.length) != (mapping.message_type, mapping.length):
            clash('Topic', other, f'write topic "{mapping.topic}" needs the message type '
                                  f'({other.message_type.value}) and Length ({other.length})')
        here, other = _processor(mapping), self._slcs.get(mapping.station)
        if here and other and (there := _processor(other)) and there is not here:
            names = [entry.value + ('' if row.processor else ' (an empty cell)')
                     for entry, row in ((here, mapping), (there, other))]
            clash('Processor', other, f'Processor of station {mapping.station} is {names[0]} '
                                      f'here, but {names[1]} in the row')
        self._check_route(mapping, clash)
        self._check_words(mapping, clash)
        if is_named and not faults:
            if mapping.changes:
                self._changing.add(mapping)
                if mapping.is_alone:
                    self._alone.add(mapping)
            if not mapping.serves:
                self._routed.setdefault(mapping.station, mapping)
            if mapping.via is not None:
                self._gateways.setdefault(mapping.via, mapping)
            if here:
                self._slcs.setdefault(mapping.station, mapping)
            if mapping.reads:
                self._readers[mapping.topic] = mapping
            if mapping.writes:
                self._writers[mapping.topic] = mapping
        return faults

    def _check_route(self, mapping: Mapping, clash: Clash) -> None:
        """Find a station with two routes: a reply has the station's number, but not its route."""
        if mapping.serves:
            return
        if (other := self._routed.get(mapping.station)) and other.via != mapping.via:
            ways = [f'Via {entry.via}' if entry.via is not None else 'no Via'
                    for entry in (mapping, other)]
            clash('Via', other, f'station {mapping.station} has {ways[0]} here, but {ways[1]} in '
                                'the row')
        elif mapping.via is not None and (other := self._gateways.get(mapping.station)):
            clash('Via', other, f'station {mapping.station} is itself the gateway in the row')
        elif mapping.via is not None and (other := self._routed.get(mapping.via)) \
                and other.via is not None:
            clash('Via', other, f'station {mapping.via} is itself behind the gateway {other.via} '
                                'in the row')

    def _check_words(self, mapping: Mapping, clash: Clash) -> None:
        """Find another writer of words that only a heartbeat or a Fallback may write."""
        others = self._changing if mapping.is_alone else self._alone
        if mapping.changes and (other := others.first(mapping)):
            clash('Address', other, (
                'the words of a heartbeat or a Fallback belong to no other row; '
                f'{mapping.address}{_why_same(mapping, other)} shares words with the row'))


def _why_same(mapping: Mapping, other: Mapping) -> str:
    """Return why words with different names in two rows are the same."""
    if mapping.station != other.station:
        return ' (a broadcast has the words of every station)'
    if mapping.address.area != other.address.area:
        return ' (a PLC finds a file by its number, whatever Type or PLC_Type a row gives it)'
    return ''
