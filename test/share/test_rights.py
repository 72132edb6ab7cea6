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
What each right lets through, judged by the bytes that reach a PLC of its own code.

A guest's frames, and the PLC behind the bridge, share no code with the package.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import GuestListener
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.scaling import Scaling
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.guest_line import GuestLine
import pytest
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import ACK, frame, OddDevice, Wiring

READ, WRITE, ALL = ShareAccess
NOT_ALLOWED, NO_REPLY, SILENT, BAD_VALUE = 0x60, 0x05, 0x07, 0xF0

# Name, the least right, and the command: CMD and what follows TNS. The map has one row, N7:0 of an
# SLC. Manual: 1770-6.5.16. PLC-5 section 1 is its program (M 13-13 has only section 0).
COMMANDS: tuple[tuple[str, ShareAccess, str], ...] = (
    ('echo', READ, '06 00 AA'),
    ('diagnostic status', READ, '06 03'),
    ('read counters', READ, '06 01 00 00 0A'),
    ('set variables', ALL, '06 02 03 03'),
    ('set timeout', ALL, '06 04 10'),
    ('set NAKs', ALL, '06 05 03'),
    ('set ENQs', ALL, '06 06 03'),
    ('reset counters', ALL, '06 07'),
    ('set data table size', ALL, '06 08 00 01'),
    ('read link parameters', READ, '06 09 00 00 02'),
    ('set link parameters', ALL, '06 0A 00 00 02 1F'),
    ('disable outputs', ALL, '07 00'),
    ('enable scan', ALL, '07 03'),
    ('enter download', ALL, '07 04'),
    ('enter upload', ALL, '07 06'),
    ('PLC-2 protected write', WRITE, '00 00 00 01 02'),
    ('PLC-2 unprotected read', READ, '01 00 00 02'),
    ('PLC-2 protected bit write', WRITE, '02 00 00 01 00'),
    ('PLC-2 physical write', ALL, '03 00 00 01 02'),
    ('PLC-2 physical read', ALL, '04 00 00 02'),
    ('PLC-2 unprotected bit write', WRITE, '05 00 00 01 00'),
    ('PLC-2 unprotected write', WRITE, '08 00 00 01 02'),
    ('CIP connected', ALL, '0A 00 00'),
    ('CIP unconnected', ALL, '0B 00 00'),
    ('word range write N7:0', WRITE, '0F 00 00 00 01 00 06 07 00 11 22'),
    ('word range write, section 1', ALL, '0F 00 00 00 01 00 07 01 02 00 11 22'),
    ('word range read, section 1', ALL, '0F 01 00 00 01 00 07 01 02 00 02'),
    ('bit write, section 1', ALL, '0F 02 07 01 02 00 FF FF 00 00'),
    ('file write N7:0', WRITE, '0F 03 00 00 01 00 06 07 00 11 22'),
    ('file write, section 1', ALL, '0F 03 00 00 01 00 07 01 02 00 11 22'),
    ('file read, section 1', ALL, '0F 04 00 00 01 00 07 01 02 00 02'),
    ('PLC-3 word range read, area 3', ALL, '0F 01 00 00 01 00 0F 03 01 00 00 02'),
    ('PLC-3 word range write, area 3', ALL, '0F 00 00 00 01 00 0F 03 01 00 00 11 22'),
    ('word range write to a symbol', ALL, '0F 00 00 00 01 00 00 24 53 59 4D 00 11 22'),
    ('download request', ALL, '0F 05 01'),
    ('upload request', ALL, '0F 06 01'),
    ('shut down', ALL, '0F 07'),
    ('physical write', ALL, '0F 08 00 00 00 00 11 22'),
    ('physical read', ALL, '0F 09 00 00 00 00 02'),
    ('restart', ALL, '0F 0A'),
    ('get edit resource', ALL, '0F 11'),
    ('return edit resource', ALL, '0F 12'),
    ('read bytes physical', ALL, '0F 17 00 00 00 00 02'),
    ('write bytes physical', ALL, '0F 18 00 00 00 00 11 22'),
    ('read-modify-write N7:0', WRITE, '0F 26 06 07 00 FF FF 01 00'),
    ('read-modify-write S:1', ALL, '0F 26 06 02 01 FF FF 01 00'),
    ('read-modify-write, section 1', ALL, '0F 26 07 01 02 00 FF FF 01 00'),
    ('read section size N7', READ, '0F 29 06 07 00'),
    ('read section size, section 1', ALL, '0F 29 07 01 02 00'),
    ('set CPU mode', ALL, '0F 3A 01'),
    ('disable forces', ALL, '0F 41'),
    ('download all', ALL, '0F 50'),
    ('download completed', ALL, '0F 52'),
    ('upload all', ALL, '0F 53'),
    ('upload completed', ALL, '0F 55'),
    ('initialize memory', ALL, '0F 57'),
    ('modify compatibility file', ALL, '0F 5E 00'),
    ('typed write N7:0', WRITE, '0F 67 00 00 01 00 06 07 00 42 11 22'),
    ('typed write, section 1', ALL, '0F 67 00 00 01 00 07 01 02 00 42 11 22'),
    ('typed read N7:0', READ, '0F 68 00 00 01 00 06 07 00 01 00'),
    ('typed read, section 1', ALL, '0F 68 00 00 01 00 07 01 02 00 01 00'),
    # The length of the masks is missing after the address (M 7-21).
    ('read-modify-write N, malformed', ALL, '0F 79 01 06 07 00 FF FF 01 00'),
    ('read-modify-write N, section 1', ALL, '0F 79 01 07 01 02 00 FF FF 01 00'),
    ('change mode', ALL, '0F 80 01'),
    ('open file', ALL, '0F 81 01 02 00 22'),
    ('close file', ALL, '0F 82 01 00'),
    ('execute command list', ALL, '0F 88 01 02 AA 00'),
    ('apply port configuration', ALL, '0F 8F 01'),
    # No manual has its form, so that it is not known which file is meant.
    ('read file information of N7', ALL, '0F 94 07 89'),
    ('read file information of type 22', ALL, '0F 94 02 22'),
    ('A1 N7:0', READ, '0F A1 02 07 89 00'),
    ('A2 N7:0', READ, '0F A2 02 07 89 00 00'),
    ('A1 program, type 22', ALL, '0F A1 50 02 22 00'),
    ('A2 program, type 22', ALL, '0F A2 50 02 22 00 00'),
    ('A2 file 0 of type 03', ALL, '0F A2 50 00 03 00 00'),
    ('A1 list of files, file 0 of type 01', READ, '0F A1 50 00 01 00'),
    ('A2 channel configuration, type 49', ALL, '0F A2 50 01 49 00 00'),
    ('A2 forces, type A1', ALL, '0F A2 02 00 A1 00 00'),
    ('A3 physical addresses', ALL, '0F A3 FF 00 00 00'),
    ('A7 protected typed file read', ALL, '0F A7 02 00 00 22 00 00'),
    ('A9 N7:0', WRITE, '0F A9 02 07 89 00 11 22'),
    ('AA N7:0', WRITE, '0F AA 02 07 89 00 00 11 22'),
    ('AA program, type 22', ALL, '0F AA 02 02 22 00 00 11 22'),
    ('A9 program, type 22', ALL, '0F A9 02 02 22 00 11 22'),
    ('AA file 0 of type 03', ALL, '0F AA 02 00 03 05 00 11 22'),
    ('AA list of files, file 0 of type 01', ALL, '0F AA 02 00 01 05 00 11 22'),
    ('AA forces, type A1', ALL, '0F AA 02 00 A1 00 00 FF FF'),
    ('AA channel configuration, type 49', ALL, '0F AA 02 01 49 00 00 11 22'),
    ('AA S:1', ALL, '0F AA 02 02 84 01 00 00 20'),
    ('AB S:1/13', ALL, '0F AB 02 02 84 01 00 00 20 00 20'),
    ('AB program, type 22', ALL, '0F AB 02 02 22 00 00 FF FF 11 22'),
    ('AA F8:0 = 1.0', WRITE, '0F AA 04 08 8A 00 00 00 00 80 3F'),
    ('AA function file, type E0', ALL, '0F AA 02 00 E0 00 00 11 22'),
    ('AF protected typed file write', ALL, '0F AF 02 00 00 22 00 00'),
    ('unknown function', ALL, '0F 99 00'),
    ('unknown CMD', ALL, '0C 00'),
    ('CMD without FNC', ALL, '0F'),
    ('AA program, with priority', ALL, '2F AA 02 02 22 00 00 11 22'),
    ('PLC-2 unprotected write, with priority', WRITE, '28 00 00 01 02'),
    ('CMD with bit 7', ALL, '8F AA 02 02 22 00 00 11 22'),
    ('A2 N7:0 and more', ALL, '0F A2 02 07 89 00 00 DE AD'),
    ('A2 without address', ALL, '0F A2'),
    ('PLC-2 unprotected read and more', ALL, '01 00 00 02 AA BB CC DD'),
)


