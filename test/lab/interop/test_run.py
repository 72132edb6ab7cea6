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

"""The programs of this folder still fit the package: an exchange with ourselves."""

from __future__ import annotations

import ast
from contextlib import ExitStack
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
import os
from pathlib import Path
import pty
import socket
import sys
import time
from types import ModuleType, SimpleNamespace
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, message_frame, NAK
from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.families import dialect_of
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.ptys import PATIENCE, read_exactly

_HERE = Path(__file__).resolve().parent


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return run.py, which looks for its own parts beside it."""
    monkeypatch.setattr(sys, 'path', list(sys.path))
    spec = spec_from_file_location('interop_run', _HERE / 'run.py')
    assert spec and spec.loader
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, 'interop_run', module)  # dataclasses look there
    spec.loader.exec_module(module)
    return module


class Client:
    """A client of our own on the line, in place of a product."""

    def __init__(self, module: ModuleType, setup: Any, port: str) -> None:
        self._codec_of = module.codec_of
        self._wanted = module.wanted
        self._family = setup.family
        self._dialect = dialect_of(setup.family)
        self._line = module.DuplexLine(port, setup.check, PATIENCE)
        self._tns = 0

    def read(self, case: Any) -> dict[str, Any]:
        address, codec = self._codec_of(case, self._family)
        data = self._execute(*self._dialect.read(address, codec.words))
        values = codec.decode(self._dialect.read_data(address, codec.words, data))
        return {'values': values if isinstance(values, str) else list(values)}

    def write(self, case: Any, values: Any) -> dict[str, Any]:
        if '/' in case.address:
            return {'cannot': 'bits'}
        address, codec = self._codec_of(case, self._family)
        data = codec.encode(self._wanted(values, codec.type))
        self._execute(*self._dialect.write(address, data))
        return {'done': True}

    def _execute(self, cmd: int, data: bytes) -> bytes:
        self._tns += 1
        reply: bytes = self._line.execute(bytes((cmd, 0)) + self._tns.to_bytes(2, 'little') + data)
        assert reply[1] == 0
        return reply[4:]

    def close(self) -> None:
        self._line.close()


def test_every_value_goes_to_and_fro(run: ModuleType) -> None:
    def start(setup: Any, port: str, stack: ExitStack) -> Client:
        return Client(run, setup, port)

    told = run.carry_out(run.Run('ourselves', PlcType.SLC, Checksum.BCC, 'plc', start), None)
    assert [entry for entry in told if not entry[2]] == []
    assert len(told) == len(run.CASES)


@pytest.mark.parametrize(('mode', 'far'), [('Peer', 'simulator'), ('Via', 'plain')])
def test_every_value_goes_through_an_ethernet_place(
        run: ModuleType, mode: str, far: str) -> None:
    entry, = (each for each in run.our_runs(None) if each.check is Checksum.CRC)
    end, = (each for each in run.FarEnd.known() if each.name == far)
    told = run.through_place(entry, mode, None, end)
    assert [entry for entry in told if not entry[2]] == []
    assert len(told) == len(run.CASES) + len(run.ETHERNET_CASES['SLC'])


def test_a_long_is_the_same_with_both_of_its_words_alone(run: ModuleType) -> None:
    assert run.same([-70000, 0x7FFFFFFF], [-70000, 0x7FFFFFFF])
    assert not run.same([0x10001], [1])
    assert run.same([-1, 1], [0xFFFF, 1])
    assert run.same([-16.0], [-16])


def test_lost_beats_and_rows_that_are_too_old_are_not_good(
        run: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = sys.modules['ours']
    now = [100.0]
    monkeypatch.setattr(ours, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    age = ours.RowAge(promised=1.5)
    for arrived, read in (100.5, 100.4), (101.8, 101.7):
        now[0] = arrived
        age.take(int(read * 1000) % 0x8000)
    assert age.seen == pytest.approx(1.4, abs=0.002)
    good = run.Tally(right=1, ours=1, beats=9, age=age)
    assert good.is_good and not replace(good, lost_beats=1).is_good
    now[0] = 103.3
    age.take(int(103.3 * 1000) % 0x8000)
    assert age.seen == pytest.approx(1.6, abs=0.002) and not good.is_good


def test_sessions_of_a_place_share_the_line_of_a_node_at_work(run: ModuleType) -> None:
    entry, = (each for each in run.our_runs(None) if each.check is Checksum.CRC)
    tally = run.crowd_at_place(entry, 'Peer', 3, 4.0)
    # the pause between two beats is that of the host, where it is busy
    assert replace(tally, longest_beat=0.0, age=None).is_good and tally.beats > 2, str(tally)
    assert tally.age.messages > 2 and tally.age.promised == pytest.approx(1.54, abs=0.1)
    assert tally.right >= 3 * 12 and tally.failures == 0


def test_two_guests_share_the_line_of_a_node_at_work(run: ModuleType) -> None:
    def start(setup: Any, port: str, stack: ExitStack) -> Client:
        return Client(run, setup, port)

    tally = run.share_line(
        run.Run('ourselves', PlcType.SLC, Checksum.CRC, 'plc', start), 'Master', 20)
    # the pause between two beats is that of the host, where it is busy
    assert replace(tally, longest_beat=0.0).is_good and tally.beats > 2, tally
    assert tally.right == 2 * 20 * 60


class LateGuest:
    """A guest, and its PLC: what it says is written comes ``delay`` reads of the PLC later."""

    def __init__(self, count: int, delay: int, add: int = 0) -> None:
        self._there, self._delay, self._add = [0] * count, delay, add
        self._coming: list[list[Any]] = []

    def write(self, case: Any, values: list[int]) -> dict[str, Any]:
        self._coming.append([self._delay, values])
        return {'done': True}

    def read(self, case: Any) -> dict[str, Any]:
        return {'values': [word + self._add for word in self.take(case, None)]}

    def take(self, case: Any, expected: object) -> list[int]:
        for entry in self._coming:
            entry[0] -= 1
        while self._coming and self._coming[0][0] < 0:
            self._there = self._coming.pop(0)[1]
        return self._there


@pytest.mark.parametrize('delay', range(7))
def test_a_late_write_of_a_guest_is_a_failure_and_no_wrong_value(
        run: ModuleType, monkeypatch: pytest.MonkeyPatch, delay: int) -> None:
    shared = sys.modules['shared']
    monkeypatch.setattr(shared, 'PATIENCE', 0.0)
    case = shared.Case('N7:0', [0.0] * 4, [])
    late = LateGuest(4, delay)
    counts = shared.work(late, case, late, 10)
    assert counts['wrong'] == 0 and counts['right'] // 4 + counts['failures'] == 10
    assert bool(counts['failures']) is bool(delay)
    mixed = LateGuest(4, 0, add=1)
    assert shared.work(mixed, case, mixed, 10) == {'wrong': 40}


def test_a_damaged_message_is_refused_and_the_shim_goes_on(run: ModuleType) -> None:
    ours, theirs = pty.openpty()
    line = run.DuplexLine(os.ttyname(theirs), Checksum.BCC)
    good = message_frame(b'\1\5\6\0\x34\x12\0', Checksum.BCC)
    os.write(ours, good[:-1] + bytes((good[-1] ^ 1,)) + good)
    end = time.monotonic() + 5
    assert line.receive(end) is None
    assert line.receive(end) == Packet.decode(b'\1\5\6\0\x34\x12\0')
    assert read_exactly(ours, 4) == NAK + ACK
    line.close()
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize('path', sorted((_HERE / 'players').glob('*.py')),
                         ids=lambda path: path.name)
def test_players_are_programs_that_need_nothing_of_this_package(path: Path) -> None:
    imported = {
        name.partition('.')[0] for node in ast.walk(ast.parse(path.read_text('utf-8')))
        for name in ([node.module or ''] if isinstance(node, ast.ImportFrom) else
                     [alias.name for alias in node.names] if isinstance(node, ast.Import) else [])}
    assert 'abdf1_ros' not in imported


def test_a_port_behind_tcp_passes_bytes_both_ways(run: ModuleType) -> None:
    ours, theirs = pty.openpty()
    with run.device_server(os.ttyname(theirs)) as number, \
            socket.create_connection(('127.0.0.1', number), timeout=5) as connection:
        connection.sendall(b'\x10\x02\x03\x04\r')
        assert read_exactly(ours, 5) == b'\x10\x02\x03\x04\r'
        os.write(ours, b'\x10\x06\x11\n')
        assert connection.recv(4) == b'\x10\x06\x11\n'
    for descriptor in (ours, theirs):
        os.close(descriptor)
