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

"""Where the files of the package are found."""

from pathlib import Path
import sys
from types import ModuleType

from abdf1_ros import paths
import pytest


@pytest.mark.parametrize('name', ['net.csv', 'map.csv', 'simulator.csv'])
def test_file_of_the_source_tree(name: str) -> None:
    path = paths.config_file(name)
    assert path.is_file()
    assert path.parent == Path(__file__).resolve().parent.parent / 'config'


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Pretend that the module lies where there is no config folder beside it."""
    monkeypatch.setattr(paths, '__file__', str(tmp_path / 'lib' / 'abdf1_ros' / 'paths.py'))
    return tmp_path


def _ament_index(monkeypatch: pytest.MonkeyPatch, share: Path | Exception) -> None:
    module = ModuleType('ament_index_python.packages')

    def get_package_share_directory(package: str) -> str:
        assert package == 'abdf1_ros'
        if isinstance(share, Exception):
            raise share
        return str(share)

    module.get_package_share_directory = (  # type: ignore[attr-defined]
        get_package_share_directory)
    monkeypatch.setitem(sys.modules, 'ament_index_python', ModuleType('ament_index_python'))
    monkeypatch.setitem(sys.modules, 'ament_index_python.packages', module)


def test_file_of_the_installed_package(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _ament_index(monkeypatch, installed / 'share')
    assert paths.config_file('net.csv') == installed / 'share' / 'config' / 'net.csv'


@pytest.mark.parametrize('error', [LookupError(), OSError('AMENT_PREFIX_PATH is not set')])
def test_file_of_a_package_that_no_index_knows(
        installed: Path, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    _ament_index(monkeypatch, error)
    assert paths.config_file('net.csv') == \
        Path(sys.prefix) / 'share' / 'abdf1_ros' / 'config' / 'net.csv'


def test_installed_file_is_found_without_ros(
        installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'ament_index_python', None)
    monkeypatch.setitem(sys.modules, 'ament_index_python.packages', None)
    assert paths.config_file('map.csv').parts[-4:] == ('share', 'abdf1_ros', 'config', 'map.csv')
