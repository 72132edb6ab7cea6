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
Corrections of texts that are not addresses: a letter for a digit, a bit after a dot.

They are advice alone; no text is read as if it were corrected.
"""

from __future__ import annotations

from collections.abc import Iterator
import re

_BIT_AFTER_DOT = re.compile(
    r'(?<![A-Z])(?P<word>(?:B|N|S|A|D)\d*[:;]\d+)\.(?P<bit>\d{1,2})(?!\d)', re.ASCII)
# Letters O among digits.
_LETTERS_O = re.compile(r'(?<=[:;./0-9-])O+(?![A-Z])', re.ASCII)
# The digit 0, and 1 or a small L, in place of the letters O and I.
_DIGIT_FOR_LETTER = re.compile(r'(?P<sign>[01|]|L(?=.*/))(?P<rest>\d?:[\d.]+(?:/\d+)?)',
                               re.ASCII)

# As an array of a Logix controller.
_ARRAY = re.compile(r'(?P<file>[A-Z]+\d+)\[(?P<element>\d+)\]', re.ASCII)

# Other programs count the bits of the status file from its first word on.
_STATUS_BIT = re.compile(r'S2?/(?P<bit>\d{1,5})', re.ASCII)


def corrections(text: str) -> Iterator[tuple[str, str]]:
    """Yield a possible fault of a text, and a text that may be right."""
    text = text.strip().upper()
    if (bare := text.rstrip(',;.')) != text:
        yield f'"{text[len(bare):]}" after it is too much', bare
    if _LETTERS_O.search(text):
        yield ('that is the letter O where a digit should be',
               _LETTERS_O.sub(lambda match: '0' * len(match[0]), text))
    if found := _DIGIT_FOR_LETTER.fullmatch(text):
        letter = 'O' if found['sign'] == '0' else 'I'
        yield f'"{found["sign"]}" stands where {letter} should', f'{letter}{found["rest"]}'
    if found := _ARRAY.fullmatch(text):
        yield 'an element stands after ":"', f'{found["file"]}:{found["element"]}'
    if found := _STATUS_BIT.fullmatch(text):
        word, bit = divmod(int(found['bit']), 16)
        yield 'the word of the status file comes first', f'S:{word}/{bit}'
    if _BIT_AFTER_DOT.search(text):
        yield ('a bit stands after "/"',
               _BIT_AFTER_DOT.sub(lambda match: f'{match["word"]}/{int(match["bit"])}', text))
