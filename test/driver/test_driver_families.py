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

"""The driver against stations of every family."""

from unittest.mock import Mock

from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench, store, stored
from support.mappings import make_mapping

PLC2_WORDS = (('000', 512),)
PLC3_FILES = (('B10:0', 512), ('N10:0', 16), ('I:0', 16), ('O:0', 16), ('T:0.CTL', 30),
              ('C:0.CTL', 30), ('D1:0', 8), ('A1:0', 8), ('S:0', 16))
PLC5_FILES = (('N7:0', 512), ('F8:0', 64), ('B3:0', 16), ('T4:0', 30), ('ST9:0', 84),
              ('PD10:0', 164))
SLC_FILES = (('N7:0', 16), ('F8:0', 8), ('B3:0', 16), ('T4:0', 30), ('O:2.0', 4), ('ST12:0', 84),
             ('L13:0', 20))

# Family, access, address, length, type, values.
VALUES: list[tuple[str, str | None, str, int, str | None, list[float] | str]] = [
    ('PLC2', None, '020', 3, None, [1, 0x1010, 65535]),
    ('PLC2', None, '020', 2, 'int32', [-2, 70000]),
    ('PLC2', None, '110/17', 3, None, [1, 0, 1]), ('PLC2', None, '110/00', 1, None, [1]),
    ('PLC2', 'Protected', '020', 2, 'bcd16', [1234, 9999]),
    ('PLC2', None, '030', 2, 'bcd12', [123, 50]),
    ('PLC2', 'Protected', '020/07', 4, None, [1, 1, 0, 1]),
    ('PLC2', None, '020', 250, None, list(range(1000, 1250))),
    ('PLC3', None, 'E3.1.8.10.0.3', 3, None, [1, 2, 0x1010]),
    ('PLC3', None, 'B10:5/17', 2, None, [1, 1]), ('PLC3', None, 'N10:2', 2, None, [-1, 7]),
    ('PLC3', None, 'T:4.PRE', 2, None, [100, 42]), ('PLC3', None, 'O:17', 1, None, [0xFFFF]),
    ('PLC3', None, 'B10:0', 342, None, list(range(342))),
    ('PLC5', 'WordRange', 'N7:3', 4, None, [1, -2, 3, 0x1010]),
    ('PLC5', 'WordRange', 'F8:1', 3, None, [1000.0, -1.5, 0.0]),
    ('PLC5', 'WordRange', 'B3:1/5', 20, None, [1, 0] * 10),
    ('PLC5', 'WordRange', 'T4:2.ACC', 1, None, [77]),
    ('PLC5', 'WordRange', 'ST9:1', 1, None, 'word range'),
    ('PLC5', 'WordRange', 'PD10:1.SP', 1, None, [12.5]),
    ('PLC5', 'WordRange', 'N7:0', 300, None, list(range(-150, 150))),
    ('PLC5', None, 'N7:3', 2, None, [-5, 32767]), ('PLC5', None, 'F8:1', 2, None, [1.5, -0.25]),
    ('PLC5', None, 'N7:3', 2, 'bcd12', [0, 999]),
    ('PLC5', None, 'B3:2/14', 4, None, [1, 0, 1, 1]), ('PLC5', None, 'T4:1.PRE', 1, None, [5]),
    ('PLC5', None, 'ST9:1', 1, None, 'Größe 7'), ('PLC5', None, 'PD10:1.KP', 2, None, [1.5, -2.0]),
    ('SLC', None, 'N7:3', 2, None, [-5, 32767]), ('SLC', None, 'F8:1', 2, None, [1.5, -0.25]),
    ('SLC', None, 'O:2.0', 1, 'bcd12', [407]),
    ('SLC', None, 'B3:2/14', 4, None, [1, 0, 1, 1]), ('SLC', None, 'O:2.0', 1, None, [3]),
    ('SLC', None, 'T4:1.ACC', 1, None, [77]), ('SLC', None, 'ST12:1', 1, None, 'odd'),
    ('SLC', None, 'L13:2', 2, None, [-70000, 2**31 - 1])]
FILES = {'PLC2': PLC2_WORDS, 'PLC3': PLC3_FILES, 'PLC5': PLC5_FILES, 'SLC': SLC_FILES}


