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

"""Cases of damaged messages, which slaves and radio modem nodes ignore alike."""

from __future__ import annotations

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Permission, Target
from abdf1_ros.conform.data import changes_nothing
from abdf1_ros.conform.ends import AskingEnd

_SILENT = (Target.SLAVE, Target.RADIO)
_SOURCE = 'KF2 4-31, SLC 13-76 to 13-80'


@case('A message with a wrong check is ignored: no slave sends DLE NAK.', _SOURCE, *_SILENT)
def bad_check_ignored(end: AskingEnd) -> None:
    for raw in codec.all_damaged(end.frame(end.command()), end.wire.check):
        end.wire.send(raw)
        end.expect_nothing('the check was wrong')


@case('A message with a wrong check is not executed.', f'{_SOURCE}, M 4-7 to 4-9',
      Target.PEER, *_SILENT, permission=Permission.WRITE)
def bad_check_not_executed(end: AskingEnd) -> None:
    changes_nothing(end, lambda command: end.wire.send(codec.damaged(end.frame(command))))


@case('A message of fewer than six bytes is ignored.', 'M 3-4, 4-4', *_SILENT)
def short_message_ignored(end: AskingEnd) -> None:
    end.send(end.command()[:5])
    end.expect_nothing('the message was shorter than its header')


@case('A message that breaks off leaves the station ready for the next one.', 'M 3-4', *_SILENT)
def broken_message(end: AskingEnd) -> None:
    def break_off() -> None:
        frame = end.frame(end.command(body=b'\x00abc'))
        end.wire.send(frame[:len(frame) // 2])
        end.wire.expect_silence('the message was not complete', 0.3)

    end.carry_out(end.command(), break_off)


@case('Bytes outside of a message do not spoil the next one.', 'M 3-4, 4-7 to 4-9',
      Target.PEER, *_SILENT)
def noise_before_message(end: AskingEnd) -> None:
    end.carry_out(end.command(), lambda: end.wire.send(b'\x55\x00\xFF\x03'))
