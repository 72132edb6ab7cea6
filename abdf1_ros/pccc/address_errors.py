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

"""What can be wrong with an address: its text, or its bytes in a command."""

from __future__ import annotations

from abdf1_ros.errors import FormatError


class AddressSyntaxError(FormatError):
    """The text is not an address of this family."""


class AddressRangeError(FormatError):
    """The address is well formed, but outside what the family can have."""


class AddressRefusal(FormatError):
    """The address in a command does not exist; a PLC answers with ``ext_sts`` (M 8-4)."""

    def __init__(self, ext_sts: int, text: str) -> None:
        super().__init__(text)
        self.ext_sts = ext_sts
