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
Mutations of the ends of ``support/mutated_ends.py``, found in their code and not by hand.

First all habits are folded away, so that what is mutated is an end that keeps the rules. A
mutation then changes one place: it turns a comparison, changes a constant, leaves out a branch or
a statement, exchanges DLE ACK and DLE NAK, and so on. Nobody chooses the place.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterator
import copy
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import ModuleType

from support import mutated_ends, plain_plc

_BENCH = ('clock', 'read', 'write', 'then', 'after', '_run', 'has')  # time, not the end
_CALLED_FROM_OUTSIDE = ('clock', 'read', 'write', 'then', 'serve', '__init__')
_RESPONSES = ('_ACK', '_NAK', '_ENQ', '_EOT')
_FRAMING = ('_DLE', '_SOH', '_STX', '_ETX')
_SETTINGS = dict.fromkeys(('_ACK_TIMEOUT', '_COMMAND_TIMEOUT'), ('{} * 4', '{} / 4')) | {
    '_LIMIT': ('({} + 1)', '({} - 1)')}

_TURNED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot,
    ast.IsNot: ast.Is, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
_OTHER_OPERATOR: dict[type[ast.operator], type[ast.operator]] = {
    ast.Sub: ast.Add, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.Mod: ast.FloorDiv,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift}

Edit = Callable[[ast.AST, Random], None]
"""Changes a node in place."""


Reached = Collection[tuple[str, int]]
"""Lines that are executed: file and number."""


@dataclass(frozen=True, slots=True)
class Site:
    """
    A place that can be mutated: node ``at`` of a source, in the order of a walk.

    ``line`` is the file and number of the line that shows it.
    """

    operator: str
    source: int
    owner: str
    at: int
    line: tuple[str, int]
    edit: Edit


@dataclass(frozen=True, slots=True)
class Mutation:
    """One mutation, with the statement before and after it; ``trees`` are the sources with it."""

    operator: str
    owner: str
    before: str
    after: str
    trees: tuple[ast.Module, ast.Module]


class _WithoutHabits(ast.NodeTransformer):
    """Replace each question for a habit by False, and leave out what can never be reached."""

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Replace ``has(Habit.X)``, and ``bytes(False)``."""
        self.generic_visit(node)
        if any(_is_habit(argument) for argument in node.args):
            return ast.Constant(False)
        is_empty = isinstance(node.func, ast.Name) and node.func.id == 'bytes' and len(
            node.args) == 1 and _value(node.args[0]) in (False, 0)
        return ast.Constant(b'') if is_empty else node

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """Replace ``Habit.X in habits``."""
        self.generic_visit(node)
        return ast.Constant(False) if _is_habit(node.left) else node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Replace ``habits & {Habit.X}``, and compute with False."""
        self.generic_visit(node)
        if isinstance(node.op, ast.BitAnd) and isinstance(node.right, ast.Set):
            return ast.Constant(False)
        if any(_value(side) is False for side in (node.left, node.right)):
            if isinstance(node.op, ast.Mult):
                return ast.Constant(0)
            return node.left if _value(node.right) is False else node.right
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        """Replace ``not False``."""
        self.generic_visit(node)
        value = _value(node.operand)
        return ast.Constant(not value) if isinstance(value, bool) else node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        """Leave out operands that decide nothing."""
        self.generic_visit(node)
        deciding = isinstance(node.op, ast.Or)
        values = [value for value in node.values if _value(value) is not (not deciding)]
        if any(_value(value) is deciding for value in values):
            return ast.Constant(deciding)
        if len(values) < 2:
            return values[0] if values else ast.Constant(not deciding)
        return ast.BoolOp(node.op, values)

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        """Keep the branch that is reached."""
        self.generic_visit(node)
        value = _value(node.test)
        return (node.body if value else node.orelse) if isinstance(value, bool) else node

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt]:
        """Keep the branch that is reached."""
        self.generic_visit(node)
        value = _value(node.test)
        if isinstance(value, bool):
            return node.body if value else node.orelse
        node.body = node.body or [ast.Pass()]
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """Leave out the docstring; a generator stays one."""
        was_generator = _yields(node)
        self.generic_visit(node)
        if ast.get_docstring(node) is not None:
            node.body = node.body[1:]
        node.body = node.body or [ast.Pass()]
        if was_generator and not _yields(node):
            node.body += ast.parse('yield from ()').body
        return node


def _yields(node: ast.AST) -> bool:
    return any(isinstance(part, ast.Yield | ast.YieldFrom) for part in ast.walk(node))


def _is_habit(node: ast.expr) -> bool:
    return isinstance(node, ast.Attribute) and isinstance(
        node.value, ast.Name) and node.value.id == 'Habit'


def _value(node: ast.AST) -> object:
    return node.value if isinstance(node, ast.Constant) else None


