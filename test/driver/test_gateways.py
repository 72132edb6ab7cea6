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

"""Two PLCs behind a gateway: one station of the line is polled for both (M 3-7)."""

from collections.abc import Callable
from functools import partial
import itertools

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, Poll, Symbol
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.gateway import SimulatedGateway
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, simulated_plc, store, stored
from support.mappings import make_mapping
from support.odd_device import OddDevice, Wiring

GATEWAY, FIRST, SECOND, DIRECT = 10, 1, 2, 3
# A line that is polled without a pause is a slow one: fewer polls a second show the same.
POLLING = {'Message': 115200, 'Standard': 19200}


class Bench(DriverBench):
    """A driver, a KF3 with a PLC-5 and an SLC behind it, and a PLC-5 on the line itself."""

    def __init__(self, polling: str = 'Message', **settings: float) -> None:
        self.first = make_mapping('N7:0', station=FIRST, via=GATEWAY, length=2)
        self.second = make_mapping('N7:0', 'ReadWrite', station=SECOND, via=GATEWAY, plc='SLC')
        self.recipe = make_mapping('N7:5', station=SECOND, via=GATEWAY, plc='SLC',
                                   is_on_demand=True)
        self.third = make_mapping('N7:0', station=DIRECT)
        network = Network(baud=POLLING[polling], timeout=100, cmd_timeout=500, polling=polling)
        rows = [self.first, self.second, self.recipe, self.third]
        super().__init__(rows, network=network, settings=DriverSettings(
            **settings), start=False)  # type: ignore
        self.plcs = [simulated_plc(FIRST, 'PLC5', self.clock, ('N7:0', 10)),
                     simulated_plc(SECOND, 'SLC', self.clock, ('N7:0', 10))]
        self.gateway = SimulatedGateway(GATEWAY, self.plcs, Checksum.CRC)
        self.connect(self.gateway)
        self.direct = self.plc(DIRECT, 'PLC5', ('N7:0', 10))
        self.polled: list[int] = []
        self.asked: list[tuple[int | None, int]] = []
        self._decoder = FrameDecoder(Checksum.CRC, Duplex.HALF)
        self.far.hear = self._listen
        for plc, value in zip([*self.plcs, self.direct], (11, 22, 33), strict=True):
            store(plc, 'N7:0', [value])
        self.open()

    def _listen(self, data: bytes) -> bytes:
        self._decoder.feed(data)
        while (symbol := self._decoder.next_symbol()) is not None:
            if isinstance(symbol, Poll):
                self.polled.append(symbol.station)
            elif isinstance(symbol, Frame):
                self.asked.append((symbol.station, Packet.decode(symbol.data).dst))
        return data


@pytest.mark.parametrize('polling', POLLING)
def test_gateway_that_is_gone_takes_both_with_it_and_one_poll_brings_both_back(
        polling: str) -> None:
    bench = Bench(polling)
    bench.run(0.5)
    frames_of = bench.gateway.slave.handle
    bench.gateway.slave.handle = lambda symbol: b''  # type: ignore[method-assign]
    bench.run(5.0)
    assert sorted(bench.listener.changes) == [(FIRST, False), (SECOND, False), (GATEWAY, False)]
    bench.polled.clear()
    bench.asked.clear()
    before = len(bench.listener.values(bench.third))
    bench.run(10.0)
    assert set(bench.polled) == {GATEWAY, DIRECT}
    assert set(bench.asked) == {(DIRECT, DIRECT)}  # nothing but polls for the gateway
    assert len(bench.listener.values(bench.third)) - before >= 80
    bench.listener.changes.clear()
    bench.gateway.slave.handle = frames_of  # type: ignore[method-assign]
    bench.run(5.0)
    assert sorted(bench.listener.changes) == [(FIRST, True), (SECOND, True), (GATEWAY, True)]
    bench.listener.reads.clear()
    bench.run(1.0)
    assert bench.listener.values(bench.first) and bench.listener.values(bench.second)