@for_all('check', ['CRC', 'BCC'])
@for_all(('plc', 'access', 'text', 'length', 'kind', 'values'), VALUES)
def test_value_is_written_and_read_back(
        check: str, plc: str, access: str | None, text: str, length: int, kind: str | None,
        values: list[float] | str) -> None:
    mapping = make_mapping(text, 'ReadWrite', plc=plc, length=length, kind=kind, access=access)
    bench = DriverBench([mapping], network=Network(baud=115200, error_code=check))
    station = bench.plc(1, plc, *FILES[plc])
    bench.run(0.3)
    bench.write(mapping, values, run=1.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(mapping)[-1] == values
    assert decoded(station, mapping) == values


def decoded(station: SimulatedPlc, mapping: Mapping) -> list[float] | str:
    """Return the values that the PLC holds."""
    start = mapping.address.at_offset(mapping.address.offset)
    values = mapping.codec.decode(station.table.read(start, mapping.codec.words))
    return values if isinstance(values, str) else list(values)


def test_digits_of_a_plc2_timer_are_written_without_its_status_bits() -> None:
    mapping = make_mapping('030', 'ReadWrite', plc='PLC2', kind='bcd12', access='Protected')
    bench = DriverBench([mapping])
    station = bench.plc(1, 'PLC2', *PLC2_WORDS)
    store(station, '030', [0xA123])
    heard = bench.far.hear = Mock(side_effect=bytes)
    bench.run(0.3)
    assert bench.listener.values(mapping)[-1] == [123]
    bench.write(mapping, [50], run=1.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert stored(station, '030') == b'\x50\xA0'
    # Protected bit write: of byte 48 set 50 and reset AF, of byte 49 reset 0F (M 7-19).
    assert bytes.fromhex('30 00 50 AF 31 00 00 0F') in b''.join(
        data for (data,), _ in heard.call_args_list)


def test_common_interface_file_of_an_slc() -> None:
    words = make_mapping('011', 'ReadWrite', plc='PLC2', access='CIF', length=60)
    bits = make_mapping('012/17', plc='PLC2', access='CIF')
    bench = DriverBench([words, bits])
    station = bench.plc(1, 'SLC', ('N9:0', 100))
    bench.run(0.3)
    bench.write(words, [0, 0x8000, *range(58)], run=1.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(words)[-1] == [0, 0x8000, *range(58)]
    assert bench.listener.values(bits)[-1] == [1]
    assert stored(station, 'N9:9', 2) == b'\0\0\0\x80'


def test_long_read_of_a_plc3_carries_its_offset() -> None:
    bench = DriverBench([make_mapping('E3.1.8.10.0.0', plc='PLC3', length=342, period=60_000)])
    bench.plc(1, 'PLC3', *PLC3_FILES)
    heard = bench.far.hear = Mock(side_effect=bytes)
    bench.run_until(lambda: bool(bench.listener.reads))
    line = b''.join(data for (data,), _ in heard.call_args_list)
    for offset, size in (('00', 'F4'), ('7A', 'F4'), ('F4', 'C4')):
        assert bytes.fromhex(f'01 {offset} 00 56 01 2C 08 0A 00 {size}') in line


REFUSALS = {
    'PLC2': 'STS 50: address outside the data table or the window, or no compatibility file',
    'PLC3': 'STS F0 EXT STS 06: file or word not there, or address does not lead to a word'}


@pytest.mark.parametrize(('plc', 'text'), [
    ('PLC2', '1000'), ('PLC3', 'B11:0'), ('PLC3', 'B10:512')])
def test_address_that_is_not_there_fails_alone(plc: str, text: str) -> None:
    good = make_mapping('000' if plc == 'PLC2' else 'B10:511', plc=plc)
    bad = make_mapping(text, plc=plc)
    bench = DriverBench([good, bad])
    bench.plc(1, plc, *FILES[plc])
    bench.run(1.0)
    assert bench.listener.values(bad) == []
    assert bench.listener.values(good)
    assert (text if plc == 'PLC2' else str(bad.address), REFUSALS[plc]) in bench.listener.reasons
