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

"""Explanations of bad cells and first rows: look-alike characters, files of other programs."""

from __future__ import annotations

from collections.abc import Sequence
import re
import unicodedata

from abdf1_ros.text import shown

WORKBOOKS = (b'PK\x03\x04', bytes.fromhex('D0CF11E0A1B11AE1'))
"""The first bytes of other files that were renamed to .csv: zip archives, old Excel files."""

# Letters of other scripts, dashes and quotes that look like a character of ASCII.
_ALIKE = str.maketrans(
    'АВЕКМНОРСТХІЅаеорсухіѕΑΒΕΖΗΙΚΜΝΟΡΤΥΧο‐‑‒–—−‘’“”⁄∕',
    'ABEKMHOPCTXISaeopcyxisABEZHIKMNOPTYXo------\'\'""//')
_MONTH = '(?:jan|feb|mar|mär|mrz|apr|may|mai|jun|jul|aug|sep|oct|okt|nov|dec|dez)[a-zä]*'
_TIME = re.compile(
    rf'\d{{1,2}}:\d\d(?::\d\d)?(?: ?[ap]m)?|\d{{1,4}}[./-]\d{{1,2}}[./-]\d{{1,4}}|'
    rf'\d{{1,2}}-\d{{1,2}}|\d{{1,2}}(?:\.|\.?[ -]){_MONTH}\.?(?:[ -]\d+)?|{_MONTH}\.?[ -]\d+',
    re.ASCII | re.IGNORECASE)
_WRAPPED = re.compile(r'="?(?P<formula>[^"]+)"?|\'(?P<text>.+)')
_ERROR = re.compile(r'#(?:(?:N/A|NV|NAME\?|NOM\?)'
                    r'|(?:DIV/0|REF|VALUE|NULL|NUM|BEZUG|WERT|ZAHL|VALEUR|VALOR)!)')
_LIKE_AN_ADDRESS = re.compile(r'[A-Z]{1,3}\d*:\d+\S*', re.ASCII)


def is_spreadsheet_error(text: str) -> bool:
    """Tell whether a cell is a spreadsheet's mark for a missing value, such as #N/A."""
    return _ERROR.fullmatch(text) is not None


def hint(text: str) -> str:
    """Return the hint that follows the fault of a cell with this content, empty for none."""
    if _TIME.fullmatch(text):  # also with the ä of a German March
        return ('; a spreadsheet may have made a date or time of it: give the column the format '
                '"text", and write the cell again')
    for number, character in enumerate(text, 1):
        if not ' ' <= character <= '~':
            return f'; character {number} is {_name(character)}'
    if match := _WRAPPED.fullmatch(text):
        return ('; signs that only a spreadsheet needs: write '
                f'{shown(match["formula"] or match["text"])}')
    return ''


def pasted(text: str) -> str:
    """
    Return the hint at the first character of a text that looks like one of ASCII, empty for none.

    Such characters come from pages and mails: “ ” – and blanks that do not break. Letters of any
    language are none.
    """
    character = next((each for each in text if not each.isascii() and _plain(each)), '')
    return f'; "{character}" is {_name(character)}' if character else ''


def _name(character: str) -> str:
    if character == '\t':
        return 'a tab, which divides no cells here'
    name = f'U+{ord(character):04X} {unicodedata.name(character, "")}'.rstrip()
    plain = _plain(character)
    return f'{name}, not "{plain}"' if plain else name


def _plain(character: str) -> str:
    """Return the characters of ASCII that a character looks like, empty for none."""
    plain = unicodedata.normalize('NFKC', character).translate(_ALIKE)
    return plain if plain.isascii() and plain.isprintable() else ''


def looks_like_address(text: str) -> bool:
    """Tell whether a cell has the form of most addresses, such as N7:0."""
    return _LIKE_AN_ADDRESS.fullmatch(text.upper()) is not None


def is_export_of_kepserver(names: Sequence[str]) -> bool:
    """Tell whether a first row begins an export of tags from KEPServerEX."""
    return {'tag name', 'address', 'client access'} <= {name.lower() for name in names}


def export_fault(path: str, names: Sequence[str]) -> str:
    """Return the fault of a file that another program has exported, empty for none."""
    return f'is an export of KEPServerEX; "plc import {path}" makes a map of it' \
        if is_export_of_kepserver(names) else ''


def row_hint(names: Sequence[str]) -> str:
    """Return an explanation of a first row that names no column, empty for none."""
    if names[0].startswith('//'):
        return ', and a comment begins with #'
    if any(map(looks_like_address, names)):
        return (', it has an address, as in an export of symbols from RSLogix ("plc import" makes '
                'a map of it) or a map without its first row')
    return ''
