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
The diagnostic commands that every node answers (M 7-6..7-27), and those that we refuse.

This module has their bytes. The diagnostic status is in ``identity``, the diagnostic counters are
in ``link_counters``. This driver sends no command that changes a processor's mode or the settings
of a link, and refuses such commands.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.pccc.fields import Reader, word

CMD = 0x06
ECHO = 0x00  # the reply has the same data (M 7-8)
READ_COUNTERS = 0x01
STATUS = 0x03
RESET_COUNTERS = 0x07

MAX_ECHO = 243  # bytes (M 7-8); a family may have less
MAX_COUNTERS = 244  # bytes in a reply to 06/01

STATUS_REQUEST = bytes((STATUS,))


@dataclass(frozen=True, slots=True)
class ReadCounters:
    """
    Read diagnostic counters, 06/01.

    ``address`` is 0 for an SLC, anything for a PLC-5, and for a module the address from its
    diagnostic status. ``size`` is bytes, at most 244.
    """

    address: int
    size: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return bytes((READ_COUNTERS,)) + word(self.address) + bytes((self.size,))

    @classmethod
    def read(cls, reader: Reader) -> ReadCounters:
        """Take the parameters off ``reader``; FormatError if bytes are missing or left."""
        request = cls(reader.word(), reader.byte())
        reader.end()
        return request
