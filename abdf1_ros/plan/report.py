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
The report on two checked files: the read plan, its times, and remarks.

All times are forecasts (see ``forecast``), in seconds. A remark names a setting that is valid, but
may have an unexpected effect.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
import math

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Transfer
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.plan import bounds, forecast
from abdf1_ros.plan.bounds import OURS_BESIDE_GUESTS, Times
from abdf1_ros.plan.planner import Block, Planner, StationArea
from abdf1_ros.settings import BAUD_RATES
from abdf1_ros.settings.heartbeats import LONGEST_LEASE, NODE_LEASE
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.remarks import network_remarks
from abdf1_ros.settings.resets import lost_by_reset
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.share import share_places
from abdf1_ros.text import counted, first, milliseconds

_HIGH_LOAD = 0.8
_GUEST_COMMAND, _GUEST_REPLY = 6, 40  # bytes after TNS: a read of 20 words of an SLC
_WORTH_SAVING = 0.05  # of the poll cycle
_NAMED_TAGS = 3
_LONG_TIMEOUT = 10_000  # ms
_CROWD = 100  # rows of one word; 16 bits, each read, written and served, are 48

PERIOD_STEPS = tuple(step * 10**power for power in (2, 3, 4) for step in (1, 2, 5))
"""The values of Period (ms) that we advise."""


class RemarkKind(Enum):
    """The subject of a remark; programs see the value."""

    MAP = 'map'
    SETTING = 'setting'
    STATION = 'station'
    PERIOD = 'period'
    LOAD = 'load'
    GAP = 'gap'
    INTERLOCK = 'interlock'


