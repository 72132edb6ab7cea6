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

"""What ``import abdf1_ros`` gives: a manual whose example runs, and a version."""

from pathlib import Path
import subprocess
import sys
import textwrap

import abdf1_ros
from abdf1_ros.client import Client
from abdf1_ros.errors import Abdf1Error, FormatError, LinkError, PortLost, RemoteError
from abdf1_ros.paths import package_version
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.tagged_client import TaggedClient
import pytest
from support.cases import for_all
from support.driver_bench import simulated_plc, stored
from support.plc_line import plc_line

PACKAGE = Path(abdf1_ros.__file__).parent


def example() -> str:
    """Return the program in the docstring of the package."""
    lines = (abdf1_ros.__doc__ or '').split('\n')
    first = next(number for number, line in enumerate(lines) if 'import Client' in line)
    last = next(number for number, line in enumerate(lines) if 'identify()' in line)
    return textwrap.dedent('\n'.join(lines[first:last + 1]))


def test_example_of_the_manual_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plc = simulated_plc(1, 'SLC', lambda: 0.0, ('N7:0', 10), ('B3:0', 1))
    with plc_line(tmp_path / 'line', plc) as port:
        program = example().replace("'/dev/ttyUSB0'", f"'{port}', duplex='half', baud=115200")
        names: dict[str, object] = {}
        exec(program, names)  # noqa: S102
    assert names['speeds'] == [0] * 10
    assert (stored(plc, 'N7:0'), stored(plc, 'B3:0')) == (b'\1\0', b'\2\0')
    assert capsys.readouterr().out.startswith('SLC 5/')


def test_import_loads_neither_the_port_nor_the_rest() -> None:
    program = (
        'import sys; import abdf1_ros; found = {name for name in sys.modules if '
        "name.startswith(('abdf1_ros.', 'serial', 'rclpy'))}; assert not found, found; "
        'assert abdf1_ros.__version__; assert "serial" not in sys.modules; '
        'from abdf1_ros import Client; assert not any(name.startswith("rclpy") '
        'for name in sys.modules)')
    subprocess.run([sys.executable, '-c', program], check=True, timeout=60, cwd=PACKAGE.parent)


def test_names_of_the_package() -> None:
    assert abdf1_ros.Client is Client
    assert abdf1_ros.__version__ == package_version()
    assert {*abdf1_ros.__all__} <= {*dir(abdf1_ros)}
    shown = {name: getattr(abdf1_ros, name) for name in abdf1_ros.__all__}
    errors = {error for error in shown.values()
              if isinstance(error, type) and issubclass(error, Exception)}
    assert errors == {Abdf1Error, ConfigurationError, FormatError, LinkError, PortLost,
                      RemoteError}
    assert all(issubclass(error, abdf1_ros.Abdf1Error) for error in errors)
    assert abdf1_ros.TaggedClient is TaggedClient
    with pytest.raises(AttributeError, match='Clients'):
        abdf1_ros.Clients  # noqa: B018


@for_all('folder', [
    'driver', 'driver/kernel', 'driver/reads', 'driver/writes', 'plan', 'ports', 'settings'])
def test_map_of_a_folder_names_what_is_there(folder: str) -> None:
    named = set((PACKAGE / folder / '__init__.py').read_text(encoding='utf-8').split('``')[1::2])
    there = {path.stem for path in (PACKAGE / folder).iterdir()} | {'check', 'df1', 'driver'}
    assert named - there == set()


def test_map_of_the_package_names_each_room() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if (path / '__init__.py').exists()}
    assert rooms - set((abdf1_ros.__doc__ or '').split('``')[1::2]) == set()
