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

"""Nothing that was published before a device server lets us through reaches the line (rule 26)."""

from collections.abc import Sequence

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.deaths import MODES
from support.driver_bench import DriverBench, Program, READ_N7
from support.mappings import make_mapping
from support.odd_device import frame, OddDevice, Wiring

NOT_HEARD = 'not written: not sent: nothing has been heard on this connection'
SAFE = 0
_WIRING = {'Peer': Wiring.FULL, 'Radio': Wiring.RADIO}
_BEGINNINGS = b'\x10\x01', b'\x10\x02', b'\x10\x05'  # of messages and polls


class Queue(DriverBench):
    """A driver at a device server that keeps what it sends while another client has the line."""

    def __init__(self, mode: str = 'Master', rows: Sequence[Mapping] | None = None,
                 share: str = '', *, is_open: bool = False) -> None:
        self.order = make_mapping('N7:0', 'Write', plc='SLC', tag='order')
        self.device = OddDevice(_WIRING.get(mode, Wiring.HALF))
        self.stored: list[tuple[float, bytes]] = []
        if not is_open:
            self.device.hear = self.keep
        super().__init__(
            [self.order, make_mapping('N9:0', plc='SLC', period=200)] if rows is None else rows,
            network=Network(station=200, baud=19200, timeout=100, cmd_timeout=500, nak_retries=1,
                            enq_retries=1, share=share,
                            **MODES[mode]),  # type: ignore[arg-type]
            settings=DriverSettings(may_store=True), far=self.device)

    def keep(self, data: bytes) -> bytes:
        self.stored.append((self.clock(), data))
        return b''

    def questions(self, since: float) -> int:
        """Return how many messages and polls have been kept since then."""
        data = b''.join(data for when, data in self.stored if when >= since)
        return sum(map(data.count, _BEGINNINGS))

    def let_through(self) -> None:
        """Give us the line, and first all that was kept."""
        self.device.hear = bytes
        self.device.receive_data(b''.join(data for _, data in self.stored), self.clock())

    def values_written(self) -> list[int]:
        """Return what writes of a word have brought to the device."""
        return [int.from_bytes(data[-2:], 'little') for data in self.device.executed
                if data[6:7] == b'\xAA']

    def results(self) -> list[str]:
        """Return the results of messages."""
        return [str(result) for result in self.listener.results]


@pytest.mark.parametrize('mode', MODES)
def test_message_from_before_a_take_over_never_reaches_the_line(mode: str) -> None:
    bench = Queue(mode)
    for number in range(45):
        bench.at(0.4 * number, lambda number=number: bench.write(  # type: ignore[misc]
            bench.order, [100 + number]))
    bench.run(18.0)
    bench.let_through()
    bench.run(5.0)
    assert bench.values_written() == []
    assert set(bench.results()) == {NOT_HEARD}
    bench.write(bench.order, [7], run=1.0)
    assert bench.values_written() == [7]
    assert bench.results()[-1] == 'written'


@pytest.mark.parametrize('mode', MODES)
def test_after_the_first_ten_one_question_a_second_is_kept(mode: str) -> None:
    bench = Queue(mode)
    bench.run(30.0)
    assert bench.questions(0.0) <= 10 + 30
    assert 5 <= bench.questions(10.0) <= 21


@pytest.mark.parametrize('mode', MODES)
def test_fallback_that_stands_calls_for_nothing_while_all_are_silent(mode: str) -> None:
    speed = make_mapping('N7:0', 'Write', plc='SLC', fallback=Fallback((SAFE,), 1000))
    bench = Queue(mode, [speed, make_mapping('N9:0', plc='SLC', period=200)], is_open=True)
    bench.run(3.0)
    bench.device.hear = bench.keep
    bench.run(20.0)  # it is to be written again after 5 s
    bench.let_through()
    bench.run(3.0)
    assert bench.results() == [f'fallback value written: {cause}' for cause in ('start', 'return')]


@pytest.mark.parametrize('mode', MODES)
def test_fallback_may_be_kept_as_it_is_the_value_of_rest(mode: str) -> None:
    speed = make_mapping('N7:0', 'Write', plc='SLC', fallback=Fallback((SAFE,), 1000))
    bench = Queue(mode, [speed, make_mapping('N9:0', plc='SLC', period=200)])
    for number in range(20):
        bench.at(0.4 * number, lambda: bench.write(speed, [777]))
    bench.run(20.0)
    for _ in range(100):
        bench.run(0.1)
        assert bench.driver.next_due() <= bench.driver.kernel.turns.next_due()
    bench.let_through()
    bench.run(2.0)
    assert {*bench.values_written()} == {SAFE}


def test_packets_of_a_fallback_at_the_end_do_not_wait_for_questions() -> None:
    lamps = make_mapping('B3:0/0', 'Write', plc='SLC', length=160,
                         fallback=Fallback((SAFE,) * 160, 1000))
    bench = Queue(rows=[lamps, make_mapping('N9:0', plc='SLC', period=200)])
    bench.run(30.0)
    bench.driver.kernel.end.wind_down()
    bench.run_until(lambda: bench.driver.kernel.end.is_over, 2.0)


