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

"""The SLC commands, byte for byte."""

from collections.abc import Callable
from functools import partial

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.slc.commands import (
    LogicalAddress,
    LogicalRead,
    LogicalWrite,
    MaskedWrite,
    MAX_READ,
    MAX_WRITE,
)
import pytest
from support.cases import for_all
from support.vectors import commands, Vector

Command = LogicalRead | LogicalWrite | MaskedWrite

READERS: dict[int, Callable[[Reader], Command]] = {
    0xA1: partial(LogicalRead.read, is_short=True), 0xA2: LogicalRead.read,
    0xA9: partial(LogicalWrite.read, is_short=True), 0xAA: LogicalWrite.read,
    0xAB: MaskedWrite.read}


@pytest.mark.parametrize(('command', 'encoded'), [
    (LogicalRead(LogicalAddress(7, 0x89, 0, 0), 20), 'A2 14 07 89 00 00'),
    (LogicalRead(LogicalAddress(10, 0x89, 300, 0), 2), 'A2 02 0A 89 FF 2C 01 00'),
    (LogicalRead(LogicalAddress(255, 0x89, 254, 255), 255), 'A2 FF FF FF 00 89 FE FF FF 00'),
    (LogicalRead(LogicalAddress(7, 0x89, 1, None), 2), 'A1 02 07 89 01'),
    (LogicalWrite(LogicalAddress(7, 0x89, 300, None), b'\x09\x00'),
     'A9 02 07 89 FF 2C 01 09 00'),
    (LogicalWrite(LogicalAddress(4, 0x86, 0, 1), b'\x2C\x01'), 'AA 02 04 86 00 01 2C 01'),
    (MaskedWrite(LogicalAddress(3, 0x85, 4, 0), 0x0108, b'\x00\x01'),
     'AB 02 03 85 04 00 08 01 00 01'),
])
def test_encode_and_read(command: Command, encoded: str) -> None:
    data = bytes.fromhex(encoded)
    assert command.encode() == data
    reader = Reader(data[1:])
    assert READERS[data[0]](reader) == command
    assert reader.is_empty


@for_all('entry', commands(*READERS))
def test_command_of_every_vector(entry: Vector) -> None:
    data = entry.packet.data
    reader = Reader(data[1:])
    command = READERS[data[0]](reader)
    assert reader.is_empty
    assert command.encode() == data


@pytest.mark.parametrize(('fnc', 'encoded'), [
    (0xA1, '02 07 89'), (0xA1, '02 07 89 00 01'), (0xA9, '02 07 89 00 01'),
    (0xA9, '02 07 89 00 01 02 03'), (0xA2, ''), (0xA2, '02 07 89 00'),
    (0xA2, '02 07 89 00 00 01'), (0xA2, '02 07 89 FF 2C'),
    (0xAA, '02 07 89 00 00'), (0xAA, '02 07 89 00 00 01'), (0xAA, '02 07 89 00 00 01 02 03'),
    (0xAB, '02 07 89 00 00 08 00 08'), (0xAB, '04 07 89 00 00 08 00 08 00'),
    (0xAB, '02 07 89 00 00 08')])
def test_sizes_that_do_not_add_up(fnc: int, encoded: str) -> None:
    with pytest.raises(FormatError):
        READERS[fnc](Reader(bytes.fromhex(encoded)))


@pytest.mark.parametrize(('fnc', 'encoded'), [
    (0xA2, '02 07 89 00 00'), (0xAA, '02 07 89 00 00 01 02'),
    (0xAB, '02 07 89 00 00 08 00 08 00')])
def test_padding_behind_the_declared_size_is_passed_over(fnc: int, encoded: str) -> None:
    padded = READERS[fnc](Reader(bytes.fromhex(encoded + ' 00 00')))
    assert padded == READERS[fnc](Reader(bytes.fromhex(encoded)))


def test_limits_of_the_manual() -> None:
    assert (MAX_READ, MAX_WRITE) == (236, 234)
