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

"""The lines that show a running bridge, and small curves of values."""

import math

from abdf1_ros.cli.monitor.curves import ASCII, Curve
from abdf1_ros.cli.monitor.curves import WIDTH as CURVE_WIDTH
from abdf1_ros.cli.monitor.view import (
    LINK_KEYS,
    NAMES_OF_BITS,
    NodeView,
    render,
    show,
    ShownStatus,
    Style,
    TextLine,
    TopicRow,
)
from abdf1_ros.text import BARS
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import ANY_CHARACTER, for_all

NOW = 1000.0  # also the beginning of a step of two seconds of a curve
WIDTH = 120


def snapshot(**changes: object) -> NodeView:
    """Return a bridge of which nothing is wrong, changed as told."""
    fields: dict[str, object] = {
        'node': '/cell/abdf1', 'is_there': True, 'told': NOW - 0.4, 'statuses': [],
        'readings': [TopicRow('speeds', [1200, -800], 'N7:0', NOW - 0.25, 0.5)],
        'active': [1, 17], 'results': []}
    return NodeView(**fields | changes)  # type: ignore[arg-type]


def lines(picture: NodeView, width: int = WIDTH) -> list[str]:
    return [line.text for line in render(picture, NOW, width)]


def line_with(text: str, picture: NodeView, width: int = WIDTH) -> TextLine:
    (line,) = [line for line in render(picture, NOW, width) if text in line.text]
    return line


def styles_of(text: str, picture: NodeView) -> list[Style]:
    """Return the styles of all lines with a text: what is wrong is told there, and in its part."""
    return [line.style for line in render(picture, NOW, WIDTH) if text in line.text]


def test_a_reading_is_shown_with_address_age_state_and_values() -> None:
    line = line_with('speeds', snapshot())
    assert line.text.split() == ['speeds', 'N7:0', '0.2', 's', 'fresh', '1200', '-800']
    assert line.style is Style.GOOD


def test_value_is_the_last_column_to_go() -> None:
    curve = Curve()
    curve.take([1], NOW)
    picture = snapshot(
        statuses=[ShownStatus('link', Style.GOOD, 'OK', {'line load by topic': 'old 2.5%'})],
        readings=[TopicRow('old', range(7, 13), 'N7:10/12', NOW - 5, 1.0, curve),
                  TopicRow('new', None, promised=1.0)])
    assert lines(picture, 38)[2:4] == [
        '  old      5.0 s  STALE  7 and 5 more', '  new             no']
    shown = '  old      5.0 s  STALE  7 8 9 10 11 12'
    for width, row in (
            (44, '  old      5.0 s  STALE     7 8 9 10 11 12'),
            (51, '  old      5.0 s  STALE      2.5%  7 8 9 10 11 12'),
            (58, '  old      5.0 s  STALE                ▁  7 8 9 10 11 12'),
            (65, '  old      5.0 s  STALE      2.5%             ▁  7 8 9 10 11 12'),
            (73, '  old      5.0 s  STALE (>1 s)       2.5%             ▁  7 8 9 10 11 12'),
            (87, '  old    N7:10/12        5.0 s  STALE (>1 s)       2.5%             ▁  7 8 9 10 '
             '11 12')):
        assert [lines(picture, each)[2] for each in (width - 1, width)] == [shown, row]
        assert lines(picture, width)[3].endswith(' no value')
        shown = row
    long = TopicRow('a_topic_of_some_length', [1], received=NOW)
    assert line_with('a_topic_of_some_l... ', snapshot(readings=[long]), 60).style is Style.PLAIN
    loads = ShownStatus('link', Style.GOOD, 'OK', {'line load by topic': f'{"x" * 40} 3.1%'})
    assert '3.1%' in line_with('xxx... ', snapshot(
        statuses=[loads], readings=[TopicRow('x' * 40, [1], received=NOW)])).text


