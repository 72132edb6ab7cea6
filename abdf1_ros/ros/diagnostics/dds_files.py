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
Find out whether the files of Fast DDS in /dev/shm are gone.

Fast DDS exchanges messages between processes of a host through these files, and a process keeps a
lock on each file that it has made. If another program removes the files, Fast DDS reports no
error. Programs that start later get no messages. After some seconds, connected programs get no
messages either. logind removes the files of a user at the last logout.
"""

from __future__ import annotations

from collections.abc import Callable
import os

_PERIOD = 5.0  # s between two looks: a look takes some 0.2 ms

# Locks on the process's own files; Fast DDS 2 calls them fastrtps_..., and 3 fastdds_...
_FIRST, _LAST = '/dev/shm/fast', '_el (deleted)'

LOST = ('the files of Fast DDS in /dev/shm are gone, so this node and other programs of this host '
        'do not hear each other. logind removes the files when a user logs out (RemoveIPC). Start '
        'all programs again')


def lost_locks() -> frozenset[str]:
    """Return the locks of this process whose files were removed."""
    folder = '/proc/self/fd'
    links = set()
    try:
        for name in os.listdir(folder):
            try:
                links.add(os.readlink(f'{folder}/{name}'))
            except OSError:
                continue  # closed since
    except OSError:
        return frozenset()  # a container without /proc
    return frozenset(link for link in links if link.startswith(_FIRST) and link.endswith(_LAST))


class DdsFiles:
    """
    The files of Fast DDS that this process has made; for one thread.

    If another process has treated a port as dead, Fast DDS makes the port anew. So a lock counts
    as lost only if two looks in a row find it lost.
    """

    def __init__(self, find: Callable[[], frozenset[str]] = lost_locks) -> None:
        self._find = find
        self._lost: frozenset[str] = frozenset()
        self._next_look = 0.0
        self.fault = ''

    def look(self, now: float) -> str:
        """Return the fault at the clock value ``now`` (s) as a text; empty if there is none."""
        if now >= self._next_look:
            self._next_look = now + _PERIOD
            before, self._lost = self._lost, self._find()
            self.fault = LOST if before & self._lost else ''
        return self.fault
