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

"""pcap and pcapng: our own, PCCC in EtherNet/IP, and files that are damaged."""

from collections.abc import Callable, Sequence
import gzip
import os
from pathlib import Path
import struct

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.pcapng import PcapngWriter
from abdf1_ros.sniffer.report import text_line
from abdf1_ros.sniffer.traffic import TrafficDecoder
import pytest
from support.captures import CAPTURES
from support.cases import for_all

ETHERNET, LOOPBACK, COOKED = 1, 0, 113
NANOSECONDS = bytes.fromhex('0200 0300 65746800 0900 0100 09000000 00000000')

# Recorded of a MicroLogix 1400 (ITI/ICS-Security-Tools, pcaps/CIP/cip_only.pcap, CC-BY-4.0).
STATUS = bytes.fromhex('06 00 63 C5 03')
STATUS_REPLY = bytes.fromhex('46 00 63 C5 00EE4A9F23313736362D4C4543202020000026003682 9EFC01')
STATUS_TEXT = 'MicroLogix 1400 series B revision 4'


def cip(pccc: bytes, is_reply: bool = False) -> bytes:
    """Return Execute PCCC; the requestor has 7 bytes."""
    head = bytes.fromhex('CB 00 00 01 34 12') if is_reply else bytes.fromhex('4B 02 20 67 24 01')
    return head + bytes.fromhex('07 4D 00 78 56 34 12') + pccc


def sent_through(message: bytes, times: int = 1) -> bytes:
    """Return an Unconnected Send of a message to slot 0, packed again and again."""
    for _ in range(times):
        message = (bytes.fromhex('52 02 20 06 24 01 05 F9') + struct.pack('<H', len(message))
                   + message + bytes.fromhex('01 00 01 00'))
    return message


def encapsulated(data: bytes, is_connected: bool = False) -> bytes:
    """Return SendRRData, or with a sequence count SendUnitData."""
    items = b'\0\0\0\0' if not is_connected else bytes.fromhex('A1 00 04 00 01 02 03 04')
    body = b'\x07\0' + data if is_connected else data
    content = (bytes(6) + b'\x02\0' + items + struct.pack(
        '<HH', 0xB1 if is_connected else 0xB2, len(body)) + body)
    return struct.pack('<HH', 0x70 if is_connected else 0x6F, len(content)) + bytes(20) + content


def tcp(payload: bytes, number: int, to_plc: bool = True, flags: int = 0x18,
        net: int = 0) -> bytes:
    """Return a segment in IP; those to the PLC have options in both heads."""
    hosts = bytes((192, 168, 0, 65)), bytes((192, 168, net, 30))
    ports = 50000, 44818
    ways = (hosts, ports) if to_plc else (hosts[::-1], ports[::-1])
    segment = struct.pack('>HHIIBBHHH', *ways[1], number & 0xFFFFFFFF, 0, 0x50 + 0x30 * to_plc,
                          flags, 0, 0, 0) + 12 * to_plc * b'\1'
    size = 40 + 16 * to_plc + len(payload)
    return (struct.pack('>BBHIBBH', 0x45 + to_plc, 0, size, 0x4000, 64, 6, 0)
            + b''.join(ways[0]) + 4 * to_plc * b'\1' + segment + payload)


def ethernet(ip: bytes, vlan: bool = False) -> bytes:
    tags = b'\x88\xA8\0\x03\x81\0\0\x07' if vlan else b''
    return bytes(12) + tags + b'\x08\0' + ip + b'padding'


def pcap(packets: Sequence[tuple[float, bytes]], link_type: int = ETHERNET, order: str = '<',
         magic: int = 0xA1B2C3D4) -> bytes:
    ticks = 10 ** (9 if magic == 0xA1B23C4D else 6)
    return struct.pack(f'{order}IHHIIII', magic, 2, 4, 0, 0, 65535, link_type) + b''.join(
        struct.pack(f'{order}IIII', int(time), round(time % 1 * ticks), len(data), len(data) + 9)
        + data for time, data in packets)


