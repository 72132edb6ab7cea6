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

"""ROS names made of tags, as ``rcl`` accepts them."""

from __future__ import annotations

import re
import unicodedata

# DDS allows topic names of at most 247 characters; 150 leave room for the namespace, the node and
# "/write/".
MAX_LENGTH = 150

_SPELLED = str.maketrans({
    'ä': 'ae', 'ö': 'oe', 'ü': 'ue', 'ß': 'ss', 'Ä': 'Ae', 'Ö': 'Oe', 'Ü': 'Ue', 'æ': 'ae',
    'ø': 'oe', 'å': 'aa'})


def sanitise(text: str) -> str:
    """
    Return ``text`` as a relative topic name, or '' if no part of it is left.

    "/" separates parts; any other character that ROS does not allow becomes "_", runs of "_"
    become one, and a part that begins with a digit gets a "t" in front.
    """
    parts = (_part(part) for part in text.split('/'))
    return '/'.join(part for part in parts if part)


def in_ascii(text: str) -> str:
    """Return ``text`` with ae for ä, and other letters without their accents."""
    plain = unicodedata.normalize('NFKD', text.translate(_SPELLED))
    return ''.join(letter for letter in plain if letter.isascii())


def _part(text: str) -> str:
    name = re.sub(r'_+', '_', re.sub(r'[^A-Za-z0-9_]', '_', text)).strip('_')
    return f't{name}' if name[:1].isdigit() else name
