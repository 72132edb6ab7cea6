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

"""Points and writes: what is published, how fresh it is, and the bytes of a write."""

from array import array
import math
import re

from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.write import Outcome, show, Write
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.settings.scaling import Scaling
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.driver_bench import simulated_plc
from support.mappings import fault, make_mapping, one


def point(publish: str = 'Always', **cells: str) -> ReadPoint:
    return ReadPoint(make_mapping(publish=publish, **cells), 0.1, 0.6)


@for_all(('age', 'freshness'), [
    (0.0, Freshness.FRESH), (0.29, Freshness.FRESH), (0.31, Freshness.LATE),
    (0.6, Freshness.LATE), (0.61, Freshness.STALE), (1e6, Freshness.STALE)])
def test_value_becomes_late_and_then_stale(age: float, freshness: Freshness) -> None:
    fresh = point()
    fresh.update(b'\1\0', 0.0)
    assert fresh.freshness(age) is freshness
    assert fresh.age(age) == age


def test_value_is_late_after_one_and_a_half_periods_where_periods_are_long() -> None:
    for stale, ages in ((30.0, (14.9, 15.1, 30.0, 30.1)), (12.0, (11.9, 12.0, 12.1, 12.1))):
        slow = ReadPoint(make_mapping(), 10.0, stale)
        slow.update(b'\1\0', 0.0)
        assert [slow.freshness(age).value for age in ages] == (
            ['fresh', 'late', 'late', 'stale'] if stale > 15 else 2 * ['fresh'] + 2 * ['stale'])


def test_interval_is_between_two_good_reads_without_a_failure() -> None:
    new = point('Change')
    new.update(b'\1\0', 3.0)
    assert new.interval is None
    new.update(b'\1\0', 3.25)
    assert new.interval == 0.25
    new.fail('no reply')
    new.update(b'\1\0', 9.0)
    assert new.interval is None
    new.update(b'\1\0', 9.5)
    assert new.interval == 0.5
    new.withhold('not in RUN', 10.0)
    assert new.update(b'\1\0', 19.0) is new.interval is None


def test_usual_interval_follows_slowly_and_forgets_a_single_long_one() -> None:
    new = point('Change')
    for now in (1.0, 2.0):
        new.update(b'\1\0', now)
    assert new.kept is None
    for now in (3.0, 60.0, 61.0):
        new.update(b'\1\0', now)
    assert new.kept == 1.0
    for now in (63.0, 65.0, 67.0):
        new.update(b'\1\0', now)
    assert 1.0 < new.kept < 1.5


def test_failure_outweighs_age_and_ends_with_the_next_good_read() -> None:
    failing = point()
    assert (failing.freshness(1e9), failing.age(5.0)) == (Freshness.WAITING, None)
    failing.fail('before the first')
    assert failing.freshness(0.0) is Freshness.FAILED
    failing.update(b'\1\0', 1.0)
    assert (failing.freshness(1.0), failing.error) == (Freshness.FRESH, None)
    assert [failing.fail('again') for _ in range(2)] == [True, False]
    assert failing.freshness(1.0) is Freshness.FAILED
    assert (failing.failures, failing.error, failing.age(1.5)) == (3, 'again', 0.5)


def test_only_changes_are_published() -> None:
    changing = point('Change')
    assert changing.update(b'\1\0', 0.0) == array('h', [1])
    assert changing.update(b'\1\0', 1.0) is None
    assert changing.last_good == 1.0
    assert changing.update(b'\2\0', 2.0) == array('h', [2])
    assert changing.update(b'\1\0', 3.0) == array('h', [1])


def test_first_text_is_published_though_it_is_empty() -> None:
    assert point('Change', text='ST9:0').update(bytes(84), 0.0) == ''


def test_words_that_are_no_value_are_not_published_and_do_not_count_as_the_last() -> None:
    digits = ReadPoint(make_mapping(kind='bcd16', publish='Change'), 0.1, 0.6)
    digits.update(b'\x12\0', 0.0)
    with pytest.raises(FormatError):
        digits.update(b'\x1a\0', 1.0)
    assert digits.last_good == 0.0
    digits.fail('no BCD')
    assert digits.update(b'\x12\0', 2.0) == array('H', [12])