def block(order: str, kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    size = struct.pack(f'{order}I', len(body) + 12)
    return struct.pack(f'{order}I', kind) + size + body + size


def pcapng(packets: Sequence[tuple[float, bytes]], order: str, options: bytes, ticks: float,
           others: int = 0) -> bytes:
    """Return a section; before the interface of the packets come ``others`` of another link."""
    return b''.join((
        block(order, 0x0A0D0D0A, struct.pack(f'{order}IHHq', 0x1A2B3C4D, 1, 0, -1)),
        *others * (block(order, 1, struct.pack(f'{order}HHI', COOKED, 0, 0)),),
        block(order, 1, struct.pack(f'{order}HHI', ETHERNET, 0, 0) + options),
        block(order, 5, bytes(20)),  # statistics
        *(block(order, 6, struct.pack(
            f'{order}5I', others, round(time * ticks) >> 32, round(time * ticks) & 0xFFFFFFFF,
            len(data), len(data) + 9) + data) for time, data in packets)))


def chunks_of(path: Path, content: bytes) -> list[Chunk]:
    path.write_bytes(content)
    return list(Recording(path).chunks())


def entries_of(chunks: Sequence[Chunk]) -> list[Entry]:
    session = TrafficDecoder()
    return [*(entry for chunk in chunks for entry in session.feed(chunk)), *session.finish()]


def exchange(begun: float = 1000.0) -> list[tuple[float, bytes]]:
    return [(begun, ethernet(tcp(encapsulated(cip(STATUS)), 0x1000))),
            (begun + 0.005, ethernet(tcp(encapsulated(cip(STATUS_REPLY, is_reply=True)), 500,
                                         to_plc=False)))]


@for_all('content', [
    pcap(exchange()), pcap(exchange(), order='>'), pcapng(exchange(), '<', b'', 1e6),
    *(pcap(exchange(), 0x54000000 + ETHERNET, order, 0xA1B23C4D) for order in '<>'),
    pcapng(exchange(), '>', b'', 1e6),
    pcapng(exchange(), '<', NANOSECONDS, 1e9, others=1),
    pcapng(exchange()[:1], '>', bytes.fromhex('0009 0001 94000000 00000000'), 2 ** 20)
    + block('>', 3, bytes(4)) + pcapng(exchange()[1:], '<', NANOSECONDS, 1e9)])
def test_pccc_of_a_real_processor_is_told_in_words(tmp_path: Path, content: bytes) -> None:
    command, reply = entries_of(chunks_of(tmp_path / 'x', content))
    assert text_line(command) == ('     0.000000 >  30 command  65 to 30, TNS C563: '
                                  'diagnostic status')
    assert (reply.kind, reply.station, reply.valid) == (Kind.REPLY, 30, None)
    assert STATUS_TEXT in reply.text
    assert reply.latency == pytest.approx(0.005, abs=2e-6)


def test_packets_that_the_recorder_has_cut_are_told_and_others_read(tmp_path: Path) -> None:
    packets = exchange()
    whole = exchange(1001.0)
    others = (1000.0, packets[0][1].replace((44818).to_bytes(2, 'big'), b'\0\x50'))
    cut = [(time, data[:90 + at]) for at, (time, data) in enumerate((*packets, others))]
    with pytest.raises(Problem, match='2 packets cut by the recorder, at 91 bytes: what was in '
                                      'them is missing; record whole packets'):
        chunks_of(tmp_path / 'x', pcap(cut))
    (tmp_path / 'y').write_bytes(pcap(cut + whole))
    recorded = Recording(tmp_path / 'y').chunks()
    assert [next(recorded).direction, next(recorded).direction] == [Direction.OUT, Direction.IN]
    with pytest.raises(Problem, match='2 packets cut'):
        next(recorded)


@pytest.mark.parametrize('data', [
    encapsulated(cip(STATUS), is_connected=True), encapsulated(sent_through(cip(STATUS))),
    encapsulated(sent_through(cip(STATUS), 2000)),
    b''.join(bytes((command, *23 * [0])) for command in (0, 1, 4, *range(0x63, 0x67), 0x72, 0x73))
    + encapsulated(bytes.fromhex('4B 03 21 00 67 00 24 01 03 4D 00') + STATUS)])
def test_pccc_comes_connected_and_through_a_backplane(tmp_path: Path, data: bytes) -> None:
    chunk, = chunks_of(tmp_path / 'x', pcap([(0.0, ethernet(tcp(data, 1).replace(
        b'\xA8\0\x41', b'\xA8\1\x1E'), vlan=True))]))  # from 192.168.1.30 to 192.168.0.30
    assert chunk == Chunk(0.0, Direction.OUT, bytes((30, 254)) + STATUS, is_message=True)


@pytest.mark.parametrize(('link_type', 'head'), [
    (LOOPBACK, b'\2\0\0\0'), (101, b''), (COOKED, bytes(14) + b'\x08\0'),
    (276, b'\x08\0' + bytes(18))])
def test_packets_come_over_any_usual_link(tmp_path: Path, link_type: int, head: bytes) -> None:
    packet = head + tcp(encapsulated(cip(STATUS + bytes(240))), 1)
    assert len(chunks_of(tmp_path / 'x', pcap([(0.0, packet)], link_type))) == 1


def test_segments_are_put_together_and_those_that_come_again_are_dropped(tmp_path: Path) -> None:
    data = encapsulated(cip(STATUS))
    again = encapsulated(cip(STATUS[:2] + b'\1\0' + STATUS[4:]))
    parts = [(b'', -1, 0x02), (data[:10], 0, 0x18), (data[:10], 0, 0x18), (data[5:30], 5, 0x18),
             (data[30:] + again + 30 * b'\2', 30, 0x18), (data, 0, 0x18),
             (b'lost before this', 9999, 0x18), (data, 20000, 0x18),
             (data[:40], 21000, 0x18), (data[40:], 21040, 0x18),  # what is complete at its end
             (b'', 4999, 0x02), (data, 5000, 0x18)]  # the same ports in a later connection
    packets = [(100.0 + at, ethernet(tcp(part, 0xFFFFFFF0 + number, flags=flags)))
               for at, (part, number, flags) in enumerate(parts)]
    found = chunks_of(tmp_path / 'x', pcap(packets))
    assert [(chunk.time, chunk.data[4:6].hex()) for chunk in found] == [
        (4.0, '63c5'), (4.0, '0100'), (7.0, '63c5'), (10.0, '63c5'),
        (11.0, '63c5')]
    halves = [(0.0, ethernet(tcp(data, 0))), (0.5, ethernet(tcp(data, 971))), *(
        (float(at), ethernet(tcp([data[29:], data[:29]][at % 2], 1000 + 29 * at)))
        for at in range(1, 11))]  # after a loss, nobody waits for more than eight segments
    assert [chunk.time for chunk in chunks_of(tmp_path / 'x', pcap(halves))] == [
        0, 0.5, *4 * [8], 10]


@for_all(('cuts', 'found'), [  # 58 bytes a message; found are messages, and their times
    ([(0, 0), (90, 200), (0, 60), (60, 90), (200, 232)], ((0, 2), (1, 3), (2, 3), (3, 4))),
    ([(0, 30), (116, 174), (116, 174), (174, 200), (30, 116), (200, 232), (232, 232)],  # 2 twice
     ((2, 1), (0, 4), (1, 4), (3, 5))),
    ([(0, 30), *((at, at) for at in range(99, 109)), (30, 99), (99, 232)],  # without data
     ((0, 11), (1, 12), (2, 12), (3, 12))),
    ([(0, 30), (58, 200), (200, 232)], ((1, 2), (2, 2), (3, 2)))])  # the rest of 0 is lost
def test_segments_that_come_out_of_order_lose_no_message(
        tmp_path: Path, cuts: list[tuple[int, int]], found: tuple[tuple[int, int], ...]) -> None:
    whole = b''.join(encapsulated(cip(STATUS[:2] + bytes((number, 1)) + STATUS[4:]))
                     for number in range(4))
    packets = [(100.0 + at, ethernet(tcp(whole[first:end], 0xFFFFFF80 + first)))
               for at, (first, end) in enumerate(cuts)]
    assert [(chunk.data[4], chunk.time)
            for chunk in chunks_of(tmp_path / 'x', pcap(packets))] == [*found]


@pytest.mark.parametrize(('count', 'found'), [(1000, 1), (1001, 0)])
def test_unfinished_messages_of_a_thousand_connections_are_kept(
        tmp_path: Path, count: int, found: int) -> None:
    data = encapsulated(cip(STATUS))
    parts = [*((port, data[:40], 0) for port in range(count)), (0, data[40:], 40)]
    packets = [(0.0, ethernet(tcp(part, number).replace(b'\xC3\x50', port.to_bytes(2, 'big'))))
               for port, part, number in parts]
    assert len(chunks_of(tmp_path / 'x', pcap([*packets, exchange()[0]]))) == found + 1


def test_two_plcs_whose_addresses_end_alike_are_two_stations(tmp_path: Path) -> None:
    packets = [(0.0, ethernet(tcp(encapsulated(cip(STATUS)), 1))),
               (0.1, ethernet(tcp(encapsulated(cip(STATUS)), 1, net=7))),
               (0.1, ethernet(tcp(encapsulated(cip(b'\6\0\1\0\3')), 59, net=7))),  # at once
               (0.2, ethernet(tcp(encapsulated(cip(STATUS_REPLY[:4], True)), 9, False, net=7))),
               (0.3, ethernet(tcp(encapsulated(cip(b'\x46\0\2\0', True)), 66, False, net=7)))]
    entries = entries_of(chunks_of(tmp_path / 'x', pcap(packets)))
    assert [(entry.kind, entry.station) for entry in entries if entry.packet] == [
        (Kind.COMMAND, 30), (Kind.COMMAND, 254), (Kind.COMMAND, 254), (Kind.REPLY, 254),
        (Kind.UNANSWERED, 30), (Kind.UNANSWERED, 254)]
    assert not any(entry.marks for entry in entries)


def test_packed_files_are_read_and_damage_is_told(tmp_path: Path) -> None:
    packed = gzip.compress(pcap(exchange()))
    assert len(chunks_of(tmp_path / 'x', packed)) == 2
    for damaged in (packed[:-20], packed[:30] + bytes(40), packed[:10] + 60 * b'\xff'):
        with pytest.raises(Problem, match='damaged gzip file'):
            chunks_of(tmp_path / 'x', damaged)


def test_what_sniff_has_written_is_read_as_it_was(tmp_path: Path) -> None:
    for capture in CAPTURES[:6]:
        writer = PcapngWriter(str(tmp_path / 'own'))
        session = TrafficDecoder()
        entries = [entry for chunk in capture.chunks for entry in session.feed(chunk)]
        writer.begin('2026-11-23T00:00:00+00:00')
        for entry in entries:
            writer.write(entry)
        writer.close()
        said = [entry for entry in entries if entry.wire]
        read = list(Recording(tmp_path / 'own').chunks())
        assert [chunk.data for chunk in read] == [entry.wire for entry in said]
        again = [entry for entry in entries_of(read) if entry.wire]
        assert [(entry.kind, entry.wire, entry.text) for entry in again] == [
            (entry.kind, entry.wire, entry.text) for entry in said]
    other = pcap([(0.0, b'\1\1\0\0'), (0.0, b'\1\7\0\0\x10\6')], 147)
    assert chunks_of(tmp_path / 'other', other) == [
        Chunk(0.0, Direction.UNKNOWN, b'\x10\6')]


def test_serial_port_recorded_by_an_rtac_is_read(tmp_path: Path) -> None:
    """A write with BCC after which nothing comes (samt707/ambersloth, df1_orig_half_duplex)."""
    sent = bytes.fromhex('1002 0000 0F00 0139 AA02 0789 0500 4934'), bytes.fromhex('1003F9')
    head = bytes.fromhex('5BBE0468 00016378')
    packets = [(event * 32.0, head + bytes((code, 0, 0, 0)) + part) for event in (1, 2, 3, 4)
               for code, part in ((event, sent[0]), (event, sent[1]), (0, b'x'))]
    packets += (100.0, b'short'), (100.0, head + b'\1\0\0\0')
    entries = entries_of(chunks_of(tmp_path / 'x', pcap(packets, link_type=250)))
    commands = [entry for entry in entries if entry.kind is Kind.COMMAND]
    assert [entry.text for entry in commands] == [
        '0 to 0, TNS 3901: protected typed logical write N7:5 = 13385'] * 4
    assert not any(entry.kind is Kind.NOISE for entry in entries)
    simple = chunks_of(tmp_path / 'simple', b''.join((  # whose packets are filled up to words
        pcapng([], '<', b'', 1e6).partition(block('<', 1, struct.pack('<HHI', ETHERNET, 0, 0)))[0],
        *(block('<', 1, struct.pack('<HHI', link_type, 0, 0)) for link_type in (250, COOKED)),
        *(block('<', 3, struct.pack('<I', len(data)) + data) for _, data in packets))))
    assert [chunk[1:3] for chunk in simple] == 2 * [
        (way, part) for way in (Direction.OUT, Direction.IN) for part in sent]


@for_all(('content', 'fault'), [
    (pcap(exchange())[:-5], 'byte 329: the file ends inside a packet'),
    (pcap([])[:20], 'byte 20: the file ends inside a packet'),
    (pcap([]) + bytes(7), 'byte 31: the file ends inside a packet'),
    (pcap([]) + struct.pack('<4I', 0, 0, 1_000_001, 0), 'a size of 1000001 bytes'),
    (pcap([]) + struct.pack('<4I', 0, 0, 1_000_000, 0), 'byte 40: the file ends inside a packet'),
    (pcap([(0.0, b'x')]), 'byte 41: no packet up to here has DF1'),
    (pcapng([], '<', b'', 1e6) + block('<', 6, struct.pack('<5I', 7, 0, 0, 0, 0)),
     'a packet without its interface'),
    (pcapng([], '<', b'', 1e6) + block('<', 6, bytes(16)), 'a packet without its interface'),
    (pcapng([], '<', b'', 1e6) + block('<', 1, b'') + struct.pack('<2I', 6, 5), 'size of -7')])
def test_damage_is_told_with_its_place(tmp_path: Path, content: bytes, fault: str) -> None:
    with pytest.raises(Problem) as problem:
        chunks_of(tmp_path / 'x', content)
    assert fault in str(problem.value)


def test_csp_is_named(tmp_path: Path) -> None:
    packet = tcp(bytes(40), 0).replace((44818).to_bytes(2, 'big'), (2222).to_bytes(2, 'big'))
    with pytest.raises(Problem, match='; TCP port 2222 is CSP, which is not decoded'):
        chunks_of(tmp_path / 'x', pcap([(0.0, ethernet(packet)), (0.1, ethernet(packet.replace(
            (2222).to_bytes(2, 'big'), b'\0\x50')))]))


@for_all('packet', [
    ethernet(tcp(encapsulated(cip(STATUS)), 0).replace(b'\x40\0\x40', b'\x20\0\x40')),  # a part
    ethernet(tcp(encapsulated(cip(STATUS)), 0).replace(b'\x40\0\x40', b'\0\1\x40')),  # its end
    b'', bytes(14), ethernet(b''), ethernet(bytes(60)), ethernet(tcp(b'', 0)[:30]),
    ethernet(tcp(bytes(100), 0)), ethernet(tcp(encapsulated(b''), 0)),
    ethernet(tcp(encapsulated(bytes.fromhex('4B 02 20 67 24 01')), 0)),
    ethernet(tcp(encapsulated(bytes.fromhex('52 02 20 06 24 01 05 F9 00 00')), 0)),
    ethernet(tcp(encapsulated(cip(b'\x06')), 0)),
    ethernet(tcp(encapsulated(cip(STATUS).replace(b'\x4B\x02', b'\x4C\x02')), 0)),
    ethernet(tcp(encapsulated(cip(STATUS).replace(b'\x20\x67', b'\x20\x04')), 0)),
    ethernet(tcp(encapsulated(cip(STATUS, is_reply=True)), 0, to_plc=False)),
    ethernet(tcp(encapsulated(cip(STATUS)), 0).replace(b'\xAF\x12', b'\x01\x02'))])
def test_other_packets_are_passed_over(tmp_path: Path, packet: bytes) -> None:
    found = chunks_of(tmp_path / 'x', pcap([(0.0, packet), *exchange()]))
    assert [chunk.is_message for chunk in found] == [True, True]


POLL, EOT = bytes.fromhex('100501FF'), b'\x10\x04'


def to_server(data: bytes, number: int, to_plc: bool = True, port: int = 4001, flags: int = 0x18,
              net: int = 0, host: int = 65) -> bytes:
    """Return a segment to a device server, or from it, in Ethernet."""
    segment = tcp(data, number, to_plc, flags, net)
    return ethernet(segment.replace((44818).to_bytes(2, 'big'), port.to_bytes(2, 'big')).replace(
        bytes((192, 168, net, 30)), bytes((192, 168, net, host))))


@for_all('port', [4001, 2101])
def test_bytes_of_a_device_server_come_in_their_order(tmp_path: Path, port: int) -> None:
    """One host may have both ends, as with a recording on 127.0.0.1: the port tells the server."""
    parts = [(b'', -1, True, 0x02), (POLL[:2], 0, True, 0x18), (b'\xFF', 3, True, 0x18),
             (POLL[1:3], 1, True, 0x18), (POLL[:2], 0, True, 0x18), (EOT, 7000, False, 0x18),
             (b'', 4, True, 0x10), (EOT, 7000, False, 0x18), (b'', 99, True, 0x02),
             (POLL, 100, True, 0x18)]
    packets = [(100.0 + at, to_server(data, 0xFFFFFFFE + number, to_plc, port, flags))
               for at, (data, number, to_plc, flags) in enumerate(parts)]
    assert chunks_of(tmp_path / 'x', pcap(packets)) == [
        Chunk(1.0, Direction.OUT, POLL[:2]), Chunk(3.0, Direction.OUT, POLL[2:]),
        Chunk(5.0, Direction.IN, EOT), Chunk(9.0, Direction.OUT, POLL)]


def test_bytes_that_were_not_recorded_do_not_hold_up_those_after_them(tmp_path: Path) -> None:
    packets = [(0.0, to_server(POLL, 0)), *((float(at), to_server(POLL, 100 + 8 * at))
                                            for at in range(1, 12))]
    found = chunks_of(tmp_path / 'x', pcap(packets))
    assert b''.join(chunk.data for chunk in found) == 12 * POLL
    assert found[1].time == 9.0  # nobody waits for more than eight segments


def test_port_of_a_device_server_is_given_or_asked_for(tmp_path: Path) -> None:
    path = tmp_path / 'x'
    path.write_bytes(pcap([(0.0, to_server(POLL, 0, port=950))]))
    with pytest.raises(Problem, match='seen are TCP ports 950, 50000: give that of a device serv'):
        list(Recording(path).chunks())
    assert list(Recording(path, servers=frozenset((950,))).chunks()) == [
        Chunk(0.0, Direction.OUT, POLL)]


def tshark_x(packet: bytes) -> list[str]:
    return [f'{at:04x}  {packet[at:at + 16].hex(" "):<47}   {characters(packet[at:at + 16])}'
            for at in range(0, len(packet), 16)]


def tcpdump_upper_x(packet: bytes) -> list[str]:
    return [f'\t0x{at:04x}:  {packet[at:at + 16].hex(" ", -2):<39}  '
            f'{characters(packet[at:at + 16])}' for at in range(0, len(packet), 16)]


def tcpdump_x(packet: bytes) -> list[str]:
    return [line[:49].rstrip() for line in tcpdump_upper_x(packet)]


def characters(data: bytes) -> str:
    return ''.join(chr(byte) if 32 <= byte < 127 else '.' for byte in data)


# A poll to 192.168.1.20:4001; the sum of its header was computed by hand.
IP = bytes.fromhex('4500 002C 0001 4000 4006 B75C C0A8010A C0A80114'
                   'C350 0FA1 000003E8 00001388 5018 0200 0000 0000 100501FF')
LINKS = {'Ethernet': bytes(12) + b'\x08\0', 'a tag': bytes(12) + b'\x81\0\0\7\x08\0',
         'cooked': bytes(14) + b'\x08\0', 'loopback': b'\2\0\0\0'}


@for_all('dump', [tshark_x, tcpdump_x, tcpdump_upper_x])
def test_text_of_whole_packets_is_refused_with_the_way_out(
        tmp_path: Path, dump: Callable[[bytes], list[str]]) -> None:
    """Otherwise IP headers would be noise, and the answers would lack their directions."""
    head = '14:05:09.120000 IP 192.168.1.10.50000 > 192.168.1.20.4001: Flags [P.], length 4'
    for packet in (IP, *(link + IP for link in LINKS.values()),
                   LINKS['Ethernet'] + IP[:10] + bytes(2) + IP[12:]):  # the card adds the sum
        text = '\n'.join([*dump(bytes(12) + b'\x08\x06' + bytes(28)), head, *dump(packet), ''])
        with pytest.raises(Problem, match='whole packets .* "tshark -w" .* text2pcap'):
            chunks_of(tmp_path / 'x', text.encode())


@for_all('wire', [
    IP[:12], IP[1:], bytes.fromhex('1002 0001 4F00 3412 0100 0000 0006 0000 0000') + bytes(60),
    bytes.fromhex('1002 0001 4600 3412 0800 0000 0006 0000') + bytes(60)])
def test_dump_of_a_line_is_not_taken_for_packets(tmp_path: Path, wire: bytes) -> None:
    found = chunks_of(tmp_path / 'x', '\n'.join(tshark_x(wire)).encode())
    assert b''.join(chunk.data for chunk in found) == wire


def test_two_device_servers_are_two_lines(tmp_path: Path) -> None:
    for port, host, other in ((2101, 30, '192.168.0.30:2101'), (4001, 31, '192.168.0.31:4001')):
        packets = [(0.0, to_server(POLL, 0, host=30)),
                   (0.1, to_server(POLL, 0, port=port, host=host))]
        with pytest.raises(Problem, match=f'byte .* 192.168.0.30:4001 and {other} are two lines'):
            chunks_of(tmp_path / 'x', pcap(packets))
    cut = to_server(POLL, 0)[:-10]
    with pytest.raises(Problem, match='1 packet cut by the recorder'):
        chunks_of(tmp_path / 'x', pcap([(0.0, cut)]))


FTDI = bytes.fromhex('12 01 0002 00 00 00 08 0304 0160 0006 01 02 03 01')
# A configuration whose end 81 has packets of 64 bytes.
ENDS = bytes.fromhex('09 02 2000 01 01 00 A0 2D 09 04 00 00 02 FF FF FF 02 07 05 81 02 4000 00 '
                     '07 05 02 02 4000 00')
USB = 220


def urb(event: str, end: int, data: bytes, transfer: int = 3, device: int = 5, setup: str = '',
        head: int = 64, number: int = 1) -> bytes:
    """Return a packet of usbmon, as Documentation/usb/usbmon.rst of Linux has it."""
    return struct.pack('<QcBBBHBBqiiII8s', number, event.encode(), transfer, end, device, 1,
                       0 if setup else 45, 0, 0, 0, 0, len(data), len(data),
                       bytes.fromhex(setup)).ljust(head, b'\0') + data


def described(descriptor: bytes, kind: int, device: int = 5) -> list[bytes]:
    return [urb('S', 0x80, b'', 2, device, f'80 06 00 {kind:02x} 00 00 12 00', number=77),
            urb('C', 0x80, descriptor, 2, device, number=77)]


def recorded(path: Path, packets: Sequence[bytes], link_type: int = USB) -> list[Chunk]:
    return chunks_of(path, pcap([*enumerate(packets)], link_type))


def test_status_bytes_of_ftdi_are_taken_off_each_packet(tmp_path: Path) -> None:
    said = bytes(range(100))
    sent = b'\x01\x60' + said[:62] + b'\x01\x60' + said[62:]
    for head, link_type in ((64, USB), (48, 189)):
        talk = [urb('S', 2, POLL, head=head), urb('C', 2, b'', head=head),
                urb('S', 0x81, b'', head=head), urb('C', 0x81, b'\x01\x60', head=head),
                urb('C', 0x81, sent, head=head)]
        heads = [packet[:48].ljust(head, b'\0') + packet[64:] for packet in (
            *described(FTDI, 1), *described(ENDS, 2))]
        assert [chunk[1:3] for chunk in recorded(tmp_path / 'x', [*heads, *talk], link_type)] == [
            (Direction.OUT, POLL), (Direction.IN, said)]
    fast = FTDI[:12] + b'\x00\x09' + FTDI[14:]  # an FT232H, with packets of 512 bytes
    found = recorded(tmp_path / 'x', [*described(fast, 1), urb('C', 0x81, sent)])
    assert [chunk.data for chunk in found] == [sent[2:]]


def test_adapters_of_others_send_no_status_bytes(tmp_path: Path) -> None:
    other = FTDI[:8] + b'\x86\x1A' + FTDI[10:]
    packets = [*described(other, 1), urb('C', 0x81, EOT), urb('C', 0x83, b'\1', 1), b'short']
    assert [chunk.data for chunk in recorded(tmp_path / 'x', packets)] == [EOT]


@for_all(('packets', 'text'), [
    ([urb('C', 0x81, EOT)], 'USB device 1.5: its descriptors are not in the recording'),
    ([*described(FTDI, 1, 4), urb('S', 2, POLL)], 'begin the recording before you plug the ada'),
    ([*described(FTDI, 1), urb('S', 2, POLL), *described(FTDI, 1, 6), urb('S', 2, POLL, device=6)],
     'the USB devices 1.5 and 1.6 both have bulk data')])
def test_usb_whose_bytes_are_not_known_is_refused(
        tmp_path: Path, packets: list[bytes], text: str) -> None:
    with pytest.raises(Problem, match=text):
        recorded(tmp_path / 'x', packets)


# Section: little endian, version 1.0, length not given. Interface: USER0, no limit, name "DF1".
HEAD = bytes.fromhex(
    '0A0D0D0A 1C000000 4D3C2B1A 0100 0000 FFFFFFFFFFFFFFFF 1C000000'
    '01000000 20000000 9300 0000 00000000 0200 0300 44463100 0000 0000 20000000')


def written(path: Path, *entries: Entry, begun: str = '') -> bytes:
    writer = PcapngWriter(str(path))
    for moment in ('2000-01-01T00:00:00+00:00', begun):
        writer.begin(moment)
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
    for time, told in (None, bytes(8)), (-0.5, bytes(8)), (1e30, b'\xFF' * 8):
        ack = Entry(time, Direction.OUT, Kind.ACK, wire=b'\x10\x06')
        assert written(tmp_path / 'x', ack, begun='yesterday')[len(HEAD):][12:20] == told


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
