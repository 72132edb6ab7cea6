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

"""A verb of plc that is made up, speeds: one file has to know it."""

from pathlib import Path

from support.patched import run_patched, touched

PATCH = Path(__file__).with_name('made_up_verb.patch')

PROGRAM = """
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
assert 'example:\\n  plc speeds --above 9600\\n' in said('speeds', '--help')
assert said('speeds', '--above', '40000') == '57600 115200\\nstatus 0\\n', said('speeds')
assert said('speeds', '--above', '115200').endswith('status 1\\n')
assert 'did you mean speeds?' in said('spedes')
"""


def test_a_new_verb_costs_one_file(tmp_path: Path) -> None:
    assert touched(PATCH) == ['abdf1_ros/cli/plc/verbs/speeds.py']
    run_patched(PATCH, PROGRAM, tmp_path)
