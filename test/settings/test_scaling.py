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

"""Engineering values: there and back, rounding, limits, and what cannot be scaled."""

from array import array
import math

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.scaling import Scaling
from hypothesis import assume, given, settings
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.mappings import make_mapping

_WHOLE = (ValueType.INT16, ValueType.UINT16, ValueType.BCD16)
_SCALES = st.floats(allow_nan=False, allow_infinity=False) | st.floats(0.001, 1000.0)


@settings(max_examples=40)
@given(st.sampled_from(_WHOLE), st.floats(-1e6, 1e6), _SCALES, st.data())
def test_value_just_published_gives_the_same_raw_value_back(
        kind: ValueType, offset: float, scale: float, data: st.DataObject) -> None:
    scaling = Scaling(scale, offset)
    assume(scale != 0 and scaling.fault(kind) is None)
    low, high = (int(end) for end in kind.range)
    raw = data.draw(st.lists(st.integers(low, high) | st.sampled_from((low, high))))
    published = scaling.publish(raw)
    assert published.typecode == 'f'
    assert all(map(math.isfinite, published))
    assert scaling.raw(published, kind) == raw


@for_all(('scale', 'offset', 'raw', 'value'), [
    (0.1, 0.0, 215, 21.5), (0.01, -40.0, 6150, 21.5), (-0.5, 0.0, 3, -1.5), (1.0, 0.5, 1, 1.5),
    (0.001525902, -50.0, 32767, -0.000769)])
def test_engineering_value_comes_from_scale_and_offset_and_goes_back(
        scale: float, offset: float, raw: int, value: float) -> None:
    scaling = Scaling(scale, offset)
    assert list(scaling.publish([raw])) == pytest.approx([value], abs=1e-6)
    assert scaling.raw([value], ValueType.INT16) == [raw]


@for_all(('value', 'raw'), [
    (0.0, 0), (0.24, 0), (0.25, 0), (0.26, 1), (0.75, 2), (1.25, 2), (1.26, 3), (-0.25, 0),
    (-0.75, -2), (-1.25, -2), (-0.26, -1)])
def test_nearest_raw_value_is_written_and_halves_go_to_the_even_one(
        value: float, raw: int) -> None:
    assert Scaling(0.5, 0.0).raw([value], ValueType.INT16) == [raw]
    assert Scaling(0.5, 1.0).raw([value], ValueType.FLOAT32) == [2 * value - 2]  # as it is


@for_all(('kind', 'scaling', 'value', 'error'), [
    (ValueType.INT16, Scaling(0.1, 0.0), 3276.76,
     'value 3276.76 at index 1 is outside -3276.8 to 3276.7, the range of int16 with Scale 0.1, '
     'Offset 0'),
    (ValueType.UINT16, Scaling(-0.5, 10.0), 10.5,
     'value 10.5 at index 1 is outside -32757.5 to 10, the range of uint16 with Scale -0.5, '
     'Offset 10'),
    (ValueType.BCD16, Scaling(1.0, 0.0), math.nan,
     'value nan at index 1 is not a valid float32, a number such as -1.5 or 2e3, at most 3.4e38'),
    (ValueType.UINT32, Scaling(0.001, 0.0), math.inf,
     'value inf at index 1 is outside 0 to 4294967.295, the range of uint32 with Scale 0.001, '
     'Offset 0'),
    (ValueType.INT32, Scaling(1.0, 0.0), -10 ** 400,
     'value -inf at index 1 is outside -2147483648 to 2147483647, the range of int32 with '
     'Scale 1, Offset 0'),
    (ValueType.FLOAT32, Scaling(0.5, 0.0), 3e38,
     'value 3e+38 at index 1 is outside -1.701411733e+38 to 1.701411733e+38, the range of '
     'float32 with Scale 0.5, Offset 0'),
    (ValueType.FLOAT32, Scaling(1e-300, 0.0), 1e38,
     'value 1e+38 at index 1 is outside -3.402823466e-262 to 3.402823466e-262, the range of '
     'float32 with Scale 1e-300, Offset 0')])
def test_value_that_the_raw_type_does_not_reach(
        kind: ValueType, scaling: Scaling, value: float, error: str) -> None:
    with pytest.raises(FormatError) as caught:
        scaling.raw([scaling.offset, value], kind)
    assert str(caught.value) == error


@for_all('value', [3276.7, 3276.74, -3276.8, -3276.84])
def test_value_less_than_half_a_step_outside_is_rounded_into_the_range(value: float) -> None:
    raw, = Scaling(0.1, 0.0).raw([value], ValueType.INT16)
    assert raw in ValueType.INT16.range


