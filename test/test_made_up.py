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

"""What a new thing costs, shown by a patch that makes it in a copy of the package."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]

# A column of the map.
UNSEEN = """
from array import array
from abdf1_ros.driver.reads.point import ReadPoint
from support.mappings import cell_of, fault, one

row = one(Command='Read', Publish='Change', Unseen='7')
assert cell_of(row, 'Unseen') == '7' and cell_of(one(), 'Unseen') == ''
assert 'Unseen = "x" should be a number' in fault(Unseen='x')
assert 'a Write row has no Unseen: it is for Read' in fault(Command='Write', Unseen='7')
point = ReadPoint(row, 0.1, 0.6)
words = (b'\\x05\\x00', b'\\x07\\x00', b'\\x08\\x00')
assert [point.update(word, now) for now, word in enumerate(words)] == [
    array('h', [5]), None, array('h', [8])]
"""
# A command of a row: each new value of the row is a line of the log.
LOG = """
from types import SimpleNamespace
from abdf1_ros.ros.diagnostics.events import LineEvents
from abdf1_ros.ros.diagnostics.log import NodeLog
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
events = LineEvents(NodeLog(logger, lambda: 0.0), 'port', {1}, scans=True, seen=Seen(),
                    results=None, read=lambda row, values: published.append(row.tag),
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
# A verb of plc.
SPEEDS = """
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import StringIO
from abdf1_ros.cli.plc.command import main

def said(*words):
    text = StringIO()
    with redirect_stdout(text), redirect_stderr(text), suppress(SystemExit):
        print('status', main(words))
    return text.getvalue()

assert 'ports     list serial ports and adapters\\n    speeds    list the baud rates of a ' \\
    'serial port\\n' in said('--help'), said('--help')
assert 'List the baud rates of a serial port.' in said('speeds', '--help')
assert 'plc speeds --above 9600\\n' in said('speeds', '--help')
assert said('speeds', '--above', '40000') == '57600 115200\\nstatus 0\\n', said('speeds')
assert said('speeds', '--above', '115200').endswith('status 1\\n')
assert 'did you mean speeds?' in said('spedes')
"""


@pytest.mark.long
@pytest.mark.parametrize(('patch', 'program', 'most', 'where'), [
    ('settings/made_up_column.patch', UNSEEN, 3, ''), ('ros/made_up_command.patch', LOG, 10, ''),
    ('cli/plc/made_up_verb.patch', SPEEDS, 1, 'cli/plc/verbs/speeds.py')])
def test_a_new_thing_costs_so_many_files_at_most(
        tmp_path: Path, patch: str, program: str, most: int, where: str) -> None:
    path = ROOT / 'test' / patch
    text = path.read_text(encoding='utf-8')
    touched = re.findall(r'^\+\+\+ b/abdf1_ros/(\S+)', text, re.MULTILINE)
    assert 0 < len(touched) <= most
    assert all(file.startswith(where) for file in touched)
    shutil.copytree(ROOT / 'abdf1_ros', tmp_path / 'abdf1_ros',
                    ignore=shutil.ignore_patterns('__pycache__'))
    # Outside of a repository, so that git takes the paths as they are.
    environment = os.environ | {
        'GIT_CEILING_DIRECTORIES': str(tmp_path.parent), 'PYTHONPATH': os.pathsep.join(
            (str(tmp_path), str(ROOT / 'test')))}
    for command in (['git', 'apply', '-C1', str(path)], [sys.executable, '-c', program]):
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True,
                              text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