def test_bits_that_are_not_ours_are_not_a_change_of_value() -> None:
    bits = point('Change', text='B3:0/4')
    assert bits.update(b'\x10\0', 0.0) == array('B', [1])
    assert bits.update(b'\x11\xff', 1.0) is None


def test_difference_within_the_deadband_is_no_change() -> None:
    row = one(Command='Read', Length='2', Publish='Change', Deadband='0.3', Scale='-0.1')
    level = ReadPoint(row, 0.1, 0.6)
    assert level.update(b'\x0a\0\x14\0', 0.0) == array('f', [-1.0, -2.0])
    for step, words in enumerate((b'\x0d\0\x14\0', b'\x07\0\x11\0', b'\x0c\0\x17\0')):
        assert level.update(words, 1.0 + step) is None  # creeping is measured from the last one
    assert level.update(b'\x0a\0\x18\0', 4.0) == array('f', [-1.0, -2.4])
    assert level.update(b'\x0d\0\x15\0', 5.0) is None


def test_number_that_becomes_none_is_a_change() -> None:
    level = ReadPoint(one(Command='Read', Address='F8:0', Publish='Change', Deadband='5'),
                      0.1, 0.6)
    assert level.update(b'\0\0\0\0', 0.0) is not None
    assert level.update(b'\0\0\xc0\x7f', 1.0) is not None  # NaN
    assert level.update(b'\0\0\xc0\x7f', 2.0) is None


def test_value_that_does_not_change_is_published_again_after_the_longest_silence() -> None:
    row = one(Command='Read', Publish='Change', Max_Silence='1000', Deadband='2')
    level = ReadPoint(row, 0.1, 0.6)
    assert row.promise(0.6) == 1.6
    assert level.update(b'\5\0', 0.0) is not None
    assert level.update(b'\6\0', 0.9) is None
    assert level.update(b'\6\0', 1.0) == array('h', [6])
    assert level.update(b'\4\0', 1.9) is None  # measured from what was published last
    assert level.update(b'\3\0', 1.95) == array('h', [3])
    assert level.update(b'\3\0', 2.9) is None


@for_all(('cells', 'text'), [
    ({'Deadband': '0'}, 'Deadband is for rows with Publish Change'),
    ({'Max_Silence': '500'}, 'Max_Silence is for rows with Publish Change'),
    ({'Publish': 'Change', 'Max_Silence': '50'}, 'should be ms from 100 to 3600000'),
    ({'Publish': 'Change', 'Deadband': '-1'}, 'Deadband should be a number from 0 on'),
    *(({'Publish': 'Change', 'Deadband': '1', 'Address': address}, 'for values that are numbers')
      for address in ('B3:0/1', 'ST9:0'))])
def test_cells_that_go_with_changes_only(cells: dict[str, str], text: str) -> None:
    assert text in fault(Command='Read', **cells)


def test_change_is_one_of_the_raw_value() -> None:
    scaling = Scaling(0.001, 1e6)  # too fine for float32 to show every step
    fine = ReadPoint(make_mapping(kind='int32', publish='Change', scaling=scaling), 0.1, 0.6)
    first = fine.update(b'\1\0\0\0', 0.0)
    assert fine.update(b'\1\0\0\0', 1.0) is None
    assert fine.update(b'\2\0\0\0', 2.0) == first == array('f', [1e6])


def commands(text: str, values: list[float] | str, plc: str = 'PLC5', length: int = 1,
             kind: str | None = None) -> list[str]:
    mapping = make_mapping(text, 'Write', plc=plc, length=length, kind=kind)
    return [data.hex(' ') for _, data in Write(mapping, values, 0.0).commands]