def _plain(module: ModuleType) -> ast.Module:
    """Return a module without habits, and without the functions that nobody calls then."""
    tree = _WithoutHabits().visit(ast.parse(Path(str(module.__file__)).read_text('utf-8')))
    while unused := _unused(tree):
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                node.body = [part for part in node.body if part not in unused]
    return ast.parse(ast.unparse(ast.fix_missing_locations(tree)))


def _unused(tree: ast.Module) -> list[ast.stmt]:
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return [part for node in ast.walk(tree) if isinstance(node, ast.ClassDef)
            for part in node.body if isinstance(part, ast.FunctionDef)
            and part.name not in used and part.name not in _CALLED_FROM_OUTSIDE]


FILES = ('<plc>', '<end>')
SOURCES = (_plain(plain_plc), _plain(mutated_ends))


def load(trees: tuple[ast.Module, ast.Module] = SOURCES) -> dict[str, type]:
    """Return what ``mutated_ends`` defines, with these sources."""
    plc, ends = ({'__name__': 'a_target'}, {'__name__': 'a_target'})
    for names, tree, file in zip((plc, ends), trees, FILES, strict=True):
        exec(compile(tree, file, 'exec'), names)  # noqa: S102 - our own code
    ends['PlainPlc'] = plc['PlainPlc']
    return ends  # type: ignore[return-value]


def sites(end: str, reached: Reached) -> list[Site]:
    """Return the places in an end, a class of ``mutated_ends``, on lines that are reached."""
    kind = getattr(mutated_ends, end)
    names = {base.__name__ for base in kind.__mro__}
    names |= {'_Executor', 'PlainPlc', '_level', '_address'} \
        if hasattr(kind('BCC'), '_plc') else {'_Asker'}
    found = []
    for source, tree in enumerate(SOURCES):
        numbers = {id(node): at for at, node in enumerate(ast.walk(tree))}
        for owner, function in _functions(tree, names):
            for node in _code(function):
                at = numbers[id(node)]
                found += [Site(change.operator, source, owner, at, line, change.edit)
                          for change in _changes(node)
                          if (line := (FILES[source], change.shown.lineno)) in reached]
    return found


def _functions(tree: ast.Module, names: Collection[str]
               ) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield functions and methods of these names, with their full names."""
    for part in tree.body:
        if isinstance(part, ast.FunctionDef) and part.name in names:
            yield part.name, part
        if isinstance(part, ast.ClassDef) and part.name in names:
            yield from ((f'{part.name}.{entry.name}', entry) for entry in part.body
                        if isinstance(entry, ast.FunctionDef) and entry.name not in _BENCH)


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all below it that is executed, but no assertion."""
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ('annotation', 'returns', 'args', 'decorator_list') or isinstance(
                node, ast.Call):
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not isinstance(child, ast.Assert):
                    yield from _code(child)


@dataclass(frozen=True, slots=True)
class _Change:
    """What can be done to a node; it is on the line of ``shown``."""

    operator: str
    edit: Edit
    shown: ast.expr | ast.stmt


def _changes(node: ast.AST) -> Iterator[_Change]:
    """Yield all that can be done to one node."""
    if isinstance(node, ast.expr):
        yield from (_Change(operator, edit, node) for operator, edit in _edits(node))
    elif isinstance(node, ast.If):
        yield _Change('branch left out', _set(body=[ast.Pass()]), node.body[0])
        if node.orelse:
            yield _Change('branch left out', _set(orelse=[]), node.orelse[0])
        yield _Change('condition turned', _turn, node)
    for field in ('body', 'orelse'):
        if isinstance(node, ast.If | ast.For | ast.While | ast.FunctionDef):
            yield from _changes_of_block(getattr(node, field, []), field)


def _edits(node: ast.expr) -> Iterator[tuple[str, Edit]]:
    if isinstance(node, ast.Compare):
        for at, operator in enumerate(node.ops):
            yield 'comparison turned', _set_item('ops', at, _TURNED[type(operator)]())
    elif isinstance(node, ast.BoolOp):
        for at in range(len(node.values)):
            yield 'condition left out', _drop_operand(at)
        yield 'and, or exchanged', _set(op=ast.And() if isinstance(node.op, ast.Or) else ast.Or())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield 'condition turned', _become('operand')
    elif isinstance(node, ast.IfExp):
        yield from (('branch left out', _become(side)) for side in ('body', 'orelse'))
    elif isinstance(node, ast.BinOp):
        yield from _arithmetic(node)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
        yield from _names(node)
    elif isinstance(node, ast.Constant) and type(node.value) in _CHANGED and node.value != b'':
        yield 'constant changed', _change_constant


