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

"""Ask which stations answer: diagnostic status, echo, and a scan of many stations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
import os
import sys
import time

from abdf1_ros.cli.plc.line import free_station
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.terminal import colour, GREEN, RED, YELLOW
from abdf1_ros.counters import Counters
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import is_local_status
from abdf1_ros.df1.stations import MOST_IN_VAIN
from abdf1_ros.diagnosis.traces import Traces
from abdf1_ros.driver.evidence import Evidence, evidence_of
from abdf1_ros.errors import (
    Abdf1Error,
    CommandTimeout,
    FormatError,
    LinkError,
    RemoteError,
    StationInactive,
)
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_address
from abdf1_ros.pccc.family import Examples
from abdf1_ros.pccc.file_search import is_there
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.plc2.commands import BasicRead, READ
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.steps import echo, identify
from abdf1_ros.settings.network import Network
from abdf1_ros.text import counted

_SLOTS_TRIED = 8

# Most questions to a silent station while the line loses frames; on a good line 2.
_MOST_ROUNDS = 4

_ECHO = bytes(range(1, 17))


@dataclass(frozen=True, slots=True)
class Presence:
    """
    The identity of a station, and the seconds until its reply.

    - ``error``: the reason if there is no ``identity``.
    - ``is_there``: True if the station has sent anything.
    - ``takes_commands``: True if the station understands our frames.
    - ``asked``: number of questions to the station.
    - ``evidence``: what the line has shown of the station.
    """

    station: int
    seconds: float
    identity: Identity | None
    error: Abdf1Error | None
    is_there: bool
    takes_commands: bool
    asked: int = 1
    evidence: Evidence | None = None

    @property
    def is_settled(self) -> bool:
        """Return True if a reply came, so that another question brings nothing new."""
        return not isinstance(self.error, LinkError)

    @property
    def is_only_acknowledged(self) -> bool:
        """Return True if an ACK came that is not the station's own, and no reply."""
        return self.evidence is not None and self.evidence.is_only_acknowledged

    @property
    def other_number(self) -> int | None:
        """Return the number to which the reply came in place of ours, None if it did not."""
        return None if self.evidence is None or self.is_settled else self.evidence.other_number

    @property
    def is_of_gateway(self) -> bool:
        """Return True if a gateway replied: for itself, or because it cannot reach the station."""
        if self.identity is not None:
            return self.identity.has_no_processor
        return isinstance(self.error, RemoteError) and is_local_status(self.error.sts)

    def __str__(self) -> str:
        """Return one line of text."""
        if self.is_of_gateway and self.identity is None:
            return f'not reached, a gateway answers for it: {self.error}'
        return str(self.identity or f'answers, but does not identify itself: {self.error}')


def look_at(session: Session, station: int) -> Presence:
    """Ask a station for its identity; raises PortLost."""
    session.settle()
    started = time.monotonic()
    identity, error = session.attempt(station, identify())
    seconds = time.monotonic() - started
    if identity is not None and _may_be_of_gateway(session, station, identity):
        error = _refusal_of_gateway(session, station)
        if error is None and identity.has_no_processor:
            error = FormatError(f'the gateway answers for this station, as {identity}')
        identity = identity if error is None else None
    evidence = evidence_of(session.network.line_mode, session.stations, station)
    # A gateway answers for a station out of its reach (M 8-2).
    is_reached = not (isinstance(error, RemoteError) and is_local_status(error.sts))
    is_silent = isinstance(error, StationInactive) or not evidence.has_own_ack and isinstance(
        error, LinkError if session.network.line_mode.is_polled else CommandTimeout)
    takes_commands = is_reached and not is_silent
    is_there = takes_commands or (
        is_reached and session.stations[station].last_heard is not None)
    return Presence(station, seconds, identity, error, is_there, takes_commands, evidence=evidence)


def _may_be_of_gateway(session: Session, station: int, identity: Identity) -> bool:
    """Return True if a gateway may have answered for another station."""
    if session.via is None:
        return identity.has_no_processor and session.network.duplex is not Duplex.HALF
    return session.via != station


