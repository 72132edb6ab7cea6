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

"""Faults of a line: an echo, our number twice, stations that take no commands, wrong PLCs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.odd import DAMAGED
from abdf1_ros.df1.stations import Station
from abdf1_ros.diagnosis.causes import diagnose, Diagnosis
from abdf1_ros.diagnosis.traces import Traces
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.evidence import evidence_of
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.settings.mapping import Mapping

# Another node with our number is reported until this many seconds after its last packet.
_SAME_NUMBER_TOLD = 60.0

# Commands, and messages that came, after which a missing byte means something: by then the low
# byte of TNS has had each value.
_ENOUGH = 256
_ENOUGH_DAMAGED = 3

SWALLOWED = str(diagnose(Traces(swallowed=b'\x11\x13')))

# With a second user the foreign replies are at least this number, and this share of all replies.
_ENOUGH_FOREIGN = 20
_FOREIGN_SHARE = 0.1

SHARED_BY_SPLITTER = (
    'many replies come that are not for us: does an HMI or a laptop share the port of the PLC by '
    'a splitter? Take it off, it may use Share')

# A station that takes no commands counts as silent after this time (s) without a sign of life.
_HEARD_LATELY = 10.0


class _Came(NamedTuple):
    """
    Commands that have gone out; good and damaged messages, bytes 11 and 13 that have come.

    ``foreign`` are replies that no command of ours had, and that are not late ones either.
    """

    commands: int
    messages: int
    damaged: int
    flow_controls: int
    replies: int
    foreign: int


def _came(driver: Driver) -> _Came:
    counters = driver.counters
    replies = counters.replies_received
    return _Came(counters.commands_sent, counters.messages_received, counters.damaged_frames,
                 driver.machine.receiver.flow_controls, replies,
                 replies - driver.tasks.transactions - counters.stale_messages)


class LineView:
    """
    The faults on the line of a driver, for statuses and watches.

    ``link`` and ``opener`` are None until the driver is on the line.
    """

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self.link: LinkThread | None = None
        self.opener: PortOpener | None = None
        self._rows_by_kind = _rows_by_kind(driver.mappings)
        self._before = _came(driver)

    def port_opened(self) -> None:
        """Begin anew: another connection may pass other bytes."""
        self._before = _came(self.driver)

    def attach(self, link: LinkThread, opener: PortOpener) -> None:
        """Set the thread whose port is reported, and the opener of this port."""
        self.link, self.opener = link, opener

    @property
    def why_closed(self) -> str:
        """Return why the port is not open; empty if it is."""
        if self.link is None:
            return 'not started yet'
        state = self.link.state
        return '' if state.is_open else state.text

    def fault(self, now: float) -> str:
        """Return the fault of the line: our number twice, or an echo; empty if there is none."""
        driver = self.driver
        told = driver.link.status().same_number
        if told is not None and now - told < _SAME_NUMBER_TOLD:
            return (f'another node on the air has our number, {driver.network.station}: its '
                    'replies and ours cannot be distinguished; give each node its own Station')
        # By radio an echo is normal: a node that passes packets on returns ours.
        duplex = driver.network.duplex
        nobody_answers = not any(station.active for station in driver.stations)
        does_harm = driver.machine.echoes and duplex is not Duplex.RADIO and (
            duplex is Duplex.FULL or nobody_answers)
        return COMES_BACK if does_harm else ''

    def deaf_stations(self, now: float) -> list[int]:
        """Return the stations of a master that answer polls, but no commands."""
        return [station.number for station in self.driver.stations if self.is_deaf(station, now)]

    def is_deaf(self, station: Station, now: float) -> bool:
        return self._comes_and_goes(station, now) and not self.is_garbled(station, now)

    def garbled_stations(self, now: float) -> list[int]:
        """Return the stations whose replies come, but none of them arrives whole."""
        return [station.number for station in self.driver.stations
                if self.is_garbled(station, now)]

    def is_garbled(self, station: Station, now: float) -> bool:
        return station.unanswered_by in DAMAGED and (
            takes_in_silence(station) or self._comes_and_goes(station, now))

    def _comes_and_goes(self, station: Station, now: float) -> bool:
        return (station.takes_no_commands and station.last_heard is not None
                and now - station.last_heard < _HEARD_LATELY
                and self.driver.network.line_mode.is_master)

    @property
    def is_refused(self) -> bool:
        """Return True if the only PLC of a full-duplex line has refused all that we have sent."""
        driver = self.driver
        return (driver.network.line_mode.has_one_plc and driver.counters.naks_received > 0
                and not driver.counters.acks_received)

    def evidence(self) -> list[str]:
        """Return what the line has shown of stations whose replies do not come, each text once."""
        found = map(self.evidence_of, self.driver.stations)
        came = _Came(*(now - before for now, before in zip(
            _came(self.driver), self._before, strict=True)))
        return [*dict.fromkeys(filter(None, (*found, _swallowed(came), self._foreign(came))))]

    def _foreign(self, came: _Came) -> str:
        """Return a text if the port of a full-duplex PLC seems to have a second user."""
        stations = self.driver.stations
        is_shown = self.driver.network.line_mode.has_one_plc and came.foreign >= max(
            _ENOUGH_FOREIGN, _FOREIGN_SHARE * came.replies) and all(
                stations.other_number(station.number) is None for station in stations)
        return SHARED_BY_SPLITTER if is_shown else ''

    def evidence_of(self, station: Station) -> str:
        """Return cause and next step of replies that do not come whole; empty if they do."""
        stations, number = self.driver.stations, station.number
        if not takes_in_silence(station) and not station.takes_no_commands \
                and stations.other_number(number) is None:
            return ''
        evidence = evidence_of(self.driver.network.line_mode, stations, number)
        is_shown = (evidence.fault is not None or evidence.is_only_acknowledged
                    or evidence.other_number is not None and evidence.gateway is None)
        return str(diagnose(self.traces(station))) if is_shown else ''

    def diagnosis(self, now: float) -> Diagnosis | None:
        """
        Return cause and next step of the stations that do not reply, None if all reply.

        Of several causes it is the one that says most.
        """
        if self.why_closed or self.driver.network.line_mode.only_listens:
            return None
        found = [diagnose(self.traces(station)) for station in self.driver.stations
                 if not station.active or takes_in_silence(station)
                 or self._comes_and_goes(station, now) or self.evidence_of(station)]
        return min(found, key=lambda each: each.rank, default=None)

    def traces(self, station: Station) -> Traces:
        """Return what the line has shown of a station that does not reply."""
        driver, counters = self.driver, self.driver.counters
        network, stations = driver.network, driver.stations
        evidence = evidence_of(network.line_mode, stations, station.number)
        other = next((other.number for other in stations
                      if other.replies and other.active and other is not station), None)
        is_new = not any(known.last_heard for known in stations)
        return Traces(
            network.line_mode, network.checksum, network.station, station.number, evidence.gateway,
            characters=counters.chars_received if is_new and not driver.machine.echoes else 0,
            polls=counters.polls_sent, polls_answered=int(station.takes_no_commands),
            acks=int(takes_in_silence(station)),
            naks=counters.naks_received if is_new or self.is_refused else 0,
            echoes=driver.machine.echoes, polled=counters.polls_received > 0,
            other_number=evidence.other_number, is_acknowledged=evidence.is_only_acknowledged,
            is_left_alone=evidence.is_left_alone, is_garbled=evidence.fault is not None,
            was_heard=station.last_heard is not None, neighbour=other,
            neighbour_answers=None if other is None else True)

    def wrong_types(self) -> list[str]:
        """Return a text for each PLC whose family or processor differs from the map."""
        found = (self.wrong_type(station.number) for station in self.driver.stations)
        return [text for text in found if text is not None]

    def wrong_type(self, station: int) -> str | None:
        identity = self.driver.checks.known(station).identity
        return wrong_type(station, identity, self._rows_by_kind[station].values())


def wrong_type(station: int, identity: Identity | None, rows: Iterable[Mapping]) -> str | None:
    """
    Return a text if PLC_Type or Processor of a row does not fit the PLC, otherwise None.

    A row of type PLC2 fits any PLC, because all families know the commands of the PLC-2.
    """
    if identity is None or identity.plc_type is None:
        return None
    for row in rows:
        if row.plc_type != identity.plc_type and not FAMILIES[row.plc_type].is_spoken_by_all:
            said = row.plc_type.value
        elif row.processor not in (identity.processor, None) and identity.processor is not None:
            said = f'{row.processor.value} in the column Processor'
        else:
            continue
        article = 'an' if identity.model.startswith('SLC') else 'a'
        return (f'station {station} is {article} {identity.model}, '
                f'{Path(row.place.file).name}:{row.place.line} says {said}')
    return None


def _rows_by_kind(mappings: Iterable[Mapping]) -> dict[int, dict[object, Mapping]]:
    """Return the first row of each PLC type and processor at each station."""
    rows: defaultdict[int, dict[object, Mapping]] = defaultdict(dict)
    for mapping in mappings:
        if not mapping.serves:
            rows[mapping.station].setdefault((mapping.plc_type, mapping.processor), mapping)
    return rows


def _swallowed(came: _Came) -> str:
    """Return a text if all that has come looks as if bytes 11 and 13 were taken out of it."""
    is_shown = not came.flow_controls and came.damaged >= _ENOUGH_DAMAGED and min(
        came.commands, came.damaged + came.messages) >= _ENOUGH
    return SWALLOWED if is_shown else ''


def takes_in_silence(station: Station) -> bool:
    """Return True if a station takes commands, but replies too late or not at all."""
    return station.active and (not station.replies_in_time or station.has_no_replies)


def deaf_text(station: int) -> str:
    """Return the text for a station that answers polls, but no commands."""
    return diagnose(Traces(station=station, polls_answered=1)).cause