def test_bits_with_names_are_shown_by_the_names_of_those_that_are_1() -> None:
    names = ShownStatus('mappings', Style.GOOD, 'OK: of 2', {
        f'{NAMES_OF_BITS}cell/doors': 'closed | B3:0/1 | drive 3 fault', 'total': '2'})

    def value(*values: int, width: int = WIDTH, topic: str = 'cell/doors') -> str:
        picture = snapshot(statuses=[names], readings=[TopicRow(topic, values, '', NOW, 1.0)])
        return line_with(topic[:9], picture, width).text.partition('fresh')[2].strip()

    assert value(1, 0, 1) == 'closed, drive 3 fault'
    assert value(0, 1, 0) == 'B3:0/1'
    assert value(0, 0, 0) == 'all 3 are 0'
    assert value(1, 0, 1, width=50) == 'closed, drive ...'
    assert value(1, 0) == '1 0'  # a map that has just been read again
    assert value(1, 0, 1, topic='other') == '1 0 1'
    assert not any(NAMES_OF_BITS in line for line in lines(snapshot(statuses=[names])))


def test_every_part_can_be_found_by_its_first_line() -> None:
    picture = snapshot(statuses=[
        ShownStatus('mappings', Style.BAD, 'ERROR', {'a': 'failed'}),
        ShownStatus('writes', Style.GOOD, 'OK', {'total': '1', 'lost': '0'}),
        ShownStatus('counters', Style.GOOD, '', {'A': '1'})])
    found = {line.section: line.text for line in render(picture, NOW, WIDTH) if line.section}
    assert {name: found[name].split()[0] for name in ('reasons', 'writes', 'counters')} == {
        'reasons': 'mappings', 'writes': 'writes', 'counters': 'counters'}


WITHHELD = [
    ShownStatus('link', Style.GOOD, 'OK: port open', {
        'line load': '47 %', 'poll cycle with Periods': '240 ms',
        'line load by topic': 'row_2 12.5%, row_1 0.4%'}),
    ShownStatus('station 1', Style.GOOD, 'OK: station 1 active', {'mode': 'REM RUN (0.1 s ago)'}),
    ShownStatus('station 2', Style.WARNING, 'WARN: station 2 in mode REM PROG',
                {'mode': 'REM PROG (0.1 s ago)'}),
    ShownStatus('mappings', Style.BAD, 'ERROR: of 10 mappings 2 withheld', {
        'total': '10', 'row_1': 'withheld: the processor is in mode REM PROG',
        'row_2': 'withheld: the processor is in mode REM PROG'}),
    ShownStatus('interlocks', Style.GOOD, 'OK: 1 of 1 confirmed'),
    ShownStatus('writes', Style.GOOD, 'OK: 0 of 0 writes confirmed')]


def test_verdict_values_and_what_is_wrong_fit_a_terminal_of_80_by_24_for_ten_rows() -> None:
    rows = [TopicRow(f'row_{number}', [number, 7], f'N7:{number}', NOW - 0.1, 0.5, Curve())
            for number in range(10)]
    shown = lines(snapshot(statuses=WITHHELD, readings=rows), 79)[:23]
    assert shown[0] == '/cell/abdf1  ERROR (1 of 2): of 10 mappings 2 withheld'
    assert shown[1].split('   ') == [
        '  load 47 %', 'cycle 240 ms', 'stations 1 REM RUN, 2 REM PROG']
    assert [line.split()[0] for line in shown[3:13]] == [f'row_{number}' for number in range(10)]
    assert shown[13:18] == [
        '  mappings     ERROR: of 10 mappings 2 withheld',
        '      row_1: withheld: the processor is in mode REM PROG',
        '      row_2: withheld: the processor is in mode REM PROG',
        '  station 2    WARN: station 2 in mode REM PROG',
        '  interlocks   OK: 1 of 1 confirmed']


def test_load_of_the_line_is_shown_by_row() -> None:
    picture = snapshot(statuses=WITHHELD, readings=[
        TopicRow(f'row_{number}', [number], '', NOW, 0.5) for number in range(3)])
    assert [line.split()[1:-1] for line in lines(picture) if 'row_' in line][:3] == [
        ['0.0', 's', 'fresh'], ['0.0', 's', 'fresh', '0.4%'], ['0.0', 's', 'fresh', '12.5%']]


