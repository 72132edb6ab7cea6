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

"""Cases for a half-duplex master, such as a driver; we are a slave that it talks to."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.conform.ends import PATIENCE, SlaveEnd
from abdf1_ros.conform.wire import expect_same, Failed

_MASTER = Target.MASTER
_COMMANDS = 4


@case('A poll is DLE ENQ, the station, and a BCC, on a line with CRC too.', 'M 5-3', _MASTER)
def poll_form(end: SlaveEnd) -> None:
    end.finish(end.next_command())


@case('A message without DLE ACK is sent again, with the same TNS.', 'M 3-13 to 3-15', _MASTER)
def no_ack_repeated(end: SlaveEnd) -> None:
    first = end.next_command()
    second = end.next_command('the message again')
    expect_same(first.data, second.data)
    end.finish(second)


@case('After DLE ACK the master polls for the reply.', 'M 3-13', _MASTER)
def polled_after_ack(end: SlaveEnd) -> None:
    command = end.next_command()
    end.finish(command)


def _polled_again(end: SlaveEnd, answer: Callable[[Symbol], bytes], what: str,
                  passed: tuple[SymbolKind, ...] = ()) -> Symbol:
    """
    Give ``answer`` to the poll for a reply, and expect another poll; return the command.

    A symbol of a kind that is ``passed`` may come before.

    A master with more than one command under way may send one first. Then the next is tried.
    """
    for _ in range(_COMMANDS):
        command = end.next_command()
        end.wire.send(codec.ACK)
        end.next_poll()
        end.wire.send(answer(command))
        symbol = end.wire.hear(PATIENCE)
        if symbol is not None and symbol.kind in passed:
            symbol = end.wire.hear(PATIENCE)
        if symbol is not None and symbol.station not in (None, end.station):
            symbol = end.next_visit(what)
        if symbol is not None and symbol.kind is SymbolKind.POLL and symbol.is_good:
            return command
        if symbol is None or not end.keeps(symbol):
            break
        end.next_poll()
        end.reply_and_hear(command)
    raise Failed(what, str(symbol or 'silence'))


@case('After DLE EOT the master polls again for a reply that is due.', 'M 3-13 to 3-15', _MASTER)
def eot_polled_again(end: SlaveEnd) -> None:
    command = _polled_again(end, lambda command: codec.EOT, 'another poll after DLE EOT')
    end.reply_and_hear(command)


@case('A poll that is not answered does not end the work of the master.', 'M 3-13 to 3-15',
      _MASTER)
def silent_poll_survived(end: SlaveEnd) -> None:
    command = end.next_command()
    end.wire.send(codec.ACK)
    end.next_poll()
    visit = end.next_visit('another poll, or a command')
    if visit.kind is SymbolKind.POLL:
        end.reply_and_hear(command)


@case('A reply that breaks off is asked for by another poll.', 'M 3-13 to 3-15', _MASTER)
def cut_reply_polled_again(end: SlaveEnd) -> None:
    def cut(command: Symbol) -> bytes:
        frame = codec.message(end.serve(command.data), end.wire.check)
        return frame[:len(frame) // 2]

    command = _polled_again(end, cut, 'another poll')
    end.reply_and_hear(command, 'DLE ACK for the good reply')


@case('A message of fewer than six bytes is not the reply: the master polls again.',
      'M 3-13 to 3-15, 4-4', _MASTER)
def short_reply_not_used(end: SlaveEnd) -> None:
    def short(command: Symbol) -> bytes:
        return codec.message(end.serve(command.data)[:codec.HEADER_SIZE - 1], end.wire.check)

    command = _polled_again(end, short, 'another poll', passed=(SymbolKind.ACK,))
    end.reply_and_hear(command, 'DLE ACK for the good reply')


@case('A reply with a wrong check is asked for by another poll; DLE NAK would reset the whole '
      'line.', 'M 3-14, 2-7', _MASTER)
def bad_reply_polled_again(end: SlaveEnd) -> None:
    for at in range(codec.CHECK_SIZES[end.wire.check]):
        def damaged(command: Symbol, at: int = at) -> bytes:
            frame = codec.message(end.serve(command.data), end.wire.check)
            return codec.all_damaged(frame, end.wire.check)[at]

        command = _polled_again(end, damaged, 'another poll')
        end.reply_and_hear(command, 'DLE ACK for the good reply')


@case('DLE NAK resets the whole line: a master does not send it with each command.',
      'M 2-7, 3-11', _MASTER)
def no_needless_reset(end: SlaveEnd) -> None:
    for _ in range(_COMMANDS):
        end.finish(end.next_command())
    resets = sum(isinstance(entry, Symbol) and entry.kind is SymbolKind.NAK
                 for entry in end.wire.transcript.entries)
    if resets > 1:
        raise Failed('no DLE NAK while all is answered', f'{resets} beside {_COMMANDS} commands')


@case('A reply that comes again, as after a lost DLE ACK, is acknowledged again.',
      'M 3-15', _MASTER)
def duplicate_acknowledged(end: SlaveEnd) -> None:
    command = end.next_command()
    end.finish(command)
    visit = end.next_visit('a poll or a command')
    if visit.kind is SymbolKind.MASTER_MESSAGE:
        end.wire.send(codec.ACK)
        end.next_poll()
    end.reply_and_hear(command, 'DLE ACK for a reply that came before')
    if visit.kind is SymbolKind.MASTER_MESSAGE:
        end.next_poll()
        end.reply_and_hear(visit, 'DLE ACK for the reply after it')


@case('A master listens for as long as an answer may take: it sends nothing while a reply comes '
      'in.', 'M 3-13 to 3-15', _MASTER)
def waits_for_slow_answer(end: SlaveEnd) -> None:
    command = end.next_command()
    end.wire.send(codec.ACK)
    end.next_poll()
    frame = codec.message(end.serve(command.data), end.wire.check)
    for at in range(0, len(frame), 4):
        end.wire.send(frame[at:at + 4])
        end.wire.rest(0.01)
    end.wire.expect(SymbolKind.ACK, 'DLE ACK for a reply that came in pieces')
