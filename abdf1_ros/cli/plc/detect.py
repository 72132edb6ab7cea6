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

"""Find the settings of a line by trying them until a station answers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
import time

from abdf1_ros.cli.plc.line import free_station, MODES
from abdf1_ros.cli.plc.overhear import ForeignMaster, overhear
from abdf1_ros.cli.plc.presence import look_at, Presence, understands
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.terminal import EXIT_FAILED, Progress
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.diagnosis.causes import diagnose
from abdf1_ros.diagnosis.traces import Traces
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import Network

# Baud rates to try, the usual rates first. Very slow rates only if they are given.
BAUD_RATES = (19200, 9600, 38400, 57600, 115200, 4800, 2400, 1200)
CHECKS = tuple(check.value for check in (Checksum.CRC, Checksum.BCC))


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Settings to try on a line; ``own``: our own station, None if the line has it."""

    baud: int
    mode: str
    check: str
    own: int | None = None

    def on(self, line: Network) -> Network:
        """Return ``line`` with these settings."""
        return replace(line, baud=self.baud, mode=self.mode, error_code=self.check,
                       station=line.station if self.own is None else self.own)

    def __str__(self) -> str:
        return f'{self.baud} baud, {_WORDS[self.mode]}, {self.check}'


_WORDS = {'Peer': 'full duplex', 'Master': 'half duplex',
          'Radio': 'radio modem (replies come without ACK)'}

# Number of echoes that show a radio modem line, and the time (s) within which a full-duplex PLC
# sends ENQ for a missing ACK (M 7-25, 7-27).
_RADIO_ECHOES = 3
ENQ_TIME = 5.0

ROUNDS = 2
"""Number of attempts with the same settings: a lost frame does not prove absence."""


@dataclass(frozen=True, slots=True)
class Found:
    """Settings with which a PLC accepts commands, or a gateway if no PLC does."""

    settings: LineSettings
    presence: Presence


class Search:
    """
    Try settings on the port of ``network``, in half duplex with each of ``stations``.

    ``show`` gets a text about the settings being tried. ``echoes`` is True if our bytes came back:
    then there cannot be a full-duplex PLC. ``traces`` has what each setting has shown. With
    ``is_acknowledged`` a full-duplex port acknowledges commands, and no station replies.
    """

    def __init__(self, network: Network, stations: Sequence[int],
                 show: Callable[[str], None] = lambda text: None) -> None:
        self.echoes = False
        self.traces: dict[LineSettings, Traces] = {}
        self._network = replace(network, nak_retries=0, enq_retries=1,
                                cmd_timeout=max(500, network.timeout))
        self._stations = stations
        self._show = show
        self.is_acknowledged = False
        self._lacks_acks = False  # replies came, but no ACK

    def run(self, bauds: Sequence[int], modes: Sequence[str] = ('Peer', 'Master'),
            checks: Sequence[str] = CHECKS) -> Found | None:
        """Return the first settings that work, or None; raises OSError, PortLost."""
        for _, baud, mode in product(range(ROUNDS), bauds, modes):
            found = self._try(baud, mode, checks)
            if found is None and self.is_acknowledged and mode == modes[-1]:
                return None  # with another speed nothing can come
            if found is None:
                continue
            radio = replace(found.settings, mode='Radio')
            is_radio = mode == MODES['full'] and self._lacks_acks and self._is_radio(
                radio, found.presence.station)
            return replace(found, settings=radio) if is_radio else found
        return None

    def _try(self, baud: int, mode: str, checks: Sequence[str],
             own: int | None = None) -> Found | None:
        """Try one speed and duplex; in half duplex a second check only after an answer."""
        # Most full-duplex ports accept messages to any station. Most other ports are station 1 or
        # 0.
        stations = self._stations if mode != MODES['full'] else \
            sorted(self._stations[:2], key=lambda station: not station)
        for check in checks:
            if self.echoes and mode == MODES['full']:
                return None
            heard, gateway, other, acknowledged = [], None, None, []
            settings = LineSettings(baud, mode, check, own)
            for presence in self._look(settings, stations, check == checks[0]):
                if presence.is_of_gateway:
                    gateway = gateway or Found(settings, presence)
                elif presence.takes_commands:
                    return Found(settings, presence)
                elif presence.is_there:
                    heard.append(presence.station)
                elif presence.is_only_acknowledged:
                    acknowledged.append(presence.station)
                if own is None and (other := presence.other_number) is not None:
                    break
            if gateway:
                return gateway
            if other is not None:
                return self._try(baud, mode, [check], other)
            if len(acknowledged) == len(stations):
                self.is_acknowledged = True
                return None
            if mode == MODES['half'] and not heard:
                return None  # a poll is the same with both checks
            stations = heard or stations
        return None

    def _look(self, settings: LineSettings, stations: Sequence[int],
              is_first: bool) -> Iterator[Presence]:
        """Yield the presence of each station; ``takes_commands`` also needs a reply to an echo."""
        network = settings.on(self._network)
        if settings.mode == MODES['half']:  # a PLC does not answer to its own address
            network = replace(network, station=free_station(network.station, stations))
        # The session sends ENQ to a silent station that is not in ``absent``. Any full-duplex port
        # answers ENQ, whatever its check and its own station.
        asks = is_first and settings.mode == MODES['full']
        with Session(network, absent=stations[1:] if asks else stations) as session:
            for station in stations:
                self._show(f'trying {settings}, station {station}')
                presence = look_at(session, station)
                if session.echoes:
                    self.echoes = True
                    self.traces.clear()  # our own bytes that came back late
                    if settings.mode == MODES['full']:
                        return
                if presence.takes_commands and not understands(session, station):
                    presence = replace(presence, takes_commands=False)
                self._lacks_acks = not session.counters.acks_received
                yield presence
            has_news = settings not in self.traces or session.counters.chars_received
            if has_news and not self.echoes:
                heard = (number for number in stations if session.stations[number].last_heard)
                self.traces[settings] = session.traces(next(heard, stations[0]))

    def _is_radio(self, settings: LineSettings, station: int) -> bool:
        """Return True if replies come without ACK, NAK or ENQ, although we send no ACK."""
        self._show(f'trying {settings}, station {station}')
        with Session(settings.on(self._network)) as session:
            if not all(understands(session, station) for _ in range(_RADIO_ECHOES)):
                return False
            time.sleep(ENQ_TIME)
            seen = session.counters
            return not seen.acks_received + seen.naks_received + seen.enqs_received


