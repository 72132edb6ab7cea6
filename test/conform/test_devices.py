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

"""The odd devices of the driver's tests as targets: right ones pass, wrong ones are found."""

from __future__ import annotations

import heapq
from itertools import count, cycle
import math

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import Target, Verdict
from abdf1_ros.conform.cases import CASES
from abdf1_ros.df1.machine import Machine
import pytest
from support.cases import long_unless
from support.conformance import failures, plc_of, results_of
from support.devices import Device, DEVICES, WRONG
from support.odd_device import OddDevice, Wiring

TARGETS = {'Message': Target.SLAVE, 'Peer': Target.PEER, 'Radio': Target.RADIO}
RUNS = list(zip(*zip(*[(device, mode) for device in DEVICES + WRONG for mode in device.modes
                       if mode in TARGETS]), cycle(('CRC', 'BCC'))))
TAKE_LONGEST = {'only_ack', 'low_byte_of_tns'}  # of message-based polling
TRIES = 9  # of a reply: devices hold some back
BYTE_TIME = 0.005  # s, where each byte comes by itself

# Of this PLC, its family, a line without CRC; then what some devices cannot be asked for.
NOT_HERE = {'address-forms', 'address-forms-agree', 'poll-stuffing', 'crc-covers-station'}
NOT_ASKED = {'loses_every_third_answer': {'other-ack-ignored'}, 'no_eot': {'poll-idle'}}


class DeviceLine:
    """A line with a device at its end."""

    def __init__(self, device: Device, machine: Machine) -> None:
        self.now = 0.0
        self._hear, self._say = device.filters()
        self._device, self._machine = device, machine
        self._events: list[tuple[float, int, bool, bytes]] = []
        self._number = count()
        self._unread: list[bytes] = []
        machine.start(0.0)

    def clock(self) -> float:
        return self.now

    def write(self, data: bytes) -> None:
        self._travel(data, to_device=True)
        self._pass(self.now)

    def read(self, timeout: float) -> bytes:
        """Let time pass until something has come, at most ``timeout`` s."""
        end = self.now + timeout
        while not self._unread and self._pass(end):
            pass
        if not self._unread:
            return b''
        if self._device.chunk == 1:
            self.now += BYTE_TIME
        return self._unread.pop(0)

    def _travel(self, data: bytes, *, to_device: bool) -> None:
        heapq.heappush(self._events, (
            self.now + self._device.propagation, next(self._number), to_device, data))

    def _pass(self, end: float) -> bool:
        """Carry out what is due up to ``end``; return False where that is nothing more."""
        if said := self._machine.data_to_send():
            self._travel(self._say(said), to_device=False)
        arrival = self._events[0][0] if self._events else math.inf
        deadline = self._machine.deadline
        due = min(arrival, math.inf if deadline is None else deadline)
        self.now = max(self.now, min(due, end))
        if due > end:
            return False
        if due < arrival:
            self._machine.handle_timeout(self.now)
            return True
        *_, to_device, data = heapq.heappop(self._events)
        if not to_device:
            size = self._device.chunk
            self._unread += [data[at:at + size] for at in range(0, len(data), size)]
        elif heard := self._hear(data):
            self._machine.receive_data(heard, self.now)
        return True


@pytest.mark.parametrize('device, mode, check', long_unless(
    lambda device, mode, _: mode != 'Message' or device.name not in TAKE_LONGEST, RUNS), ids=str)
def test_right_device_passes_and_wrong_one_fails_its_case(
        device: Device, mode: str, check: str) -> None:
    target = TARGETS[mode]
    line = DeviceLine(device, plc_of(target, check, nak_retries=TRIES))
    results = results_of(line, target, check)
    assert len(results) == sum(target in case.targets for case in CASES)
    assert line.now < 15 * 60
    verdicts = {result.case.name: result.verdict for result in results}
    if device.breaks:
        assert verdicts[device.breaks] is Verdict.FAIL
        return
    assert failures(results) == []
    assert {name for name, verdict in verdicts.items() if verdict is Verdict.SKIP} - NOT_HERE \
        == NOT_ASKED.get(device.name, set())


class OddLine:
    """A line with an odd device at its end, without time on the way."""

    def __init__(self, device: OddDevice) -> None:
        self.now = 0.0
        self._device, self._unread = device, b''

    def clock(self) -> float:
        return self.now

    def write(self, data: bytes) -> None:
        self._device.receive_data(data, self.now)
        self._unread += self._device.data_to_send()

    def read(self, timeout: float) -> bytes:
        """Return what has come, or let time pass."""
        data, self._unread = self._unread, b''
        if not data:
            self.now += timeout
        return data


def test_answer_of_unknown_symbols_is_not_silence() -> None:
    """Noise is passed over; DLE with a code that no symbol has is something that was said."""
    device = OddDevice(Wiring.HALF)
    device.say = lambda data: b'\x00' + data + b'\xff'
    line = OddLine(device)
    assert results_of(line, Target.SLAVE, 'CRC', only='poll-idle')[0].verdict is Verdict.PASS
    device.say = lambda data: b'\x10\x0f' if data == codec.EOT else data
    assert results_of(line, Target.SLAVE, 'CRC', only='poll-idle')[0].verdict is Verdict.FAIL
