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

"""Rows that do not fit the line or each other."""

from abdf1_ros.plan.report import make_report
from abdf1_ros.plan.usable_rows import line_problems, usable_rows
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from support.cases import for_all
from support.mappings import make_mapping

PEER = Network(mode='Peer')


def row(text: str, plc: str = 'PLC5', length: int = 1) -> Mapping:
    """Return a Serve row."""
    return make_mapping(text, 'Serve', station=5, plc=plc, length=length)


def texts(*mappings: Mapping, network: Network = PEER) -> list[str]:
    """Return the text of every problem."""
    return [str(problem) for _, problem in line_problems(mappings, network)]


def test_serve_needs_our_plc_type() -> None:
    assert texts(row('N7:50', 'SLC')) == [
        'map.csv:2: Item: 1, a Serve row has the PLC_Type we emulate, which is PLC5 in the net '
        'file']
    assert texts(row('N7:50', 'SLC'), network=Network(mode='Peer', plc_type='SLC')) == []


def test_serve_needs_our_station() -> None:
    assert texts(make_mapping('N7:50', 'Serve', station=0, item=7)) == [
        'map.csv:8: Item: 7, a Serve row has our own Station, which is 5 in the net file']


def test_serve_rows_of_one_file_have_one_type() -> None:
    assert texts(row('N9:0'), row('B9:0'), row('N9:1')) == [
        'map.csv:2: Item: 1, B9:0 does not fit an earlier Serve row: file 9 is of type N already']


def test_files_of_a_plc3_are_numbered_in_each_section() -> None:
    network = Network(mode='Peer', plc_type='PLC3')
    assert texts(row('N9:0', 'PLC3'), row('B9:0', 'PLC3'), network=network) == []


def test_full_duplex_line_has_no_broadcast() -> None:
    everybody = make_mapping('N7:0', 'Write', station=255)
    assert texts(everybody) == [
        'map.csv:2: Item: 1, Station 255 is for a line with many stations, not for Mode Peer']
    assert texts(everybody, network=Network()) == []


@for_all(('network', 'is_wrong'), [
    (Network(station=1), True), (Network(station=1, polling='Standard'), True),
    (Network(station=1, mode='Slave'), True), (Network(station=1, mode='Peer'), False),
    (Network(station=2), False)])
def test_station_to_be_read_is_not_our_own(network: Network, is_wrong: bool) -> None:
    ours = [make_mapping('N7:0', station=1), make_mapping('N7:0', 'Write', station=1)]
    assert texts(*ours, network=network) == [
        'map.csv:2: Item: 1, Station 1 is our own Station in the net file; write the '
        'station of the PLC here'] * 2 * is_wrong


@for_all(('network', 'is_wrong'), [(Network(), True), (PEER, False)])
def test_gateway_is_not_our_own_station(network: Network, is_wrong: bool) -> None:
    assert texts(make_mapping('N7:0', via=5), network=network) == [
        'map.csv:2: Item: 1, Via 5 is our own Station in the net file, not a gateway'] * is_wrong


def test_rule_14_counter_has_to_be_read_often_enough_on_this_line() -> None:
    counter = make_mapping('N11:3', tag='alive', period=100, item=1)
    guarded = make_mapping('N7:0', tag='it', period=100, item=2, condition=While(('alive',), 300))
    good, (problem,) = usable_rows(rows := Rows([counter, guarded]), Network(baud=1200), 0.1)
    assert good == (counter,)
    assert str(problem) == (
        'map.csv:3 (While_Timeout): Item: 2, While_Timeout 300 ms is shorter than 3 reads '
        'of alive on this line; 2620 ms would be enough')
    assert usable_rows(rows, Network(mode='Listen', baud=1200), 0.1) == (rows, [])


def test_rule_15_row_that_does_not_fit_the_line_takes_along_what_depends_on_it() -> None:
    own = Network(station=1)
    counter = make_mapping('N11:3', tag='alive', period=100, item=1)
    guarded = make_mapping('N7:0', tag='level', item=2, condition=While(('alive',), 900))
    word = make_mapping('N7:5', 'Write', tag='speed', topic='speed', item=3)
    beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=500, station=2, item=4,
                        condition=While(('speed',), 500))
    bit = make_mapping('B3:0/0', tag='bit', station=2, item=5, confirms='beat')
    good, problems = usable_rows(Rows([counter, guarded, word, beat, bit]), own, 0.1)
    assert good == ()
    assert [problem.text.partition(',')[0] for problem in problems] == [
        f'Item: {number}' for number in range(1, 6)]


def test_problems_go_with_their_rows() -> None:
    good, bad = row('N7:0'), make_mapping('N7:50', 'Serve', station=1)
    assert [mapping for mapping, _ in line_problems([good, bad], PEER)] == [bad]


@for_all(('mapping', 'text'), [
    (make_mapping(command='Write', period=100), 'Command): Item: 1, Write sends commands, and '
     'Mode Listen sends nothing; only Read rows are possible'),
    (make_mapping(command='Serve', station=5, period=100), 'Command): Item: 1, Serve sends '
     'commands, and Mode Listen sends nothing; only Read rows are possible'),
    *((row, 'Period): Item: 1, Mode Listen needs a Period above 0: the longest time (ms) between '
       'two reads of these words by the other master')
      for row in (make_mapping(), make_mapping(period=0), make_mapping(is_on_demand=True))),
    *((make_mapping(text, plc=plc, access=access, period=100), 'Access): Item: 1, Mode Listen '
       f'does not understand reads with Access {access}')
      for text, plc, access in (('I:1', 'SLC', 'Flat'), ('020', 'PLC2', 'CIF'))),
    (make_mapping(length=200, period=100), 'Length): Item: 1, 200 words never come in one reply, '
     'which has 122 at most; divide the row'),
    (make_mapping(length=122, period=100), ''),  # another master may use word range reads
    (make_mapping(plc='SLC', length=118, period=100, processor='ML1400'), ''),
    (make_mapping(station=5, period=100), '')])  # our own Station means nothing
def test_rows_that_no_traffic_can_fill(mapping: Mapping, text: str) -> None:
    found = texts(mapping, network=Network(mode='Listen'))
    assert found == ([f'map.csv:2 ({text}'] if text else [])


def test_rows_in_mode_listen_promise_what_their_period_says() -> None:
    """However slow the line is: another master reads, and not we."""
    mappings = [make_mapping(f'N7:{first}', length=40, period=100) for first in range(0, 999, 200)]
    heard = make_report(Network(mode='Listen', baud=1200), mappings, 0.1)
    assert [*heard.promises().values()] == [pytest.approx(0.3)] * 5
    assert heard.remarks() == []
    assert min(make_report(Network(baud=1200), mappings, 0.1).promises().values()) > 1.0
