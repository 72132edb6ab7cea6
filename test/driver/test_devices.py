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

"""Odd but legal devices, played against the driver in every mode in which they can occur."""

from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import for_all
from support.devices import Device, DEVICES, link_of, WRONG
from support.driver_bench import DriverBench, Program, READ_N7, store, stored
from support.mappings import make_mapping
from support.odd_device import OddDevice, Wiring

NETWORKS = {
    'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
    'Radio': {'mode': 'Radio'}}


def bench_of(device: Device, mode: str, check: str, *rows: Mapping
             ) -> tuple[DriverBench, SimulatedPlc]:
    """Return a line with an SLC that behaves so, not opened yet."""
    bench = DriverBench(rows, start=False, chunk=device.chunk, network=Network(
        baud=19200, timeout=200, error_code=check, **NETWORKS[mode]))  # type: ignore[arg-type]
    bench.line.propagation = device.propagation
    plc = bench.plc(1, 'SLC', ('N7:0', 10))
    store(plc, 'N7:0', [0x1010, 0x0310, -2])
    bench.far.hear, bench.far.say = device.filters()
    return bench, plc


@pytest.mark.parametrize(('device', 'mode', 'check'), [
    pytest.param(device, mode, check, id=f'{device}-{mode}-{check}',
                 marks=() if is_quick else pytest.mark.long)
    for number, (device, mode) in enumerate(
        (device, mode) for device in DEVICES for mode in device.modes)
    for check, is_quick in (('CRC', number % 2), ('BCC', not number % 2))])
def test_values_are_right_and_writes_are_told_as_they_ended(
        device: Device, mode: str, check: str) -> None:
    words = make_mapping('N7:0', plc='SLC', length=3)
    target = make_mapping('N7:5', 'Write', plc='SLC')
    bench, plc = bench_of(device, mode, check, words, target)
    bench.open(run=1.0)
    guest = Program(bench)
    guest.keep_asking(READ_N7)
    bench.run(3.0)
    assert {tuple(values) for values in bench.listener.values(words)} == {(0x1010, 0x0310, -2)}
    assert bench.driver.stations[1].active
    for value in range(1, 4):
        bench.write(target, [value])
        bench.run_until(lambda count=value: len(bench.listener.results) == count, 20.0)
    assert bench.listener.outcomes() == 3 * [Outcome.WRITTEN]
    assert stored(plc, 'N7:5') == b'\x03\x00'
    before = len(bench.listener.values(words))
    bench.far.say = bench.far.hear = bytes  # a usual device from now on
    bench.run_until(lambda: len(bench.listener.values(words)) > before, 20.0)
    assert {reply.data for _, reply in guest.replies if not reply.sts} == {b'\x10\x10'}


@pytest.mark.parametrize(('device', 'mode'), [
    (device, mode) for device in WRONG for mode in device.modes], ids=str)
def test_what_is_no_reply_is_no_value_and_confirms_nothing(device: Device, mode: str) -> None:
    words = make_mapping('N7:0', plc='SLC', length=3)
    target = make_mapping('N7:5', 'Write', plc='SLC')
    bench, _ = bench_of(device, mode, 'CRC', words, target)
    bench.open(run=3.0)
    bench.write(target, [7])
    bench.run_until(lambda: bool(bench.listener.results), 20.0)
    assert bench.listener.values(words) == []
    assert bench.listener.outcomes()[0] in (Outcome.UNKNOWN, Outcome.NOT_SENT)
    assert {2508, 2510} & bench.listener.numbers()
    bench.far.say = bytes  # a usual device from now on
    bench.run_until(lambda: bool(bench.listener.values(words)), 20.0)


def odd_bench(mode: str, device: OddDevice, *rows: Mapping) -> DriverBench:
    """Return a line with a device that shares no code with the package, not opened yet."""
    return DriverBench(rows, start=False, far=device, network=Network(
        baud=19200, timeout=200, **NETWORKS[mode]))  # type: ignore[arg-type]


WIRINGS = {'Message': Wiring.HALF, 'Standard': Wiring.HALF, 'Peer': Wiring.FULL,
           'Radio': Wiring.RADIO}


@pytest.mark.parametrize('mode', ['Message', 'Standard'])
def test_reply_of_a_slave_that_waits_for_no_poll_is_taken(mode: str) -> None:
    device = OddDevice(Wiring.HALF)
    device.waits_for_poll = False  # home-made slaves
    words, target = make_mapping('N7:0', plc='SLC'), make_mapping('N7:5', 'Write', plc='SLC')
    device.words[1, 7, 0] = 1234
    bench = odd_bench(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, [7], run=1.0)
    assert {tuple(values) for values in bench.listener.values(words)} == {(1234,)}
    assert (bench.listener.outcomes(), device.words[1, 7, 5]) == ([Outcome.WRITTEN], 7)


@pytest.mark.parametrize('mode', NETWORKS)
def test_controller_that_knows_no_command_is_told_as_it_is(mode: str) -> None:
    """A Micro800 takes DF1 frames, and no PCCC in them: STS 10 to each command."""
    device = OddDevice(WIRINGS[mode])
    device.knows_commands = False
    words, target = make_mapping('N7:0', plc='SLC'), make_mapping('N7:5', 'Write', plc='SLC')
    bench = odd_bench(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, [7], run=2.0)
    assert bench.listener.values(words) == []
    assert bench.listener.outcomes() == [Outcome.FAILED]
    assert 'STS 10' in str(bench.listener.results[0])
    assert bench.driver.stations[1].active