@for_all(('plc', 'text', 'length', 'values', 'expected'), [
    # Typed write: FNC 67, offset, total, address 07 area file element, descriptor, data.
    ('PLC5', 'N7:3', 1, [0x1234], ['67 00 00 01 00 06 07 03 93 09 42 34 12']),
    ('PLC5', 'N7:300', 2, [1, -1],
     ['67 00 00 02 00 06 07 ff 2c 01 95 09 42 01 00 ff ff']),
    ('PLC5', 'F8:1', 1, [1.5], ['67 00 00 01 00 06 08 01 96 09 94 08 00 00 c0 3f']),
    ('PLC5', 'PD12:10.SP', 1, [42.5],
     ['67 00 00 01 00 0e 0c 0a 02 96 09 94 08 00 00 2a 42']),
    ('PLC5', 'PD12:10.KP', 2, [1.0, 2.0],
     ['67 00 00 01 00 0e 0c 0a 04 96 09 94 08 00 00 80 3f',
      '67 00 00 01 00 0e 0c 0a 06 96 09 94 08 00 00 00 40']),
    ('PLC5', 'SC9:1.PRE', 1, [7], ['67 00 00 01 00 0e 09 01 01 93 09 42 07 00']),
    # Protected typed logical write: FNC AA, size, file, type, element, sub-element, data.
    ('SLC', 'PD10:1.KC', 2, [1, 2],
     ['aa 02 0a 93 01 03 01 00', 'aa 02 0a 93 01 04 02 00']),
    ('SLC', 'N7:3', 2, [1, -1], ['aa 04 07 89 03 00 01 00 ff ff']),
    ('SLC', 'F8:4', 1, [1.5], ['aa 04 08 8a 04 00 00 00 c0 3f']),
    ('SLC', 'L10:2', 1, [-2], ['aa 04 0a 91 02 00 fe ff ff ff']),
    ('SLC', 'I:1.2', 1, [7], ['aa 02 01 8c 01 02 07 00']),
    ('SLC', 'O:3.0', 1, [7], ['aa 02 00 8b 03 00 07 00'])])
def test_bytes_of_a_write_of_words(
        plc: str, text: str, length: int, values: list[float], expected: list[str]) -> None:
    assert commands(text, values, plc, length) == expected


@for_all(('text', 'length', 'values', 'expected'), [
    # FNC 26, address, AND mask, OR mask.
    ('B3:1/5', 1, [1], ['26 06 03 01 df ff 20 00']),
    ('B3:1/5', 1, [0], ['26 06 03 01 df ff 00 00']),
    ('N7:0/4', 3, [1, 0, 1], ['26 06 07 00 8f ff 50 00']),
    ('B3:0/14', 4, [1, 1, 0, 1],
     ['26 06 03 00 ff 3f 00 c0', '26 06 03 01 fc ff 02 00']),
    ('I:017/12', 1, [1], ['26 06 01 0f ff fb 00 04']),
    ('T4:7/DN', 1, [1], ['26 0e 04 07 00 ff df 00 20']),
    ('MG9:3/TO', 1, [1], ['26 0e 09 03 00 ff fe 00 01']),
    # FNC AB, size, file, type, element, sub-element, mask, bits.
    ('B3:1/5', 1, [1], ['ab 02 03 85 01 00 20 00 20 00']),
    ('B3:1/5', 1, [0], ['ab 02 03 85 01 00 20 00 00 00']),
    ('B3:0/14', 4, [1, 1, 0, 1],
     ['ab 02 03 85 00 00 00 c0 00 c0', 'ab 02 03 85 01 00 03 00 02 00']),
    ('I:1.2/3', 1, [1], ['ab 02 01 8c 01 02 08 00 08 00']),
    ('T4:7/DN', 1, [0], ['ab 02 04 86 07 00 00 20 00 00'])])
def test_bits_are_a_read_modify_write_of_a_plc5_and_a_masked_write_of_an_slc(
        text: str, length: int, values: list[float], expected: list[str]) -> None:
    plc = 'PLC5' if expected[0].startswith('26') else 'SLC'
    assert commands(text, values, plc, length) == expected


@pytest.mark.parametrize('plc, limit', [('PLC5', 110), ('SLC', 117)])
def test_long_write_is_divided_at_the_limit_of_a_packet(plc: str, limit: int) -> None:
    assert len(commands('N7:0', [0] * limit, plc, limit)) == 1
    assert len(commands('N7:0', [0] * (limit + 1), plc, limit + 1)) == 2


@for_all('plc', ['PLC5', 'SLC'])
@for_all(('text', 'length', 'kind', 'natural'), [
    ('N7:0', 250, None, -5), ('F8:0', 120, None, 0.5), ('N7:1', 60, 'int32', 70000),
    ('D9:3', 10, 'bcd16', 1234), ('N7:7', 3, 'uint16', 40000), ('T4:1.PRE', 2, None, 9),
    ('B3:0/3', 40, None, 1)])
