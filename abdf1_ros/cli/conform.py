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
The command ``conform``: simulates one end of a line and checks the far end by the manual.

The far end is a slave or a master of a half-duplex line, or a node of a full-duplex line or a
radio modem network. Such a node answers commands (peer, radio) or sends them (client,
radio-client). Every case is a rule: the bytes to send, the answer that must come, its time, and
the document with its page.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from decimal import Context, ROUND_DOWN
import math
import random
import re
import time

from abdf1_ros.cli.plc.line import apart_from_target, network_of
from abdf1_ros.cli.plc.options import add_line_options, LineDefaults
from abdf1_ros.cli.terminal import (
    command_parser,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    NoPort,
    number_option,
    prepare_output,
    reason_of,
    run_command,
    tell,
    whole_option,
)
from abdf1_ros.conform.case import (
    Case,
    CaseResult,
    End,
    LONGEST_CASE,
    Permission,
    run_cases,
    Target,
    Verdict,
)
from abdf1_ros.conform.cases import CASES
from abdf1_ros.conform.codec import BlockCheck, HEADER_SIZE
from abdf1_ros.conform.data import why_no_words
from abdf1_ros.conform.ends import (
    AskingEnd,
    MasterEnd,
    PeerEnd,
    RadioEnd,
    RadioServerEnd,
    Serve,
    ServerEnd,
    SlaveEnd,
    Words,
)
from abdf1_ros.conform.report import as_issue, as_json, line_of, summary_of
from abdf1_ros.conform.wire import Failed, Skipped, Wire
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Damaged
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.errors import FormatError
from abdf1_ros.line_names import host_and_port
from abdf1_ros.paths import config_file, expanded, package_version
from abdf1_ros.pccc.families import decode_identity
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.endpoints import Endpoint, PtyWire, TcpEndpoint
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.wake import Wake
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import load_plcs

_DOWN = Context(prec=1, rounding=ROUND_DOWN)
_NEAR = 2.0  # in units of --answer-time: an earlier DLE ENQ may look like an answer

_NOTHING_TRIED = 'no rule was tried: each case has its reason'
_NOBODY = 'no byte was received: check cable, port, speed, power and --station'
_MOST_IN_VAIN = 5  # cases without a byte of a target that should answer; no further one is tried

# With more, a run could not try the cases in the time that it has.
_ANSWER_TIME = number_option('a number of seconds above 0, up to 30', math.ulp(0.0), 30.0)

_MOST_WORDS = 41  # of one command to the smallest processors (M 7-17)

_EPILOG = """\
exit status: 0 if no case failed, 1 if a case failed, no case was tried, no byte was heard, or the
             line was lost or cannot be opened, 2 for bad options or files, 130 after Ctrl-C

examples:
  conform slave --port /dev/ttyUSB0 --baud 19200 --station 1 --family SLC
  conform peer --port /dev/ttyUSB0 --family PLC5 --words N7:100 --yes
  conform master --pty /tmp/line --station 1        a driver opens /tmp/line and reads station 1
  conform client --tcp 127.0.0.1:4001 --check BCC
  conform slave --list

Do not run conform against a machine that is in use.
"""


