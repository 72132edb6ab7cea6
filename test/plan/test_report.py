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

"""The report on both files, worked out by hand from the frames on the line, and its forecasts."""

from dataclasses import replace

from abdf1_ros.plan.forecast import (
    block_time,
    intervals,
    line_model,
    load,
    OwnCommand,
    PATIENCE,
    poll_cycle,
    stale_times,
)
from abdf1_ros.plan.planner import Planner
from abdf1_ros.plan.report import make_report, Remark, RemarkKind, Report, setting_remarks
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench
from support.mappings import make_mapping

CHARACTER = 10 / 9600  # s; 8 data bits, no parity, 1 stop bit
# Command of 16 bytes in a frame of 25, ACK 2, poll 4, reply of 13 in a frame of 19, ACK 2.
TWO_WORDS = 52 * CHARACTER
ONE_WORD = 50 * CHARACTER  # the reply has one word less
FULL_DUPLEX = 45 * CHARACTER  # no poll, and no address in front of the command
TWO_WORDS_SLC = 45 * CHARACTER  # 12 bytes and 10
ANSWERS = 0.02  # two, of 10 ms


def report_of(*mappings: Mapping, period: float = 1.0, response: float = 0.01,
              **settings: object) -> Report:
    network = Network(**{'timeout': 300} | settings)  # type: ignore[arg-type]
    return make_report(network, mappings, period, response)


def test_settings_that_are_odd_come_first_with_their_stations() -> None:
    odd = replace(make_mapping('N7:0', station=3), remarks=('map.csv:2:8 (Max): too much',))
    assert report_of(odd, data_bits=7).remarks()[:2] == [
        Remark(RemarkKind.SETTING, 'Data_Bits 7: DF1 sends bytes of 8 bits; with less the check '
                                   'of nearly every message fails'),
        Remark(RemarkKind.SETTING, 'map.csv:2:8 (Max): too much', 3)]


def test_write_over_what_another_row_reads_is_odd() -> None:
    bits = make_mapping('B3:2/0', tag='il', length=3)
    odd = report_of(bits, make_mapping('B3:2/2', 'Write', tag='rip', item=4)).remarks()
    assert odd == [Remark(RemarkKind.SETTING, (
        'map.csv:5: rip writes B3:2/2, which il reads, so a message overwrites the value '
        'of the PLC; if you mean that, use one ReadWrite row, otherwise another address'), 1)]
    assert report_of(bits, make_mapping('B3:1', 'Write', length=2)).remarks()
    written = make_mapping('N7:0', 'Write', tag='w')
    assert len(report_of(written, make_mapping('N7:0', item=2)).remarks()) == 1
    # Other bits, other stations and all of them, and rows that say that they do both.
    for address, command, station in (
            ('B3:2/3', 'Write', 1), ('B3:3', 'Write', 1), ('B3:2/0', 'ReadWrite', 1),
            ('B3:2/0', 'Write', 2), ('B3:2/0', 'Write', 255)):
        assert report_of(bits, make_mapping(address, command, station=station)).remarks() == []


def texts(report: Report, kind: RemarkKind) -> list[str]:
    return [remark.text for remark in report.remarks() if remark.kind is kind]


def test_words_that_very_many_rows_have_are_one_remark() -> None:
    rows = [make_mapping('N7:4', 'Write', tag=f't{number}', item=number, length=2)
            for number in range(101)]
    told = texts(report_of(*rows[1:]), RemarkKind.SETTING)
    assert len(told) == 99 and told[-1].startswith(
        'map.csv:101: t100 writes N7:4, of which t1, t2, t3 and 96 more also writes')
    assert texts(report_of(*rows), RemarkKind.SETTING) == [
        '101 rows have the word N7:4: t0, t1, t2 and 98 more; they are too many to be compared '
        'with each other']


