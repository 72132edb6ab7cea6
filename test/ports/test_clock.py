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

"""The clock of lines counts while the host sleeps (rule 6 of docs/heartbeats.md)."""

import inspect
import time

from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread


def test_rule_6_clock_counts_a_suspend() -> None:
    before = time.clock_gettime(time.CLOCK_BOOTTIME)
    assert before <= line_time() <= time.clock_gettime(time.CLOCK_BOOTTIME)


def test_rule_6_link_thread_has_that_clock() -> None:
    assert inspect.signature(LinkThread).parameters['clock'].default is line_time
