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

"""The fixtures of pytest; where ROS 2 is, an import keeps all topics in a domain of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from abdf1_ros.testing.plcs import Plcs
import pytest

if TYPE_CHECKING:
    from abdf1_ros.testing.cell import SimulatedCell

_LACKING = ''
try:  # now, because a program of the test may make the first context
    from abdf1_ros.testing import cell as _cell
except ImportError as error:
    _LACKING = str(error)


@pytest.fixture
def abdf1_plcs(tmp_path: Path) -> Iterator[Callable[..., Plcs]]:
    """
    Return a function that makes ``Plcs`` of the text of a simulator CSV; they end with the test.

    Each call makes a line of its own. ``ladders`` are stations with the program of
    docs/tutorials/heartbeats.md.
    """
    numbers = count(1)
    with ExitStack() as stack:
        def made(data: str, ladders: Sequence[int] = ()) -> Plcs:
            if not isinstance(data, str) or '\n' not in data:
                raise ValueError(f'{data!r} should be the text of a simulator CSV, with its first '
                                 'row; Plcs takes the path of a file')
            folder = tmp_path / f'line{next(numbers)}'
            folder.mkdir()
            (folder / 'data.csv').write_text(data, encoding='utf-8')
            return stack.enter_context(Plcs(folder / 'data.csv', ladders))

        yield made


@pytest.fixture
def abdf1_cell(tmp_path: Path) -> Iterator[Callable[..., SimulatedCell]]:
    """
    Return a function that makes a ``SimulatedCell`` of texts; the cell ends with the test.

    Its context is the default one, so a node of the test needs no context as an argument.
    """
    if _LACKING:
        pytest.fail(f'abdf1_cell needs ROS 2 ({_LACKING}): is it sourced, as by '
                    '". /opt/ros/jazzy/setup.bash"? abdf1_plcs does without', pytrace=False)
    with ExitStack() as stack:
        context = stack.enter_context(_cell.default_context())
        yield lambda *texts, **options: stack.enter_context(
            _cell.SimulatedCell(tmp_path, *texts, context=context, **options))
