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

"""The status ``standby``: a spare shows only this while another bridge has the line."""

from __future__ import annotations

import socket

from abdf1_ros.ros.diagnostics.line import LineView
from abdf1_ros.ros.diagnostics.link import changed_text
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, period_of, Seen, WARN


class StandbyStatus:
    """Why a spare waits, and whether its files have changed since it read them."""

    name = 'standby'

    def __init__(self, line: LineView, port: str, seen: Seen) -> None:
        self.hardware_id = port
        self._line = line
        self._seen = seen

    def judge(self, now: float) -> Judgement:
        link, seen = self._line.link, self._seen
        if seen.take_over_fault:
            return ERROR, f'has got the line on {socket.gethostname()}, but cannot offer its ' \
                f'topics and services: {seen.take_over_fault}'
        state = 'not started yet' if link is None else 'the port is open, and no station has ' \
            'answered' if link.state.is_open else link.state.text
        text = f'waits on {socket.gethostname()} for the line: {state}'
        if changed := changed_text(seen):
            return WARN, f'{text}; {changed}'
        return OK, text

    def values(self, now: float) -> dict[str, str]:
        return {'host': socket.gethostname(), **period_of(self._seen)}
