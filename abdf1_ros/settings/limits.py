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

"""From the values of a topic to raw values for the PLC, within all limits."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import value_text


def raw_values(mapping: Mapping, values: Sequence[float] | str) -> Sequence[float] | str:
    """Return the raw values to write; FormatError where a limit or the type forbids one."""
    codec, scaling = mapping.codec, mapping.scaling
    if isinstance(values, str) or scaling is None:
        codec.check(values)
        _check_limits(mapping, values)
        return values
    raw = scaling.raw(values, mapping.type)
    codec.check(raw)
    _check_limits(mapping, values)
    if mapping.type is not ValueType.FLOAT32:  # rounding must not exceed a limit either
        _check_limits(mapping, scaling.publish(raw), ', the nearest that can be written,')
    return raw


def _check_limits(mapping: Mapping, values: Sequence[float] | str, what: str = '') -> None:
    if isinstance(values, str):
        return
    minimum, maximum = mapping.minimum, mapping.maximum
    if mapping.message_type is ValueType.FLOAT32:  # the nearest possible values
        minimum, maximum = array('f', (minimum, maximum))
    for index, value in enumerate(values):
        if not minimum <= value <= maximum:
            raise FormatError(f'value {value_text(value)} at index {index}{what} is outside '
                              f'Min {mapping.minimum:.15g}, Max {mapping.maximum:.15g}')
