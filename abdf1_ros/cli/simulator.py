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
The simulator: PLCs on one line, to try the bridge without hardware.

By default all PLCs of the data file share a half-duplex multidrop line. With --full-duplex one PLC
has a full-duplex line of its own, on which it can also send commands. The line is a
pseudo-terminal, a serial port, or a TCP port. While the simulator runs, lines on standard input
switch faults on and off.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
import math
from operator import itemgetter
import os
import select
import signal
import sys
import threading
import time
import traceback

from abdf1_ros.cli.terminal import (
    command_parser,
    drop_output,
    EXIT_FAILED,
    EXIT_USAGE,
    NoPort,
    prepare_output,
    run_command,
    seconds_option,
    tell,
    whole_option,
)
from abdf1_ros.console import Sink
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Control, Duplex, Frame, FrameDecoder, NAK
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.radio import RadioNode
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.line_names import host_and_port
from abdf1_ros.numbers import decimal_number
from abdf1_ros.paths import config_file, expanded
from abdf1_ros.pccc.data_table import NoSuchFile
from abdf1_ros.ports.descriptor import Port, PortAround
from abdf1_ros.ports.endpoints import Endpoint, PtyEndpoint, SerialEndpoint, TcpEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortKind, PortState
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings import BAUD_RATES
from abdf1_ros.settings.network import make_network, Network, URLS
from abdf1_ros.signals import EndRequest
from abdf1_ros.simulator.commands import CommandError, COMMANDS, execute
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.ladder import Ladder, Lamp
from abdf1_ros.simulator.simulated_plc import load_plcs, SimulatedPlc

_EPILOG = COMMANDS + """
exit status: 0 after "quit", a signal or --seconds, 1 if the port cannot be opened or the name of
             --pty is in use, 2 for bad options or data files

examples:
  simulator --pty /tmp/plc
  simulator --tcp 127.0.0.1:4001 --check BCC
  simulator --full-duplex 1 --pty /tmp/plc --at '3 msg 1 N7:50 11 22'
  simulator --pty /tmp/plc --at '5 silent 2' --at '10 normal 2'
"""


# Time (s) to print the last lines.
_LAST_LINES = 1.0

_GLANCE = 0.05  # s

# The lamps of a ladder that are reported; the remaining lamps blink.
_LAMPS = {Lamp.ALIVE: 'ROS alive', Lamp.IN_CONTROL: 'ROS in control',
          Lamp.STOPPED: 'ROS stopped (heartbeat 0)',
          Lamp.LOST: 'ROS lost (heartbeat stands still)'}


