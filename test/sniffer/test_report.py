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

"""Entries and summaries: what they count, as text and as JSON."""

from dataclasses import replace
import json

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.listener import LineKind
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.report import json_line, summary_json, summary_lines, text_line
from abdf1_ros.sniffer.summary import Summary
from abdf1_ros.sniffer.traffic import TrafficDecoder
import pytest
from support.cases import for_all

OUT, IN = Direction.OUT, Direction.IN
HALF = LineKind(Checksum.CRC, Duplex.HALF)
COMMAND = Entry(
    0.5, OUT, Kind.COMMAND, '5 to 1, TNS 1234: echo 01', 1, Checksum.CRC, True,
    Packet(1, 5, 0x06, 0, 0x1234, b'\x00\x01'), marks=(Mark.RETRANSMISSION,))
REPLY = Entry(
    1.25, IN, Kind.REPLY, '1 to 5, TNS 1234: 01', 1, Checksum.CRC, True,
    Packet(5, 1, 0x46, 0, 0x1234, b'\x01'), 0.75)
REFUSAL = Entry(1.0, IN, Kind.REPLY, 'STS 50: no', 1, Checksum.CRC, True,
                Packet(5, 1, 0x46, 0x50, 0x1234), 0.0, marks=(Mark.DUPLICATE,))
DAMAGED = Entry(2.0, IN, Kind.DAMAGED, 'wrong check', 1, Checksum.BCC, False,
                Packet(5, 1, 0x46, 0x50, 7))
POLL = Entry(None, Direction.UNKNOWN, Kind.POLL, '', 0, Checksum.BCC, True)
NOISE = Entry(3.0, IN, Kind.NOISE, '2 bytes outside of any frame', size=2)


@for_all(('entry', 'text'), [
    (COMMAND, '     0.500000 >   1 command  5 to 1, TNS 1234: echo 01 | CRC good | '
              'RETRANSMISSION'),
    (REPLY, '     1.250000 <   1 reply    1 to 5, TNS 1234: 01 | CRC good | 750.0 ms'),
    (DAMAGED, '     2.000000 <   1 damaged  wrong check | BCC BAD'),
    (POLL, '            - ?   0 poll     BCC good'),
    (NOISE, '     3.000000 <     noise    2 bytes outside of any frame'),
    (Entry(0.0, IN, Kind.ACK, latency=0.0, guest='\x1b[2J'),
     '     0.000000 <     ACK      guest \\x1b[2J | 0.0 ms')])
def test_entry_has_its_line_of_text(entry: Entry, text: str) -> None:
    assert text_line(entry) == text


@for_all(('entry', 'shade'), [
    (COMMAND, '\x1b[33m'), (REFUSAL, '\x1b[31m'), (DAMAGED, '\x1b[31m'), (POLL, '\x1b[2m'),
    (NOISE, '\x1b[31m'), (Entry(0.0, IN, Kind.SILENCE), '\x1b[33m'),
    (replace(POLL, valid=False), '\x1b[31m'), (Entry(0.0, IN, Kind.NAK), '\x1b[33m'),
    *((Entry(0.0, IN, kind), '\x1b[31m') for kind in (Kind.UNANSWERED, Kind.UNKNOWN)),
    *((Entry(0.0, IN, kind), '\x1b[2m') for kind in (Kind.ACK, Kind.EOT))])
def test_line_has_the_colour_of_its_kind(entry: Entry, shade: str) -> None:
    assert text_line(entry, colour=True) == f'{shade}{text_line(entry)}\x1b[0m'
    assert text_line(REPLY, colour=True) == text_line(REPLY)


def test_entry_is_told_as_json_with_all_its_fields() -> None:
    assert json.loads(json_line(COMMAND)) == {
        'time': 0.5, 'direction': '>', 'kind': 'command', 'station': 1,
        'text': '5 to 1, TNS 1234: echo 01', 'check': 'CRC', 'valid': True,
        'marks': ['retransmission'], 'dst': 1, 'src': 5, 'command': '06/00', 'sts': 0,
        'tns': 0x1234, 'data': '0001'}
    assert json.loads(json_line(REPLY))['latency_ms'] == 750.0
    at_once = json.loads(json_line(replace(
        REPLY, time=0.0, station=0, latency=0.0, marks=(Mark.DUPLICATE, Mark.STRAY))))
    assert [at_once[name] for name in ('time', 'station', 'latency_ms', 'marks')] == [
        0.0, 0, 0.0, ['duplicate', 'stray']]
    assert json.loads(json_line(NOISE)) == {
        'time': 3.0, 'direction': '<', 'kind': 'noise', 'text': '2 bytes outside of any frame',
        'bytes': 2}


@pytest.fixture
def summary() -> Summary:
    summary = Summary(9600)
    summary.take(Chunk(0.0, OUT, bytes(600)))
    summary.take(Chunk(2.0, IN, bytes(360)))
    for entry in (COMMAND, REPLY, REFUSAL, DAMAGED, replace(POLL, valid=False), NOISE,
                  *(Entry(2.0, IN, kind, station=0, marks=(mark,)) for number, (kind, mark) in
                    enumerate(zip(Kind, 2 * [*Mark]), 1) for _ in range(number))):
        summary.add(entry)
    return summary


