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
Find out the settings of a line by trying them.

  plc detect --port /dev/ttyUSB0 --stations 1-4
"""

from __future__ import annotations

import argparse
from contextlib import suppress
import sys

from abdf1_ros.cli.plc import init, overhear, presence
from abdf1_ros.cli.plc.detect import Found, found_settings, only_heard
from abdf1_ros.cli.plc.line import MODES, network_of, unusual_bits
from abdf1_ros.cli.plc.options import (
    add_line_options,
    add_stations_to_try,
    DEFAULT_STATION,
    DETECT_DEFAULTS,
)
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.terminal import colour, EXIT_FAILED, GREEN
from abdf1_ros.errors import LinkError, RemoteError
from abdf1_ros.paths import called

_BEHIND_GATEWAY = (
    'a gateway: each PLC behind it has a node number. If a scan with --via finds no node, scan '
    'without --via: the gateway may make each node a station of this line')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_line_options(parser, DETECT_DEFAULTS)
    add_stations_to_try(parser)


def run(options: argparse.Namespace) -> int:
    """Try settings; print the settings that work, and the next command."""
    network = network_of(options, timeout=DETECT_DEFAULTS.timeout)
    found = found_settings(options, network)
    if isinstance(found, overhear.ForeignMaster):
        return only_heard(
            network, found, 'Next: "plc init" writes net.csv and map.csv for Mode Listen')
    if found is None:
        return EXIT_FAILED
    there = found.presence
    print(f'{colour(str(found.settings), GREEN, sys.stdout)}: station {there.station} {there}')
    settings = found.settings
    with Session(found.settings.on(network)) as session, suppress(LinkError, RemoteError):
        if ways := presence.io_access(session, there):
            print(f'inputs and outputs: Access {" or ".join(ways)}')
    if there.is_of_gateway:
        print(_BEHIND_GATEWAY)
    parity = '' if network.parity == 'None' else f' --parity {network.parity}'
    bits = ''.join(f' --{column.lower().replace("_", "-")} {count}'
                   for column, count in unusual_bits(network).items())
    own = '' if settings.own is None else f' --own-station {settings.own}'
    print(f'next: {called("plc")} {_first_task(found)} --port {network.port} '
          f'--baud {settings.baud} --check {settings.check}{parity}{bits}{own}')
    print(f'net.csv:\n{init.net_csv(network, found, [there.station])}')
    return 0


def _first_task(found: Found) -> str:
    """Return the next command for the station found, without the options of the line."""
    there, mode = found.presence, found.settings.mode
    duplex = {MODES['full']: ' --peer', MODES['half']: ''}.get(mode, ' --radio')
    if there.is_of_gateway:
        return f'scan {init.nodes_of(there.station, mode)}{duplex}'
    is_default = mode == MODES['full'] and there.station == DEFAULT_STATION
    return (f'read {presence.examples_of(there).words}{duplex}'
            f'{"" if is_default else f" --station {there.station}"}{presence.type_to_say(there)}')
