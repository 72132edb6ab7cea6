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
Show a PLC's time and its drift, or set it.

  plc clock 1 --net net.csv
  plc clock 1 --set --yes --net net.csv
"""

from __future__ import annotations

import argparse
from datetime import datetime, timedelta

from abdf1_ros.cli.plc import data
from abdf1_ros.cli.plc.asking import after_write, ask, check_type, failed, family_of
from abdf1_ros.cli.plc.options import add_plc_type, add_station
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.terminal import EXIT_FAILED, EXIT_UNKNOWN, EXIT_USAGE, is_wanted
from abdf1_ros.errors import Abdf1Error, FormatError
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.mapping import Command

# A larger difference right after a write means that the clock has not accepted the time.
_TAKEN = timedelta(seconds=3)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_station(parser)
    add_plc_type(parser)
    parser.add_argument('--set', action='store_true',
                        help="write this computer's local time into the PLC, after a question on "
                             'the terminal')
    parser.add_argument('--yes', action='store_true', help='set the clock without a question')


def run(options: argparse.Namespace) -> int:
    """Show the clock of the station, or set it."""
    return ask(options, _clock, writes=options.set)


def _clock(options: argparse.Namespace, session: Session) -> int:
    clock = Clock(session, options.station, *family_of(options, session))
    try:
        if not options.set:
            print(f'station {options.station}: {told(*clock.read())}')
            return 0
        if not options.yes and not is_wanted(
                f'set the clock of station {options.station} ({clock.address}) to '
                f"{datetime.now():%Y-%m-%d %H:%M:%S}, this computer's time"):
            complain('nothing was written; --yes writes')
            return EXIT_USAGE
        if status := clock.write():
            if status != EXIT_UNKNOWN:
                check_type(options, session, options.station)
            return status
        with after_write('written'):
            try:
                time, ahead = clock.read()
            except FormatError as error:  # the PLC has replaced what was written
                return failed(options, session, error, clock.address)
            print(f'station {options.station}: {told(time, ahead)}', flush=True)
            if abs(ahead) > _TAKEN:
                complain('the PLC confirmed the write, but its clock has not changed: these words '
                         'may be a copy of the clock; set the clock with the software of the PLC')
                return EXIT_FAILED
    except Abdf1Error as error:
        return failed(options, session, error, clock.address)
    return 0


class Clock:
    """
    Year, month, day, hour, minute and second of a station; FormatError if no clock is known.

    ``address``: address of the first word.
    """

    def __init__(self, session: Session, station: int, plc_type: PlcType,
                 processor: Processor | None) -> None:
        family = FAMILIES[plc_type]
        if not family.clock:
            raise FormatError(f'is a {family.addressing.title}, whose clock is not known')
        if processor is not None and not processor.has_clock:
            raise FormatError(_why_none(processor))
        self._session = session
        self._mapping = data.mapping_of(family.clock, {
            'Command': Command.READ_WRITE.value, 'Station': str(station), 'Length': '6',
            'Type': ValueType.UINT16.value, 'PLC_Type': plc_type.value})
        self.address = str(self._mapping.address)

    def read(self) -> tuple[datetime, timedelta]:
        """Return the PLC's time, and its lead over this computer's local time."""
        begun = datetime.now()
        values = data.read(self._session, self._mapping)
        ended = datetime.now()
        try:
            found = datetime(*values)
        except ValueError:
            raise FormatError(f'holds no date and time: {" ".join(map(str, values))}'
                              + ('' if any(values) else '; is its clock switched off?')) from None
        return found, found - (begun + (ended - begun) / 2)

    def write(self) -> int:
        """Set the clock to this computer's local time, to the second; return the exit status."""
        texts = [*map(str, datetime.now().timetuple()[:6])]
        return data.status_of(data.Writing(self._mapping, texts).carry_out(self._session))


def _why_none(processor: Processor) -> str:
    """Return the reason why S:37 to S:42 of a processor are not its clock."""
    if not processor.is_micrologix:
        return f'is an SLC {processor.value}, which has no clock'
    return (f'is a {processor.value}: S:37 to S:42 are the clock of an SLC 5/03, 5/04 or 5/05. '
            'The clock of a MicroLogix is its function file RTC, whose type code is not known; '
            'let the program copy it into an N file')


def told(time: datetime, ahead: timedelta) -> str:
    """Return a time and its drift as text."""
    seconds = round(ahead.total_seconds())
    if abs(seconds) <= 1:
        return f'{time}, as this computer'
    side = 'ahead of' if seconds > 0 else 'behind'
    return f'{time}, {timedelta(seconds=abs(seconds))} {side} this computer'
