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

"""Messages, QoS and values of mappings, with the real std_msgs."""

from array import array
import math
from pathlib import Path
from typing import Any

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.ros.topics import messages
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
import pytest
from rclpy import qos
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs import msg
from support.cases import for_all
from support.ros import write_csv

TYPES = {
    'bool': msg.UInt8MultiArray, 'int16': msg.Int16MultiArray, 'uint16': msg.UInt16MultiArray,
    'bcd16': msg.UInt16MultiArray, 'bcd12': msg.UInt16MultiArray, 'int32': msg.Int32MultiArray,
    'uint32': msg.UInt32MultiArray, 'float32': msg.Float32MultiArray, 'string': msg.String}


def make_mapping(folder: Path, address: str, **cells: object) -> Mapping:
    header = ','.join(['Tag,Command,Address,Station,PLC_Type', *cells])
    row = ','.join(map(str, ['tag', 'Read', address, 2, 'SLC', *cells.values()]))
    (mapping,), problems = load_mappings(str(write_csv(folder / 'map.csv', header, [row])))
    assert not problems
    return mapping


def test_every_value_type_has_its_message() -> None:
    assert messages.MESSAGES == {ValueType(name): message for name, message in TYPES.items()}


@for_all(('address', 'cells', 'kind'), [
    ('B3:1/14', {'Length': 5}, msg.UInt8MultiArray), ('N7:3', {'Length': 5}, msg.Int16MultiArray),
    ('B3:3', {'Length': 5}, msg.UInt16MultiArray), ('F8:3', {'Length': 5}, msg.Float32MultiArray),
    ('L10:3', {'Length': 5}, msg.Int32MultiArray),
    ('N7:3', {'Length': 5, 'Type': 'uint32'}, msg.UInt32MultiArray),
    ('N7:3', {'Length': 5, 'Type': 'bcd16'}, msg.UInt16MultiArray),
    ('N7:3', {'Length': 5, 'Scale': 0.1}, msg.Float32MultiArray),
    ('N7:3', {'Length': 5, 'Offset': 1, 'Type': 'uint32'}, msg.Float32MultiArray)])
def test_layout_says_what_the_values_are(
        tmp_path: Path, address: str, cells: dict[str, object], kind: Any) -> None:
    message = messages.new_message(make_mapping(tmp_path, address, **cells))
    assert type(message) is kind
    (dimension,) = message.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == (address, 5, 5)
    assert message.layout.data_offset == 0


@pytest.mark.parametrize(('address', 'cells'), [
    ('ST9:0', {}), ('A10:0', {'Length': 5, 'Type': 'string'})])
def test_string_has_no_layout(tmp_path: Path, address: str, cells: dict[str, object]) -> None:
    assert messages.new_message(make_mapping(tmp_path, address, **cells)) == msg.String()


def padded(wire: bytes) -> bytes:
    """
    Return a message with 0 as padding, which nobody sets.

    CDR aligns the number after the label to 4 bytes; before the label stand the header, the count
    of dimensions and the length of the label.
    """
    end = 12 + int.from_bytes(wire[8:12], 'little')
    count = -end % 4
    return wire[:end] + bytes(count) + wire[end + count:]


@for_all('length', [1, 2, 3, 7])
@for_all(('address', 'cells', 'values'), [
    ('B3:1/3', {}, [1, 0, 0, 1, 1, 0, 1]), ('N7:3', {}, [-1, 0, 1, 256, -32768, 32767, 7]),
    ('B3:3', {}, [65535, 1, 0, 2, 3, 4, 5]), ('F8:3', {}, [1.0, -0.5, 0.0, 2.0, 3.0, 4.0, 5.0]),
    ('L10:3', {}, [-2**31, 1, 2**31 - 1, 0, 5, 6, 7]),
    ('N7:3', {'Type': 'uint32'}, [2**32 - 1, 1, 0, 65536, 2, 3, 4]),
    ('N7:3', {'Type': 'bcd16'}, [9999, 1, 0, 1000, 2, 3, 4])])
def test_array_that_is_encoded_is_the_message(
        tmp_path: Path, address: str, cells: dict[str, object], values: list[float],
        length: int) -> None:
    mapping = make_mapping(tmp_path, address, Length=length, **cells)
    encode, message = messages.encoder(mapping), messages.new_message(mapping)
    for given in (values[:length], values[-length:]):
        # As it comes from a PLC, not as the message would make it.
        read = mapping.codec.decode(mapping.codec.encode(given)) if mapping.address.bit is None \
            else array('B', map(int, given))
        message.data = given
        assert padded(encode(read)) == padded(serialize_message(message))
        assert deserialize_message(encode(read), type(message)) == message


