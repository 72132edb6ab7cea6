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

"""The status ``guests``: programs that share the port."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, WARN
from abdf1_ros.share.guest_line import GuestPlace
from abdf1_ros.text import counted, milliseconds


class GuestsStatus:
    """Which places are open, and what their guests have sent."""

    name = 'guests'

    def __init__(self, lines: Sequence[GuestPlace], port: str) -> None:
        self.hardware_id = port
        self._lines = lines

    def judge(self, now: float) -> Judgement:
        guests = [line.guest for line in self._lines]
        connected = sum(guest.is_connected for guest in guests)
        notes = [f'{counted(count, what)} {why}' for count, what, why in (
            (sum(guest.refused for guest in guests), 'command', 'not allowed'),
            (sum(guest.outside for guest in guests), 'write', 'outside of limits'),
            (sum(guest.collisions for guest in guests), 'write', 'to words of this bridge'))
            if count]
        text = f'{connected} of {len(guests)} guests are connected'
        faults = [f'{line.guest.name}: {line.fault}' for line in self._lines if line.fault]
        if faults:
            return ERROR, '; '.join(faults)
        return (WARN, '; '.join([text, *notes])) if notes else (OK, text)

    def values(self, now: float) -> dict[str, str]:
        return {line.guest.name: (
            f'{line.state}; {counted(line.guest.commands, "command")}, '
            f'{line.guest.refused} not allowed, {line.guest.outside} outside of limits, '
            f'{line.guest.unanswered} without reply, '
            f'{line.waiting} waiting, '
            f'slowest {milliseconds(line.guest.slowest or None)}') for line in self._lines}
