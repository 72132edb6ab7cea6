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

"""All that asks stations that are gone takes an eighth of the line's time at most."""

from itertools import pairwise

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, Poll
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.gateway import SimulatedGateway
from hypothesis import example, given, settings
from hypothesis import strategies as st
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, simulated_plc
from support.mappings import make_mapping
from support.multidrop import Slave

LIVING, STRANGERS = 254, (252, 253)
PROBES = 10
SLOTS = 8


class Bench(DriverBench):
    """
    A driver that knows that all stations but one are gone, and notes who has the line.

    Of each three that are gone one has a read, one a write, one both. The living one is read
    twice in the time of a probe and has messages for others. With ``is_deaf`` some of those
    that are gone answer polls, and take no command.
    """

    def __init__(self, network: Network, gone: int, *, is_deaf: bool) -> None:
        kinds = 'Read', 'Write', 'ReadWrite'
        self.unit = network.line_mode.longest_probe(network.line)
        self.living = make_mapping('N7:0', station=LIVING, period=max(100, int(500 * self.unit)))
        self.gone = [make_mapping('N7:0', kinds[station % 3], station=station, period=100)
                     for station in range(1, gone + 1) if station != network.station]
        super().__init__([self.living, *self.gone], network=network, start=False, chunk=1,
                         settings=DriverSettings(write_timeout=20 * self.unit))
        self.spoken: list[tuple[float, int, float]] = []
        self._decoder = FrameDecoder(Checksum.CRC, Duplex.HALF)
        self._begun: float | None = None
        self.far.hear = self._note
        numbers = [*(row.station for row in self.gone), *STRANGERS]
        for number in numbers:
            self.driver.stations.lost(number, 0.0)
        for number in numbers[-7:] if is_deaf else ():
            deaf = Slave(number, self.clock)
            deaf.deaf = True
            self.connect(deaf)
        plc = simulated_plc(LIVING, 'PLC5', self.clock, ('N7:0', 10))
        self.talker = Slave(LIVING, self.clock, plc.serve)
        self.connect(self.talker)
        for tns in range(8 * PROBES):
            self.at(tns * self.unit, lambda tns=tns: self._disturb(tns, numbers))
        self.open()

    def _note(self, data: bytes) -> bytes:
        if self._begun is None:
            self._begun = self.clock() - self.network.timing.char_time
        self._decoder.feed(data)
        while (symbol := self._decoder.next_symbol()) is not None:
            station = symbol.station if isinstance(symbol, Poll | Frame) else None
            if station is not None:
                self.spoken.append((self._begun, station, self.clock()))
            self._begun = None
        return data

    def _disturb(self, count: int, numbers: list[int]) -> None:
        """Ask for writes to stations that are gone, and let the living one talk to them."""
        for row in self.gone[count % 7::7]:
            if row.writes:
                self.write(row, [count])
        if len(self.talker.outbox) < 2:
            dst = numbers[-1 - count % min(5, len(numbers))]
            self.talker.outbox.append(Packet(dst, LIVING, 0x06, 0, count, b'\x00\x01'))

    def spent(self) -> tuple[float, float]:
        """Return the seconds that stations had that are gone, in all and at most at a time."""
        total = longest = now = 0.0
        last = LIVING
        for (begun, station, sent), (after, _, _) in pairwise(self.spoken):
            spent = min(after - begun, sent - begun + self.unit)
            now = spent + (now if station == last else 0.0)
            if station != LIVING:
                longest, total = max(longest, now), total + spent
            last = station
        return total, longest


@pytest.mark.parametrize('polling', ['Message', 'Standard'])
@settings(max_examples=4)
@given(timeout=st.integers(0, 360_000) | st.integers(0, 50), tx_delay=st.integers(0, 65_535),
       nak_retries=st.integers(0, 10), enq_retries=st.integers(0, 10),
       gone=st.integers(1, 251), is_deaf=st.booleans())
@example(timeout=200, tx_delay=0, nak_retries=3, enq_retries=3, gone=9, is_deaf=False)
@example(timeout=200, tx_delay=0, nak_retries=3, enq_retries=3, gone=9, is_deaf=True)
@example(timeout=0, tx_delay=0, nak_retries=6, enq_retries=0, gone=1, is_deaf=True)
def test_stations_that_are_gone_get_an_eighth_of_the_line_at_most(
        polling: str, timeout: int, tx_delay: int, nak_retries: int, enq_retries: int, gone: int,
        is_deaf: bool) -> None:
    """Reads, writes, echoes and messages to be passed on together, in the legal ranges."""
    # So slow a line that a run has few transactions.
    network = Network(
        baud=200 / max(timeout / 1000, 0.02), timeout=timeout, tx_delay=tx_delay,  # type: ignore
        cmd_timeout=10 ** 9, nak_retries=nak_retries, enq_retries=enq_retries, polling=polling)
    bench = Bench(network, gone, is_deaf=is_deaf)
    window = 8 * PROBES * bench.unit
    bench.run(window)
    total, longest = bench.spent()
    # A deaf one that answers a poll counts as active, so its first command waits for no turn.
    assert 0 < total <= window / 8 + (1 + is_deaf) * longest + bench.unit
    assert len(bench.listener.times(bench.living)) > PROBES / 2