def test_plc_holds_what_was_written_and_nothing_else_changes(
        plc: str, text: str, length: int, kind: str | None, natural: float) -> None:
    mapping = make_mapping(text, 'Write', plc=plc, length=length, kind=kind)
    machine = simulated_plc(1, plc, lambda: 0.0, (text, 300))
    start, whole = mapping.address.at_offset(0), 2 * (mapping.address.offset + 300)
    machine.table.write(start, b'\xff' * whole)
    values = [natural if n % 2 else 0 for n in range(length)]
    _serve_all(machine.table, Write(mapping, values, 0.0))
    codec = mapping.codec
    words = machine.table.read(mapping.address, codec.words)
    assert list(codec.decode(words)) == values
    everything = machine.table.read(start, whole // 2)
    at = 2 * mapping.address.offset
    outside = everything[:at] + everything[at + 2 * codec.words:]
    assert outside == b'\xff' * len(outside)
    if mapping.address.bit is not None:
        ours = (1 << length) - 1 << mapping.address.bit
        assert int.from_bytes(words, 'little') | ours == (1 << 16 * codec.words) - 1


def _serve_all(table: DataTable, write: Write) -> None:
    from abdf1_ros.df1.packet import Packet

    for number, (cmd, data) in enumerate(write.commands):
        assert Server(table).serve(Packet(1, 5, cmd, 0, number, data)).sts == 0


@given(st.sampled_from((PlcType.PLC5, PlcType.SLC)), st.integers(0, 15), st.integers(1, 40),
       st.data())
def test_bit_writes_touch_only_their_bits(
        plc_type: PlcType, bit: int, length: int, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(0, 1), min_size=length, max_size=length))
    mapping = make_mapping(f'B3:1/{bit}', 'Write', plc=plc_type.value, length=length)
    before = data.draw(st.binary(min_size=12, max_size=12))
    machine = simulated_plc(1, plc_type.value, lambda: 0.0, ('B3:0', 6))
    start = mapping.address.at_offset(0)
    machine.table.write(start, before)
    _serve_all(machine.table, Write(mapping, values, 0.0))
    after = int.from_bytes(machine.table.read(start, 6), 'little')
    mask = (1 << length) - 1 << 16 + bit
    assert after & ~mask == int.from_bytes(before, 'little') & ~mask
    assert [after >> 16 + bit + n & 1 for n in range(length)] == values


@for_all(('values', 'error'), [
    ([11, 20], None), ([10, 20], None), ([10, 21], 'value 21 at index 1 is outside Min 10, '
                                                   'Max 20'),
    ([9, 20], 'value 9 at index 0 is outside Min 10, Max 20'),
    ([1], '1 value, the mapping has 2'),
    ([40000, 0], 'value 40000 at index 0 is not a valid int16, a whole number '
                 'from -32768 to 32767')])
def test_limits_hold_for_every_element(values: list[float], error: str | None) -> None:
    mapping = make_mapping(command='Write', length=2, minimum=10, maximum=20)
    if error is None:
        Write(mapping, values, 0.0)
        return
    with pytest.raises(FormatError) as caught:
        Write(mapping, values, 0.0)
    assert str(caught.value) == error


@for_all(('text', 'values', 'reason'), [
    ('N7:0', [1, 2], 'the mapping has 1'), ('N7:0', [], 'the mapping has 1'),
    ('N7:0', [32768], '32768'), ('N7:0', [11], 'Max 10'), ('N7:0', [-11], 'Min -10'),
    ('F8:0', [math.nan], 'nan'), ('F8:0', [math.inf], 'inf'), ('F8:0', [1e39], '1e+39'),
    ('B3:0/0', [2], '2')])
def test_what_does_not_fit_is_refused(text: str, values: list[float], reason: str) -> None:
    limit = math.inf if text == 'B3:0/0' else 10.0
    with pytest.raises(FormatError, match=re.escape(reason)):
        Write(make_mapping(text, 'Write', minimum=-limit, maximum=limit), values, 0.0)