class _FaultyPort(PortAround):
    """The port of the single PLC on a full-duplex line, with the effects of its faults."""

    def __init__(self, port: Port, plc: SimulatedPlc, checksum: Checksum) -> None:
        super().__init__(port)
        self._plc = plc
        self._decoder = FrameDecoder(checksum, Duplex.FULL)

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes; a silent PLC ignores them, a full PLC answers messages with NAK."""
        data = self._port.read(timeout, wake)
        if self._plc.faults.full:
            self._refuse(data)
        return b'' if self._plc.faults.silent or self._plc.faults.full else data

    def _refuse(self, data: bytes) -> None:
        """Answer NAK to every message and every enquiry."""
        self._decoder.feed(data)
        while (symbol := self._decoder.next_symbol()) is not None:
            if isinstance(symbol, Frame) or symbol is Control.ENQ:
                self.write(NAK)

    def write(self, data: bytes) -> None:
        """Send bytes, damaged if the PLC is noisy; a silent PLC sends nothing."""
        if not self._plc.faults.silent:
            self._port.write(self._plc.damaged(data))


class _Hearing(Collection[int]):
    """The stations of the PLCs that are not silent now."""

    def __init__(self, plcs: Sequence[SimulatedPlc]) -> None:
        self._plcs = plcs

    def __iter__(self) -> Iterator[int]:
        return (plc.station for plc in self._plcs if not plc.faults.silent)

    def __contains__(self, station: object) -> bool:
        return station in list(self)

    def __len__(self) -> int:
        return len(list(self))


class _EchoingPort(PortAround):
    """The port of a line whose adapter echoes all bytes to the far end."""

    def read(self, timeout: float | None, wake: int) -> bytes:
        data = self._port.read(timeout, wake)
        if data:
            self._port.write(data)
        return data


TimedCommands = list[tuple[float, str]]
"""Commands with their times: seconds after the start, and the command."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Run until SIGINT, SIGTERM, "quit" or the end of --seconds.

    Return one of the exit statuses that --help lists, or 1 after internal errors.
    """
    prepare_output()
    options = parse_options(args)
    return run_command('simulator', lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    try:
        script = sorted(map(_scheduled, options.at), key=itemgetter(0))
        if script:
            _try_out(script, options)
        cast = Cast(options)
    except (CommandError, ValueError) as error:
        tell('simulator', str(error))
        return EXIT_USAGE
    # A thread prints, so that a slow terminal or pipe stops neither the PLCs nor the end.
    output = Sink(sys.stdout.fileno())
    cast.say = lambda text: output.put(f'simulator: {text}\n'.encode(
        sys.stdout.encoding, 'backslashreplace'))
    output.start()
    try:
        cast.start()
        with EndRequest((signal.SIGINT, signal.SIGTERM)) as ended:
            _converse(cast, script, options, ended)
    finally:  # otherwise the thread keeps the process alive
        cast.close()
        output.end()
        output.join(_LAST_LINES)
    return EXIT_FAILED if cast.has_failed else 0


def _print(text: str) -> None:
    try:
        print(f'simulator: {text}', flush=True)
    except OSError:  # nothing reads the output any more; the PLCs go on
        drop_output()


class Cast:
    """
    PLCs that answer on a line from ``start`` to ``close``, by the options of the simulator.

    ``on_lamp`` gets station, lamp and state from ladder programs; ``say`` prints a line. Both are
    called in the thread that answers, and in the thread of the caller.
    """

    def __init__(self, options: argparse.Namespace,
                 on_lamp: Callable[[str, Lamp, bool], None] = lambda *lamp: None) -> None:
        self.say: Callable[[str], None] = _print
        self._on_lamp = on_lamp
        self._plcs = _load(options, self._tell_lamp)
        self._line = _make_line(options)
        self._make_machine = partial(_make_machine, self._plcs, options)
        self._link = _make_thread(
            self._make_machine(), self._plcs, self._line, options, self._tell)
        self._check = options.check

    def _tell(self, text: str) -> None:
        self.say(text)

    def start(self) -> None:
        """Print the stations, and start."""
        names = ', '.join(f'{plc.station} ({plc.table.plc_type.value})' for plc in self._plcs)
        self.say(f'stations {names} on {self._line.name}, {self._check}')
        self._link.start()

    @property
    def has_failed(self) -> bool:
        """Tell whether the thread has ended by internal errors."""
        return self._link.has_failed

    def carry_out(self, line: str) -> None:
        """Carry out a command, and print its result."""
        try:
            self.say(execute(line, self._plcs, self.say))
        except CommandError as error:
            self.say(str(error))
        else:
            if line.split()[0] == 'power' and self._plcs[0].processor.is_full_duplex:
                self._link.exchange(self._make_machine(), lambda: None, reopen=False,
                                    reason='the power was off')
        self._link.wake()

    def advance(self) -> None:
        """Let the ladder programs go on, also without commands to their PLCs."""
        for plc in self._plcs:
            plc.advance()

    def close(self) -> None:
        """End the thread and the line."""
        self._link.stop()
        self._line.close()

    def _tell_lamp(self, station: str, at: float, lamp: Lamp, is_on: bool) -> None:
        if lamp in _LAMPS:
            self.say(f'station {station}: {_LAMPS[lamp]} {"on" if is_on else "off"}')
            self._on_lamp(station, lamp, is_on)


def _try_out(script: TimedCommands, options: argparse.Namespace) -> None:
    """Raise CommandError for a command of --at that would fail later; send nothing."""
    plcs = _load(options)
    for _, line in script:
        try:
            if line.strip() != 'quit':
                execute(line, plcs)
        except CommandError as error:
            fault, is_long, _ = str(error).partition('\n')
            more = '; "simulator --help" lists the commands' if is_long else ''
            raise CommandError(f'--at: {fault}{more}') from None


def _load(options: argparse.Namespace,
          on_lamp: Callable[[str, float, Lamp, bool], None] = lambda *lamp: None
          ) -> list[SimulatedPlc]:
    """
    Return the PLCs of the data file with their ladder programs, for the mode of the line.

    With --full-duplex it is only the PLC that the option names. ``on_lamp`` gets the station, and
    what its ladder program reports.
    """
    plcs = load_plcs(options.data, Checksum(options.check), time.monotonic, threading.RLock)
    if not plcs:
        raise ValueError(f'{options.data}: has no stations')
    if options.full_duplex is not None:
        plcs = [_plc('--full-duplex', options.full_duplex, plcs)]
        plcs[0].be_full_duplex()
    elif options.radio:
        for plc in plcs:
            plc.be_radio(plcs[0].counters)
    for station in options.ladder:
        plc = _plc('--ladder', station, plcs)
        try:
            plc.run_ladder(Ladder(plc.table, on_lamp=partial(on_lamp, station)))
        except NoSuchFile as error:
            raise ValueError(
                f'--ladder {station}: {error}; it needs N10, N11, B12 and T13') from None
    return plcs


def _plc(option: str, station: str, plcs: Sequence[SimulatedPlc]) -> SimulatedPlc:
    """Return the PLC that an option names; raises ValueError if there is none."""
    for plc in plcs:
        if station == str(plc.station):
            return plc
    known = ', '.join(str(plc.station) for plc in plcs)
    raise ValueError(f'{option}: name a station ({known})')


def _make_machine(plcs: Sequence[SimulatedPlc], options: argparse.Namespace) -> Machine:
    """Return a machine that answers for ``plcs``."""
    checksum = Checksum(options.check)
    # Timers depend on the speed of the line, and only a serial port has a real speed.
    timing = Network(baud=options.baud).timing if options.port else LineTiming()
    if options.full_duplex is not None:
        return _full_duplex(plcs[0], checksum, timing)
    if options.radio:
        return _radio(plcs, checksum, timing)
    return Machine(multidrop(stations_of(plcs, checksum)), checksum=checksum)


def _make_thread(machine: Machine, plcs: Sequence[SimulatedPlc], line: Endpoint,
                 options: argparse.Namespace, say: Callable[[str], None]) -> LinkThread:
    """Return the thread that runs ``machine`` on ``line``."""
    def open_line() -> Port:
        port: Port = _EchoingPort(line.open()) if options.echo else line.open()
        if options.full_duplex is None:
            return port
        return _FaultyPort(port, plcs[0], Checksum(options.check))

    return LinkThread(
        machine, open_line, on_state=_announcer(say),
        on_fault=lambda error: say(''.join(traceback.format_exception(error))))


def _announcer(say: Callable[[str], None]) -> Callable[[PortState], None]:
    """Return a function that prints each change of the line's state, except to a normal state."""
    last = ''

    def announce(state: PortState) -> None:
        nonlocal last
        is_news = state.text != last and not state.is_open
        last = state.text
        if is_news and state.kind is not PortKind.NO_CLIENT:
            say(state.text)
    return announce


