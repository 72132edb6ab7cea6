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

"""Bits that mean a fault of the plant: a status each row, and no alarm that nobody sees."""

from array import array
from pathlib import Path
import re

from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.plan.report import make_report
from abdf1_ros.ros.diagnostics.alarms import Alarms, AlarmStatus
from abdf1_ros.ros.diagnostics.status import ERROR, OK, WARN
from abdf1_ros.settings.network import Network
import pytest
from std_msgs.msg import UInt8MultiArray
from support.mappings import cell_of, fault, one
from support.ros import BridgeCell

STALE = 0.6


class Bench:
    """A row of two bits, and the clock."""

    def __init__(self, alarm: str = 'ERROR', **cells: str) -> None:
        row = one(Command='Read', Address='B3:0/3', Length='2', Alarm=alarm, **cells)
        self.now = 100.0
        self.point = ReadPoint(row, 0.2, STALE)
        others = [ReadPoint(one(Command='Read', Address='B3:1/0', Alarm=text), 0.2, STALE)
                  for text in ('WARN', '')]
        self.alarms = Alarms([*others, self.point], '/dev/plc', lambda: self.now)
        self.status: AlarmStatus
        _, self.status = self.alarms.statuses

    def read(self, *bits: int, after: float = 0.1) -> None:
        """Read the row ``after`` so many seconds."""
        self.now += after
        self.point.update(bytes([bits[0] << 3 | bits[1] << 4, 0]), self.now)
        self.alarms.read(self.point.mapping, array('B', bits))

    def says(self) -> tuple[bytes, str]:
        """Return level and text."""
        return self.status.judge(self.now)


def test_bit_with_a_name_is_told_by_it() -> None:
    bench = Bench(Bits='|drive 3 fault', Description='Drives')
    bench.read(1, 1)
    assert bench.says() == (
        ERROR, 'B3:0/3 for 0.0 s, 1 time, drive 3 fault for 0.0 s, 1 time: Drives')
    assert [*bench.status.values(bench.now)] == ['B3:0/3', 'drive 3 fault']


def test_bits_are_alarms_each_for_itself() -> None:
    bench = Bench(Description='Guard doors')
    bench.read(0, 0)
    assert bench.says() == (OK, 'no alarm: Guard doors')
    bench.read(0, 1)
    bench.read(0, 1, after=0.4)
    bench.alarms.forget()  # a status has shown it; it lasts
    assert bench.says() == (ERROR, 'B3:0/4 for 0.4 s, 1 time: Guard doors')
    assert bench.status.values(bench.now) == {'B3:0/3': 'never', 'B3:0/4': 'for 0.4 s, 1 time'}
    bench.read(1, 1)
    assert bench.says()[1].startswith('B3:0/3 for 0.0 s, 1 time, B3:0/4 for 0.5 s, 1 time')


def test_alarm_between_two_statuses_is_shown_once() -> None:
    bench = Bench('WARN')
    for _ in range(3):
        bench.read(1, 0)
        bench.read(0, 0)
    assert bench.says() == (WARN, 'B3:0/3 3 times, gone 0.0 s ago')
    assert bench.status.values(bench.now)['B3:0/3'] == '3 times, gone 0.0 s ago'
    assert bench.says()[0] == WARN  # whoever looks changes nothing
    bench.alarms.forget()
    assert bench.says() == (OK, 'no alarm')
    bench.read(1, 0)
    assert bench.says()[0] == WARN
    bench.read(1, 0)  # while the status is made
    bench.alarms.forget()
    bench.read(0, 0)
    assert bench.says()[0] == WARN  # it was on after that status, too


@pytest.mark.parametrize('alarm', ['WARN 0', 'warn  0'])
def test_zero_may_be_the_alarm(alarm: str) -> None:
    bench = Bench(alarm)
    bench.read(1, 0)
    assert bench.says() == (WARN, 'B3:0/4 for 0.0 s, 1 time')


def test_what_is_not_known_is_never_well() -> None:
    bench = Bench('WARN', Description='Guard')
    assert bench.says() == (WARN, 'unknown: its row is waiting for the first read: Guard')
    bench.read(0, 0)
    bench.now += STALE + 0.1
    assert bench.says() == (ERROR, 'unknown: its row is stale: Guard')
    bench.point.fail('STS 10')
    assert bench.says() == (ERROR, 'unknown: its row is failed: Guard')


def test_column() -> None:
    assert cell_of(one(Command='Read', Address='B3:0/3', Alarm='error 1'), 'Alarm') == 'ERROR'
    assert 'Alarm = "bad" should be WARN or ERROR, for a 1' in fault(Alarm='bad')
    assert fault(Address='N7:0', Alarm='WARN').endswith('Alarm is for bits (bool), such as B3:0/0')
    assert 'a Write row has no Alarm' in fault(Command='Write', Address='B3:0/3', Alarm='WARN')


def test_check_names_the_rows() -> None:
    row = one(Command='Read', Address='B3:0/3', Alarm='ERROR')
    assert f'alarms on /diagnostics: {row.tag}' in make_report(Network(), [row], 0.1).notes()


def test_bridge_reports_the_alarm_of_a_plc(tmp_path: Path) -> None:
    rows = ('Tag,Command,Address,Station,PLC_Type,Alarm\nlamp,Read,B3:0/2,1,PLC5,\n'
            'door,Read,B3:0/1,1,PLC5,ERROR\n')
    data = 'Station,PLC_Type,Address,Length,Values\n1,PLC5,B3:0,1,0\n'
    net = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout\n1,1,5000,115200,3000\n'

    def text_of(array: object) -> str:
        return next((status.message for status in array.status  # type: ignore[attr-defined]
                     if status.name == 'abdf1: alarm door'), '')

    with BridgeCell(tmp_path, data, rows, net) as cell:
        cell.diagnostics.until(lambda array: text_of(array) == 'OK: no alarm', 'no alarm')
        door = cell.ros.listen(UInt8MultiArray, '/abdf1/read/door')
        cell.plcs.set('B3:0', 2)
        door.values([1])  # an alarm is a value too
        cell.diagnostics.until(lambda array: re.fullmatch(
            r'ERROR: B3:0/1 for \d+\.\d s, 1 time', text_of(array)) is not None, 'the alarm')
        cell.diagnostics.clear()
        cell.plcs.set('B3:0', 0)
        cell.diagnostics.until(lambda array: text_of(array) == 'OK: no alarm', 'its end')