@dataclass(frozen=True, slots=True)
class Remark:
    """An unusual setting or time; ``station``: the station concerned, None for the line."""

    kind: RemarkKind
    text: str
    station: int | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """
    The read plan of a line.

    ``default_period`` is for mappings without Period. ``response_time`` is the time of a station
    for each answer, ``answer_time`` the time that the line waits for it. All are in seconds.
    """

    network: Network
    mappings: Rows
    blocks: tuple[Block, ...]
    default_period: float
    response_time: float
    answer_time: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Find out how long the line waits for an answer."""
        object.__setattr__(self, 'answer_time', forecast.answer_time(
            self.network, self.blocks, self.response_time))

    @property
    def is_timed(self) -> bool:
        """Tell whether we decide when a row is read; in Mode Slave the master does."""
        return not self.network.line_mode.is_polled

    @property
    def poll_cycle(self) -> float:
        """Return the seconds that it takes to read every block once."""
        return forecast.poll_cycle(self.blocks, self.answer_time)

    @property
    def load(self) -> float:
        """Return the part of the line's time that the periods need."""
        return forecast.load(self.blocks, self.answer_time) + sum(
            own.seconds / own.period for own in self._own_work)

    def intervals(self) -> dict[Block, float]:
        """Return the expected seconds between two reads of each block."""
        return forecast.intervals(forecast.line_model(self.network), self.blocks, self._own_work,
                                  self.answer_time)

    @property
    def _own_work(self) -> list[forecast.OwnCommand]:
        return bounds.own_work(
            forecast.line_model(self.network), self.mappings, self.default_period,
            response_time=self.answer_time)

    @property
    def times(self) -> Times:
        """Return the times that heartbeats and fallbacks can keep, and the longest transaction."""
        return Times(self.network, self.mappings, self.blocks, self.response_time)

    def promises(self) -> dict[Mapping, float]:
        """Return the deadline (s) of the topic of each row that we read, if it has one."""
        # The node promises the same time, however long a PLC really takes to answer.
        line = forecast.line_model(self.network)
        stale = forecast.stale_times(
            line, self.blocks, self.default_period, forecast.USUAL_STALE_AFTER,
            bounds.own_work(line, self.mappings, self.default_period),
            is_heard=self.network.line_mode.only_listens)
        return {mapping: promise for mapping, time in stale.items()
                if math.isfinite(promise := mapping.promise(time))}

    def time(self, block: Block) -> float:
        """Return the seconds that a block takes, answers included."""
        return forecast.block_time(block, self.answer_time)

    def needed_baud(self) -> int | None:
        """Return the lowest baud rate at which the line can keep all periods, or None."""
        found = bisect_left(BAUD_RATES, True, key=lambda baud: make_report(
            replace(self.network, baud=baud), self.mappings, self.default_period,
            self.response_time).load <= 1)
        return BAUD_RATES[found] if found < len(BAUD_RATES) else None

    def needed_period(self) -> int | None:
        """
        Return the shortest Period (ms) that may replace all shorter ones, or None.

        It is one of ``PERIOD_STEPS``. The periods then need at most ``_HIGH_LOAD`` of the time.
        """
        others = self.load - forecast.load(self.blocks, self.answer_time)
        return next((period for period in PERIOD_STEPS if others + sum(
            self.time(block) / max(block.period, period / 1000) for block in self.blocks
            if block.period) <= _HIGH_LOAD), None)

    def notes(self) -> list[str]:
        """Return facts that a reader should know although they are not unusual."""
        found = list(bounds.costs(
            self.network, self.mappings, self.default_period, self.response_time))
        found += bounds.conditions(self.network, self.mappings)
        bits = [mapping for mapping in self.mappings if mapping.command is Command.READ
                and mapping.type is ValueType.BOOL]
        silent = [mapping for mapping in bits if math.isinf(mapping.promise(0.0))]
        if silent:
            found.append(f'bits with Publish Change: {_tags(silent)}; their topics have no '
                         'deadline, so a subscriber that asks for a deadline gets no values; '
                         'Max_Silence gives them a deadline')
        free = [mapping for mapping in bits if mapping.condition is None]
        if free:
            found.append(f'bits without While: {_tags(free)}; their values go on when the '
                         'program of the PLC stops')
        if alarms := [mapping for mapping in self.mappings if mapping.alarm is not None]:
            found.append(f'alarms on /diagnostics: {_tags(alarms)}')
        if self.mappings.on_demand:
            found.append(f'read on demand alone, by ~/read_now: {self._on_demand()}')
        if self.mappings.served and (lost := lost_by_reset(self.network, self.mappings)):
            found.append('with the parameter nak_on_command_timeout true, each overdue reply '
                         f'would make all slaves drop what they have queued: {"; ".join(lost)}')
        if gaps := '; '.join(_unprotected(self.mappings)):
            found.append(f'nothing protects: {gaps}')
        found += _publisher_notes(self.mappings.fallbacks)
        return found

    def _on_demand(self) -> str:
        """Return the rows that are read on demand, with the time that each read takes."""
        planner = Planner(forecast.line_model(self.network), self.default_period)
        return first([f'{mapping.tag} ({milliseconds(self.time(planner.alone(mapping)))})'
                      for mapping in self.mappings.on_demand], _NAMED_TAGS)

    def remarks(self) -> list[Remark]:
        found = [*setting_remarks(self.network, self.mappings)]
        if not self.mappings:
            text = 'the map has no usable row: nothing is read or written'
            return [*found, Remark(RemarkKind.MAP, text)]
        times = bounds.remarks(self.network, self.mappings, self.blocks, self.response_time)
        if self.network.line_mode.only_listens:
            return found
        return [*found, *self.load_remarks(), *_gap_remarks(self), *_again_remarks(self),
                *(Remark(RemarkKind.INTERLOCK, text) for text in times)]

    def load_remarks(self) -> list[Remark]:
        """Return the remarks on periods that the line cannot keep."""
        return [] if self.network.line_mode.only_listens else [
            *_load_remarks(self), *_period_remarks(self), *_packet_remarks(self)]


