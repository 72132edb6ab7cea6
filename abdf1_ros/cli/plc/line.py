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

"""The line that the options of ``plc`` describe."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from dataclasses import replace

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import FIELDS, load_network, make_network, Network

# For a user who waits, the default Timeout of a net CSV (1000 ms) is long.
DEFAULTS = Network(timeout=300)

# The first number to try for our own station. Most PLCs have smaller numbers, and by default we
# ask station 1.
_FIRST_SPARE = 10

MODES = {Duplex.HALF.name.lower(): 'Master', Duplex.FULL.name.lower(): 'Peer',
         Duplex.RADIO.name.lower(): 'Radio', 'slave': 'Slave'}

# Options, each for a column of the net CSV.
_COLUMNS = {'port': 'com_port', 'baud': 'baud', 'check': 'error_code', 'parity': 'parity',
            'data_bits': 'data_bits', 'stop_bits': 'stop_bits', 'timeout': 'timeout',
            'own_station': 'station'}


def unusual_bits(network: Network) -> dict[str, int]:
    """Return data bits and stop bits of a line by their columns, if they are not 8 and 1."""
    return {FIELDS[name].column: value for name in ('data_bits', 'stop_bits')
            if (value := getattr(network, name)) != getattr(DEFAULTS, name)}


def free_station(own: int, taken: Collection[int | None]) -> int:
    """Return a free address for us on a half-duplex line: ``own`` if possible."""
    candidates = (own, *range(_FIRST_SPARE, MAX_STATION))
    return next((number for number in candidates if number not in taken), own)


def apart_from_target(network: Network, options: argparse.Namespace,
                      others: Collection[int] = ()) -> Network:
    """
    Return a line on which we have another address than the station that the options name.

    If we need a new address, no gateway and no station of ``others`` has that address.
    Raises ConfigurationError if a user gave us the address of that station.
    """
    if options.station != network.station:
        return network
    if options.net or options.own_station is not None or network.line_mode.is_polled:
        raise ConfigurationError([Problem('--own-station', (
            f'{network.station} is our own Station, so no PLC can answer as {options.station}; '
            'give us a station number that no PLC of the line has'))])
    taken = {options.station, getattr(options, 'via', None), *others}
    return replace(network, station=free_station(network.station, taken))


def network_of(options: argparse.Namespace, duplex: str | None = None,
               needs_port: bool = True, timeout: str | None = None) -> Network:
    """
    Return the line of the options; raises ConfigurationError with every fault.

    ``duplex``: used if the command has no duplex option; ``timeout``: if the user gave none.
    """
    base = load_network(options.net) if options.net else DEFAULTS
    given = {column: (str(value), f'--{option.replace("_", "-")}')
             for option, column in _COLUMNS.items()
             if (value := getattr(options, option, None)) is not None}
    is_told = 'timeout' in given
    if timeout is not None:
        given.setdefault('timeout', (timeout, '--timeout'))
    network = make_network(given, base)
    if network.timeout == 0:
        raise ConfigurationError([Problem('--timeout', '0 ms leaves no time for an answer')])
    if needs_port and not options.net and not options.port:
        raise ConfigurationError([Problem(
            '--port', 'name the port, such as --port /dev/ttyUSB0, or a net CSV with --net')])
    network = replace(network, mode=MODES.get(duplex or options.duplex, network.mode),
                      polling=DEFAULTS.polling)
    via = getattr(options, 'via', None)
    if via is not None and network.line_mode.has_one_plc:
        raise ConfigurationError([Problem(
            '--via', 'in full duplex a gateway has no address: --station is the node behind it')])
    if via == network.station:
        raise ConfigurationError([Problem(
            '--via', f'{via} is our own Station, not a gateway; --own-station N changes ours')])
    # By radio there is no ACK, so --timeout limits the wait for the reply.
    if network.duplex is Duplex.RADIO and is_told:
        return replace(network, cmd_timeout=network.timeout)
    return network
