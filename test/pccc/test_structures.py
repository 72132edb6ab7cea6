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

"""Which parts of structures are which type, and which of them are not for others to write."""

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.structures import type_fault, write_fault
from abdf1_ros.pccc.values import ValueType
import pytest

PLC5, SLC = PlcType.PLC5, PlcType.SLC


def at(text: str, family: PlcType = PLC5) -> Address:
    """Return an address."""
    return parse_address(text, family)


@pytest.mark.parametrize(('text', 'kind', 'length'), [
    ('PD9:0.SP', 'float32', 24), ('PD9:0.TIE', 'float32', 1), ('PD9:0', 'int16', 2),
    ('PD9:0.50', 'uint16', 34), ('T4:0', 'int16', 30), ('BT9:0', 'int16', 60),
    ('N7:0', 'float32', 50), ('F8:0', 'float32', 9), ('PD9:0/EN', 'bool', 1)])
def test_ranges_of_one_type(text: str, kind: str, length: int) -> None:
    assert type_fault(at(text), ValueType(kind), length) is None


@pytest.mark.parametrize(('text', 'kind', 'length', 'fault'), [
    ('PD9:0.SP', 'float32', 25,
     '25 float32 from PD9:0.SP reach to PD9:0.50, where words of 16 bits are'),
    ('PD9:0', 'int16', 3, '3 int16 from PD9:0 reach to PD9:0.SP, where floats are'),
    ('PD9:0.80', 'uint16', 5, '5 uint16 from PD9:0.80 reach to PD9:1.SP, where floats are')])
def test_range_that_reaches_into_another_type(text: str, kind: str, length: int,
                                              fault: str) -> None:
    assert type_fault(at(text), ValueType(kind), length) == fault


@pytest.mark.parametrize(('text', 'family', 'kind', 'length'), [
    ('T4:0.PRE', PLC5, 'int16', 2), ('T4:0/DN', PLC5, 'bool', 3), ('T4:0.ACC/3', SLC, 'bool', 13),
    ('PD9:0.SP', PLC5, 'float32', 12), ('PD9:0/MO', PLC5, 'bool', 2),
    ('MG9:0/TO', PLC5, 'bool', 1),
    ('BT9:0/CO', PLC5, 'bool', 1), ('PD9:0.SPS', SLC, 'int16', 4), ('PD9:0/TM', SLC, 'bool', 4),
    ('N7:0', SLC, 'int16', 100), ('ST9:0', SLC, 'string', 1)])
def test_what_may_be_written(text: str, family: PlcType, kind: str, length: int) -> None:
    assert write_fault(at(text, family), ValueType(kind), length) is None


@pytest.mark.parametrize(('text', 'family', 'kind', 'length', 'wrong'), [
    ('T4:0', PLC5, 'int16', 1, 'T4:0'), ('T4:0.PRE', SLC, 'int16', 3, 'T4:1'),
    ('T4:0.0/12', SLC, 'bool', 2, 'T4:0.0/12'),
    ('PD9:0.SP', PLC5, 'float32', 13, 'PD9:0.PV'), ('PD9:0/INI', PLC5, 'bool', 1, 'PD9:0/INI'),
    ('PD9:0/SWM', PLC5, 'bool', 2, 'PD9:0/5'), ('PD9:0.54', PLC5, 'int16', 1, 'PD9:0.54'),
    ('MG9:0/EN', PLC5, 'bool', 1, 'MG9:0/EN'), ('BT9:0.RLEN', PLC5, 'int16', 1, 'BT9:0.RLEN'),
    ('MG9:0.RBL', SLC, 'int16', 1, 'MG9:0.RBL'), ('PD9:0.SPS', SLC, 'int16', 5, 'PD9:0.6'),
    ('PD9:0.17', SLC, 'int16', 1, 'PD9:0.17')])
def test_what_belongs_to_the_processor(text: str, family: PlcType, kind: str, length: int,
                                       wrong: str) -> None:
    fault = write_fault(at(text, family), ValueType(kind), length)
    assert fault is not None
    assert fault.startswith(
        f'{wrong} belongs to the processor; of such an element can be written: ')


def test_fault_says_what_may_be_written() -> None:
    assert str(write_fault(at('SC9:0.TIM'), ValueType.INT16, 1)).endswith('be written: PRE')
    assert str(write_fault(at('MG9:0.0', SLC), ValueType.INT16, 1)).endswith('written: nothing')