def test_curve_stands_beside_its_value() -> None:
    curve = Curve()
    for second in range(20):
        curve.take([5, second], NOW - 19 + second)
    reading = TopicRow('ramp', [5, 19], 'N7:0', NOW - 2, 1.5, curve)
    assert line_with('ramp', snapshot(readings=[reading])).text.endswith(
        f'  {curve.draw(NOW, 1.5)}  5 19')
    ascii_line = next(line.text for line in render(snapshot(readings=[reading]), NOW, 80, ASCII)
                      if 'ramp' in line.text)
    assert ascii_line.isascii()


@for_all(('statuses', 'verdict', 'style'), [
    ((), 'OK: 1 topic', Style.GOOD),
    ((ShownStatus('mappings', Style.GOOD, 'OK: of 1 mappings 1 fresh'),
      ShownStatus('link', Style.GOOD, 'OK: port open')), 'OK: of 1 mappings 1 fresh', Style.GOOD),
    ((ShownStatus('mappings', Style.BAD, 'ERROR: of 1 mappings 1 failed'),
      ShownStatus('link', Style.BAD, 'ERROR: port gone')), 'ERROR (1 of 2): port gone', Style.BAD),
    ((ShownStatus('writes', Style.WARNING, 'WARN: 1 lost'),), 'WARN: writes: 1 lost',
     Style.WARNING),
    ((ShownStatus('standby', Style.GOOD, 'OK: waits'),), 'OK: standby: waits', Style.GOOD),
])
def test_verdict_is_the_worst_that_is_told(
        statuses: tuple[ShownStatus, ...], verdict: str, style: Style) -> None:
    first = render(snapshot(statuses=statuses), NOW, WIDTH)[0]
    assert (first.text, first.style) == (f'/cell/abdf1  {verdict}', style)


def test_value_that_does_not_come_here_is_in_the_verdict_though_the_bridge_is_content() -> None:
    good = [ShownStatus('mappings', Style.GOOD, 'OK: of 2 mappings 2 fresh')]
    for reading in (TopicRow('a', [1], received=NOW - 5, promised=1.0),
                    TopicRow('a', promised=1.0)):
        told = lines(snapshot(statuses=good, readings=[reading, TopicRow('b', [1])]))
        assert told[0] == '/cell/abdf1  ERROR: topics: 1 of 2 topics without a fresh value here'
    readings = [TopicRow('a'), TopicRow('empty', '', '', NOW, 1.0)]
    assert lines(snapshot(statuses=good, readings=readings))[0].endswith('2 fresh')


@for_all(('reading', 'state'), [
    (TopicRow('a', [1], received=NOW - 0.5, promised=0.5), ('fresh', Style.GOOD)),
    (TopicRow('a', [1], received=NOW - 0.51, promised=0.5), ('STALE (>0.5 s)', Style.BAD)),
    (TopicRow('a', [1], received=NOW - 900, promised=None), ('any age', Style.PLAIN)),
    (TopicRow('a', None, promised=0.5), ('no value', Style.BAD)),
    (TopicRow('a', None, promised=None), ('no value', Style.BAD)),
])
def test_what_a_value_is_worth_comes_from_its_age_and_the_promise(
        reading: TopicRow, state: tuple[str, Style]) -> None:
    assert reading.state(NOW) == state


def test_columns_are_as_wide_as_the_longest_name() -> None:
    picture = snapshot(readings=[
        TopicRow('a', [1], 'N7:0', NOW, 1.0), TopicRow('longer/name', [2], 'N7:1', NOW, 1.0)])
    rows = [line for line in lines(picture) if 'fresh' in line]
    assert len({line.index('fresh') for line in rows}) == 1


