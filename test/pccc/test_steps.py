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

"""Steps with a station: what is asked, and what becomes of the answers."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.steps import AddressedValues, read, write
import pytest

SLC = PlcType.SLC


def reply(data: bytes = b'', sts: int = 0) -> Packet:
    return Packet(5, 1, 0x4F, sts, 7, data)


def requests_of(steps: Steps[object], *answers: Packet) -> list[str]:
    """Return the requests as bytes, when each has been answered."""
    found = [next(steps)]
    for answer in answers:
        try:
            found.append(steps.send(answer))
        except StopIteration:
            break
    return [data.hex(' ').upper() for _, data in found]


def test_packets_are_those_of_the_processor() -> None:
    for processor, sizes in ((None, [236, 14]), (Processor.SLC_5_01, [82, 82, 82, 4])):
        values = AddressedValues.of('N7:0', SLC, 125, processor=processor)
        found = requests_of(read(values), *(reply(bytes(size)) for size in sizes))
        assert [int(request.split()[1], 16) for request in found] == sizes


def test_values_across_elements_are_read_in_whole_elements() -> None:
    values = AddressedValues.of('T4:1.ACC', SLC, 3)
    assert requests_of(read(values), reply(bytes(12))) == ['A2 0C 04 86 01 00']
    assert requests_of(read(AddressedValues.of('T4:1.ACC', SLC)), reply(b'\1\0')) == [
        'A2 02 04 86 01 02']


def test_write_stops_at_the_first_refusal() -> None:
    steps = write(AddressedValues.of('N7:0', SLC, 250), [*range(250)])
    assert next(steps)[1][:2] == bytes((0xAA, 234))
    steps.send(reply())
    with pytest.raises(RemoteError, match='STS 60'):
        steps.send(reply(sts=0x60))


def test_what_must_not_be_written_is_refused_before_the_first_step() -> None:
    with pytest.raises(FormatError, match='HSC:0.ACC belongs to the processor'):
        write(AddressedValues.of('HSC:0.ACC', SLC), [1])
    with pytest.raises(FormatError, match='2 values'):
        write(AddressedValues.of('N7:0', SLC), [1, 2])


@pytest.mark.parametrize(('text', 'access', 'sts', 'is_told'), [
    ('I:1.0', None, 0x10, True), ('O:2.0', Access.SLOT, 0x50, True),
    ('I:1.0', None, 0x60, False), ('I:5', Access.FLAT, 0x10, False), ('N7:0', None, 0x10, False)])
def test_refused_inputs_and_outputs_by_slot_lead_to_flat(
        text: str, access: Access | None, sts: int, is_told: bool) -> None:
    steps = read(AddressedValues.of(text, SLC, access=access))
    next(steps)
    with pytest.raises(RemoteError) as refusal:
        steps.send(reply(sts=sts))
    assert ('Access Flat' in str(refusal.value)) is is_told
