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

"""The rules of the link in the documentation, from vectors/conversations.json."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
import json
from pathlib import Path
import re
from typing import Any

from tools.tables import table

_FILE = Path(__file__).resolve().parent.parent / 'vectors' / 'conversations.json'
_OURS = ('ours', 'S0')  # sources that are not rules of the protocol
_SIDES = {'Master': ('master', 'slave'), 'Slave': ('slave', 'master'), 'Peer': ('node', 'PLC')}


@cache
def _conversations() -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = json.loads(
        _FILE.read_text(encoding='utf-8'))['conversations']
    return entries


def rules(*modes: str) -> str:
    """Return the protocol rules of the modes, and the conversations that show them."""
    names: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for entry in _conversations():
        if entry['mode'] in modes and not entry['source'].startswith(_OURS):
            name = re.sub(r'_\d+$', '_n', entry['name'])
            known = names[entry['rule'], entry['source']]
            if name not in known:
                known.append(name)
    return table(('rule', 'source', 'conversation'), (
        (rule, source, ', '.join(f'`{name}`' for name in played))
        for (rule, source), played in names.items()))


def dialogue(name: str) -> str:
    """Return a conversation as a diagram."""
    entry = next(entry for entry in _conversations() if entry['name'] == name)
    ours, theirs = _SIDES[entry['mode']]
    drawn, last = [f'    participant A as {ours}', f'    participant B as {theirs}'], 0
    if 'Master' not in entry['mode'] and ours == 'slave':
        drawn.reverse()
    for line in entry['lines']:
        at = f'{line["at"]} ms: ' if line['at'] != last else ''
        if 'says' in line:
            arrow = 'A->>B' if 'we' in line else 'B->>A'
            drawn.append(f'    {arrow}: {at}{line["says"]}')
        elif 'executes' in line:
            drawn.append('    Note over A: executes it')
        else:
            continue
        last = line['at']
    return '\n'.join(('```mermaid', 'sequenceDiagram', *drawn, '```'))
