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
_MOST_TO_COME_BACK = 20  # commands
_PROGRAM_MODE = b'\x70'  # STS: the processor is in program mode (M 8-3); it changes again


@case('A command has DST, SRC, CMD, STS 00 and TNS, and the check covers what the manual says.',
      'M 5-2 to 5-7, 6-3', *_ASKING)
def command_form(end: AnsweringEnd) -> None:
    try:
        command = end.next_command()
    except Skipped:
        if not end.wire.noise:
            raise
        raise Failed('a command', f'{end.wire.noise} bytes outside of any symbol') from None
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


def _read_of_a_word(end: AnsweringEnd) -> tuple[Symbol, bytes]:
    """Return a command that reads words, and the reply to it without the last word."""
    for _ in range(_MOST_COMMANDS):
        command = end.next_command()
        reply = end.serve(command.data)
        if len(reply) >= codec.HEADER_SIZE + 2:
            return command, reply[:-2]
        end.finish(command)
    raise Skipped('not tried: no command reads a word')


def _expect_taken(end: AnsweringEnd, command: Symbol, raw: bytes) -> None:
    """Send ``raw`` instead of the reply to a command, and expect that it is taken."""
    end.acknowledge(command)
    end.say(raw)
    end.expect_taken(command)


@case('A data byte 10 is doubled in a reply, and single in its value.', 'M 2-7, 5-4', *_ASKING)
def stuffing(end: AnsweringEnd) -> None:
    command, begun = _read_of_a_word(end)
    _expect_taken(end, command, codec.message(begun + b'\x10\x10', end.wire.check))


@case('A check byte of 10 is not doubled in a reply.', 'M 5-5', *_ASKING)
def check_not_doubled(end: AnsweringEnd) -> None:
    command, begun = _read_of_a_word(end)
    frames = (codec.message(begun + value.to_bytes(2, 'little'), end.wire.check)
              for value in range(0x10000))
    _expect_taken(end, command, next(
        frame for frame in frames if codec.has_10_in_check(frame, end.wire.check)))


@case('A reply with an error has six bytes, and is the reply.', 'M 6-3, 8-2', *_ASKING)
def error_taken(end: AnsweringEnd) -> None:
    command = end.next_command()
    header = end.serve(command.data)[:codec.HEADER_SIZE]
    _expect_taken(end, command, codec.message(
        header[:3] + _PROGRAM_MODE + header[4:], end.wire.check))


@case('Bytes outside of a message do not spoil the reply after them.', 'M 3-4, 4-7 to 4-9',
      *_ASKING)
def noise_before_reply(end: AnsweringEnd) -> None:
    command = end.next_command()
    _expect_taken(end, command, b'\x55\x00\xFF\x03' + codec.message(
        end.serve(command.data), end.wire.check))


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
    if end.has_further:
        raise Skipped('not judged: the next command comes before the reply to the last one')
    if is_as_late(answered, unanswered):
        raise Skipped('not judged: the next command comes as late after a reply as after none: '
                      'the target reads too seldom, or takes no reply')
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


def _with_change(end: AnsweringEnd, at: int) -> Callable[[Symbol], None]:
    """Return an answer that gives the reply, with another byte in its header."""
    def answer(command: Symbol) -> None:
        _say_changed(end, command, end.serve(command.data), at)
    return answer


def _say_changed(end: AnsweringEnd, command: Symbol, reply: bytes, at: int) -> None:
    end.acknowledge(command)
    changed = reply[:at] + bytes((reply[at] ^ 0x05,)) + reply[at:][1:]
    end.say(codec.message(changed, end.wire.check))


@case('A reply with another TNS or DST is not that of the command.', 'M 6-3, 6-7', *_ACKNOWLEDGED)
def other_reply_ignored(end: AnsweringEnd) -> None:
    expect_not_used(end, *(_with_change(end, at) for at in (5, 4, 0)))


@case('A reply with another CMD is not used as that of the command.', 'M 6-3', *_ASKING)
def other_code_not_used(end: AnsweringEnd) -> None:
    if _uses(end, [_with_change(end, 2)]) is None:
        return
    # It went on at once. Only words that come back show whether it has used the reply.
    end.finish(end.next_command())
    body = _read_that_comes_back(end)
    if not body:
        raise Skipped('not judged: the next command comes at once, be the reply used or refused; '
                      'look whether the target shows a value, or let it write what it reads')
    if _comes_back(end, body):
        raise Failed('no word of a reply with another CMD', 'a command that writes this word')


def _mark(number: int) -> bytes:
    """Return a word that is in no other place of a command."""
    return (2600 + number).to_bytes(2, 'little')


def _read_that_comes_back(end: AnsweringEnd) -> bytes:
    """Return what follows TNS in a read whose word a later command has; empty for none."""
    bodies: list[bytes] = []
    for _ in range(_MOST_TO_COME_BACK):
        command = end.next_command()
        body, reply = command.data[codec.HEADER_SIZE:], end.serve(command.data)
        back = [read for number, read in enumerate(bodies) if _mark(number) in body]
        if back:
            end.finish(command)
            return back[0]
        if len(reply) < codec.HEADER_SIZE + 2:
            end.finish(command)
            continue
        end.acknowledge(command)
        end.say(codec.message(reply[:-2] + _mark(len(bodies)), end.wire.check))
        bodies.append(body)
    return b''


def _comes_back(end: AnsweringEnd, body: bytes) -> bool:
    """Give a word to such a read in a reply with another CMD; tell whether it comes back."""
    mark, is_given = _mark(_MOST_TO_COME_BACK), False
    for _ in range(2 * _MOST_TO_COME_BACK):
        command = end.next_command()
        if mark in command.data[codec.HEADER_SIZE:]:
            end.finish(command)
            return True
        if is_given or command.data[codec.HEADER_SIZE:] != body:
            end.finish(command)
            continue
        _say_changed(end, command, end.serve(command.data)[:-2] + mark, 2)
        is_given = True
    if not is_given:
        raise Skipped('not judged: the read whose word came back does not come again')
    return False
