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

By default all PLCs of the data file share a half-duplex multidrop line; with --full-duplex one
of them has a full-duplex line for itself, on which it can also send commands. The line is a
pseudo-terminal, a serial port, or a TCP port. While it runs, lines on standard input switch
faults on and off.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import math
import os
from pathlib import Path
import select
import signal
import socket
import sys
import threading
import time
import traceback
import tty

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Code, Control, Duplex, Frame, FrameDecoder, NAK
from abdf1_ros.df1.machine import LineTiming, Machine, Procedure
from abdf1_ros.df1.peer import FullDuplexPeer, PeerSettings
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.csv_table import whole_number
from abdf1_ros.driver.network import BAUD_RATES, Network
from abdf1_ros.errors import ConfigurationError
from abdf1_ros.paths import config_file
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.port import DescriptorPort, LinkThread, open_port, Port, PortState
from abdf1_ros.simulated_plc import Faults, load_plcs, numbers, SimulatedPlc
from abdf1_ros.terminal import drop_output, prepare_output, seconds_option

EXIT_FAULT = 1
EXIT_CONFIGURATION = 2

WAITING = 'waiting for a client'

# Where a simulated PLC sends its messages: the default Station of a net CSV.
BRIDGE_STATION = Network().station

_COMMANDS = """\
commands, on standard input or with --at:
  silent STATION              it stops answering
  full STATION                it has no room for commands
  slow STATION POLLS          so many polls get EOT before each reply
  delay STATION MS            polls get EOT until so many ms after each command
  noise STATION SHARE         so much of what it sends is damaged (0.01 is 1 %)
  error STATION STS [EXT]     every reply says this error (hexadecimal)
  normal STATION              it works again
  mode STATION MODE           its processor is in mode run, program, remote (run), test, or
                              has a fault
  counters STATION            say what its port has counted
  msg STATION ADDRESS VALUE.. it writes to the bridge (with --full-duplex)
  quit                        end the simulator

examples:
  simulator --pty /tmp/plc
  simulator --tcp 127.0.0.1:4001 --check BCC
  simulator --full-duplex 1 --pty /tmp/plc --at '3 msg 1 N7:50 11 22'
  simulator --pty /tmp/plc --at '5 silent 2' --at '10 normal 2'
"""


class CommandError(Exception):
    """A line that is no command; the text says what would be right."""


def execute(line: str, plcs: Sequence[SimulatedPlc], is_full_duplex: bool = False) -> str:
    """Carry out a command line; return what has been done, or raise CommandError."""
    verb, *words = line.split()
    plc, arguments = _station(words, plcs)
    if verb == 'msg' and is_full_duplex and len(arguments) > 1:
        return _send(plc, *arguments)
    if verb == 'mode' and len(arguments) == 1:
        return _set_mode(plc, arguments[0])
    if verb == 'counters' and not arguments:
        counts = plc.counters.by_mnemonic().items()
        return f'station {plc.station}: {" ".join(f"{name}={count}" for name, count in counts)}'
    plc.faults = _faults(line, verb, arguments, is_full_duplex)
    return f'station {plc.station}: {" ".join([verb, *arguments])}'


def _faults(line: str, verb: str, arguments: list[str], is_full_duplex: bool) -> Faults:
    faults = Faults()
    try:
        if verb == 'silent' and not arguments:
            faults.silent = True
        elif verb == 'full' and not arguments:
            faults.full = True
        elif verb == 'slow' and len(arguments) == 1 and not is_full_duplex:
            faults.slow = int(arguments[0])
        elif verb == 'delay' and len(arguments) == 1 and not is_full_duplex:
            faults.delay = float(arguments[0]) / 1000
        elif verb == 'noise' and len(arguments) == 1:
            faults.noise = float(arguments[0])
        elif verb == 'error' and len(arguments) in (1, 2):
            faults.status = tuple(bytes.fromhex(''.join(arguments)))
        elif verb != 'normal' or arguments:
            raise CommandError(f'"{line.strip()}" is no command\n{_COMMANDS}')
    except ValueError:
        raise CommandError(f'"{line.strip()}" has a number that is none') from None
    return faults


def _set_mode(plc: SimulatedPlc, text: str) -> str:
    try:
        plc.processor.setting = Setting(text)
    except ValueError:
        known = ', '.join(setting.value for setting in Setting)
        raise CommandError(f'mode {plc.station} {text}: the modes are {known}') from None
    return f'station {plc.station}: mode {text}'


def _send(plc: SimulatedPlc, address: str, *values: str) -> str:
    try:
        place = Address.parse(address, plc.table.plc_type)
        plc.send(place, numbers(values), BRIDGE_STATION,
                 lambda outcome: _say(f'station {plc.station}: msg {place} {outcome}'))
    except ValueError as error:
        raise CommandError(f'msg {address}: {error}') from None
    return f'station {plc.station}: msg {place} {" ".join(values)}'


