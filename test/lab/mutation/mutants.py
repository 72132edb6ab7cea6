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


"""Single small mistakes in a module: which there can be, and its source with one of them."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

_SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult,
    ast.Div: ast.Mult, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift}

Edit = tuple[str, Callable[[], object]]


@dataclass(frozen=True, slots=True)
class Mutant:
    """One mistake: the ``edit``-th one of the ``node``-th node of a module, and how to show it."""

    module: Path
    line: int
    node: int
    edit: int
    before: str
    name: str

    def __str__(self) -> str:
        return f'{self.module}:{self.line}: {self.before}  [{self.name}]'


def mutants(module: Path, source: str) -> list[Mutant]:
    """Return every mistake of which ``mutated`` can make one in ``source``."""
    return [Mutant(module, node.lineno, number, at, _shown(node), name)
            for number, node in enumerate(_nodes(ast.parse(source)))
            for at, (name, _) in enumerate(_edits(node))]


def mutated(mutant: Mutant, source: str) -> str:
    """Return ``source`` with the mistake."""
    tree = ast.parse(source)
    node = next(node for number, node in enumerate(_nodes(tree)) if number == mutant.node)
    _, make = [*_edits(node)][mutant.edit]
    make()
    return ast.unparse(ast.fix_missing_locations(tree))


def _shown(node: ast.stmt | ast.expr) -> str:
    text = ast.unparse(node).splitlines()
    return text[0][:100] + (' ...' if len(text) > 1 else '')


def _nodes(tree: ast.AST) -> Iterator[ast.stmt | ast.expr]:
    """Yield statements and expressions; not what only readers and type checkers look at."""
    for name, value in ast.iter_fields(tree):
        if name in ('annotation', 'returns', 'decorator_list', 'bases'):
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.Assert) or not isinstance(node, ast.AST):
                continue
            if isinstance(node, ast.stmt | ast.expr):
                yield node
            yield from _nodes(node)


def _edits(node: ast.stmt | ast.expr) -> Iterator[Edit]:
    """Yield what can be done to one node: a name, and what does it."""
    match node:
        case ast.Compare(ops=ops):
            for at, operator in enumerate(ops):
                yield _swap(operator, partial(ops.__setitem__, at))
        case ast.BoolOp(op=operator) | ast.BinOp(op=operator) | ast.AugAssign(op=operator) \
                if type(operator) in _SWAPS:
            yield _swap(operator, partial(setattr, node, 'op'))
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            yield 'condition negated', lambda: setattr(node, 'test', ast.UnaryOp(ast.Not(), test))
        case ast.UnaryOp(op=ast.Not() | ast.USub() as operator, operand=operand):
            yield f'{type(operator).__name__} left out', lambda: setattr(  # twice is not at all
                node, 'operand', ast.UnaryOp(type(operator)(), operand))
        case ast.Constant(value=bool(value)):
            yield f'{not value}', lambda: setattr(node, 'value', not value)
        case ast.Constant(value=int(value) | float(value)):
            yield f'{value + 1}', lambda: setattr(node, 'value', value + 1)
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield 'returns None', lambda: setattr(node, 'value', ast.Constant(None))
        case ast.Expr(value=ast.Call() | ast.YieldFrom()):
            yield 'left out', lambda: setattr(node, 'value', ast.Constant(...))
        case _:
            pass


def _swap(operator: ast.AST, put: Callable[[ast.AST], object]) -> Edit:
    new = _SWAPS[type(operator)]
    return f'{new.__name__} for {type(operator).__name__}', lambda: put(new())