@for_all(('plc', 'settings', 'line_time'), [
    ('PLC5', {}, TWO_WORDS), ('SLC', {}, TWO_WORDS_SLC), ('PLC5', {'mode': 'Peer'}, FULL_DUPLEX),
    ('PLC5', {'baud': 19200}, TWO_WORDS / 2), ('PLC5', {'tx_delay': 5}, TWO_WORDS + 0.015),
    ('PLC5', {'mode': 'Peer', 'tx_delay': 5}, FULL_DUPLEX + 0.010),
    ('PLC5', {'parity': 'Even'}, TWO_WORDS * 1.1),
    # BCC is one byte instead of two, in the command and in the reply.
    ('PLC5', {'error_code': 'BCC'}, TWO_WORDS - 2 * CHARACTER)])
def test_times_of_one_read(plc: str, settings: dict[str, object], line_time: float) -> None:
    report = report_of(make_mapping('N7:0', plc=plc, length=2), **settings)
    block, = report.blocks
    assert block.line_time == pytest.approx(line_time)
    assert report.time(block) == report.poll_cycle == pytest.approx(line_time + ANSWERS)
    assert report.load == pytest.approx(line_time + ANSWERS)  # of one second
    assert report.remarks() == []
    slow = report_of(make_mapping('N7:0', plc=plc, length=2), response=0.1, **settings)
    assert slow.time(block) == slow.poll_cycle == pytest.approx(line_time + 10 * ANSWERS)


def test_map_without_a_row_is_odd() -> None:
    odd, remark = report_of(data_bits=7).remarks()
    assert (odd.kind, remark.kind, remark.station) == (RemarkKind.SETTING, RemarkKind.MAP, None)
    assert remark.text == 'the map has no usable row: nothing is read or written'


@for_all(('own', 'station', 'begin'), [
    (0, 1, 'our own Station is 0'), (5, 0, 'station 0 is in the map'), (5, 1, None)])
@for_all('mode', ['Peer', 'Master'])
def test_station_0_on_a_full_duplex_line_is_odd(mode: str, own: int, station: int,
                                                begin: str | None) -> None:
    found = report_of(make_mapping('N7:0', station=station), mode=mode, station=own).remarks()
    if mode == 'Master' or begin is None:
        assert found == []
    else:
        remark, = found
        assert (remark.kind, remark.station) == (RemarkKind.STATION, 0)
        assert remark.text.startswith(f'{begin}: a message to station 0 begins with 00')


@for_all(('station', 'octal'), [(10, 8), (17, 15), (77, 63), (7, None), (18, None)])
def test_node_behind_a_gateway_may_be_octal_on_its_panel(station: int, octal: int | None) -> None:
    found = texts(report_of(make_mapping('N7:0'), make_mapping('N7:0', station=station, via=3)),
                  RemarkKind.STATION)
    if octal is None:
        assert found == []
    else:
        text, = found
        assert 'on Data Highway Plus node numbers are octal' in text
        assert text.endswith(f'if {station} is what a panel there shows, write {octal}')
    assert texts(report_of(make_mapping('N7:0'), make_mapping('N7:0', station=station)),
                 RemarkKind.STATION) == []


def test_nodes_of_a_full_duplex_gateway_may_be_octal_too() -> None:
    rows = [make_mapping('N7:0'), make_mapping('N7:0', station=10)]
    text, = [text for text in texts(report_of(*rows, mode='Peer'), RemarkKind.STATION)
             if 'octal' in text]
    assert 'station 10 of' in text and text.endswith('write 8')
    assert report_of(rows[1], mode='Peer').remarks() == []  # one PLC needs no gateway


@pytest.mark.parametrize('mode', ['Peer', 'Slave'])
def test_via_is_for_a_master(mode: str) -> None:
    text, = texts(report_of(make_mapping('N7:0', station=2, via=3), mode=mode), RemarkKind.STATION)
    assert 'Via is for Mode Master' in text