GATEWAY = 100


class LateBench(DriverBench):
    """
    A living PLC, and others that take commands and never reply in time.

    Each of these has a heartbeat and a fallback, every other one a read. ``asked`` notes who has
    got a command; for its Cmd_Timeout all others wait.
    """

    def __init__(self, late: int, cmd_timeout: int, via: int | None) -> None:
        self.living = make_mapping('N7:0', station=LIVING, period=cmd_timeout // 4)
        self.late = {*range(1, late + 1)}
        rows = [row for number in self.late for row in self._rows(number, via)]
        super().__init__([self.living, *rows], start=False, network=Network(
            baud=9600, timeout=50, cmd_timeout=cmd_timeout))
        self.plc(LIVING, 'PLC5', ('N7:0', 4))
        self.asked: list[int] = []
        if via is None:
            for number in self.late:
                self.connect(Slave(number, self.clock, self._lose_reply))
        else:
            plcs = [simulated_plc(number, 'PLC5', self.clock) for number in self.late]
            for plc in plcs:
                plc.serve = self._lose_reply  # type: ignore[method-assign]
            self.connect(SimulatedGateway(via, plcs, Checksum.CRC))
        self.breathe()
        self.open()

    def _rows(self, number: int, via: int | None) -> list[Mapping]:
        """Return the rows of a station that replies late."""
        rows = [make_mapping('N7:0', 'Heartbeat', station=number, via=via, tag=f'beat{number}',
                             period=1000),
                make_mapping('N7:1', 'Write', station=number, via=via, tag=f'speed{number}',
                             fallback=Fallback((7,), 1000))]
        read = make_mapping('N7:2', station=number, via=via, tag=f'read{number}')
        return [*rows, read] if number % 2 else rows

    def _lose_reply(self, command: Packet) -> Packet:
        self.asked.append(command.dst)
        reply = command.reply()
        return reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for


@pytest.mark.parametrize('late, cmd_timeout, via', long_unless(
    lambda late, cmd_timeout, via: (via is None) == (late == 1),
    [(*late, via) for late in ((1, 3000), (4, 500)) for via in (None, GATEWAY)]))
def test_heartbeats_fallbacks_and_checks_of_late_stations_get_an_eighth_of_the_line(
        late: int, cmd_timeout: int, via: int | None) -> None:
    bench = LateBench(late, cmd_timeout, via)
    unit = cmd_timeout / 1000
    bench.run((3 * late + 8) * unit)  # until that is known of each
    bench.asked.clear()
    before = len(bench.listener.times(bench.living))
    bench.run(8 * SLOTS * unit)
    assert SLOTS / 2 < len(bench.asked) <= SLOTS + 1
    assert {*bench.asked} == bench.late
    assert len(bench.listener.times(bench.living)) - before > 0.8 * 4 * 8 * SLOTS


def test_station_that_dies_on_a_write_is_probed_where_another_is_gone_already() -> None:
    """Its reads wait in the queue of the living; a probe of the other would always come first."""
    rows = [make_mapping('N7:0', 'ReadWrite', station=1, period=5000),
            make_mapping('N7:0', station=2, period=100)]
    bench = DriverBench(rows)
    first = bench.plc(1, 'PLC5', ('N7:0', 4))
    bench.plc(2, 'PLC5', ('N7:0', 4)).faults.silent = True
    bench.run(2.0)
    first.faults.silent = True
    bench.write(rows[0], [1], run=20.0)
    assert not bench.driver.stations[1].active
    first.faults.silent = False
    bench.listener.reads.clear()
    bench.run(20.0)
    assert bench.listener.values(rows[0])


def test_silent_stations_with_reads_and_without_have_their_probes_in_turns() -> None:
    rows = [make_mapping('N7:0', station=1), make_mapping('N7:0', 'Write', station=2),
            make_mapping('N7:0', station=3, period=50)]
    bench = DriverBench(rows, network=Network(timeout=500))
    bench.plc(3, 'PLC5', ('N7:0', 4))
    bench.run(60.0)
    failures = [bench.driver.stations[number].failures for number in (1, 2)]
    assert min(failures) > 5 and max(failures) - min(failures) <= 1