def parse_options(args: Sequence[str] | None) -> argparse.Namespace:
    """Return the options of the simulator."""
    parser = command_parser('simulator', __doc__, _EPILOG)
    parser.add_argument('--data', metavar='FILE', type=expanded,
                        default=str(config_file('simulator.csv')),
                        help='CSV of the data tables (default: %(default)s)')
    line = parser.add_mutually_exclusive_group()
    line.add_argument('--pty', metavar='NAME', type=_name,
                      help='make a pseudo-terminal of this name (default: a new name, which is '
                           'printed)')
    line.add_argument('--port', type=_name, help=f'use a serial port, {URLS}')
    line.add_argument('--tcp', metavar='HOST:PORT', help='listen on a TCP port')
    parser.add_argument('--ladder', metavar='STATION', action='append', default=[],
                        help='the program of this PLC watches a heartbeat in N10:0 and reports '
                             'when ROS is in control (docs/tutorials/heartbeats.md); may be '
                             'repeated')
    duplex = parser.add_mutually_exclusive_group()
    duplex.add_argument('--full-duplex', metavar='STATION',
                        help='only this PLC answers, on a full-duplex line')
    duplex.add_argument('--radio', action='store_true',
                        help='all PLCs answer behind a DF1 radio modem (Mode Radio)')
    parser.add_argument('--echo', action='store_true',
                        help='the line sends all received bytes back, as some two-wire adapters '
                             'do')
    parser.add_argument('--baud', type=whole_option, choices=BAUD_RATES, default=9600,
                        help='baud rate of the serial port (default: %(default)s)')
    parser.add_argument('--check', type=str.upper,
                        choices=[check.value for check in Checksum], default=Checksum.CRC.value,
                        help='check of messages (default: %(default)s)')
    parser.add_argument('--at', metavar='"SECONDS COMMAND"', action='append', default=[],
                        help='carry out a command SECONDS after the start; may be repeated')
    parser.add_argument('--seconds', type=seconds_option, default=math.inf,
                        help='end after this number of seconds')
    return parser.parse_args(args)