def test_banner_noise_and_a_reply_to_another_client_are_not_heard() -> None:
    bench = Queue()
    other = bytes((9, 1, 0x4F, 0, 0x12, 0x34, 0, 0))
    for data in (b'Welcome\r\n', b'\xff\xfb\x01', b'\x10\x04', b'\x10\x06', frame(other)):
        bench.run(1.0)
        bench.driver.machine.receive_data(data, bench.clock())
        bench.write(bench.order, [1], run=0.1)
    assert set(bench.results()) == {NOT_HEARD}


@pytest.mark.parametrize('mode', _WIRING)
def test_command_of_a_plc_that_the_server_may_have_kept_has_to_come_again(mode: str) -> None:
    bench = Queue(mode, [], is_open=True)
    echo = frame(Packet(200, 1, 0x06, 0, 1, b'\0').encode())
    for seconds, executed in ((0.0, 0), (0.4, 0), (0.1, 1)):
        bench.run(seconds)
        bench.driver.machine.receive_data(echo, bench.clock())
        assert bench.driver.counters.commands_received == executed


def test_connection_whose_stations_are_all_silent_is_unheard_again() -> None:
    bench = Queue(is_open=True)
    bench.run(1.0)
    bench.write(bench.order, [1], run=0.5)
    bench.device.say = lambda data: b''
    bench.run(2.0)
    bench.write(bench.order, [2], run=0.5)
    bench.device.say = bytes
    bench.run(3.0)
    bench.write(bench.order, [3], run=0.5)
    assert bench.results() == ['written', NOT_HEARD, 'written']
    assert bench.values_written() == [1, 3]


def test_later_packets_of_a_message_end_when_all_stations_are_silent() -> None:
    recipe = make_mapping('N7:0', 'Write', plc='SLC', length=1000)
    bench = Queue('Peer', [recipe, make_mapping('N9:0', plc='SLC', period=200)], is_open=True)
    bench.run(0.5)
    bench.write(recipe, 1000 * [7])
    bench.run_until(lambda: len(bench.values_written()) == 4)  # then it is the turn of a read
    bench.device.hear = bench.keep
    bench.run(20.0)
    assert max(len(data) for _, data in bench.stored) < 50
    assert 'only partly written: 2509 ERR_INACTIVE_STATION' in bench.results()[0]


def test_row_without_a_read_is_asked_by_an_echo() -> None:
    order = make_mapping('N7:0', 'Write', plc='SLC')
    bench = Queue(rows=[order], is_open=True)
    bench.run(0.5)
    bench.write(order, [3], run=0.5)
    assert bench.results() == ['written']


@pytest.mark.parametrize('share', ['', 'tcp:6000'])
def test_line_that_only_broadcasts_is_spared(share: str) -> None:
    every = make_mapping('N7:0', 'Write', station=255, plc='SLC')
    bench = Queue(rows=[every], share=share)
    for value in range(15):  # more than the quick questions
        bench.write(every, [value], run=0.3)
    assert bench.listener.outcomes() == 15 * [Outcome.BROADCAST]


@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_read_of_a_guest_is_the_question_where_there_are_no_rows_no_write(mode: str) -> None:
    every = make_mapping('N7:0', 'Write', station=255, plc='SLC')
    bench = Queue(mode, [every], share='tcp:6000', is_open=True)
    guest, answers = Guest('tcp:6000', ShareAccess.ALL), list[Packet]()

    def ask(*commands: bytes, dst: int = 1) -> None:
        for data in commands:
            bench.driver.guests.put(GuestCommand(
                guest, Packet(dst, 9, 0x0F, 0, 1, data), bench.clock(), answers.append))
        bench.line.wake(bench.driver.machine)
        bench.run(1.0)

    write, read = b'\xAA\x02\x07\x89\0\0\x05\0', b'\xA2\x02\x07\x89\0\0'
    ask(write, write, read)
    ask(read, dst=7)  # a station that has never been heard shows nothing about the connection
    ask(write)
    bench.device.hear = bench.keep
    bench.at(bench.clock() + 0.1, lambda: bench.write(every, [9]))
    for _ in range(4):
        ask(write)
    bench.let_through()
    ask(write, write, read)
    ask(write)
    assert [reply.sts for reply in answers] == [
        7, 7, 0, 7 if mode == 'Master' else 2, 0, 2, 7, 7, 7, 7, 7, 0, 0]
    assert bench.values_written() == [5, 5, *[9] * (mode == 'Peer'), 5]  # what was kept
    assert bench.listener.outcomes() == [
        Outcome.UNKNOWN if mode == 'Peer' else Outcome.BROADCAST]


def test_guest_is_the_next_question_of_a_silent_line() -> None:
    bench = DriverBench([], settings=DriverSettings(may_store=True), network=Network(
        baud=19200, timeout=100, cmd_timeout=3000, share='tcp:6000'))
    program = Program(bench)
    program.go_on(lambda: program.ask(READ_N7), pause=0.3)
    for _ in range(100):
        bench.run(0.2)
    assert {*program.statuses} == {7}