def test_strings_of_a_plc_cannot_move_the_cursor_or_forge_a_line() -> None:
    picture = snapshot(
        node='/n\x1b[2J',
        readings=[TopicRow('na\nme', 'Tank\x1b[31m\n4', 'N7\r', NOW, 1.0)],
        statuses=[ShownStatus('link', Style.GOOD, 'OK: \x1b]0;', {'settings': '\x9b1m'}),
                  ShownStatus('counters', Style.GOOD, '', {'A\n': '\x00'}),
                  ShownStatus('mappings', Style.GOOD, '', {'tag\n': 'x\u202e'}),
                  ShownStatus('station 1\n', Style.GOOD, '', {'mode': '\x7f'})],
        results=[ShownStatus('t\n', Style.GOOD, '\x1b', {'value': '\n'}, NOW)])
    assert all(line.isprintable() for line in lines(picture))
    assert r'"Tank\x1b[31m\n4"' in line_with('na\\nme', picture).text


def test_link_shows_load_and_poll_cycle() -> None:
    picture = snapshot(statuses=[ShownStatus(
        'link', Style.WARNING, 'WARN: port open', {
            'port': 'open', 'settings': '19200 baud, CRC', 'line load': '61 %',
            'poll cycle with Periods': '240 ms',
            'period 100 ms': 'wanted 100 ms, kept 345 ms', 'last error': '2509 ERR',
            'cause': 'noise', 'next step': 'check shield'})])
    assert lines(picture)[1] == '  load 61 %   cycle 240 ms'
    assert styles_of('  link         WARN: port open', picture) == [Style.WARNING] * 2
    assert lines(picture)[-9:-1] == [
        '  link         WARN: port open',
        '      settings                 19200 baud, CRC',
        '      line load                61 %',
        '      poll cycle with Periods  240 ms',
        '      period 100 ms            wanted 100 ms, kept 345 ms', '      last error: 2509 ERR',
        '      cause: noise', '      next step: check shield']
    assert line_with('last error: 2509 ERR', picture).style is Style.WARNING
    picture = snapshot(statuses=[ShownStatus('standby', Style.GOOD, 'OK: waits')])
    assert '  standby      OK: waits' in lines(picture)


def test_stations_are_told_from_the_active_node_table_and_the_diagnostics() -> None:
    picture = snapshot(statuses=[ShownStatus('station 1', Style.GOOD, 'OK'), ShownStatus(
        'station 22', Style.BAD, 'ERROR: station 22 inactive', {
            'last answer': '4.7 s ago', 'transactions without reply': '3', 'error replies': '0',
            'processor': 'SLC', 'mode': 'RUN', 'faults': 'stop'})])
    assert [line.split()[-1] for line in lines(picture)[-5:]] == ['ago', '3', 'SLC', 'RUN', 'stop']
    assert 'active stations: 1, 17' in '\n'.join(lines(picture))
    assert styles_of('  station 22   ERROR', picture) == [Style.BAD] * 2
    assert line_with('4.7 s ago', picture).style is Style.PLAIN
    assert line_with('stations 1 OK, 22 silent', picture).style is Style.WARNING
    assert styles_of('stations 1 REM', snapshot(statuses=WITHHELD)) == [Style.WARNING]
    picture = snapshot(statuses=[ShownStatus('station 1', Style.GOOD, 'OK')])
    assert line_with('stations 1 OK', picture).style is Style.PLAIN
    assert 'active stations: none' in '\n'.join(lines(snapshot(active=[])))
    assert 'active stations' not in '\n'.join(lines(snapshot(active=None)))


def test_no_sentence_is_cut_and_zeros_are_left_out() -> None:
    text = 'ERROR: port open, but none of the stations has ever answered a command'
    picture = snapshot(statuses=[
        ShownStatus('link', Style.BAD, text, {
            'settings': '9600 baud', 'line load': '0.0', 'last error': 'none'}),
        ShownStatus('writes', Style.GOOD, 'OK: 0 of 0 writes confirmed', {'total': '0'})])
    shown = lines(picture, 44)
    assert all(len(line) <= 44 for line in shown)
    assert text in ' '.join(' '.join(line.split()) for line in shown)
    assert not [line for line in shown for zero in ('line load', '0 of 0', 'last error')
                if zero in line]


