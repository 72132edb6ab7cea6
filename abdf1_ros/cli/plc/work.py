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

"""The commands of ``plc``: a function for each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
import errno
from functools import partial
from pathlib import Path
import shlex
import sys
from typing import TypeVar

from abdf1_ros.cli.overhearing import map_of, texts_of
from abdf1_ros.cli.plc import data, detect, files, init, overhear, presence
from abdf1_ros.cli.plc.clock import Clock, TAKEN, told
from abdf1_ros.cli.plc.exports.form import Wanted
from abdf1_ros.cli.plc.exports.imported import import_map
from abdf1_ros.cli.plc.line import free_station, MODES, network_of
from abdf1_ros.cli.plc.options import COLUMN_ROLES, DEFAULT_STATION, RADIXES
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.plc.targets import no_value, rows_of_map, Targets, to_read, to_write
from abdf1_ros.cli.plc.watch import Watch
from abdf1_ros.cli.terminal import (
    advice_for,
    called,
    colour,
    drop_output,
    EXIT_FAILED,
    EXIT_UNKNOWN,
    EXIT_USAGE,
    GREEN,
    Progress,
    RED,
    table,
    tell,
)
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.errors import Abdf1Error, LinkError, PortLost, RemoteError
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import is_address_fault
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.report import make_report
from abdf1_ros.ports.listing import serial_ports
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import load_network, Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import counted, printable

_ALL_TRIED_IN_VAIN = (
    'not one character came: cable, port, power? Or a station that was not asked (--stations; a '
    'PLC-5 shows its own in octal)')
_ONE_PLC_ANSWERS_TO_ALL = (
    'in full duplex most PLCs answer to every station number, so these may be one PLC')

_Prepared = TypeVar('_Prepared')

_UNCERTAIN = (Outcome.UNKNOWN, Outcome.PARTLY)


def _mappings(options: argparse.Namespace, session: Session, targets: Targets) -> list[Mapping]:
    """Return the mappings of addresses; where needed, ask the PLC for its type first."""
    if not targets.addresses:
        return targets.rows
    plc_type, processor = _family(options, session)
    kind = {'PLC_Type': plc_type.value, 'Processor': data.processor_cell(processor)}
    cells = {column: text for column, text in kind.items() if text} | targets.cells
    return [mapping for item, entry in enumerate(targets.entries, 1) for mapping in (
        [entry] if isinstance(entry, Mapping) else data.mappings_of(entry, cells, item))]


def _line(options: argparse.Namespace, prepared: object) -> Network:
    """
    Return the line of a command for one station, and set the station in ``options``.

    Raises ConfigurationError if a write names no station on a line of several, and if the station
    is our own. Rows of a map name their stations.
    """
    network = network_of(options)
    if isinstance(prepared, Targets) and prepared.rows:
        prepared.check_line(network)
        if not prepared.addresses:
            options.is_assumed, options.station = False, prepared.rows[0].station
            return network
    has_several = network.mode != MODES['full']
    options.is_assumed = has_several and options.station is None
    if options.is_assumed and (options.command == 'write' or getattr(options, 'set', False)):
        raise ConfigurationError([Problem(
            '--station', 'give the station to write to: this line may have several stations')])
    if options.station is None:
        options.station = DEFAULT_STATION
    if not has_several or options.station != network.station:
        return network
    if options.is_assumed:
        raise ConfigurationError([Problem(
            '--station', f'give the station to ask; {options.station} is our own Station')])
    if options.net or options.own_station is not None or network.line_mode.is_polled:
        raise ConfigurationError([Problem('--own-station', (
            f'{network.station} is our own Station, so no PLC can answer as {options.station}; '
            'give us a station number that no PLC of the line has'))])
    return replace(network, station=free_station(network.station, [options.station]))


def _asking(work: Callable[[argparse.Namespace, Session, _Prepared], int],
            prepare: Callable[[argparse.Namespace], _Prepared],
            ) -> Callable[[argparse.Namespace], int]:
    """
    Return a command that asks one station; it warns if ``via`` may not be a gateway.

    ``prepare`` finds faults before the port is opened; ``work`` gets its result.
    """
    def command(options: argparse.Namespace) -> int:
        prepared = prepare(options)
        network = _line(options, prepared)
        record = None if options.command == 'watch' else getattr(options, 'record', None)
        routes = prepared.routes if isinstance(prepared, Targets) else None
        with Session(network, via=options.via, record=record, routes=routes) as session:
            if options.via is not None and (
                    who := presence.common_identity(session, options.station, options.via)):
                _complain(f'stations {options.station} and {options.via} are both "{who}": if '
                          f'{options.via} is not a gateway, it answers itself')
            try:
                return work(options, session, prepared)
            except Abdf1Error as error:
                return _failed(options, session, error)
            finally:
                if session.is_silent:
                    _complain(presence.traffic(session.counters, session.stray))
    return command


def _failed(options: argparse.Namespace, session: Session, error: Abdf1Error, place: str = '',
            row: Mapping | None = None) -> int:
    """Print why a request to a station, about ``place``, failed; return the exit status."""
    if isinstance(error, ConfigurationError | PortLost):
        raise error
    station = options.station if row is None else row.station
    _complain(f'{place and f"{place} of "}station {station}: {error}')
    if isinstance(error, RemoteError):
        _check_type(options, session, station)
    _advise(session, presence.hint(session, error))
    session.is_silent |= isinstance(error, LinkError)
    if options.is_assumed and isinstance(error, LinkError):
        _advise(session, f'no station was given, so {station} was asked; "plc scan" lists the '
                         'stations that answer')
    if place and isinstance(error, RemoteError) and is_address_fault(error):
        _advise(session, f'"plc files {station}" lists its data files and their lengths')
    return EXIT_FAILED


def _check_type(options: argparse.Namespace, session: Session, station: int) -> None:
    """Ask a PLC for its type once; warn if an option gives another type."""
    if '--plc-type' not in session.said:
        session.said.add('--plc-type')
        _advise(session, presence.type_hint(session, station, options.plc_type))


def _advise(session: Session, text: str) -> None:
    """Print a text of advice once per command."""
    if text and text not in session.said:
        session.said.add(text)
        _complain(text)


def _read(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    status, is_read = 0, False
    for mapping in _mappings(options, session, targets):
        for remark in mapping.remarks if mapping.address.file_type.is_structure else ():
            _complain(remark.text)
        try:
            values = data.read(session, mapping)
        except Abdf1Error as error:
            status = _failed(options, session, error, data.named(mapping), mapping)
        else:
            is_read = True
            _print_values(mapping, values, RADIXES[options.radix], targets.tags)
    if is_read:  # a PLC may answer commands of another family
        _check_type(options, session, options.station)
    return status


def _print_values(mapping: Mapping, values: Values, radix: data.Radix = data.Radix.DECIMAL,
                  tags: data.Tags | None = None) -> None:
    rows = list(data.rows(mapping, values, data.labels(mapping, tags), radix))
    width = max(len(address) for address, _ in rows)
    note = mapping.description if data.is_row(mapping) else ''
    for address, text in rows:
        print(printable(f'{address:{width}}  {text}  {note}'.rstrip()))
        note = ''


def _write(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    mapping, = _mappings(options, session, targets)
    with no_value(options.address):
        writing = data.Writing(mapping, options.values)
    for remark in data.remarks_of_write(mapping):
        _complain(remark)
    if not options.yes and not _is_confirmed(options, session, writing):
        _complain('nothing was written; --yes writes')
        return EXIT_USAGE
    status = _carry_out(session, writing)
    if status != EXIT_UNKNOWN:
        _check_type(options, session, mapping.station)
    return status


def _is_confirmed(options: argparse.Namespace, session: Session, writing: data.Writing) -> bool:
    """Show the present values; return True if the user confirms the write."""
    mapping = writing.mapping
    try:
        print('now:')
        _print_values(mapping, data.read(session, mapping))
    except Abdf1Error as error:
        _failed(options, session, error, data.named(mapping), mapping)
    return _is_wanted(f'write {writing} to {data.named(mapping)} of station {mapping.station}')


def _is_wanted(question: str) -> bool:
    """Ask the user on a terminal; print the question and return False without a terminal."""
    if not sys.stdin.isatty():
        print(f'would {printable(question)}')
        return False
    try:
        return input(f'{printable(question)}? [y/N] ').strip().lower() in ('y', 'yes')
    except EOFError:
        return False


def _carry_out(session: Session, writing: data.Writing) -> int:
    """Write, show the values in the PLC after it, and return the exit status."""
    mapping = writing.mapping
    place = f'{data.named(mapping)} of station {mapping.station}'
    result = writing.carry_out(session)
    text = str(result)
    if result.outcome is not Outcome.WRITTEN:
        _complain(f'{place}: {text}')
        return EXIT_UNKNOWN if result.outcome in _UNCERTAIN else EXIT_FAILED
    try:
        print(f'{place}: {colour(text, GREEN, sys.stdout)}; now:', flush=True)
        _print_values(mapping, data.read(session, mapping))
        sys.stdout.flush()
    except KeyboardInterrupt:  # the write is complete
        pass
    except Abdf1Error as error:
        _complain(f'cannot be read back: {error}')
    except OSError as error:
        drop_output()
        _complain(f'{text}, but that cannot be printed: {error.strerror}')
    return 0


def _watch(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    mappings = _mappings(options, session, targets)
    session.close()  # the driver opens the port itself
    watch = Watch(session.network, mappings, options.period, RADIXES[options.radix],
                  options.csv, targets.tags, options.record)
    failed = watch.run(options.count)
    if failed:
        _complain(presence.traffic(watch.counters))
    return EXIT_FAILED if failed else 0


def _status(options: argparse.Namespace, session: Session, prepared: None) -> int:
    there = presence.look_at(session, options.station)
    if there.error is not None:
        raise there.error
    print('\n'.join(presence.describe(there)))
    return 0


def _ping(options: argparse.Namespace, session: Session, prepared: None) -> int:
    times: list[float] = []
    failures = 0
    try:
        for _ in range(options.count):
            try:
                times.append(presence.ping(session, options.station))
            except Abdf1Error as error:
                failures += 1
                _failed(options, session, error)
            else:
                print(f'station {options.station}: {times[-1] * 1000:.1f} ms', flush=True)
    except KeyboardInterrupt:
        pass  # the interrupted echo does not count
    text = f'{failures + len(times)} sent, {len(times)} answered'
    if times:
        text += (f'; shortest {min(times) * 1000:.1f}, mean '
                 f'{sum(times) / len(times) * 1000:.1f}, longest {max(times) * 1000:.1f} ms')
    print(text)
    return 0 if times and not failures else EXIT_FAILED


def _scan(options: argparse.Namespace) -> int:
    progress = Progress()
    found = 0
    asked = 1
    network = network_of(options)
    for there in presence.scan(network, options.stations, options.via, progress.show):
        if there.is_there:
            if not found:
                print('station    answer  processor')
            found += 1
            progress.clear()
            print(f'{there.station:7}  {there.seconds * 1000:5.0f} ms  {there}'
                  f'{presence.again(there.asked)}', flush=True)
        else:
            asked = there.asked
    progress.clear()
    print(presence.tally(found, len(options.stations), asked))
    if found > 1 and network.mode == MODES['full']:
        print(_ONE_PLC_ANSWERS_TO_ALL)
    return 0 if found else EXIT_FAILED


def _detect(options: argparse.Namespace) -> int:
    network = network_of(options)
    found = _found(options, network)
    if isinstance(found, overhear.ForeignMaster):
        return _only_heard(found, '"plc init" writes net.csv and map.csv for Mode Listen')
    if found is None:
        return EXIT_FAILED
    there = found.presence
    print(f'{colour(str(found.settings), GREEN, sys.stdout)}: station {there.station} {there}')
    settings = found.settings
    with Session(found.settings.on(network)) as session, suppress(LinkError):
        if ways := presence.io_access(session, there):
            print(f'inputs and outputs: Access {" or ".join(ways)}')
    other = '' if there.station == DEFAULT_STATION else f' --station {there.station}'
    whom = {MODES['full']: f'--peer{other}', MODES['half']: f'--station {there.station}'}.get(
        settings.mode, f'--radio --station {there.station}') + presence.type_to_say(there)
    parity = '' if network.parity == 'None' else f' --parity {network.parity}'
    print(f'next: {called("plc")} read N7:0 {whom} --port {network.port} --baud {settings.baud} '
          f'--check {settings.check}{parity}')
    print(f'net.csv:\n{init.net_csv(network, found, [there.station])}')
    return 0


def _found(options: argparse.Namespace,
           network: Network) -> detect.Found | overhear.ForeignMaster | None:
    """Return the settings that work, or another master; print traces if there is neither."""
    if options.duplex == 'slave':
        raise ConfigurationError([Problem(
            '--duplex', 'a slave cannot try settings; leave --duplex out, then we listen first')])
    progress = Progress()
    bauds: Sequence[int] = [network.baud] if options.baud or '://' in network.port \
        else detect.BAUD_RATES
    modes = [MODES[options.duplex]] if options.duplex else [MODES['full'], MODES['half']]
    checks = [network.error_code] if options.check else detect.CHECKS
    master = overhear.overhear(network, bauds, progress.show)
    if master is not None:
        progress.clear()
        return master
    search = detect.Search(network, options.stations, progress.show)
    found = search.run(bauds, modes, checks)
    progress.clear()
    if search.echoes:
        _complain(COMES_BACK)
    if found is None:
        _complain(f'nothing answers with any of these settings, tried {detect.ROUNDS} times')
        for trace in search.traces or [_ALL_TRIED_IN_VAIN] * (not search.echoes):
            _complain(trace)
        kept = [option for option, value in (
            ('--duplex', options.duplex), ('--baud', options.baud), ('--check', options.check))
            if value]
        if kept:
            _complain(f'{" and ".join(kept)}: no other value was tried; leave the option out to '
                      'try all')
    return found


def _init(options: argparse.Namespace) -> int:
    target = init.NewFiles(Path(options.into), 'net.csv', 'map.csv')
    if not options.port and not options.net:
        options.port = _only_port()
    network = network_of(options)
    found = None if network.line_mode.only_listens else _found(options, network)
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
          f'  {called("plc")} watch S:0 --station {there[0].station}'
          f'{presence.type_to_say(there[0])} --net {net}\n'
          f'  {called("check")} {net} {map_file}\n'
          f'  {called("node")} --ros-args -p net_file:={net} -p map_file:={map_file}')
    return 0


def _only_heard(master: overhear.ForeignMaster | None, what: str) -> int:
    """Print the ways to use a line of another master; return the status."""
    _complain(what if master is None else (
        f'{master}: nothing was sent. If the master polls a station N that no PLC has, "plc '
        '--slave --own-station N" can ask PLCs through it, like a node of Mode Slave; "sniff" '
        f'shows what the master reads; {what}'))
    return EXIT_FAILED


def _init_listening(network: Network, master: overhear.ForeignMaster | None,
                    target: init.NewFiles) -> int:
    """Write net.csv and map.csv for Mode Listen, with the reads of another master."""
    if master is not None:
        print(f'{master}: we send nothing')
        check = network.error_code if master.check is None else master.check.value
        network = replace(overhear.silent(network), baud=master.baud, error_code=check)
    progress = Progress()
    progress.show(f'listening for {overhear.LISTENED_FOR_READS:.0f} s')
    reads = overhear.heard_reads(network, overhear.LISTENED_FOR_READS)
    progress.clear()
    if not reads:
        return _only_heard(master, 'no read with its reply was heard, so no file was written')
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
    for seen in presence.scan(network, stations) if stations else ():
        if seen.is_there:
            there[seen.station] = seen
        else:
            asked = seen.asked
    if asked > 1:
        print(presence.tally(len(there), len({*there, *stations}), asked))
    return [there[number] for number in sorted(there)] or [found.presence]


def _import(options: argparse.Namespace) -> int:
    result = import_map(options.file, Wanted(
        PlcType(options.plc_type), options.stations, options.read_only, options.period,
        {role: name for role in COLUMN_ROLES if (name := getattr(options, f'{role}_column'))},
        options.plc, options.status))
    for problem in result.left_out:
        _complain(str(problem))
    for text, count in (+result.ignored).items():
        print(f'ignored: {count} {text}')
    for text, count in (+result.remarks).items():
        _complain(f'{counted(count, "row")}: {text}')
    left_out = f', {len(result.left_out)} left out' if result.left_out else ''
    if not result.count:
        _complain(f'{options.file}: no row can be used{left_out}; nothing was written')
        return EXIT_FAILED
    file = init.NewFiles(Path(options.into), 'map.csv')
    file.write(result.text)
    target, = file.paths
    print(f'written: {target}: {counted(result.count, "row")}{left_out}')
    nets = (target.with_name('net.csv'), Path('net.csv'))
    net = next((path for path in nets if path.exists()), None)
    print(f'next: {called("check")} {shlex.quote(str(net or nets[1]))} '
          f'{shlex.quote(str(target))}')
    if net is None:
        print(f'net.csv is not there yet: {called("plc")} init --into ANOTHER_FOLDER makes one')
        return EXIT_FAILED if result.left_out else 0
    with suppress(ConfigurationError):  # "check" reports the fault
        report = make_report(load_network(str(net)), load_mappings(str(target))[0],
                             DriverSettings().default_period)
        if report.load > 1 and (period := report.needed_period()):
            print(f'these rows need {report.load:.0%} of the time of the line in {net}; '
                  f'--period {period} would do')
    return EXIT_FAILED if result.left_out else 0


def _only_port() -> str:
    """Return the only port; ConfigurationError if there is none or more than one."""
    ports = serial_ports()
    if len(ports) == 1:
        print(f'port: {ports[0].device} {ports[0].adapter}'.rstrip())
        return ports[0].stable or ports[0].device
    listed = ', '.join(port.device for port in ports) or 'this machine has none'
    raise ConfigurationError([Problem('--port', f'name the port: {listed}')])


def _ports(options: argparse.Namespace) -> int:
    ports = serial_ports()
    rows = [(port.device, port.adapter, port.stable,
             '' if port.may_open else 'no access for this user') for port in ports]
    if not ports:
        _complain('this machine has no serial port: is the adapter plugged in? In a virtual '
                  'machine or container the host must pass it through')
        return EXIT_FAILED
    print(table(('port', 'adapter', 'stable name', ''), rows))
    if not all(port.may_open for port in ports):
        _complain(advice_for(errno.EACCES))
    return 0


def _clock(options: argparse.Namespace, session: Session, prepared: None) -> int:
    clock = Clock(session, options.station, *_family(options, session))
    try:
        if not options.set:
            print(f'station {options.station}: {told(*clock.read())}')
            return 0
        if not options.yes and not _is_wanted(
                f'set the clock of station {options.station} ({clock.address})'):
            _complain('nothing was written; --yes writes')
            return EXIT_USAGE
        clock.write()
        time, ahead = clock.read()
    except Abdf1Error as error:
        return _failed(options, session, error, clock.address)
    print(f'station {options.station}: {told(time, ahead)}')
    if abs(ahead) <= TAKEN:
        return 0
    _complain('the PLC confirmed the write, but its clock has not changed: these words may be a '
              'copy of the clock; set the clock with the software of the PLC')
    return EXIT_FAILED


def _files(options: argparse.Namespace, session: Session, mappings: Rows) -> int:
    family, processor = _family(options, session)
    progress = Progress()
    found = []
    for entry in files.find_files(session, options.station, family, processor, options.files,
                                  progress.show, _complain):
        found.append(entry)
        if options.map is None:
            progress.clear()
            print(f'{str(entry):6} {_extent(entry)}', flush=True)
    progress.clear()
    if options.map:
        faults = [*files.outside(found, mappings, options.station)]
        print('\n'.join(map(str, faults)) or f'all rows of station {options.station} lie inside')
        return EXIT_FAILED if faults else 0
    if options.map is not None:
        print('Tag,Command,Address,Station,PLC_Type,Processor,Length,Period'
              + ('' if options.via is None else ',Via'))
        for row in files.map_rows(found, options.station, family,
                                  data.processor_cell(processor), options.via):
            print(row)
    return 0 if found else EXIT_FAILED


def _family(options: argparse.Namespace, session: Session) -> tuple[PlcType, Processor | None]:
    """Return family and processor: from the option, or ask the station."""
    if options.plc_type:
        return PlcType(options.plc_type), None
    return data.ask_family(session, options.station)


def _extent(entry: DataFile) -> str:
    if entry.type.is_io:
        return f'{entry.elements:4} words' if entry.elements else '     by rack or slot'
    return f'{entry.elements:4} elements'


def _nothing(options: argparse.Namespace) -> None:
    """Prepare nothing."""


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    'read': _asking(_read, to_read), 'write': _asking(_write, to_write),
    'watch': _asking(_watch, to_read), 'status': _asking(_status, _nothing),
    'ping': _asking(_ping, _nothing), 'scan': _scan, 'detect': _detect, 'init': _init,
    'ports': _ports, 'files': _asking(_files, lambda options: rows_of_map(options.map)),
    'clock': _asking(_clock, _nothing), 'import': _import}

_complain = partial(tell, 'plc', code=RED)
