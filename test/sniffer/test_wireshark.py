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

"""
The dissector against sniff: tshark and --json say the same of every recorded byte.

What stands on the line goes to tshark as it was heard, so both take it apart by themselves.
"""

from collections.abc import Iterable
import json
from pathlib import Path
from random import Random
import shutil
import subprocess
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import message_frame
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Mark
from abdf1_ros.sniffer.pcapng import PcapngWriter
from abdf1_ros.sniffer.report import json_line
from abdf1_ros.sniffer.traffic import TrafficDecoder
import pytest
from support.captures import CAPTURES
from support.vectors import load_json, VECTORS

_SCRIPT = Path(__file__).resolve().parents[2] / 'wireshark' / 'abdf1.lua'
_FIELDS = (
    'direction', 'kind', 'check', 'valid', 'computed', 'station', 'dst', 'src', 'sts', 'tns',
    'code', 'data', 'command', 'address', 'status', 'request', 'latency', 'copy_of')
_ADDRESSED = (
    '00', '01', '02', '05', '08', '0F/00', '0F/01', '0F/02', '0F/04', '0F/26', '0F/67', '0F/68',
    '0F/A1', '0F/A2', '0F/A9', '0F/AA', '0F/AB')
_BEGUN = '2026-11-22T03:00:00+00:00'
_BEGUN_SECONDS = 1795316400.0

pytestmark = pytest.mark.skipif(shutil.which('tshark') is None, reason='there is no tshark')


def dissected(path: Path, entries: Iterable[Entry]) -> list[dict[str, str]]:
    """Return what tshark says of entries, by field; empty for what a packet does not have."""
    writer = PcapngWriter(str(path))
    writer.begin(_BEGUN)
    for entry in entries:
        writer.write(entry)
    writer.close()
    names = ['frame.time_epoch', 'frame.packet_flags_direction', '_ws.expert.message',
             *(f'abdf1.{name}' for name in _FIELDS)]
    done = subprocess.run(
        ['tshark', '-X', f'lua_script:{_SCRIPT}', '-r', str(path), '-T', 'fields', '-E',
         'separator=/t', '-E', 'occurrence=f', *(word for name in names for word in ('-e', name))],
        capture_output=True, text=True, check=True, timeout=120)
    return [dict(zip(names, line.split('\t'))) for line in done.stdout.splitlines()]


def number(text: str) -> int | None:
    """Return a number as tshark writes it."""
    return int(text, 0) if text else None


def assert_same(told: dict[str, str], entry: Entry) -> None:
    """Compare what tshark says of a packet with what sniff says."""
    said: dict[str, Any] = json.loads(json_line(entry))
    field = {name: told[f'abdf1.{name}'] for name in _FIELDS}
    assert 'Lua Error' not in told['_ws.expert.message'], told
    assert float(told['frame.time_epoch']) == pytest.approx(
        _BEGUN_SECONDS + said.get('time', 0.0), abs=2e-6)
    assert (field['direction'], field['kind']) == (said['direction'], said['kind'])
    assert told['frame.packet_flags_direction'] in {
        '>': ('0x00000002', '2'), '<': ('0x00000001', '1'), '?': ('0x00000000', '0')}[
            said['direction']]
    assert (field['check'] or None) == said.get('check')
    verdict = {'1': True, 'True': True, '0': False, 'False': False, '': None}
    assert verdict[field['valid']] is verdict[field['computed']] is said.get('valid')
    if said['kind'] not in ('command', 'reply'):
        return
    for name in ('dst', 'src', 'sts', 'tns'):
        assert number(field[name]) == said[name], name
    assert field['code'] == said['command']
    assert field['data'].replace(':', '') == said['data']
    text = said['text'].partition(': ')[2]
    if said['kind'] == 'reply':
        if said['sts']:
            assert field['status'] and text.startswith(field['status'])
        return
    assert text.startswith(field['command'] or 'command ')
    if said['command'] in _ADDRESSED and 'malformed' not in text:
        assert field['address'], text
    is_ascii = f'${field["address"]}'.encode().hex() in said['data']  # sniff drops its letter
    if field['address'] and 'malformed' not in text and not is_ascii:
        place = text.removeprefix(field['command']).strip()
        assert place.startswith(field['address']), (place, field['address'])


