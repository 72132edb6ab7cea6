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

"""File types, processors and I/O of PLC-5, SLC and MicroLogix, from the line to the listener."""

from collections.abc import Callable

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import DriverBench, Program, store, stored
from support.mappings import make_mapping


def test_members_of_one_pid_come_together_and_right() -> None:
    names = ['SP', 'KP', 'KI', 'KD', 'PV', 'ERR', 'OUT', 'TIE']
    mappings = [make_mapping(f'PD10:1.{name}') for name in names]
    mappings.append(make_mapping('PD10:1/SPOR'))
    bench = DriverBench(mappings)
    plc = bench.plc(1, 'PLC5', ('PD10:0', 3 * 82))
    for number, name in enumerate(names):
        store(plc, f'PD10:1.{name}', [number + 0.5])
    store(plc, 'PD10:1/SPOR', [1])
    bench.run_until(lambda: len(bench.listener.reads) == len(mappings))
    assert len(bench.driver.readings.blocks) == 1
    assert [bench.listener.values(mapping) for mapping in mappings] == [
        *([[number + 0.5]] for number in range(len(names))), [[1]]]


class OldPlc(SimulatedPlc):
    """
    A PLC with packets of 82 bytes that knows no masked write.

    ``meanwhile`` is called with each function code before the command is carried out.
    """

    meanwhile: Callable[[int], object] = staticmethod(lambda function: None)

    def serve(self, command: Packet) -> Packet:
        """Refuse what it does not know or take."""
        if command.cmd != slc.CMD:
            return super().serve(command)
        function, size = command.data[:2]
        self.meanwhile(function)
        if function == slc.MASKED_WRITE or size > 82:
            return command.reply(sts=0x10)
        return super().serve(command)


def old_bench(mapping: Mapping, polling: str = 'Message') -> tuple[DriverBench, OldPlc]:
    """Return a bench with an old PLC on the line."""
    bench = DriverBench([mapping], network=Network(baud=19200, timeout=200, polling=polling))
    table = DataTable(PlcType.SLC)
    plc = OldPlc(1, table, bench.network.checksum, bench.clock)
    for text, words in (('N7:0', 256), ('B3:0', 8)):
        table.create(make_mapping(text, plc='SLC').address, words)
    bench.connect(plc)
    return bench, plc


def test_old_slc_is_read_and_written_in_packets_of_82_bytes() -> None:
    mapping = make_mapping('N7:0', 'ReadWrite', plc='SLC', length=200, processor='5/02')
    values = list(range(200))
    bench, plc = old_bench(mapping)
    bench.write(mapping, values, run=2.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(mapping)[-1] == values
    assert stored(plc, 'N7:199') == (199).to_bytes(2, 'little')


def test_packets_of_a_5_03_are_too_long_for_an_old_slc_and_become_shorter() -> None:
    mapping = make_mapping('N7:0', plc='SLC', length=100)
    bench, plc = old_bench(mapping)
    store(plc, 'N7:0', list(range(100)))
    bench.run(1.0)
    assert bench.listener.values(mapping)[-1] == list(range(100))
    assert bench.listener.reasons == []
    assert bench.driver.stations[1].remote_errors == 4  # 100 words, then 50, each twice


def test_change_between_reading_and_writing_back_is_lost_as_the_result_says() -> None:
    mapping = make_mapping('B3:1/4', 'Write', plc='SLC', processor='5/01')
    bench, plc = old_bench(mapping)

    def interfere(function: int) -> None:
        if function == slc.LOGICAL_WRITE:
            store(plc, 'B3:1', [0x0002])

    plc.meanwhile = interfere
    bench.write(mapping, [1], run=0.5)
    assert str(bench.listener.results[0]).endswith('a change that the PLC made in between is lost')
    assert stored(plc, 'B3:1') == bytes.fromhex('10 00')
    bench.write(mapping, [0], run=0.5)
    assert stored(plc, 'B3:1') == bytes(2)
    plc.meanwhile = lambda function: setattr(
        plc.faults, 'silent', function == slc.LOGICAL_READ)  # then nothing has been changed
    bench.write(mapping, [1], run=10.0)
    assert bench.listener.outcomes()[-1] is Outcome.NOT_SENT


@pytest.mark.parametrize(('polling', 'dst'), [('Message', 1), ('Standard', 255)])
def test_guests_write_goes_after_the_word_is_written_back(polling: str, dst: int) -> None:
    mapping = make_mapping('B3:1/4', 'Write', plc='SLC', processor='5/01')
    bench, plc = old_bench(mapping, polling)
    bench.write(mapping, [1], run=0.5)  # of the next write only one packet goes before guests
    program, two = Program(bench, ShareAccess.ALL), bytes.fromhex('AA 02 03 85 01 00 02 00')
    plc.meanwhile = lambda function: function == slc.LOGICAL_READ and program.ask(two, dst)
    bench.write(mapping, [0], run=0.5)
    confirmed = 0x05 if dst == 255 else 0
    assert (program.statuses, stored(plc, 'B3:1')) == ([confirmed], b'\2\0')


def test_flat_io_is_read_and_written_through_the_slots() -> None:
    inputs = make_mapping('I:1', plc='SLC', length=3, access='Flat')
    output = make_mapping('O:1/5', 'ReadWrite', plc='SLC', access='Flat')
    slot = make_mapping('I:3.0', plc='SLC')
    bench = DriverBench([inputs, output, slot])
    plc = bench.plc(1, 'SLC', ('I:1.0', 2), ('I:3.0', 2), ('O:2.0', 1), ('O:4.0', 1))
    store(plc, 'I:1.0', [10, 11])
    store(plc, 'I:3.0', [12, 13])
    bench.run(0.3)
    bench.write(output, [1], run=0.5)
    assert bench.listener.values(inputs)[-1] == [11, 12, 13]
    assert bench.listener.values(slot)[-1] == [12]
    assert bench.listener.values(output)[-1] == [1]
    assert stored(plc, 'O:4.0') == bytes.fromhex('20 00')
    # What is flat is never read with what is a slot's.
    assert len(bench.driver.readings.blocks) == 3
