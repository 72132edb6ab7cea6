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

"""The bytes of TCP connections, put in order from recorded segments."""

from __future__ import annotations

from collections.abc import Iterator

MOST_EARLY = 8
"""Most segments that wait for an earlier segment."""


class TcpWay:
    """
    The bytes of one direction of a TCP connection, in their order.

    The methods yield parts: the sequence number of a part, and its bytes. Where bytes were lost,
    the number of a part is not the end of the part before.
    """

    def __init__(self) -> None:
        self._next: int | None = None
        self._early: dict[int, bytes] = {}

    def is_early(self, number: int) -> bool:
        """Return True for a segment before which a segment comes later, or was lost."""
        return self._next is not None and 0 < self._distance(number) < 1 << 31

    def feed(self, number: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Take a segment; yield what follows the bytes before."""
        self._next = number if self._next is None else self._next
        if len(data) > len(self._early.get(number, b'')):
            self._early[number] = data
        yield from self._follow()
        if len(self._early) > MOST_EARLY:
            yield from self.flush()

    def flush(self) -> Iterator[tuple[int, bytes]]:
        """Yield the bytes after the first that were lost."""
        if self._early:
            self._next = min(self._early, key=self._distance)
            yield from self._follow()

    def _distance(self, number: int) -> int:
        """Return how many bytes after the next byte a segment begins; its numbers wrap."""
        return number - (self._next or 0) & 0xFFFFFFFF

    def _follow(self) -> Iterator[tuple[int, bytes]]:
        while ready := [number for number in self._early if not self.is_early(number)]:
            number = ready[0]
            data = self._early.pop(number)[-self._distance(number) & 0xFFFFFFFF:]
            if data:
                assert self._next is not None
                number, self._next = self._next, self._next + len(data) & 0xFFFFFFFF
                yield number, data
