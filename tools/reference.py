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
Write the generated parts of documentation and dissector, each between its two markers.

Run it from the root as ``python -m tools.reference``, or as ``make docs``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
import re
import sys

from abdf1_ros.messages import Severity

from tools import conversations, dissector, drawing, tables

ROOT = Path(__file__).resolve().parent.parent
REFERENCE = 'docs/reference'

PARTS: dict[tuple[str, str], Callable[[], str]] = {
    ('CONTRIBUTING.md', 'rooms'): tables.rooms,
    ('docs/architecture.md', 'drawing'): drawing.mermaid,
    ('wireshark/abdf1.lua', 'tables'): dissector.lua,
    (f'{REFERENCE}/bounds.md', 'bounds'): tables.bounds,
    ('docs/protocol/framing.md', 'symbols'): tables.symbols,
    ('docs/protocol/full_duplex.md', 'message'): partial(
        conversations.dialogue, 'peer_transaction_2'),
    ('docs/protocol/full_duplex.md', 'enquiry'): partial(conversations.dialogue, 'peer_enquired'),
    ('docs/protocol/full_duplex.md', 'rules'): partial(conversations.rules, 'Peer'),
    ('docs/protocol/full_duplex.md', 'radio'): partial(conversations.rules, 'Radio'),
    ('docs/protocol/half_duplex.md', 'command'): partial(
        conversations.dialogue, 'master_slow_slave'),
    ('docs/protocol/half_duplex.md', 'repetition'): partial(
        conversations.dialogue, 'master_ack_lost'),
    ('docs/protocol/half_duplex.md', 'rules'): partial(
        conversations.rules, 'Master', 'Standard polling', 'Slave'),
    ('docs/sharing.md', 'rights'): tables.rights,
    ('docs/troubleshooting.md', 'causes'): tables.causes,
    ('docs/protocol/addresses.md', 'file-codes'): tables.file_codes,
    ('docs/protocol/statuses.md', 'statuses'): tables.statuses,
    ('docs/protocol/commands.md', 'commands'): tables.commands,
    (f'{REFERENCE}/files.md', 'net'): tables.net_fields,
    (f'{REFERENCE}/files.md', 'map'): tables.map_columns,
    (f'{REFERENCE}/addresses.md', 'addresses'): tables.addresses,
    (f'{REFERENCE}/addresses.md', 'members'): tables.members,
    (f'{REFERENCE}/addresses.md', 'packets'): tables.packets,
    (f'{REFERENCE}/parameters.md', 'parameters'): tables.parameters,
    (f'{REFERENCE}/topics.md', 'outcomes'): tables.outcomes,
    (f'{REFERENCE}/topics.md', 'reasons'): tables.write_reasons,
    (f'{REFERENCE}/counters.md', 'counters'): tables.counters,
    **{(f'{REFERENCE}/messages.md', severity.value): partial(tables.messages, severity)
       for severity in Severity},
}
"""The function that makes each part, by file and marker."""


def find(text: str, name: str) -> re.Match[str]:
    """Return the place of a part in ``text``, with its markers; raises LookupError."""
    # A comment of Markdown, or one of Lua.
    match = re.search(rf'((?:<!)?-- generated: {name}(?: -->)?\n).*?((?:<!)?-- end: {name}\b)',
                      text, re.DOTALL)
    if match is None:
        raise LookupError(f'there are no markers "generated: {name}" and "end: {name}"')
    return match


def filled(text: str, name: str, part: str) -> str:
    """Return ``text`` with the part between its markers."""
    match = find(text, name)
    return f'{text[:match.end(1)]}\n{part}\n\n{text[match.start(2):]}'


def main() -> int:
    """Write every part; return 0."""
    for (file, name), make in PARTS.items():
        path = ROOT / file
        text = path.read_text(encoding='utf-8')
        new = filled(text, name, make())
        if new != text:
            path.write_text(new, encoding='utf-8')
            print(f'{file}: {name}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
