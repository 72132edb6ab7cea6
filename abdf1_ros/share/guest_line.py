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

"""Places where guests connect: to the guest each is the PLC."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
from typing import Protocol

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming, Machine, MOST_LATE, Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand, GuestListener, GuestQueue
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.endpoints import Endpoint, PtyPlace, SerialEndpoint, TcpEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import SharePlace, station_of

# Poll interval (s) for new programs at a place; it also limits the error of a command's age.
_GLANCE = 0.1


class GuestPlace(Protocol):
    """A place of Share; ``guest`` has counted what its programs have sent."""

    guest: Guest

    @property
    def state(self) -> str:
        """Return the state of the place, as a text for users."""

    @property
    def fault(self) -> str:
        """Return why no program can connect; empty if a program can."""

    @property
    def waiting(self) -> int:
        """Return how many commands wait."""

    def start(self) -> None:
        """Wait for programs, and serve them; also after ``pause``."""

    def pause(self) -> None:
        """Close the place and disconnect its programs until the next ``start``."""

    def stop(self) -> None:
        """End the place."""


def guest_place(place: SharePlace, stations: Sequence[int], network: Network, queue: GuestQueue,
                wake: Callable[[], None], listener: GuestListener,
                fault: Callable[[Exception], None]) -> GuestPlace:
    """Return what serves a place, for a map with rows of these ``stations``."""
    if not place.is_ethernet:
        return GuestLine(place, network, queue, wake, listener, fault)
    from abdf1_ros.share.ethernet_place import EthernetPlace
    return EthernetPlace(
        place, station_of(place, stations), network, queue, wake, listener, fault)


class _Nothing(TaskSource):
    """We send no commands of our own to a guest."""


class GuestLine:
    """
    Put the commands of the guest at ``place`` into ``queue``, and send the replies to the guest.

    If a wait has lasted too long, this process or its host was paused, and the arrival time of a
    command is unknown. Then its earliest possible arrival time counts.

    - ``wake``: wakes the link of the PLC.
    - ``listener``: gets the actions of the guest.
    - ``fault``: gets internal errors.

    The guest's program may connect and disconnect at any time. A reply to a program that has
    disconnected is dropped.
    """

    def __init__(self, place: SharePlace, network: Network, queue: GuestQueue,
                 wake: Callable[[], None], listener: GuestListener,
                 fault: Callable[[Exception], None],
                 clock: Callable[[], float] = line_time) -> None:
        self.guest = Guest(place.text, ShareAccess(network.share_access), listener)
        self._place = place
        self._queue = queue
        self._wake = wake
        self._endpoint: Endpoint | None = None
        # No handshake: a device needs it for its own wiring, as a radio modem does.
        self._port = PortSettings(
            place.name, place.baud or network.baud, network.data_bits,
            place.parity or network.parity, network.stop_bits)
        checksum = place.check or network.checksum
        char_time = self._port.char_time if place.kind == 'serial' else 0.0
        self.machine = Machine(self._run, checksum=checksum, duplex=Duplex.FULL,
                               timing=LineTiming(char_time), senders_patience=math.inf)
        self._peer = FullDuplexPeer(
            self.machine, LinkSettings(station=None, checksum=checksum), ActiveStationList(),
            self._take)
        self.link = LinkThread(self.machine, self.open_port, on_state=self._changed,
                               on_fault=fault, retry_period=_GLANCE, longest_wait=_GLANCE,
                               clock=clock)
        self.link.daemon = True  # a guest never keeps the process alive

    @property
    def state(self) -> str:
        """Return the state of the place, as a text for users."""
        return self.link.state.text

    @property
    def fault(self) -> str:
        """Return why no program can connect; empty if a program can."""
        return self.link.fault

    @property
    def waiting(self) -> int:
        """Return how many commands wait."""
        return len(self.guest.waiting)

    def start(self) -> None:
        """Wait for the guest, and serve it; also after ``pause``."""
        self.link.begin()

    def pause(self) -> None:
        """Close the place and disconnect the guest until the next ``start``."""
        self.link.release()
        self._close()

    def stop(self) -> None:
        """End the place."""
        self.link.stop()
        self._close()

    def _close(self) -> None:
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None:
            endpoint.close()

    def _run(self, machine: Machine) -> Procedure:
        return self._peer.run(_Nothing())

    def _take(self, command: Packet) -> None:
        answer = partial(self._answer, self._peer.replies.append)
        requested, came_after = self.machine.now, self.link.came_after
        if requested - came_after > 2 * _GLANCE + MOST_LATE:
            requested = came_after
        self._queue.put(GuestCommand(self.guest, command, requested, answer))
        self._wake()

    def _answer(self, append: Callable[[Packet], None], reply: Packet) -> None:
        """Send a reply, in any thread; ``append`` has no effect after the guest has gone."""
        append(reply)
        self.link.wake()

    def open_port(self) -> Port:
        if self._endpoint is None:
            self._endpoint = self._made()
        return self._endpoint.open()

    def _made(self) -> Endpoint:
        place = self._place
        if place.kind == 'pty':
            return PtyPlace(place.name)
        if place.listens:
            return TcpEndpoint(place.host, place.port, self._turned_away, 0.0,
                               lambda: self.machine.counters.messages_received)
        return SerialEndpoint(self._port)

    def _turned_away(self, other: str) -> None:
        self.guest.listener.turned_away(
            self.guest, other, 'the place takes one program at a time')

    def _changed(self, state: PortState) -> None:
        self.guest.is_connected = state.is_open
