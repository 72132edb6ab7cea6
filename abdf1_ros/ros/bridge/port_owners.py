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

"""Which line of this process has which port."""

from __future__ import annotations

from abdf1_ros.ports.ownership import line_of
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.share import share_places


class PortOwners:
    """
    The ports of all lines: two masters on one line would disturb each other.

    So would two lines with one place for guests: a command would go to either PLC.
    The system refuses a device that is open, but neither the port of a device server nor a device
    that its line has left for a while.
    """

    def __init__(self) -> None:
        self._devices: dict[str, dict[str, str]] = {}

    def hold(self, owner: str, *names: str) -> None:
        """
        Let a line have these ports and places of Share, and no others any more; from any thread.

        Raises ConfigurationError, and leaves all as it was, where another line has one of them.
        """
        before, wanted = self._devices.get(owner, {}), {_line(name): name for name in names}
        # Ours are entered first, so that of two lines that want a port at once none or one has it.
        self._devices[owner] = wanted
        for other, held in [*self._devices.items()]:
            if other != owner and (taken := wanted.keys() & held.keys()):
                self._devices[owner] = before
                name = wanted[taken.pop()]
                kind = 'place' if _is_place(name) else 'port'
                raise ConfigurationError([Problem('port', f'{name} is the {kind} of {other}')])


def _is_place(name: str) -> bool:
    return name.startswith(('pty:', 'tcp:'))


def _line(name: str) -> str:
    where = name.partition('?')[0]
    return share_places(where)[0].line if _is_place(where) else line_of(where)
