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

"""What speaks against new files of a line that runs, and what they change."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.bridge.reload import changes, refuse_harm
from abdf1_ros.ros.parameters.declared import Configuration, Parameters
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from support.mappings import make_mapping

ROW = make_mapping(tag='speed')


def configured(*rows: Any, port: str = '/dev/ttyS0', **network: Any) -> Configuration:
    return Configuration(
        Parameters(map_file='map.csv'), Network(**network), port, Rows(rows), [], {})


def refusal(before: Configuration, after: Configuration, *, is_open: bool = True,
            reason: str = '') -> tuple[str, list[str]]:
    """Return the text of a refusal, empty where there is none, and which ports were tried."""
    tried = []

    def judge(settings: PortSettings) -> str:
        tried.append(settings.name)
        return reason

    settings = PortSettings(after.port)
    try:
        refuse_harm(before, after, is_open, settings, judge)
    except ConfigurationError as error:
        return str(error), tried
    return '', tried


def test_map_without_rows_would_end_all_topics() -> None:
    text = ('map.csv: it has no row, so all topics would end; only a line with Share may have '
            'no row')
    assert refusal(configured(ROW), configured()) == (text, [])
    assert refusal(configured(), configured()) == ('', [])
    assert refusal(configured(ROW), configured(share='pty:/tmp/hmi')) == ('', [])


def test_only_another_device_is_tried_and_only_by_a_line_that_runs() -> None:
    here, there = configured(ROW), configured(ROW, port='/dev/ttyS77')
    reason = 'No such file or directory'
    assert refusal(here, there, reason=reason) == (
        f'port: /dev/ttyS77 cannot be opened: {reason}', ['/dev/ttyS77'])
    assert refusal(here, there) == ('', ['/dev/ttyS77'])
    assert refusal(here, here, reason=reason) == ('', [])
    assert refusal(here, there, is_open=False, reason=reason) == ('', [])


def test_other_name_of_the_same_device_is_not_tried(tmp_path: Path) -> None:
    link = tmp_path / 'plc'
    link.symlink_to('/dev/null')
    assert refusal(configured(ROW, port='/dev/null'), configured(ROW, port=str(link))) == ('', [])


def test_changes_are_named() -> None:
    before = configured(ROW, make_mapping('N7:9', tag='gone'))
    assert changes(before, before) == 'nothing has changed'
    after = configured(make_mapping('N7:1', tag='speed'), make_mapping('N7:2', tag='new'),
                       port='/dev/ttyS1', baud=19200, share='pty:/tmp/hmi')
    assert changes(before, after) == (
        'port /dev/ttyS1 (was /dev/ttyS0); Baud 19200 (was 9600); Share pty:/tmp/hmi (was '
        'empty); new: new; gone: gone; changed: speed')
    moved = configured(replace(ROW, item=7))
    assert changes(configured(ROW), moved) == 'nothing has changed', 'its line in the file'
