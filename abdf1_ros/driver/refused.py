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

"""Commands of other nodes, such as the MSG of a PLC, that we have refused."""

from __future__ import annotations

from collections import Counter

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import RemoteError
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.status import check_status

# Greatest number of different commands that are kept. If a PLC has more, all have the same fault.
_MOST = 8

_LATELY = 60.0  # s


class RefusedCommands:
    """
    Refused commands, by a text with station, address and reason.

    Only the link thread adds commands; any thread may read them.
    """

    def __init__(self, plc_type: PlcType) -> None:
        self._meanings = FAMILIES[plc_type].meanings
        self._counts: Counter[str] = Counter()
        self._last: dict[str, float] = {}  # when each was refused last (clock value in s)

    def add(self, command: Packet, reply: Packet, now: float) -> None:
        """Keep a refused command, without the values that it would have written."""
        try:
            check_status(reply, self._meanings)
        except RemoteError as error:
            asked = describe(command).partition(' = ')[0]
            text = f'station {command.src}: {asked}: {error}'
            if text in self._last or len(self._last) < _MOST:
                self._counts[text] += 1
                self._last[text] = now

    def lately(self, now: float) -> list[str]:
        """Return the commands that were refused within the last minute."""
        return [text for text, last in [*self._last.items()] if now - last < _LATELY]

    def counted(self) -> dict[str, int]:
        """Return how often each command was refused."""
        return dict(self._counts)
