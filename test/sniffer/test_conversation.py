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

"""Which reply belongs to which command, and what is said twice."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Direction
from abdf1_ros.sniffer.conversation import Conversation, Copies, MessageFacts
from abdf1_ros.sniffer.entries import Mark
import pytest

COMMAND = Packet(1, 5, 0x0F, 0, 7, b'\xa2')
REPLY = COMMAND.reply(b'\x01')


class Talk(Conversation):
    """A conversation between a master (out) and slaves (in)."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0

    def out(self, packet: Packet) -> MessageFacts:
        return self._say(packet, Direction.OUT, True)

    def back(self, packet: Packet) -> MessageFacts:
        return self._say(packet, Direction.IN, False)

    def _say(self, packet: Packet, direction: Direction, from_master: bool) -> MessageFacts:
        self.now += 0.5
        return self.take(packet, self.now, direction, from_master)


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_reply_finds_its_command(talk: Talk) -> None:
    assert talk.out(COMMAND) == MessageFacts()
    talk.out(Packet(2, 5, 0x0F, 0, 7))
    assert talk.back(REPLY) == MessageFacts(COMMAND, 1.0)
    assert [open_one.command.dst for open_one in talk.unanswered()] == [2]


def test_command_after_the_note_of_a_guest_is_the_guests(talk: Talk) -> None:
    talk.note_guest('0001 tcp:a')  # a command that the recording lacks
    talk.note_guest(f'{COMMAND.tns:04X} pty:/tmp/hmi')
    assert talk.out(Packet(2, 5, 0x0F, 0, COMMAND.tns + 1)).guest == ''
    assert talk.out(COMMAND).guest == 'pty:/tmp/hmi'
    assert talk.out(COMMAND) == MessageFacts(guest='pty:/tmp/hmi', marks=(Mark.RETRANSMISSION,))
    assert talk.back(REPLY).guest == 'pty:/tmp/hmi'
    # The TNS comes again, much later.
    assert talk.out(Packet(1, 5, 0x06, 0, COMMAND.tns, b'\x03')).guest == ''


def test_reply_to_nothing_and_to_another_command(talk: Talk) -> None:
    assert talk.back(REPLY).marks == (Mark.STRAY,)
    talk.out(COMMAND)
    assert [talk.back(Packet(5, 1, 0x46, 0, 7)).marks for _ in range(2)] == [
        (Mark.WRONG_COMMAND,), (Mark.RETRANSMISSION, Mark.WRONG_COMMAND)]
    assert len(talk.unanswered()) == 1


def test_again_without_ack_is_a_retransmission_with_ack_a_duplicate(talk: Talk) -> None:
    talk.out(COMMAND)
    assert talk.out(COMMAND).marks == (Mark.RETRANSMISSION,)
    talk.acknowledge(Direction.IN)
    assert talk.out(COMMAND).marks == (Mark.DUPLICATE,)
    assert talk.back(REPLY) == MessageFacts(COMMAND, 1.5)  # since it was said first
    assert talk.back(REPLY) == MessageFacts(COMMAND, None, (Mark.RETRANSMISSION,))
    talk.acknowledge(Direction.OUT)
    assert talk.back(REPLY) == MessageFacts(COMMAND, None, (Mark.DUPLICATE,))


def test_an_ack_is_for_what_went_the_other_way(talk: Talk) -> None:
    for dst in (2, COMMAND.dst, 3):
        talk.out(COMMAND._replace(dst=dst))
    talk.back(Packet(5, 2, 0x0F, 0, 7))
    talk.acknowledge(Direction.OUT)
    assert talk.out(COMMAND).marks == (Mark.RETRANSMISSION,)
    talk.acknowledge(Direction.IN)
    assert [talk.out(COMMAND).marks for _ in range(2)] == 2 * [(Mark.DUPLICATE,)]


