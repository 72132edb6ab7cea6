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

"""Which of the real ROS tools were here, so that a report of skipped tests can be judged."""

import pytest
from support.ros_tools import are_demanded, found, TOOLS


def test_which_ros_tools_are_here(capsys: pytest.CaptureFixture[str]) -> None:
    missing = [name for name in TOOLS if name not in found()]
    with capsys.disabled():
        print(f'\nROS tools found: {", ".join(found()) or "none"}; '
              f'missing: {", ".join(missing) or "none"}')
    assert not (are_demanded() and missing)
