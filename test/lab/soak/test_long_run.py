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

"""The parts of the long run that need no hour."""

from __future__ import annotations

import subprocess
import sys

import pytest
from soak.long_run import Counts, difference, growth, Sample

# Other threads of this process may come and go.
GROWING = """
import os, threading
print('small', flush=True)
input()
threading.Thread(target=threading.Event().wait, daemon=True).start()
kept = os.pipe(), bytes(range(256)) * (1 << 18)  # 64 MiB
print('large', flush=True)
input()
"""


def test_sample_is_what_the_process_has() -> None:
    with subprocess.Popen([sys.executable, '-c', GROWING], text=True, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stdout is not None
        assert process.stdout.readline() == 'small\n'
        before = Sample.take(process.pid)
        process.stdin.write('\n')
        process.stdin.flush()
        assert process.stdout.readline() == 'large\n'
        after = Sample.take(process.pid)
        process.communicate('\n', timeout=30)
    assert (after.threads, after.descriptors) == (before.threads + 1, before.descriptors + 2)
    assert 60 < after.memory - before.memory < 140
    assert after.cpu >= before.cpu and after.cpu > 0


@pytest.mark.parametrize('after, expected', [
    ({'a': (110, 10), 'b': (57, 7)}, 0), ({'a': (111, 10), 'b': (57, 7)}, 1),
    ({'a': (110, 10), 'b': (53, 7)}, 4)])
def test_counters_are_compared_since_the_last_round(after: Counts, expected: int) -> None:
    before = {'a': (100, 99), 'b': (50, 3)}
    assert difference(before, after) == (expected, 0)
    again = 'CNT_ENQ_RETRIES'
    assert difference({**before, again: (4, 0)}, {**after, again: (6, 0)}) == (expected, 2)


def test_growth_leaves_the_first_quarter_out() -> None:
    samples = [Sample(float(memory), 1, 1, 0.0)
               for memory in (10, 30, 70, 70, 71, 72, 72, 90, 73, 73, 74, 72)]
    assert growth(samples) == 73 - 71
