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

Usual mistakes get an answer of their own: a range, a letter for a digit, a bit after a dot. Those
that only one family can tell are in its ``address``.
"""

from __future__ import annotations

import re

_RANGE = re.compile(
    r'(?P<first>[#$]?[A-Z]{1,2}\d*[:;](?P<element>\d{1,5})(?:[./][A-Z0-9]+)?)\s*'
    r'(?:\{(?P<braces>\d{1,5})\}|\[(?P<brackets>\d{1,5})\]|(?:,\s*L?|\s+L)(?P<comma>\d{1,5})'
    r'|(?:-|\.\.+|\bTO\b)\s*(?:[A-Z]{1,2}\d*[:;])?(?P<last>\d{1,5}))', re.ASCII)
_BIT_AFTER_DOT = re.compile(
    r'(?P<word>[#$]?(?:B|N|S|A|D)\d*[:;]\d+)\.(?P<bit>\d{1,2})', re.ASCII)
# Letters O among digits.
_LETTERS_O = re.compile(r'(?<=[:;./0-9])O+(?![A-Z])', re.ASCII)


def advice(text: str) -> str | None:
    """Return the advice for an address in capital letters, None for no usual mistake."""
    if match := _RANGE.fullmatch(text):
        return _of_range(match)
    if _LETTERS_O.search(text):
        return ('that is the letter O where a digit should be; write '
                + _LETTERS_O.sub(lambda match: '0' * len(match[0]), text))
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
