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

"""Heartbeat, Fallback and While in a map CSV; tests are named by the rule they show."""

from pathlib import Path

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command
import pytest
from support.cases import for_all
from support.mappings import cell_of, fault, faults, load_rows, load_text, one, row

BEAT = {'Tag': 'beat', 'Command': 'Heartbeat', 'Address': 'N10:0'}
WRITE = {'Tag': 'speed', 'Command': 'Write', 'Address': 'N10:1'}
COUNTER = {'Tag': 'counter', 'Command': 'Read', 'Address': 'N11:3', 'Period': '100'}
DOORS = {'Tag': 'doors', 'Command': 'Read', 'Address': 'B3:0/0', 'While': 'counter',
         'While_Timeout': '1000'}
BIT = {'Tag': 'bit', 'Command': 'Read', 'Address': 'B12:0/2', 'Confirms': 'beat'}


def tags_of(*rows: str) -> list[str]:
    """Return the tags of the rows that are good."""
    return [mapping.tag for mapping in load_rows(*rows)[0]]


def test_rule_1_heartbeat_is_one_word_without_a_topic() -> None:
    mapping = one(**BEAT)
    assert (mapping.command, mapping.period, mapping.condition) == (Command.HEARTBEAT, 1000, None)
    assert not mapping.reads and not mapping.writes and not mapping.polls


@for_all(('cells', 'text'), [
    ({'Address': 'F8:0'}, '3 (Address): Item: 1, a heartbeat is a word of type int16 or uint16'),
    ({'Address': 'B3:0/1'}, 'a heartbeat is a word of type int16 or uint16'),
    ({'Type': 'int32'}, '7 (Type): Item: 1, a heartbeat is a word of type int16 or uint16'),
    ({'Length': '2'}, '6 (Length): Item: 1, a heartbeat is one word; leave the cell empty'),
    ({'Topic': 'x'}, 'a Heartbeat row has no Topic: it is for Read, Write, ReadWrite and '
     'Serve rows; leave the cell empty'),
    ({'Max': '9'}, 'a Heartbeat row has no Max: it is for Write, ReadWrite and Serve '
     'rows; leave the cell empty'),
    ({'Publish': 'Change'}, 'a Heartbeat row has no Publish: it is for Read, '
     'ReadWrite and Serve rows; leave the cell empty'),
    ({'Fallback': '0'}, 'a Heartbeat row has no Fallback: it is for Write and Serve rows'),
    ({'Station': '255'}, 'must be less than 255')])
def test_rule_1_what_a_heartbeat_cannot_be(cells: dict[str, str], text: str) -> None:
    assert text in fault(**BEAT | cells)


BY_NUMBER = ' (a PLC finds a file by its number, whatever Type or PLC_Type a row gives it)'


@for_all('own', [BEAT, BEAT | {'Command': 'Write', 'Fallback': '0', 'Fallback_After': '500'}])
@for_all(('cells', 'why'), [
    *(({'Command': command, 'Address': 'N10:0'}, '')
      for command in ('Write', 'ReadWrite', 'Heartbeat')),
    ({'Station': '255', 'Address': 'N10:0'}, ' (a broadcast has the words of every station)'),
    ({'Station': '255', 'Address': 'B10:0', 'PLC_Type': 'SLC'},
     ' (a broadcast has the words of every station)'),
    ({'Address': 'D10:0'}, BY_NUMBER), ({'Address': 'B10:0/3'}, BY_NUMBER),
    ({'Address': 'N10:0', 'PLC_Type': 'SLC'}, BY_NUMBER),
    # Elements of another length: which words they are nobody can tell.
    ({'Address': 'F10:7'}, BY_NUMBER), ({'Address': 'T10:5.PRE'}, BY_NUMBER),
    ({'Address': '020', 'PLC_Type': 'PLC2'}, BY_NUMBER)])
def test_rules_1_and_12_nobody_else_writes_the_words_whatever_their_name(
        own: dict[str, str], cells: dict[str, str], why: str) -> None:
    rows = [own, {'Tag': 'other', 'Command': 'Write'} | cells]
    found = faults(*(row(**cells) for cells in rows))
    address = str(one(**rows[1]).address)
    assert found == ['3:3 (Address): Item: 2, the words of a heartbeat or a Fallback belong to no '
                     'other row; '
                     f'{address}{why} shares words with the row of item 1 (line 2, tag "beat")']
    rows[1]['Tag'] = 'a'  # whichever comes first
    told, = faults(*(row(**cells) for cells in reversed(rows)))
    assert f'{why} shares words with' in told


