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

"""The one way from other threads into the thread of the link."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

_Item = TypeVar('_Item')


class Inbox(Generic[_Item]):
    """
    Hand items from any threads to one thread that takes them, in their order, each once.

    ``items`` are the items that wait. Unless it ``is_open``, an inbox accepts no item. There is no
    lock: every step is one atomic operation of a deque. The items are never copied and then
    cleared: an item that another thread adds in between would be lost.
    """

    def __init__(self, is_open: bool = True) -> None:
        self.items: deque[_Item] = deque()
        self.is_open = is_open

    def __len__(self) -> int:
        """Return how many items wait."""
        return len(self.items)

    def open(self) -> None:  # noqa: A003
        """Accept items from now on."""
        self.is_open = True

    def close(self) -> Iterator[_Item]:
        """Accept no more items; return the items that wait."""
        self.is_open = False
        return self.take()

    def put(self, item: _Item) -> bool:
        """Add an item and return True; return False, without the item, if the inbox is closed."""
        self.items.append(item)
        if self.is_open:
            return True
        # The inbox was closed before, or just now. In the second case the closing thread may have
        # taken the item.
        try:
            self.items.remove(item)
        except ValueError:
            return True
        return False

    def take(self) -> Iterator[_Item]:
        """Yield and remove the items that wait, also items that are added meanwhile."""
        while True:
            try:
                yield self.items.popleft()
            except IndexError:
                return