def _refusal_of_gateway(session: Session, station: int) -> Abdf1Error | None:
    """
    Return why a read does not reach a station; None if the station itself replies.

    A gateway may answer diagnostic commands itself, for every number (a switch of the 1770-KF2).
    All families know the read command of a PLC-2.
    """
    _, error = session.attempt(station, _basic_read())
    is_of_plc = isinstance(error, RemoteError) and not is_local_status(error.sts)
    return None if is_of_plc else error


def _basic_read() -> Steps[None]:
    check_status((yield READ, BasicRead(0, 2).encode()))


def scan(network: Network, stations: Sequence[int], via: int | None = None,
         show: Callable[[str], None] = lambda text: None,
         ended: Callable[[Session], None] = lambda session: None, *,
         asks_all: bool = True,
         is_beside_master: Callable[[Session], bool] = lambda session: False,
         ) -> Iterator[Presence]:
    """
    Yield the presence of every station, ``via`` a gateway; raises OSError and PortLost.

    Beside another master no station is asked.

    In full duplex the scan ends, unless it ``asks_all``, after a number of stations in a row of
    which only an ACK came.

    Silent stations are asked again at the end: a lost frame does not prove absence. ``show`` gets
    a text about the present station. ``ended`` gets the session at the end. Its ``silent`` is a
    station that answers polls only; or a silent station, if there is no other or if the line loses
    frames. On a line with station numbers we use a free number.
    """
    if not network.line_mode.has_one_plc and not network.line_mode.is_polled:
        network = replace(network, station=free_station(network.station, {*stations, via}))
    with Session(network, absent=stations, via=via) as session:
        if is_beside_master(session):
            return
        left: Sequence[int] = stations
        counters, has_lost, is_found, in_vain = session.counters, False, False, 0
        for asked in range(1, _MOST_ROUNDS + 1):
            damaged, loses = counters.damaged_frames, False
            silent = []
            for count, station in enumerate(left, 1):
                show(f'station {count} of {len(left)}{again(asked)}')
                heard = counters.chars_received
                presence = replace(look_at(session, station), asked=asked)
                # Each command without a reply may cost an SLC with passthru one of its 30 buffers.
                is_enough = presence.is_only_acknowledged and counters.damaged_frames == damaged
                in_vain = in_vain + 1 if is_enough and network.line_mode.has_one_plc else 0
                if presence.is_settled or is_enough:
                    is_found |= presence.is_there
                    yield presence
                    if in_vain >= MOST_IN_VAIN and not asks_all:
                        return
                    continue
                silent.append(presence)
                loses |= counters.chars_received > heard and not session.echoes
            loses |= counters.damaged_frames > damaged
            has_lost |= loses
            loses |= len(silent) < len(left)
            left = [presence.station for presence in silent]
            if not left or asked == _MOST_ROUNDS or asked > 1 and not loses:
                break
        yield from silent
        there = [presence.station for presence in silent if presence.is_there]
        if there or has_lost or not is_found:
            session.silent = next(iter((*there, *(presence.station for presence in silent))), None)
    ended(session)


def again(asked: int) -> str:
    """Return the number of questions to a station as text; empty for one."""
    return f', asked {asked} times' if asked > 1 else ''


def tally(found: int, count: int, asked: int, acknowledged: int = 0) -> str:
    """
    Return the number of stations found as text, with the questions to the silent stations.

    ``acknowledged``: number of stations of which only an ACK came that is not their own.
    """
    rest = f'; silent stations were asked {asked} times' if found < count and asked > 1 else ''
    if acknowledged:
        rest += (f'; of {acknowledged} only an ACK came, which a gateway, an SLC with passthru or '
                 'a PLC with another number may have sent')
    return f'{found} of {count} stations answer{rest}'


def understands(session: Session, station: int) -> bool:
    """
    Return True if a station returns random data, or refuses to; raises PortLost.

    Only such a reply proves a station. An echo of the line, or a device that acknowledges every
    message, does not give it.
    """
    _, error = session.attempt(station, echo(os.urandom(len(_ECHO))))
    return error is None or isinstance(error, RemoteError)