@for_all('cells', [
    {'Station': '255', 'Address': 'N10:1'}, {'Station': '255', 'Address': 'N11:0'},
    {'Address': 'D10:1'}, {'Address': 'N11:0', 'PLC_Type': 'SLC'}, {'Address': 'F8:0'},
    {'Address': 'D9:0', 'PLC_Type': 'SLC'},
    {'Address': '000', 'PLC_Type': 'PLC2', 'Access': 'CIF'},  # file 7 or 9
    *({'Address': 'N10:0'} | other for other in (
        {'Command': 'Serve'}, {'Command': 'Read'}, {'Station': '2'}))])
def test_rules_1_and_12_other_words(cells: dict[str, str]) -> None:
    assert tags_of(row(**BEAT), row(**{'Tag': 'other', 'Command': 'Write'} | cells)) == [
        'beat', 'other']


def test_rule_12_common_interface_file_is_file_9_or_7() -> None:
    cif = {'Tag': 'cif', 'Command': 'Write', 'PLC_Type': 'PLC2', 'Access': 'CIF'}
    for address in ('N9:3', 'N7:3'):
        beat = row(**BEAT | {'Address': address}, PLC_Type='SLC')
        assert tags_of(beat, row(**cif, Address='003')) == ['beat']
        assert tags_of(beat, row(**cif, Address='004')) == ['beat', 'cif']
    own = cif | {'Tag': 'own', 'Address': '003', 'Fallback': '0', 'Fallback_After': '500'}
    assert tags_of(row(**own), row(**cif, Address='003')) == ['own']
    assert tags_of(row(**own), row(**cif, Address='004')) == ['own', 'cif']
    # Without CIF the numbers are counted in another way.
    assert tags_of(row(**own), row(**cif | {'Access': ''}, Address='004')) == ['own']


def test_rule_12_slots_and_sections_are_files_of_their_own() -> None:
    own = {'Command': 'Write', 'Fallback': '0', 'Fallback_After': '500', 'PLC_Type': 'SLC'}
    first = row(Tag='a', Address='O:1.0', **own)
    assert tags_of(first, row(Tag='b', Address='O:2.0', **own)) == ['a', 'b']
    flat = row(Tag='b', Address='O:7', Access='Flat', **own)
    assert tags_of(first, flat) == ['a']  # which slot that is nobody can tell
    own['PLC_Type'] = 'PLC3'
    rows = [row(Tag=kind, Address=f'{kind}10:0', **own) for kind in ('N', 'B')]
    assert tags_of(*rows) == ['N', 'B']


@for_all('address', ['S:1', 'I:001', 'O:001', 'T4:0.ACC', 'C5:0.PRE', 'R6:0.POS', 'PD10:0'])
def test_rule_1_file_with_a_meaning_is_no_place_to_count(address: str) -> None:
    found = faults(row(**BEAT | {'Address': address}, Type='int16'))
    assert any('take a word of its own in an N or B file, such as N7:0' in text
               for text in found), found
    assert found[0].startswith('2:3 (Address): Item: 1, ')


def test_rule_3_requires_topics_with_a_time() -> None:
    rows = (row(**BEAT, While='speed stop', While_Timeout='500'), row(**WRITE),
            row(**WRITE | {'Tag': 'stop', 'Address': 'N10:2'}))
    mappings, problems = load_rows(*rows)
    assert problems == []
    assert mappings[0].condition == While(('speed', 'stop'), 500)
    assert [cell_of(mappings[0], column) for column in ('While', 'While_Timeout')] == [
        'speed stop', '500']


@pytest.mark.parametrize(('cells', 'text'), [
    ({'While': 'speed'}, 'While_Timeout is missing: ms from 100 to 3600000'),
    ({'While_Timeout': '500'}, 'While_Timeout is for a row with While; '
     'leave the cell empty'),
    ({'While': 'nobody', 'While_Timeout': '500'},
     'no good Write, ReadWrite or Serve row has the topic "nobody"')])
