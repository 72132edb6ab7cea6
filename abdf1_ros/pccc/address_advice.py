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
Advice for a text that is not an address of a PLC-5, SLC or MicroLogix.

Usual mistakes get an answer of their own: an address of the other family, a range, a letter for a
digit, files that these commands do not reach.
"""

from __future__ import annotations

import re

from abdf1_ros.pccc.file_types import PlcType

_RANGE = re.compile(
    r'(?P<first>[#$]?[A-Z]{1,2}\d*[:;](?P<element>\d+)(?:[./][A-Z0-9]+)?)\s*'
    r'(?:\{(?P<braces>\d+)\}|\[(?P<brackets>\d+)\]|,\s*L?(?P<comma>\d+)'
    r'|-(?:[A-Z]{1,2}\d*[:;])?(?P<last>\d+))', re.ASCII)
_BIT_AFTER_DOT = re.compile(
    r'(?P<word>[#$]?(?:B|N|S|A|D)\d*[:;]\d+)\.(?P<bit>\d{1,2})', re.ASCII)
_SLC_IO = re.compile(r'[#$]?[IO]\d?[:;]\d+\.\d+(?:/\d+)?', re.ASCII)
_PLC5_IO = re.compile(r'[#$]?(?P<type>[IO])\d?[:;]0[0-7]{2}(?:/[0-7]{1,2})?', re.ASCII)
# Letters O among digits.
_LETTERS_O = re.compile(r'(?<=[:;./0-9])O+(?![A-Z])', re.ASCII)
# The function files of the MicroLogix; they are read by other commands than data files.
_FUNCTION_FILES = re.compile(
    r'(?P<name>BHI|CS|DAT|DLS|EII|ES|HSC|IOS|LCD|MMI|PTO|PWM|RTC|STI|TPI)\d*(?:[:;/.].*)?',
    re.ASCII)


def advice(text: str, plc_type: PlcType) -> str | None:
    """Return the advice for an address in capital letters, None for no usual mistake."""
    if match := _RANGE.fullmatch(text):
        return _of_range(match)
    if plc_type is PlcType.SLC and (match := _FUNCTION_FILES.fullmatch(text)):
        return (f'{match["name"]} is a function file, which is not supported; let the program '
                'copy what is needed into an N file')
    if _LETTERS_O.search(text):
        return ('that is the letter O where a digit should be; write '
                + _LETTERS_O.sub(lambda match: '0' * len(match[0]), text))
    if plc_type is PlcType.PLC5 and _SLC_IO.fullmatch(text):
        return ('this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as in '
                'I:017/12')
    if plc_type is PlcType.SLC and (match := _PLC5_IO.fullmatch(text)):
        kind = match['type']
        return (f'this is the octal form of a PLC-5; an SLC has slot, word and bit, as in '
                f'{kind}:1.0/3')
    if (match := _BIT_AFTER_DOT.fullmatch(text)) and int(match['bit']) < 16:
        return f'a bit stands after "/"; write {match["word"]}/{int(match["bit"])}'
    return None


def _of_range(match: re.Match[str]) -> str | None:
    count = match['braces'] or match['brackets'] or match['comma']
    if match['last'] is not None:
        count = str(int(match['last']) - int(match['element']) + 1)
    if int(count) < 1:
        return None
    return f'write {match["first"]}, and Length {int(count)}'