def _station(arguments: list[str],
             plcs: Sequence[SimulatedPlc]) -> tuple[SimulatedPlc, list[str]]:
    for plc in plcs:
        if arguments and arguments[0] == str(plc.station):
            return plc, arguments[1:]
    known = ', '.join(str(plc.station) for plc in plcs)
    raise CommandError(f'name a station ({known})\n{_COMMANDS}')


class _FaultyPort:
    """The port of the one PLC on a full-duplex line, as good as its faults allow."""

    def __init__(self, port: Port, plc: SimulatedPlc, checksum: Checksum) -> None:
        self._port = port
        self._plc = plc
        self._decoder = FrameDecoder(checksum, Duplex.FULL)

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes; a silent PLC hears none, a full one only that there are messages."""
        data = self._port.read(timeout, wake)
        if self._plc.faults.full:
            self._refuse(data)
        return b'' if self._plc.faults.silent or self._plc.faults.full else data

    def _refuse(self, data: bytes) -> None:
        """Answer NAK to every message and every enquiry."""
        self._decoder.feed(data)
        while (symbol := self._decoder.next_symbol()) is not None:
            if isinstance(symbol, Frame) or symbol == Control(Code.ENQ):
                self.write(NAK)

    def write(self, data: bytes) -> None:
        """Send bytes, damaged or not at all."""
        if not self._plc.faults.silent:
            self._port.write(self._plc.damaged(data))

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class PtyLine:
    """A pseudo-terminal; ``link`` is a name for its other end."""

    def __init__(self, link: str | None) -> None:
        self._ours, self._theirs = os.openpty()
        # Open at both ends all the time, or a read fails whenever nobody is connected.
        tty.setraw(self._theirs)
        self.name = link or os.ttyname(self._theirs)
        self._link = Path(link) if link else None
        if self._link:
            if self._link.is_symlink():  # of an earlier run; anything else is not ours
                self._link.unlink()
            self._link.symlink_to(os.ttyname(self._theirs))

    def open(self) -> Port:
        """Return our end."""
        descriptor = os.dup(self._ours)
        return DescriptorPort(descriptor, lambda: os.close(descriptor))

    def close(self) -> None:
        """Take the line and its name away."""
        if self._link:
            self._link.unlink(missing_ok=True)
        os.close(self._ours)
        os.close(self._theirs)


class TcpLine:
    """A listening TCP port, "HOST:PORT"; one client at a time is the line."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(':')
        number = whole_number(port)
        if number is None or not 0 <= number <= 65535:
            raise ValueError(f'--tcp "{address}" should be HOST:PORT')
        self._listener = socket.create_server((host or '127.0.0.1', number))
        self._listener.settimeout(0.2)
        self.name = 'socket://{}:{}'.format(*self._listener.getsockname()[:2])

    def open(self) -> Port:
        """Return the connection of a client; OSError while there is none."""
        try:
            client, _ = self._listener.accept()
        except TimeoutError:
            raise OSError(WAITING) from None
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return DescriptorPort(client.fileno(), client.close)

    def close(self) -> None:
        """Stop listening."""
        self._listener.close()


class SerialLine:
    """A serial port, or anything that pyserial opens."""

    def __init__(self, name: str, network: Network) -> None:
        self.name = name
        self._network = network

    def open(self) -> Port:
        """Open the port."""
        return open_port(self._network, self.name)

    def close(self) -> None:
        """Do nothing: the link thread closes what it has opened."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Run until SIGINT, SIGTERM, "quit" or the end of --seconds.

    Returns 0, 2 for faulty files or options, 1 after internal errors.
    """
    prepare_output()
    options = _parse(args)
    try:
        script = sorted(map(_scheduled, options.at))
        plcs = _load(options)
        line = _open_line(options)
    except (CommandError, ConfigurationError, OSError, ValueError) as error:
        print(f'simulator: {error}', file=sys.stderr)
        return EXIT_CONFIGURATION
    link = _make_link(plcs, line, options)
    names = ', '.join(f'{plc.station} ({plc.table.plc_type.value})' for plc in plcs)
    _say(f'stations {names} on {line.name}, {options.check}')
    link.start()
    try:
        _converse(plcs, script, link, options)
    finally:  # the thread would keep the process alive
        link.stop()
        line.close()
    return EXIT_FAULT if link.has_failed else 0


def _load(options: argparse.Namespace) -> list[SimulatedPlc]:
    """Return the PLCs of the data file, or the one that has a line for itself."""
    plcs = load_plcs(options.data or str(config_file('simulator.csv')),
                     Checksum(options.check), time.monotonic)
    if options.full_duplex is None:
        return plcs
    for plc in plcs:
        if options.full_duplex == str(plc.station):
            return [plc]
    known = ', '.join(str(plc.station) for plc in plcs)
    raise CommandError(f'--full-duplex: name a station ({known})')