def test_rule_3_requires_without_what_it_needs(cells: dict[str, str], text: str) -> None:
    assert text in faults(row(**WRITE), row(**BEAT | cells))[0]


@pytest.mark.parametrize('period', ['99', '60001', 'x'])
def test_rule_4_period_of_a_heartbeat(period: str) -> None:
    assert 'should be' in fault(**BEAT | {'Period': period})
    assert one(**BEAT | {'Period': '100'}).period == 100


@for_all(('cells', 'fallback'), [
    ({'Fallback': '0', 'Fallback_After': '500'}, Fallback((0.0,), 500)),
    ({'Fallback': '1 -2 3', 'Length': '3', 'Fallback_After': '200'},
     Fallback((1.0, -2.0, 3.0), 200)),
    ({'Command': 'Serve', 'Fallback': '7', 'Fallback_After': '60000'}, Fallback((7.0,), 60000)),
    ({'Address': 'B3:0/4', 'Length': '2', 'Fallback': '0 0', 'Fallback_After': '500'},
     Fallback((0.0, 0.0), 500)),
    ({'Scale': '10', 'Fallback': '99990', 'Fallback_After': '500'}, Fallback((99990.0,), 500))])
def test_rule_12_write_and_serve_rows_take_a_fallback(
        cells: dict[str, str], fallback: Fallback) -> None:
    mapping = one(**WRITE | cells)
    assert mapping.fallback == fallback
    assert [cell_of(mapping, column) for column in ('Fallback', 'Fallback_After')] == [
        cells['Fallback'], str(fallback.after)]


@for_all(('command', 'cell', 'is_single'), [
    ('Write', 'yes', True), ('Serve', 'Yes', True), ('Write', 'No', False), ('Write', '', False)])
def test_rule_28_rows_with_a_fallback_may_have_a_single_publisher(
        command: str, cell: str, is_single: bool) -> None:
    mapping = one(**WRITE | {'Command': command, 'Fallback': '0', 'Fallback_After': '500',
                             'Single_Publisher': cell})
    assert mapping.single_publisher is is_single
    assert cell_of(mapping, 'Single_Publisher') == ('Yes' if is_single else '')


@for_all(('cells', 'text'), [
    ({}, 'Single_Publisher is for rows with Fallback: without one the last value would stand'),
    ({'Command': 'ReadWrite'},
     'a ReadWrite row has no Single_Publisher: it is for Write and Serve rows'),
    ({'Single_Publisher': '1'}, 'Single_Publisher = "1" should be one of Yes, No')])
def test_rule_28_what_a_single_publisher_is_not_for(cells: dict[str, str], text: str) -> None:
    assert text in fault(**WRITE | {'Single_Publisher': 'Yes'} | cells)


@for_all(('cells', 'text'), [
    ({'Fallback': '0'}, 'Fallback_After is missing: ms from 200 to 60000'),
    ({'Fallback_After': '500'}, 'Fallback is missing: the values to write'),
    ({'Fallback': '0', 'Fallback_After': '199'}, 'should be ms from 200 to 60000'),
    ({'Fallback': '0 0', 'Fallback_After': '500'}, 'Fallback has 2 values, Length is 1'),
    ({'Fallback': '40000', 'Fallback_After': '500'}, 'a number from -32768 to 32767'),
    ({'Fallback': '9', 'Max': '5', 'Fallback_After': '500'}, 'a number from -32768 to 5'),
    ({'Min': '5', 'Fallback': '4', 'Fallback_After': '500'},
     'Fallback "4" should be a number from 5 to 32767'),
    ({'Length': '2', 'Fallback': '0 stop', 'Fallback_After': '500'},
     'Fallback "stop" should be a number'),
    ({'Address': 'B3:0/1', 'Length': '2', 'Fallback': '0 1', 'Fallback_After': '500'},
     'Fallback "1" should be 0: a bool falls back to 0, because a 1 may be the pulse that'),
    ({'Address': 'B3:0/1', 'Fallback': 'true', 'Fallback_After': '500'},
     'Fallback "true" should be 0: a bool falls back to 0'),
    ({'Command': 'ReadWrite', 'Fallback': '0'},
     'a ReadWrite row has no Fallback: it is for Write and Serve rows'),
    ({'Command': 'Read', 'Fallback': '0'}, 'a Read row has no '
     'Fallback: it is for Write and Serve rows; leave the cell empty'),
    ({'Address': 'ST9:0', 'Fallback_After': '500'}, '(Fallback_After): Item: 1, a string has no'),
    ({'Fallback': '1.5', 'Fallback_After': '500'},
     'Fallback cannot be written: value 1.5 at index 0 is not a valid int16'),
    ({'Station': '255', 'Fallback': '0', 'Fallback_After': '500'},
     'no station confirms what is written to 255; leave the cell empty')])
