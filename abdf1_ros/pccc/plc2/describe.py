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

"""The commands of a PLC-2, in words."""

from __future__ import annotations

from abdf1_ros.pccc.notation import CommandCode, Effect, KnownCommand, words_text
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.plc2 import targets
from abdf1_ros.pccc.plc2.address import show_word
from abdf1_ros.text import counted


def _byte_address(address: int) -> str:
    # The octal word that a PLC-2 addresses; an SLC may count words in ADDR, not bytes.
    return f'{show_word(address // 2)} (ADDR {address})'


def _read(request: plc2.BasicRead) -> str:
    return f'{_byte_address(request.address)}, {counted(request.size, "byte")}'


def _write(request: plc2.BasicWrite) -> str:
    return f'{_byte_address(request.address)} = {words_text(request.data) or "nothing"}'


def _bit_write(request: plc2.BasicBitWrite) -> str:
    return ', '.join(
        f'{_byte_address(change.address)} {"high" if change.address % 2 else "low"} byte '
        f'set {change.set:02X} reset {change.reset:02X}' for change in request.changes)


DESCRIBED: dict[CommandCode, KnownCommand] = {
    (plc2.READ, None): KnownCommand(
        'unprotected read', Effect.READS,
        plc2.BasicRead.read, _read, lambda request, data: words_text(data),
        reach=targets.READ),
    (plc2.UNPROTECTED_WRITE, None): KnownCommand(
        'unprotected write', Effect.WRITES, plc2.BasicWrite.read, _write,
        reach=targets.WRITE),
    (plc2.PROTECTED_WRITE, None): KnownCommand(
        'protected write', Effect.WRITES, plc2.BasicWrite.read, _write,
        reach=targets.WRITE),
    (plc2.UNPROTECTED_BIT_WRITE, None): KnownCommand(
        'unprotected bit write', Effect.WRITES, plc2.BasicBitWrite.read, _bit_write,
        reach=targets.BIT_WRITE),
    (plc2.PROTECTED_BIT_WRITE, None): KnownCommand(
        'protected bit write', Effect.WRITES, plc2.BasicBitWrite.read, _bit_write,
        reach=targets.BIT_WRITE)}