def test_program_that_never_changes_its_tns(talk: Talk) -> None:
    for count in range(3):
        marks = (Mark.DUPLICATE,) if count else ()
        assert talk.out(COMMAND) == MessageFacts(marks=marks)
        talk.acknowledge(Direction.IN)
        assert talk.take(REPLY, talk.now, Direction.IN, False) == MessageFacts(COMMAND, 0.0, marks)
        talk.acknowledge(Direction.OUT)


def test_message_from_slave_to_slave_is_relayed(talk: Talk) -> None:
    command = Packet(7, 2, 0x0F, 0, 9)
    assert talk.back(command).marks == ()
    assert talk.out(command).marks == (Mark.RELAYED,)
    assert talk.back(command.reply()) == MessageFacts(command, 1.0)
    assert talk.out(command.reply()) == MessageFacts(command, None, (Mark.RELAYED,))
    assert talk.unanswered() == []
    assert talk.out(command._replace(tns=10)).marks == ()


def test_broadcast_has_no_reply(talk: Talk) -> None:
    talk.out(Packet(255, 5, 0x0F, 0, 7))
    assert talk.unanswered() == []


def test_another_recording_begins(talk: Talk) -> None:
    talk.now = 100.0
    talk.out(COMMAND)
    talk.out(Packet(2, 5, 0x0F, 0, 7))
    assert list(talk.expired(None)) == []  # a line without a time
    assert list(talk.expired(100.0)) == []  # the ports of a tap are not exactly together
    talk.now = 0.0
    assert talk.back(REPLY) == MessageFacts(COMMAND, None)
    assert [entry.command.dst for entry in talk.expired(talk.now)] == [2]
    assert talk.unanswered() == []


def test_tns_used_for_something_else_gives_the_first_command_up(talk: Talk) -> None:
    other, later = Packet(2, 5, 0x0F, 0, 8), COMMAND._replace(data=b'\xaa')
    for command in (COMMAND, other, later):
        talk.out(command)
    for now, given_up in ((talk.now, [COMMAND]), (talk.now, []), (talk.now + 9.7, [other])):
        assert [entry.command for entry in talk.expired(now)] == given_up
    assert [entry.command for entry in talk.unanswered()] == [later]
    assert talk.out(other).marks == (Mark.RETRANSMISSION,)
    assert talk.back(other.reply()) == MessageFacts(other, 0.5)  # since it came again
    talk.back(later.reply())
    talk.out(COMMAND)
    assert list(talk.expired(talk.now)) == []


def test_without_times_there_is_a_limit_too() -> None:
    talk = Conversation()
    given_up = []
    for tns in range(2000):
        talk.take(Packet(1, 5, 0x0F, 0, tns), None, Direction.UNKNOWN, True)
        given_up += [entry.command.tns for entry in talk.expired(None)]
    assert given_up == list(range(1000))
    assert len(talk.unanswered()) == 1000


def test_packet_that_was_sent_again_is_remembered_from_then_on() -> None:
    copies, again = Copies(), Packet(1, 5, 0x0F, 0, 7)
    marks = []
    for tns, time in ((100, 0.0), (200, 1.5), (300, 1.6)):
        marks.append(copies.mark(again, time, Direction.IN))
        for number in range(15):
            copies.mark(again._replace(tns=tns + number), time, Direction.IN)
    assert marks == [None, Mark.RETRANSMISSION, Mark.FORWARDED]
    assert [copies.mark(again._replace(tns=tns), 1.6, Direction.IN) for tns in (210, 209)] == [
        Mark.FORWARDED, None]  # too many since then
    assert copies.mark(again._replace(tns=314), -20.0, Direction.IN) is None  # another recording
    assert copies.mark(again._replace(tns=314), None, Direction.IN) is Mark.RETRANSMISSION
    copies = Copies()  # of a node that repeats its own message soon
    assert [copies.mark(again, time, way) for time, way in (
        (0.0, Direction.OUT), (0.5, Direction.OUT), (9.0, Direction.IN))] == [
            None, Mark.RETRANSMISSION, Mark.FORWARDED]
