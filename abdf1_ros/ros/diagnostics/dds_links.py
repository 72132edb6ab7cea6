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
Find out whether the process began before its host had a network.

Fast DDS looks at the network links of the host once, when the process begins. If no link was up
then, programs on other hosts never hear the process, even after the network is up.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import fcntl
import os
import socket
import struct

_PERIOD = 5.0  # s between two looks

# Of Linux: requests of ioctl, their struct, and the flags of a link (linux/if.h, netdevice(7)).
_GET_ADDRESS, _GET_FLAGS = 0x8915, 0x8913
_REQUEST = struct.Struct('16sH14x8x')
_UP, _LOOPBACK, _RUNNING = 0x1, 0x8, 0x40

BEGAN_EARLY = ('this process began before its host had a network, so programs on other hosts do '
               'not hear it: start it again')


def has_network() -> bool:
    """Return True if a link other than loopback is up, has a carrier and an IPv4 address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        for _, name in socket.if_nameindex():
            request = _REQUEST.pack(name.encode()[:15], 0)
            with suppress(OSError):  # the link has gone, or has no address
                _, flags = _REQUEST.unpack(fcntl.ioctl(asker, _GET_FLAGS, request))
                fcntl.ioctl(asker, _GET_ADDRESS, request)
                if flags & (_UP | _LOOPBACK | _RUNNING) == _UP | _RUNNING:
                    return True
    return False


def stays_on_host() -> bool:
    """Return True if the environment keeps discovery on this host."""
    return os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', '').upper() in (
        'LOCALHOST', 'OFF') or os.environ.get('ROS_LOCALHOST_ONLY') == '1'


class DdsLinks:
    """The network links of the host when this process began, and now; for one thread."""

    def __init__(self, has_links: Callable[[], bool] = has_network) -> None:
        self._has_links = has_links
        self._may_be_early = not stays_on_host() and not has_links()
        self._next_look = 0.0
        self.fault = ''

    def look(self, now: float) -> str:
        """Return the fault at the clock value ``now`` (s) as a text; empty if there is none."""
        if self._may_be_early and not self.fault and now >= self._next_look:
            self._next_look = now + _PERIOD
            self.fault = BEGAN_EARLY if self._has_links() else ''
        return self.fault
