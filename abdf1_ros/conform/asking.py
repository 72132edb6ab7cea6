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

"""Cases of the commands that a driver sends, in every discipline; we answer them."""

from __future__ import annotations

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.ends import AnsweringEnd, MOST_REPETITIONS, PATIENCE
from abdf1_ros.conform.wire import Failed, Skipped

_ASKING = (Target.MASTER, Target.CLIENT, Target.RADIO_CLIENT)

_REPLY_BIT = 0x40


@case('A command has DST, SRC, CMD, STS 00 and TNS, and the check covers what the manual says.',
      'M 5-2 to 5-7, 6-3', *_ASKING)
def command_form(end: AnsweringEnd) -> None:
    command = end.next_command()
    data = command.data
    if len(data) < codec.HEADER_SIZE or data[2] & _REPLY_BIT or data[3]:
        raise Failed('a command with STS 00', data.hex(' '))
    end.finish(command)


@case('Each new command has another TNS.', 'M 6-7', *_ASKING)
def tns_differs(end: AnsweringEnd) -> None:
    seen = []
    for _ in range(3):
        command = end.next_command()
        seen.append(command.data[4:6])
        end.finish(command)
    if len(set(seen)) < len(seen):
        raise Failed('three different TNS', ', '.join(tns.hex(' ') for tns in seen))


@case('A command that is never answered is given up.', 'M 3-13 to 3-15, SLC 13-76 to 13-80',
      Target.MASTER, Target.RADIO_CLIENT)
def repetitions_limited(end: AnsweringEnd) -> None:
    first = end.next_command()
    for _ in range(MOST_REPETITIONS):
        symbol = end.wire.hear(PATIENCE)
        if symbol is None or symbol.data != first.data:
            return
    raise Skipped(f'sent more than {MOST_REPETITIONS} times: a larger limit is set')
