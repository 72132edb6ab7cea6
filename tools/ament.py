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

"""
The rules of ament's linters that ruff does not have, for ``make lint``.

``colcon test`` of ROS runs ament_flake8, ament_pep257, ament_copyright and ament_xmllint. This
module follows their versions in Ubuntu 24.04. From the root: ``python -m tools.ament``.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator
import io
from pathlib import Path
import sys
import tokenize
from xml.etree import ElementTree

import pycodestyle

ROOT = Path(__file__).resolve().parent.parent
_FOLDERS = 'abdf1_ros', 'examples', 'launch', 'test', 'tools'
_HEADER = ''.join(Path(__file__).read_text(encoding='utf-8').partition('limitations')[:2])
_MOST_COLUMNS = 99
# flake8 itself leaves E121, E123 and E126 out.
_CODES = 'E122', 'E124', 'E125', 'E127', 'E128', 'E129', 'E131', 'E501'

Finding = tuple[int, str]
"""A line and its fault."""


def sources() -> Iterator[Path]:
    """Yield all Python files of ours."""
    yield ROOT / 'setup.py'
    for folder in _FOLDERS:
        yield from sorted((ROOT / folder).rglob('*.py'))


def findings_in(source: str) -> Iterator[Finding]:
    """Yield faults that only ament_copyright, ament_flake8 and ament_pep257 find."""
    shown = source.partition('\n')[2] if source.startswith('#!') else source
    if shown and not shown.startswith(_HEADER):
        yield 1, 'copyright: the licence header is missing, or is another'
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ClassDef):
            yield from _in_class(node, lines)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = (ast.get_docstring(node) or '').partition('\n')[0]
            if f'{node.name}(' in first.replace(' ', ''):
                yield node.lineno, 'D402: the first line of the docstring reads like a signature'
    yield from _far_type_imports(ast.parse(source).body, lines)
    yield from _needless_double_quotes(source)


def _far_type_imports(body: list[ast.stmt], lines: list[str]) -> Iterator[Finding]:
    """Yield imports for types that do not follow the other imports after one empty line."""
    end = None
    for node in body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            end = node.end_lineno
        elif end and isinstance(node, ast.If) and 'TYPE_CHECKING' in ast.unparse(node.test):
            first = node.body[0].lineno
            if first - end != 3 and 'noqa: I300' not in lines[first - 1]:
                yield first, 'I300: "if TYPE_CHECKING" is not one line below the other imports'


def _needless_double_quotes(source: str) -> Iterator[Finding]:
    """Yield each string in double quotes without need; ruff judges adjacent strings together."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        text = token.string.lstrip('bBfFrRuU')
        if token.type == tokenize.STRING and text.startswith('"') \
                and not text.startswith('"""') and "'" not in text:
            yield token.start[0], 'Q000: double quotes where single quotes would do'


def _in_class(node: ast.ClassDef, lines: list[str]) -> Iterator[Finding]:
    for item in node.body:
        if isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef):
            names = [item.name]
        elif isinstance(item, ast.Assign | ast.AnnAssign):
            targets = item.targets if isinstance(item, ast.Assign) else [item.target]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
        else:
            continue
        if any(hasattr(builtins, name) for name in names if not name.startswith('__')) \
                and 'noqa: A003' not in lines[item.lineno - 1]:
            yield item.lineno, 'A003: a class attribute has the name of a builtin'
    first = node.body[0]
    above = min([first.lineno, *(item.lineno for item in getattr(first, 'decorator_list', ()))])
    if isinstance(first, ast.FunctionDef | ast.AsyncFunctionDef) and lines[above - 2].strip():
        yield node.lineno, 'CNL100: no empty line between a class and its first method'


def main() -> int:
    """Print the faults; return 1 if there are any."""
    style = pycodestyle.StyleGuide(select=_CODES, max_line_length=_MOST_COLUMNS)
    count: int = style.check_files([str(path) for path in sources()]).total_errors
    for path in sources():
        for line, text in findings_in(path.read_text(encoding='utf-8')):
            print(f'{path.relative_to(ROOT)}:{line}: {text}')
            count += 1
    for path in sorted(ROOT.glob('*.xml')) + sorted(
            path for folder in ('config', 'examples', 'launch')
            for path in (ROOT / folder).rglob('*.xml')):
        try:
            ElementTree.parse(path)
        except ElementTree.ParseError as error:
            print(f'{path.relative_to(ROOT)}: xmllint: {error}')
            count += 1
    return min(count, 1)


if __name__ == '__main__':
    sys.exit(main())