@pytest.mark.parametrize('polling', POLLING)
def test_plc_that_the_gateway_does_not_reach_costs_the_other_nothing(polling: str) -> None:
    bench = Bench(polling)
    bench.plcs[1].faults.silent = True
    bench.run(2.0)
    assert bench.listener.values(bench.second) == []
    assert bench.driver.points[bench.recipe].error is None  # no call has asked for it
    assert [address for address, _ in bench.listener.reasons] == ['N7:0']
    assert 'STS 02' in bench.listener.reasons[0][1]
    assert len(bench.listener.values(bench.first)) >= 16
    assert bench.driver.stations[SECOND].active  # the gateway is
    assert bench.driver.stations[SECOND].last_heard is None
    bench.plcs[1].faults.silent = False
    bench.run(3.0)
    assert bench.listener.values(bench.second)


@pytest.mark.parametrize('polling', POLLING)
def test_gateway_that_takes_long_to_say_so_does_not_take_the_line(polling: str) -> None:
    bench = Bench(polling)
    answer, ready = bench.gateway.handle, [0.0]

    def answer_late(symbol: Symbol) -> bytes:
        if isinstance(symbol, Poll) and bench.clock() < ready[0]:
            return frames.EOT if symbol.station == GATEWAY else b''
        if isinstance(symbol, Frame) and Packet.decode(symbol.data).dst == SECOND:
            ready[0] = bench.clock() + 0.4  # of the 0.5 s of Cmd_Timeout
        return answer(symbol)

    bench.gateway.handle = answer_late  # type: ignore[method-assign]
    bench.plcs[1].faults.silent = True
    bench.run(5.0)
    bench.listener.reads.clear()
    bench.run(10.0)
    assert bench.driver.stations[SECOND].active  # the gateway is
    assert len(bench.listener.values(bench.third)) > 70  # of 100
    if polling == 'Message':  # otherwise the gateway keeps only its own waiting
        assert len(bench.listener.values(bench.first)) > 70
    bench.plcs[1].faults.silent = False
    bench.gateway.handle = answer  # type: ignore[method-assign]
    bench.run(5.0)
    assert bench.listener.values(bench.second)


class OneByOne(DriverBench):
    """Three PLCs behind a gateway that works on one command after the other, in ``seconds``."""

    def __init__(self, *seconds: float) -> None:
        self.rows = [make_mapping('N7:0', station=number, via=GATEWAY) for number in (1, 2, 3)]
        network = Network(baud=19200, timeout=100, cmd_timeout=500, polling='Standard')
        super().__init__(self.rows, network=network, start=False)
        self.seconds = dict(zip((1, 2, 3), seconds, strict=True))
        self._answer = SimulatedGateway(GATEWAY, [
            simulated_plc(number, 'PLC5', self.clock, ('N7:0', 10)) for number in (1, 2, 3)
        ], Checksum.CRC).handle
        self.mute: set[int] = set()
        self._ready: list[float] = []  # when each reply will be, in their order
        self.connect(self)
        self.open()

    def handle(self, symbol: Symbol) -> bytes:
        """Answer; a poll gets EOT until the work on the next reply is done."""
        if isinstance(symbol, Poll) and self._ready and self._ready[0] > self.clock():
            return frames.EOT
        if isinstance(symbol, Frame) and Packet.decode(symbol.data).dst in self.mute:
            return frames.ACK
        answer = self._answer(symbol)
        if isinstance(symbol, Frame) and answer:
            free = max(self.clock(), *self._ready[-1:], 0.0)
            self._ready.append(free + self.seconds.get(Packet.decode(symbol.data).dst, 0.0))
        elif isinstance(symbol, Poll) and answer != frames.EOT:
            self._ready.pop(0)
        return answer

    def counts(self, seconds: float) -> list[int]:
        """Return how many values each row gets in so many seconds."""
        self.listener.reads.clear()
        self.run(seconds)
        return [len(self.listener.values(row)) for row in self.rows]


