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
Make one mistake at a time in the code that decides what is written, and look for a story of it.

``drawn.py --seed 1`` draws 30: a comparison turned, a term left out, an event ignored (a statement
deleted), a time not compared. ``drawn.py --lot carried.json`` makes those that people have written
down. Each is made in a copy of the tree. First all stories with one deviation are told, then the
pairs of ``--pairs`` scenes. It prints for each the story that shows it, or what a scene reaches
only with or only without it, or how many stories came out otherwise beside that. One that changes
none of them changes nothing here.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
import json
from pathlib import Path
from random import Random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from stories.scenes import SCENES, SMALL
from stories.walk import Ledger, text_of, Told, Walk

_ROOT = Path(__file__).resolve().parents[3]
# The code that decides what is written.
DECIDING = ('write.py', 'kernel/*.py', 'writes/*.py')
_CHEAP = ('little gets', 'little free', 'little end')  # whose pairs take half a minute
_LONGEST = 180  # s of a processor, for all stories of a mistake, which may let one hang

_TURNED: dict[type[ast.cmpop], str] = {
    ast.Lt: '>=', ast.LtE: '>', ast.Gt: '<=', ast.GtE: '<', ast.Eq: '!=', ast.NotEq: '==',
    ast.Is: 'is not', ast.IsNot: 'is', ast.In: 'not in', ast.NotIn: 'in'}


@dataclass(frozen=True, slots=True)
class Edit:
    """A mistake: what it is, and the text of each file that it changes."""

    what: str
    texts: dict[str, str]

    def __str__(self) -> str:
        """Return what it is."""
        return self.what


class _Source:
    """The text of a module, and all mistakes that can be made in it."""

    def __init__(self, root: Path, path: Path) -> None:
        self.file = str(path.relative_to(root))
        self.text = path.read_text(encoding='utf-8')
        self._starts = [0]
        for line in self.text.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line.encode()))
        self._bytes = self.text.encode()

    def edits(self) -> Iterator[Edit]:
        """Yield all."""
        for node in ast.walk(ast.parse(self.text)):
            if isinstance(node, ast.Compare) and len(node.ops) == 1:
                yield self._edit('comparison turned', node, ' '.join((
                    self._of(node.left), _TURNED[type(node.ops[0])],
                    self._of(node.comparators[0]))))
                if isinstance(node.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE):
                    for value in ('True', 'False'):
                        yield self._edit('time not compared', node, value)
            elif isinstance(node, ast.BoolOp):
                word = ' and ' if isinstance(node.op, ast.And) else ' or '
                yield from self._without_one('term left out', node, node.values, word)
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) \
                    and node.func.id in ('min', 'max') and len(node.args) > 1:
                for left_out in node.args:
                    yield self._edit('term left out', node, f'{node.func.id}([' + ', '.join(
                        self._of(each) for each in node.args if each is not left_out) + '])')
            elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) \
                    or isinstance(node, ast.Assign | ast.AugAssign) and not _is_made(node):
                yield self._edit('event ignored', node, 'pass')

    def _without_one(self, kind: str, node: ast.expr, values: list[ast.expr],
                     word: str) -> Iterator[Edit]:
        for left_out in values:
            rest = word.join(f'({self._of(each)})' for each in values if each is not left_out)
            yield self._edit(kind, node, rest)

    def _of(self, node: ast.expr) -> str:
        return self._bytes[self._begin(node):self._end(node)].decode()

    def _begin(self, node: ast.expr | ast.stmt) -> int:
        return self._starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self._starts[node.end_lineno - 1] + node.end_col_offset

    def _edit(self, kind: str, node: ast.expr | ast.stmt, new: str) -> Edit:
        begin, end = self._begin(node), self._end(node)
        put = f'({new})' if isinstance(node, ast.expr) else new
        text = (self._bytes[:begin] + put.encode() + self._bytes[end:]).decode()
        old = ' '.join(self._bytes[begin:end].decode().split())
        what = f'{kind}, {self.file}:{node.lineno}: {old}  ->  {" ".join(new.split())}'
        return Edit(what, {self.file: text})


def _is_made(node: ast.Assign | ast.AugAssign) -> bool:
    """Tell whether an assignment makes a name: without it nothing would run."""
    return isinstance(node, ast.Assign) and not all(
        isinstance(target, ast.Attribute) for target in node.targets)


def _all_edits(root: Path) -> Iterator[Edit]:
    """Yield all mistakes in the deciding code."""
    folder = root / 'abdf1_ros' / 'driver'
    for pattern in DECIDING:
        for path in sorted(folder.glob(pattern)):
            yield from _Source(root, path).edits()


def draw(root: Path, seed: int, count: int) -> list[Edit]:
    """Return so many mistakes; each kind is as likely."""
    dice = Random(seed)
    by_kind: dict[str, list[Edit]] = {}
    for edit in _all_edits(root):
        by_kind.setdefault(edit.what.partition(',')[0], []).append(edit)
    drawn: list[Edit] = []
    while len(drawn) < count:
        edits = by_kind[dice.choice(sorted(by_kind))]
        drawn.append(edits.pop(dice.randrange(len(edits))))
    return drawn