@pytest.mark.parametrize('mode', NETWORKS)
@pytest.mark.parametrize('station', [0, 16, 254])
def test_stations_0_and_16_and_254_are_like_any_other(mode: str, station: int) -> None:
    """The number 16 is DLE (reports of ProSoft), 0 is that of a 1761-NET-ENI."""
    device = OddDevice(WIRINGS[mode], station)
    device.words[station, 7, 0] = 0x1010
    words = make_mapping('N7:0', plc='SLC', station=station)
    target = make_mapping('N7:5', 'Write', plc='SLC', station=station)
    bench = odd_bench(mode, device, words, target)
    bench.open(run=1.0)
    bench.write(target, [0x1003], run=1.0)
    assert {tuple(values) for values in bench.listener.values(words)} == {(0x1010,)}
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert device.words[station, 7, 5] == 0x1003


class LateNode(OddDevice):
    """Two nodes, 1 and 2; the replies of 2 come with the next reply of 1, before it."""

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring, 1, (1, 2))
        self.late: list[bytes] = []
        self.say = self._say

    def _say(self, data: bytes) -> bytes:
        at = data.find(b'\x10\x02')
        if at < 0:
            return data
        if data[at + 3] == 2:
            self.late.append(data[at:])
            return data[:at]
        return data[:at] + (self.late.pop(0) if self.late else b'') + data[at:]


@pytest.mark.parametrize('mode', ['Peer', 'Radio'])
def test_late_replies_of_a_site_are_no_values_of_another(mode: str) -> None:
    """Reports of an SLC 500 with two MicroLogix 1500 by radio: values of a silent site mixed."""
    device = LateNode(WIRINGS[mode])
    device.words.update({(1, 7, 0): 111, (2, 7, 0): 222})
    first, second = (make_mapping('N7:0', plc='SLC', station=number, tag=f'site{number}')
                     for number in (1, 2))
    bench = odd_bench(mode, device, first, second)
    bench.open(run=20.0)
    values = [{tuple(entry) for entry in bench.listener.values(row)} for row in (first, second)]
    assert values[0] == {(111,)}
    assert values[1] <= {(222,)}
    assert 2510 in bench.listener.numbers()
    assert len(bench.listener.values(first)) > 50


@for_all('mode', NETWORKS)
def test_strings_that_no_program_has_written_are_not_values(mode: str) -> None:
    """ST elements with LEN 65535, LEN 100, and LEN 3 before old text."""
    rows = [make_mapping(f'ST9:{number}', plc='SLC', tag=f's{number}') for number in range(3)]
    bench = DriverBench(rows, start=False, network=Network(
        baud=19200, timeout=200, **NETWORKS[mode]))  # type: ignore[arg-type]
    plc = bench.plc(1, 'SLC', ('ST9:0', 3 * 42))
    for number, length in enumerate((0xFFFF, 100, 3)):
        plc.table.write(parse_address(f'ST9:{number}', PlcType.SLC),
                        length.to_bytes(2, 'little') + 41 * b'BA')
    bench.open(run=2.0)
    assert [bench.listener.values(row)[:1] for row in rows] == [[], [], ['ABA']]
    assert bench.driver.stations[1].active


@pytest.mark.parametrize('mode', NETWORKS)
@pytest.mark.parametrize('has_reads', [True, False])
def test_first_number_of_a_new_process_may_be_the_last_one_of_the_old_process(
        mode: str, has_reads: bool) -> None:
    """The PLC takes our first command for a repetition: it acknowledges, and does nothing."""
    device, = (each for each in DEVICES if each.name == 'knows_the_last_tns_for_ever')
    words = make_mapping('N7:0', plc='SLC', length=3)
    target = make_mapping('N7:5', 'Write', plc='SLC')
    bench, plc = bench_of(device, mode, 'CRC', *([words] if has_reads else []), target)
    hear, numbers = bench.far.hear, [0]

    def note(data: bytes) -> bytes:
        if link := link_of(data):
            numbers.append(int.from_bytes(link[4:6], 'little'))
        return hear(data)

    bench.far.hear = note
    bench.open(run=1.0)
    bench.write(target, [1])
    bench.run_until(lambda: bool(bench.listener.results), 20.0)
    numbers.append(last := numbers[-1])
    bench.listener.reads.clear()
    bench.restart(first_tns=last - 1 & 0xFFFF)
    bench.write(target, [2])
    bench.run_until(lambda: len(bench.listener.results) == 2, 20.0)
    bench.run(3.0)
    assert numbers.count(last) > 2
    outcome = bench.listener.outcomes()[1]
    assert (outcome, stored(plc, 'N7:5')) in (
        (Outcome.WRITTEN, b'\x02\x00'), (Outcome.UNKNOWN, b'\x01\x00'))
    bench.write(target, [3], run=1.0)
    assert (bench.listener.outcomes()[2], stored(plc, 'N7:5')) == (Outcome.WRITTEN, b'\x03\x00')
    assert bool(bench.listener.values(words)) == has_reads


def test_every_device_has_a_source_and_a_name_of_its_own() -> None:
    assert all(device.source and device.modes for device in DEVICES + WRONG)
    assert len({device.name for device in DEVICES + WRONG}) == len(DEVICES + WRONG)