def test_slow_gateway_holds_a_plc_up_for_the_time_of_the_others_and_not_for_ever() -> None:
    bench = OneByOne(0.4, 0.4, 0.0)
    bench.run(5.0)
    assert min(bench.counts(10.0)) >= 10 / (2 * 0.5 + 0.1)
    bench.seconds = dict.fromkeys((1, 2, 3), 0.0)
    bench.run(5.0)
    assert min(bench.counts(5.0)) >= 40  # of 50: side by side again


def test_plcs_that_never_reply_cost_another_behind_their_gateway_little() -> None:
    bench = OneByOne(0.0, 0.0, 0.0)
    bench.mute = {1, 2}
    bench.run(5.0)
    counts = bench.counts(10.0)
    assert counts[:2] == [0, 0] and counts[2] > 70  # of 100


def address_replies(bench: Bench, address: Callable[[int], int],
                    plc: SimulatedPlc | None = None) -> None:
    """Let a PLC, the first if none is given, reply to other nodes, by the count of replies."""
    plc = plc or bench.plcs[0]
    serve, count = plc.serve, itertools.count()
    plc.serve = lambda command: serve(command)._replace(  # type: ignore[method-assign]
        dst=address(next(count)))


@pytest.mark.parametrize('polling', POLLING)
@pytest.mark.parametrize('node', [GATEWAY, 0, 9])
def test_gateway_that_fills_in_its_own_node(polling: str, node: int) -> None:
    """M 6-4: it may put its node in place of our station, so replies come to that."""
    bench = Bench(polling)
    address_replies(bench, lambda count: node)
    bench.run(2.0)
    assert len(bench.listener.values(bench.first)) >= 8
    assert len(bench.listener.values(bench.second)) >= 8
    # A number that we do not know is believed when the next reply has it, too.
    wrong = [] if node == GATEWAY else [(FIRST, node)]
    assert bench.listener.wrong_messages() == wrong


@pytest.mark.parametrize('polling', POLLING)
@pytest.mark.parametrize('nodes', [(SECOND,), (DIRECT,), (9, 12)])
def test_reply_to_another_node_confirms_no_write(polling: str, nodes: tuple[int, ...]) -> None:
    bench = Bench(polling)
    bench.run(1.0)
    address_replies(bench, lambda count: nodes[count % len(nodes)], bench.plcs[1])
    bench.run(0.5)
    bench.write(bench.second, [7], run=5.0)
    assert stored(bench.plcs[1], 'N7:0') == b'\x07\x00'
    assert bench.listener.outcomes() == [Outcome.UNKNOWN]
    assert {number for number, _ in bench.listener.wrong_messages()} == {SECOND}


def test_processors_behind_a_gateway_tell_what_they_are() -> None:
    bench = Bench(processor_period=5.0)
    bench.run(2.0)
    known = bench.driver.checks.known
    assert 'PLC-5' in known(FIRST).processor
    assert '5/03' in known(SECOND).processor
    assert '1770-KF3' in known(GATEWAY).processor


# heartbeats and fallbacks; the rules have the numbers of docs/heartbeats.md


class Interlocked(DriverBench):
    """Two PLCs behind a gateway, each with a heartbeat and a command; what reaches the first."""

    def __init__(self, polling: str) -> None:
        kinds = {FIRST: 'PLC5', SECOND: 'SLC'}
        beats = [make_mapping('N10:0', 'Heartbeat', station=number, via=GATEWAY, plc=kind,
                              tag=f'beat{number}', period=300)
                 for number, kind in kinds.items()]
        self.commands = [make_mapping('N7:1', 'Write', station=number, via=GATEWAY, plc=kind,
                                      tag=f'speed{number}', fallback=Fallback((7,), 1000))
                         for number, kind in kinds.items()]
        super().__init__([*beats, *self.commands], start=False, network=Network(
            baud=POLLING[polling], timeout=100, cmd_timeout=500, nak_retries=1, enq_retries=1,
            polling=polling))
        self.plcs = [simulated_plc(number, kind, self.clock, ('N7:0', 10), ('N10:0', 4))
                     for number, kind in kinds.items()]
        self.gateway = SimulatedGateway(GATEWAY, self.plcs, Checksum.CRC)
        self.connect(self.gateway)
        self.seen: list[list[tuple[float, int]]] = [[], []]
        for number, plc in enumerate(self.plcs):
            plc.serve = partial(self._serve, number, plc.serve)  # type: ignore[method-assign]
        self.breathe()
        self.open()

    def _serve(self, number: int, serve: Callable[[Packet], Packet], command: Packet) -> Packet:
        """Keep how a heartbeat changes."""
        reply, seen = serve(command), self.seen[number]
        value = int.from_bytes(stored(self.plcs[number], 'N10:0'), 'little')
        if not seen or seen[-1][1] != value:
            seen.append((self.clock(), value))
        return reply

    def beats(self, number: int, since: float) -> list[int]:
        """Return the heartbeats that came to a PLC, 0 for the first."""
        return [value for when, value in self.seen[number] if when >= since]


