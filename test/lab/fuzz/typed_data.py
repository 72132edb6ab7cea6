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

"""Fuzz target: type descriptors and system addresses of the PLC-5 commands."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.typed_data import TypedData


def one_input(data: bytes) -> None:
    """Check that parameters are read whole and encode to themselves, or are refused."""
    _typed_data(data)
    _system_address(data)


def _typed_data(data: bytes) -> None:
    try:
        values = TypedData.decode(data)
    except FormatError as error:
        assert str(error)
        return
    assert len(values.data) <= len(data)
    assert values.count * values.element_size == len(values.data)
    assert TypedData.decode(values.encode()) == values


def _system_address(data: bytes) -> None:
    try:
        address = SystemAddress.read(Reader(data))
    except FormatError as error:
        assert str(error)
        return
    assert SystemAddress.read(Reader(address.encode())) == address