def read_lot(root: Path, path: Path) -> list[Edit]:
    """Return the mistakes of a file: a name, what each does, and file, old and new texts."""
    found = []
    for each in json.loads(path.read_text(encoding='utf-8')):
        edit = Edit(f'{each["name"]}, {each["what"]}', {})
        for file, old, new in each['changes']:
            text = edit.texts.get(file) or (root / file).read_text(encoding='utf-8')
            if text.count(old) != 1:
                raise SystemExit(f'{edit}: {file} has {text.count(old)} times {old!r}')
            edit.texts[file] = text.replace(old, new)
        found.append(edit)
    return found


# In the copy

def judge(names: Iterable[str], deviations: int, ledgers: Path) -> tuple[str, int]:
    """Return the first story that shows something, and how many came out otherwise before."""
    others = 0
    for name in names:
        before = Ledger(_ledger(ledgers, name))
        walk = Walk(SCENES[name])

        def take(one: Told, before: Ledger = before) -> None:
            nonlocal others
            others += before.has(one) and before.differs(one)

        try:
            for _ in walk.to(deviations, partial(bool, walk.broken), take):
                pass
        except Exception as error:
            return f'{name}: {type(error).__name__} {error}', others
        if walk.broken:
            one = walk.broken[0]
            story = text_of(one.story).replace('\n', ' | ')
            return f'{name}, {story!r}: {one.broken[:100]}', others
        if before.reached and (changed := before.reached ^ walk.reached):
            return f'{name}, reached or not any more: {min(changed)}', others
    return '', others


def _ledger(folder: Path, name: str) -> Path:
    return folder / f'{name}.json'


def _judge_here(ledgers: Path, pairs: list[str]) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (_LONGEST, _LONGEST))
    found, others = judge(SMALL, 1, ledgers)
    if not found and pairs:
        found, _ = judge(pairs, 2, ledgers)
    print(json.dumps([found, others]))


def keep(ledgers: Path) -> None:
    """Keep what comes of the stories without a mistake."""
    for name in SMALL:
        ledger = Ledger(None)
        walk = Walk(SCENES[name])
        for _ in walk.to(1, told=ledger.add):
            pass
        ledger.reached = walk.reached
        ledger.write(_ledger(ledgers, name))


# Here

def _copy(to: Path) -> None:
    for part in ('abdf1_ros', 'test/support', 'test/lab/stories', 'test/lab/simulate', 'tools'):
        shutil.copytree(_ROOT / part, to / part,
                        ignore=shutil.ignore_patterns('__pycache__', 'stored'))


def _put(tree: Path, texts: dict[str, str]) -> None:
    for file, text in texts.items():
        (tree / file).write_text(text, encoding='utf-8')


def _try_out(tree: Path, edit: Edit, options: list[str]) -> tuple[str, int]:
    before = {file: (tree / file).read_text(encoding='utf-8') for file in edit.texts}
    _put(tree, edit.texts)
    try:
        run = subprocess.run(
            [sys.executable, tree / 'test/lab/stories/drawn.py', *options], check=False,
            capture_output=True, text=True)
    finally:
        _put(tree, before)
    if run.returncode == -signal.SIGXCPU:
        return 'it hangs', 0
    if run.returncode:
        return run.stderr.strip().splitlines()[-1], 0
    found, others = json.loads(run.stdout)
    return found, others


def main() -> int:
    """Make the mistakes; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--count', type=int, default=30)
    parser.add_argument('--lot', type=Path, help='a file with mistakes, instead of drawn ones')
    parser.add_argument('--only', default='', help='those whose text holds this')
    parser.add_argument('--pairs', nargs='*', default=_CHEAP, help='of these scenes, too')
    parser.add_argument('--judge', type=Path, help=argparse.SUPPRESS)
    parser.add_argument('--list', action='store_true', help='make none, only tell which')
    wanted = parser.parse_args()
    if wanted.judge:
        _judge_here(wanted.judge, wanted.pairs)
        return 0
    edits = read_lot(_ROOT, wanted.lot) if wanted.lot else draw(_ROOT, wanted.seed, wanted.count)
    edits = [edit for edit in edits if wanted.only in str(edit)]
    if wanted.list:
        print(*edits, sep='\n')
        return 0
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix='abdf1_drawn_') as folder:
        tree = Path(folder) / 'tree'
        _copy(tree)
        keep(Path(folder))
        for edit in edits:
            begun = time.monotonic()
            found, others = _try_out(
                tree, edit, [f'--judge={folder}', '--pairs', *wanted.pairs])
            end = 'found' if found else 'NOT FOUND' if others else 'changes nothing'
            ends[end] += 1
            print(f'{end}: {edit}\n    {found or f"{others} stories came out otherwise"} '
                  f'({time.monotonic() - begun:.0f} s)', flush=True)
    print(', '.join(f'{count} {end}' for end, count in sorted(ends.items())), f'of {len(edits)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
