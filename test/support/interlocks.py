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

"""Heartbeats and fallback values on a virtual line, for the tests of their rules."""

from collections.abc import Callable, Sequence
from functools import partial

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from support.driver_bench import DriverBench
from support.mappings import make_mapping

WORDS = ('N7:0', 'N10:0')  # of the PLC: a fallback, and a heartbeat
AFTER = 0.5
FALLBACK = Fallback((7,), int(AFTER * 1000))
START, TIMEOUT, RETURN, RUN, END = (
    f'fallback value written: {cause}' for cause in ('start', 'timeout', 'return', 'run', 'end'))


def beat_row(period: int = 200, requires: Sequence[str] = (), timeout: int | None = None,
             address: str = 'N10:0') -> Mapping:
    """Return a Heartbeat row."""
    return make_mapping(address, 'Heartbeat', tag='beat', period=period,
                        condition=While(tuple(requires), timeout) if requires else None)


def speed_row(fallback: Fallback | None = FALLBACK, address: str = 'N7:0', tag: str = 'speed',
              length: int = 1) -> Mapping:
    """Return a Write row with Fallback."""
    return make_mapping(address, 'Write', tag=tag, fallback=fallback, length=length)


class Cell:
    """A driver, a PLC whose writes are kept, and a ROS executor that can stand still."""

    def __init__(self, *rows: Mapping, polling: str = 'Message', start: bool = True,
                 run: float = 0.0, cmd_timeout: int = 500, **settings: object) -> None:
        self.bench = DriverBench(rows, network=Network(
            # Polled without a pause, a slow line shows the same with fewer polls.
            baud=115200 if polling == 'Message' else 19200, timeout=200, cmd_timeout=cmd_timeout,
            nak_retries=1, enq_retries=1, polling=polling),
            settings=DriverSettings(**settings), start=False)  # type: ignore
        self.plc = self.bench.plc(1, 'PLC5', ('N7:0', 200), ('N10:0', 20), ('N11:0', 20),
                                  ('B3:0', 4))
        self.plc.slave = HalfDuplexSlave(LinkSettings(station=1), self._serve)
        self.refused: set[str] = set()
        self.refusals = 0
        self.spared: int | None = None  # this value is taken all the same
        self.is_late = False  # commands are carried out, and no reply comes in time
        self.is_undelivered: Callable[[Packet], bool] = lambda command: False  # by a gateway
        self.writes: list[tuple[float, str, int]] = []
        self.bench.breathe()
        if start:
            self.bench.open(run=run)

    @property
    def now(self) -> float:
        return self.bench.clock()

    def put_behind_gateway(self, run: float = 0.0) -> None:
        """Let station 7 answer for the PLC, and open the port; let so many seconds pass."""
        self.plc.slave, self.plc.station = HalfDuplexSlave(LinkSettings(station=7), self._serve), 7
        self.bench.open(run=run)

    def _serve(self, command: Packet) -> Packet:
        if self.is_undelivered(command):
            return command.reply(sts=0x02)
        before = self._words()
        is_spared = int.from_bytes(command.data[-2:], 'little') == self.spared
        if command.cmd == 0x0F and command.data[0] == 0x67 and not is_spared \
                and self.refused & self.named(command):
            self.refusals += 1
            return command.reply(sts=0x10)
        reply = self.plc.serve(command)
        if self.is_late:  # nobody waits for this one
            reply = reply._replace(tns=reply.tns ^ 0x8000)
        after = self._words()
        if command.cmd == 0x0F and command.data[0] == 0x67:
            for name in self.named(command):
                self.writes.append((self.now, name, after[name]))
        elif before != after:
            for name in after:
                if before[name] != after[name]:
                    self.writes.append((self.now, name, after[name]))
        return reply

    def named(self, command: Packet) -> set[str]:
        """Return the word that a typed write goes to."""
        files = {7: 'N7:0', 10: 'N10:0'}
        return {files[number] for number in files if bytes((6, number)) in command.data[:9]
                or bytes((7, 0, number)) in command.data[:10]}

    def _words(self) -> dict[str, int]:
        return {name: self.word(name) for name in WORDS}

    def word(self, text: str) -> int:
        return int.from_bytes(
            self.plc.table.read(parse_address(text, self.plc.table.plc_type), 1), 'little')

    def written(self, text: str, since: float = 0.0) -> list[int]:
        """Return what was written to a word."""
        return [value for when, name, value in self.writes if name == text and when >= since]

    def results(self) -> list[str]:
        """Return the results of writes."""
        return [str(result) for result in self.bench.listener.results]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.bench.run(seconds)

    def publish(self, row: Mapping, value: int, times: int = 1, gap: float = 0.1,
                run: float = 0.0) -> None:
        """Publish a value, so many times, while so many seconds pass."""
        for number in range(times):
            self.bench.at(self.now + number * gap, lambda: self.bench.write(row, [value]))
        if run:
            self.run(run)


