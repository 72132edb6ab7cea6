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

"""How a press has to react to faults of the robot's computer, the line, or the PLC."""

import signal

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from std_msgs.msg import Int16MultiArray

DATA = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,SLC,N7:0,4,250,,
1,SLC,N10:0,4,,,
"""
ROWS = """\
Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After
pressure,Read,N7:0,1,SLC,100,,
beat,Heartbeat,N10:0,1,SLC,100,,
speed,Write,N10:1,1,SLC,,0,500
"""


@pytest.fixture
def cell(abdf1_cell):
    """Return a press whose PLC runs the program of the heartbeats tutorial."""
    return abdf1_cell(DATA, ROWS, ladders=[1])


@pytest.fixture
def pressure(cell):
    """Return the messages with the pressure."""
    return cell.ros.listen(Int16MultiArray, '/abdf1/read/pressure')


def test_value_of_the_plc_comes_as_a_topic(cell, pressure):
    assert list(pressure.first().data) == [250]
    cell.plcs.set('N7:0', 300)
    pressure.until(lambda message: list(message.data) == [300], 'the new pressure')


def test_speed_falls_back_when_nobody_publishes_any_more(cell):
    speed = cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed')

    def has_speed():
        speed.publish(Int16MultiArray(data=[70]))
        return cell.plcs.word('N10:1') == 70

    cell.ros.until(has_speed, 'the speed')
    cell.ros.until(lambda: cell.plcs.word('N10:1') == 0, 'the fallback value')


def test_bridge_tells_that_the_plc_is_silent(cell):
    diagnostics = cell.ros.listen(DiagnosticArray, '/diagnostics', 10)
    cell.plcs.say('silent 1')
    diagnostics.until(lambda array: array.status[0].level == DiagnosticStatus.ERROR, 'an error')


def test_value_of_a_slow_plc_comes_too(cell, pressure):
    cell.plcs.say('delay 1 300')
    pressure.first()


def test_plc_stops_the_press_when_the_bridge_is_killed(cell):
    speed = cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed')

    def is_in_control():  # the PLC accepts a reset after 4 s of heartbeats, while the speed is 0
        cell.plcs.say('reset 1')
        return cell.plcs.word('B12:0') & 1 << 2

    def runs():  # after a pause of the heartbeats the PLC needs a new reset, at speed 0
        if is_in_control():
            speed.publish(Int16MultiArray(data=[70]))
        return cell.plcs.word('N11:2') == 70  # the speed that the program lets through

    cell.ros.until(runs, 'the press')
    cell.end(signal.SIGKILL)
    cell.ros.until(lambda: cell.plcs.word('N11:2') == 0, 'its end')
