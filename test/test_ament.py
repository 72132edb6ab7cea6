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

"""The linters that every ROS package runs, as they come with Jazzy."""

from pathlib import Path

import pytest
from support.ros_tools import are_demanded, found, needs, TOOLS

ROOT = Path(__file__).resolve().parent.parent
# What is ours; a build or an environment may lie beside it.
SOURCES = [str(ROOT / name) for name in (
    'abdf1_ros', 'examples', 'launch', 'test', 'tools', 'setup.py')]


@pytest.mark.timeout(1800)  # 100 s of processor time for 600 files
def test_ament_flake8_finds_nothing_wrong() -> None:
    status, errors = needs('ament_flake8.main').main_with_errors(argv=SOURCES)
    assert (status, errors) == (0, [])


@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', ['ament_copyright', 'ament_pep257'])
def test_ament_finds_a_licence_header_in_every_file_and_sound_docstrings(name: str) -> None:
    assert needs(f'{name}.main').main(argv=SOURCES) == 0


def test_ament_xmllint_finds_nothing_wrong() -> None:
    # package.xml names a schema on a server; that is for those who have the Internet.
    folders = [str(ROOT / name) for name in ('config', 'examples', 'launch')]
    assert needs('ament_xmllint.main').main(argv=folders) == 0


def test_which_ros_tools_are_here(capsys: pytest.CaptureFixture[str]) -> None:
    missing = [name for name in TOOLS if name not in found()]
    with capsys.disabled():
        print(f'\nROS tools found: {", ".join(found()) or "none"}; '
              f'missing: {", ".join(missing) or "none"}')
    assert not (are_demanded() and missing)