def hold(cell: Cell, seconds: float, is_meant: Callable[[Packet], bool]) -> None:
    """Let a gateway say that a command was not delivered, and deliver it later."""
    serve = cell.plc.serve

    def keep(command: Packet) -> Packet:
        if not is_meant(command):
            return serve(command)
        cell.bench.at(cell.now + seconds, lambda: serve(command))
        return command.reply(sts=0x02)

    cell.plc.serve = keep  # type: ignore[method-assign]


class GuestCell(Cell):
    """A cell with a guest who writes there."""

    def __init__(self, *rows: Mapping, start: bool = True, run: float = 1.0,
                 polling: str = 'Message', cmd_timeout: int = 500) -> None:
        super().__init__(*rows, start=False, polling=polling, cmd_timeout=cmd_timeout)
        self.replies: list[int] = []
        if start:
            self.bench.open(run=run)

    def ask(self, text: str, value: int, dst: int = 1) -> None:
        """Let the guest write a word."""
        row = make_mapping(text, 'Write')
        cmd, data = row.dialect.write(row.address, value.to_bytes(2, 'little'))
        self.bench.driver.guests.put(GuestCommand(
            Guest('pty:hmi', ShareAccess.ALL), Packet(dst, 9, cmd, 0, 1, data), self.now,
            lambda reply: self.replies.append(reply.sts)))
        self.bench.line.wake(self.bench.driver.machine)

    def hold_guests(self, seconds: float) -> None:
        """Let a gateway keep the guest's 99."""
        hold(self, seconds, lambda command: command.data.endswith(b'\x63\0'))


def speed_cell() -> tuple[Cell, Mapping]:
    """Return a cell with one Write row, whose first fallback has been written, and the row."""
    speed = speed_row()
    return Cell(speed, run=1.0), speed


def end(cell: Cell, seconds: float = 2.0) -> None:
    """End in order: within so many seconds all has to be confirmed, and then the port closes."""
    driver = cell.bench.driver
    driver.kernel.end.wind_down()
    cell.bench.line.wake(driver.machine)
    give_up = cell.now + seconds
    while not driver.kernel.end.is_over:
        assert cell.now < give_up
        cell.run(0.005)
    assert not any(row.is_under_way for row in driver.kernel.rows.plc_of)
    cell.bench.lose_port()
    cell.run(2.0)


class Line(DriverBench):
    """PLCs of which some carry out what they are told and do not reply; who was asked for what."""

    def __init__(self, rows: Sequence[Mapping], stations: Sequence[int]) -> None:
        super().__init__(rows, network=Network(
            baud=115200, timeout=100, cmd_timeout=500, nak_retries=1, enq_retries=1))
        self.mute: set[int] = set()
        self.asked: list[tuple[float, int, int]] = []
        for number in stations:
            plc = self.plc(number, 'PLC5', ('N7:0', 40), ('N10:0', 4))
            plc.slave = HalfDuplexSlave(LinkSettings(station=number), partial(self._serve, plc))
        self.breathe()

    def _serve(self, plc: SimulatedPlc, command: Packet) -> Packet:
        reply = plc.serve(command)
        if command.cmd == 0x0F and command.data[0] == 0x67 and command.data[6] == 7:
            self.asked.append((self.clock(), plc.station, command.data[7]))
        if plc.station in self.mute:
            reply = reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for
        return reply
