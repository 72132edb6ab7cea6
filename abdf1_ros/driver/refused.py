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
    Refused commands, by a text with station, address and reason; the last one is the latest.

    When there are too many, a new one takes the place of the oldest, but not of one that is shown
    still. Only the link thread adds commands; any thread may read them.
    """

    def __init__(self, plc_type: PlcType) -> None:
        self._meanings = FAMILIES[plc_type].meanings
        # How often each was refused, and when last (clock value in s). Replaced, never changed.
        self._refused: dict[str, tuple[int, float]] = {}

    def add(self, command: Packet, reply: Packet, now: float) -> None:
        """Keep a refused command, without the values that it would have written."""
        try:
            check_status(reply, self._meanings)
        except RemoteError as error:
            asked = describe(command).partition(' = ')[0]
            self._keep(f'station {command.src}: {asked}: {error}', now)

    def _keep(self, text: str, now: float) -> None:
        others = {**self._refused}
        count, _ = others.pop(text, (0, now))
        if len(others) == _MOST:
            oldest = next(iter(others))
            if oldest in self.lately(now):
                return
            del others[oldest]
        self._refused = {**others, text: (count + 1, now)}

    def lately(self, now: float) -> list[str]:
        """Return the commands that were refused within the last minute."""
        return [text for text, (_, last) in self._refused.items() if now - last < _LATELY]

    def counted(self) -> dict[str, int]:
        """Return how often each command was refused."""
        return {text: count for text, (count, _) in self._refused.items()}