def test_summary_counts_what_was_seen_and_what_was_wrong(summary: Summary) -> None:
    head, seen, faults, latency, _, zero, one = summary_lines(summary, HALF)
    assert head == ('summary: 2.0 s, 960 bytes (600 >, 360 <), half duplex, CRC, '
                    'line load 50.0% at 9600 baud')
    assert seen == ('  seen: 3 commands, 5 replies, 1 of them with an error, 2 polls, 6 EOT, '
                    '4 ACK, 5 NAK, 7 ENQ, 14 forwarded')
    assert faults == ('  faults: 10 damaged, 2 bytes of noise, 9 retransmissions, 11 duplicates, '
                      '12 commands without reply, 11 polls and messages without answer')
    assert latency == '  replies after: mean 375.0 ms, max 750.0 ms'
    assert one.split() == ['1', '0', '0', '1', '2', '1', '1', '2', '0', '375.0', '750.0']
    assert zero.split() == ['0', '2', '11', '2', '3', '0', '9', '18', '12', '-', '-']


def test_json_has_all_that_the_summary_tells(summary: Summary) -> None:
    found = json.loads(summary_json(summary, HALF))
    assert {name: found[name] for name in (
        'kind', 'seconds', 'bytes', 'check', 'duplex', 'baud', 'load', 'errors', 'damaged',
        'noise')} == {
            'kind': 'summary', 'seconds': 2.0, 'bytes': {'>': 600, '<': 360}, 'check': 'CRC',
            'duplex': 'half', 'baud': 9600, 'load': 0.5, 'errors': 1, 'damaged': 10, 'noise': 2}
    assert [(station, counts['latency_ms']) for station, counts in found['stations'].items()] == [
        ('0', None), ('1', {'mean': 375.0, 'max': 750.0})]
    assert [*found['counts'].items()] == [*zip((kind.value for kind in Kind), (
        2, 3, 5, 4, 5, 6, 7, 9, 9, 11, 11, 12))]
    assert [*found['marks'].values()] == [9, 11, 12, 14, 16, 18]
    nothing = json.loads(summary_json(Summary(), LineKind(None, None)))
    assert (nothing['check'], nothing['duplex'], nothing['load']) == (None, None, None)


def test_silence_of_a_side_that_was_not_recorded_is_no_fault() -> None:
    """The ACK of a master after its poll shows that the slave has answered."""
    command = bytes.fromhex('10010110020105 0F00EEFE 6800000400060700 0400 1003E24E')
    reply = bytes.fromhex('10020501 4F00EEFE 990909 42D5002D0300000000 10035AC6')
    poll, ack, eot = bytes.fromhex('100501FF'), b'\x10\x06', b'\x10\x04'
    for said, way, is_one_sided in (
            ([command, poll, ack], OUT, True), ([command, poll, ack], Direction.UNKNOWN, True),
            ([command, poll, poll], OUT, False), ([command, ack, poll, eot], IN, False),
            ([ack, reply], IN, True), ([command, ack, poll, reply, ack], IN, False)):
        decoder, summary = TrafficDecoder(Checksum.CRC, Duplex.HALF), Summary()
        for data in said:
            for entry in decoder.feed(Chunk(0.0, way, data)):
                summary.add(entry)
        for entry in decoder.finish():
            summary.add(entry)
        summary.end()
        text = '\n'.join(summary_lines(summary, HALF))
        assert ('only one side of the line was recorded' in text) is is_one_sided, text
        if is_one_sided:
            assert 'faults: none' in text
            assert json.loads(summary_json(summary, HALF))['one_sided']


def test_what_is_not_known_is_left_out() -> None:
    summary = Summary(9600)
    summary.take(Chunk(None, IN, b'x'))
    assert [*summary_lines(summary, LineKind(None, None))] == [
        'summary: 1 byte', '  seen: none', '  faults: none']
    assert json.loads(json_line(POLL)) == {
        'direction': '?', 'kind': 'poll', 'station': 0, 'check': 'BCC', 'valid': True}


def _heard(summary: Summary, begun: float = 10.0) -> Summary:
    summary.take(Chunk(begun, OUT, bytes(300)))
    summary.take(Chunk(begun + 1.0, IN, bytes(180)))
    return summary


@for_all(('baud', 'duplex', 'load'), [
    (9600, Duplex.HALF, 0.5), (9600, Duplex.FULL, 0.3125), (9600, None, 0.5),
    (4800, Duplex.HALF, 1.0), (4000, Duplex.HALF, None), (None, Duplex.HALF, None)])
def test_load_is_known_where_baud_and_duplex_are(
        baud: int | None, duplex: Duplex | None, load: float | None) -> None:
    summary = _heard(Summary(baud))
    assert summary.load(duplex) == load
    assert summary.seconds == 1.0
    assert summary.bytes == {OUT: 300, IN: 180}


def test_recordings_one_after_the_other() -> None:
    summary = _heard(Summary(9600))
    summary.take(Chunk(None, OUT, b''))  # of one without times
    _heard(_heard(summary, 4.0), 2.0)
    assert summary.seconds == 3.0
    assert summary.load(Duplex.HALF) == 0.5
