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

"""Peer against peer on a virtual line, both asking and both serving, clean and noisy."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming, Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.sender import Sender
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import CommandTimeout, StationInactive
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
import pytest
from support.peers import CommandTask, PeerNode
from support.virtual_line import char_time, Noise, QUIET, VirtualLine

BAUD = 19200
WORDS = 60
STATIONS = {5: PlcType.SLC, 1: PlcType.PLC5}
# The longest message, stuffed to the last byte, with the longest pause inside it.
LONGEST = 2 * 270 * char_time(BAUD) + 20 * char_time(BAUD) + 0.1
SETTINGS = LinkSettings(station=None, timeout=0.1, cmd_timeout=0.5)
PATIENT = LinkSettings(station=None, timeout=1.0, cmd_timeout=3.0)


class End(PeerNode):
    """One end: it asks the other at random and remembers what it has executed."""

    def __init__(self, rig: Rig, number: int, settings: LinkSettings) -> None:
        super().__init__(settings, lambda: rig.line.now, serve=self._answer,
                         timing=LineTiming(char_time(BAUD)))
        self.number = number
        self.table = DataTable(STATIONS[number])
        self.table.create(self.place(0), WORDS)
        self.executed: Counter[int] = Counter()
        self.replies: dict[int, Packet] = {}
        self.all: list[CommandTask] = []
        self._server = Server(self.table)
        self._random = rig.random
        self._tns = rig.random.randrange(0x10000)

    def place(self, offset: int) -> Address:
        """Return the address of a word of ours."""
        return parse_address(f'N7:{offset}', STATIONS[self.number])

    def _answer(self, command: Packet) -> Packet:
        reply = self._server.serve(command)
        self.executed[command.tns] += 1
        self.replies[command.tns] = reply
        return reply

    def ask(self, other: End, count: int) -> None:
        """Queue as many random reads and writes of the other end's words."""
        dialect = dialect_of(other.table.plc_type)
        for _ in range(count):
            start = other.place(self._random.randrange(WORDS - 20))
            words = self._random.randint(1, 20)
            kind = self._random.randrange(3)
            if kind == 0:
                cmd, body = dialect.read(start, words)
            elif kind == 1:
                cmd, body = dialect.write(start, bytes(
                    self._random.choice((0x00, 0x10, 0x55, 0xFF)) for _ in range(2 * words)))
            else:
                cmd, body = dialect.write_bits(
                    start, self._random.getrandbits(16), self._random.getrandbits(16))
            self._tns = self._tns + 1 & 0xFFFF
            self.all.append(self.add(Packet(other.number, self.number, cmd, 0, self._tns, body)))


class Rig:
    """Two ends and the line between them."""

    def __init__(self, settings: LinkSettings, *, noise: Noise = QUIET, chunk: int = 1,
                 seed: int = 1) -> None:
        self.random = Random(seed)
        self.ends = [End(self, number, settings) for number in STATIONS]
        self.line = VirtualLine(
            *(end.machine for end in self.ends), baud=BAUD, propagation=0.001, chunk=chunk,
            noise=noise, seed=seed)
        self.line.start()
        self.settings = settings

    def run(self, count: int) -> None:
        """Let both ends ask ``count`` times, until all of it has ended."""
        ours, theirs = self.ends
        ours.ask(theirs, count)
        theirs.ask(ours, count)
        for end in self.ends:
            self.line.wake(end.machine)
        for end in self.ends:
            for task in list(end.all):
                if task.result is None:
                    self.line.run(lambda task=task: task.result is not None, 10_000.0)

    def transfer_bound(self) -> float:
        """Return the longest time that a transfer may take, with what is heard out."""
        settings = self.settings
        waits = 1 + settings.nak_retries + 1 + settings.enq_retries + 1
        pauses = 0.25 * sum(range(settings.nak_retries))
        return waits * (settings.timeout + 2 * LONGEST) + pauses

    def bound(self) -> float:
        """Return the longest time of a task: its transfer, its reply's, and one in between."""
        return 2 * self.transfer_bound() + self.settings.cmd_timeout

    def both(self) -> list[tuple[End, End]]:
        """Return each end with the other one."""
        ours, theirs = self.ends
        return [(ours, theirs), (theirs, ours)]


def noise_of(rate: float) -> Noise:
    """Return noise of every kind."""
    return Noise(rate / 4, rate / 4, rate / 4, rate / 4)


def assert_exact(rig: Rig) -> None:
    """Check what must hold as long as the check finds every error."""
    for asking, serving in rig.both():
        sent = {task.command.tns: task.command for task in asking.all}
        assert set(serving.executed.values()) <= {1}
        for command in serving.served:
            assert command == sent[command.tns]
        for task in asking.all:
            if isinstance(task.result, Packet):
                assert task.result == serving.replies[task.command.tns]
            else:
                assert isinstance(task.result, (CommandTimeout, StationInactive))


def assert_bounded(rig: Rig) -> None:
    """Check that everything has ended in time, and no more was outstanding than allowed."""
    for end in rig.ends:
        assert all(task.result is not None for task in end.all)
        assert max(task.seconds for task in end.all) <= rig.bound()
        assert end.most_outstanding <= end.settings.max_outstanding


