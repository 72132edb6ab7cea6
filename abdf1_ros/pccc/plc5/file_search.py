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

"""The data files of a PLC-5. Its reply to a typed read names the type of the elements."""

from __future__ import annotations

from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_search import check_absent, counted, DataFile
from abdf1_ros.pccc.file_types import DEFAULT_FILES, FileType
from abdf1_ros.pccc.plc5.address import ADDRESSING, FILES
from abdf1_ros.pccc.plc5.dialect import PLC5_TYPED
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.typed_data import BYTE_STRING, TypedData

_USUAL = {number: kind for kind, number in DEFAULT_FILES.items()}


class Plc5FileSearch:
    """Search by typed reads, because no list of the files is known."""

    def directory(self, processor: Processor | None) -> None:
        return None

    def look_for(self, number: int) -> Steps[DataFile | None]:
        start = Address(ADDRESSING, FileType.INTEGER, number, 0)
        try:
            kind = _kind(number, TypedData.decode(check_status((yield PLC5_TYPED.read(start, 1)))))
        except (RemoteError, FormatError) as error:
            check_absent(error)
            return None
        if kind is None or kind.is_io:
            return kind and DataFile(kind, number, 0)
        return (yield from counted(ADDRESSING, PLC5_TYPED, kind, number,
                                   ADDRESSING.last_element(kind) + 1))


def _kind(number: int, data: TypedData) -> FileType | None:
    """Return the type that a reply tells; words of N, B, O, I and S files are all integers."""
    usual = _USUAL.get(number, FileType.INTEGER)
    if data.type_id == FILES[usual].code:
        return usual
    if data.type_id == BYTE_STRING:
        return FileType.ASCII if data.element_size == 1 else FileType.STRING
    kinds = FileType.INTEGER, *FILES  # of all types with its code, a user file is this one
    return next((kind for kind in kinds if FILES[kind].code == data.type_id), None)
