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


"""Mistakes are single ones, and each makes another program."""

import ast
from pathlib import Path

from mutation.mutants import mutants, mutated
import pytest

MODULE = Path('module.py')
SOURCE = '''
@dataclass(frozen=True)
class Reader:
    """Reads."""

    def read(self, count: int | None = 3) -> bool:
        assert count is not None
        if not self.is_open and count < 7:
            self.start()
        return self.take(count + 1)
'''


def test_every_mistake_is_made_where_it_says() -> None:
    for path in sorted((Path(__file__).parents[3] / 'abdf1_ros' / 'df1').glob('*.py')):
        source = path.read_text(encoding='utf-8')
        plain = ast.unparse(ast.parse(source)).splitlines()
        for mutant in mutants(MODULE, source)[::60]:
            other = mutated(mutant, source).splitlines()
            assert sum(a != b for a, b in zip(plain, other)) == 1, mutant


@pytest.mark.parametrize(('line', 'text'), [
    ('self.start()', '...'), ('count + 1', 'count - 1'), ('count + 1', 'count + 2'),
    ('count < 7', 'count <= 7'), ('count < 7', 'count < 8'), ('and', 'or'),
    ('not self.is_open', 'not not self.is_open'), ('= 3', '= 4'),
    ('return self.take(count + 1)', 'return None'),
    ('if not self.is_open and count < 7', 'if not (not self.is_open and count < 7)')])
def test_mistakes_of_a_function(line: str, text: str) -> None:
    wanted = ast.unparse(ast.parse(SOURCE.replace(line, text)))
    assert [mutated(mutant, SOURCE) for mutant in mutants(MODULE, SOURCE)].count(wanted) == 1


def test_what_only_readers_see_is_left_alone() -> None:
    assert len(mutants(MODULE, SOURCE)) == 10