def test_blocks_go_by_station_and_then_by_row() -> None:
    report = report_of(make_mapping('N7:0', station=2, item=1), make_mapping('B3:0', item=3),
                       make_mapping('F8:0', item=2))
    assert [(block.station, str(block.start)) for block in report.blocks] == [
        (1, 'F8:0'), (1, 'B3:0'), (2, 'N7:0')]


def test_period_that_another_baud_rate_can_keep() -> None:
    report = report_of(make_mapping('N7:0', length=2, period=50, tag='speed'),
                       make_mapping('N9:0', period=0))
    assert report.load == pytest.approx((TWO_WORDS + ANSWERS) / 0.05)  # 148.3 %
    assert report.needed_baud() == 19200  # 27.1 ms and 20 ms of 50 ms
    slow = report_of(make_mapping('N7:0', length=2, period=50), response=0.02)
    assert slow.needed_baud() == 57600  # 9.0 ms and 40 ms
    rare = make_mapping('N9:0', period=10_000)
    assert report_of(rare, *report.mappings).needed_period() == 100
    assert texts(report, RemarkKind.LOAD) == [
        'the periods need 148% of the time of the line at 9600 baud, so reads come late; '
        '19200 baud would be enough; or Period 100 in place of shorter ones']
    assert texts(report, RemarkKind.PERIOD) == [
        'speed: a read takes 74.2 ms, the period is 50.0 ms']
    text, = texts(report_of(make_mapping('N7:0', period=1)), RemarkKind.LOAD)
    assert text.endswith('; no baud rate is enough, only longer periods; or Period 100 in place '
                         'of shorter ones')


def test_packets_that_take_longer_than_cmd_timeout_are_named() -> None:
    rows = [make_mapping('N7:0', length=2, tag='speed'),
            make_mapping('N9:0', length=30, tag='recipe')]
    for mode, baud, cmd_timeout, named in (
            ('Master', 9600, 500, []), ('Master', 1200, 1000, []), ('Master', 300, 5000, []),
            ('Master', 300, 2000, ['recipe']), ('Radio', 300, 1000, ['speed', 'recipe'])):
        line = Network(mode=mode, baud=baud, cmd_timeout=cmd_timeout)
        found = texts(make_report(line, rows, 60.0, 0.0), RemarkKind.PERIOD)
        assert [text.partition(':')[0] for text in found] == named, (mode, baud, found)
    assert found[1] == (
        'recipe: a packet takes 4496.7 ms at 300 baud, Cmd_Timeout is 1000 ms; by radio its reply '
        'may come too late each time: raise Cmd_Timeout, or use shorter rows or a higher baud '
        'rate')


def test_plcs_of_a_radio_network_work_on_their_answers_at_a_time() -> None:
    rows = [make_mapping('N7:0', station=1), make_mapping('N7:0', station=2),
            make_mapping('N9:0', 'Heartbeat', period=1000)]  # which is read every 500 ms
    quick, slow = (report_of(*rows, response=response, mode='Radio', collision_avoidance=True,
                             tx_delay=delay) for response, delay in ((0.0, 0), (1.0, 5)))
    assert slow.poll_cycle == pytest.approx(quick.poll_cycle + 3 * 0.51)  # half of 1 s, 2 * 5 ms
    # Four reads a second, a heartbeat, and half a question for the mode.
    assert slow.load == pytest.approx(quick.load + 5.5 * 0.51) == max(slow.intervals().values())


def test_guarded_rows_of_a_full_line_are_named() -> None:
    rows = [make_mapping('N7:0', period=50, tag='free'),
            make_mapping('N7:1', period=50, tag='guarded', condition=While(('RUN',)))]
    assert texts(report_of(*rows), RemarkKind.LOAD)[1:] == [
        'on such a line rows with While come less often than other rows, because each value '
        'needs a recent mode of the PLC, or a recent counter: guarded']
    assert texts(report_of(*[replace(row, period=2000) for row in rows]), RemarkKind.LOAD) == []


