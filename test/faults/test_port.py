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

"""What happens to ports, done to a real node and a real simulator; see docs/troubleshooting.md."""

import os
from pathlib import Path

from support.fault_rig import boxed, is_unanswered, NOT_SENT, rigged, SETPOINT
from support.ros import ERROR, Observer, Process
from support.simulator_process import IMPATIENT_ROW, make_files

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