def test_rule_12_what_a_fallback_cannot_be(cells: dict[str, str], text: str) -> None:
    assert text in fault(**WRITE | cells)


def test_rule_12_a_fallback_owns_its_words() -> None:
    own = WRITE | {'Fallback': '0', 'Fallback_After': '500'}
    assert 'belong to no other row' in faults(
        row(**own), row(Tag='b', Command='Write', Address='N10:0', Length='2'))[0]
    bits = own | {'Address': 'B3:0/4', 'Length': '16', 'Fallback': 16 * ' 0'}
    # Other bits of the word are written by a mask, so they are others.
    for address, tags in (('B3:0/3', ['speed', 'b']), ('B3:1/4', ['speed', 'b']),
                          ('B3:0/4', ['speed']), ('B3:1/3', ['speed']), ('B3:1', ['speed'])):
        assert tags_of(row(**bits), row(Tag='b', Command='Write', Address=address)) == tags


def test_rule_13_values_depend_on_run_or_on_a_counter() -> None:
    assert one(Command='Read', While='run').condition == While(('RUN',))
    mappings, problems = load_rows(row(**DOORS), row(**COUNTER))
    assert problems == []
    assert mappings[0].condition == While(('counter',), 1000)
    assert (cell_of(mappings[0], 'While'), cell_of(mappings[0], 'While_Timeout')) == (
        'counter', '1000')


@for_all(('cells', 'counter', 'text'), [
    *((cells, {}, text) for cells, text in (
        ({'Command': 'ReadWrite'}, 'a ReadWrite row has no While: it is for Read and '
         'Heartbeat rows'),
        ({'Publish': 'Change'}, 'needs Publish Always'),
        ({'Publish': 'Change', 'While': 'RUN', 'While_Timeout': ''}, 'needs Publish Always'),
        ({'While': 'run'}, 'RUN has no While_Timeout'),
        ({'While': 'doors'}, 'cannot depend on itself'),
        ({'While': 'Doors'}, 'RUN or the tag of one good Read row; "Doors" is neither'),
        ({'While': ''}, 'While_Timeout is for a row with While'),
        ({'Station': '2'}, 'is of station 1; a counter of the same PLC is needed'))),
    *(({}, counter, text) for counter, text in (
        ({'Command': 'Write'}, 'is not a Read row'), ({'Length': '2'}, 'is not one int16'),
        ({'Address': 'F8:0'}, 'is not one int16'),
        ({'While': 'RUN'}, 'depends on something itself'),
        ({'Period': 'on demand'}, '"counter" is read only on demand')))])
def test_rule_13_what_values_cannot_depend_on(
        cells: dict[str, str], counter: dict[str, str], text: str) -> None:
    told = faults(row(**DOORS | cells), row(**COUNTER | counter))
    assert text in told[0] and len(told) == 1 + ('Command' in cells)


@pytest.mark.parametrize('timeout', ['', '1000'])
def test_rule_13_misspelt_tag_is_told_with_the_right_name(timeout: str) -> None:
    doors = row(**DOORS | {'Command': 'read', 'While_Timeout': timeout, 'While': 'Countr'})
    told = faults(doors, row(**COUNTER | {'Tag': 'COUNTER'}))
    assert told[-1].endswith('"Countr" is neither; did you mean COUNTER?')
    assert len(told) == 1 + (not timeout)


@pytest.mark.parametrize('text', ['RUM', 'runn', 'RNU'])
def test_rule_13_misspelt_run_is_not_taken_for_a_tag(text: str) -> None:
    told, = faults(row(**DOORS | {'While_Timeout': '', 'While': text}))
    assert f'(While): Item: 1, "{text}" is not RUN: did you mean RUN?' in told
    assert not faults(row(**DOORS | {'While': text}), row(**COUNTER | {'Tag': text, 'Period': ''}))