def test_baud_rate_has_to_do_for_heartbeats_and_questions_too() -> None:
    rows = [make_mapping('N7:0', length=2, period=100, tag='speed'),
            make_mapping('N10:0', 'Heartbeat', tag='beat', period=300)]
    report = report_of(*rows)
    assert report_of(rows[0]).load < 1 < report.load
    needed = report.needed_baud()
    assert needed == 19200
    assert f'{needed} baud would be enough' in texts(report, RemarkKind.LOAD)[0]
    assert report_of(*rows, baud=needed).load <= 1
    text, = texts(report_of(replace(rows[1], period=50)), RemarkKind.LOAD)
    assert 'Period' not in text  # it is no read


def test_together_the_periods_may_be_too_short_though_none_is() -> None:
    mappings = [make_mapping('N7:0', length=2, station=station, period=100, item=station)
                for station in (1, 2)]
    report = report_of(*mappings)
    assert report.load == pytest.approx(2 * (TWO_WORDS + ANSWERS) / 0.1)
    assert texts(report, RemarkKind.PERIOD) == []
    assert len(texts(report, RemarkKind.LOAD)) == 1


@pytest.mark.parametrize('period, warned', [(90, True), (95, False)])
def test_load_above_80_percent_is_warned_of(period: int, warned: bool) -> None:
    # 75.2 ms are 84 % of 90 ms and 79 % of 95 ms.
    report = report_of(make_mapping('N7:0', length=2, period=period))
    assert bool(texts(report, RemarkKind.LOAD)) is warned
    assert not warned or '82% of the line' in texts(report, RemarkKind.LOAD)[0]


def test_guests_are_part_of_the_load() -> None:
    report = report_of(make_mapping('N7:0', period=100), share='pty:/tmp/hmi')
    text, = texts(report, RemarkKind.LOAD)
    assert text == (
        'while guests (Share) ask, a quarter of the time may be theirs: the periods then need '
        f'{report.load / 0.75:.0%} of the time that is left, and the poll cycle is up to a third '
        'longer; of their reads of 20 words the line takes 11 a second, and 3 beside rows with '
        'Period 0')


@for_all(('baud', 'mode', 'told'), [
    (9600, 'Peer', '11 a second, and 3 '), (19200, 'Peer', '21 a second, and 5 ')])
def test_commands_of_guests_a_second_are_told_for_the_line(
        baud: int, mode: str, told: str) -> None:
    report = report_of(make_mapping('N7:0', period=1000), share='eip:44818', baud=baud, mode=mode)
    assert f'the line takes {told}beside rows' in texts(report, RemarkKind.LOAD)[0]


def test_served_words_and_broadcasts_clash_with_nothing() -> None:
    report = report_of(make_mapping('N7:0', 'Serve', station=5),
                       make_mapping('N7:0', 'Write', station=255, plc='SLC', item=2),
                       make_mapping('N7:0', 'Write', station=255, item=3))
    assert report.blocks == ()
    assert report.remarks() == []


def test_file_of_a_plc_has_one_type() -> None:
    rows = [make_mapping(f'{kind}10:{number}', station=station, plc='SLC', tag=f'{kind}{station}')
            for number, kind in enumerate('NBF') for station in (1, 2)][:-1]
    told = setting_remarks(Network(), rows)  # as the node logs them
    assert [*told] == [Remark(RemarkKind.STATION, (
        f'station {station}: file 10 cannot be {kinds} at the same time; a file of a PLC has '
        'one type'), station) for station, kinds in (
            (1, 'N10 (N1), B10 (B1), F10 (F1)'), (2, 'N10 (N2), B10 (B2)'))]
    # A PLC-3 numbers the files of each type by themselves; an I/O slot is of no file.
    assert texts(report_of(*[make_mapping(f'{kind}10:0', plc='PLC3') for kind in 'NB']),
                 RemarkKind.STATION) == []
    # And PTO is number 1 of the function files.
    assert texts(report_of(*[make_mapping(text, plc='SLC') for text in (
        'I:1.0', 'O:1.0', 'PTO:0.OUT')]), RemarkKind.STATION) == []


