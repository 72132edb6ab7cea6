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

"""A file for the targets whose input is one."""

from functools import cache
from pathlib import Path
import tempfile

_MEMORY = Path('/dev/shm')


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(
        prefix='abdf1_fuzz_', dir=_MEMORY if _MEMORY.is_dir() else None)


def path_of(data: bytes) -> str:
    """Return the path of a file with this content; the next call overwrites it."""
    path = Path(_folder().name, 'input.csv')
    path.write_bytes(data)
    return str(path)