class Place:
    """A place of a line that is shared, and the PLC on the line: bytes in, bytes out."""

    def __init__(self, access: ShareAccess, mode: str = 'Peer',
                 rows: Sequence[Mapping] = ()) -> None:
        network = Network(mode=mode, baud=19200, timeout=200, share='tcp:4501',
                          share_access=access.value)
        wiring = Wiring.FULL if mode == 'Peer' else Wiring.HALF
        self.device = OddDevice(wiring)
        self.device.answer = lambda data: (0, bytes(16))  # type: ignore[method-assign]
        rows = rows or [make_mapping('N7:0', plc='SLC', period=5000)]
        self.bench = DriverBench(rows, network=network, far=self.device)
        self.bench.run(1.0)
        self.faults: list[Exception] = []
        place, = share_places(network.share)
        self.line = GuestLine(place, network, self.bench.driver.guests, lambda: None,
                              GuestListener(), self.faults.append, self.bench.clock)
        self.line.machine.start(self.bench.clock())
        self._tns = count(0x101)

    def _exchange(self, data: bytes = b'') -> bytes:
        """Let the place hear bytes; return what it says."""
        machine, now = self.line.machine, self.bench.clock()
        self.line.link.came_after = now
        if data:
            machine.receive_data(data, now)
        else:
            machine.wake(now)
        said = machine.data_to_send()
        self.bench.run(0.1)
        while machine.next_call is not None and machine.next_call <= self.bench.clock():
            machine.handle_timeout(self.bench.clock())
        return said + machine.data_to_send()

    def ask(self, text: str, dst: int = 1) -> tuple[bool, int | None]:
        """Send a command; tell whether it reached the line, and the STS of the reply."""
        bench, before = self.bench, len(self.device.executed)
        body, tns = bytes.fromhex(text), next(self._tns).to_bytes(2, 'little')
        ack = self._exchange(frame(bytes((dst, 0x33, body[0], 0)) + tns + body[1:]))
        bench.line.wake(bench.driver.machine)
        bench.run(0.7)
        ack, _, reply = (ack + self._exchange()).partition(b'\x10\x02')
        assert ack == ACK
        assert self._exchange(ACK) == b''
        was_sent = any((data[0], data[2], data[6:]) == (dst, body[0], body[1:])
                       for data in self.device.executed[before:])
        if not reply:
            return was_sent, None
        reply = reply.replace(b'\x10\x10', b'\x10')
        assert (reply[:3], reply[4:6]) == (bytes((0x33, dst, body[0] | 0x40)), tns)
        assert reply[6:7] == b'\x12' or reply[3] != BAD_VALUE
        return was_sent, reply[3]


