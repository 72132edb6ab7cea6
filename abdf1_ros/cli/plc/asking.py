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

"""The common part of the ``plc`` verbs that ask one station."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as MappingType
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
import sys

from abdf1_ros.cli.plc import data, presence
from abdf1_ros.cli.plc.inquiry import conclude, is_beside_master
from abdf1_ros.cli.plc.line import apart_from_target, MODES, network_of
from abdf1_ros.cli.plc.options import DEFAULT_STATION
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.plc.targets import routes_of, Targets
from abdf1_ros.cli.terminal import drop_output, EXIT_FAILED
from abdf1_ros.errors import Abdf1Error, LinkError, PortLost, RemoteError
from abdf1_ros.open_line import kind_of
from abdf1_ros.pccc import steps
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import is_address_fault
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network


def ask(options: argparse.Namespace, work: Callable[[argparse.Namespace, Session], int],
        targets: Targets | None = None, writes: bool = False, record: str | None = None) -> int:
    """
    Open the line and carry out ``work`` with one station; warn if ``via`` may not be a gateway.

    - ``targets``: the rows and addresses that ``work`` reads or writes; a row of a map names its
      station.
    - ``writes``: if True, the user has to name the station on a line with several stations, and
      nothing is sent beside another master.
    - ``record``: a file for all bytes of the line.
    """
    network = _line(options, targets, writes)
    routes = targets.routes if targets else None
    with Session(network, via=options.via, record=record, routes=routes) as session:
        if writes and is_beside_master(session):
            return EXIT_FAILED
        if options.via is not None and (
                who := presence.common_identity(session, options.station, options.via)):
            complain(f'stations {options.station} and {options.via} are both "{who}": if '
                     f'{options.via} is not a gateway, it answers itself')
        try:
            status = work(options, session)
        except Abdf1Error as error:
            status = failed(options, session, error)
    conclude(session, partial(_neighbours, options, routes or {}))
    return status


def _neighbours(options: argparse.Namespace, routes: MappingType[int, int]) -> Sequence[int]:
    """Return stations that are on the line itself: of the map, or of map.csv beside net.csv."""
    if not routes and options.net:
        with suppress(ConfigurationError):
            routes = routes_of(load_mappings(str(Path(options.net).with_name('map.csv')))[0])
    return sorted(station for station, gateway in routes.items() if station == gateway)


def mappings_of(options: argparse.Namespace, session: Session,
                targets: Targets) -> list[Mapping]:
    """Return the mappings of addresses; where needed, ask the PLC for its type first."""
    if not targets.addresses:
        return targets.rows
    plc_type, processor = family_of(options, session)
    kind = {'PLC_Type': plc_type.value, 'Processor': data.processor_cell(processor)}
    cells = {column: text for column, text in kind.items() if text} | targets.cells
    return [mapping for item, entry in enumerate(targets.entries, 1) for mapping in (
        [entry] if isinstance(entry, Mapping) else data.mappings_of(entry, cells, item))]


def family_of(options: argparse.Namespace,
              session: Session) -> tuple[PlcType, Processor | None]:
    """Return family and processor: from the option, or from the station's reply."""
    if options.plc_type:
        return PlcType(options.plc_type), None
    return kind_of(lambda: session.ask(options.station, steps.identify()), 'give --plc-type')


def failed(options: argparse.Namespace, session: Session, error: Abdf1Error, place: str = '',
           row: Mapping | None = None) -> int:
    """Print why a request to a station, about ``place``, failed; return the exit status."""
    if isinstance(error, ConfigurationError | PortLost):
        raise error
    station = options.station if row is None else row.station
    complain(f'{place and f"{place} of "}station {station}: {error}')
    if isinstance(error, RemoteError):
        check_type(options, session, station)
    if isinstance(error, LinkError) and session.silent is None:
        session.silent = station
    if options.is_assumed and isinstance(error, LinkError):
        _advise(session, f'no station was given, so {station} was asked; "plc scan" lists the '
                         'stations that answer')
    lists_files = row is None or FAMILIES[row.plc_type].file_search is not None
    if place and lists_files and isinstance(error, RemoteError) and is_address_fault(error):
        _advise(session, f'"plc files {station}" lists its data files and their lengths')
    return EXIT_FAILED


@contextmanager
def after_write(text: str) -> Iterator[None]:
    """Look at a complete write, whose result is ``text``; no failure there ends the command."""
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        pass
    except Abdf1Error as error:
        complain(f'cannot be read back: {error}')
    except OSError as error:
        drop_output()
        complain(f'{text}, but that cannot be printed: {error.strerror}')


def check_type(options: argparse.Namespace, session: Session, station: int) -> None:
    """Ask a PLC for its type once; warn if an option gives another type."""
    if '--plc-type' not in session.said:
        session.said.add('--plc-type')
        with suppress(PortLost):  # this is advice only
            _advise(session, presence.type_hint(session, station, options.plc_type))


def _line(options: argparse.Namespace, targets: Targets | None, writes: bool) -> Network:
    """
    Return the line of a command for one station, and set the station in ``options``.

    Raises ConfigurationError if a write names no station on a line of several stations, and if the
    station is our own. Rows of a map name their stations.
    """
    network = network_of(options)
    if targets and targets.rows:
        targets.check_line(network)
        if not targets.addresses:
            options.is_assumed, options.station = False, targets.rows[0].station
            return network
    has_several = network.mode != MODES['full']
    options.is_assumed = has_several and options.station is None
    if options.is_assumed and writes:
        raise ConfigurationError([Problem(
            '--station', 'give the station to write to: this line may have several stations')])
    if options.station is None:
        options.station = DEFAULT_STATION
    if options.is_assumed and options.station == network.station:
        raise ConfigurationError([Problem(
            '--station', f'give the station to ask; {options.station} is our own Station')])
    if not has_several:
        return network
    routes = targets.routes if targets else {}
    return apart_from_target(network, options, {*routes, *routes.values()})


def _advise(session: Session, text: str) -> None:
    """Print a text of advice once per command."""
    if text and text not in session.said:
        session.said.add(text)
        complain(text)
