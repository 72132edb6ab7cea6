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

"""Commands of other nodes that we refuse: by what they ask, and how many are kept."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.refused import RefusedCommands
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.network import Network
from support.driver_bench import DriverBench
from support.mappings import make_mapping


def write(element: int, value: int = 1, src: int = 1) -> Packet:
    """Return a typed write of one word to N7."""
    data = bytes((0xAA, 2, 7, 0x89, element, 0, value, 0))
    return Packet(5, src, 0x0F, 0, 1, data)


def test_other_values_and_later_times_are_the_same_command() -> None:
    refused = RefusedCommands(PlcType.SLC)
    for now in range(3):
        refused.add(write(0, now), write(0).reply(sts=0x10), float(now))
    refused.add(write(0), write(0).reply(), 3.0)  # is not refused
    (text, count), = refused.counted().items()
    assert (text.startswith('station 1: '), ' N7:0: STS 10: ' in text, count) == (True, True, 3)
    assert refused.lately(61.9) == [text]
    assert refused.lately(62.0) == []


def test_flood_of_different_commands_is_bounded() -> None:
    refused = RefusedCommands(PlcType.PLC5)
    for element in range(200):
        refused.add(write(element), write(element).reply(b'\x06', 0xF0), 0.0)
    assert len(refused.counted()) == 8
    assert 'STS F0 EXT STS 06' in refused.lately(0.0)[0]


def test_driver_keeps_what_it_refuses() -> None:
    bench = DriverBench([make_mapping('N7:0', 'Serve', station=5, plc='SLC')],
                        network=Network(plc_type='SLC'))
    assert [bench.driver.serve(write(element)).sts for element in (0, 9)] == [0, 0x50]
    text, = bench.driver.refused.counted()
    assert ' N7:9: STS 50: ' in text