def _unprotected(mappings: Rows) -> Iterator[str]:
    """
    Find rows where a dead publisher or PLC is noticed late or never.

    This is rule 20 of docs/heartbeats.md.
    """
    written = mappings.of_plcs.messages
    bare = [mapping for mapping in written if mapping.fallback is None]
    if bare:
        bare.sort(key=lambda mapping: (mapping.address.file_type is not FileType.OUTPUT,
                                       mapping.type is not ValueType.BOOL))
        yield f'{len(bare)} of {len(written)} written rows, without Fallback: {_tags(bare)}'
    stations = {mapping.station for mapping in written}
    beats = mappings.heartbeats
    deaf = [mapping for mapping in beats if mapping.condition is None
            and mapping.station in stations]
    if deaf:
        yield f'heartbeats without While, which count even if no program publishes: {_tags(deaf)}'
    slow = [mapping for mapping in beats
            if mapping.condition and (mapping.condition.timeout or 0) > _LONG_TIMEOUT]
    if slow:
        yield f'While_Timeout over {_LONG_TIMEOUT // 1000} s: {_tags(slow)}'
    pushed = [mapping for mapping in mappings.served
              if not mapping.is_read_only and not mapping.period]
    if pushed:
        yield ('topics of Serve rows without Period, so a PLC that stops is not noticed: '
               f'{_tags(pushed)}')


def _publisher_notes(fallbacks: Rows) -> Iterator[str]:
    """Yield a note on how many publishers rows with Fallback may have (rules 20 and 28)."""
    killed = (f'a killed publisher counts for {NODE_LEASE} s, or for {LONGEST_LEASE:g} s if it '
              f'offers a liveliness lease of {LONGEST_LEASE:g} s or less')
    if many := [mapping for mapping in fallbacks if not mapping.single_publisher]:
        yield (f'rows with Fallback that take messages of any number of publishers: {_tags(many)}'
               '; Single_Publisher Yes refuses all messages while more than one publisher is '
               f'alive; {killed}')
    elif fallbacks:
        yield f'Single_Publisher: {killed}'


def make_report(network: Network, mappings: Iterable[Mapping], default_period: float,
                response_time: float = forecast.USUAL_RESPONSE_TIME) -> Report:
    """Plan the reads of ``mappings``; times in seconds."""
    mappings = Rows(mappings)
    planner = Planner(forecast.line_model(network), default_period)
    blocks = sorted(planner.plan(mappings.repeated), key=_row_order)
    return Report(network, mappings, tuple(blocks), default_period, response_time)


def setting_remarks(network: Network, mappings: Sequence[Mapping]) -> Iterator[Remark]:
    """Find unusual settings in both files that are valid, and stations that clash."""
    for text in network_remarks(network):
        yield Remark(RemarkKind.SETTING, text)
    for mapping in mappings:
        for problem in mapping.remarks:
            yield Remark(RemarkKind.SETTING, str(problem), mapping.station)
    yield from _overlap_remarks(mappings)
    yield from _case_remarks(mappings)
    yield from _station_remarks(network, mappings)


def _overlap_remarks(mappings: Sequence[Mapping]) -> Iterator[Remark]:
    """Find Write rows that write words of Read rows, and words that several rows write."""
    here: defaultdict[tuple[object, ...], defaultdict[int, list[Mapping]]] = defaultdict(
        lambda: defaultdict(list))
    for mapping in mappings:
        for word in _words([mapping]):
            here[_area(mapping)][word].append(mapping)
    yield from _crowd_remarks(here.values())
    for mapping in mappings:
        if not mapping.writes:
            continue
        words = here[_area(mapping)]
        others = dict.fromkeys(other for word in _words([mapping]) for other in words[word]
                               if mapping.shares_words(other))
        read = [other for other in others if other.command is Command.READ]
        written = [other for other in others if other.writes and other.item < mapping.item]
        about = f'{mapping.place}: {mapping.tag} writes {mapping.address}'
        if read and mapping.command is Command.WRITE and not mapping.write_again:
            yield Remark(RemarkKind.SETTING, (
                f'{about}, which {_tags(read)} reads, so a message overwrites the value of the '
                'PLC; if you mean that, use one ReadWrite row, otherwise another address'),
                mapping.station)
        if written:
            yield Remark(RemarkKind.SETTING, (
                f'{about}, of which {_tags(written)} also writes some or all: each row '
                'overwrites values of the other row'), mapping.station)