def test_mappings_name_what_is_wrong_and_leave_the_counts_to_the_summary() -> None:
    values = {'total': '2', 'failed': '1', 'part_counter': 'failed: C5:0.ACC at station 2'}
    picture = snapshot(statuses=[
        ShownStatus('mappings', Style.BAD, 'ERROR: of 2 mappings 1 failed', values)])
    assert line_with('part_counter: failed: C5:0.ACC', picture).style is Style.BAD
    assert not [line for line in lines(picture) if 'total' in line]


def test_results_of_writes_are_shown_with_value_age_and_latency() -> None:
    lost = ShownStatus('writes', Style.WARNING, 'WARN: lost', {'lost': '0'})
    picture = snapshot(statuses=[lost], results=[ShownStatus(
        'recipe', Style.BAD, 'not written: refused', {'value': '[1, 2]', 'latency_ms': '0.3'},
        NOW - 2)])
    line = line_with('recipe', picture)
    assert styles_of('  writes       WARN: lost', picture) == [Style.WARNING] * 2
    assert line.text.strip() == '2.0 s ago: recipe [1, 2] not written: refused (0.3 ms)'
    assert line.style is Style.BAD


def test_only_counters_that_have_counted_are_shown() -> None:
    picture = snapshot(statuses=[ShownStatus(
        'counters', Style.GOOD, 'OK', {'CNT_A': '3', 'CNT_B': '0', 'CNT_C': '1', 'CNT_D': '2'})])
    narrow, wide = ([line.split() for line in lines(picture, width) if 'CNT' in line]
                    for width in (77, 78))
    assert narrow == [['CNT_A', '3'], ['CNT_C', '1'], ['CNT_D', '2']]
    assert wide == [['CNT_A', '3', 'CNT_C', '1'], ['CNT_D', '2']]


@for_all(('changes', 'text', 'style'), [
    ({'is_there': False, 'told': NOW - 5}, 'ERROR (1 of 2): the node is gone', Style.BAD),
    ({'is_there': False, 'told': None}, 'the node is not found yet', Style.BAD),
    ({'is_there': False, 'stopped': 'does not run: no port'}, 'not run: no port', Style.BAD),
    ({'told': None}, 'no diagnostics yet; if /diagnostics is remapped', Style.WARNING),
    ({'told': NOW - 5}, 'no diagnostics for 5.0 s', Style.BAD),
    ({'readings': []}, 'no read topic found', Style.WARNING),
    ({'readings': [], 'hint': '; set X'}, 'no read topic found; set X', Style.WARNING),
])
def test_what_is_missing_is_said(changes: dict[str, object], text: str, style: Style) -> None:
    assert line_with(text, snapshot(**changes)).style is style


@for_all(('values', 'width', 'text'), [
    ([1, 0, 1], 5, '1 0 1'), ([0.10000000149011612, -3.5], 20, '0.1 -3.5'),
    (range(100), 20, '0 1 2 3 and 96 more'), ([123456789], 6, '123...'),
    (range(12345, 12355), 16, '12345 and 9 more'),
    ('Tank 4', 20, '"Tank 4"'), ('a' * 30, 10, '"aaaaaa...'), ([], 5, ''),
])
def test_values_are_cut_to_what_fits(values: list[float], width: int, text: str) -> None:
    assert show(values, width) == text


@given(st.lists(st.integers() | st.floats(), max_size=50) | st.text(ANY_CHARACTER),
       st.integers(min_value=3, max_value=60))
def test_values_never_take_more_than_their_width(values: list[float] | str, width: int) -> None:
    text = show(values, width)
    assert len(text) <= width
    assert text.isprintable()


@given(st.integers(min_value=10, max_value=250), st.text(ANY_CHARACTER, max_size=60),
       st.text(ANY_CHARACTER, max_size=400))
