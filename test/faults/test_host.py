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

"""What happens to processes, clocks and ports of a real node; see docs/troubleshooting.md."""

import os
from pathlib import Path
import re
import signal
import time

from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from std_msgs.msg import Int16MultiArray, UInt8MultiArray
from support.fault_rig import boxed, is_unanswered, NOT_SENT, rigged, SETPOINT
from support.ros import ERROR, Observer, Process
from support.simulator_process import IMPATIENT_ROW, make_files

TOO_OLD = re.compile(
    r'not written: refused: it came \d+\.\d s after it was published, write_timeout is ')
HERE = Path(__file__).resolve().parent.parent


def test_node_is_stopped_and_goes_on(observer: Observer, tmp_path: Path) -> None:
    files = make_files(tmp_path)
    with rigged(observer, files, str(files.port), files.start_simulator(),
                'write_timeout:=0.5') as rig:
        rig.until_well()
        watched = observer.listen(Int16MultiArray, '/abdf1/read/speeds',
                                  QoSProfile(depth=1, deadline=Duration(seconds=2)))
        watched.first()
        publisher = observer.publisher(UInt8MultiArray, '/abdf1/write/flags')
        rig.node.stop()
        watched.deadlines.clear()
        for _ in range(3):
            publisher.publish(UInt8MultiArray(data=[1, 1, 1]))
        published = time.monotonic()
        observer.until(lambda: watched.deadlines, 'the deadline of the reader')
        observer.until(lambda: time.monotonic() - published > 0.6, 'the pulses to become old')
        flags = observer.listen(UInt8MultiArray, '/abdf1/read/flags', QoSProfile(depth=100))
        rig.node.go_on()
        rig.recovers()
        observer.until(lambda: len(rig.results) == 3, 'a result for each pulse')
        assert all(TOO_OLD.match(result.message) for result in rig.results)
        flags.next()
        flags.next()
        assert all(list(message.data) == [0, 0, 0] for message in flags)
        assert rig.has_read_only(SETPOINT)
        observer.forget(flags)
        observer.forget(watched)
        observer.node.destroy_publisher(publisher)


def test_clock_of_the_host_that_steps_changes_no_age(observer: Observer, tmp_path: Path) -> None:
    files = make_files(tmp_path)
    with rigged(observer, files, str(files.port), files.start_simulator(),
                program=HERE / 'support' / 'stepping_node.py') as rig:
        rig.until_well()
        lines = len(rig.node.lines)
        rig.node.send(signal.SIGUSR1)
        rig.node.wait_for('the clock has stepped')
        rig.recovers()
        # Here the publisher's clock has not stepped, as if it were another host.
        assert re.match(r'not written: refused: it came 36\d\d\.', rig.write(3.0))
        for result in ('written', r'not written: refused: its time stamp is 36\d\d\.. s ahead'):
            after = len(rig.node.lines)  # an hour back, and then behind the publisher
            rig.node.send(signal.SIGUSR2)
            rig.node.wait_for('the clock has stepped', after=after)
            rig.recovers()
            rig.observer.until(lambda expected=result: re.match(expected, rig.write(4.0)), result)
        assert 'ERROR' not in '\n'.join(rig.node.lines[lines:])


REFUSED = 'not written: refused: the port is not open'


def test_device_vanishes_and_returns_as_another_of_its_name(
        observer: Observer, tmp_path: Path) -> None:
    with boxed(observer, tmp_path) as (rig, box):
        rig.writes(3.0)
        device = os.readlink(box.name)
        box.unplug()
        rig.status('link', ERROR, 'cannot open the port: ')
        rig.node.wait_for('[ERROR]', f'{box.name}: the port was lost: ')
        rig.node.wait_for('[ERROR]', f'{box.name}: cannot open the port: ', 'No such file')
        rig.status('mappings', ERROR, '25 failed')
        rig.status('station 2', ERROR, 'unknown: the port is not open')
        rig.writes(4.0, REFUSED)
        lines = len(rig.node.lines)
        box.plug(other_than=device)
        assert os.readlink(box.name) != device
        rig.recovers()
        rig.node.wait_for('[INFO]', f'{box.name}: open', after=lines)
        assert rig.has_read_only(SETPOINT, 3.0)


def test_process_at_the_far_end_of_tcp_is_frozen(observer: Observer, tmp_path: Path) -> None:
    files = make_files(tmp_path, IMPATIENT_ROW)
    simulator = Process('simulator', '--tcp', '127.0.0.1:0', '--data', str(files.simulator))
    url = simulator.wait_for(' on socket://').split(' on ')[1].split(',')[0]
    with rigged(observer, files, url, simulator) as rig:
        rig.until_well()
        simulator.stop()
        assert is_unanswered(rig.write(3.0))
        rig.status('link', ERROR, 'port open, but none of 2 stations answers')
        rig.writes(4.0, NOT_SENT + 'nothing has been heard on this connection')  # rule 26
        simulator.go_on()
        rig.recovers()
        # Commands that the connection has kept are expired for the far end, and not answered.
        assert rig.has_read_only(SETPOINT, 3.0)
