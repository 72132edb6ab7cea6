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

"""What a line loses by DLE NAK of its master: all slaves drop what they have queued (M 2-7)."""

from __future__ import annotations

from collections.abc import Iterable

from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import first


def lost_by_reset(network: Network, mappings: Iterable[Mapping]) -> list[str]:
    """Return what others miss after a DLE NAK; nothing where the line has one slave for us."""
    rows, found = Rows(mappings), []
    if not network.line_mode.is_master or network.line_mode.takes_turns:
        return []
    if len(rows.asked) > 1:
        found.append(f'messages of stations {first([*map(str, sorted(rows.asked))])}')
    if rows.served:
        found.append(f'messages of slaves for {first([row.tag for row in rows.served])}')
    if network.share:
        found.append('messages of stations that guests ask')
    return found