@pytest.mark.parametrize('access', ShareAccess)
def test_right_lets_through_what_its_list_has_and_nothing_else(access: ShareAccess) -> None:
    place, wrong = Place(access), []
    for name, needed, text in COMMANDS:
        is_right = (True, 0) if access.value in _rights_from(needed) else (False, NOT_ALLOWED)
        if (found := place.ask(text)) != is_right:
            wrong.append((name, found))
    # A reply is nothing that a guest may send, whatever its right.
    assert place.ask('CF AA 02 02 22 00 00 11 22') == (False, None)
    assert (len(COMMANDS), wrong, place.faults) == (103, [], [])


def _rights_from(least: ShareAccess) -> list[str]:
    names = ['Read', 'Write', 'All']
    return names[names.index(least.value):]


@pytest.mark.parametrize(('access', 'expected'), [
    (READ, [NOT_ALLOWED, NOT_ALLOWED, 0]), (WRITE, [0, NOT_ALLOWED, 0]), (ALL, [0, 0, 0])])
def test_only_plc_of_a_peer_is_meant_by_a_broadcast_too(
        access: ShareAccess, expected: list[int]) -> None:
    place = Place(access)
    texts = ('0F AA 02 07 89 00 00 11 22', '0F AA 02 02 22 00 00 11 22', '0F A2 02 07 89 00 00')
    assert [place.ask(text, 255)[1] for text in texts] == expected


