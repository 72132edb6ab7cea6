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


"""What holds for all tests: the examples of property tests, and which files begin."""

from __future__ import annotations

from pathlib import Path

from hypothesis import HealthCheck, settings
import pytest

# Files that wait for other processes, the longest first. Tests that only compute come after them,
# also the longest first: several workers then share the processors better, and end together.
_FIRST = (
    'ros/test_process.py', 'faults/', 'cli/monitor/', 'examples/', 'ros/', 'test_docs', 'test_',
    'cli/', 'noise/', 'df1/test_multidrop_line.py', 'soak/', 'df1/test_peer_line.py', 'driver/',
    'df1/', 'fuzz/')

_HERE = Path(__file__).parent

settings.register_profile(
    'abdf1_ros', derandomize=True, max_examples=150, deadline=None, database=None,
    suppress_health_check=[HealthCheck.too_slow])
settings.load_profile('abdf1_ros')


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files in their order."""
    def rank(item: pytest.Item) -> int:
        path = item.path.relative_to(_HERE).as_posix()
        return next((at for at, start in enumerate(_FIRST) if path.startswith(start)), len(_FIRST))

    items.sort(key=rank)