def _crowd_remarks(areas: Iterable[dict[int, list[Mapping]]]) -> Iterator[Remark]:
    """Find words that very many rows have, and take these rows out of the lists."""
    for words in areas:
        crowded = [word for word, rows in words.items() if len(rows) > _CROWD]
        if not crowded:
            continue
        rows = words[crowded[0]]
        yield Remark(RemarkKind.SETTING, (
            f'{len(rows)} rows have the word {last_address(rows[0].address, crowded[0])}: '
            f'{_tags(rows)}; they are too many to be compared with each other'), rows[0].station)
        for word in crowded:
            words[word].clear()


def _case_remarks(mappings: Iterable[Mapping]) -> Iterator[Remark]:
    """Find tags that differ only in capital and small letters."""
    names: defaultdict[str, list[Mapping]] = defaultdict(list)
    for mapping in mappings:
        names[mapping.name.lower()].append(mapping)
    for group in names.values():
        if len({mapping.name for mapping in group}) > 1:
            yield Remark(RemarkKind.SETTING, (
                f'tags that differ only in capital and small letters: {_tags(group)}'))


def _area(mapping: Mapping) -> tuple[object, ...]:
    return mapping.serves, mapping.station, mapping.address.area


def _row_order(block: Block) -> tuple[int, int]:
    return block.station, min(mapping.item for mapping in block.mappings)


def _station_remarks(network: Network, rows: Sequence[Mapping]) -> Iterator[Remark]:
    """Find stations whose numbers or types clash."""
    stations: defaultdict[int, list[Mapping]] = defaultdict(list)
    for mapping in rows:
        if not mapping.serves and mapping.station != BROADCAST:
            stations[mapping.station].append(mapping)
    for station, mappings in sorted(stations.items()):
        if station == network.station and not network.line_mode.only_listens:
            yield Remark(RemarkKind.STATION, (
                f'station {station} of {_tags(mappings)} is our own Station in the net file; '
                'a PLC may refuse commands from its own number'), station)
        types: dict[str, list[Mapping]] = {}
        for mapping in mappings:
            if mapping.access is Access.CIF:
                continue  # two types, one PLC: PLC-2 commands to an SLC
            types.setdefault(mapping.plc_type.value, []).append(mapping)
        if len(types) > 1:
            kinds = ', '.join(f'{name} ({_tags(group)})' for name, group in types.items())
            yield Remark(RemarkKind.STATION, (
                f'station {station} has more than one PLC_Type: {kinds}'), station)
        yield from _file_remarks(station, mappings)
    yield from _gateway_remarks(network, stations)
    if network.line_mode.has_one_plc and 0 in (network.station, *stations):
        whose = 'our own Station is 0' if network.station == 0 else 'station 0 is in the map'
        yield Remark(RemarkKind.STATION, (
            f'{whose}: a message to station 0 begins with 00, and neither BCC nor CRC notices '
            'when that is lost on a full-duplex line; any other number is safe'), 0)
    if network.line_mode.has_one_plc and len(stations) > 1:
        listed = ', '.join(map(str, sorted(stations)))
        yield Remark(RemarkKind.STATION, (
            f'a full-duplex line has one PLC, the map has stations {listed}; only a gateway '
            'answers for several'))


def _file_remarks(station: int, mappings: Iterable[Mapping]) -> Iterator[Remark]:
    """Find files of a PLC that have different types in two rows."""
    files: defaultdict[tuple[PlcType, int], dict[FileType, list[Mapping]]] = defaultdict(dict)
    for mapping in mappings:
        address = mapping.address
        if not address.is_by_type and mapping.access is not Access.CIF:
            files[mapping.plc_type, address.file].setdefault(address.file_type, []).append(mapping)
    for (_, number), types in sorted(files.items(), key=lambda item: item[0][1]):
        if len(types) > 1:
            kinds = ', '.join(f'{kind.value}{number} ({_tags(group)})'
                              for kind, group in types.items())
            yield Remark(RemarkKind.STATION, (
                f'station {station}: file {number} cannot be {kinds} at the same time; a file of '
                'a PLC has one type'), station)