@pytest.mark.parametrize('access', ShareAccess)
def test_command_to_all_stations_needs_all_and_is_not_confirmed(access: ShareAccess) -> None:
    place = Place(access, 'Master')
    device = place.device
    device.stations = frozenset((1, 255))
    texts = ('0F AA 02 07 89 00 00 11 22', '0F AA 02 02 22 00 00 11 22', '0F A2 02 07 89 00 00')
    assert [place.ask(text, 255)[1] for text in texts] == (
        [NO_REPLY, NO_REPLY, SILENT] if access is ALL else [NOT_ALLOWED] * 3)
    heard = [data[6:].hex(' ').upper() for data in device.executed if data[0] == 255]
    assert heard == ([text[3:] for text in texts[:2]] if access is ALL else [])


def limited_rows(plc: str) -> list[Mapping]:
    """Return rows with limits, with floats, and without any."""
    rows = [
        make_mapping('N7:10', 'Write', plc=plc, length=3, tag='speed', minimum=0.0, maximum=100.0),
        make_mapping('F8:0', 'Write', plc=plc, length=2, tag='heat', minimum=0.1, maximum=10.0),
        # Min and Max have no effect in a Read row, and none on bits.
        make_mapping('F8:10', plc=plc, tag='level', period=5000, minimum=0.0, maximum=1.0),
        make_mapping('N7:20', 'Write', plc=plc, kind='int32', tag='wide', minimum=-5.0,
                     maximum=70_000.0),
        make_mapping('N7:30', 'Write', plc=plc, tag='scaled', minimum=0.0, maximum=5.0,
                     scaling=Scaling(0.1, -10.0)),
        make_mapping('N7:50', 'Write', plc=plc, kind='float32', word_order='High', tag='high'),
        make_mapping('B3:0/0', 'Write', plc=plc, length=4, tag='bits', minimum=0.0, maximum=0.0),
        make_mapping('ST9:0', 'Write', plc=plc, tag='text'),
        make_mapping('N7:40', 'Write', plc=plc, tag='plain')]
    return rows


# Commands to an SLC with these rows that must not reach it, because of their values.
OF_SLC = (
    '0F AA 02 07 89 0A 00 65 00', '0F AA 02 07 89 0C 00 FF FF', '0F A9 02 07 89 0A 65 00',
    '0F AA 06 07 89 09 00 65 00 64 00 65 00',  # N7:9 may be 101, N7:11 not
    '0F AB 02 07 89 0A 00 FF 00 01 00', '0F AB 02 07 89 0A 00 FF FF 65 00',
    '0F 67 00 00 01 00 06 07 0A 42 65 00',
    '0F AA 04 08 8A 00 00 00 00 30 41', '0F AA 04 08 8A 01 00 FF FF FF FF',  # 11.0, NaN
    '0F AA 04 08 8A 00 00 CC CC CC 3D',  # the float32 below 0.1
    '0F AA 02 08 8A 00 01 30 41', '0F AB 04 08 8A 00 00 0F 00 00 00 A0 40',
    '0F AA 04 08 8A 0A 00 00 00 80 7F', '0F AA 04 08 8A 0A 00 00 00 C0 FF',  # infinity, NaN
    '0F AA 04 08 8A 32 00 FF FF FF FF', '0F AA 02 08 8A 32 01 FF FF',  # F8:50, of no row
    '0F AA 04 08 8A 32 01 00 00 80 3F',  # a half of F8:50, and a half of F8:51
    '0F A9 04 08 8A 32 FF FF FF FF', '0F AB 04 08 8A 32 00 FF FF FF FF FF FF',
    '0F AB 04 08 8A 32 00 00 FF FF FF FF FF',
    '0F AA 04 07 89 14 00 71 11 01 00', '0F AA 02 07 89 14 00 00 00', '0F AA 02 07 89 15 00 00 00',
    '0F AA 02 07 89 1E 00 97 00', '0F AA 02 07 89 1E 00 63 00',
    '0F AA 04 07 89 32 00 C0 7F 00 00', '2F AA 02 07 89 0A 00 65 00')
# Which words these write is not known: a type that does not fit, an odd size, a file write, a
# command of another family, and the common interface file, which may count bytes.
UNKNOWN = (
    '0F AA 02 07 85 0A 00 01 00', '0F AA 03 07 89 0A 00 01 00 01',
    '0F 03 00 00 01 00 06 07 0A 01 00', '0F 00 00 00 01 00 06 07 0A 01 00', '08 0A 00 01 00')
