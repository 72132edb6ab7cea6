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
Numbers as people write them.

Python's own ``int`` and ``float`` take more than that: "1_000", the digits of every script,
"nan" and "infinity".
"""

from __future__ import annotations

import math
import re

_WHOLE = re.compile(r'[+-]?[0-9]{1,20}')
_DECIMAL = re.compile(r'[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_COMMA_AND_THREE = re.compile(r'[+-]?[0-9]+,[0-9]{3}')


def whole_number(text: str) -> int | None:
    """Return the number that decimal digits stand for, None for anything else."""
    return int(text) if _WHOLE.fullmatch(text) else None


def decimal_number(text: str) -> float | None:
    """Return the number that ``text`` stands for, None for others and too large ones."""
    value = float(text) if _DECIMAL.fullmatch(text) else math.inf
    return value if math.isfinite(value) else None


def two_readings(text: str) -> str:
    """Return what to write instead of "1,000", which may be 1 or 1000; otherwise empty."""
    if not _COMMA_AND_THREE.fullmatch(text):
        return ''
    return f'{text.replace(",", "")} or {text.replace(",", ".")}'