def test_limit_in_the_message_is_the_limit_of_the_file() -> None:
    mapping = make_mapping('L10:0', 'Write', plc='SLC', maximum=1234567)
    with pytest.raises(FormatError,
                       match='^value 1234568 at index 0 is outside Min -inf, Max 1234567$'):
        Write(mapping, [1234568], 0.0)


@given(st.sampled_from(['int16', 'uint16']), st.integers(0, 65535),
       st.floats(0.001, 1000.0) | st.floats(-1000.0, -0.001), st.floats(-1000.0, 1000.0))
def test_word_comes_back_from_the_value_that_was_published(
        kind: str, word: int, scale: float, offset: float) -> None:
    mapping = make_mapping(command='ReadWrite', plc='SLC', kind=kind,
                           scaling=Scaling(scale, offset))
    words = word.to_bytes(2, 'little')
    values = ReadPoint(mapping, 0.1, 0.6).update(words, 0.0)
    assert values is not None
    (_, command), = Write(mapping, values, 0.0).commands
    assert command[-2:] == words


@for_all(('values', 'error'), [
    ([0.3, 10.0], None), ([0.2, 0.3], 'value 0.2 at index 0 is outside Min 0.3, Max 10.1'),
    ([1, 10.2], 'value 10.2 at index 1 is outside Min 0.3, Max 10.1'),
    ([1, 10.1], 'value 10.2 at index 1, the nearest that can be written, is outside Min 0.3, '
                'Max 10.1'),
    ([1, -2e5], 'value -200000 at index 1 is outside -9830.4 to 9830.1, the range of int16 with '
                'Scale 0.3, Offset 0'),
    ([1], '1 value, the mapping has 2'),
    ('1', "the text '1' is not a valid int16, a whole number from -32768 to 32767")])
def test_limits_of_engineering_values(values: list[float] | str, error: str | None) -> None:
    mapping = make_mapping(command='Write', length=2, minimum=0.3, maximum=10.1,
                           scaling=Scaling(0.3))
    written = values if isinstance(values, str) else array('f', values)
    if error is None:
        assert Write(mapping, written, 0.0).raw == [1, 33]
        return
    with pytest.raises(FormatError) as caught:
        Write(mapping, written, 0.0)
    assert str(caught.value) == error


def test_result_tells_value_latency_and_request() -> None:
    write = Write(make_mapping(command='Write', length=2), [1, -2], 10.0, 'r7')
    result, = write.result(Outcome.UNKNOWN, 'no reply').of(write.origins, 12.5)
    assert (result.request, result.value, result.latency) == ('r7', '[1, -2]', 2.5)
    assert result.mapping is write.mapping
    assert str(result) == 'unknown whether written: no reply'
    assert str(write.result(Outcome.WRITTEN)) == 'written'


@for_all(('values', 'text'), [
    ([1, 0, 1], '[1, 0, 1]'), ([], '[]'), ("it's", '"it\'s"'),
    ('\x1b[2J\r\n\0\x9bä', r"'\x1b[2J\r\n\x00\x9bä'"), ([0.1, -2.5], '[0.1, -2.5]'),
    (array('f', [0.1]), '[0.1]'), ([1234567, -2147483648], '[1234567, -2147483648]'),
    ('a' * 100, repr('a' * 100)), ('a' * 101, repr('a' * 100) + ' and 1 more characters'),
    ([4294967295], '[4294967295]'), (array('f', [1234567, 0.3]), '[1234567, 0.3]'),
    (list(range(16)), str(list(range(16)))),
    (list(range(17)), str(list(range(16)))[:-1] + ', and 1 more]')])
def test_values_are_shown_short_and_exact(values: list[float] | str, text: str) -> None:
    assert show(values) == text


def test_read_of_a_faster_block_is_for_a_point_when_its_period_has_passed() -> None:
    point = ReadPoint(make_mapping(), 1.0, 3.0)
    assert point.is_due(0.0, 0.1)  # the first
    point.update(bytes(2), 0.0)
    assert [point.is_due(now, 0.1) for now in (0.1, 0.9, 0.96, 1.0, 2.0)] == [
        False, False, True, True, True]
    point.fail('lost')
    assert point.is_due(0.1, 0.1)
