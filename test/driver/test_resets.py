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

"""DLE NAK after an overdue reply makes all slaves drop their messages: when it is sent (M 2-7)."""

from collections.abc import Sequence
import itertools

from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import OddDevice, Wiring

US, SLOW, OTHER = 5, 1, 2


def message(value: int, src: int = OTHER, dst: int = US) -> bytes:
    """Return a MSG of a slave: the value into word N7:50."""
    return bytes((dst, src, 0x0F, 0x00)) + (0x300 + value).to_bytes(2, 'little') \
        + bytes((0xAA, 0x02, 0x07, 0x89, 0x32, 0x00)) + value.to_bytes(2, 'little')


class Slaves(OddDevice):
    """Slaves 1 and 2 of a half-duplex line; each fifth reply of slave 1 comes 1.4 s late."""

    def __init__(self) -> None:
        super().__init__(Wiring.HALF, SLOW, (SLOW, OTHER))
        self.stations = frozenset((SLOW, OTHER))
        self._turns = itertools.cycle((0.0, 0.0, 0.0, 0.0, 1.4))
        self.seconds = lambda data: next(self._turns) if data[0] == SLOW else 0.0


SPEED = make_mapping('N7:0', station=SLOW, plc='SLC', period=200)
BESIDE = make_mapping('N7:1', station=OTHER, plc='SLC', period=1000)
PUSHED = make_mapping('N7:50', 'Serve', station=US, plc='SLC')


def bench_of(rows: Sequence[Mapping], nak: bool | None = None, share: str = '') -> DriverBench:
    """Return a line with both slaves, whatever rows the map has."""
    return DriverBench(rows, far=Slaves(), settings=DriverSettings(nak_on_command_timeout=nak),
                       network=Network(plc_type='SLC', baud=19200, timeout=300, share=share))


def send(bench: DriverBench, count: int) -> None:
    """Let slave 2 send a message every 1.5 s."""
    for value in range(1, count + 1):
        bench.at(1.5 * value, lambda value=value: bench.far.send(message(value)))  # type: ignore


@pytest.mark.parametrize('nak', [None, False, True])
def test_no_message_of_another_slave_is_lost_unless_the_reset_is_forced(nak: bool | None) -> None:
    bench = bench_of([SPEED, BESIDE, PUSHED], nak)
    send(bench, 13)
    bench.run(25.0)
    assert bench.driver.counters.command_timeouts > 5
    came = [value for (value,) in bench.listener.values(PUSHED)]
    is_kept = not nak
    assert (came == [*range(1, 14)]) is is_kept
    assert (bench.far.flushed == []) is is_kept
    assert (len(bench.far.answered) == 13) is is_kept


@pytest.mark.parametrize(('rows', 'share', 'is_reset'), [
    ([SPEED], '', True),
    ([SPEED, BESIDE], '', False),
    ([SPEED, PUSHED], '', False),  # a message of the slow slave itself
    ([make_mapping('N7:0', station=SLOW, plc='SLC', via=OTHER)], '', False),
    ([SPEED], 'pty:/tmp/hmi', False)],
    ids=['alone', 'two rows', 'Serve', 'Via', 'Share'])
def test_reset_is_sent_only_where_nobody_may_wait_for_what_it_destroys(
        rows: Sequence[Mapping], share: str, is_reset: bool) -> None:
    bench = bench_of(rows, share=share)
    bench.run(6.0)
    assert bench.driver.counters.command_timeouts > 0
    assert (bench.driver.counters.naks_sent > 0) is is_reset


def test_station_that_a_slave_has_named_keeps_its_messages() -> None:
    """A slave whose MSG has gone to another one: from then on that one is polled as well."""
    bench = bench_of([SPEED])
    bench.at(0.1, lambda: bench.far.send(message(1, src=SLOW, dst=OTHER)))
    bench.run(6.0)
    assert message(1, src=SLOW, dst=OTHER) in bench.far.executed
    assert bench.driver.counters.command_timeouts > 0
    assert bench.driver.counters.naks_sent == 0
