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

"""What real processors have answered: vectors/processors.json with types."""

from dataclasses import dataclass
import json
from typing import Any

from abdf1_ros.df1.packet import Packet
from support.vectors import VECTOR_FOLDER

PROCESSORS: list[dict[str, Any]] = json.loads(
    (VECTOR_FOLDER / 'processors.json').read_text(encoding='utf-8'))['processors']


@dataclass(frozen=True, slots=True)
class Exchange:
    """A command and its reply, without link header."""

    meaning: str
    command: Packet
    reply: Packet


def exchanges(name: str) -> list[Exchange]:
    """Return what a processor has been asked, and has answered."""
    entry = next(processor for processor in PROCESSORS if processor['name'] == name)
    found = []
    for exchange in entry['exchanges']:
        raw = bytes.fromhex(exchange['command'])
        command = Packet(1, 0, raw[0], 0, 7, raw[1:])
        reply = command.reply(bytes.fromhex(exchange['data']), int(exchange['sts'], 16))
        found.append(Exchange(exchange['meaning'], command, reply))
    return found


ML1400 = exchanges('micrologix_1400')