def _make_link(plcs: Sequence[SimulatedPlc], line: PtyLine | TcpLine | SerialLine,
               options: argparse.Namespace) -> LinkThread:
    """Return the thread that plays ``plcs`` on ``line``."""
    checksum = Checksum(options.check)
    machine = Machine(multidrop(plcs), checksum=checksum)
    open_line = line.open
    if options.full_duplex is not None:
        # Only a port has a speed of its own, for which the timers have to wait.
        timing = Network(baud=options.baud).timing if options.port else LineTiming()
        machine = _full_duplex(plcs[0], checksum, timing)

        def open_line() -> Port:
            return _FaultyPort(line.open(), plcs[0], checksum)

    return LinkThread(machine, open_line, on_state=_Announcer().announce,
                      on_fault=_print_fault)


class _Announcer:
    """Say what has become of the line, each state once."""

    def __init__(self) -> None:
        self._last = ''

    def announce(self, state: PortState) -> None:
        """Say it, unless it is what was said last or what is normal."""
        is_news = state.text != self._last and not state.is_open
        self._last = state.text
        if is_news and WAITING not in state.text:
            _say(state.text)


def _parse(args: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='simulator', description=__doc__, epilog=_COMMANDS,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', help='CSV of the data tables (default: config/simulator.csv)')
    line = parser.add_mutually_exclusive_group()
    line.add_argument('--pty', metavar='NAME', help='a pseudo-terminal of this name (default: '
                                                    'one with the name that is printed)')
    line.add_argument('--port', help='a serial port or a URL of pyserial')
    line.add_argument('--tcp', metavar='HOST:PORT', help='a TCP port to listen on')
    parser.add_argument('--full-duplex', metavar='STATION',
                        help='this PLC alone, on a full-duplex line')
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=9600,
                        help='of the serial port (default: %(default)s)')
    parser.add_argument('--check', choices=[check.value for check in Checksum],
                        default=Checksum.CRC.value, help='default: %(default)s')
    parser.add_argument('--at', metavar='"SECONDS COMMAND"', action='append', default=[],
                        help='a command to carry out after so many seconds; may be repeated')
    parser.add_argument('--seconds', type=seconds_option, default=math.inf,
                        help='end after so many seconds')
    return parser.parse_args(args)


def _scheduled(text: str) -> tuple[float, str]:
    seconds, _, command = text.partition(' ')
    try:
        return float(seconds), command
    except ValueError:
        raise ValueError(f'--at "{text}" should be seconds and a command') from None


def _open_line(options: argparse.Namespace) -> PtyLine | TcpLine | SerialLine:
    if options.tcp:
        return TcpLine(options.tcp)
    if options.port:
        return SerialLine(options.port, Network(baud=options.baud))
    return PtyLine(options.pty)


def _full_duplex(plc: SimulatedPlc, checksum: Checksum, timing: LineTiming) -> Machine:
    """Return a machine that is ``plc`` at the other end of a full-duplex line."""
    def run(machine: Machine) -> Procedure:
        peer = FullDuplexPeer(
            machine, PeerSettings(checksum), ActiveStationList(), plc.serve)
        return peer.run(plc)

    plc.be_full_duplex()
    return Machine(run, checksum=checksum, duplex=Duplex.FULL, timing=timing,
                   counters=plc.counters)


def _converse(plcs: Sequence[SimulatedPlc], script: list[tuple[float, str]], link: LinkThread,
              options: argparse.Namespace) -> None:
    """Carry out commands as they come, until it is time to end."""
    def carry_out(line: str) -> None:
        if line.strip() == 'quit':
            ended.set()
        elif line.strip():
            try:
                _say(execute(line, plcs, options.full_duplex is not None))
            except CommandError as error:
                _say(str(error))
            link.wake()

    ended = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    begin = time.monotonic()
    inputs = [sys.stdin.fileno()] if sys.stdin else []
    rest = b''
    while not ended.is_set() and (passed := time.monotonic() - begin) < options.seconds:
        while script and script[0][0] <= passed:
            carry_out(script.pop(0)[1])
        if select.select(inputs, [], [], 0.05)[0]:
            data = os.read(inputs[0], 4096)
            *lines, rest = (rest + data).split(b'\n')
            if not data:
                lines, inputs = [rest], []  # closed; signals and --seconds still end us
            for line in lines:
                carry_out(line.decode(errors='replace'))


def _say(text: str) -> None:
    try:
        print(f'simulator: {text}', flush=True)
    except OSError:  # nobody reads it any more; the PLCs go on
        drop_output()


def _print_fault(error: Exception) -> None:
    traceback.print_exception(error)


if __name__ == '__main__':
    sys.exit(main())
