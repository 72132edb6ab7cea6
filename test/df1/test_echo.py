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

"""What comes back of what we have sent is nobody's word, in every mode and at every delay."""

from dataclasses import replace
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, ENQ, EOT, master_frame, message_frame, NAK, poll_frame
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.errors import StationInactive
import pytest
from support.cases import for_all
from support.multidrop import MasterBench, MasterNode, SlaveBench
from support.peers import CommandTask, PeerBench, PeerNode, single_bytes
from support.virtual_line import char_time, VirtualLine

US, PLC = 5, 1
SETTINGS = LinkSettings(station=None, timeout=0.3, cmd_timeout=0.5)
COMMAND = Packet(PLC, US, 0x0F, 0, 0x1034, b'\x68\x10\x02\x10')
THEIRS = Packet(US, PLC, 0x0F, 0, 0x7710, b'\x67\x00\x01')


def commands(count: int, station: int = PLC) -> list[Packet]:
    """Return commands of ours, with every kind of bytes in them."""
    random = Random(station)
    return [Packet(station, US, random.choice((0x06, 0x0F)), 0, number,
                   random.randbytes(random.choice((1, 8, 200)))) for number in range(count)]


def run_alone(node: PeerNode | MasterNode, line: VirtualLine) -> list[CommandTask]:
    """Let a node send commands on a line that has nothing but an echo."""
    line.start()
    tasks = [node.add(command) for command in commands(6)]
    node.stations.add((PLC,))
    line.wake(node.machine)
    line.run(lambda: all(task.result is not None for task in tasks), 600.0)
    line.run_for(5.0)
    return tasks


@for_all('checksum', Checksum)
@for_all('delay', [0.0, 0.05, 0.29, 0.31, 1.0, 2.0])
@for_all('chunk', [1, 16, 1000])
def test_full_duplex_alone_with_its_echo_hears_nobody(
        checksum: Checksum, delay: float, chunk: int) -> None:
    node = PeerNode(replace(SETTINGS, checksum=checksum), lambda: line.now,
                    timing=LineTiming(char_time(19200)))
    line = VirtualLine(node.machine, propagation=delay, chunk=chunk)
    line.echoes = True
    assert all(isinstance(task.result, StationInactive) for task in run_alone(node, line))
    assert node.served == []
    assert node.stations[PLC].last_heard is None
    assert set(node.counts()) <= {
        'messages_sent', 'commands_sent', 'enq_retries', 'enq_limit_exceeded'}
    assert node.machine.echoes


@pytest.mark.parametrize('polling', [None, PollingSettings((PLC,))])
def test_master_alone_with_its_echo_hears_nobody(polling: PollingSettings | None) -> None:
    settings = LinkSettings(station=US, timeout=0.1, cmd_timeout=0.5)
    node = MasterNode(settings, lambda: line.now, polling, numbers=[PLC],
                      timing=LineTiming(char_time(19200)))
    line = VirtualLine(node.machine)
    line.echoes = True
    assert all(isinstance(task.result, StationInactive) for task in run_alone(node, line))
    assert (node.served, node.stations[PLC].last_heard) == ([], None)
    assert node.machine.echoes


def test_master_and_slaves_that_all_hear_themselves() -> None:
    bench = MasterBench(1, 2, settings=LinkSettings(station=US, timeout=0.1))
    bench.line.echoes = True
    bench.start()
    tasks = [bench.ask(number) for number in (1, 2) * 5]
    message = bench.message(1, US)
    bench.run(5.0)
    assert all(isinstance(task.result, Packet) for task in tasks)
    assert (len(bench[1].served), len(bench[2].served)) == (5, 5)
    assert (bench.master.served, len(bench[1].heard)) == ([message], 1)
    assert bench.master.machine.echoes and bench.far.echoes


def test_slave_passes_over_its_own_message_before_the_ack() -> None:
    bench = SlaveBench(LinkSettings(station=PLC))
    command = COMMAND._replace(data=b'\x68')
    assert bench.hear(master_frame(PLC, command.encode(), Checksum.CRC)) == ACK
    said = bench.hear(poll_frame(PLC))
    assert said == message_frame(command.reply().encode(), Checksum.CRC)
    assert bench.hear(said, ACK, poll_frame(PLC)) == EOT
    assert bench.counts()['acks_received'] == 1


# A PLC and an echo on the same full-duplex line


def behind_an_adapter(peer: PeerBench, said: bytes, *parts: bytes) -> bytes:
    """Let the peer hear itself, then others, and then what it answers to them."""
    answers = peer.hear(said, *parts)
    assert peer.hear(answers) == b''
    return answers


