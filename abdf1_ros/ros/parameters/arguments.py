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

"""The parameters and remaps that a process was given, and the node that each of them is for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
import re

from abdf1_ros.problems import Place, Problem
from abdf1_ros.ros.parameters.files import names_in, node_sections, parameter_files, parameter_tree
from abdf1_ros.text import first, printable

# Names of our parameters that nodes of other packages use too.
_USUAL_NAMES = frozenset((
    'port', 'lines', 'low_latency', 'rs485', 'diagnostics_period', 'write_timeout', 'use_sim_time',
    'start_type_description_service'))


@dataclass(frozen=True, slots=True)
class Typed:
    """A parameter of the command line; ``node``: the node name before it, or empty."""

    node: str
    name: str
    value: str

    def is_for(self, full_name: str) -> bool:
        """Return True if ROS gives the parameter to this node."""
        return self.node in ('', full_name.lstrip('/'))


@dataclass(frozen=True, slots=True)
class Arguments:
    """
    The parameters and remaps that a process was given, for all of its nodes.

    - ``files``: paths of parameter files
    - ``typed``: parameters of the command line
    - ``others``: full names of all nodes of the process, if it has several
    - ``remaps``: the left sides of remaps, such as ``~/read/door``, after the name of a node and
      a colon if the remap is for this node only
    """

    files: Sequence[str] = ()
    typed: Sequence[Typed] = ()
    others: Collection[str] = ()
    remaps: Sequence[str] = ()

    @classmethod
    def of(cls, args: Sequence[str], others: Collection[str] = ()) -> Arguments:
        """Return the parameters in the arguments of a process."""
        typed = []
        for left, _, value in _rules(args, '-p', '--param'):
            node, _, name = left.rpartition(':')
            typed.append(Typed(node.strip('/'), name, value))
        return cls(parameter_files(args), typed, others,
                   [left for left, _, _ in _rules(args, '-r', '--remap')])

    def typed_for(self, full_name: str) -> dict[str, str]:
        """Return the command line's parameters for a node, as text."""
        return {typed.name: typed.value for typed in self.typed if typed.is_for(full_name)}

    def remapped_for(self, full_name: str) -> list[str]:
        """Return the names that remaps replace in a node."""
        pairs = (left.rpartition(':') for left in self.remaps if '://' not in left)
        return [name for node, _, name in pairs if node in ('', _base(full_name))]

    def only_for(self, full_name: str) -> set[str]:
        """Return the names on the command line that only this node of the process gets."""
        return {typed.name for typed in self.typed
                if typed.is_for(full_name) and (typed.node or not self.others)}

    def misdirected(self, full_name: str, usual_name: str,
                    known: Collection[str]) -> Iterator[Problem]:
        """
        Yield parameters that seem to be meant for this node but go to another name.

        ``usual_name``: the node's name without remapping; ``known``: its parameters. If a file has
        a section for this node, we treat all its other sections as meant for other nodes.
        """
        for path in self.files:
            yield from self._of_others(path, full_name, usual_name, {*known} - _USUAL_NAMES)
        for typed in self.typed:
            if typed.name in known and not (
                    typed.is_for(full_name) or f'/{typed.node}' in self.others):
                yield Problem(f'parameter {typed.node}:{typed.name}', (
                    f'this node is {full_name}; leave out "{printable(typed.node)}:"'))

    def _of_others(self, path: str, full_name: str, usual_name: str,
                   ours: Collection[str]) -> Iterator[Problem]:
        """Yield the first section that seems to be meant for this node but has another name."""
        sections = [*node_sections(parameter_tree(path))]
        if any(name == full_name for name, _, _ in sections):
            return
        for name, line, tree in sections:
            if is_for(name, full_name) or {name, full_name} <= {*self.others}:
                continue
            found = [parameter for parameter in names_in(tree) if parameter in ours]
            if found or (name not in self.others
                         and _base(name) in (_base(full_name), usual_name)):
                yield Problem(Place(path, line), _advice(name, full_name, found))
                return


def _rules(args: Sequence[str], *options: str) -> list[tuple[str, str, str]]:
    """Return the rules after one of the options: left side, ":=", right side."""
    return [rule.partition(':=') for option, rule in zip(args, args[1:], strict=False)
            if option in options]


def is_for(section: str, full_name: str) -> bool:
    """Return True if ROS gives the parameters of a section, maybe with wildcards, to a node."""
    pattern = re.escape(section).replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'/\w+')
    return re.fullmatch(pattern, full_name) is not None


def _base(name: str) -> str:
    return name.rpartition('/')[2]


def _advice(section: str, full_name: str, found: Sequence[str]) -> str:
    of_no_use = f'; {first(found)} would have no effect' if found else ''
    return (f'section {printable(section)} is not for this node, {full_name}: write '
            f'"{full_name}:", or "/**:" for every node{of_no_use}')