def assert_all_same(path: Path, entries: Iterable[Entry],
                    is_one_line: bool = True) -> list[dict[str, str]]:
    """Compare all of them, latencies where they are of one line; return what tshark has said."""
    on_line = [entry for entry in entries if entry.wire]
    told = dissected(path, on_line)
    assert len(told) == len(on_line)
    for fields, entry in zip(told, on_line):
        assert_same(fields, entry)
        if is_one_line:
            latency = fields['abdf1.latency']
            assert (float(latency) if latency else None) == (
                entry.latency and pytest.approx(entry.latency, abs=2e-5)), (fields, entry)
    return told


def test_dissector_tells_every_capture_as_we_do(tmp_path: Path) -> None:
    entries = [entry for capture in CAPTURES for entry in capture.entries]
    assert_all_same(tmp_path / 'line.pcapng', entries)


def test_by_radio_a_copy_is_that_of_the_first_and_a_reply_answers_that(tmp_path: Path) -> None:
    capture, = (entry for entry in CAPTURES if entry.name.startswith('radio'))
    entries = [entry for entry in capture.entries if entry.wire]
    told = assert_all_same(tmp_path / 'line.pcapng', entries)
    copies = [fields for fields in told if fields['abdf1.copy_of']]
    assert len(copies) == 43
    for fields, entry in zip(told, entries):
        assert bool(fields['abdf1.copy_of']) is bool(entry.marks)
    for fields in copies:
        first = told[int(fields['abdf1.copy_of']) - 1]
        assert [fields[f'abdf1.{name}'] for name in ('dst', 'src', 'tns', 'data')] == [
            first[f'abdf1.{name}'] for name in ('dst', 'src', 'tns', 'data')]


def test_repeated_late_and_wrong_messages_have_the_latency_that_we_tell(tmp_path: Path) -> None:
    random, time = Random(42), 1.0
    session, entries = TrafficDecoder(Checksum.BCC), list[Entry]()
    for _ in range(400):
        way = random.choice((Direction.OUT, Direction.IN))
        cmd = 0x0F if way is Direction.OUT else random.choice((0x4F,) * 9 + (0x46,))
        # A read of N7:0 or N7:1, or the two words that may be there.
        data = bytes.fromhex('A202078900' + random.choice(('00', '01')) if cmd == 0x0F else '0100')
        packet = Packet(way is Direction.OUT, way is Direction.IN, cmd, 0, random.randrange(3),
                        data)
        frame = message_frame(packet.encode(), Checksum.BCC)
        for direction, said, chance in ((way, frame, 1.0), (way.opposite, b'\x10\x06', 0.8),
                                        (way, frame, 0.3)):
            if random.random() < chance:
                time += random.choice((0.01,) * 20 + (0.5, 3.0, 11.0))
                entries += session.feed(Chunk(time, direction, said))
    assert_all_same(tmp_path / 'line.pcapng', entries)
    assert sum(entry.latency is not None for entry in entries) > 50
    assert {mark for entry in entries for mark in entry.marks} == {
        Mark.RETRANSMISSION, Mark.DUPLICATE, Mark.STRAY, Mark.WRONG_COMMAND}


def test_every_frame_of_the_vectors(tmp_path: Path) -> None:
    entries: list[Entry] = []
    for vector in VECTORS:
        session = TrafficDecoder(vector.checksum, vector.duplex)
        entries += session.feed(Chunk(1.0, Direction.OUT, vector.frame))
        entries += (entry for entry in session.finish() if entry.wire)
    assert_all_same(tmp_path / 'line.pcapng', entries, is_one_line=False)


def test_dissector_tells_every_command_of_the_vectors_as_we_do(tmp_path: Path) -> None:
    entries: list[Entry] = []
    session = TrafficDecoder(Checksum.BCC)
    exchanges = load_json('exchanges.json')['exchanges']
    for exchange in exchanges:
        for direction, name in ((Direction.OUT, 'command'), (Direction.IN, 'reply')):
            frame = message_frame(bytes.fromhex(exchange[name]), Checksum.BCC)
            entries += session.feed(Chunk(2.5, direction, frame))
    assert len(assert_all_same(tmp_path / 'line.pcapng', entries)) == 2 * len(exchanges)
