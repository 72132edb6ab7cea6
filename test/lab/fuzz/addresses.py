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

"""Fuzz target: the grammar of addresses, of every family."""

from abdf1_ros.pccc.address import AddressRangeError, AddressSyntaxError, BITS
from abdf1_ros.pccc.families import FAMILIES, parse_address


def one_input(data: bytes) -> None:
    """Check that text is an address, which reads back from its own text, or is refused."""
    text = data.decode(errors='replace')
    for plc_type in FAMILIES:
        try:
            address = parse_address(text, plc_type)
        except (AddressSyntaxError, AddressRangeError) as error:
            assert str(error)
            continue
        shown = str(address)
        assert shown.isascii() and shown.isprintable()
        assert parse_address(shown, plc_type) == address
        assert 0 <= address.offset < address.area_size
        assert address.bit is None or 0 <= address.bit < BITS