def _gateway_remarks(network: Network, stations: dict[int, list[Mapping]]) -> Iterator[Remark]:
    """Find unusual values in the column Via, and unusual stations behind a gateway."""
    is_behind = network.line_mode.has_one_plc and len(stations) > 1
    for station, mappings in sorted(stations.items()):
        via = mappings[0].via
        if via is None and not is_behind:
            continue
        if via is not None and not network.line_mode.is_master:
            yield Remark(RemarkKind.STATION, (
                f'station {station} of {_tags(mappings)}: Via is for Mode Master; in Mode '
                f'{network.mode} the gateway is not addressed'), station)
        elif station > 7 and set(str(station)) <= set('01234567'):
            yield Remark(RemarkKind.STATION, (
                f'station {station} of {_tags(mappings)} is behind '
                f'{"a gateway" if via is None else f"gateway {via}"}: on Data Highway '
                f'Plus node numbers are octal; if {station} is what a panel there shows, write '
                f'{int(str(station), 8)}'), station)


def _load_remarks(report: Report) -> Iterator[Remark]:
    """Compare the time that the periods need with the time of the line."""
    load = report.load
    if load > 1:
        baud = report.needed_baud()
        period = report.needed_period()
        advice = f'{baud} baud would be enough' if baud \
            else 'no baud rate is enough, only longer periods'
        advice += f'; or Period {period} in place of shorter ones' if period else ''
        yield Remark(RemarkKind.LOAD, (
            f'the periods need {load:.0%} of the time of the line at {report.network.baud} baud, '
            f'so reads come late; {advice}'))
    elif load > _HIGH_LOAD:
        yield Remark(RemarkKind.LOAD, (
            f'the periods need {load:.0%} of the line; writes, repetitions and silent stations '
            'have to do with the rest'))
    guarded = [row for row in report.mappings if row.is_guarded]
    if load > _HIGH_LOAD and guarded:
        yield Remark(RemarkKind.LOAD, (
            'on such a line rows with While come less often than other rows, because each value '
            f'needs a recent mode of the PLC, or a recent counter: {_tags(guarded)}'))
    if share_places(report.network.share):
        yield Remark(RemarkKind.LOAD, (
            'while guests (Share) ask, a quarter of the time may be theirs: the periods then need '
            f'{load * (1 + 1 / OURS_BESIDE_GUESTS):.0%} of the time that is left, and the '
            f'poll cycle is up to a third longer; {_guest_rate(report)}'))


def _guest_rate(report: Report) -> str:
    """Return how many reads of guests the line takes, alone and beside our own reads."""
    seconds = report.answer_time + forecast.line_model(report.network).transaction_time(
        _GUEST_COMMAND, _GUEST_REPLY)
    beside = seconds * (1 + OURS_BESIDE_GUESTS)
    return (f'of their reads of {_GUEST_REPLY // 2} words the line takes {1 / seconds:.0f} a '
            f'second, and {1 / beside:.0f} beside rows with Period 0')


def _again_remarks(report: Report) -> Iterator[Remark]:
    """Find rows with Write_Again whose words are read too seldom to show what the PLC holds."""
    expected = report.intervals()
    for row in report.mappings:
        if row.write_again is None:
            continue
        reads = [expected[block] for block in report.blocks
                 if block.extent.holds(row.extent)]
        least, which = min((row.write_again, 'Write_Again'), (
            (row.fallback.after, 'Fallback_After') if row.fallback
            else (int(1000 * bounds.USUAL_WRITE_TIMEOUT), 'write_timeout')))
        if not reads:
            text = 'has no effect: no Read row has all of its words'
        elif 2000 * min(reads) > least:
            text = (f'has little effect: its words are read every {milliseconds(min(reads))}, and '
                    f'that has to be well below {which}, {least} ms')
        else:
            continue
        yield Remark(RemarkKind.SETTING, f'{row.tag}: Write_Again {text}', row.station)