def _name(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError('the name is missing')
    return expanded(text)


def _scheduled(text: str) -> tuple[float, str]:
    seconds, _, command = text.partition(' ')
    value = decimal_number(seconds)
    if value is None or value < 0 or not command.strip():
        raise ValueError(f'--at "{text}" should be seconds from 0 and a command, as in '
                         '"5 silent 1"')
    return value, command


def _make_line(options: argparse.Namespace) -> Endpoint:
    """Return the line; raises NoPort with the name of a line that cannot be opened."""
    try:
        if options.tcp is not None:
            try:
                return TcpEndpoint(*host_and_port(options.tcp))
            except ValueError as error:
                raise ValueError(f'--tcp {error}') from None
        if options.port is not None:
            return SerialEndpoint(_port_settings(options))
        return PtyEndpoint(options.pty)
    except OSError as error:
        name = options.port or options.pty or f'--tcp "{options.tcp}"'
        raise NoPort(name, error) from None


def _port_settings(options: argparse.Namespace) -> PortSettings:
    """Return the settings of the port; raises ConfigurationError for a bad URL."""
    if '://' in options.port:
        make_network({'com_port': (options.port, '--port')})
    return PortSettings(options.port, options.baud)


def _full_duplex(plc: SimulatedPlc, checksum: Checksum, timing: LineTiming) -> Machine:
    """Return a machine that answers for ``plc`` on a full-duplex line."""
    def run(machine: Machine) -> Procedure:
        peer = FullDuplexPeer(
            machine, LinkSettings(station=None, checksum=checksum), ActiveStationList(), plc.serve)
        return peer.run(plc)

    return Machine(run, checksum=checksum, duplex=Duplex.FULL, timing=timing,
                   counters=plc.counters)


def _radio(plcs: Sequence[SimulatedPlc], checksum: Checksum, timing: LineTiming) -> Machine:
    """Return a machine that answers for all PLCs behind one radio modem."""
    def serve(command: Packet) -> Packet | None:
        replies = [plc.serve(command) for plc in plcs
                   if command.dst in (plc.station, BROADCAST) and not plc.faults.silent]
        return replies[0] if replies else None

    settings = LinkSettings(station=None, checksum=checksum, also=_Hearing(plcs))
    return Machine(
        lambda machine: RadioNode(machine, settings, ActiveStationList(), serve).run(plcs[0]),
        checksum=checksum, duplex=Duplex.RADIO, timing=timing, counters=plcs[0].counters)


def _converse(cast: Cast, script: TimedCommands, options: argparse.Namespace,
              ended: EndRequest) -> None:
    """Carry out commands when they are due, until it is time to end."""
    def carry_out(line: str) -> None:
        if line.strip() == 'quit':
            ended.set()
        elif line.strip():
            cast.carry_out(line)

    signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # otherwise a background process is stopped
    begin = time.monotonic()
    inputs = [sys.stdin.fileno()] if sys.stdin else []
    rest = b''
    while not ended.is_set() and (passed := time.monotonic() - begin) < options.seconds:
        while script and script[0][0] <= passed:
            carry_out(script.pop(0)[1])
        cast.advance()
        if select.select(inputs, [], [], _GLANCE)[0]:
            data = input_of(inputs[0])
            if data is None:
                time.sleep(_GLANCE)
                continue
            *lines, rest = (rest + data).split(b'\n')
            if not data:
                # input is closed; a signal or --seconds still ends the process
                lines, inputs = [rest], []
            for line in lines:
                carry_out(line.decode(errors='replace'))


def input_of(descriptor: int) -> bytes | None:
    """Return the typed text; None while the terminal belongs to another job."""
    try:
        return os.read(descriptor, 4096)
    except OSError:  # EIO: this process is in the background
        return None


if __name__ == '__main__':
    raise SystemExit(main())
