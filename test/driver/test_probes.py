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

"""Stations that are gone get an eighth of the line's time at most, whatever is set."""

from __future__ import annotations

from collections.abc import Container

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.tasks import Task
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.links import DriverSettings
from abdf1_ros.errors import LinkError
from abdf1_ros.plan.forecast import longest_probe
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from support.driver_bench import DriverBench
from support.mappings import make_mapping

LIVING = 254
MOST = 1 / 8 + 0.01
PROBES = 24


class _TimedTask:
    """A task that tells how long it has had the line."""

    def __init__(self, task: Task, driver: _TimedDriver) -> None:
        self.command, self.reply_size, self.expires = task.command, task.reply_size, task.expires
        self.sent = False
        self._begun = driver.machine.now
        self._task = task
        self._driver = driver

    def reply(self, packet: Packet) -> None:
        """Hand on the reply."""
        self._end()
        self._task.reply(packet)

    def fail(self, error: LinkError) -> None:
        """Hand on the error."""
        self._end()
        self._task.sent = self.sent
        self._task.fail(error)

    def _end(self) -> None:
        if self.command.dst != LIVING:
            self._driver.probes += 1
            self._driver.probing += self._driver.machine.now - self._begun


class _TimedDriver(Driver):
    """A driver that adds up what stations that are gone take of its time."""

    probing = 0.0
    probes = 0

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the next task, timed."""
        task = super().next_task(now, busy)
        return None if task is None else _TimedTask(task, self)


def bench_of(network: Network, gone: int, monkeypatch: pytest.MonkeyPatch,
             command: str = 'Read', period: int = 100) -> tuple[DriverBench, list[Mapping]]:
    """Return a driver that knows that so many stations are gone, and their rows."""
    rows = [make_mapping('N7:0', command, station=station, period=period)
            for station in range(1, gone + 1)]
    living = make_mapping('N7:0', station=LIVING, period=period)
    monkeypatch.setattr('support.driver_bench.Driver', _TimedDriver)
    bench = DriverBench([living, *rows], network=network, settings=DriverSettings(), start=False)
    bench.plc(LIVING, 'PLC5', ('N7:0', 10))
    for row in rows:
        bench.driver.stations.lost(row.station, 0.0)
    return bench, rows


SETTINGS = {
    'timeout': st.integers(0, 360_000) | st.integers(0, 50), 'tx_delay': st.integers(0, 65_535),
    'nak_retries': st.integers(0, 10), 'enq_retries': st.integers(0, 10),
    'baud': st.sampled_from([19200, 115200])}


@settings(max_examples=30)
@given(gone=st.integers(1, 253), command=st.sampled_from(['Read', 'Write']),
       values=st.fixed_dictionaries(SETTINGS))
def test_probes_of_the_driver_take_an_eighth_at_most(
        gone: int, command: str, values: dict[str, int]) -> None:
    network = Network(**values)  # type: ignore[arg-type]
    probe = longest_probe(network)
    with pytest.MonkeyPatch.context() as monkeypatch:
        bench, rows = bench_of(network, gone, monkeypatch, command, int(probe * 1000))
    bench.open()
    window = 8 * PROBES * probe + 1.0
    driver = bench.driver
    assert isinstance(driver, _TimedDriver)
    bench.run(window)
    assert driver.probing <= MOST * window + probe
    assert driver.probes
    assert len(bench.listener.reads) >= PROBES


@pytest.mark.parametrize('timeout, tx_delay, gone', [
    (0, 0, 1), (0, 0, 15), (1, 40, 15), (300, 0, 15), (0, 300, 15)])
def test_polls_of_standard_polling_take_an_eighth_at_most(
        timeout: int, tx_delay: int, gone: int, monkeypatch: pytest.MonkeyPatch) -> None:
    network = Network(timeout=timeout, tx_delay=tx_delay, polling='Standard', baud=19200)
    bench, _ = bench_of(network, gone, monkeypatch)
    said: list[tuple[float, int]] = []

    def hear(data: bytes) -> bytes:
        said.append((bench.clock(), data[2] if len(data) > 2 else 0))
        return data

    bench.far.hear = hear
    bench.open()
    bench.run(8.0)
    probing = sum(after - when for (when, station), (after, _) in zip(said, said[1:], strict=False)
                  if data_is_of_the_gone(station, gone))
    assert probing <= MOST * 8.0 + longest_probe(network)
    assert len(bench.listener.reads) > 2


def data_is_of_the_gone(station: int, gone: int) -> bool:
    """Tell whether the station of a poll or message is one of those that are gone."""
    return 1 <= station <= gone