def test_rule_14_timeout_has_no_default_and_allows_three_reads() -> None:
    text, tag = faults(row(**DOORS | {'While_Timeout': '', 'While': 'PROG'}))
    assert 'While_Timeout is missing: ms that the counter "PROG" may stand still; for the ' \
        'mode of the processor While is RUN' in text
    assert '(While): Item: 1, should be RUN or the tag of one good Read row; ' in tag
    assert faults(row(**DOORS | {'While_Timeout': '299'}), row(**COUNTER)) == [
        '2:21 (While_Timeout): Item: 1, While_Timeout 299 is less than 3 x 100 ms, the '
        'Period of counter']
    assert faults(row(**DOORS | {'While_Timeout': '300'}), row(**COUNTER)) == []


@for_all(('rows', 'good', 'count'), [
    ((DOORS, COUNTER | {'Address': 'N11:x'}, WRITE), ['speed'], 2),
    ((BIT, BEAT | {'Period': '1'}, WRITE), ['speed'], 2),
    ((WRITE | {'Length': '0'}, BEAT | {'While': 'speed', 'While_Timeout': '500'}), [], 2),
    # By another row.
    ((BIT, BEAT | {'While': 'speed', 'While_Timeout': '500'}, WRITE | {'Length': '0'}), [], 3)])
def test_rule_15_a_row_left_out_takes_along_what_depends_on_it(
        rows: tuple[dict[str, str], ...], good: list[str], count: int) -> None:
    rows_of = [row(**cells) for cells in rows]
    assert (tags_of(*rows_of), len(faults(*rows_of))) == (good, count)


def test_rule_22_bit_confirms_a_heartbeat_of_its_station() -> None:
    rows = load_rows(row(**BIT), row(**BEAT))[0]
    assert [(row.confirms, cell_of(row, 'Confirms')) for row in rows] == [('beat',) * 2, ('',) * 2]
    assert len(faults(row(**BIT | {'While': 'nobody', 'While_Timeout': '500'}))) == 2


@pytest.mark.parametrize('cells', [{'Length': '2'}, {'Address': 'N12:0'}])
def test_rule_22_what_is_not_a_bit_that_is_read_confirms_nothing(cells: dict[str, str]) -> None:
    assert 'Confirms is for a Read row of one bit' in faults(row(**BIT | cells), row(**BEAT))[0]


@for_all('cells', [
    {'Confirms': 'nobody'}, {'Confirms': 'bit'}, {'Confirms': 'speed'}, {'Station': '2'}])
def test_rule_22_what_a_bit_cannot_confirm(cells: dict[str, str]) -> None:
    cells = BIT | cells
    station = cells.get('Station', '1')
    assert faults(row(**cells), row(**BEAT), row(**WRITE)) == [
        f'2:22 (Confirms): Item: 1, "{cells["Confirms"]}" should be the tag of a good Heartbeat '
        f'row of station {station} that no row before it confirms']


@for_all('ours', [
    BEAT | {'Address': 'B12:0'}, BEAT | {'Address': 'N12:0'}, WRITE | {'Address': 'B12:0/2'},
    WRITE | {'Address': 'B12:0', 'Station': '255'}])
def test_rule_21_no_bit_that_we_write_confirms(ours: dict[str, str]) -> None:
    rows = {entry['Tag']: row(**entry) for entry in (BIT, BEAT, WRITE, ours)}
    assert faults(*rows.values()) == [
        f'2:22 (Confirms): Item: 1, "beat" cannot be confirmed by B12:0/2, which {ours["Tag"]} '
        'writes: no heartbeat confirms itself; name a bit that the program of the PLC sets']


def test_rule_22_a_heartbeat_is_confirmed_once() -> None:
    other = BIT | {'Tag': 'other', 'Address': 'B12:0/3'}
    station_2 = (row(**BIT | {'Tag': 'bit2', 'Station': '2', 'Confirms': 'beat2'}),
                 row(**BEAT | {'Tag': 'beat2', 'Station': '2'}))
    assert tags_of(row(**BIT), row(**other), row(**BEAT), *station_2) == [
        'bit', 'beat', 'bit2', 'beat2']


