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
Fuzz target: a driver in every mode, on a line whose other end says anything.

An input is a script. Its first byte chooses the mode; each action after it is two bytes, what
and how much, and the bytes that the action takes.
"""

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Frame, FrameDecoder, MAX_WAITING
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.values import Values
from abdf1_ros.settings.network import Network
from support.driver_bench import Recorder
from support.mappings import make_mapping

_US = 5
_NETWORKS = [
    Network(mode=mode, polling=polling, station=_US, error_code=check, timeout=50, baud=115200,
            tx_delay=delay, nak_retries=1, enq_retries=1, **radio)
    for mode, polling, radio in (
        ('Master', 'Message', {}), ('Master', 'Standard', {}), ('Peer', 'Message', {}),
        ('Slave', 'Message', {}), ('Radio', 'Message', {'store_forward': '1 2 255'}),
        ('Radio', 'Message', {'collision_avoidance': True}))
    for check in ('CRC', 'BCC') for delay in (0, 40)]
_MAPPINGS = [
    make_mapping('N7:0', 'ReadWrite', station=1, plc='PLC5', length=4, period=50),
    make_mapping('N7:0', 'ReadWrite', station=2, plc='SLC', length=6, period=50, item=2),
    make_mapping('ST9:0', 'ReadWrite', station=1, plc='PLC5', period=50, item=3),
    make_mapping('B3:0/3', 'ReadWrite', station=2, plc='SLC', length=20, period=50, item=4),
    make_mapping('N7:0', 'ReadWrite', station=1, kind='bcd16', period=50, item=5),
    make_mapping('N20:0', 'Serve', station=_US, length=5, period=1000, item=6)]
_MOST_TURNS = 20_000


class _Line:
    """The driver, and what its script makes of the line."""

    def __init__(self, network: Network) -> None:
        self.now = 0.0
        self.accepted = 0
        self.asked: list[Packet] = []  # by a guest
        self.answered: list[Packet] = []
        self._guest = Guest('a guest', ShareAccess.ALL)
        self.heard = Recorder(lambda: self.now)
        settings = DriverSettings(default_period=0.05, max_outstanding=2, poll_timeout=1.0)
        self.driver = Driver(network, _MAPPINGS, settings, self.heard)
        self._ears = FrameDecoder(network.checksum, network.duplex)
        self._last = Packet(1, _US, 0x0F, 0, 0)
        self._turns = 0
        self.driver.machine.start(self.now)
        self._collect()

    def say(self, data: bytes) -> None:
        """Let the driver hear bytes."""
        self.driver.machine.receive_data(data, self.now)
        self._settle()

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        machine = self.driver.machine
        while machine.deadline is not None and machine.deadline <= end:
            self.now = max(self.now, machine.deadline)
            machine.handle_timeout(self.now)
            self._collect()
        self.now = end

    def message(self, data: bytes) -> None:
        """Let it hear a good message that holds ``data``."""
        self.say(self._framed(data))

    def reply(self, sts: int, data: bytes) -> None:
        """Let it hear an answer to the last command, with all that has to come before it."""
        network = self.driver.network
        for frame in (frames.ACK, self._framed(self._last.reply(data, sts).encode())):
            self.say(frame)
            if network.mode == 'Master':
                self.wait(0.03)

    def write(self, number: int, value: int) -> None:
        """Ask for a write."""
        mapping = _MAPPINGS[number % len(_MAPPINGS)]
        values: Values = 'ab' if mapping.type.value == 'string' else [value % 2] * mapping.length
        self.accepted += 1
        self.driver.write([mapping], values, self.now)
        self.driver.machine.wake(self.now)
        self._settle()

    def ask(self, much: int, data: bytes) -> None:
        """Let a guest send a command."""
        command = Packet(much % 4, 9, data[0] & 0x3F if data else 0x0F, 0, len(self.asked),
                         data[1:])
        self.asked.append(command)
        self.driver.guests.put(GuestCommand(self._guest, command, self.now, self.answered.append))
        self.driver.machine.wake(self.now)
        self._settle()

    def lose(self) -> None:
        """Lose the port, and open it again."""
        self.driver.machine.stop(PortLost('unplugged'), self.now)
        self.driver.machine.start(self.now)
        self._settle()

    def end(self) -> None:
        """Lose the port for ever; then each write has had one result, each guest one reply."""
        self.driver.machine.stop(PortLost('unplugged'), self.now)
        assert len(self.heard.results) == self.accepted
        assert len(self.answered) == len(self.asked)
        for command in self.asked:
            reply, = (reply for reply in self.answered if reply.tns == command.tns)
            assert reply.answers(command)

    def _framed(self, data: bytes) -> bytes:
        network = self.driver.network
        if network.mode == 'Slave':
            return frames.master_frame(_US, data, network.checksum)
        return frames.message_frame(data, network.checksum)

    def _settle(self) -> None:
        self.driver.machine.handle_timeout(self.now)
        self._collect()

    def _collect(self) -> None:
        """Take what the driver sends, which has to be whole frames, and see what it keeps."""
        self._turns += 1
        assert self._turns < _MOST_TURNS, 'time does not pass'
        machine = self.driver.machine
        self._ears.feed(machine.data_to_send())
        while (symbol := self._ears.next_symbol()) is not None:
            if isinstance(symbol, Frame):
                assert symbol.fault is None
                packet = Packet.decode(symbol.data)
                self._last = self._last if packet.is_reply else packet
        assert len(self._ears.waiting) == 0 and not self._ears.in_message
        assert len(machine.receiver.decoder.waiting) <= MAX_WAITING
        assert not machine.sender.waiting


def one_input(data: bytes) -> None:
    """Carry out a script."""
    if not data:
        return
    line = _Line(_NETWORKS[data[0] % len(_NETWORKS)])
    at = 1
    while at + 2 <= len(data):
        what, much = data[at] % 8, data[at + 1]
        taken = data[at + 2:at + 2 + much]
        at += 2
        if what in (0, 1, 2, 3):
            at += len(taken)
        if data[at - 2] & 0x80 and what == 3:
            line.ask(much, taken)
        else:
            _ACTIONS[what](line, much, taken)
    line.wait(0.5)
    line.end()


def _serve(line: _Line, much: int, taken: bytes) -> None:
    """Let it hear a command for it, with a number of its own."""
    line.message(Packet(_US, 1, 0x0F, 0, much, taken).encode())


_ACTIONS = (
    lambda line, much, taken: line.say(taken),
    lambda line, much, taken: line.message(taken),
    lambda line, much, taken: line.reply(taken[0] if taken else 0, taken[1:]),
    _serve,
    lambda line, much, taken: line.wait(much / 100),
    lambda line, much, taken: line.write(much, much // 8),
    lambda line, much, taken: line.lose(),
    lambda line, much, taken: line.say(
        (frames.EOT, frames.ACK, frames.NAK, frames.ENQ, frames.poll_frame(_US))[much % 5]),
)