def _period_remarks(report: Report) -> Iterator[Remark]:
    """Find reads that take longer than their own period."""
    for block in report.blocks:
        time = report.time(block)
        if 0 < block.period < time:
            yield Remark(RemarkKind.PERIOD, (
                f'{_tags(block.mappings)}: a read takes {milliseconds(time, 1)}, '
                f'the period is {milliseconds(block.period, 1)}'), block.station)


def _packet_remarks(report: Report) -> Iterator[Remark]:
    """Find packets that take the line for longer than Cmd_Timeout."""
    network = report.network
    longest = network.cmd_timeout / 1000
    effect = 'by radio its reply may come too late each time: raise Cmd_Timeout' \
        if network.duplex is Duplex.RADIO else 'all else waits that long: give guests more time'
    for block in report.blocks:
        if (time := max(block.line_times)) > longest:
            yield Remark(RemarkKind.PERIOD, (
                f'{_tags(block.mappings)}: a packet takes {milliseconds(time, 1)} at '
                f'{network.baud} baud, Cmd_Timeout is {network.cmd_timeout} ms; {effect}, '
                'or use shorter rows or a higher baud rate'), block.station)


def _gap_remarks(report: Report) -> Iterator[Remark]:
    """Find tags that lie far apart in the PLC, so that reading them costs much more."""
    groups: defaultdict[tuple[StationArea, float], list[Block]] = defaultdict(list)
    for block in report.blocks:
        groups[block.station_area, block.period].append(block)
    saving = _WORTH_SAVING * report.poll_cycle
    for blocks in groups.values():
        time = sum(map(report.time, blocks))
        least = _time_side_by_side(report, blocks)
        mappings = [mapping for block in blocks for mapping in block.mappings]
        if len(mappings) > 1 and time - least >= saving:
            first, last = _ends(mappings)
            spare = sum(block.words for block in blocks) - len(_words(mappings))
            yield Remark(RemarkKind.GAP, (
                f'station {blocks[0].station}, {first} to {last}: '
                f'{counted(len(blocks), "read")} with {counted(spare, "word")} that no tag needs '
                f'take {milliseconds(time, 1)}; side by side in the PLC the tags would take '
                f'{milliseconds(least, 1)}'), blocks[0].station)


def _time_side_by_side(report: Report, blocks: Sequence[Block]) -> float:
    """Return the seconds that the mappings of an area would take without gaps between them."""
    mappings = [mapping for block in blocks for mapping in block.mappings]
    example = blocks[0]
    kind = example.start.file_type
    needed, limit = len(_words(mappings)), example.dialect.max_read(kind)
    if needed > 1:
        needed += -needed % example.start.layout.words
    packets = [limit] * (needed // limit) + [needed % limit] * (needed % limit > 0)
    requests = tuple(Transfer(example.start, words) for words in packets)
    model = forecast.line_model(report.network)
    line_times = tuple(model.read_time(example.dialect, request, example.station)
                       for request in requests)
    return report.time(replace(example, requests=requests, line_times=line_times))


def _words(mappings: Iterable[Mapping]) -> set[int]:
    """Return the offsets of all words that mappings of one area need."""
    return {mapping.address.offset + number
            for mapping in mappings for number in range(mapping.codec.words)}


def _ends(mappings: Sequence[Mapping]) -> tuple[Address, Address]:
    """Return the first and the last word of mappings of one area."""
    offsets = _words(mappings)
    address = mappings[0].address
    return address.at_offset(min(offsets)), last_address(address, max(offsets))


def last_address(address: Address, offset: int) -> Address:
    """Return the address of the element, or a structure's word, at an offset in the area."""
    whole = 1 if address.file_type.is_structure else address.layout.words
    return address.at_offset(offset - offset % whole)


def _tags(mappings: Sequence[Mapping]) -> str:
    return first([mapping.tag for mapping in mappings], _NAMED_TAGS)
