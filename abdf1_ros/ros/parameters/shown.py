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

"""Show the contents of both files as parameters; ``~/reload`` renews them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import FIELDS, Network
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

# rclpy sends an event for each parameter: 120,000 events for 5000 rows take 12 s.
MOST_SHOWN_ROWS = 100

_Cell = tuple[str, object, ParameterDescriptor]

_REASON = 'read-only: it shows the files; change the files and call ~/reload'


def descriptor_of(default: bool | float | str, description: str, low: float | None = None,
                  high: float | None = None, *, read_only: bool = False) -> ParameterDescriptor:
    """Return a descriptor that allows any type, because we check types ourselves."""
    descriptor = ParameterDescriptor(
        description=description, read_only=read_only, dynamic_typing=True)
    if low is not None and high is not None:
        if isinstance(default, int):
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))]
    return descriptor


def text_of(value: object) -> str:
    """Return a value as a CSV cell has it; YAML turns Yes and No into bools."""
    if isinstance(value, bool):
        return 'Yes' if value else 'No'
    return str(value)


def map_cells(mappings: Iterable[Mapping]) -> Iterator[tuple[str, str, str]]:
    """Yield each cell of a map: name of its parameter, value, description of its column."""
    for mapping in mappings:
        for column in MAP_COLUMNS:
            yield (f'map.{mapping.name.replace("/", ".")}.{column.name.lower()}',
                   column.text(mapping), column.description)


def _net_cells(network: Network) -> Iterator[_Cell]:
    for name, value in network.cells().items():
        entry, kind = FIELDS[name], FIELDS[name].kind
        choices = f' ({", ".join(kind.choices)})' if kind.choices else ''
        yield entry.parameter, value, descriptor_of(
            value, entry.description + choices, kind.low, kind.high)


class ShownFiles:
    """
    The parameters ``net.*`` and ``map.*`` of a node.

    A call from outside cannot set them. They are not read-only for rclpy, because rclpy never
    undeclares a read-only parameter.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._is_showing = False
        self._shown: list[str] = []
        node.add_on_set_parameters_callback(self._judge)

    def show(self, network: Network, mappings: Iterable[Mapping]) -> None:
        """Show these settings and rows in place of the old ones."""
        for name in self._shown:
            self._node.undeclare_parameter(name)
        cells: list[_Cell] = [*_net_cells(network), *(
            (name, value, descriptor_of(value, description))
            for name, value, description in map_cells(mappings))]
        self._is_showing = True
        try:
            self._node.declare_parameters('', [*cells], ignore_override=True)
        finally:
            self._is_showing = False
        self._shown = [name for name, _, _ in cells]

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        is_ours = any(parameter.name.startswith(('net.', 'map.')) for parameter in parameters)
        return SetParametersResult(successful=self._is_showing or not is_ours, reason=_REASON)