def io_access(session: Session, there: Presence) -> list[str]:
    """
    Return the Access values that read inputs of an SLC or MicroLogix.

    Raises LinkError, and RemoteError of a node on the way.
    """
    kind = _family(there)
    ways = () if kind is None else FAMILIES[kind].accesses
    if kind is None or Access.FLAT not in ways:
        return []
    return [way.value for way in ways if any(
        session.ask(there.station, is_there(
            parse_address(f'I:{element}', kind, way), dialect_of(kind, way)))
        for element in range(_SLOTS_TRIED if way is Access.SLOT else 1))]


def ping(session: Session, station: int) -> float:
    """Return the seconds that an echo takes; raises LinkError, RemoteError or FormatError."""
    session.settle()
    started = time.monotonic()
    session.ask(station, echo(_ECHO))
    return time.monotonic() - started


def common_identity(session: Session, *stations: int) -> Identity | None:
    """Return the common identity of stations; None if they differ. Raises PortLost."""
    first, *others = (look_at(session, station).identity for station in stations)
    return first if all(other == first for other in others) else None


def type_to_say(there: Presence) -> str:
    """Return the option that commands need for a PLC of an unknown family: SLC as a guess."""
    return '' if _family(there) else f' --plc-type {PlcType.SLC.value}'


def examples_of(there: Presence) -> Examples:
    """Return addresses to begin with; a PLC of an unknown family counts as an SLC."""
    return FAMILIES[_family(there) or PlcType.SLC].examples


def _family(there: Presence) -> PlcType | None:
    return there.identity.plc_type if there.identity else None


def describe(presence: Presence) -> list[str]:
    """Return all facts of a station with an identity, line by line."""
    identity = presence.identity
    assert identity is not None
    is_running = identity.mode is not None and identity.mode.is_running
    lines = [('mode', identity.mode_text, GREEN if is_running else YELLOW),
             ('faults', ', '.join(identity.faults) or 'none', RED if identity.faults else GREEN),
             ('remarks', ', '.join(identity.remarks), YELLOW),
             ('own name', identity.name, None),
             ('program ID', '' if identity.program_id is None
              else f'0x{identity.program_id:04X}', None),
             ('memory', identity.memory, None),
             ('reply', f'after {presence.seconds * 1000:.0f} ms', None)]
    return [f'station {presence.station}: {identity}', *(
        f'  {name:10} {colour(text, code, sys.stdout) if code else text}'
        for name, text, code in lines if text)]


def facts(network: Network, counters: Counters, stray: str, traces: Traces) -> str:
    """Return settings, numbers of frames, and the first bytes if no DF1 came, as text."""
    first = '' if traces.is_df1 or not traces.first else f'; first bytes {traces.first_text}'
    return (f'{network.baud} baud, parity {network.parity}, {network.duplex.value}, '
            f'{network.error_code}; {traffic(counters, stray)}{first}')


def traffic(counters: Counters, stray: str = '') -> str:
    """Return the numbers of frames sent and received, for a user who gets no answer."""
    again = counters.nak_retries + counters.enq_retries
    came = [counted(counters.chars_received, 'character'),
            counted(counters.damaged_frames, 'damaged frame'),
            f'{counters.naks_received} NAK'] + [stray] * bool(stray)
    return (f'sent: {counted(counters.commands_sent, "command")}, '
            f'{counted(counters.polls_sent, "poll")}, {counted(again, "repetition")} included; '
            f'received: {", ".join(came)}')


def type_hint(session: Session, station: int, plc_type: str | None) -> str:
    """Return a remark if a PLC is not of the given type; empty if that is unknown."""
    identity, _ = session.attempt(station, identify()) if plc_type else (None, None)
    if identity is None or identity.plc_type is None or identity.plc_type.value == plc_type:
        return ''
    return f'station {station} is {identity}; --plc-type says {plc_type}'
