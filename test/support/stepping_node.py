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

"""The node in a process whose wall clock steps: SIGUSR1 an hour ahead, SIGUSR2 an hour back."""

import signal
import sys
import time

from abdf1_ros.ros.node import main

_HOUR = 3600 * 10**9


class WallClock:
    """Stand in for the clock of ``time``; DDS and rclcpp below Python keep the true one."""

    def __init__(self) -> None:
        self._offset = 0
        self._true_ns = time.time_ns

    def time_ns(self) -> int:
        """Return the nanoseconds of the clock that steps."""
        return self._true_ns() + self._offset

    def time(self) -> float:
        """Return the seconds of the clock that steps."""
        return self.time_ns() / 1e9

    def step(self, number: int, frame: object) -> None:
        """Step; how far is a matter of the signal."""
        self._offset += _HOUR if number == signal.SIGUSR1 else -_HOUR
        print('the clock has stepped', flush=True)


if __name__ == '__main__':
    clock = WallClock()
    time.time_ns, time.time = clock.time_ns, clock.time
    signal.signal(signal.SIGUSR1, clock.step)
    signal.signal(signal.SIGUSR2, clock.step)
    sys.exit(main())