def test_gap_that_costs_a_second_read() -> None:
    report = report_of(make_mapping('N7:0', kind='int32', item=1), make_mapping('N7:200', item=2),
                       make_mapping('N7:5', item=3), make_mapping('N7:400', period=5000))
    remark, = report.remarks()
    assert (remark.kind, remark.station) == (RemarkKind.GAP, 1)
    assert remark.text == (
        'station 1, N7:0 to N7:200: 2 reads with 3 words that no tag needs take 155.6 ms; '
        'side by side in the PLC the tags would take 79.4 ms')


def test_side_by_side_as_many_words_as_a_packet_takes_are_one_read() -> None:
    report = report_of(*(make_mapping(f'N7:{first}', length=55) for first in range(0, 800, 200)))
    packets = report_of(make_mapping('N7:0', length=220)).poll_cycle
    assert report.remarks()[0].text.endswith(f'the tags would take {packets * 1000:.1f} ms')


def test_members_of_structures_apart_are_compared_with_whole_elements() -> None:
    report = report_of(make_mapping('T4:0.ACC', item=1), make_mapping('T4:200.ACC', item=2))
    text, = texts(report, RemarkKind.GAP)
    assert text == (
        'station 1, T4:0.ACC to T4:200.ACC: 2 reads with 0 words that no tag needs take 146.2 ms; '
        'side by side in the PLC the tags would take 82.5 ms')


def test_rule_20_what_nothing_protects_is_one_note() -> None:
    fallback = Fallback((0,), 2000)
    guarded = [make_mapping('N10:1', 'Write', tag='speed', fallback=fallback, station=2,
                            single_publisher=True),
               make_mapping('N10:0', 'Heartbeat', tag='beat', period=1000,
                            condition=While(('speed',), 10_000)),
               make_mapping('N7:9', 'Serve', station=5, tag='pushed', period=1000)]
    killed = ('a killed publisher counts for 20 s, or for 2 s if it offers a liveliness lease of '
              '2 s or less')
    assert report_of(*guarded, mode='Peer').notes() == [f'Single_Publisher: {killed}']
    bare = [make_mapping('N7:1', 'Write', tag='word'), make_mapping('B3:0/2', 'Write', tag='bit'),
            make_mapping('N7:3', 'ReadWrite', tag='recipe'),
            make_mapping('O:001', 'Write', tag='lamp'),
            make_mapping('N10:5', 'Heartbeat', tag='bare', period=1000, station=2),
            make_mapping('N11:5', 'Heartbeat', tag='alone', period=1000, station=9),
            make_mapping('N10:6', 'Heartbeat', tag='slow', period=1000,
                         condition=While(('speed',), 10_001)),
            make_mapping('N7:8', 'Serve', station=5, tag='silent')]
    note, _ = report_of(*guarded, *bare, mode='Peer').notes()
    assert note == (
        'nothing protects: 4 of 5 written rows, without Fallback: lamp, bit, word and 1 more; '
        'heartbeats without While, which count even if no program publishes: bare; While_Timeout '
        'over 10 s: slow; topics of Serve rows without Period, so a PLC that stops is not '
        'noticed: silent')
    shared = [make_mapping(f'N11:{number}', 'Write', tag=f'w{number}', fallback=fallback)
              for number in range(4)]
    note, = report_of(*guarded, *shared, mode='Peer').notes()
    assert note == (
        'rows with Fallback that take messages of any number of publishers: w0, w1, w2 and 1 '
        'more; Single_Publisher Yes refuses all messages while more than one publisher is alive; '
        f'{killed}')


