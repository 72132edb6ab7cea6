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


"""The transcript of a case: what both ends of the line have sent."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import BlockCheck, Symbol, SymbolKind

_NO_ANSWERS = (SymbolKind.NOISE, SymbolKind.NAK, SymbolKind.EOT)
_NOT_TO_BE_TAKEN = (SymbolKind.ACK, SymbolKind.NAK, SymbolKind.POLL)


@dataclass(frozen=True, slots=True)
class Sent:
    """Bytes that we have sent, and the time (s)."""

    at: float
    raw: bytes


class Transcript:
    """All bytes of a case in their order: ``entries`` has ours and the symbols of the target."""

    def __init__(self, check: BlockCheck, is_half_duplex: bool) -> None:
        self.entries: list[Sent | Symbol] = []
        self._check = check
        self._is_half_duplex = is_half_duplex

    def has_sent(self, raw: bytes) -> bool:
        """Tell whether we have sent these bytes, alone or among others."""
        return any(raw in entry.raw for entry in self.entries if isinstance(entry, Sent))

    @property
    def is_unanswered(self) -> bool:
        """
        Tell whether neither DLE ACK nor a reply has come since we last sent anything to be taken.

        That is anything but polls and responses. DLE EOT, DLE NAK and commands are no answers:
        they come from a target that takes nothing, too.
        """
        for entry in reversed(self.entries):
            if isinstance(entry, Symbol):
                if entry.kind not in _NO_ANSWERS and not codec.is_command(entry):
                    break
                continue
            sent = codec.next_symbol(entry.raw, self._check, self._is_half_duplex)
            if sent is None or sent.kind not in _NOT_TO_BE_TAKEN or not sent.is_good:
                return True
        return False
