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

"""A command of a row that is made up, Log: each new value of the row is a line of the log."""

from pathlib import Path

from support.patched import run_patched, touched

PATCH = Path(__file__).with_name('made_up_command.patch')

PROGRAM = """
from types import SimpleNamespace
from abdf1_ros.ros.diagnostics.events import LineEvents
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.ros.topics.reads import ReadTopics
from support.driver_bench import DriverBench, store
from support.mappings import fault, load_rows, row

rows, problems = load_rows(row(Command='Log'), row(Tag='b', Command='Read', Address='N7:1'))
assert problems == [], problems
assert 'a Log row has no Topic: it is for Read' in fault(Command='Log', Topic='a')

lines, published = [], []
logger = SimpleNamespace(info=lines.append, warning=lines.append, error=lines.append,
                         is_enabled_for=lambda severity: False)
events = LineEvents(logger, 'port', {1}, scans=True, seen=Seen(), results=None,
                    read=lambda row, values: published.append(row.tag),
                    table_changed=lambda: None)
bench = DriverBench(rows, listener=events)
plc = bench.plc(1, 'PLC5', ('N7:0', 2))
bench.run(1.0)
store(plc, 'N7:0', [7])
bench.run(3.0)
assert [line for line in lines if 'N7:0' in line] == [
    'a (N7:0 at station 1): [0]', 'a (N7:0 at station 1): [7]'], lines
assert set(published) == {'b'}

node = SimpleNamespace(create_publisher=lambda kind, name, *rest, **more: name)
topics = ReadTopics(node, {})
topics.open(bench.driver.points)
topics.take_over()
assert [topic.publisher for topic in topics._topics.values()] == ['~/read/b']
"""


def test_a_new_command_of_a_row_costs_ten_files_at_most(tmp_path: Path) -> None:
    assert len(touched(PATCH)) <= 10
    run_patched(PATCH, PROGRAM, tmp_path)
