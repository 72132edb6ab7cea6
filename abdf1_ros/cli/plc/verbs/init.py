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
Find port, settings and stations, and write net.csv and map.csv.

  plc init --into line1
  plc init --port /dev/ttyUSB0 --stations 1-4
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import shlex
import sys

from abdf1_ros.cli.overhearing import map_of, texts_of
from abdf1_ros.cli.plc import detect, files, init, overhear, presence
from abdf1_ros.cli.plc.detect import found_settings, only_heard
from abdf1_ros.cli.plc.inquiry import conclude
from abdf1_ros.cli.plc.line import MODES, network_of
from abdf1_ros.cli.plc.options import (
    add_folder,
    add_line_options,
    add_stations_to_try,
    DETECT_DEFAULTS,
)
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.terminal import colour, EXIT_FAILED, GREEN, Progress
from abdf1_ros.paths import called
from abdf1_ros.ports.listing import serial_ports
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import Network


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_line_options(parser, DETECT_DEFAULTS)
    add_folder(parser, 'net.csv and map.csv')
    add_stations_to_try(parser)


def run(options: argparse.Namespace) -> int:
    """Find the line and its PLCs, and write both files."""
    target = init.NewFiles(Path(options.into), 'net.csv', 'map.csv')
    if not options.port and not options.net:
        options.port = _only_port()
    network = network_of(options, timeout=DETECT_DEFAULTS.timeout)
    found = None if network.line_mode.only_listens else found_settings(options, network)
    master = found if isinstance(found, overhear.ForeignMaster) else None
    if master is not None or network.line_mode.only_listens:
        return _init_listening(network, master, target)
    if found is None or isinstance(found, overhear.ForeignMaster):
        return EXIT_FAILED
    print(f'{colour(str(found.settings), GREEN, sys.stdout)}')
    # Most full-duplex ports answer to every station. We avoid station 0 (see "check").
    others = options.stations if found.settings.mode != MODES['full'] else \
        [1] if found.presence.station == 0 else []
    there = _stations_there(found, found.settings.on(network), others)
    for seen in there:
        print(f'station {seen.station}: {seen}{presence.again(seen.asked)}')
    with Session(found.settings.on(network)) as session:
        listed = {seen.station: files.listed(session, seen.station, seen.identity)
                  for seen in there}
    target.write(*init.files_of(network, found, there, listed))
    net, map_file = (shlex.quote(str(path)) for path in target.paths)
    print(f'written: {", ".join(map(str, target.paths))}\n'
          'next: write the addresses that you need into map.csv, then\n'
          f'  {called("plc")} {_first_look(found, there)} --net {net}\n'
          f'  {called("check")} {net} {map_file}\n'
          f'  {called("node")} --ros-args -p net_file:={net} -p map_file:={map_file}')
    return 0


def _first_look(found: detect.Found, there: Sequence[presence.Presence]) -> str:
    """Return the command that shows values of a PLC; without a PLC, nodes behind a gateway."""
    plc = next((seen for seen in there if not seen.is_of_gateway), None)
    if plc is None:
        return f'scan {init.nodes_of(there[0].station, found.settings.mode)}'
    return (f'watch {presence.examples_of(plc).status} --station {plc.station}'
            f'{presence.type_to_say(plc)}')


def _init_listening(network: Network, master: overhear.ForeignMaster | None,
                    target: init.NewFiles) -> int:
    """Write net.csv and map.csv for Mode Listen, with the reads of another master."""
    if master is not None:
        check = network.error_code if master.check is None else master.check.value
        network = replace(overhear.silent(network), baud=master.baud, error_code=check)
        if not network.line_mode.only_listens:
            return only_heard(network, master, 'Mode Listen works with a device or socket://, not '
                                               'with rfc2217://, so no file was written')
        print(f'{master}: we send nothing')
    progress = Progress()
    progress.show(f'listening for {overhear.LISTENED_FOR_READS:.0f} s')
    reads = overhear.heard_reads(network, overhear.LISTENED_FOR_READS)
    progress.clear()
    if not reads:
        return only_heard(
            network, master, 'No read with its reply was heard, so no file was written')
    for text in texts_of(reads):
        print(text)
    target.write(init.listening_csv(network), map_of(reads))
    net, map_file = (shlex.quote(str(path)) for path in target.paths)
    print(f'written: {", ".join(map(str, target.paths))}\n'
          f'next: {called("check")} {net} {map_file}')
    return 0


def _stations_there(found: detect.Found, network: Network,
                    stations: Sequence[int]) -> list[presence.Presence]:
    """Return the stations that answer, at least the found station; print the tally."""
    is_full = found.settings.mode == MODES['full']  # the PLC answers to several numbers
    there = {} if is_full and stations else {found.presence.station: found.presence}
    asked = 1
    for seen in presence.scan(network, stations, ended=conclude) if stations else ():
        if seen.is_there:
            there[seen.station] = seen
        else:
            asked = seen.asked
    if asked > 1:
        print(presence.tally(len(there), len({*there, *stations}), asked))
    return [there[number] for number in sorted(there)] or [found.presence]


def _only_port() -> str:
    """Return the only port; ConfigurationError if there is none or more than one."""
    ports = serial_ports()
    if len(ports) == 1:
        print(f'port: {ports[0].device} {ports[0].adapter}'.rstrip())
        return ports[0].stable or ports[0].device
    listed = ', '.join(port.device for port in ports) or 'this machine has none'
    raise ConfigurationError([Problem('--port', f'name the port: {listed}')])
