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

"""Which data files a processor has, and how long they are, found by reading alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.address import Address, Addressing
from abdf1_ros.pccc.dialect import Dialect, Steps
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import (
    check_status,
    EXT_BAD_PARAMETER,
    EXT_OTHER_TYPE,
    is_address_fault,
)


@dataclass(frozen=True, slots=True)
class DataFile:
    """
    A file with its elements.

    The elements of the images of inputs and outputs are words, 0 if they cannot be counted.
    """

    type: FileType  # noqa: A003
    number: int
    elements: int

    def __str__(self) -> str:
        """Return type and number as in an address."""
        return self.type.value if self.type.is_function else f'{self.type.value}{self.number}'


class FileSearch(Protocol):
    """The search for the files of a PLC of one family."""

    def directory(self, processor: Processor | None) -> Steps[list[DataFile]] | None:
        """
        Return the steps that read the processor's own list of files, None where none is known.

        The steps raise RemoteError or LinkError, and FormatError for data that are not such a
        list.
        """

    def look_for(self, number: int) -> Steps[DataFile | None]:
        """Return the steps that look for a file by reads; their result is None without a file."""


def is_there(address: Address, dialect: Dialect) -> Steps[bool]:
    """Tell whether a read of an element succeeds; raises what ``check_absent`` does."""
    words = address.layout.words
    try:
        dialect.read_data(address, words, check_status((yield dialect.read(address, words))))
    except (RemoteError, FormatError) as error:
        check_absent(error)
        return False
    return True


def check_absent(error: RemoteError | FormatError) -> None:
    """Raise a refusal that does not tell what the PLC has: of a node on the way, or of access."""
    if isinstance(error, RemoteError) and not is_address_fault(error) \
            and error.ext_sts not in (EXT_OTHER_TYPE, EXT_BAD_PARAMETER):
        raise error


def counted(addressing: Addressing, dialect: Dialect, kind: FileType, number: int,
            most: int) -> Steps[DataFile]:
    """Count the elements of a file, at most ``most``, by bisection; element 0 has to exist."""
    low, high = 1, most
    while low < high:
        middle = (low + high + 1) // 2
        if (yield from is_there(Address(addressing, kind, number, middle - 1), dialect)):
            low = middle
        else:
            high = middle - 1
    return DataFile(kind, number, low)
