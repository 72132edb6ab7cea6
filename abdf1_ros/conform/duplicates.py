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

"""
Cases of duplicate detection, which is the same for a half-duplex slave and a full-duplex node.

A message is a duplicate if it has the SRC, CMD and TNS of the message before it. Products have a
setting that turns detection off.
"""

from __future__ import annotations

from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.codec import SymbolKind
from abdf1_ros.conform.ends import AskingEnd
from abdf1_ros.conform.wire import Failed, Skipped

_ANSWERING = (Target.SLAVE, Target.PEER)
_EVERYBODY = (*_ANSWERING, Target.RADIO)
_SOURCE = 'M 3-4, 4-4, KF2 4-31'

_ECHO = b'\x00twice'
_OTHER_CMD = 0x0C  # a CMD that no PLC knows: the answer is STS 10 (M 8-2)


@case('A message with the header of the last one is acknowledged and discarded.',
      _SOURCE, *_ANSWERING)
def duplicate_discarded(end: AskingEnd) -> None:
    begun = end.wire.now
    command = end.command(body=_ECHO)
    end.carry_out(command)
    taken = end.wire.now - begun
    end.deliver(command)
    end.owed.clear()
    symbol = end.further(2 * taken + end.wire.answer_time)
    if symbol is not None and symbol.kind is SymbolKind.MESSAGE:
        end.taken(symbol)
        raise Skipped('two replies to a message sent twice: duplicate detection is off')
    if symbol is not None:
        raise Failed('DLE ACK, and nothing after it', str(symbol))


@case('A message with another TNS is not a duplicate.', _SOURCE, *_EVERYBODY)
def new_tns_executed(end: AskingEnd) -> None:
    for _ in range(2):
        end.carry_out(end.command(body=_ECHO))


@case('A message with the TNS of the last one and another CMD is not a duplicate.',
      _SOURCE, *_EVERYBODY)
def other_command_executed(end: AskingEnd) -> None:
    first = end.command(body=_ECHO)
    end.carry_out(first)
    end.carry_out(first[:2] + bytes((_OTHER_CMD,)) + first[3:6])


@case('A message with the TNS of the last one and another SRC is not a duplicate.',
      _SOURCE, *_EVERYBODY)
def other_source_executed(end: AskingEnd) -> None:
    first = end.command(body=_ECHO)
    end.carry_out(first)
    end.carry_out(first[:1] + bytes((end.another,)) + first[2:])


@case('A message with the header of the last but one is not a duplicate.', _SOURCE, *_ANSWERING)
def older_header_executed(end: AskingEnd) -> None:
    first = end.command(body=_ECHO)
    for command in (first, end.command(body=_ECHO), first):
        end.carry_out(command)
