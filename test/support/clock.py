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

"""A clock that tests set themselves, and one that does not count what a busy host takes."""

from collections import defaultdict
from contextlib import suppress
import os
from pathlib import Path
import time


class Clock:
    """A clock that stands still at `now`, in seconds, until a test sets it."""

    def __init__(self, now: float = 50.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


class Stopwatch:
    """
    The time since it was made, less what the processes in question waited for a processor.

    So a bound on what they do holds beside any load, which is measured and not guessed. Threads of
    one process wait at the same time, so that one counts which waited longest.
    """

    def __init__(self, *processes: int) -> None:
        """Begin; ``processes`` count beside this one."""
        self._processes = {os.getpid(), *processes}
        self._began, self._waited = time.monotonic(), self._waits()

    @property
    def seconds(self) -> float:
        """Return the time without the waits, in s."""
        lost: defaultdict[int, int] = defaultdict(int)
        for (process, thread), wait in self._waits().items():
            waited = wait - self._waited.get((process, thread), 0)
            lost[process] = max(lost[process], waited)
        return time.monotonic() - self._began - sum(lost.values()) / 1e9

    def _waits(self) -> dict[tuple[int, str], int]:
        """Return how long (ns) each thread has waited for a processor so far."""
        waits = {}
        for process in self._processes:
            for file in Path(f'/proc/{process}/task').glob('*/schedstat'):
                with suppress(OSError):  # the thread has ended
                    waits[process, file.parent.name] = int(file.read_text('ascii').split()[1])
        return waits
