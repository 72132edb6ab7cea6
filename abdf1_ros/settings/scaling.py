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

"""Engineering values: raw values of a PLC converted by the columns Scale and Offset."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
import math

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.values import FLOAT_MAX, ValueType


@dataclass(frozen=True, slots=True)
class Scaling:
    """
    Engineering value = raw value * ``scale`` + ``offset``.

    It is computed in double precision and published as float32. A written value becomes the raw
    value nearest to (value - ``offset``) / ``scale``. Of two equally near raw values, it becomes
    the even one, as in IEEE 754. ``scale`` and ``offset`` are finite, ``scale`` is not 0.
    """

    scale: float = 1.0
    offset: float = 0.0

    def publish(self, raw: Sequence[float]) -> array[float]:
        """Return engineering values, to be published."""
        return array('f', [value * self.scale + self.offset for value in raw])

    def raw(self, values: Sequence[float], kind: ValueType) -> list[float]:
        """Return the nearest raw values; FormatError outside of ``kind``, and for NaN."""
        low, high = kind.range
        found: list[float] = []
        for index, value in enumerate(map(_float_of, values)):
            if math.isnan(value):
                raise ValueType.FLOAT32.refusal(value, index)
            nearest = (value - self.offset) / self.scale
            if kind is not ValueType.FLOAT32 and math.isfinite(nearest):
                nearest = round(nearest)
            if not low <= nearest <= high:
                raise FormatError(f'value {value:.7g} at index {index} is outside '
                                  f'{self._range(kind)}')
            found.append(nearest)
        return found

    def fault(self, kind: ValueType) -> str | None:
        """
        Return why values of ``kind`` cannot have this scaling, None when they can.

        Published values are float32. Two different 16-bit values must not become the same float32.
        Otherwise a published value, written back, could give another raw value.
        """
        if kind in (ValueType.BOOL, ValueType.STRING):
            return f'Scale and Offset are for numbers, not for {kind.value}'
        widest = max(map(abs, self.limits(kind)))
        if kind is not ValueType.FLOAT32 and widest > FLOAT_MAX:
            return f'a float32 cannot hold {self._range(kind)}'
        # The float32 is off by a quarter of a raw step at most; half a step would be too much.
        if kind.words == 1 and 2 * float32_step(widest) > abs(self.scale):
            return ('a float32 has too few digits to tell the values apart in '
                    f'{self._range(kind)}')
        return None

    def limits(self, kind: ValueType) -> tuple[float, float]:
        """Return the least and the greatest engineering value that raw values can stand for."""
        low, high = sorted(end * self.scale + self.offset for end in kind.range)
        return low, high

    def _range(self, kind: ValueType) -> str:
        low, high = self.limits(kind)
        return (f'{low:.10g} to {high:.10g}, the range of {kind.value} with '
                f'Scale {self.scale:.10g}, Offset {self.offset:.10g}')


def float32_step(value: float) -> float:
    """Return the distance of float32 numbers around ``value``."""
    return math.ldexp(1.0, max(math.frexp(value)[1] - 24, -149))


def _float_of(value: float) -> float:
    """Return a number as a float, infinite if no float can hold it."""
    try:
        return value * 1.0
    except OverflowError:
        return math.inf if value > 0 else -math.inf
