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

"""Listening on a port, and between two."""

import math
import os
from pathlib import Path
import termios

from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.tap import is_pty, Tap
from abdf1_ros.sniffer.capture import Chunk, Direction
import pytest
from support.cases import for_all
from support.ptys import PATIENCE, Pty, read_exactly


def tap(*names: object) -> Tap:
    return Tap([str(name) for name in names], PortSettings(''))


def hear(listening: Tap, count: int) -> list[Chunk]:
    """Return chunks until they have ``count`` bytes, the bytes of one direction joined."""
    found: dict[Direction, bytes] = {}
    for chunk in listening.chunks(PATIENCE, PATIENCE, lambda: None):
        assert chunk.time is not None
        assert 0 <= chunk.time < PATIENCE
        found[chunk.direction] = found.get(chunk.direction, b'') + chunk.data
        if sum(map(len, found.values())) >= count:
            break
    return [Chunk(None, direction, data) for direction, data in found.items()]


def test_one_port_is_listened_to(ptys: list[Pty]) -> None:
    with Tap([str(ptys[0].name)], PortSettings('', 1200)) as listening:
        assert termios.tcgetattr(ptys[0].fileno())[4] == termios.B1200
        for said in (b'\x10\x04', b'\x10\x06'):
            ptys[0].write(said)
            assert hear(listening, 2) == [Chunk(None, Direction.UNKNOWN, said)]
    open_port(PortSettings(str(ptys[0].name))).close()  # it is free again


def test_everything_is_passed_on_both_ways(ptys: list[Pty]) -> None:
    one, other = ptys
    every = bytes(range(256))
    with tap(one.name, other.name) as listening:
        one.write(every)
        assert other.read(256) == every
        other.write(every[::-1])
        assert one.read(256) == every[::-1]
        assert hear(listening, 512) == [
            Chunk(None, Direction.OUT, every), Chunk(None, Direction.IN, every[::-1])]


def test_new_pseudo_terminal_takes_its_name_away(ptys: list[Pty], tmp_path: Path) -> None:
    name = tmp_path / 'new'
    with tap(f'pty:{name}', ptys[1].name) as listening:
        assert listening.names == [str(name), str(ptys[1].name)]
        descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)
        os.write(descriptor, b'\x10\x05')
        assert ptys[1].read(2) == b'\x10\x05'
        ptys[1].write(b'\x10\x04')
        assert read_exactly(descriptor, 2) == b'\x10\x04'
        os.close(descriptor)
    assert not name.is_symlink()


def test_port_that_cannot_be_opened(ptys: list[Pty], tmp_path: Path) -> None:
    first = tmp_path / 'first'
    with pytest.raises(OSError, match='No such file') as error:
        tap(f'pty:{first}', tmp_path / 'none')
    assert error.value.filename == str(tmp_path / 'none')
    assert not first.is_symlink()  # the first has been closed again


def test_lost_port_ends_it_with_an_error(ptys: list[Pty]) -> None:
    with tap(ptys[0].name, ptys[1].name) as listening:
        ptys[1].close()
        with pytest.raises(OSError, match='^(Input/output error|the other end has closed)'):
            list(listening.chunks(PATIENCE, PATIENCE, lambda: None))


def test_it_ends_when_told_or_when_the_time_is_up(ptys: list[Pty]) -> None:
    with tap(ptys[0].name) as listening:
        listening.stop()
        assert list(listening.chunks(math.inf, PATIENCE, lambda: None)) == []
        assert list(listening.chunks(0.01, math.inf, lambda: None)) == []


def test_silence_is_told(ptys: list[Pty]) -> None:
    told: list[int] = []
    with tap(ptys[0].name) as listening:
        def idle() -> None:
            told.append(1)
            if len(told) == 3:
                listening.stop()

        assert list(listening.chunks(PATIENCE, 0.01, idle)) == []
    assert len(told) == 3


@for_all(('name', 'expected'), [
    ('pty', True), ('pty:/tmp/x', True), ('/dev/ttyUSB0', False), ('socket://h:1', False),
    ('ptys', False)])
def test_word_pty_and_its_file_name_ask_for_a_pseudo_terminal(name: str, expected: bool) -> None:
    assert is_pty(name) is expected


def test_what_nothing_takes_is_passed_on_and_counted(
        ptys: list[Pty], monkeypatch: pytest.MonkeyPatch) -> None:
    """After Ctrl-S it was all kept, without a bound."""
    monkeypatch.setattr('abdf1_ros.ports.tap.MOST_WAITING', 3)
    with tap(ptys[0].name, ptys[1].name) as listening:
        for number in range(8):
            ptys[0].write(bytes([number]))
            assert ptys[1].read(1) == bytes([number])
        assert [listening.new_losses(), listening.new_losses()] == [5, 0]
        assert hear(listening, 3) == [Chunk(None, Direction.OUT, bytes([0, 1, 2]))]