GOOD = (
    '0F AA 02 07 89 0A 00 64 00', '0F AA 06 07 89 0B 00 00 00 64 00 65 00',
    '0F AB 02 07 89 0A 00 FF FF 64 00', '0F AA 08 08 8A 00 00 00 00 20 41 CD CC CC 3D',  # 10, 0.1
    '0F AA 04 08 8A 0A 00 CA F2 49 F1', '0F AA 04 08 8A 32 00 CA F2 49 71',
    '0F A9 04 08 8A 32 CA F2 49 71', '0F AB 04 08 8A 32 00 FF FF CA F2 49 71',
    '0F AA 04 07 89 14 00 70 11 01 00', '0F AA 04 07 89 14 00 FB FF FF FF',
    '0F AA 02 07 89 1E 00 96 00', '0F AA 02 07 89 1E 00 64 00',
    '0F AA 04 07 89 32 00 80 3F 00 00', '0F AB 02 03 85 00 00 05 00 05 00',
    '0F AA 02 07 89 28 00 FF FF', '0F AB 02 07 89 28 00 0F 00 01 00')


@pytest.mark.parametrize('access', [WRITE, ALL])
def test_values_of_guests_keep_the_limits_of_the_rows(access: ShareAccess) -> None:
    place = Place(access, rows=limited_rows('SLC'))
    refused, sent = (False, BAD_VALUE), (True, 0)
    assert [(text, found) for text in OF_SLC if (found := place.ask(text)) != refused] == []
    assert [(text, found) for text in GOOD if (found := place.ask(text)) != sent] == []
    expected = sent if access is ALL else refused
    assert [(text, found) for text in UNKNOWN if (found := place.ask(text)) != expected] == []
    guest = place.line.guest
    assert guest.outside == len(OF_SLC) + len(UNKNOWN) * (access is WRITE)
    assert guest.refused == 0


@pytest.mark.parametrize(('text', 'is_good'), [
    ('0F 67 00 00 01 00 06 07 0A 42 64 00', True), ('0F 67 00 00 01 00 06 07 0A 42 65 00', False),
    ('0F 00 00 00 01 00 06 07 0A 65 00', False), ('0F 00 01 00 02 00 06 07 09 65 00', False),
    ('0F 26 06 07 0A FF FF 01 00', False), ('0F 26 06 07 0A 00 00 40 00', True),
    ('0F 02 06 07 0A 01 00 00 00', False), ('0F 26 06 03 00 FF FF 01 00', True),
    # 11.0 and 5.0: in a word range command the high word comes first.
    ('0F 00 00 00 02 00 06 08 00 30 41 00 00', False),
    ('0F 00 00 00 02 00 06 08 00 A0 40 00 00', True),
    ('0F 00 00 00 01 00 06 08 00 30 41', False),
    ('0F 67 00 00 01 00 06 08 00 96 09 94 08 00 00 A0 40', True),
    ('0F 67 00 00 01 00 06 08 00 96 09 94 08 00 00 30 41', False),
    ('0F 67 00 00 01 00 06 14 00 96 09 94 08 FF FF FF FF', False),  # F20:0, of no row
    ('0F 67 00 00 01 00 06 14 00 96 09 94 08 CA F2 49 71', True),
    ('0F 67 00 00 01 00 06 14 00 94 09 92 08 FF FF', False),  # a float of two bytes
    ('0F 79 01 06 07 28 02 FF FF 01 00', False), ('08 28 00 01 00', True)])
def test_values_for_a_plc5_keep_the_limits_of_its_rows(text: str, is_good: bool) -> None:
    place = Place(WRITE, rows=limited_rows('PLC5'))
    assert place.ask(text) == ((True, 0) if is_good else (False, BAD_VALUE))


def test_values_for_all_stations_keep_the_limits_of_each() -> None:
    place = Place(ALL, 'Master', limited_rows('SLC'))
    assert place.ask('0F AA 02 07 89 0A 00 65 00', 255) == (False, BAD_VALUE)
    assert place.ask('0F AA 02 07 89 0A 00 64 00', 255)[1] == NO_REPLY


def test_station_without_limits_takes_words_that_are_not_known() -> None:
    place = Place(WRITE)
    assert [place.ask(text) for text in UNKNOWN] == [(True, 0)] * len(UNKNOWN)
