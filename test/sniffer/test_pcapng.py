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

"""Packets for Wireshark: the blocks of draft-ietf-opsawg-pcapng, written out by hand."""

import os
from pathlib import Path

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.sniffer.capture import Direction
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.pcapng import PcapngWriter
import pytest

# Section: little endian, version 1.0, length not given. Interface: USER0, no limit, name "DF1".
HEAD = bytes.fromhex(
    '0A0D0D0A 1C000000 4D3C2B1A 0100 0000 FFFFFFFFFFFFFFFF 1C000000'
    '01000000 20000000 9300 0000 00000000 0200 0300 44463100 0000 0000 20000000')


def written(path: Path, *entries: Entry, begun: str = '') -> bytes:
    writer = PcapngWriter(str(path))
    writer.begin(begun)
    for entry in entries:
        writer.write(entry)
    writer.close()
    return path.read_bytes()


def test_a_packet_has_time_bytes_and_direction(tmp_path: Path) -> None:
    ack = Entry(1.5, Direction.OUT, Kind.ACK, wire=b'\x10\x06')
    # 1.5 s after 1970 is 0x16E360 microseconds; 6 bytes and 2 of padding; outbound.
    assert written(tmp_path / 'x', ack, begun='1970-01-01T00:00:00+00:00') == HEAD + bytes.fromhex(
        '06000000 34000000 00000000 00000000 60E31600 06000000 06000000'
        '01 01 00 00 10 06 0000 0200 0400 02000000 0000 0000 34000000')


@pytest.mark.parametrize(('entry', 'head', 'flags'), [
    (Entry(0.0, Direction.IN, Kind.POLL, checksum=Checksum.BCC, valid=True, wire=b'abcd'),
     '01020101', '01000000'),
    (Entry(0.0, Direction.UNKNOWN, Kind.DAMAGED, checksum=Checksum.CRC, valid=False,
           wire=b'abcd'), '01000202', '00000000')])
def test_before_the_bytes_stand_direction_check_and_verdict(
        tmp_path: Path, entry: Entry, head: str, flags: str) -> None:
    packet = written(tmp_path / 'x', entry)[len(HEAD):]
    assert packet[28:36] == bytes.fromhex(head) + b'abcd'
    assert packet[40:44] == bytes.fromhex(flags)


def test_what_nobody_said_is_no_packet(tmp_path: Path) -> None:
    assert written(tmp_path / 'x', Entry(0.0, Direction.IN, Kind.SILENCE),
                   Entry(0.0, Direction.IN, Kind.NOISE, size=3)) == HEAD


def test_time_of_day_that_is_none_counts_from_0(tmp_path: Path) -> None:
    ack = Entry(None, Direction.OUT, Kind.ACK, wire=b'\x10\x06')
    packet = written(tmp_path / 'x', ack, begun='yesterday')[len(HEAD):]
    assert packet[12:20] == bytes(8)


def test_only_a_file_of_ours_is_replaced_and_nobody_else_may_read_it(tmp_path: Path) -> None:
    path = tmp_path / 'x'
    written(path, Entry(0.0, Direction.OUT, Kind.ACK, wire=b'\x10\x06'))
    assert written(path) == HEAD
    assert path.stat().st_mode & 0o007 == 0
    for content in (b'mine', HEAD.replace(b'DF1', b'eth')):  # also a capture of Wireshark
        path.write_bytes(content)
        with pytest.raises(OSError, match='exists and was not made by --pcapng'):
            PcapngWriter(str(path))
        assert path.read_bytes() == content


def test_a_named_pipe_is_written_as_it_goes(tmp_path: Path) -> None:
    path = tmp_path / 'pipe'
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    writer = PcapngWriter(str(path))
    assert os.read(reader, 1000) == HEAD
    writer.write(Entry(0.0, Direction.OUT, Kind.ACK, wire=b'\x10\x06'))
    assert b'\x10\x06' in os.read(reader, 1000)
    writer.close()
    os.close(reader)
