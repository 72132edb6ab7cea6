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

"""The ports that each line of this process uses."""

from __future__ import annotations

from abdf1_ros.ports.ownership import line_of
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.share import share_places


class PortOwners:
    """
    The ports and guest places of all lines; each may belong to one line only.

    Two masters on one port would disturb each other. If two lines had one guest place, a command
    might reach the wrong PLC. The operating system refuses to open a device twice. But it refuses
    neither the port of a device server nor a device that its line has released for a while.
    """

    def __init__(self) -> None:
        self._devices: dict[str, dict[str, str]] = {}

    def hold(self, owner: str, *names: str) -> None:
        """
        Let a line hold exactly these ports and places of Share; may be called in any thread.

        Raises ConfigurationError and changes nothing if another line holds one of them.
        """
        before, wanted = self._devices.get(owner, {}), {held_line(name): name for name in names}
        # Enter ours first: if two lines want a port at the same time, at most one line gets it.
        self._devices[owner] = wanted
        for other, held in [*self._devices.items()]:
            if other != owner and (taken := wanted.keys() & held.keys()):
                self._devices[owner] = before
                name = wanted[taken.pop()]
                kind = 'place' if _is_place(name) else 'port'
                raise ConfigurationError([Problem('port', f'{name} is the {kind} of {other}')])


def _is_place(name: str) -> bool:
    return name.startswith(('pty:', 'tcp:', 'eip:'))


def held_line(name: str) -> str:
    """Return the same text for all names of one port or place of Share."""
    where = name.partition('?')[0]
    return share_places(where)[0].line if _is_place(where) else line_of(where)
