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

"""Full duplex through a gateway that replies to its own number (M 6-4, 1747-UM005B 3-3)."""

from collections.abc import Callable
from unittest.mock import Mock

from abdf1_ros.driver.evidence import evidence_of
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import Answer, frame, OddDevice, Wiring

US, GATEWAY, PLC, SECOND = 5, 8, 1, 2
WORDS = make_mapping('N7:0', station=PLC, plc='SLC')
OTHER = make_mapping('N7:0', station=SECOND, plc='SLC')
TARGET = make_mapping('N7:5', 'Write', station=PLC, plc='SLC')


def bench_of(device: OddDevice, *rows: Mapping, mode: str = 'Peer', **settings: float
             ) -> DriverBench:
    device.words = {(PLC, 7, 0): 42, (SECOND, 7, 0): 43}
    return DriverBench(rows, far=device, settings=DriverSettings(**settings),  # type: ignore
                       network=Network(mode=mode, baud=19200, timeout=300))


def gateway(replies_to: int | None = GATEWAY) -> OddDevice:
    """Return a KF3 with two PLCs, whose replies come to its own number."""
    device = OddDevice(Wiring.FULL, GATEWAY, (PLC, SECOND))
    device.replies_to = replies_to
    return device


def told(bench: DriverBench, station: int = PLC) -> str:
    """Return what the line has shown of a station, in short."""
    found = evidence_of(bench.network.line_mode, bench.driver.stations, station)
    if found.other_number is not None and found.gateway is None:
        return f'replies come to {found.other_number}'
    if not found.is_only_acknowledged:
        return ''
    by = '' if found.gateway is None else f' by {found.gateway}'
    return 'left alone' if found.is_left_alone else f'only acknowledged{by}'


def test_replies_to_the_number_of_a_gateway_are_taken_from_the_second_on() -> None:
    bench = bench_of(gateway(), WORDS, OTHER, TARGET)
    bench.run(4.0)
    assert {tuple(values) for values in bench.listener.values(WORDS)} == {(42,)}
    assert {tuple(values) for values in bench.listener.values(OTHER)} == {(43,)}
    assert len(bench.listener.wrong_messages()) == 1  # one command is lost, not one for each PLC
    bench.write(TARGET, [7], run=1.0)
    assert (bench.listener.outcomes(), bench.far.words[PLC, 7, 5]) == ([Outcome.WRITTEN], 7)
    assert bench.driver.stations[PLC].has_gateway
    assert told(bench) == 'replies come to 8'


def test_first_write_is_told_as_unknown_and_the_number_with_it() -> None:
    bench = bench_of(gateway(), TARGET)
    bench.write(TARGET, [7], run=1.5)
    assert (bench.listener.outcomes(), bench.far.words[PLC, 7, 5]) == ([Outcome.UNKNOWN], 7)
    assert told(bench) == 'replies come to 8'
    bench.write(TARGET, [8], run=1.5)
    assert bench.listener.outcomes() == [Outcome.UNKNOWN, Outcome.WRITTEN]


