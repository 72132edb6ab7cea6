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

"""Which dialect speaks to which PLC."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access, accesses_of
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.plc2.dialect import Plc2Dialect
from abdf1_ros.pccc.plc5.dialect import Plc5Dialect
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.slc.dialect import SlcDialect
from abdf1_ros.pccc.word_range.dialect import PLC3, PLC5_WORD_RANGE

_DIALECTS: dict[tuple[PlcType, Access], Dialect] = {
    (PlcType.PLC2, Access.UNPROTECTED): Plc2Dialect(Access.UNPROTECTED),
    (PlcType.PLC2, Access.PROTECTED): Plc2Dialect(Access.PROTECTED),
    (PlcType.PLC2, Access.CIF): Plc2Dialect(Access.CIF),
    (PlcType.PLC3, Access.WORD_RANGE): PLC3,
    (PlcType.PLC5, Access.TYPED): Plc5Dialect(),
    (PlcType.PLC5, Access.WORD_RANGE): PLC5_WORD_RANGE,
}
# Slots or the whole image: an SLC's addresses tell which.
_SLC = {processor: SlcDialect(processor) for processor in Processor}


def dialect_of(plc_type: PlcType, access: Access | None = None,
               processor: Processor | None = None) -> Dialect:
    """
    Return how such a PLC is spoken to; None stands for what is usual in the family.

    The usual SLC is a 5/03. Raises FormatError when the family does not have this access, and
    for a processor of another family.
    """
    ways = accesses_of(plc_type)
    if access is not None and access not in ways:
        right = ', '.join(entry.value for entry in ways)
        raise FormatError(f'Access of a {plc_type.value} is {right}, not {access.value}')
    if plc_type is PlcType.SLC:
        return _SLC[processor or USUAL]
    if processor is not None:
        raise FormatError(f'Processor is for PLC_Type SLC, not for {plc_type.value}')
    return _DIALECTS[plc_type, access or ways[0]]
