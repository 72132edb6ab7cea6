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

"""What other threads hand to the link comes once, whatever they do at the same moment."""

from collections import deque
from collections.abc import Iterator
import sys
import threading

from abdf1_ros.driver.inbox import Inbox
import pytest

SENDERS = 4
ITEMS = 4000


class Emptied(deque[str]):
    """Items that another thread takes as soon as they come."""

    def append(self, item: str) -> None:
        """Keep nothing."""


@pytest.fixture
def restless() -> Iterator[None]:
    """Let threads take turns as often as Python can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_items_come_in_order_and_once() -> None:
    inbox: Inbox[str] = Inbox()
    assert [inbox.put(item) for item in 'ab'] == [True, True]
    assert len(inbox) == 2
    assert list(inbox.take()) == ['a', 'b']
    assert list(inbox.take()) == []


def test_what_is_added_while_items_are_taken_comes_too() -> None:
    inbox: Inbox[int] = Inbox()
    inbox.put(0)
    seen = []
    for item in inbox.take():
        seen.append(item)
        if item < 3:
            inbox.put(item + 1)
    assert seen == [0, 1, 2, 3]


def test_closed_inbox_takes_nothing_and_gives_what_waited() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.put('a')
    assert list(inbox.close()) == ['a']
    assert not inbox.put('b')
    inbox.open()
    assert list(inbox.take()) == []
    assert inbox.put('c')
    assert list(inbox.take()) == ['c']
    inbox.close()
    inbox.items = Emptied()
    assert inbox.put('d')  # it was taken


def test_no_item_is_lost_or_taken_twice_under_stress(restless: None) -> None:
    inbox: Inbox[tuple[int, int]] = Inbox()
    accepted: list[list[tuple[int, int]]] = [[] for _ in range(SENDERS)]

    def send(sender: int) -> None:
        for number in range(ITEMS):
            item = sender, number
            if inbox.put(item):
                accepted[sender].append(item)

    senders = [threading.Thread(target=send, args=(number,)) for number in range(SENDERS)]
    for sender in senders:
        sender.start()
    taken: list[tuple[int, int]] = []
    while any(sender.is_alive() for sender in senders):
        taken += inbox.take()
        taken += inbox.close()  # the port is lost, and comes back
        inbox.open()
    taken += inbox.take()
    assert len(taken) == len(set(taken))
    for sender, items in enumerate(accepted):
        assert [item for item in taken if item[0] == sender] == items