@for_all(('kind', 'scaling', 'error'), [
    (ValueType.BOOL, Scaling(), 'Scale and Offset are for numbers, not for bool'),
    (ValueType.STRING, Scaling(), 'Scale and Offset are for numbers, not for string'),
    (ValueType.INT16, Scaling(0.001, -8191.0),
     'a float32 has too few digits to tell the values apart in -8223.768 to -8158.233, the range '
     'of int16 with Scale 0.001, Offset -8191'),
    (ValueType.UINT16, Scaling(1e-46),
     'a float32 has too few digits to tell the values apart in 0 to 6.5535e-42, the range of '
     'uint16 with Scale 1e-46, Offset 0'),
    (ValueType.BCD16, Scaling(1e35),
     'a float32 cannot hold 0 to 9.999e+38, the range of bcd16 with Scale 1e+35, Offset 0'),
    (ValueType.INT32, Scaling(1.0, -1e39),
     'a float32 cannot hold -1e+39 to -1e+39, the range of int32 with Scale 1, Offset -1e+39'),
    (ValueType.INT16, Scaling(1.0, 8355840.0), None), (ValueType.INT32, Scaling(0.001), None),
    (ValueType.UINT32, Scaling(1.0), None), (ValueType.FLOAT32, Scaling(1000.0, -273.15), None),
    (ValueType.BCD16, Scaling(-0.01, 100.0), None), (ValueType.UINT16, Scaling(1e-40), None)])
def test_values_that_cannot_be_scaled_and_some_that_can(
        kind: ValueType, scaling: Scaling, error: str | None) -> None:
    assert scaling.fault(kind) == error


def test_what_a_float32_cannot_hold_is_published_as_infinite() -> None:
    assert Scaling(2.0).publish([3e38, math.inf, 1.0]) == array('f', [math.inf, math.inf, 2.0])


@pytest.mark.parametrize('scaling', [None, Scaling(0.37, 0.011), Scaling(-3.0, 0.5)])
def test_limit_of_floats_is_kept_by_the_float32_that_is_written(scaling: Scaling | None) -> None:
    """The float32 nearest to a limit may be outside of it, and stands for it in a message."""
    for limit, (nearest,) in ((0.7, array('f', [0.7])), (0.1, array('f', [0.1]))):
        mapping = make_mapping('F8:0', 'Write', minimum=-limit, maximum=limit, scaling=scaling)
        assert (nearest > limit) is (limit == 0.1)
        for value in (nearest, -nearest, limit, -limit):
            raw, = raw_values(mapping, [value])
            assert [raw] == [*array('f', [raw])]
            written = raw if scaling is None else raw * scaling.scale + scaling.offset
            assert -limit <= written <= limit
            assert written == pytest.approx(value, abs=1e-7)
    assert raw_values(make_mapping('F8:0', 'Write', maximum=0.5), [0.5]) == [0.5]
    with pytest.raises(FormatError, match=r'value 0.1001 at index 0 is outside Min -0.1, Max 0.1'):
        raw_values(mapping, [0.1001])


@for_all(('kind', 'scale', 'offset', 'limit'), [
    ('int32', 0.001, 0.0, 2_000_000.123), ('uint32', 0.001, 0.0, 4_000_000.377),
    ('int32', 1.0, 0.0, 2_000_000_001), ('int32', -0.01, 7.0, 12_345_678.91)])
def test_limit_of_scaled_32_bits_is_kept_to_the_raw_step(
        kind: str, scale: float, offset: float, limit: float) -> None:
    """A float32 has 24 bits: the one nearest to the limit is up to 128 steps away."""
    mapping = make_mapping('N7:0', 'Write', kind=kind, maximum=limit,
                           scaling=Scaling(scale, offset))
    nearest, = array('f', [limit])
    above, = array('f', [limit + 300 * abs(scale)])
    raw, = raw_values(mapping, [nearest])
    assert raw * scale + offset <= limit + abs(scale) * 1e-6
    with pytest.raises(FormatError, match='is outside Min -inf'):
        raw_values(mapping, [above])


def test_message_between_the_last_raw_step_and_the_limit_is_refused() -> None:
    mapping = make_mapping('N7:0', 'Write', length=2, maximum=12.5, scaling=Scaling(2.0, 1.0))
    assert raw_values(mapping, [11.4, 1.0]) == [5, 0]
    with pytest.raises(FormatError, match='value 13 at index 1, the nearest that can be written'):
        raw_values(mapping, [11.4, 12.2])


def test_limit_of_long_words_is_not_that_of_a_float32() -> None:
    mapping = make_mapping('L10:0', 'Write', plc='SLC', length=2, maximum=16_777_217)
    assert raw_values(mapping, [16_777_217, 0]) == [16_777_217, 0]
    with pytest.raises(FormatError, match='at index 1 is outside Min -inf, Max 16777217'):
        raw_values(mapping, [0, 16_777_218])
