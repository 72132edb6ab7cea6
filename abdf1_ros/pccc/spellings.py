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

"""Names of PLC families, processors and value types, and what the CSV files call these."""

from __future__ import annotations

import re

# Processors and catalog numbers of a family: 5/03, ML1400, 1747-L531; PLC-5/40, 1785-L40B.
_FAMILIES = (
    (re.compile(r'SLC[\d/]*|5/0?[1-5]|(?:MICROLOGIX|MLX?)(?:1[0-5]00.*)?|1747.*|176[1-6].*'),
     'SLC'),
    (re.compile(r'PLC5[\d/]*[CELV]?|5/[1-8]\d|1785.*'), 'PLC5'),
    (re.compile(r'PLC3(?:/10)?|1775.*'), 'PLC3'), (re.compile(r'PLC2(?:/\d\d)?'), 'PLC2'))
_OTHERS = (
    (re.compile(r'[A-Z]*(?<!RS)(?<!MICRO)LOGIX.*|CLX|1756.*|1768.*|1769L.*|5069.*|5[35][78]0.*'), (
        'a Logix controller has only the addresses of its "Map PLC/SLC Messages" here: choose SLC '
        'or PLC5 for them; libplctag and pycomm3 read its tags')),
    (re.compile('MICRO8.*|2080.*'), 'a Micro800 has no DF1 commands; it has Modbus RTU'))
_MICROLOGIX = re.compile(r'(?:MICROLOGIX|MLX?)?-?(1[0-5]00)', re.IGNORECASE)
_SLC = re.compile(r'(?:SLC-?)?5(?:[/-]0?|0)([1-5])', re.IGNORECASE)
# The family of catalog numbers of processors, such as 1747-L532 and 1766-L32BXB.
_CATALOG = re.compile(r'(?:1747-?L5([1-5])\w*|(176[1-46])(?:-?L\w*)?)', re.IGNORECASE)
_MICROLOGIX_OF = {'1761': 'ML1000', '1762': 'ML1200', '1763': 'ML1100', '1764': 'ML1500',
                  '1766': 'ML1400'}
_TYPES = {'int': 'int16', 'word': 'uint16', 'dint': 'int32', 'long': 'int32', 'dword': 'uint32',
          'real': 'float32', 'float': 'float32', 'bit': 'bool'}


def family_name(text: str) -> str:
    """Return the PLC_Type for a name such as PLC-5; any text in capitals, without - and spaces."""
    name = text.upper().replace('-', '').replace(' ', '')
    return next((family for names, family in _FAMILIES if names.fullmatch(name)), name)


def family_advice(text: str) -> str:
    """Return what to choose as PLC_Type for the name of something else."""
    name = text.upper().replace('-', '').replace(' ', '')
    return next((advice for names, advice in _OTHERS if names.fullmatch(name)),
                'a MicroLogix is SLC')


def processor_name(text: str) -> str:
    """Return the Processor for a name such as SLC 5/3 or 1766-L32BXB, or the text itself."""
    name = text.replace(' ', '')
    if match := _CATALOG.fullmatch(name):
        return _MICROLOGIX_OF[match[2]] if match[2] else f'5/0{match[1]}'
    if match := _MICROLOGIX.fullmatch(name):
        return f'ML{match[1]}'
    return f'5/0{match[1]}' if (match := _SLC.fullmatch(name)) else text


def type_name(text: str) -> str:
    """Return the value of Type for a name such as DINT; any other text in small letters."""
    return _TYPES.get(text.lower(), text.lower())
