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

"""Runs of the conformance cases on a line in virtual time."""

from collections.abc import Callable
from typing import Any, Protocol

from abdf1_ros.conform.case import CaseResult, Permission, run_cases, Target, Verdict
from abdf1_ros.conform.cases import CASES
from abdf1_ros.conform.codec import BlockCheck
from abdf1_ros.conform.ends import (
    MasterEnd,
    PeerEnd,
    RadioEnd,
    RadioServerEnd,
    ServerEnd,
    SlaveEnd,
    Words,
)
from abdf1_ros.conform.wire import RawLine, Wire
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import Machine, Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.radio import RadioNode
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
from abdf1_ros.df1.stations import ActiveStationList
from support.driver_bench import simulated_plc


class TimedLine(RawLine, Protocol):
    """A line with a clock of its own."""

    def clock(self) -> float:
        """Return the time (s)."""


def results_of(line: TimedLine, target: Target, check: str, family: str = 'SLC',
               only: str = '', station: int = 1, words: Words | None = None) -> list[CaseResult]:
    """Return how the cases of ``target`` end."""
    wire = Wire(line, BlockCheck(check), line.clock, is_half_duplex=target.is_half_duplex,
                is_radio=target.is_radio, answer_time=1.0,
                passes_commands=target in (Target.SLAVE, Target.PEER, Target.RADIO))
    words = words or Words(7, 2, 3, family)
    plc = simulated_plc(1, 'PLC5', line.clock, ('N7:0', 20), checksum=check)

    def serve(command: bytes) -> bytes:
        return plc.serve(Packet.decode(command)).encode()

    ends: dict[Target, Callable[[], Any]] = {
        Target.SLAVE: lambda: MasterEnd(wire, station, 5, 0x2000, words),
        Target.PEER: lambda: PeerEnd(wire, station, 5, 0x2000, words),
        Target.MASTER: lambda: SlaveEnd(wire, station, serve),
        Target.CLIENT: lambda: ServerEnd(wire, serve),
        Target.RADIO: lambda: RadioEnd(wire, station, 5, 0x2000, words),
        Target.RADIO_CLIENT: lambda: RadioServerEnd(wire, station, serve)}
    cases = [case for case in CASES if target in case.targets and only in ('', case.name)]
    return list(run_cases(cases, wire, ends[target](), frozenset(Permission)))


def plc_of(target: Target, check: str, family: str = 'SLC', nak_retries: int = 3) -> Machine:
    """Return a simulated PLC, station 1, that keeps the rules."""
    settings = LinkSettings(
        station=1 if target.is_half_duplex or target.is_radio else None,
        checksum=Checksum[check], nak_retries=nak_retries, store_forward={1, 5, 254, 255})
    plc = simulated_plc(1, family, lambda: 0.0, ('N7:0', 20), checksum=check)
    if target.is_half_duplex:
        plc.slave = HalfDuplexSlave(settings, plc.serve, plc.counters)
        return Machine(multidrop([plc]), checksum=settings.checksum)
    plc.be_full_duplex()

    def run(machine: Machine) -> Procedure:
        kind = RadioNode if target.is_radio else FullDuplexPeer
        return kind(machine, settings, ActiveStationList(), plc.serve).run(plc)

    return Machine(run, checksum=settings.checksum, duplex=Duplex.FULL, counters=plc.counters)


def failures(results: list[CaseResult]) -> list[str]:
    """Return the cases that failed, with the reason."""
    return [f'{result.case.name}: expected {result.expected}, got {result.got}'
            for result in results if result.verdict is Verdict.FAIL]
