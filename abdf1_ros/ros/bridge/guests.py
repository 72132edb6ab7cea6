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

"""The places where other programs (guests) share the port of a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestListener
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.pccc.describe import command_name, describe
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.ros.diagnostics.log import LimitedLog
from abdf1_ros.ros.parameters.declared import Configuration
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.guest_line import guest_place
from abdf1_ros.text import first


class GuestPlaces(GuestListener):
    """A guest line for each place, and the log entries about its guest."""

    def __init__(self, configuration: Configuration, driver: Driver, opener: PortOpener,
                 notes: LimitedLog, wake: Callable[[], None]) -> None:
        self._driver = driver
        self._opener = opener
        self._notes = notes
        self._are_open = False
        network = configuration.network
        if configuration.parameters.read_only:
            network = replace(network, share_access='Read')
        self.lines = [guest_place(place, configuration.mappings.stations, network, driver.guests,
                                  wake, self, self._fault)
                      for place in share_places(network.share)]

    def start(self) -> None:
        """Let guests connect, unless the places are open already."""
        if not self._are_open:
            self._are_open = True
            for line in self.lines:
                line.start()

    def pause(self) -> None:
        """Close the places and disconnect the guests until the next ``start``."""
        if self._are_open:
            self._are_open = False
            for line in self.lines:
                line.pause()

    def stop(self) -> None:
        """Close the places and disconnect the guests."""
        for line in self.lines:
            line.stop()

    def sends(self, guest: Guest, command: Packet) -> None:
        """Write the name of the guest into the trace: its command is sent now."""
        self._opener.note_guest(guest.name, command)

    def turned_away(self, guest: Guest, other: str, why: str) -> None:
        """Log that one more program tried to use a place."""
        self._notes.warning(f'guest {guest.name}', (
            f'guest {guest.name}: another program, at {other}, was refused: {why}'))

    def wrote(self, guest: Guest, command: Packet, flight: Flight) -> None:
        """Log that a guest has sent a write to words that this bridge writes too."""
        rows = [row for row in self._driver.mappings if row.changes and flight.meets(row.extent)]
        if rows:
            guest.collisions += 1
            what = 'words of' if flight.extents is not None \
                else 'with unknown words, which may be those of'
            self._notes.warning(
                f'writes of {guest.name}', f'guest {guest.name} has sent to station '
                f'{flight.station}: {describe(command)}, {what} '
                f'{first([row.tag for row in rows])}')

    def goes_beyond(self, guest: Guest, command: Packet) -> None:
        """Log only the first command that is not for data."""
        if guest.beyond == 1:
            self._notes.warning(f'guest {guest.name}', (
                f'guest {guest.name}: first command that only Share_Access All allows: '
                f'{_meant(command)}'))

    def was_unanswered(self, guest: Guest, command: Packet, sts: int) -> None:
        """Log only the first command without a reply: a scan asks hundreds of stations."""
        if guest.unanswered == 1:
            self._notes.info(f'guest {guest.name}', (
                f'guest {guest.name} gets no reply from station {command.dst} to '
                f'{describe(command)}, but STS {sts:02X}; the status "guests" counts them all'))

    def was_refused(self, guest: Guest, command: Packet, needed: ShareAccess) -> None:
        """Log only the first command that is not allowed, and the first that needs All."""
        if guest.refused == 1 or needed is ShareAccess.ALL and guest.beyond == 1:
            self._notes.warning(f'guest {guest.name}', (
                f'guest {guest.name}: command refused: {_meant(command)}; it needs Share_Access '
                f'{needed.value}, and has {guest.access.value}'))

    def broke_limit(self, guest: Guest, command: Packet, limit: str) -> None:
        """Log only the first command whose values are outside of a limit."""
        if guest.outside == 1:
            self._notes.warning(f'guest {guest.name}', (
                f'guest {guest.name}: command refused: {_meant(command)}; {limit}'))

    def _fault(self, error: Exception) -> None:
        self._notes.error(
            'guests', f'internal error in the line of a guest: {error!r}; please report it')


def _meant(command: Packet) -> str:
    """Return a command in words, with its code and the station in it."""
    return f'{command_name(command)} to station {command.dst}, {describe(command)}'