def test_what_a_reset_of_the_slaves_would_destroy_is_noted_where_rows_wait_for_messages() -> None:
    rows = [make_mapping('N7:0', station=2, plc='SLC', via=8),
            make_mapping('N7:8', 'Serve', station=5, tag='pushed', period=1000)]
    note, = report_of(*rows).notes()
    assert note == (
        'with the parameter nak_on_command_timeout true, each overdue reply would make all slaves '
        'drop what they have queued: messages of stations 2, 8; messages of slaves for pushed')
    for mode in ({'polling': 'Standard'}, {'mode': 'Peer'}):
        assert report_of(*rows, **mode).notes() == []
    assert report_of(rows[0]).notes() == []


def test_bits_that_go_on_without_the_program_are_noted_and_are_not_odd() -> None:
    run = While(('RUN',))
    rows = [make_mapping('B3:0/0', tag='door', period=1000),
            make_mapping('B3:0/1', tag='guarded', period=1000, condition=run),
            make_mapping('B3:0/2', 'ReadWrite', tag='command', period=1000),
            make_mapping('N7:0', station=2, period=1000, condition=While(('alive',), 9000))]
    # A command of 7 bytes in a frame of 16, ACK 2, poll 4, reply of 32 in a frame of 38, ACK 2.
    cost, bits, _ = report_of(*rows).notes()
    assert bits == ('bits without While: door; their values go on when the program of the '
                    'PLC stops')
    assert cost == ('While RUN: asking station 1 for its mode about every 1000 ms takes '
                    f'{62 * CHARACTER + ANSWERS:.0%} of the time')
    assert report_of(*rows, mode='Listen').notes()[0].startswith('While RUN: rows have values')
    assert report_of(rows[3]).notes() == []
    assert report_of(make_mapping('B3:0/0', tag='door', publish='Change')).notes()[0] == (
        'bits with Publish Change: door; their topics have no deadline, so a subscriber '
        'that asks for a deadline gets no values; Max_Silence gives them a deadline')


def test_rows_promise_three_intervals_and_a_read() -> None:
    row, silent = make_mapping('N7:0', length=2), make_mapping('N7:0', publish='Change')
    assert report_of(row, silent).promises() == {row: pytest.approx(3 + TWO_WORDS + ANSWERS)}
    rare, beat = make_mapping('N7:2', period=1200), make_mapping('N9:0', 'Heartbeat', period=100)
    assert report_of(row, rare).promises()[rare] == pytest.approx(
        3.6 + TWO_WORDS + 2 * CHARACTER + ANSWERS)
    busy = report_of(row, beat)  # of the heartbeat nobody is promised anything
    interval = max(busy.intervals().values())
    assert busy.promises() == {row: pytest.approx(3 * interval + TWO_WORDS + ANSWERS)}
    assert interval > 1.2
    guarded = make_mapping('B3:0', period=200, condition=While(('RUN',)))
    fast, slow = report_of(row, guarded), report_of(row, guarded, response=0.1)
    # The node does not know how slow the PLC is, and so promises the same.
    assert slow.promises() == fast.promises()
    assert slow.poll_cycle > fast.poll_cycle and slow.load > fast.load
    assert slow.intervals() != fast.intervals()


def test_time_of_an_end_is_that_of_slow_plcs() -> None:
    rows = [make_mapping(f'N{file}:0', 'Write', tag=f'w{file}', length=120,
                         fallback=Fallback((0,) * 120, 60_000)) for file in (7, 9, 10)]
    assert texts(report_of(*rows, baud=19200), RemarkKind.INTERLOCK) == []
    text, _ = texts(report_of(*rows, baud=19200, response=0.3), RemarkKind.INTERLOCK)
    assert text.startswith('an orderly end needs 4')


