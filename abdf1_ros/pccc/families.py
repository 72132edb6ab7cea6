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

"""The PLC families that there are, each in a folder of its own."""

from __future__ import annotations

from abdf1_ros.counters import Counters
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import gateways
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, AddressSyntaxError
from abdf1_ros.pccc.address_advice import corrections
from abdf1_ros.pccc.address_range import AddressRange, read_range
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.plc2 import FAMILY as PLC2
from abdf1_ros.pccc.plc3 import FAMILY as PLC3
from abdf1_ros.pccc.plc5 import FAMILY as PLC5
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc import FAMILY as SLC

# The longest text of an address (characters); two ends of a range take far less.
_LONGEST = 100

FAMILIES: dict[PlcType, Family] = {family.plc_type: family for family in (PLC2, PLC3, PLC5, SLC)}


def decode_identity(data: bytes) -> Identity:
    """
    Read the data of a reply to 06/03.

    Data of an unknown layout are shown in hexadecimal. Raises FormatError for a reply that is too
    short.
    """
    if len(data) < 2:
        raise FormatError(f'a diagnostic status of {len(data)} bytes')
    for decode in (*(family.decode_identity for family in FAMILIES.values()), gateways.decode):
        identity = decode(data)
        if identity is not None:
            return identity
    return Identity(None, f'unknown processor ({data[:8].hex(" ").upper()})')


def served_counters(counters: Counters, plc_type: PlcType, mode: str) -> ServedCounters | None:
    """
    Return our counters as a processor of the family in the same mode shows its own.

    The modules in front of a PLC-2 or PLC-3 have blocks of their own (M 9-10), which are not
    emulated: then return None.
    """
    layout_in = FAMILIES[plc_type].served_counters
    return layout_in and ServedCounters(counters, layout_in(mode))


def parse_address(text: str, plc_type: PlcType, access: Access | None = None) -> Address:
    """
    Read the text of an address, reached by ``access`` where that makes a difference.

    Raises AddressSyntaxError or AddressRangeError, whose text says what would be right.
    """
    found = parse_range(text, plc_type, access)
    if isinstance(found, AddressRange):
        raise AddressSyntaxError(f'write {found.first}, and Length {found.length()}')
    return found


def parse_range(text: str, plc_type: PlcType,
                access: Access | None = None) -> Address | AddressRange:
    """Read the text of an address or of a range; raises what ``parse_address`` does."""
    if len(text) > _LONGEST:
        raise AddressSyntaxError(f'an address has at most {_LONGEST} characters')
    addressing = FAMILIES[plc_type].addressing

    def parse(part: str) -> Address:
        return addressing.parse(part, access)

    try:
        return read_range(text, parse)
    except AddressSyntaxError:
        for reason, right in corrections(text):
            try:
                read_range(right, parse)
            except FormatError:
                continue
            raise AddressSyntaxError(f'{reason}; write {right}') from None
        raise


def dialect_of(plc_type: PlcType, access: Access | None = None,
               processor: Processor | None = None) -> Dialect:
    """
    Return the dialect for such a PLC; None stands for the usual access of the family.

    Raises FormatError when the family does not have this access, and for a processor of
    another family.
    """
    family = FAMILIES[plc_type]
    ways = tuple(family.dialects)
    if access is not None and access not in ways:
        right = ', '.join(entry.value for entry in ways)
        raise FormatError(f'Access of a {family.addressing.title} is {right}, not {access.value}')
    if processor is None:
        return family.dialects[access or ways[0]]
    if not family.by_processor:
        raise FormatError(f'a {family.addressing.title} has no Processor')
    return family.by_processor[processor]