@pytest.mark.parametrize('polling, is_told', long_unless(  # by the gateway; or nothing comes
    lambda polling, is_told: polling == 'Message' or is_told,
    itertools.product(POLLING, (True, False))))
def test_rule_11_plc_out_of_reach_does_not_take_the_line_from_the_other(
        is_told: bool, polling: str) -> None:
    bench = Interlocked(polling)
    bench.run(1.0)
    for command in bench.commands:
        bench.write(command, [5])
    bench.run(0.1)
    if is_told:
        bench.plcs[1].faults.silent = True
    else:
        bench.plcs[1].serve = lambda command: (  # type: ignore[method-assign]
            command.reply()._replace(tns=command.tns ^ 0x8000))
    begun = bench.clock()
    bench.run(20.0)
    changes = [when for when, _ in bench.seen[0] if when >= begun]
    # Two failures, of a command timeout each, may come together.
    assert max(after - before for before, after in zip(changes, changes[1:], strict=False)) < 1.4
    assert len(changes) > (60 if is_told else 30)
    assert stored(bench.plcs[0], 'N7:1') == b'\7\0'


@pytest.mark.parametrize('polling', POLLING)
def test_rule_10_gateway_may_hold_a_message_of_the_time_before_the_port_was_opened(
        polling: str) -> None:
    bench = Interlocked(polling)
    for cause in ('start', 'return'):
        bench.run(0.3)
        store(bench.plcs[0], 'N7:1', [800])  # it has let it go
        bench.run(1.2)
        assert stored(bench.plcs[0], 'N7:1') == b'\7\0'
        assert {str(result) for result in bench.listener.results[-2:]} == {
            f'fallback value written: {cause}'}
        bench.lose_port()
        bench.open()


@pytest.mark.parametrize('polling', POLLING)
def test_rules_2_and_8_plc_within_reach_again_is_a_first_contact(polling: str) -> None:
    bench = Interlocked(polling)
    bench.run(3.0)
    bench.plcs[1].faults.silent = True
    bench.run(4.0)
    store(bench.plcs[1], 'N7:1', [800])  # as from a memory module
    bench.plcs[1].faults.silent = False
    since = bench.clock()
    bench.run(3.0)
    assert stored(bench.plcs[1], 'N7:1') == b'\7\0'
    beats = bench.beats(1, since)
    assert beats[beats.index(0):][:3] == [0, 1, 2]
    assert 0 not in bench.beats(0, since)  # the other one has been there all the time
    assert [str(result) for result in bench.listener.results][2:] == [
        'fallback value written: return']


@pytest.mark.parametrize('nodes', [(FIRST, SECOND), (SECOND,)])
def test_gateway_without_via_is_known_by_its_stations_or_its_status(
        nodes: tuple[int, ...]) -> None:
    device = OddDevice(Wiring.FULL, GATEWAY, nodes)
    bench = DriverBench([make_mapping('N7:0', station=number, plc='SLC') for number in nodes],
                        network=Network(mode='Peer'), far=device)
    for number, there in enumerate((nodes, (), nodes)):
        device.nodes = frozenset(there)
        bench.run(1.0)
        assert bench.driver.stations[SECOND].has_gateway is (len(nodes) > 1 or number > 0)
