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

"""Other names of PLC families and value types, and what the CSV files call these."""

from __future__ import annotations

_FAMILIES = {'SLC500': 'SLC', 'SLC5/03': 'SLC', 'MICROLOGIX': 'SLC'}
_TYPES = {'int': 'int16', 'word': 'uint16', 'dint': 'int32', 'long': 'int32', 'dword': 'uint32',
          'real': 'float32', 'float': 'float32', 'bit': 'bool'}


def family_name(text: str) -> str:
    """Return the PLC_Type for a name such as PLC-5; any text in capitals, without - and spaces."""
    name = text.upper().replace('-', '').replace(' ', '')
    return _FAMILIES.get(name, name)


def type_name(text: str) -> str:
    """Return the value of Type for a name such as DINT; any other text in small letters."""
    return _TYPES.get(text.lower(), text.lower())