def found_settings(options: argparse.Namespace,
                   network: Network) -> Found | ForeignMaster | None:
    """Return the settings that work, or another master; print traces if there is neither."""
    if options.duplex == 'slave':
        raise ConfigurationError([Problem(
            '--duplex', 'a slave cannot try settings; leave --duplex out, then we listen first')])
    progress = Progress()
    bauds: Sequence[int] = [network.baud] if options.baud or '://' in network.port \
        else BAUD_RATES
    modes = [MODES[options.duplex]] if options.duplex else [MODES['full'], MODES['half']]
    checks = [network.error_code] if options.check else CHECKS
    master = overhear(network, bauds, progress.show)
    if master is not None:
        progress.clear()
        return master
    search = Search(network, options.stations, progress.show)
    found = search.run(bauds, modes, checks)
    progress.clear()
    if search.echoes:
        complain(COMES_BACK)
    if found is None:
        if not search.is_acknowledged:
            complain(f'nothing answers with any of these settings, tried {ROUNDS} times')
        for text in [] if search.echoes else conclusion(search.traces):
            complain(text)
        kept = [] if search.is_acknowledged else [option for option, value in (
            ('--duplex', options.duplex), ('--baud', options.baud), ('--check', options.check))
            if value]
        if kept:
            complain(f'{" and ".join(kept)}: no other value was tried; leave the option out to '
                     'try all')
    return found


def conclusion(traces: Mapping[LineSettings, Traces]) -> Iterator[str]:
    """Yield the cause that the settings show together, and the first bytes if they are no DF1."""
    noisy = sum(seen.characters > 0 for seen in traces.values())
    found = {settings: diagnose(replace(
        seen, settings=len(traces), noisy=noisy,
        takes_other_check=_takes_other_check(traces, settings)))
        for settings, seen in traces.items()}
    settings, best = min(found.items(), key=lambda entry: entry[1].rank)
    yield str(best) if best.rule.is_of_all else f'{settings}: {best}'
    if best.traces.characters and not best.traces.is_df1:
        yield f'{settings}: first bytes {best.traces.first_text}'


def _takes_other_check(traces: Mapping[LineSettings, Traces],
                       settings: LineSettings) -> bool | None:
    """Return False if commands were refused with CRC and with BCC alike."""
    other = traces.get(replace(settings, check=traces[settings].other_check))
    is_refused = other is not None and not other.acks and (
        other.naks + other.polls_answered > 0)
    return False if is_refused else traces[settings].takes_other_check


def only_heard(network: Network, master: ForeignMaster | None, what: str) -> int:
    """Print ``what`` came of listening, and the ways to ask beside a master; return the status."""
    if master is None:
        complain(what)
        return EXIT_FAILED
    complain(f'{master}: nothing was sent. {what}')
    complain(f'"sniff --port {network.port} --baud {master.baud}" shows what the master reads. '
             '"plc read N7:0 --slave --own-station N" asks through the master, if it polls a '
             'number N that no PLC has')
    return EXIT_FAILED
