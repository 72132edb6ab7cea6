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

"""The layout for Foxglove shows what the demo publishes, and nothing that is not there."""

import json
import re
from typing import Any

from abdf1_ros.paths import config_file
from abdf1_ros.settings.map_file import load_mappings
import pytest
from support.ros_tools import SOURCE

LAYOUT = json.loads((SOURCE / 'examples' / 'foxglove_layout.json').read_text('utf-8'))


def shown() -> list[str]:
    """Return every topic or path to an element that a panel takes."""
    values: list[str] = []
    for panel in LAYOUT['configById'].values():
        values += [path['value'] for path in panel.get('paths', [])]
        values += [panel[key] for key in ('topicPath', 'topicToRender') if key in panel]
    return values


def panels(layout: Any) -> list[str]:
    """Return the panels that a layout places on the screen."""
    if isinstance(layout, str):
        return [layout]
    return panels(layout['first']) + panels(layout['second'])


def test_every_panel_has_its_place() -> None:
    assert sorted(panels(LAYOUT['layout'])) == sorted(LAYOUT['configById'])


@pytest.fixture
def topics() -> dict[str, int]:
    """Return what a bridge with the files of the demo publishes, with the length of its arrays."""
    mappings, _ = load_mappings(config_file('map.csv'))
    # That it has these topics is in test_bridge.py.
    return {'/diagnostics': 0, '/abdf1/write_results': 0, '/abdf1/snapshot': 0,
            **{f'/abdf1/read/{mapping.topic}': mapping.length for mapping in mappings}}


@pytest.mark.parametrize('value', shown())
def test_what_is_shown_is_published_by_the_demo(value: str, topics: dict[str, int]) -> None:
    match = re.fullmatch(r'(/[\w/]+)(?:\.data\[(\d+)\])?', value)
    assert match, value
    assert match[1] in topics
    if match[2] is not None:
        assert int(match[2]) < topics[match[1]]
