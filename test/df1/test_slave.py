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

"""Slaves that share a line; the rules of one of them are conversations (vectors/)."""

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, EOT, master_frame, message_frame, poll_frame
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop

COMMAND = Packet(dst=7, src=5, cmd=0x0F, sts=0, tns=0x0102, data=b'\xA2\x01')


class Line:
    """A machine of several slaves, which reply their number, and an STS where one is given."""

    def __init__(self, *numbers: int, sts: int = 0) -> None:
        self.served: list[int] = []
        self._sts = sts
        self.slaves = [HalfDuplexSlave(
            LinkSettings(station=number), lambda command, number=number: self._serve(
                command, number)) for number in numbers]
        self.machine = Machine(multidrop(self.slaves), checksum=Checksum.CRC)
        self.machine.start(0.0)

    def _serve(self, command: Packet, number: int) -> Packet:
        self.served.append(number)
        return self.reply(command, number)

    def reply(self, command: Packet, number: int) -> Packet:
        """Return what a slave replies."""
        return command.reply(bytes((number,)), self._sts)

    def say(self, data: bytes) -> bytes:
        """Put the master's bytes on the line; return what they answer."""
        self.machine.receive_data(data, 1.0)
        return self.machine.data_to_send()

    def send(self, command: Packet) -> bytes:
        """Send a command; return what they answer."""
        return self.say(master_frame(command.dst, command.encode(), Checksum.CRC))

    def frame(self, command: Packet) -> bytes:
        """Return the reply to a command as it stands on the line."""
        return message_frame(self.reply(command, command.dst).encode(), Checksum.CRC)


def test_only_the_addressed_station_answers() -> None:
    line = Line(1, 7, 8)
    assert line.send(COMMAND) == ACK
    assert line.say(poll_frame(8)) == EOT
    assert line.say(poll_frame(7)) == line.frame(COMMAND)
    assert line.say(poll_frame(9)) == b''
    assert line.machine.deadline is None


def test_ack_goes_to_the_station_that_spoke() -> None:
    line, other = Line(7, 8), COMMAND._replace(dst=8)
    assert (line.send(COMMAND), line.send(other)) == (ACK, ACK)
    assert line.say(poll_frame(7)) == line.frame(COMMAND)
    assert line.say(poll_frame(8)) == line.frame(other)
    assert line.say(ACK) == b''
    assert [slave.counters.acks_received for slave in line.slaves] == [1, 1]
    assert (line.say(poll_frame(7)), line.say(poll_frame(8))) == (line.frame(COMMAND), EOT)


def test_broadcast_reaches_every_station() -> None:
    line = Line(7, 8)
    assert line.send(COMMAND._replace(dst=BROADCAST)) == b''
    assert line.served == [7, 8]


def test_reply_with_an_error_is_counted_once() -> None:
    line = Line(7, sts=0x10)
    line.send(COMMAND)
    assert [line.say(poll_frame(7)) for _ in range(2)] == [line.frame(COMMAND)] * 2
    assert line.slaves[0].counters.error_messages_sent == 1


def test_withdraw_does_not_touch_replies() -> None:
    line = Line(7)
    line.send(COMMAND)
    line.say(poll_frame(7))
    line.slaves[0].withdraw()
    assert line.say(poll_frame(7)) == line.frame(COMMAND)
