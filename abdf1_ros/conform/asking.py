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

"""Cases of the commands that a driver sends, in every discipline; our end answers them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.codec import Symbol
from abdf1_ros.conform.ends import AnsweringEnd, expect_limit, is_as_late, PATIENCE
from abdf1_ros.conform.wire import Failed, Skipped

_ASKING = (Target.MASTER, Target.CLIENT, Target.RADIO_CLIENT)
_ACKNOWLEDGED = (Target.MASTER, Target.CLIENT)

_MOST_COMMANDS = 5


@case('A command has DST, SRC, CMD, STS 00 and TNS, and the check covers what the manual says.',
      'M 5-2 to 5-7, 6-3', *_ASKING)
def command_form(end: AnsweringEnd) -> None:
    command = end.next_command()
    data = command.data
    if len(data) < codec.HEADER_SIZE or data[2] & codec.REPLY_BIT or data[3]:
        raise Failed('a command with STS 00', data.hex(' '))
    end.finish(command)


@case('A command is one that a PLC executes: not each has an error as reply.', 'M 8-2 to 8-4',
      *_ASKING)
def command_executed(end: AnsweringEnd) -> None:
    for _ in range(_MOST_COMMANDS):
        command = end.next_command()
        status = end.serve(command.data)[3]
        end.finish(command)
        if not status:
            return
    raise Failed('a command that the simulated PLC executes (for words that --data does not have '
                 'it sends an error, too)', f'{_MOST_COMMANDS} errors, the last STS {status:02X}')


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
    header = end.next_command().data[:codec.HEADER_SIZE]

    def comes() -> bool:
        with suppress(Failed):
            end.wire.until(lambda symbol: symbol.data[:codec.HEADER_SIZE] == header, '', PATIENCE)
            return True
        return False

    expect_limit('the command again', comes)


@case('A check byte of 10 is not doubled in a reply.', 'M 5-5', *_ASKING)
def check_not_doubled(end: AnsweringEnd) -> None:
    for _ in range(_MOST_COMMANDS):
        command = end.next_command()
        reply = end.serve(command.data)
        frames = [] if len(reply) < codec.HEADER_SIZE + 2 else [
            codec.message(reply[:-2] + value.to_bytes(2, 'little'), end.wire.check)
            for value in range(0x1000)]
        frame = next((frame for frame in frames
                      if codec.has_10_in_check(frame, end.wire.check)), None)
        if frame is not None:
            break
        end.finish(command)
    else:
        raise Skipped('not tried: no command reads a word')
    end.acknowledge(command)
    end.say(frame)
    end.expect_taken(command)


def _follows(end: AnsweringEnd, command: Symbol,
             answer: Callable[[Symbol], None]) -> tuple[float, Symbol]:
    """Answer a command; return the time (s) until the next command, and that command."""
    answer(command)
    begun = end.wire.now
    following = end.next_command('another command')
    return following.at - begun, following


def _uses(end: AnsweringEnd, answers: Iterable[Callable[[Symbol], None]]) -> Failed | None:
    """Give answers that are not replies; return how one of them was used, None if none was."""
    answered, command = _follows(end, end.next_command(), end.finish)
    unanswered, command = _follows(end, command, end.acknowledge)
    if is_as_late(answered, unanswered) or end.has_further:
        raise Skipped('not judged: the next command comes as soon after no reply as after a reply')
    for answer in answers:
        for _ in range(2):  # so that the target does not count us as inactive
            _, command = _follows(end, command, end.finish)
        took, command = _follows(end, command, answer)
        if took < (answered + unanswered) / 2:
            return Failed(f'no new command for {unanswered:.1f} s, as after no reply',
                          f'the next command after {took:.2f} s')
    end.finish(command)
    return None


def expect_not_used(end: AnsweringEnd, *answers: Callable[[Symbol], None]) -> None:
    """Give answers that are not replies: the next command must come as late as without a reply."""
    if failure := _uses(end, answers):
        raise failure


# No reply with another CMD: it may end the command as an error, and we cannot see that.
def _with_change(end: AnsweringEnd, at: int) -> Callable[[Symbol], None]:
    """Return an answer that gives the reply, with another byte in its header."""
    def answer(command: Symbol) -> None:
        reply = bytearray(end.serve(command.data))
        reply[at] ^= 0x05
        end.acknowledge(command)
        end.say(codec.message(bytes(reply), end.wire.check))
    return answer


@case('A reply with another TNS or DST is not that of the command.', 'M 6-3, 6-7', *_ACKNOWLEDGED)
def other_reply_ignored(end: AnsweringEnd) -> None:
    expect_not_used(end, *(_with_change(end, at) for at in (5, 4, 0)))


@case('A reply with another CMD is not used as that of the command.', 'M 6-3', *_ACKNOWLEDGED)
def other_code_not_used(end: AnsweringEnd) -> None:
    if _uses(end, [_with_change(end, 2)]) is None:
        return
    # An answer of a target that ends the command as a fault would look the same.
    end.finish(end.next_command())
    raise Skipped('not judged: the next command comes at once, so the target has used the reply '
                  'or ended the command as failed: look whether it shows a value')
