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

"""Find files that have changed since they were read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
import threading

_Stamp = tuple[int, int, int]

PERIOD = 2.0  # s between two looks


class FileWatch:
    """
    Remembers the state of files, to notice changes; make it before you read the files.

    It looks in a thread of its own, because a mount without its server may hang for ever.
    """

    def __init__(self, paths: Iterable[str] = ()) -> None:
        self._stamps = {path: _stamp(path) for path in paths}
        self._changed: list[str] = []
        self._next_look = 0.0
        self.looking = threading.Thread()

    def changed(self, now: float) -> list[str]:
        """Return the names of files that have changed or gone, as of the last look."""
        if now >= self._next_look and not self.looking.is_alive():
            self._next_look = now + PERIOD
            self.looking = threading.Thread(target=self._look, name='files', daemon=True)
            self.looking.start()
        return self._changed

    def _look(self) -> None:
        self._changed = [Path(path).name for path, stamp in self._stamps.items()
                         if _stamp(path) != stamp]


def _stamp(path: str) -> _Stamp | None:
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