class _PortLine:
    """A port for cases; if the port ``echoes`` our bytes, ``read`` leaves them out."""

    def __init__(self, port: Port, echoes: bool) -> None:
        self._port = port
        self._echoes = echoes
        self._echo = b''
        self._never = Wake()

    def read(self, timeout: float) -> bytes:
        data = self._port.read(timeout, self._never.descriptor)
        size = min(len(data), len(self._echo))
        if data[:size] != self._echo[:size]:
            raise OSError('our bytes do not come back unchanged; leave out --echo')
        self._echo = self._echo[size:]
        # A character that the UART has found damaged has to spoil its message (M 4-7).
        return bytes(byte ^ isinstance(data, Damaged) for byte in data[size:])

    def write(self, data: bytes) -> None:
        self._port.write(data)
        if self._echoes:
            self._echo += data

    def close(self) -> None:
        self._port.close()
        self._never.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the cases; return one of the exit statuses that --help lists."""
    prepare_output()
    options = _parse(args)
    target = Target(options.target)
    cases = [case for case in CASES if target in case.targets
             and (not options.only or case.name in options.only)]

    def run() -> int:
        with ExitStack() as stack:
            return _run(options, target, cases, stack)
    return run_command('conform', run, EXIT_INTERRUPTED, EXIT_FAILED)


def _run(options: argparse.Namespace, target: Target, cases: Sequence[Case],
         stack: ExitStack) -> int:
    """Run the cases on the line, which ``stack`` closes."""
    if options.list:
        for case in cases:
            print(f'{case.name:24} {case.source:16} {case.rule}')
        return 0
    made = options.pty is not None or options.tcp is not None
    network = network_of(options, 'half' if target.is_half_duplex else 'full', not made)
    asks = target in (Target.SLAVE, Target.PEER, Target.RADIO)
    if target in (Target.SLAVE, Target.RADIO):  # in full duplex both may have one number
        network = apart_from_target(network, options)
    serve = None if asks else _server(options, network)
    try:
        line = _open(options, network, stack)
    except OSError as error:
        name = options.pty or network.port if options.tcp is None else '--tcp'
        raise NoPort(name, error) from None
    try:
        wire = Wire(line, BlockCheck(network.error_code), time.monotonic,
                    is_half_duplex=target.is_half_duplex, is_radio=target.is_radio,
                    answer_time=options.answer_time,
                    char_time=0.0 if made else network.timing.char_time, passes_commands=asks)
        return _judge(options, target, cases, wire, network,
                      _end(options, target, wire, network, serve))
    except OSError as error:
        tell('conform', f'the line was lost: {reason_of("", error)}')
        return EXIT_FAILED


def _judge(options: argparse.Namespace, target: Target, cases: Sequence[Case], wire: Wire,
           network: Network, end: End) -> int:
    results: list[CaseResult] = []
    identity = None
    try:
        identity = _identity(end) if isinstance(end, AskingEnd) else None
        for result in run_cases(cases, wire, end, _allowed(options)):
            results.append(result)
            if not (options.json or options.report):
                print(line_of(result), flush=True)
            if isinstance(end, AskingEnd) and not wire.reader.has_heard and sum(
                    each.verdict is Verdict.FAIL for each in results) == _MOST_IN_VAIN:
                break
    finally:  # also of a run that Ctrl-C or the loss of the line ends
        _tell_results(options, results, identity, wire, network)
    if wire.noise:
        tell('conform', f'{wire.noise} bytes outside of any symbol were ignored: noise, or a '
             'wrong speed or parity?')
    if not wire.reader.has_heard:
        tell('conform', _NOBODY)
        return EXIT_FAILED
    verdicts = {result.verdict for result in results}
    if verdicts == {Verdict.SKIP}:
        tell('conform', _NOTHING_TRIED)
        return EXIT_FAILED
    if Verdict.FAIL not in verdicts:
        return 0
    if wire.enquired_after < _NEAR * options.answer_time:
        tell('conform', f'the target sends DLE ENQ after {wire.enquired_after:.2f} s; with '
             f'--answer-time {options.answer_time:g} that may look like a fault: try '
             f'--answer-time {_DOWN.create_decimal(wire.enquired_after / _NEAR + 1e-9):f}')
    return EXIT_FAILED


def _tell_results(options: argparse.Namespace, results: Sequence[CaseResult],
                  identity: Identity | None, wire: Wire, network: Network) -> None:
    """Print the results as the options say."""
    # Facts that may be published. The name of the port is left out: it may contain a host's name.
    # What an identity has in brackets is a part of the status, which may name the program.
    processor = str(identity or 'not known').partition(' (')[0]
    kind = 'TCP' if options.tcp else 'pty' if options.pty else (
        network.port.partition('://')[0] if '://' in network.port else 'serial')
    facts = {'target': options.target, 'processor': processor,
             'station': str(options.station), 'check': wire.check.value, 'port': kind,
             'baud': str(network.baud), 'parity': network.parity,
             'answer time': f'{options.answer_time:g} s', 'abdf1_ros': package_version()}
    if options.json:
        print(as_json(facts, results))
    elif options.report:
        print(as_issue(facts, results))
    else:
        print(summary_of(results))


def _identity(end: AskingEnd) -> Identity | None:
    """
    Ask the target for its identity; without --family the cases that read use its family.

    Tell why they are skipped if the target does not know the commands of its family.
    """
    identity = _ask_identity(end)
    try:
        why_not = why_no_words(end)
    except (Failed, Skipped):  # the cases report the fault
        return identity
    if why_not:
        tell('conform', f'{why_not}; cases that read or write words are skipped')
        end.words = replace(end.words, why_not=why_not)
    return identity


def _ask_identity(end: AskingEnd) -> Identity | None:
    end.wire.begin(LONGEST_CASE)
    try:
        end.settle()
        identity = decode_identity(end.ask(0x06, b'\x03')[HEADER_SIZE:])
    except (Failed, Skipped, FormatError):  # the cases report the fault
        return None
    if identity.plc_type in (PlcType.PLC5, PlcType.SLC) and not end.words.family:
        end.words = replace(end.words, family=identity.plc_type.value)
    return identity


def _allowed(options: argparse.Namespace) -> frozenset[Permission]:
    allowed = {Permission.NOTHING}
    if options.yes:
        allowed.add(Permission.RESET)
        if options.words:
            allowed.add(Permission.WRITE)
    return frozenset(allowed)


def _end(options: argparse.Namespace, target: Target, wire: Wire, network: Network,
         serve: Serve | None) -> End:
    """Return our end of the line; ``serve`` answers the commands of a target that asks."""
    if serve is None:
        kind = MasterEnd if target is Target.SLAVE else (
            PeerEnd if target is Target.PEER else RadioEnd)
        file, element = options.words or (7, 0)
        words = Words(file, element, options.count, options.family or '')
        return kind(wire, options.station, network.station, random.randrange(0x10000), words)
    if target is Target.MASTER:
        return SlaveEnd(wire, options.station, serve)
    if target.is_radio:
        return RadioServerEnd(wire, options.station, serve)
    return ServerEnd(wire, serve)


def _integer_words(text: str) -> tuple[int, int]:
    found = re.fullmatch(r'[Nn](\d{1,3}):(\d{1,3})', text)
    if found is None:
        raise argparse.ArgumentTypeError(f'"{text}" should be integer words such as N7:100')
    return int(found[1]), int(found[2])


def _server(options: argparse.Namespace, network: Network) -> Serve:
    """Return a function that executes commands on the data table of a simulated PLC."""
    plcs = load_plcs(options.data or str(config_file('simulator.csv')),
                     Checksum[network.error_code], time.monotonic)
    plc = next((plc for plc in plcs if plc.station == options.station), None)
    if plc is None:
        raise ConfigurationError([Problem(f'--station {options.station}', (
            f'{options.data or "the example data"} has stations '
            f'{", ".join(str(plc.station) for plc in plcs)}'))])
    return lambda command: plc.serve(Packet.decode(command)).encode()


def _open(options: argparse.Namespace, network: Network, stack: ExitStack) -> _PortLine:
    """Open the line; a pseudo-terminal or TCP port waits for its client."""
    line = _PortLine(_port(options, network, stack), options.echo)
    stack.callback(line.close)
    return line


def _port(options: argparse.Namespace, network: Network, stack: ExitStack) -> Port:
    end: Endpoint
    if options.tcp is not None:
        end = TcpEndpoint(*options.tcp)
    elif options.pty is not None:
        end = PtyWire(options.pty, is_awaited=True)
    else:
        return open_port(PortSettings.of(network))
    stack.callback(end.close)
    tell('conform', f'at {end.name}')
    while True:
        try:
            return end.open()
        except OSError:  # no client yet; Ctrl-C ends it
            time.sleep(0.05)


def _parse(args: Sequence[str] | None) -> argparse.Namespace:
    parser = command_parser('conform', __doc__, _EPILOG)
    parser.add_argument('target', choices=[target.value for target in Target],
                        help='the kind of node at the far end')
    parser.add_argument('--station', type=whole_option, default=1, metavar='N',
                        help='station of the target; if the target is a master or client: the '
                             'station we simulate (default: %(default)s)')
    parser.add_argument('--answer-time', type=_ANSWER_TIME, default=1.0, metavar='S',
                        help='longest time (s) for an answer, up to 30; silence of this length '
                             'counts as no answer (default: %(default)s)')
    parser.add_argument('--family', type=str.upper, choices=('PLC5', 'SLC'),
                        help='family of the target, for cases that read and write (default: the '
                             'target is asked)')
    parser.add_argument('--words', metavar='ADDRESS', type=_integer_words,
                        help='first integer word that cases may read, and overwrite with --yes '
                             '(default for reads: N7:0)')
    parser.add_argument('--count', type=whole_option, default=1, metavar='N',
                        help=f'number of these words, up to {_MOST_WORDS} (default: %(default)s)')
    parser.add_argument('--yes', action='store_true',
                        help='also run cases that write, and cases that reset the line')
    parser.add_argument('--data', metavar='FILE', type=expanded,
                        help='target master or client: CSV of the data tables that we simulate '
                             '(default: the example)')
    parser.add_argument('--only', action='append', default=[], metavar='CASE',
                        help='run only this case; may be repeated')
    parser.add_argument('--list', action='store_true', help='list the cases and end')
    parser.add_argument('--json', action='store_true', help='print the result as JSON')
    parser.add_argument('--report', action='store_true',
                        help='print the result as text for an issue, with the row for '
                             'docs/tested_with.md')
    parser.add_argument('--pty', metavar='LINK', type=expanded,
                        help='make a pseudo-terminal of this name')
    parser.add_argument('--tcp', metavar='HOST:PORT', help='listen on a TCP port')
    parser.add_argument('--echo', action='store_true',
                        help='half duplex: the adapter echoes the bytes that we send')
    add_line_options(parser, LineDefaults(), has_link=False)
    options = parser.parse_args(args)
    target = Target(options.target)
    if options.echo and not target.is_half_duplex:
        parser.error('--echo: in full duplex an echo looks like an answer')
    unknown = set(options.only) - {case.name for case in CASES if target in case.targets}
    if unknown:
        parser.error(f'--only {", ".join(sorted(unknown))}: no such case of target '
                     f'{target.value}; --list shows them')
    if not 0 <= options.station <= MAX_STATION:
        parser.error(f'--station {options.station} should be from 0 to {MAX_STATION}')
    if not 1 <= options.count <= _MOST_WORDS:
        parser.error(f'--count {options.count} should be from 1 to {_MOST_WORDS}')
    if [options.pty, options.tcp, options.port].count(None) < 2:
        parser.error('--pty, --tcp and --port: give one of them')
    if options.tcp is not None:
        try:
            options.tcp = host_and_port(options.tcp)
        except ValueError as error:
            parser.error(f'--tcp {error}')
    return options


if __name__ == '__main__':
    raise SystemExit(main())
