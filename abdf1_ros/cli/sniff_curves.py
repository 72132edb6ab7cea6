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

"""The curves of ``sniff --curve``: values of addresses in the replies of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta, UTC

from abdf1_ros.cli.lanes import text_of
from abdf1_ros.cli.plc.data import check_for_some_family, listed_addresses, mapping_of
from abdf1_ros.cli.plc.log_picture import ValuePicture
from abdf1_ros.cli.plc.log_reader import Sample, ValuePlace
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.foreign_words import words_in_reply
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.describe import describe, effect_of
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.sniffer.entries import Entry, Kind

# Most different commands of which is kept whether they read an address.
_MOST_KNOWN = 10_000
_MOST_READS = 8  # that a remark may name


class HeardCurves:
    """
    Collect the values that good replies have, of each station that is asked for them.

    Each item of ``addresses`` is an address, or several with commas. ``remarks`` names those that
    no reply has.

    Raises ConfigurationError if no family has one of the addresses.
    """

    def __init__(self, addresses: Sequence[str]) -> None:
        self._addresses = [address for text in addresses for address in listed_addresses(text)]
        check_for_some_family(self._addresses, _cells(0))
        self._found: set[str] = set()
        self._reads: dict[str, None] = {}  # the reads that were answered, in words
        self._picture = ValuePicture()
        self._places: set[ValuePlace] = set()
        self._rows: dict[tuple[int, str, PlcType], Mapping | None] = {}
        self._known: dict[tuple[int, int, bytes, str], Mapping | None] = {}

    def add(self, entry: Entry, begun: datetime | None) -> None:
        """Take an entry of a recording that was ``begun`` at a time of day, None if unknown."""
        try:
            when = (begun or datetime(1970, 1, 1)) + timedelta(seconds=entry.time or 0.0)
        except OverflowError:  # beyond the years that a date can have
            return
        when = when if when.tzinfo else when.replace(tzinfo=UTC)
        command, reply = entry.request, entry.packet
        if entry.kind in (Kind.SILENCE, Kind.UNANSWERED):
            for place in self._places:
                if place.station == str(entry.station):
                    self._picture.add(Sample(when, place, None, 'no answer'))
        elif entry.kind is Kind.REPLY and command is not None and reply is not None \
                and not reply.sts and entry.latency is not None \
                and effect_of(command) is Effect.READS:
            if len(self._reads) < _MOST_READS:
                self._reads[describe(command)] = None
            for address in self._addresses:
                self._take(address, command, reply, when)

    def _take(self, address: str, command: Packet, reply: Packet, when: datetime) -> None:
        key = command.dst, command.cmd, command.data, address
        if key not in self._known and len(self._known) < _MOST_KNOWN:
            self._known[key] = next(filter(None, (
                row for plc_type in FAMILIES
                if (row := self._row(command.dst, address, plc_type))
                and _words(command, reply, row))), None)
        row = self._known.get(key)
        words = _words(command, reply, row) if row else b''
        if row is None or not words:
            return
        try:
            values = row.codec.decoder()(words)
        except FormatError:
            return
        self._found.add(address)
        station = str(row.station)
        told: Sequence[float | str] = [values] if isinstance(values, str) else values
        for number, value in enumerate(told):
            place = ValuePlace(station, str(row.place_of(number)), '')
            self._places.add(place)
            self._picture.add(Sample(when, place, value, ''))

    def _row(self, station: int, address: str, plc_type: PlcType) -> Mapping | None:
        """Return the row of an address in a family; None if the family does not have it."""
        key = station, address, plc_type
        if key not in self._rows:
            try:
                self._rows[key] = mapping_of(
                    address, {**_cells(station), 'PLC_Type': plc_type.value})
            except ConfigurationError:
                self._rows[key] = None
        return self._rows[key]

    @property
    def remarks(self) -> list[str]:
        """Return a remark for each address that no reply has."""
        reads = '; '.join(self._reads) or 'nothing'
        return [f'no reply has {address}; answered is: {reads}'
                for address in self._addresses if address not in self._found]

    def parts(self) -> Iterator[str]:
        """Yield the parts of the page."""
        yield '<h2>Values</h2>'
        if self._picture.rows:
            yield from self._picture.drawings('h3')
        for remark in self.remarks:
            yield f'<p class="is-odd">{text_of(remark)}</p>'


def _cells(station: int) -> dict[str, str]:
    return {'Command': Command.READ.value, 'Station': str(station)}


def _words(command: Packet, reply: Packet, row: Mapping) -> bytes:
    """Return the words of a row; empty if the reply does not have all of them."""
    words, extent = words_in_reply(command, reply, [row]), row.extent
    found = [words.get((extent.area, offset)) for offset in range(extent.first, extent.end)]
    return b'' if None in found else b''.join(filter(None, found))
