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
Public reports about drivers, HMIs and gateways, played against the driver.

The far end shares no code with the package. test/lab/field.md has the sources.
"""

from collections.abc import Callable

from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping
from support.odd_device import Answer, OddDevice, Wiring

MODES = {'Message': (Wiring.HALF, {}), 'Standard': (Wiring.HALF, {'polling': 'Standard'}),
         'Peer': (Wiring.FULL, {'mode': 'Peer'}), 'Radio': (Wiring.RADIO, {'mode': 'Radio'})}
POLLED = ('Message', 'Standard')


def bench_of(mode: str, device: OddDevice, *rows: Mapping, timeout: int = 300,
             cmd_timeout: int = 1000, tx_delay: int = 0) -> DriverBench:
    """Return a line with this device, not opened yet."""
    return DriverBench(rows, start=False, far=device, network=Network(
        baud=19200, timeout=timeout, cmd_timeout=cmd_timeout, tx_delay=tx_delay,
        **MODES[mode][1]))  # type: ignore[arg-type]


def device_of(mode: str, *nodes: int, kind: type[OddDevice] = OddDevice) -> OddDevice:
    """Return a device of this mode: station 1, or station 8 with nodes behind it."""
    return kind(MODES[mode][0], 8 if nodes else 1, nodes)


@pytest.mark.parametrize('mode', MODES)
def test_node_0_behind_a_gateway_is_like_any_other(mode: str) -> None:
    device = device_of(mode, 0)
    device.words[0, 7, 0] = 42
    via = 8 if mode in POLLED else None
    words, target = (make_mapping(address, command, plc='SLC', station=0, via=via)
                     for address, command in (('N7:0', 'Read'), ('N7:5', 'Write')))
    bench = bench_of(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, [7], run=1.0)
    assert {tuple(values) for values in bench.listener.values(words)} == {(42,)}
    assert (bench.listener.outcomes(), device.words[0, 7, 5]) == ([Outcome.WRITTEN], 7)


class NeedsAPause(OddDevice):
    """It discards a message that comes less than ``pause`` s after its own."""

    pause, free, dropped = 0.04, 0.0, 0

    def receive_data(self, data: bytes, now: float) -> None:
        self.is_early = now < self.free + self.pause
        super().receive_data(data, now)

    def data_to_send(self) -> bytes:
        data = super().data_to_send()
        if b'\x10\x02' in data:
            self.free = self._now + len(data) / 1920
        return data

    def takes_late_messages(self, data: bytes) -> Answer:
        self.dropped += self.is_early
        return Answer.NOTHING if self.is_early else Answer.ACK


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('tx_delay', [0, 50])
def test_device_that_discards_what_comes_too_soon_works_and_with_tx_delay_fast(
        mode: str, tx_delay: int) -> None:
    device = device_of(mode, kind=NeedsAPause)
    assert isinstance(device, NeedsAPause)
    device.takes = device.takes_late_messages
    words, target = make_mapping('N7:0', plc='SLC'), make_mapping('N7:5', 'Write', plc='SLC')
    bench = bench_of(mode, device, words, target, tx_delay=tx_delay)
    bench.open(run=2.0)
    for value in range(1, 4):
        bench.write(target, [value], run=3.0)
    assert bench.listener.outcomes() == 3 * [Outcome.WRITTEN]
    assert device.words[1, 7, 5] == 3
    if tx_delay:
        assert device.dropped == 0
        assert len(bench.listener.values(words)) > 55  # of 110
    else:
        assert bench.listener.values(words)


class OneAtATime(OddDevice):
    """It has room for a message only while no reply of its own waits; some replies take long."""

    ready = 0.0

    def takes_one(self, data: bytes) -> Answer:
        if self._replies[1]:
            return Answer.NOTHING
        self.ready = self._now + (1.3 if len(self.executed) % 5 == 3 else 0.0)
        return Answer.ACK

    def _polled(self, station: int) -> None:
        if self._now < self.ready:
            self._polled_station = None
            self._out += b'\x10\x04'
        else:
            super()._polled(station)


@pytest.mark.parametrize('mode', POLLED)
def test_slave_whose_sink_is_full_until_it_is_polled_keeps_its_writes(mode: str) -> None:
    device = device_of(mode, kind=OneAtATime)
    assert isinstance(device, OneAtATime)
    device.takes = device.takes_one
    words = make_mapping('N7:0', plc='SLC', period=100)
    target = make_mapping('N7:5', 'Write', plc='SLC')
    bench = bench_of(mode, device, words, target, cmd_timeout=2000)
    bench.open(run=5.0)
    for value in range(1, 4):
        bench.write(target, [value], run=4.0)
    assert bench.listener.outcomes() == 3 * [Outcome.WRITTEN]
    assert len(bench.listener.values(words)) > 30
    assert bench.listener.changes == []


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('change', [lambda data: data[:-2], lambda data: data + b'\x01\x02',
                                    lambda data: data[:-1], lambda data: b''])
def test_reply_with_another_number_of_bytes_is_no_value(
        mode: str, change: Callable[[bytes], bytes]) -> None:
    device = device_of(mode)
    answer = device.answer

    def wrong(data: bytes) -> tuple[int, bytes]:
        status, result = answer(data)
        return status, change(result) if data[2] == 0x0F else result

    device.answer = wrong  # type: ignore[method-assign]
    words = make_mapping('N7:0', plc='SLC', length=3)
    bench = bench_of(mode, device, words)
    bench.open(run=2.0)
    assert bench.listener.values(words) == []
    assert 'asked were 6' in dict(bench.listener.reasons)['N7:0']
    assert bench.driver.stations[1].active


@pytest.mark.parametrize('mode', POLLED)
@pytest.mark.parametrize('timeout', [1000, 1200])
def test_radio_modems_that_take_half_the_timeout_each_way(mode: str, timeout: int) -> None:
    device = device_of(mode)
    device.words[1, 7, 0] = 42
    words, target = make_mapping('N7:0', plc='SLC'), make_mapping('N7:5', 'Write', plc='SLC')
    bench = bench_of(mode, device, words, target, timeout=timeout, cmd_timeout=5000)
    bench.line.propagation = 0.5
    bench.open(run=20.0)
    bench.write(target, [7], run=20.0)
    assert {tuple(values) for values in bench.listener.values(words)} == {(42,)}
    assert (bench.listener.outcomes(), device.words[1, 7, 5]) == ([Outcome.WRITTEN], 7)


@pytest.mark.parametrize('mode', MODES)
def test_words_that_look_like_symbols_are_data(mode: str) -> None:
    values = [0x1010, 0x0310, 0x1003, 0x0610, 0x0210, 0x0010, 0x1000]
    device = device_of(mode)
    device.words.update({(1, 7, number): value for number, value in enumerate(values)})
    words, target = (make_mapping(address, command, plc='SLC', length=7, kind='uint16')
                     for address, command in (('N7:0', 'Read'), ('N7:20', 'Write')))
    bench = bench_of(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, values, run=1.0)
    assert {tuple(each) for each in bench.listener.values(words)} == {tuple(values)}
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert [device.words[1, 7, 20 + number] for number in range(7)] == values


@pytest.mark.parametrize('mode', MODES)
def test_processor_that_takes_shorter_packets_than_the_rows_say_is_read_all_the_same(
        mode: str) -> None:
    device = device_of(mode)
    device.words.update({(1, 7, number): number for number in range(100)})
    device.takes = lambda data: Answer.REFUSES if data[6:7] in (b'\xa2', b'\xaa') \
        and data[7] > 82 else Answer.ACK
    words = make_mapping('N7:0', plc='SLC', length=100)  # Processor is 5/03 unless told
    told, untold = (make_mapping('N7:0', 'Write', plc='SLC', length=100, tag=name, processor=name)
                    for name in ('ML1000', '5/03'))
    bench = bench_of(mode, device, words, told, untold)
    bench.open(run=4.0)
    assert bench.listener.values(words)[-1] == list(range(100))
    bench.write(untold, [6] * 100, run=2.0)
    bench.write(told, [5] * 100, run=3.0)
    assert bench.listener.outcomes() == [Outcome.FAILED, Outcome.WRITTEN]
    assert 'STS 10: illegal command, format or length' in str(bench.listener.results[0])
    assert {device.words[1, 7, number] for number in range(100)} == {5}


@pytest.mark.parametrize('mode', ['Message', pytest.param('Standard', marks=pytest.mark.long)])
def test_slaves_without_power_leave_the_others_nine_tenths_of_their_reads(mode: str) -> None:
    dead = {3, 8, 12, 17}
    rows = [make_mapping('N7:0', plc='SLC', station=number, tag=f'n{number}', period=1000)
            for number in range(1, 20)]
    bench = DriverBench(rows, start=False, network=Network(
        station=30, baud=9600, timeout=300, **MODES[mode][1]))  # type: ignore[arg-type]
    for number in range(1, 20):
        plc = bench.plc(number, 'SLC', ('N7:0', 4))
        store(plc, 'N7:0', [number])
        plc.faults.silent = number in dead
    bench.open(run=60.0)
    for row in rows:
        values = bench.listener.values(row)
        assert len(values) >= (0 if row.station in dead else 54), row.station
        assert {tuple(each) for each in values} <= {(row.station,)}


@pytest.mark.parametrize('text', ['This is a test', 'This is a testx', 'a', ''])
def test_strings_of_even_and_odd_length_are_written_whole(text: str) -> None:
    device = device_of('Peer')
    device.words.update({(1, 13, number): 0x4141 for number in range(42)})  # an older text
    words = make_mapping('ST13:0', plc='SLC')
    target = make_mapping('ST13:0', 'Write', plc='SLC', tag='target')
    bench = bench_of('Peer', device, words, target)
    bench.open(run=1.0)
    bench.write(target, text, run=2.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(words)[-1] == text
    assert device.words[1, 13, 0] == len(text)
    written = [device.words[1, 13, number].to_bytes(2, 'big') for number in range(1, 42)]
    assert b''.join(written)[:len(text)].decode() == text


@pytest.mark.parametrize('mode', MODES)
def test_whole_file_of_256_words_is_one_row(mode: str) -> None:
    device = device_of(mode)
    words = make_mapping('N7:0', plc='SLC', length=256, processor='ML1400')
    target = make_mapping('N7:0', 'Write', plc='SLC', length=256, processor='ML1400', tag='target')
    bench = bench_of(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, list(range(256)), run=6.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert [device.words[1, 7, number] for number in range(256)] == list(range(256))
    assert bench.listener.values(words)[-1] == list(range(256))


@for_all(('address', 'length'), [('N7:0/0', 8), ('N7:0/0', 16), ('N7:0/8', 8), ('N7:0/4', 20)])
def test_bits_of_integers_in_any_number(address: str, length: int) -> None:
    device = device_of('Peer')
    device.words.update({(1, 7, 0): 0x1234, (1, 7, 1): 0xFFFE})
    row = make_mapping(address, plc='SLC', length=length)
    bench = bench_of('Peer', device, row)
    bench.open(run=1.0)
    first = int(address.partition('/')[2])
    assert bench.listener.values(row)[-1] == [
        0xFFFE1234 >> first + number & 1 for number in range(length)]
