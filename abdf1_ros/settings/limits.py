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

"""Conversion of the values of a topic to raw values for the PLC, within all limits."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
import math

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.scaling import float32_step, Scaling
from abdf1_ros.text import value_text

# Tolerance at a limit, in raw steps: the rounding error of double precision for 32-bit values.
_EXACT = 1e-6

_UNSCALED = Scaling()
_NO_LIMITS = -math.inf, math.inf


def raw_values(mapping: Mapping, values: Sequence[float] | str) -> Sequence[float] | str:
    """
    Return the raw values to write; FormatError where a limit or the type forbids one.

    No raw value is outside of Min and Max. The float32 nearest to a limit can be outside. It then
    counts as the limit, and the nearest raw value inside is written.
    """
    codec, scaling = mapping.codec, mapping.scaling
    raw = values if isinstance(values, str) or scaling is None \
        else scaling.raw(values, mapping.type)
    codec.check(raw)
    limits = mapping.minimum, mapping.maximum
    if isinstance(values, str) or limits == _NO_LIMITS:
        return raw
    if mapping.message_type is not ValueType.FLOAT32:
        _check_limits(mapping, values, *limits)
        return raw
    low, high = array('f', limits)
    _check_limits(mapping, values, min(low, mapping.minimum), max(high, mapping.maximum))
    return _raw_inside(mapping, values)


def check_foreign(mapping: Mapping, raw: float, index: int) -> None:
    """
    Check a raw value that another program writes.

    Raises FormatError where a limit or the type forbids it. The float32 nearest to a limit counts
    as the limit. Min and Max of a Read row have no effect.
    """
    if not math.isfinite(raw):
        raise mapping.type.refusal(raw, index)
    scaling, tolerance = mapping.scaling or _UNSCALED, _EXACT
    low, high = sorted((end - scaling.offset) / scaling.scale
                       for end in _limits_in_effect(mapping))
    if mapping.type is ValueType.FLOAT32:
        nearest = array('f', (low, high))
        low, high, tolerance = min(low, nearest[0]), max(high, nearest[1]), 0.0
    if not low - tolerance <= raw <= high + tolerance:
        raise _outside(mapping, index, raw * scaling.scale + scaling.offset)


def has_limits(mapping: Mapping) -> bool:
    """Tell whether another program must not write some values that the words of a row can hold."""
    if mapping.type in (ValueType.BOOL, ValueType.STRING):
        return False
    return mapping.type is ValueType.FLOAT32 or _limits_in_effect(mapping) != _NO_LIMITS


def _limits_in_effect(mapping: Mapping) -> tuple[float, float]:
    return (mapping.minimum, mapping.maximum) if mapping.writes else _NO_LIMITS


def _raw_inside(mapping: Mapping, values: Sequence[float]) -> list[float]:
    """Return raw values inside the limits; FormatError where the nearest raw value is outside."""
    scaling, low, high = mapping.scaling or _UNSCALED, mapping.minimum, mapping.maximum
    found = scaling.raw([min(max(value, low), high) for value in values], mapping.type)
    low, high = sorted((end - scaling.offset) / scaling.scale for end in (low, high))
    if mapping.type is ValueType.FLOAT32:
        return [_inside(raw, low, high) for raw in found]
    for index, raw in enumerate(found):
        if not low - _EXACT <= raw <= high + _EXACT:
            raise _outside(mapping, index, raw * scaling.scale + scaling.offset,
                           ', the nearest that can be written,')
    return found


def _inside(value: float, low: float, high: float) -> float:
    """Return the float32 nearest to ``value`` that is not outside the limits."""
    nearest, = array('f', [value])
    step = float32_step(nearest)
    return nearest + step * ((nearest < low) - (nearest > high))


def _check_limits(mapping: Mapping, values: Sequence[float], minimum: float,
                  maximum: float) -> None:
    for index, value in enumerate(values):
        if not minimum <= value <= maximum:
            raise _outside(mapping, index, value)


def _outside(mapping: Mapping, index: int, value: float, what: str = '') -> FormatError:
    return FormatError(f'value {value_text(value)} at index {index}{what} is outside '
                       f'Min {mapping.minimum:.15g}, Max {mapping.maximum:.15g}')
