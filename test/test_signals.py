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

"""The end of a process that a signal asks for."""

import subprocess
import sys

from abdf1_ros.signals import EndRequest

# What stays until the interpreter takes its modules apart, when it has no signal handler any more.
SLOW_END = """
import time
from abdf1_ros.signals import limit_output

class Slow:
    def __del__(self, sleep=time.sleep):
        sleep(0.5)

slow = Slow()
limit_output(0.2)
print('last words')
"""


def test_second_signal_does_not_begin_the_end_again() -> None:
    begun: list[float] = []
    end = EndRequest((), lambda: begun.append(end.when))
    for _ in range(2):
        end.set()
    assert begun == [end.when]
    assert end.is_set()


def test_alarm_of_the_last_output_does_not_kill_a_slow_end() -> None:
    ended = subprocess.run(
        [sys.executable, '-c', SLOW_END], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, 'last words\n', '')