def test_full_duplex_plc_behind_an_adapter_that_echoes_is_heard_but_asks_in_vain() -> None:
    peer = PeerBench(SETTINGS)
    for number in range(3):
        command = COMMAND._replace(tns=number)
        task = peer.begin(command)
        said = bytearray(peer.said())
        said[-1] ^= number  # the check of an echo may be damaged
        assert behind_an_adapter(peer, bytes(said), ACK, peer.frame(command.reply())) == ACK
        assert behind_an_adapter(peer, b'', ENQ) == ACK
        assert (task.result, peer.machine.echoes) == (command.reply(), True)
    # It may be ours, with damage that no check shows.
    assert behind_an_adapter(peer, b'', peer.frame(THEIRS)) == NAK
    peer.start()
    assert (peer.served, peer.machine.echoes) == ([], False)


def test_echo_that_ends_is_forgotten_with_the_next_message() -> None:
    peer = PeerBench(SETTINGS)
    peer.begin(COMMAND)
    behind_an_adapter(peer, peer.said(), ACK, peer.frame(COMMAND.reply()))
    assert peer.hear(peer.frame(THEIRS)) == NAK  # this, too, does not come back
    peer.begin(COMMAND._replace(tns=2))
    peer.said()
    assert peer.machine.echoes
    peer.hear(ACK)
    assert not peer.machine.echoes
    assert peer.hear(peer.frame(COMMAND._replace(tns=2).reply())) == ACK
    assert peer.hear(peer.frame(THEIRS)).startswith(ACK)
    assert peer.served == [THEIRS]


def test_echo_is_forgotten_when_many_messages_do_not_come_back() -> None:
    peer = PeerBench(replace(SETTINGS, enq_retries=0))
    for number in range(10):
        peer.begin(COMMAND._replace(tns=number))
        said = peer.said()
        assert peer.hear(said if number == 0 else b'', peer.frame(COMMAND.reply())) == ACK
        peer.wait(1.0)
        assert peer.machine.echoes == (number < 8)


@pytest.mark.parametrize('size', [1, 1000])
def test_plc_with_our_station_number_asks_and_answers(size: int) -> None:
    peer = PeerBench(SETTINGS)
    for number in range(3):
        ours = Packet(US, US, 0x0F, 0, number, b'\x68\x10')
        theirs = ours._replace(data=b'\x67\x10')
        task = peer.begin(ours)
        peer.said()
        for heard in (ACK, peer.frame(theirs), peer.frame(ours.reply(b'\x01'))):
            peer.hear(*(single_bytes(heard) if size == 1 else [heard]))
        peer.hear(ACK)
        assert task.result == ours.reply(b'\x01')
    assert len(peer.served) == 3
    assert not peer.machine.echoes


def test_reply_that_equals_one_of_ours_ends_its_command() -> None:
    """Both ends have one number and count alike: their replies to writes are the same bytes."""
    peer = PeerBench(SETTINGS)
    theirs = Packet(US, US, 0x0F, 0, 0x77, b'\x67\x33')
    assert peer.hear(peer.frame(theirs)) == ACK + peer.frame(theirs.reply())
    peer.hear(ACK)
    task = peer.begin(theirs._replace(data=b'\x67\x44'))
    peer.said()
    assert peer.hear(ACK, peer.frame(theirs.reply())) == ACK
    assert task.result == theirs.reply()
    assert not peer.machine.echoes


def test_message_of_which_nobody_can_tell_whose_it_is_is_taken_when_it_comes_again() -> None:
    """It crosses an equal one of ours. Its sender asks for the response, and gets NAK."""
    peer = PeerBench(SETTINGS)
    ours = Packet(US, US, 0x0F, 0, 7, b'\x68\x10')
    peer.hear(peer.frame(ours._replace(tns=6)), ACK)
    task = peer.begin(ours)
    peer.said()
    assert peer.hear(peer.frame(ours)) == b''
    assert peer.hear(ENQ) == NAK
    assert peer.hear(ACK, peer.frame(ours.reply())) == ACK
    assert task.result == ours.reply()
    assert peer.machine.echoes
    for number in (8, 9):
        command = ours._replace(tns=number)
        task = peer.begin(command)
        peer.wait(0.1)
        peer.said()
        peer.hear(ACK, peer.frame(command.reply()))
        assert task.result == command.reply()
    assert not peer.machine.echoes
    assert peer.hear(peer.frame(ours)).startswith(ACK)
    assert peer.served[1:] == [ours]
