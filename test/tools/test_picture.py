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

"""The picture of a run: the line, the screen of the monitor, and curves with their gaps."""

from pathlib import Path
from xml.etree import ElementTree

from abdf1_ros.cli.monitor.view import NodeView, ShownStatus, Style, TextLine, TopicRow
import pytest

from tools import picture
from tools.picture import Curve

SVG = '{http://www.w3.org/2000/svg}'
LINES = [TextLine('/abdf1  OK: <&>', Style.GOOD), TextLine('  b', Style.BAD), TextLine('')]


def texts(svg: str) -> list[str]:
    """Return the texts in a picture."""
    return [(entry.text or '').replace('\N{NO-BREAK SPACE}', ' ')
            for entry in ElementTree.fromstring(svg).iter(f'{SVG}text')]


def snapshot(value: float, received: float, *statuses: ShownStatus) -> NodeView:
    reading = TopicRow('speed', [value], 'N7:0', received, 1.0)
    return NodeView('/abdf1', True, 0.0, statuses, [reading], None, [])


def drawn(*values: tuple[float, float, float]) -> ElementTree.Element:
    """Return the picture of a curve of values; each is taken at a time and was received before."""
    curve = Curve('speed', '/read/speed')
    for now, value, received in values:
        curve.take(snapshot(value, received), now)
    return ElementTree.fromstring(picture.picture(LINES, [], [curve], 30.0))


def test_screen_is_drawn_line_by_line_in_the_colours_of_the_terminal() -> None:
    svg = picture.picture(LINES, ['1: PLC-5/40', '2: SLC 5/03'], [], 0.0)
    assert {'/abdf1  OK: <&>', '  b', 'station 1', 'PLC-5/40', 'SLC 5/03'} <= {*texts(svg)}
    fills = {(entry.text or '').split('\N{NO-BREAK SPACE}')[-1]: entry.get('fill') for entry in
             ElementTree.fromstring(svg).iter(f'{SVG}text')}
    assert fills['<&>'] != fills['b']


def test_curve_rises_to_the_right_and_ends_where_no_value_is_fresh() -> None:
    svg = drawn((10.0, 0, 10.0), (11.0, 5, 11.0), (13.0, 5, 11.0), (20.0, 10, 20.0),
                (21.0, 10, 21.0))
    first, second = (
        [tuple(map(float, place.split(','))) for place in line.get('points', '').split()]
        for line in svg.iter(f'{SVG}polyline'))
    assert (len(first), len(second)) == (2, 2)
    assert first[0][0] < first[1][0] < second[0][0]
    assert first[0][1] > first[1][1] > second[0][1]
    assert [entry.text for entry in svg.iter(f'{SVG}text')].count('silent') == 1


def test_curve_without_values_is_empty() -> None:
    assert not [*drawn().iter(f'{SVG}polyline')]


def test_stations_are_named_by_their_processors() -> None:
    status = ShownStatus(
        'station 2', Style.GOOD, 'OK', {'processor': 'SLC 5/03 series A, REM RUN'})
    assert picture.stations_of(snapshot(1, 0, status)) == ['2: SLC 5/03']


@pytest.mark.long
def test_run_of_a_bridge_becomes_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture, 'SHOT', 15.0)
    monkeypatch.setattr(picture, 'STORY', ())
    assert picture.main([str(tmp_path / 'run.svg')]) == 0
    found = texts((tmp_path / 'run.svg').read_text(encoding='utf-8'))
    assert any(text.startswith('/abdf1  ') for text in found)
    assert any(text.startswith('  line_speed ') for text in found)
    assert 'station 2' in found


def test_picture_in_the_pages_shows_line_monitor_and_curves() -> None:
    svg = (Path(__file__).parents[2] / 'docs' / 'demo.svg').read_text(encoding='utf-8')
    assert {'station 1', 'bridge', 'silent'} <= {*texts(svg)}
    assert len([*ElementTree.fromstring(svg).iter(f'{SVG}polyline')]) == 3
