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

"""The files of a bridge, and the simulator that goes with them as a process."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from std_msgs import msg
from support.ros import Process, ros_args, write_csv

NET_HEADER = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout'
# On a busy host a process may stand still for longer than PLCs are usually given time; so what is
# not about PLCs that do not answer gives them more.
NET_ROW = '2,2,5000,115200,3000'
IMPATIENT_ROW = '2,2,500,115200,200'

MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Type,Period,Publish,Min,Max,' \
    'Scale,Offset,Word_Order'
MAP_ROWS = (
    'bits,Read,B3:0/2,1,PLC5,6,,,,,', 'door,Read,I:017/12,1,PLC5,,,,,,',
    'rack,Read,I:017,1,PLC5,,,,,,', 'speeds,Read,N7:0,1,PLC5,2,,,,,',
    'levels,ReadWrite,F8:0,1,PLC5,3,,,,-50,150',
    'temperatures,ReadWrite,N7:4,1,PLC5,2,,,,-40,125,0.1,-40',
    'weight,ReadWrite,N7:6,1,PLC5,,uint32,,,,,0.5,,High', 'label,ReadWrite,A10:0,1,PLC5,3,string',
    'timer,Read,T4:1,1,PLC5,3,,,,,', 'timer/done,Read,T4:1/DN,1,PLC5,,,,,,',
    'counts,Read,C5:0,1,PLC5,6,,,,,', 'flags,ReadWrite,B3:4/1,1,PLC5,3,,,,,',
    'flag_word,Read,B3:4,1,PLC5,,,,,,', 'parts,Read,C5:2.ACC,2,SLC,,,,,,',
    'preset,ReadWrite,C5:2.PRE,2,SLC,,,,,,', 'gripper,Read,I:1.0,2,SLC,2,,,,,',
    'lamp,ReadWrite,O:2.0/3,2,SLC,,,,,,', 'lamps,Read,O:2.0,2,SLC,,,,,,',
    'total,ReadWrite,L10:0,2,SLC,2,,,,,', 'unsigned,Read,N7:40,2,SLC,,uint32,,,,',
    'name,ReadWrite,ST9:1,2,SLC,,,,,,', 'digits,ReadWrite,N7:30,2,SLC,2,bcd16,,,,',
    'setpoint,ReadWrite,F8:4,2,SLC,,,,,-50,150', 'recipe,ReadWrite,N7:10,2,SLC,4,,,Change,0,999',
    'heartbeat,Read,N7:60,2,SLC,,,1000,,,', 'reset,Write,B3:1/5,2,SLC,,,,,,',
)

# Diagnostics that come often, so that who waits for them does not wait long.
OFTEN = 'diagnostics_period:=0.2'

SIMULATOR_HEADER = 'Station,PLC_Type,Address,Length,Values,Motion,Period'
SIMULATOR_ROWS = (
    '1,PLC5,I:000,16,,,', '1,PLC5,I:017/12,1,1,,', '1,PLC5,B3:0,8,,,',
    '1,PLC5,B3:0/2,6,1 0 0 1 1 0,,', '1,PLC5,B3:4,1,65521,,', '1,PLC5,N7:0,16,1200 -800,,',
    '1,PLC5,N7:4,4,615 0 1 2,,', '1,PLC5,F8:0,8,12.5 40.25 -3.5,,',
    '1,PLC5,A10:0,3,24930 25344 0,,', '1,PLC5,T4:0,9,,,', '1,PLC5,T4:1.PRE,2,500 120,,',
    '1,PLC5,T4:1/DN,1,1,,', '1,PLC5,C5:0,6,,,', '1,PLC5,C5:1.PRE,2,9 8,,',
    '2,SLC,I:1.0,2,5 40960,,', '2,SLC,O:2.0,1,240,,', '2,SLC,B3:0,4,,,', '2,SLC,C5:0,9,,,',
    '2,SLC,C5:2.ACC,1,-17,,', '2,SLC,N7:0,64,,,', '2,SLC,N7:10,4,101 102 103 104,,',
    '2,SLC,N7:30,2,4660 153,,', '2,SLC,N7:40,2,-1 1,,', '2,SLC,N7:60,1,7,,', '2,SLC,F8:0,8,,,',
    '2,SLC,F8:4,1,21.5,,', '2,SLC,L10:0,2,-70000 2000000000,,', '2,SLC,ST9:0,1,,,',
    '2,SLC,ST9:1,1,Tank 4,,',
)

# Topic: type, label, values.
READS: dict[str, tuple[Any, str, list[float] | str]] = {
    'bits': (msg.UInt8MultiArray, 'B3:0/2', [1, 0, 0, 1, 1, 0]),
    'door': (msg.UInt8MultiArray, 'I:017/12', [1]),
    'rack': (msg.UInt16MultiArray, 'I:017', [1 << 0o12]),
    'speeds': (msg.Int16MultiArray, 'N7:0', [1200, -800]),
    'levels': (msg.Float32MultiArray, 'F8:0', [12.5, 40.25, -3.5]),
    'temperatures': (msg.Float32MultiArray, 'N7:4', [21.5, -40.0]),
    'weight': (msg.Float32MultiArray, 'N7:6', [32769.0]),
    'label': (msg.String, '', 'abc'),
    'timer': (msg.Int16MultiArray, 'T4:1', [1 << 13, 500, 120]),
    'timer/done': (msg.UInt8MultiArray, 'T4:1/DN', [1]),
    'counts': (msg.Int16MultiArray, 'C5:0', [0, 0, 0, 0, 9, 8]),
    'flags': (msg.UInt8MultiArray, 'B3:4/1', [0, 0, 0]),
    'flag_word': (msg.UInt16MultiArray, 'B3:4', [0xFFF1]),
    'parts': (msg.Int16MultiArray, 'C5:2.ACC', [-17]),
    'preset': (msg.Int16MultiArray, 'C5:2.PRE', [0]),
    'gripper': (msg.UInt16MultiArray, 'I:1.0', [5, 40960]),
    'lamp': (msg.UInt8MultiArray, 'O:2.0/3', [0]),
    'lamps': (msg.UInt16MultiArray, 'O:2.0', [0x00F0]),
    'total': (msg.Int32MultiArray, 'L10:0', [-70000, 2000000000]),
    'unsigned': (msg.UInt32MultiArray, 'N7:40', [0x1FFFF]),
    'name': (msg.String, '', 'Tank 4'),
    'digits': (msg.UInt16MultiArray, 'N7:30', [1234, 99]),
    'setpoint': (msg.Float32MultiArray, 'F8:4', [21.5]),
    'recipe': (msg.Int16MultiArray, 'N7:10', [101, 102, 103, 104]),
    'heartbeat': (msg.Int16MultiArray, 'N7:60', [7]),
}
WRITES = {'levels', 'temperatures', 'weight', 'label', 'flags', 'preset', 'lamp', 'total', 'name',
          'digits', 'setpoint', 'recipe', 'reset'}

STATUSES = ['link', 'counters', 'station 1', 'station 2', 'mappings', 'writes', 'topics']


@dataclass(frozen=True, slots=True)
class Files:
    """The files of a bridge; ``args`` are the node's arguments for them."""

    folder: Path
    net: Path
    map: Path  # noqa: A003
    simulator: Path
    port: Path

    def args(self, *assignments: str) -> list[str]:
        return ros_args(f'net_file:={self.net}', f'map_file:={self.map}',
                        f'port:={self.port}', OFTEN, *assignments)

    def start_simulator(self) -> Process:
        simulator = Process('simulator', '--pty', str(self.port), '--data', str(self.simulator))
        simulator.wait_for('stations 1 (PLC5), 2 (SLC) on')
        return simulator


def make_files(folder: Path, net_row: str = NET_ROW, period: int = 100) -> Files:
    return Files(
        folder, write_csv(folder / 'net.csv', NET_HEADER, [net_row]),
        write_csv(folder / 'map.csv', MAP_HEADER, [_every(period, row) for row in MAP_ROWS]),
        write_csv(folder / 'simulator.csv', SIMULATOR_HEADER, SIMULATOR_ROWS), folder / 'plc')


def _every(period: int, row: str) -> str:
    """Return a row with a Period (ms), its own if it has one."""
    cells = [*row.split(','), *8 * ['']]
    return ','.join([*cells[:7], cells[7] or str(period), *cells[8:14]])
