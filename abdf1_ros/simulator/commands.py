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

"""The commands that the simulator accepts while it runs: faults, modes, counters, messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import re

from abdf1_ros.numbers import decimal_number, whole_number
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.ladder import Ladder
from abdf1_ros.simulator.simulated_plc import InjectedFaults, numbers, SimulatedPlc

COMMANDS = """\
commands, on standard input or with --at:
  silent STATION              the station stops answering
  full STATION                the station has no room for commands
  slow STATION POLLS          answer this number of polls with EOT before each reply
  delay STATION MS            answer polls with EOT for this time after each command
  noise STATION SHARE         damage this share of its characters (0.01 is 1 %)
  error STATION STS [EXT]     put this error into every reply (hexadecimal)
  normal STATION              end silent, full, slow, delay, noise or error
  mode STATION MODE           set the mode of the processor: run, program, remote (run), test
                              or fault; outside of run nothing moves, but the station answers
  program, test, run STATION  the same as mode STATION program, test, remote
  download STATION            load the program: words as at the start, mode program
  power STATION               switch power off and on
  scan STATION MS             set the scan time of its ladder (10 at the start)
  reset STATION               press the reset button of its ladder (--ladder)
  counters STATION            print the counters of its port
  msg STATION ADDRESS VALUE.. the PLC writes to the bridge (with --full-duplex)
  quit                        end the simulator
"""

_LONGEST = 3_600_000  # ms
_SCANS = 1, 1000  # ms

# Where a simulated PLC sends its messages: the default Station of a net CSV.
_BRIDGE_STATION = Network().station

# Faults that need polls, and faults that need a port of the PLC on the line.
_OF_POLLS = ('slow', 'delay')
_OF_PORT = (*_OF_POLLS, 'full', 'noise')

_MODES = {'program': Setting.PROGRAM, 'test': Setting.TEST, 'run': Setting.REMOTE}


def _ladder(plc: SimulatedPlc) -> Ladder:
    if plc.ladder is None:
        raise CommandError(f'station {plc.station} has no ladder; start with --ladder '
                           f'{plc.station}')
    plc.advance()
    return plc.ladder


def _set_scan_time(plc: SimulatedPlc, text: str) -> str:
    value = whole_number(text)
    low, high = _SCANS
    if value is None or not low <= value <= high:
        raise CommandError(
            f'scan {plc.station} {text}: "{text}" should be ms from {low} to {high}')
    _ladder(plc).scan_time = value / 1000
    return f'station {plc.station}: scan {value}'


_ACTIONS: dict[str, Callable[[SimulatedPlc], None]] = {
    'download': SimulatedPlc.download, 'power': SimulatedPlc.cycle_power,
    'reset': lambda plc: _ladder(plc).press_reset()}


class CommandError(Exception):
    """A text that is not a command; the message describes a right command."""


def execute(line: str, plcs: Sequence[SimulatedPlc],
            report: Callable[[str], None] = lambda text: None) -> str:
    """
    Carry out any command except "quit"; return a text about it, or raise CommandError.

    ``report`` gets the result of a message later.
    """
    verb, *words = line.split() or ['']
    plc, arguments = _station(words, plcs)
    with plc.lock:
        return _carry_out(line, verb, plc, arguments, report)


def _carry_out(line: str, verb: str, plc: SimulatedPlc, arguments: list[str],
               report: Callable[[str], None]) -> str:
    if verb == 'msg' and plc.processor.is_full_duplex and len(arguments) > 1:
        return _send(plc, arguments[0], arguments[1:], report)
    if verb == 'mode' and len(arguments) == 1:
        return _set_mode(plc, arguments[0])
    if verb == 'scan' and len(arguments) == 1:
        return _set_scan_time(plc, arguments[0])
    if verb in _MODES and not arguments:
        return _set_mode(plc, _MODES[verb].value)
    if verb in _ACTIONS and not arguments:
        _ACTIONS[verb](plc)
        return f'station {plc.station}: {verb}'
    if verb == 'counters' and not arguments:
        counts = plc.counters.by_mnemonic().items()
        return f'station {plc.station}: {" ".join(f"{name}={count}" for name, count in counts)}'
    faults = _faults(line, verb, arguments)
    _check_effect(plc, verb)
    plc.faults = faults
    return f'station {plc.station}: {" ".join([verb, *arguments])}'


def _check_effect(plc: SimulatedPlc, verb: str) -> None:
    """Raise CommandError for a fault that has no effect in the place of the PLC."""
    place, without_effect = (
        ('behind a radio modem', _OF_PORT) if plc.is_radio else
        ('on a full-duplex line', _OF_POLLS) if plc.processor.is_full_duplex else
        ('behind a gateway', _OF_PORT) if plc.via is not None else ('', ()))
    if verb in without_effect:
        raise CommandError(f'station {plc.station} is {place}, where "{verb}" has no effect')


def _faults(line: str, verb: str, arguments: list[str]) -> InjectedFaults:
    faults = InjectedFaults()
    try:
        if verb == 'silent' and not arguments:
            faults.silent = True
        elif verb == 'full' and not arguments:
            faults.full = True
        elif verb == 'slow' and len(arguments) == 1:
            faults.slow = _polls(arguments[0])
        elif verb == 'delay' and len(arguments) == 1:
            faults.delay = _decimal(arguments[0], 'ms', _LONGEST) / 1000
        elif verb == 'noise' and len(arguments) == 1:
            faults.noise = _decimal(arguments[0], 'a share', 1)
        elif verb == 'error' and len(arguments) in (1, 2):
            faults.status = tuple(map(_byte, arguments))
        elif verb != 'normal' or arguments:
            raise CommandError(f'"{line.strip()}" is not a command\n{COMMANDS.rstrip()}')
    except ValueError as error:
        raise CommandError(f'{line.strip()}: {error}') from None
    return faults


def _polls(text: str) -> int:
    value = whole_number(text)
    if value is None or value < 0:
        raise ValueError(f'"{text}" should be a whole number from 0')
    return value


def _decimal(text: str, what: str, high: float) -> float:
    value = decimal_number(text)
    if value is None or not 0 <= value <= high:
        raise ValueError(f'"{text}" should be {what} from 0 to {high:.0f}')
    return value


def _byte(text: str) -> int:
    if not re.fullmatch('[0-9A-Fa-f]{2}', text):
        raise ValueError(f'"{text}" should be a byte in hexadecimal such as 0B')
    return int(text, 16)


def _set_mode(plc: SimulatedPlc, text: str) -> str:
    try:
        plc.set_mode(Setting(text))
    except ValueError:
        known = ', '.join(setting.value for setting in Setting)
        raise CommandError(f'mode {plc.station} {text}: the modes are {known}') from None
    return f'station {plc.station}: mode {text}'


def _send(plc: SimulatedPlc, address: str, values: Sequence[str],
          report: Callable[[str], None]) -> str:
    try:
        place = parse_address(address, plc.table.plc_type)
        plc.send(place, numbers(values), _BRIDGE_STATION,
                 lambda outcome: report(f'station {plc.station}: msg {place} {outcome}'))
    except ValueError as error:
        raise CommandError(f'msg {address}: {error}') from None
    return f'station {plc.station}: msg {place} {" ".join(values)}'


def _station(arguments: list[str], plcs: Sequence[SimulatedPlc]) -> tuple[SimulatedPlc, list[str]]:
    for plc in plcs:
        if arguments and arguments[0] == str(plc.station):
            return plc, arguments[1:]
    known = ', '.join(str(plc.station) for plc in plcs)
    raise CommandError(f'name a station ({known})\n{COMMANDS.rstrip()}')