def test_map_of_the_tutorial_is_that_of_the_demo() -> None:
    root = Path(__file__).resolve().parents[2]
    mappings, problems = load_mappings(str(root / 'config' / 'heartbeat_map.csv'))
    assert problems == []
    assert [mapping.tag for mapping in mappings][-7:] == [
        'ros_alive', 'speed', 'gripper', 'used_speed', 'in_control', 'plc_alive', 'doors']
    head, *rows = (root / 'config' / 'heartbeat_map.csv').read_text(
        encoding='utf-8').splitlines()[2:]
    told = '\n'.join([head, *rows[-7:]])
    assert told in (root / 'docs/tutorials/heartbeats.md').read_text(encoding='utf-8')


def test_rule_12_fallback_of_bits_of_an_old_slc_is_warned_of() -> None:
    for part, told in (({'Address': 'B3:0/0'}, [True]), ({'Type': 'bcd12'}, [True]), ({}, [])):
        cells = WRITE | part | {'PLC_Type': 'SLC', 'Processor': '5/02'}
        remarks = one(**cells, Fallback='0', Fallback_After='500').remarks
        assert ['rewriting the whole word' in str(remark) for remark in remarks] == told
        assert not one(**cells).remarks


def test_rule_13_counter_is_not_an_echo_of_our_heartbeat() -> None:
    found = faults(row(**BEAT), row(**COUNTER | {'Address': 'B10:0'}), row(**DOORS))
    assert len(found) == 1
    assert '"counter" reads our own heartbeat, so both sides would wait for each other' in found[0]


@pytest.mark.parametrize('tag', ['RUN', 'Run'])
def test_tag_like_the_mode_run_is_ambiguous(tag: str) -> None:
    guarded = row(**DOORS | {'While': 'run', 'While_Timeout': ''})
    text, = faults(row(**COUNTER | {'Tag': tag}), guarded)
    assert text == ('3:20 (While): Item: 2, "RUN" is the mode of the PLC, and the tag of item 1 '
                    '(line 2); give that row another tag')
    assert faults(row(**COUNTER | {'Tag': tag})) == []


@pytest.mark.parametrize('topics', ['RUN', 'speed run'])
def test_rule_3_heartbeat_does_not_depend_on_the_mode(topics: str) -> None:
    told = faults(row(**WRITE), row(**WRITE | {'Tag': 'run', 'Address': 'N7:1'}),
                  row(**BEAT | {'While': topics, 'While_Timeout': '500'}))
    assert told == ['4:20 (While): Item: 3, RUN is the mode of a PLC, and a heartbeat depends on '
                    'topics whose messages we get']


def test_name_that_is_the_tag_of_one_row_and_the_topic_of_another_is_ambiguous() -> None:
    other = row(Tag='speed', Command='Read', Address='N7:9', Topic='actual')
    write = row(**WRITE | {'Tag': 'set', 'Topic': 'speed'})
    beat = row(**BEAT | {'While': 'speed', 'While_Timeout': '500'})
    text, = faults(other, write, beat)
    assert text == ('4:20 (While): Item: 3, "speed" is a write topic, and the tag of item 1 '
                    '(line 2); give that row another tag')
    counter = row(**COUNTER | {'Topic': 'alive'})
    text, = faults(counter, row(**WRITE | {'Topic': 'counter'}), row(**DOORS))
    assert '"counter" is a write topic, and the tag of item 1' in text
    # Where the row with the tag has the topic, too, there is one meaning.
    assert faults(row(Tag='speed', Command='Read', Address='N7:9'), write, beat) == []


def test_columns_of_before_are_told_with_the_new_cells() -> None:
    mappings = (
        'Tag,Command,Address,Station,PLC_Type,Requires,Requires_Timeout,publish_while,'
        'Heartbeat_Timeout\n'
        'beat,Heartbeat,N10:0,1,SLC,speed stop,500,,\n'
        'doors,Read,B3:0,1,SLC,,,RUN,\n')
    with pytest.raises(ConfigurationError) as error:
        load_text(mappings)
    assert [str(problem).split('map.csv:')[1] for problem in error.value.problems] == [
        '1:6: column Requires is called While now',
        '1:7: column Requires_Timeout is called While_Timeout now',
        '1:8: column publish_while is called While now',
        '1:9: column Heartbeat_Timeout is called While_Timeout now',
        '2:6: write While = "speed stop" instead of Requires',
        '2:7: write While_Timeout = "500" instead of Requires_Timeout',
        '3:8: write While = "RUN" instead of publish_while']