def test_no_line_is_wider_than_the_terminal(width: int, name: str, text: str) -> None:
    picture = snapshot(
        readings=[TopicRow(name, text, name, NOW, 1.0)],
        statuses=[ShownStatus('link', Style.GOOD, text, {LINK_KEYS[-1]: text}),
                  *(ShownStatus(part, Style.GOOD, text, {name: text})
                    for part in ('mappings', 'counters'))])
    widths = [len(line) for line in lines(picture, max(width, 20))]
    assert max(widths) <= max(width, 20)


# Curves: what is drawn, and where nothing is known


def drawn(*values: tuple[float, list[float]], is_bits: bool = False, now: float = NOW,
          promised: float | None = 3.0, bars: str = BARS) -> str:
    """Return the curve of values that came so many seconds before ``NOW``."""
    curve = Curve(is_bits)
    for ago, elements in values:
        curve.take(elements, NOW - ago)
    return curve.draw(now, promised, bars)


def ramp(count: int) -> list[tuple[float, list[float]]]:
    return [(2.0 * ago, [count - ago]) for ago in reversed(range(count))]


def test_newest_value_stands_last_and_the_range_is_that_of_the_curve() -> None:
    assert drawn(*ramp(8)) == ' ' * (CURVE_WIDTH - 8) + BARS
    assert drawn(*ramp(20))[0] == BARS[0]
    assert drawn(*ramp(6), bars=ASCII) == ' ' * (CURVE_WIDTH - 6) + ASCII


def test_time_without_a_good_value_is_blank() -> None:
    assert drawn((20, [2]), (18, [1]), (2, [1]), (1, [2]), (0, [2])).strip() == '█▁▁      ██'
    # Good for 5 s, from the end of its step on.
    assert drawn((0.1, [1]), promised=5.0, now=NOW + 6).strip() == '▁▁▁▁'
    assert drawn((0, [1]), promised=4.0, now=NOW + 6).strip() == '▁▁▁'


def test_topic_that_promises_nothing_keeps_its_value() -> None:
    assert drawn((2000, [1]), (4, [2]), promised=None) == '▁' * (CURVE_WIDTH - 3) + '███'
    assert drawn((2000, [1]), promised=3.0) == ' ' * CURVE_WIDTH


def test_bit_is_drawn_between_0_and_1() -> None:
    assert drawn((2, [1]), (0, [1]), is_bits=True).strip() == '██'
    assert drawn((2, [0]), (0, [0]), is_bits=True).strip() == '▁▁'
    assert drawn((2, [7]), (0, [7])).strip() == '▁▁'


def test_bit_that_blinks_faster_than_the_steps_is_seen() -> None:
    blinking = [(second / 4, [0, second % 2]) for second in reversed(range(1, 41))]
    assert drawn(*blinking, is_bits=True).strip() == '▁█▁█▁█'


def test_peak_within_a_step_is_seen() -> None:
    assert drawn((3, [5]), (1.9, [4]), (1.7, [9]), (1.5, [5]), (1, [8])).strip() == '▁█▆'
    assert drawn((3, [9]), (1.9, [9]), (1.7, [1]), (1.5, [5]), (1, [2])).strip() == '█▁▂'


def test_value_that_comes_late_in_a_step_holds_from_then_on() -> None:
    # Both come in the first of five steps.
    assert drawn((7.5, [0]), (7, [9]), promised=12.0).strip() == '▁████'


def test_first_element_that_changes_is_drawn() -> None:
    rows = [(2.0 * ago, [5, 8 - ago, ago]) for ago in reversed(range(8))]
    assert drawn(*rows).strip() == BARS


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_blank(value: float) -> None:
    assert drawn((6, [1]), (4, [value]), (2, [2]), (0, [3]), promised=2.0).strip()[0] == '▁'
    assert ' ' in drawn((6, [1]), (4, [value]), (2, [2]), (0, [3]), promised=2.0).strip()


def test_nothing_that_came_is_a_blank_curve() -> None:
    assert drawn() == drawn((0, [])) == ' ' * CURVE_WIDTH


def test_rows_of_any_length_are_taken() -> None:
    assert len(drawn((4, [1] * 1000), (2, [1]), (1, []), (0, [2, 3]))) == CURVE_WIDTH
