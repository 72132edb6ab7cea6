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
Find out why other programs cannot hear this process.

Fast DDS exchanges messages between processes of a host through files in /dev/shm, and a process
keeps a lock on each file that it has made. If another program removes the files, Fast DDS reports
no error. Programs that start later get no messages. After some seconds, connected programs get no
messages either. logind removes the files of a user at the last logout.

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

_PERIOD = 5.0  # s between two looks: a look takes some 0.2 ms

# Locks on the process's own files; Fast DDS 2 calls them fastrtps_..., and 3 fastdds_...
_FIRST, _LAST = '/dev/shm/fast', '_el (deleted)'

# Of Linux: requests of ioctl, their struct, and the flags of a link (linux/if.h, netdevice(7)).
_GET_ADDRESS, _GET_FLAGS = 0x8915, 0x8913
_REQUEST = struct.Struct('16sH14x8x')
_UP, _LOOPBACK, _RUNNING = 0x1, 0x8, 0x40

LOST = ('the files of Fast DDS in /dev/shm are gone, so this node and other programs of this host '
        'do not hear each other. logind removes the files when a user logs out (RemoveIPC). Start '
        'all programs again')

BEGAN_EARLY = ('this process began before its host had a network, so programs on other hosts do '
               'not hear it: start it again')


def lost_locks() -> frozenset[str]:
    """Return the locks of this process whose files were removed."""
    folder = '/proc/self/fd'
    links = set()
    try:
        for name in os.listdir(folder):
            with suppress(OSError):  # closed since
                links.add(os.readlink(f'{folder}/{name}'))
    except OSError:
        return frozenset()  # a container without /proc
    return frozenset(link for link in links if link.startswith(_FIRST) and link.endswith(_LAST))


def has_network() -> bool:
    """Return True if a link other than loopback is up, has a carrier and an IPv4 address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        for _, name in socket.if_nameindex():
            request = _REQUEST.pack(name.encode(), 0)
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


class DdsWatch:
    """
    The files of Fast DDS that this process has made, and the links of its host; for one thread.

    If another process has treated a port as dead, Fast DDS makes the port anew. So a lock counts
    as lost only if two looks in a row find it lost. Links count only if there was none when this
    process began.
    """

    def __init__(self, find_lost: Callable[[], frozenset[str]] = lost_locks,
                 has_links: Callable[[], bool] = has_network) -> None:
        self._find_lost = find_lost
        self._has_links = has_links
        self._lost: frozenset[str] = frozenset()
        self._may_be_early = not stays_on_host() and not has_links()
        self._began_early = False
        self._next_look = 0.0
        self._fault = ''

    def look(self, now: float) -> str:
        """Return the fault at the clock value ``now`` (s) as a text; empty if there is none."""
        if now >= self._next_look:
            self._next_look = now + _PERIOD
            before, self._lost = self._lost, self._find_lost()
            self._began_early |= self._may_be_early and self._has_links()
            early = BEGAN_EARLY if self._began_early else ''
            self._fault = LOST if before & self._lost else early
        return self._fault
