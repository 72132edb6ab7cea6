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

"""The link of each mode: which procedure of the link layer runs, with which settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from abdf1_ros.counters import Counters
from abdf1_ros.df1.link import Link, LinkSettings
from abdf1_ros.df1.machine import Background, Machine, Procedure
from abdf1_ros.df1.master import HalfDuplexMaster
from abdf1_ros.df1.master_line import MasterSettings
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer, PeerSettings
from abdf1_ros.df1.polling import PollingSettings, StandardPollingMaster
from abdf1_ros.df1.radio import RadioNode, RadioSettings
from abdf1_ros.df1.slave import SlaveSettings
from abdf1_ros.df1.slave_link import SlaveLink
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.messages import Event


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """
    Settings that are not in the net CSV; times in seconds.

    ``stale_after`` counts periods. ``processor_period`` is the time between two questions for the
    diagnostic status of a station, 0 for never. In full duplex at most ``max_outstanding``
    commands wait for their replies. ``polling`` is for standard polling, None for one list of all
    mapped stations. ``first_tns`` is the first transaction number. It should be random: a station
    could take the first command of a restarted driver for a duplicate. The others are explained
    with the settings of masters and slaves in ``df1``.
    """

    default_period: float = 0.1
    stale_after: float = 3.0
    write_timeout: float = 2.0
    read_only: bool = False
    nak_on_command_timeout: bool = True
    max_outstanding: int = 1
    accept_slave_messages: bool = True
    polling: PollingSettings | None = None
    eot_suppression: bool = False
    duplicate_detection: bool = True
    poll_timeout: float = 60.0
    processor_period: float = 0.0
    first_tns: int = 0


def make_machine(line: LinkSettings, run: Callable[[], Procedure], counters: Counters,
                 background: Background | None = None) -> Machine:
    """Return the machine for a line, with ``run`` as its procedure."""
    return Machine(
        lambda machine: run(), checksum=line.checksum, duplex=line.duplex, timing=line.timing,
        counters=counters, forget_on_send=line.mode == 'Master', background=background)


def make_link(line: LinkSettings, settings: DriverSettings, machine: Machine,
              stations: ActiveStationList, serve: Callable[[Packet], Packet],
              report: Callable[[Event], None]) -> Link:
    """Return the link for the Mode (and Polling) of a line."""
    if line.mode == 'Peer':
        peer_settings = PeerSettings(
            line.checksum, line.nak_retries, line.enq_retries, line.timeout, line.cmd_timeout,
            settings.max_outstanding, settings.duplicate_detection, line.station)
        return FullDuplexPeer(machine, peer_settings, stations, serve, report)
    if line.mode == 'Radio':
        radio_settings = RadioSettings(
            line.station, line.checksum, line.nak_retries, line.cmd_timeout, line.store_forward,
            avoids_collisions=line.avoids_collisions)
        return RadioNode(machine, radio_settings, stations, serve, report)
    if line.mode == 'Slave':
        slave_settings = SlaveSettings(
            line.station, line.checksum, line.nak_retries,
            eot_suppression=settings.eot_suppression,
            duplicate_detection=settings.duplicate_detection)
        return SlaveLink(machine, slave_settings, stations, serve, cmd_timeout=line.cmd_timeout,
                         poll_timeout=settings.poll_timeout, report=report)
    master_settings = MasterSettings(
        line.station, line.checksum, line.nak_retries, line.enq_retries, line.timeout,
        line.cmd_timeout, settings.nak_on_command_timeout,
        accept_slave_messages=settings.accept_slave_messages)
    if line.polling == 'Standard':
        return StandardPollingMaster(
            machine, master_settings, _polling(settings, stations), stations, report, serve)
    return HalfDuplexMaster(machine, master_settings, stations, report, serve)


def _polling(settings: DriverSettings, stations: ActiveStationList) -> PollingSettings:
    """Return the poll lists with every mapped station: one without a poll could not reply."""
    polling = settings.polling or PollingSettings(())
    listed = {*polling.priority, *polling.normal}
    mapped = dict.fromkeys(stations.via(station.number) for station in stations)
    return replace(polling, normal=(
        *polling.normal, *(number for number in mapped if number not in listed)))