def test_engineering_values_are_encoded(tmp_path: Path) -> None:
    mapping = make_mapping(tmp_path, 'N7:3', Length=2, Scale=0.5)
    assert mapping.scaling is not None
    values = mapping.scaling.publish(mapping.codec.decode(b'\x03\x00\xff\xff'))
    message = deserialize_message(messages.encoder(mapping)(values), msg.Float32MultiArray)
    assert list(message.data) == [1.5, -0.5]


def test_string_is_published_as_a_message(tmp_path: Path) -> None:
    assert messages.encoder(make_mapping(tmp_path, 'ST9:0'))('text') == msg.String(data='text')


@pytest.mark.parametrize(('text', 'arrived'), [
    ('Tank \xe4\t\x1b[2J\r\n', 'Tank \xe4\t\x1b[2J\r\n'), ('ab\0cd', 'ab')])
def test_string_arrives_unchanged_up_to_a_nul(text: str, arrived: str) -> None:
    wire = serialize_message(msg.String(data=text))
    assert deserialize_message(wire, msg.String).data == arrived


def test_values_of_arrays_and_strings() -> None:
    assert messages.values_of(msg.Int16MultiArray(data=[-1, 2])) == array('h', [-1, 2])
    assert messages.values_of(msg.String(data='text')) == 'text'
    assert messages.values_of(msg.UInt8MultiArray()) == array('B')


def test_values_that_do_not_start_at_the_beginning_are_refused() -> None:
    message = msg.Int16MultiArray(data=[1, 2], layout=msg.MultiArrayLayout(data_offset=1))
    with pytest.raises(FormatError, match=r'^layout\.data_offset should be 0$'):
        messages.values_of(message)


def test_read_topic_offers_its_stale_time(tmp_path: Path) -> None:
    profile = messages.read_qos(make_mapping(tmp_path, 'N7:0'), 0.75)
    assert profile.reliability is qos.ReliabilityPolicy.RELIABLE
    assert profile.durability is qos.DurabilityPolicy.TRANSIENT_LOCAL
    assert (profile.history, profile.depth) == (qos.HistoryPolicy.KEEP_LAST, 1)
    assert profile.liveliness is qos.LivelinessPolicy.MANUAL_BY_TOPIC
    stale_time = Duration(nanoseconds=750_000_000)
    assert profile.lifespan == profile.deadline == stale_time
    assert profile.liveliness_lease_duration == stale_time


@pytest.mark.parametrize(('cells', 'stale_time'), [
    ({'Publish': 'Change'}, 0.75), ({'Publish': 'Always'}, math.inf)])
def test_topic_without_a_rhythm_promises_none(
        tmp_path: Path, cells: dict[str, object], stale_time: float) -> None:
    profile = messages.read_qos(make_mapping(tmp_path, 'N7:0', **cells), stale_time)
    assert profile.durability is qos.DurabilityPolicy.TRANSIENT_LOCAL
    default = qos.QoSProfile(depth=1)
    assert profile.lifespan == default.lifespan
    assert profile.deadline == default.deadline
    assert profile.liveliness_lease_duration == default.liveliness_lease_duration
    assert profile.liveliness is not qos.LivelinessPolicy.MANUAL_BY_TOPIC


def test_result_is_not_repeated_to_a_subscriber_that_was_cut_off_for_its_lease() -> None:
    profile = messages.results_qos()
    assert profile.reliability is qos.ReliabilityPolicy.RELIABLE
    assert profile.durability is qos.DurabilityPolicy.VOLATILE
    assert (profile.history, profile.depth) == (qos.HistoryPolicy.KEEP_LAST, 1000)
    assert profile.lifespan == Duration(seconds=10)  # a lease is 20 s


def test_write_topic_keeps_a_burst_but_nothing_from_before() -> None:
    profile = messages.write_qos()
    assert profile.reliability is qos.ReliabilityPolicy.RELIABLE
    assert profile.durability is qos.DurabilityPolicy.VOLATILE
    assert profile.depth >= 1000  # as many as may wait for the line
