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

"""The rules of ament's linters that ``make lint`` adds to those of ruff."""

from pathlib import Path

import pytest
from support.cases import for_all

ament = pytest.importorskip('tools.ament')

HEADER = Path(__file__).read_text(encoding='utf-8').partition('""')[0]


@for_all(('source', 'expected'), [
    ('x = 1\n', []),
    ('class Door:\n\n    def opened(self) -> None:\n        """Open it."""\n', []),
    ('class Door:\n    """A door."""\n\n    def shut(self) -> None:\n        pass\n', []),
    ('class Door:\n    def shut(self) -> None:\n        pass\n', ['CNL100']),
    ('class Door:\n\n    @final\n    def shut(self) -> None:\n        pass\n', []),
    ('class Door:\n\n    def open(self) -> None:\n        pass\n', ['A003']),
    ('class Door:\n\n    def open(self) -> None:  # noqa: A003\n        pass\n', []),
    ('class Door:\n    type = 3\n', ['A003']), ('class Door:\n    type: int\n', ['A003']),
    ("class Door:\n    __doc__ = 'a door'\n", []),
    ('import wall\nif TYPE_CHECKING:\n    import door\n', ['I300']),
    ('import wall\n\nx = 1\nif TYPE_CHECKING:\n    import door\n', ['I300']),
    ('import wall\n\nx = 1\nif TYPE_CHECKING:\n    import door  # noqa: I300\n', []),
    ('import typing\n\nif typing.TYPE_CHECKING:\n    import door\n', []),
    ('x = "it\'s" "b"\n', ['Q000']),
    ('x = "it\'s"\n', []), ('x = """a"""\n', []),
    ('def sent(x: int) -> None:\n    """Judge what is sent (rule 3)."""\n', ['D402']),
    ('def sent(x: int) -> None:\n    """Judge what goes out (rule 3)."""\n', [])])
def test_rule(source: str, expected: list[str]) -> None:
    found = [text.partition(':')[0] for _, text in ament.findings_in(HEADER + source)]
    assert found == expected


def test_licence_header_is_needed_below_the_interpreter_at_most() -> None:
    assert [*ament.findings_in('#!/usr/bin/env python3\n' + HEADER)] == []
    assert [line for line, _ in ament.findings_in('x = 1\n')] == [1]
    assert [*ament.findings_in('')] == []