def test_write_again_is_held_against_the_reads_that_slow_plcs_allow() -> None:
    rows = [make_mapping('N7:0', 'Write', tag='w', write_again=1000),
            make_mapping('N7:0', tag='r', length=4, period=200)]
    assert not texts(report_of(*rows), RemarkKind.SETTING)
    found = texts(report_of(*rows, response=0.5, cmd_timeout=2000), RemarkKind.SETTING)
    assert any('well below Write_Again, 1000 ms' in text for text in found)


@for_all(('again', 'after', 'period', 'expected'), [
    (1000, None, 500, ''), (1000, None, 800, 'read every 800 ms, and that has to be well below '
                                             'Write_Again, 1000 ms'),
    (5000, 1000, 800, 'read every 800 ms, and that has to be well below Fallback_After, 1000 ms'),
    (5000, None, 1500, 'read every 1500 ms, and that has to be well below write_timeout, 2000 ms'),
    (1000, None, None, 'w: Write_Again has no effect: no Read row has all of its words')])
def test_words_with_write_again_have_to_be_read_often(
        again: int, after: int | None, period: int | None, expected: str) -> None:
    rows = [make_mapping('N7:0', 'Write', tag='w', write_again=again,
                         fallback=Fallback((0,), after) if after else None)]
    if period:
        rows.append(make_mapping('N7:0', tag='r', length=4, period=period))
    rows.append(make_mapping('N9:0', period=100))  # of other words
    found = texts(report_of(*rows[::-1]), RemarkKind.SETTING)
    assert [expected in text for text in found] == [True] * bool(expected)


# Forecasts of poll cycle and load, before anything is connected


NETWORK = Network(baud=9600)
ROWS = [make_mapping('N7:0', length=40, period=500), make_mapping('F8:0', length=10, period=0),
        make_mapping('T4:0', length=9, period=2000)]


def blocks_of(network: Network) -> list:  # type: ignore[type-arg]
    return Planner(line_model(network), 0.1).plan(ROWS)


def test_poll_cycle_is_characters_and_two_answers_a_transaction() -> None:
    blocks = blocks_of(NETWORK)
    characters = sum(block.line_time for block in blocks)
    assert poll_cycle(blocks, 0.0) == pytest.approx(characters)
    assert poll_cycle(blocks, 0.01) == pytest.approx(characters + 6 * 0.01)
    assert poll_cycle(blocks) == poll_cycle(blocks, 0.01)


def test_mapping_of_several_packets_has_answers_for_each() -> None:
    block, = Planner(line_model(NETWORK), 0.1).plan([make_mapping('N7:0', length=250)])
    assert len(block.requests) == 3
    assert block_time(block, 0.01) - block_time(block, 0.0) == pytest.approx(6 * 0.01)


def test_load_is_what_periods_need_and_leaves_out_those_without() -> None:
    times = {block.period: block_time(block, 0.01) for block in blocks_of(NETWORK)}
    assert load(blocks_of(NETWORK), 0.01) == pytest.approx(times[0.5] / 0.5 + times[2.0] / 2)


def expected(*rows: tuple[int, int], own: tuple[OwnCommand, ...] = (),
             network: Network = NETWORK) -> tuple[dict[float, float], float]:
    """Return the intervals for so many reads of a period (ms) each, and the time of one."""
    mappings = [make_mapping(f'N{9 + 20 * group + number}:0', period=period)
                for group, (period, count) in enumerate(rows) for number in range(count)]
    blocks = Planner(line_model(network), 0.1).plan(mappings)
    found = intervals(line_model(network), blocks, own)
    return {block.period: time for block, time in found.items()}, block_time(blocks[0])


