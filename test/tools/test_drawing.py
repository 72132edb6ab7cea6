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

"""The drawing shows the arrows of the code, and none of them leads back."""

import re

import pytest

from tools import drawing
from tools.rooms import Room, room_of, ROOMS

A, B, C = Room(('a.py',), ''), Room(('b.py',), ''), Room(('c.py',), '')


def test_what_a_longer_way_implies_is_left_out() -> None:
    assert drawing.reduced({A: {B, C}, B: {C}, C: set()}) == {A: {B}, B: {C}, C: set()}


@pytest.fixture(scope='module')
def found() -> dict[Room, set[Room]]:
    return drawing.arrows()


def test_arrows_are_the_imports(found: dict[Room, set[Room]]) -> None:
    assert room_of('pccc/address.py') in found[room_of('settings/mapping.py')]
    assert room_of('ports/link_thread.py') in found[room_of('ros/node.py')]
    assert found[room_of('messages.py')] == set()


def test_no_room_leads_back_to_itself(found: dict[Room, set[Room]]) -> None:
    for room in ROOMS:
        reached: set[Room] = set()
        waiting = [room]
        while waiting:
            for target in found[waiting.pop()] - reached:
                assert target is not room, room.name
                reached.add(target)
                waiting.append(target)


def test_drawing_names_every_room_once() -> None:
    text = drawing.mermaid()
    labels = re.findall(r'\["(.*?)"\]', text)
    assert [label.replace('<br>', ', ') for label in labels] == [room.name for room in ROOMS]
    assert re.search(r'r\d+ --> r\d+', text)