def test_nothing_is_told_where_our_station_is_the_number_of_the_gateway() -> None:
    bench = bench_of(gateway(US), WORDS, TARGET)
    bench.run(2.0)
    bench.write(TARGET, [7], run=1.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert (bench.listener.wrong_messages(), told(bench)) == ([], '')


def test_gateway_that_answers_diagnostics_itself_does_so_to_our_number() -> None:
    device = gateway()
    device.executes_diagnostics = True
    bench = bench_of(device, WORDS, processor_period=0.5)
    bench.run(6.0)
    assert len(bench.listener.values(WORDS)) > 20
    assert len(bench.listener.wrong_messages()) == 1


@pytest.mark.parametrize('comes_first', [True, False])
def test_reply_for_another_device_on_the_wire_is_never_taken(comes_first: bool) -> None:
    """A passive splitter: the PLC's replies to an HMI, here with the SRC, CMD and TNS of ours."""
    device = OddDevice(Wiring.FULL)
    bench = bench_of(device, WORDS, TARGET)
    bench.run(1.0)
    device.say = both_replies(comes_first)
    bench.listener.reads.clear()
    bench.run(5.0)
    assert {tuple(values) for values in bench.listener.values(WORDS)} == {(42,)}
    assert told(bench) == ''
    assert not bench.driver.stations[PLC].has_gateway
    device.say = lambda data: data[:2] + foreign(data)  # its own replies get lost
    bench.write(TARGET, [7], run=3.0)
    assert bench.listener.outcomes() == [Outcome.UNKNOWN]


def foreign(data: bytes) -> bytes:
    """Return a reply to station 0 with the numbers of the one in these bytes, and other words."""
    at = data.find(b'\x10\x02')
    if at < 0 or not data[at + 4] & 0x40:
        return b''
    return frame(b'\x00' + data[at + 3:at + 8] + b'\x09\x09')


def both_replies(comes_first: bool) -> Callable[[bytes], bytes]:
    def say(data: bytes) -> bytes:
        other, at = foreign(data), data.find(b'\x10\x02')
        if not other:
            return data
        return data[:at] + other + data[at:] if comes_first else data + other
    return say


def silent_but_for(number: int) -> Callable[[bytes], Answer]:
    return lambda data: Answer.ACK if data[0] == number else Answer.LOSES


def test_acknowledgement_without_a_reply_is_told_as_what_it_is_in_full_duplex() -> None:
    device = OddDevice(Wiring.FULL, station=9)  # an SLC with passthru to Data Highway Plus
    device.takes = silent_but_for(9)
    bench = bench_of(device, WORDS)
    assert told(bench) == ''
    bench.run(3.0)
    assert told(bench) == 'only acknowledged'
    device.takes = lambda data: Answer.ACK
    device.nodes = frozenset((PLC,))
    bench.run_until(lambda: bool(bench.listener.values(WORDS)), 20.0)
    assert told(bench) == ''


def asked(device: OddDevice) -> int:
    """Return the number of commands that have come to the station of WORDS."""
    return device.asked.count(PLC)


class Passthru(OddDevice):
    """An SLC with passthru to Data Highway Plus, own node 9; other nodes may be off."""

    def __init__(self, *on: int) -> None:
        super().__init__(Wiring.FULL, station=9, nodes=(9, *on))
        self.asked: list[int] = []
        self.takes = self._take

    def _take(self, data: bytes) -> Answer:
        if not data[2] & 0x40:
            self.asked.append(data[0])
        return Answer.ACK if data[0] in self.nodes else Answer.LOSES


OWN = make_mapping('N7:0', station=9, plc='SLC')


@pytest.mark.parametrize('rows', [(WORDS,), (WORDS, OWN), (WORDS, TARGET, OWN)])
def test_nothing_asks_a_node_that_has_left_five_commands_without_a_reply(
        rows: tuple[Mapping, ...]) -> None:
    """Each may cost one of 30 buffers of the SLC until its power is off (1747-RM001G 14-5)."""
    device = Passthru()
    bench = bench_of(device, *rows, processor_period=1.0)
    bench.run(60.0)
    assert device.asked.count(PLC) == 5
    assert told(bench) == 'left alone'
    assert OWN not in rows or len(bench.listener.values(OWN)) > 40


@pytest.mark.parametrize('ask', ['write', 'call', 'message of the node'])
def test_node_that_is_left_alone_is_asked_again(ask: str) -> None:
    device = Passthru(PLC)
    bench = bench_of(device, WORDS, TARGET, OWN)
    bench.run(2.0)
    device.nodes = frozenset((9,))  # it goes off; later it is on again, and nobody sees it
    bench.run(40.0)
    device.nodes = frozenset((9, PLC))
    bench.listener.reads.clear()
    device.asked.clear()
    bench.run(60.0)
    assert (asked(device), bench.listener.values(WORDS)) == (0, [])
    if ask == 'write':
        bench.write(TARGET, [7], run=1.0)
        assert bench.listener.outcomes() == [Outcome.WRITTEN]
    elif ask == 'call':
        bench.driver.read_now(WORDS, Mock())
    else:
        bench.at(bench.line.now, lambda: device.send(
            bytes.fromhex('05 01 0f 00 01 00 a2 02 07 89 00 00')))
    bench.run(10.0)
    assert len(bench.listener.values(WORDS)) > 5 and told(bench) == ''


def test_each_call_costs_a_node_that_is_left_alone_one_command() -> None:
    bench = bench_of(device := Passthru(), WORDS, OWN)
    bench.run(30.0)
    device.asked.clear()
    for _ in range(3):
        bench.driver.read_now(WORDS, answer := Mock())
        bench.run(10.0)
        assert '2508' in answer.call_args[0][0].error
    bench.driver.checks.request_counters(PLC)
    bench.run(10.0)
    assert asked(device) == 3
    assert not bench.driver.checks.counters_wanted


def test_plc_that_is_alone_and_has_replied_is_asked_for_ever() -> None:
    device = Passthru(PLC)
    bench = bench_of(device, WORDS)
    bench.run(2.0)
    device.nodes = frozenset((9,))
    bench.run(60.0)
    device.nodes = frozenset((9, PLC))
    bench.listener.reads.clear()
    bench.run(10.0)
    assert len(bench.listener.values(WORDS)) > 5


def test_acknowledgement_of_a_gateway_is_not_that_of_its_node() -> None:
    device = OddDevice(Wiring.HALF, GATEWAY, (SECOND,))
    device.takes = silent_but_for(SECOND)
    bench = bench_of(device, make_mapping('N7:0', station=PLC, plc='SLC', via=GATEWAY),
                     make_mapping('N7:0', station=SECOND, plc='SLC', via=GATEWAY), mode='Master')
    bench.run(5.0)
    assert told(bench) == 'only acknowledged by 8'
    assert told(bench, SECOND) == ''


def test_acknowledgement_of_a_slave_is_its_own() -> None:
    device = OddDevice(Wiring.HALF)
    device.takes = lambda data: Answer.LOSES
    bench = bench_of(device, WORDS, mode='Master')
    bench.run(5.0)
    assert bench.driver.stations[PLC].has_no_replies and told(bench) == ''