def _arithmetic(node: ast.BinOp) -> Iterator[tuple[str, Edit]]:
    if isinstance(node.op, ast.Add):
        yield from (('part left out', _become(side)) for side in ('left', 'right'))
        yield 'order exchanged', _set(left=node.right, right=node.left)
    elif type(node.op) in _OTHER_OPERATOR:
        yield 'operator changed', _set(op=_OTHER_OPERATOR[type(node.op)]())


def _names(node: ast.Name) -> Iterator[tuple[str, Edit]]:
    for names in (_RESPONSES, _FRAMING):
        if node.id in names:
            yield 'symbol exchanged', _change_name(names)
    if node.id in _SETTINGS:
        yield 'constant changed', _change_setting(*_SETTINGS[node.id])


def _changes_of_block(block: list[ast.stmt], field: str) -> Iterator[_Change]:
    """Yield what can be done to the statements of a block."""
    for at, statement in enumerate(block):
        if len(block) > 1 and isinstance(
                statement, ast.Expr | ast.AugAssign | ast.Return) or _is_kept(statement):
            yield _Change('statement left out', _set_item(field, at, ast.Pass()), statement)
        pair = block[at:at + 2]
        if len(pair) == 2 and all(isinstance(entry, ast.Expr | ast.Assign | ast.AugAssign)
                                  for entry in pair):
            yield _Change('order exchanged', _exchange(field, at), statement)


def _is_kept(statement: ast.stmt) -> bool:
    """Tell whether a statement changes what an object keeps."""
    return isinstance(statement, ast.Assign) and any(
        isinstance(target, ast.Attribute | ast.Subscript) for target in statement.targets)


def _set(**fields: object) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        for name, value in fields.items():
            setattr(node, name, copy.deepcopy(value))
    return edit


def _set_item(field: str, at: int, value: ast.AST) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        getattr(node, field)[at] = value
    return edit


def _exchange(field: str, at: int) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        block = getattr(node, field)
        block[at:at + 2] = block[at + 1], block[at]
    return edit


def _drop_operand(at: int) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        assert isinstance(node, ast.BoolOp)
        del node.values[at]
        if len(node.values) == 1:
            _replace(node, node.values[0])
    return edit


def _become(field: str) -> Edit:
    return lambda node, random: _replace(node, getattr(node, field))


def _replace(node: ast.AST, other: ast.AST) -> None:
    node.__class__ = other.__class__  # type: ignore[assignment]
    node.__dict__.clear()
    node.__dict__.update(vars(other))


def _turn(node: ast.AST, random: Random) -> None:
    assert isinstance(node, ast.If)
    node.test = ast.UnaryOp(ast.Not(), node.test)


def _change_name(names: tuple[str, ...]) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        assert isinstance(node, ast.Name)
        node.id = random.choice([name for name in names if name != node.id])
    return edit


def _change_setting(*forms: str) -> Edit:
    def edit(node: ast.AST, random: Random) -> None:
        assert isinstance(node, ast.Name)
        form = random.choice(forms).format(node.id)
        _replace(node, ast.parse(form, mode='eval').body)
    return edit


def _other_bytes(value: bytes, random: Random) -> bytes:
    at = random.randrange(len(value))
    byte = random.choice([b'', bytes((value[at] ^ 1 << random.randrange(8),))])
    return value[:at] + byte + value[at + 1:]


_CHANGED: dict[type, Callable[..., object]] = {
    bool: lambda value, random: not value,
    int: lambda value, random: value + random.choice((-1, 1)),
    float: lambda value, random: value * random.choice((0.25, 4.0)),
    bytes: _other_bytes}


def _change_constant(node: ast.AST, random: Random) -> None:
    assert isinstance(node, ast.Constant)
    node.value = _CHANGED[type(node.value)](node.value, random)  # type: ignore[assignment]


def mutate(random: Random, end: str, reached: Reached) -> Mutation:
    """Draw a mutation of an end: first its line, then what is done to it."""
    found = sites(end, reached)
    line = random.choice(sorted({site.line for site in found}))
    site = random.choice([site for site in found if site.line == line])
    trees = list(SOURCES)
    tree = trees[site.source] = copy.deepcopy(SOURCES[site.source])
    before = ast.unparse(tree).splitlines()
    site.edit(list(ast.walk(tree))[site.at], random)
    after = ast.unparse(ast.fix_missing_locations(tree)).splitlines()
    return Mutation(site.operator, site.owner, *_difference(before, after), (trees[0], trees[1]))


def _difference(before: list[str], after: list[str]) -> tuple[str, str]:
    """Return the lines that differ."""
    begin = next((at for at, (one, other) in enumerate(zip(before, after, strict=False))
                  if one != other), min(len(before), len(after)))
    end = 0
    while end < min(len(before), len(after)) - begin and before[-1 - end] == after[-1 - end]:
        end += 1
    return tuple('; '.join(line.strip() for line in lines[begin:len(lines) - end])
                 for lines in (before, after))  # type: ignore[return-value]