def test_periods_are_longer_by_the_load_of_the_line_but_by_no_more_than_a_scan() -> None:
    found, time = expected((100, 1), (1000, 20))
    needed = time / 0.1 + 20 * time / 1.0
    assert 1.5 < needed < 2.5
    assert found[0.1] == pytest.approx(0.1 * needed)
    assert found[1.0] == pytest.approx(1.0 * needed)
    found, time = expected((10, 10), (1000, 1))
    assert found[0.01] == pytest.approx(0.01 * (10 * time / 0.01 + time / 1.0), rel=0.01)
    assert found[1.0] == pytest.approx(1.0 + 11 * time, rel=0.01)
    found, time = expected((1000, 1), own=(OwnCommand(0.5, 0.1),))
    assert found == {1.0: pytest.approx(1.0 + time + 0.5)}


def test_own_commands_go_before_the_reads_of_a_station_that_is_polled_in_turn() -> None:
    standard = replace(NETWORK, polling='Standard')
    _, time = expected((100, 1))  # a scan of one station that has a command each time
    found, _ = expected((100, 3), own=(OwnCommand(time, 1.0, 1),), network=standard)
    assert found == {0.1: pytest.approx(3 * time / (1 - time))}
    found, _ = expected((100, 3), own=(OwnCommand(time, 0.01, 1),), network=standard)
    assert found == {0.1: pytest.approx(0.1 + 4 * time)}
    found, _ = expected((0, 2), (1000, 1), network=standard)
    assert found == {0.0: pytest.approx(2 * time / (1 - time)), 1.0: 1.0}


@for_all(('count', 'between'), [(0, 0.5), (1, 0.6), (2, 0.9), (9, 1.8)])
def test_stale_time_has_room_for_one_own_command_after_each_read(
        count: int, between: float) -> None:
    line = line_model(Network(baud=115200))
    blocks = Planner(line, 0.25).plan([
        make_mapping('N7:0'), make_mapping('N9:0', length=120)])  # three reads
    own = [OwnCommand(0.6, 100.0), *[OwnCommand(0.3, 100.0)] * 8]
    found = stale_times(line, blocks, 0.25, 3.0, own[:count])
    assert [*found.values()] == 2 * [pytest.approx(
        0.25 + between + max(blocks[1].line_times) + ANSWERS)]


def test_reads_without_a_period_are_expected_to_have_what_is_left() -> None:
    found, time = expected((0, 2), (500, 2))
    left = 1 - 2 * time / 0.5
    assert found == {0.0: pytest.approx(2 * time / left), 0.5: 0.5}
    found, time = expected((0, 2))
    assert found == {0.0: pytest.approx(2 * time)}
    found, _ = expected((0, 2), own=(OwnCommand(0.5, 0.5),))  # which leave nothing
    assert found == {0.0: pytest.approx(10 * time)}


@for_all(('period', 'is_full'), [(100, True), (300, False)])
def test_reads_without_a_period_are_expected_to_have_little_of_a_full_line(
        period: int, is_full: bool) -> None:
    found, time = expected((0, 2), (period, 4))
    once, needed, short = 6 * time, 4 * time / period * 1000, period / 1000
    assert needed > 1 if is_full else 0.95 < needed < 1
    stretch = needed + 2 * time / (PATIENCE * once)
    assert found[0.0] == pytest.approx(min(PATIENCE * once * stretch, (PATIENCE + 1) * once))
    assert found[short] == pytest.approx(min(short * stretch, short + once))


@pytest.mark.parametrize('tx_delay', [0, 20])
@pytest.mark.parametrize('baud', [1200, 19200])
def test_forecast_is_what_a_line_does_whose_station_answers_at_once(
        baud: int, tx_delay: int) -> None:
    rows = [replace(row, period=0) for row in ROWS]
    bench = DriverBench(rows, network=Network(baud=baud, tx_delay=tx_delay), start=False)
    bench.plc(1, 'PLC5', ('N7:0', 40), ('F8:0', 20), ('T4:0', 9))
    bench.open(run=20.0)
    measured = bench.driver.readings.reads.poll_cycle
    assert measured == pytest.approx(poll_cycle(bench.driver.readings.blocks, 0.0), rel=0.03)
