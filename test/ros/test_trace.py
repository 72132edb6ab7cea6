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

"""The node records its line when it is asked to, and runs on when it cannot."""

import json
from pathlib import Path

from abdf1_ros.cli.sniff import main as sniff
from abdf1_ros.sniffer.entries import Kind
import pytest
from std_msgs.msg import Float32MultiArray
from support.commands import call
from support.ros import Observer, Process
from support.simulator_process import Files, make_files


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return make_files(tmp_path)


def test_trace_of_a_running_node_tells_what_it_has_read(
        files: Files, capsys: pytest.CaptureFixture[str]) -> None:
    trace = files.folder / 'field.cap'
    with (files.start_simulator(), Observer() as observer,
          Process('node', *files.args(f'trace_file:={trace}')) as node):
        observer.listen(Float32MultiArray, '/abdf1/read/setpoint').values([21.5])
        node.end()
    *entries, summary = map(json.loads, call(sniff, capsys, '--json', str(trace)).good_lines)
    texts = {entry.get('text', '').partition(': ')[2] for entry in entries}
    assert 'protected typed logical read F8:4, 1 element' in texts
    assert '21.5' in texts
    assert (summary['check'], summary['duplex'], summary['baud']) == ('CRC', 'half', 115200)
    assert (summary['damaged'], summary['noise']) == (0, 0)
    # On a busy host the simulator may be slow or silent for a moment, and is asked again.
    assert summary['marks'].keys() <= {'retransmission'}
    assert set(summary['counts']) <= {
        kind.value for kind in (Kind.COMMAND, Kind.REPLY, Kind.POLL, Kind.ACK, Kind.EOT,
                                Kind.UNANSWERED, Kind.SILENCE)}
    assert summary['counts']['reply'] > 10


def test_trace_that_cannot_be_written_is_an_error_and_no_stop(files: Files) -> None:
    trace = files.folder / 'nowhere' / 'field.cap'
    with (files.start_simulator(), Observer() as observer,
          Process('node', *files.args(f'trace_file:={trace}')) as node):
        node.wait_for('[ERROR] ', 'trace_file: [Errno 2] No such file or directory: '
                                  f"'{trace}'; nothing is recorded")
        observer.listen(Float32MultiArray, '/abdf1/read/setpoint').values([21.5])
        node.end()
