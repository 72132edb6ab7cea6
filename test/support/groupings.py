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

"""Every way to put a few things into groups, for searches that leave nothing out."""

from collections.abc import Iterator, Sequence
import itertools
from typing import TypeVar

_Item = TypeVar('_Item')


def groupings(items: Sequence[_Item]) -> Iterator[list[list[_Item]]]:
    """Yield every way to put ``items``, all different, into groups."""
    if not items:
        yield []
        return
    head, *rest = items
    for size in range(len(rest) + 1):
        for others in itertools.combinations(rest, size):
            left = [item for item in rest if item not in others]
            for groups in groupings(left):
                yield [[head, *others], *groups]