def assert_recovers(rig: Rig) -> None:
    """Check that all is well as soon as the line is quiet."""
    rig.line.run_for(2 * rig.bound())  # also for replies that nobody acknowledged
    rig.line.noise = QUIET
    rig.line.run_for(1.0)
    for asking, serving in rig.both():
        cmd, body = dialect_of(serving.table.plc_type).read(serving.place(0), 20)
        tns = asking.all[-1].command.tns + 1 & 0xFFFF
        task = asking.add(Packet(serving.number, asking.number, cmd, 0, tns, body))
        rig.line.wake(asking.machine)
        rig.line.run(lambda task=task: task.result is not None, rig.bound())
        assert isinstance(task.result, Packet)
        data = dialect_of(serving.table.plc_type).read_data(serving.place(0), 20, task.result.data)
        assert data == serving.table.read(serving.place(0), 20)
        assert asking.stations[serving.number].active


def test_reflexes_change_nothing_on_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    send, seen = Machine.data_to_send, []
    for react in Sender.react, lambda sender, reflex, symbol: None:
        sent: list[bytes] = []
        monkeypatch.setattr(Sender, 'react', react)
        monkeypatch.setattr(Machine, 'data_to_send', lambda machine, sent=sent:
                            sent.append(send(machine)) or sent[-1])
        rig = Rig(SETTINGS, noise=Noise(*[0.001] * 4), chunk=8)
        rig.run(40)
        seen.append((list(filter(None, sent)), rig.line.now))
    assert seen[0] == seen[1]


@pytest.mark.parametrize('chunk', [1, 14])
@pytest.mark.parametrize('outstanding', [1, 3])
@pytest.mark.parametrize('checksum', Checksum)
def test_counters_of_both_ends_agree_on_a_clean_line(checksum: Checksum, outstanding: int,
                                                     chunk: int) -> None:
    rig = Rig(replace(PATIENT, checksum=checksum, max_outstanding=outstanding), chunk=chunk)
    rig.run(150)
    rig.line.run_for(5.0)
    assert_exact(rig)
    assert_bounded(rig)
    for one, other in rig.both():
        sent, received = one.machine.counters, other.machine.counters
        assert all(isinstance(task.result, Packet) for task in one.all)
        assert sent.commands_sent == received.commands_received == 150
        assert sent.replies_sent == received.replies_received == 150
        assert sent.messages_sent == received.messages_received == 300
        assert sent.acks_sent == received.acks_received == 300
        assert sent.chars_sent == received.chars_received
        assert set(one.counts()) == {
            'commands_sent', 'commands_received', 'replies_sent', 'replies_received',
            'messages_sent', 'messages_received', 'acks_sent', 'acks_received'}
        assert one.stations[other.number].replies == 150
        assert {number for number, *_ in one.numbers()} == {2523}


@pytest.mark.parametrize('outstanding', [1, 3])
def test_noise_costs_time_but_no_result_is_wrong(outstanding: int) -> None:
    rig = Rig(replace(SETTINGS, max_outstanding=outstanding), noise=noise_of(1e-2),
              seed=100 + outstanding)
    rig.run(300)
    assert_exact(rig)
    assert_bounded(rig)
    replied = sum(isinstance(task.result, Packet) for end in rig.ends for task in end.all)
    assert replied >= 300
    assert_recovers(rig)


@pytest.mark.parametrize('outstanding', [1, 3])
def test_commands_on_a_dead_line_end_as_inactive(outstanding: int) -> None:
    rig = Rig(replace(SETTINGS, max_outstanding=outstanding), noise=Noise(lost=1.0))
    rig.run(5)
    for end in rig.ends:
        assert all(isinstance(task.result, StationInactive) for task in end.all)
        assert end.changes == [(6 - end.number, False)]
        assert (end.served, end.counts()['messages_sent']) == ([], 5)
        # A whole cycle of ENQs for the first, none for the probes behind it.
        assert end.counts()['enq_retries'] == 3
    assert_recovers(rig)


def test_line_that_goes_and_comes_again() -> None:
    rig = Rig(replace(SETTINGS, max_outstanding=3))
    for _ in range(10):
        rig.run(10)
        rig.line.noise = Noise(lost=1.0)
        rig.run(2)
        rig.line.noise = QUIET
    assert_exact(rig)
    assert_recovers(rig)


def test_ack_that_waits_behind_a_long_message_is_awaited() -> None:
    rig = Rig(LinkSettings(station=None, timeout=0.02, cmd_timeout=1.0, enq_retries=0,
                           max_outstanding=3))
    rig.run(100)
    assert_exact(rig)
    for end in rig.ends:
        assert all(isinstance(task.result, Packet) for task in end.all)


def test_lost_frame_on_a_line_that_is_faster_than_set_costs_no_more_than_its_retries() -> None:
    rig = Rig(SETTINGS)
    rig.line.char_time = 0.0  # as a network: what is written is there
    rig.run(500)
    ours, theirs = rig.ends
    begun = rig.line.now
    rig.line.noise = Noise(lost=1.0)
    rig.run(1)
    assert rig.line.now - begun < rig.transfer_bound()


@pytest.mark.parametrize('checksum', Checksum)
@pytest.mark.parametrize('rate', [0.0, 1e-3, 1e-2])
def test_both_ends_embed_responses_once_one_does(rate: float, checksum: Checksum) -> None:
    rig = Rig(replace(SETTINGS, checksum=checksum, max_outstanding=3),
              noise=noise_of(rate) if rate else QUIET, seed=5)
    rig.line.run_for(0.2)
    for end in rig.ends:
        end.machine.sender.embeds = True
    rig.run(200)
    assert_bounded(rig)
    if rate == 0.0 or checksum is Checksum.CRC:
        assert_exact(rig)
    if rate == 0.0:
        assert all(end.counts().get('enq_retries') is None for end in rig.ends)
        assert sum(isinstance(task.result, Packet) for end in rig.ends for task in end.all) == 400
    assert_recovers(rig)
