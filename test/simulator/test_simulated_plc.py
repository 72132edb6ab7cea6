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

"""The simulated PLC: its data file, motions, faults and commands, on a clock of the test."""

import copy
import math
from pathlib import Path
from unittest.mock import MagicMock, Mock

from abdf1_ros.counters import Counters
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Code, Control, Frame, Poll
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import LinkError
from abdf1_ros.pccc.diagnostics import STATUS_REQUEST
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import decode_identity, dialect_of, FAMILIES, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.simulator.commands import CommandError, execute
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.ladder import Ladder
from abdf1_ros.simulator.simulated_plc import COLUMNS, InjectedFaults, load_plcs, SimulatedPlc
import pytest
from support.cases import for_all
from support.clock import Clock
from support.driver_bench import simulated_plc, store, stored

HEADER = ','.join(COLUMNS)
ACKNOWLEDGED = Control(Code.ACK)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'simulator.csv'


def load(path: Path, clock: Clock, *rows: str) -> list[SimulatedPlc]:
    path.write_text('\n'.join([HEADER, *rows]), encoding='utf-8')
    return load_plcs(str(path), Checksum.CRC, clock, MagicMock)


def faults(path: Path, *rows: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        load(path, Clock(), *rows)
    return [str(problem).split('simulator.csv:')[1] for problem in caught.value.problems]


@for_all('row', [
    '{},PLC5,N7:0', '1,{},N7:0', '1,PLC5,T4:0.{}', '1,PLC5,N7:0,{}', '1,PLC5,N7:0,1,{}',
    '1,PLC5,N7:0,1,0,{}', '1,SLC,N7:0,1,0,,,,{}'])
def test_fault_of_a_long_cell_is_short(path: Path, row: str) -> None:
    fault, = faults(path, row.format('x' * 5000))
    assert len(fault) < 300


class Master:
    """Sends commands to a PLC, frame by frame."""

    def __init__(self, plc: SimulatedPlc) -> None:
        self._plc = plc
        self._tns = 0

    def deliver(self, request: Request) -> bytes:
        """Send a command; return what the PLC says to that."""
        self._tns += 1
        cmd, data = request
        packet = Packet(self._plc.station, 5, cmd, 0, self._tns, data)
        return self._plc.handle(Frame(packet.encode(), self._plc.station))

    def poll(self) -> bytes:
        """Poll; return what the PLC says to that."""
        return self._plc.handle(Poll(self._plc.station, True))

    def read(self, text: str, words: int = 1) -> bytes:
        """Return words, by a whole transaction."""
        address = parse_address(text, self._plc.table.plc_type)
        dialect = dialect_of(address.plc_type)
        assert self.deliver(dialect.read(address, words)) == frames.ACK
        decoder = frames.FrameDecoder(Checksum.CRC, frames.Duplex.HALF)
        decoder.feed(self.poll())
        symbol = decoder.next_symbol()
        assert isinstance(symbol, Frame)
        self._plc.handle(ACKNOWLEDGED)
        reply = Packet.decode(symbol.data)
        assert reply.sts == 0
        return dialect.read_data(address, words, reply.data)

    def number(self, text: str) -> int:
        """Return a word as a signed number."""
        return int.from_bytes(self.read(text), 'little', signed=True)


def test_data_file_fills_the_tables_of_its_plcs(path: Path, clock: Clock) -> None:
    one, two = load(path, clock, '1,PLC5,N7:0-2,3,1 -2 3,,', '1,PLC5,B3:0/4,3,1 0 1,,',
                    '1,PLC5,F8:1,1,1.5,,', '1,plc5,ST9:0,1,Hi,,', '2,SLC,L10:255,1,70000,,',
                    '2,MicroLogix,I:1.0,2,5,,')
    assert (one.station, two.station, one.lock is two.lock) == (1, 2, False)
    store(one, 'N7:1', [9])
    one.download()  # also without a ladder
    assert stored(one, 'N7:0', 3) == b'\1\0\xfe\xff\3\0'
    assert stored(one, 'B3:0') == b'\x50\0'
    assert stored(one, 'F8:0', 4) == bytes(4) + b'\0\0\xc0\x3f'
    assert stored(one, 'ST9:0', 2) == b'\2\0iH'
    assert stored(two, 'L10:255', 2) == b'\x70\x11\1\0'
    assert stored(two, 'I:1.0', 2) == b'\5\0\0\0'  # what is not named is 0


def test_data_file_with_structures(path: Path, clock: Clock) -> None:
    one, two = load(path, clock, '1,PLC5,PD10:0,82,,,', '1,PLC5,PD10:0.SP,2,1.5 -2,,',
                    '1,PLC5,PD10:0.PV,1,7.5,Ramp,100', '1,PLC5,PD10:0/MO,1,1,,',
                    '1,PLC5,MG11:1.ERR,1,-3,,', '1,PLC5,BT12:0,6,1 2,,', '1,PLC5,SC13:0.PRE,1,9,,',
                    '2,SLC,PD10:0.SPS,2,500 7,,', '2,SLC,MG11:0/DN,1,1,,')
    assert stored(one, 'PD10:0', 6) == bytes.fromhex('02 00 00 00 00 00 C0 3F 00 00 00 C0')
    assert stored(one, 'MG11:1.ERR') == bytes.fromhex('FD FF')
    assert (stored(one, 'BT12:0', 2), stored(one, 'SC13:0.PRE')) == (b'\1\0\2\0', b'\x09\0')
    assert stored(two, 'PD10:0.SPS', 2) == bytes.fromhex('F4 01 07 00')
    assert stored(two, 'MG11:0.17') == bytes.fromhex('00 20')
    clock.now += 0.1
    read_pv = bytes.fromhex('68 00 00 01 00 0F 00 0A 00 1A 01 00')
    reply = one.serve(Packet(1, 5, 0x0F, 0, 1, read_pv))
    assert reply.data == bytes.fromhex('96 09 94 08 00 00 08 41')


def test_data_file_of_a_plc2_and_a_plc3(path: Path, clock: Clock) -> None:
    two, three = load(path, clock, '4,PLC2,020,3,1 2 65535,,', '4,PLC2,022/17,1,,Toggle,100',
                      '5,plc3,E3.1.8.10.0.2,2,7 8,,', '5,PLC3,N10:0,1,-1,,',
                      '5,PLC3,T:1.ACC,1,5,Ramp,100')
    clock.now += 0.1
    assert Master(two).read('020', 3) == b'\1\0\2\0\xff\x7f'
    three_master = Master(three)
    assert three_master.read('B10:0', 4) == b'\0\0\0\0\7\0\x08\0'
    assert (three_master.number('N10:0'), three_master.number('T:1.ACC')) == (-1, 6)


def test_common_interface_file_of_a_micrologix_1000_is_n7(path: Path, clock: Clock) -> None:
    """M 7-31; it has no file 9."""
    old, new = load(path, clock, '1,SLC,N7:0,4,,,,,ML1000', '2,SLC,N7:0,4,,,,,ML1400',
                    '2,SLC,N9:0,4,,,')
    for plc, file in ((old, 'N7'), (new, 'N9')):
        assert plc.serve(Packet(plc.station, 0, 0x08, 0, 1, b'\x02\x00\x34\x12')).sts == 0
        assert stored(plc, f'{file}:2') == b'\x34\x12'
        assert plc.serve(Packet(plc.station, 0, 0x01, 0, 2, b'\x02\x00\x02')).data == b'\x34\x12'
    assert stored(new, 'N7:2') == b'\x00\x00'


@pytest.mark.parametrize(('plc', 'text', 'cmd', 'data'), [
    ('PLC2', '020', 0x08, '20 00 07 00'),
    ('PLC3', 'N7:0', 0x0F, '00 00 00 01 00 2C 05 07 00 07 00')])
def test_message_of_a_plc2_and_a_plc3_writes_its_value_and_tells_that_it_is_confirmed(
        plc: str, text: str, cmd: int, data: str, clock: Clock) -> None:
    machine = simulated_plc(4, plc, clock, (text, 1))
    said: list[str] = []
    machine.send(parse_address(text, machine.table.plc_type), [7], 5, said.append)
    machine.send(parse_address(text, machine.table.plc_type), [8] * 200, 5, said.append)
    assert machine.next_task(0.0, {5}) is None
    sending, last, more = (machine.next_task(0.0) for _ in range(3))
    assert sending is not None and last is not None and more is not None
    command = sending.command
    assert (command.cmd, command.dst, command.src) == (cmd, 5, 4)
    assert sending.answer_within == math.inf  # also for a station that was silent
    assert command.data == bytes.fromhex(data)
    sending.reply(command.reply())
    last.reply(last.command.reply(sts=0x10))
    assert (said[0], len(said)) == ('confirmed', 2) and said[1].startswith('STS 10: ')
    assert (last.command.tns, more.command.tns) == (command.tns + 1, command.tns + 2)


@for_all(('row', 'text'), [
    ('1,PLC2,N7:0,,,,', '2:3 (Address): write the octal number of a word, as in 020 or 110/17'),
    ('1,PLC3,F8:0,,,,', '2:3 (Address): F is not a file type of a PLC-3; file types: O, I, T, C, '
                        'N, D, B, A, S'),
    ('300,PLC5,N7:0,,,,', '2:1 (Station): Station = "300" should be a whole number from 0 to '
                          '254'),
    ('x,PLC5,N7:0,,,,', '2:1 (Station): Station = "x" should be a whole number from 0 to 254'),
    ('1,PLC9,N7:0,,,,',
     '2:2 (PLC_Type): PLC_Type = "PLC9" should be one of PLC2, PLC3, PLC5, SLC'),
    ('1,PLC5,N7,,,,', '2:3 (Address): an element is missing, as in N7:0'),
    ('1,PLC5,N7:2000,,,,', '2:3 (Address): elements of N run from 0 to 1999'),
    ('1,PLC5,N7:0,0,,,', '2:4 (Length): Length = "0" should be a whole number from 1 to 1000'),
    ('1,PLC5,N7:0-3,3,,,', '2:4 (Length): N7:0-3 has Length 4'),
    ('1,PLC5,F8:1998,3,,,', '2:4 (Length): the last word there can be is F8:1999'),
    ('1,SLC,T4:255,4,,,', '2:4 (Length): the last word there can be is T4:255.ACC'),
    ('1,PLC5,N7:0,1,1 2,,', '2:5 (Values): 2 values, the mapping has 1'),
    ('1,PLC5,N7:0,1,40000,,', '2:5 (Values): value 40000 at index 0 is not a valid int16, a whole '
                              'number from -32768 to 32767'),
    ('1,PLC5,N7:0,1,1.5,,', '2:5 (Values): value 1.5 at index 0 is not a valid int16, a whole '
                            'number from -32768 to 32767'),
    ('1,PLC5,B3:0/0,1,2,,', '2:5 (Values): value 2 at index 0 is not a valid bool, 0 or 1'),
    ('1,PLC5,ST9:0,1,' + 'x' * 83 + ',,', '2:5 (Values): 83 characters, a PLC string has 82'),
    ('1,PLC5,N7:0,1,,Jump,5', '2:6 (Motion): Motion = "Jump" should be one of Ramp, Toggle'),
    ('1,PLC5,N7:0,1,,Ramp,', '2:7 (Period): Period = "" should be a whole number from 1 to '
                             '3600000'),
    ('1,PLC5,N7:0,1,,Ramp,0', '2:7 (Period): Period = "0" should be a whole number from 1 to '
                              '3600000'),
    ('1,PLC5,ST9:0,1,,Ramp,5', '2:6 (Motion): a string does not move'),
    ('1,PLC5,B3:0/4,2,,Ramp,5', '2:6 (Motion): bits have no Ramp, only Toggle'),
])
def test_fault_of_the_data_file(path: Path, row: str, text: str) -> None:
    assert faults(path, row, row) == [text, f'3{text[1:]}']


def test_ramp_counts_up_each_period_and_begins_again(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, '1,PLC5,N7:0,2,10 998,Ramp,250')
    master = Master(plc)
    seen = []
    for passed in (0.0, 0.249, 0.25, 0.499, 0.5, 2.6):
        clock.now = 50.0 + passed
        seen.append((master.number('N7:0'), master.number('N7:1')))
    assert seen == [(10, 998), (10, 998), (11, 999), (11, 999), (12, 0), (20, 8)]


def test_toggle_changes_its_bits_each_period_and_no_other(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, '1,PLC5,B3:0,1,65535,,', '1,PLC5,B3:0/3,2,0 1,Toggle,100')
    master = Master(plc)
    seen = []
    for passed in (0.0, 0.1, 0.2, 0.5, 0.7, 0.8):
        clock.now = 50.0 + passed + 0.001
        seen.append(master.number('B3:0'))
    assert seen == [-9, -17, -9, -17, -17, -9]


def test_ramp_of_floats_and_members(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, '1,SLC,F8:0,1,40.25,Ramp,100', '1,SLC,T4:0.ACC,1,5,Ramp,100')
    clock.now += 0.301
    master = Master(plc)
    assert master.read('F8:0', 2) == bytes.fromhex('00 00 2d 42')  # 43.25
    assert master.number('T4:0.ACC') == 8
    assert master.read('T4:0', 2) == bytes(4)


def test_motion_waits_until_a_word_is_bcd_again(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, '1,SLC,D9:0,1,5,Ramp,100')
    for written, after in (('cdab', 'cdab'), ('9901', '0002')):
        plc.table.write(parse_address('D9:0', PlcType.SLC), bytes.fromhex(written))
        clock.now += 0.1001
        plc.advance()
        assert stored(plc, 'D9:0').hex() == after


def test_motion_goes_on_from_what_was_written(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, '1,SLC,N7:0,1,0,Ramp,100')
    master = Master(plc)
    address = parse_address('N7:0', plc.table.plc_type)
    master.deliver(dialect_of(address.plc_type).write(address, b'\x64\0'))
    master.poll()
    plc.handle(ACKNOWLEDGED)
    clock.now += 0.1
    assert master.number('N7:0') == 101
    plc.set_mode(Setting.PROGRAM)
    clock.now += 5.0  # no step of this time is made up for
    plc.set_mode(Setting.REMOTE)
    clock.now += 0.05
    for setting in (Setting.REMOTE, Setting.PROGRAM, Setting.REMOTE):  # at once: no step is due
        assert master.number('N7:0') == 102
        plc.set_mode(setting)
    assert master.number('N7:0') == 102


@pytest.fixture
def plc(clock: Clock) -> SimulatedPlc:
    return simulated_plc(1, 'SLC', clock, ('N7:0', 10))


READ = (0x0F, bytes.fromhex('a2 02 07 89 00 00'))


@pytest.mark.parametrize(('faults', 'polled'), [
    (InjectedFaults(silent=True), b''), (InjectedFaults(full=True), frames.EOT)])
def test_silent_plc_says_nothing_and_neither_it_nor_a_full_one_takes_a_command(
        plc: SimulatedPlc, faults: InjectedFaults, polled: bytes) -> None:
    plc.faults = faults
    master = Master(plc)
    assert (master.deliver(READ), master.poll()) == (b'', polled)
    plc.faults = InjectedFaults()
    assert master.poll() == frames.EOT  # it has not kept the command
    assert master.number('N7:0') == 0


def test_slow_plc_lets_polls_pass_before_it_replies(plc: SimulatedPlc) -> None:
    plc.faults = InjectedFaults(slow=3)
    master = Master(plc)
    for _ in range(2):
        assert master.deliver(READ) == frames.ACK
        answers = [master.poll() for _ in range(4)]
        assert answers[:3] == [frames.EOT] * 3
        assert answers[3].startswith(frames.STX)
        plc.handle(ACKNOWLEDGED)


def test_slow_station_does_not_answer_polls_of_others(plc: SimulatedPlc) -> None:
    plc.faults = InjectedFaults(slow=1)
    master = Master(plc)
    master.deliver(READ)
    assert plc.handle(Poll(2, True)) == plc.handle(Poll(1, False)) == b''
    assert master.poll() == frames.EOT
    assert master.poll().startswith(frames.STX)


@pytest.mark.parametrize('status, link_data', [
    ((0x50,), '05 01 4f 50 01 00'), ((0xF0, 0x0B), '05 01 4f f0 01 00 0b')])
def test_plc_with_an_error_replies_with_that_status(
        plc: SimulatedPlc, status: tuple[int, ...], link_data: str) -> None:
    plc.faults = InjectedFaults(status=status)
    master = Master(plc)
    master.deliver(READ)
    assert master.poll() == frames.message_frame(bytes.fromhex(link_data), Checksum.CRC)


def test_noise_damages_its_share(plc: SimulatedPlc) -> None:
    plc.faults = InjectedFaults(noise=0.1)
    sent = bytes(10_000)
    received = plc.damaged(sent)
    assert len(received) == len(sent)
    damaged = [byte for byte in received if byte]
    assert 900 < len(damaged) < 1100
    assert set(damaged) == {1 << bit for bit in range(8)}
    plc.faults = InjectedFaults(noise=1.0, slow=1)
    master = Master(plc)
    assert (master.deliver(READ) == frames.ACK, master.poll() == frames.EOT) == (False, False)
    assert master.poll()[:1] not in (b'', frames.STX[:1])


def test_plc_with_a_delay_replies_when_it_is_over(plc: SimulatedPlc, clock: Clock) -> None:
    plc.faults = InjectedFaults(delay=0.05)
    master = Master(plc)
    for _ in range(2):
        assert master.deliver(READ) == frames.ACK
        assert [master.poll() for _ in range(3)] == [frames.EOT] * 3
        clock.now += 0.049
        assert master.poll() == frames.EOT
        clock.now += 0.002
        assert master.poll().startswith(frames.STX)
        plc.handle(ACKNOWLEDGED)
        assert master.poll() == frames.EOT
    plc.faults = InjectedFaults(delay=0.05, slow=2)
    master.deliver(READ)
    plc.faults = InjectedFaults()
    assert master.poll().startswith(frames.STX)


def _with_ladder() -> tuple[Clock, SimulatedPlc]:
    clock = Clock()
    plc = simulated_plc(1, 'SLC', clock, ('S:0', 4), ('N7:0', 4))
    plc.run_ladder(Ladder(plc.table))
    return clock, plc


def test_program_stands_still_outside_of_run_but_tables_answer() -> None:
    clock, plc = _with_ladder()
    clock.now += 2.0
    plc.advance()
    count, words = stored(plc, 'N11:3'), copy.deepcopy(plc.table.words)
    assert (count, stored(plc, 'T13:0.PRE')) == (b'\x10\0', b'\x2c\1')  # with scans of 10 ms
    for setting in (Setting.PROGRAM, Setting.TEST, Setting.FAULT):
        plc.set_mode(setting)
        clock.now += 5.0
        plc.advance()
        assert plc.table.words == words
    plc.set_mode(Setting.REMOTE)
    clock.now += 1.0
    plc.advance()
    assert stored(plc, 'N11:3') != count
    plc.set_mode(Setting.RUN)  # the key is turned, and the program runs on
    plc.advance()
    assert stored(plc, 'S:1')[1] >> 7 == 0


def test_download_brings_back_the_words_of_the_start() -> None:
    clock, plc = _with_ladder()
    words = copy.deepcopy(plc.table.words)
    for _ in range(2):
        store(plc, 'N10:0', [5, 42])
        store(plc, 'S:0', [3])
        clock.now += 1.0
        plc.download()
        assert plc.table.words == words
    assert not plc.is_running
    clock.now += 3.0
    plc.set_mode(Setting.REMOTE)
    plc.advance()
    assert stored(plc, 'S:1')[1] >> 7 == 1  # the first scan


def test_power_cycle_keeps_words_and_begins_anew() -> None:
    clock, plc = _with_ladder()
    store(plc, 'N10:0', [5, 42])
    plc.handle(Frame(Packet(1, 5, 0x06, 0, 1, b'\x03').encode(), 1))
    plc.send(parse_address('N7:0', plc.table.plc_type), [1], 5, lambda outcome: None)
    clock.now += 1.0
    plc.cycle_power()
    assert stored(plc, 'N11:3') != bytes(2)
    assert plc.next_task(clock.now) is None
    assert plc.handle(Poll(1, True)) == frames.EOT
    plc.advance()
    assert stored(plc, 'N10:0', 2) == bytes([5, 0, 42, 0])
    assert stored(plc, 'S:1')[1] >> 7 == 1


def test_plcs_behind_a_gateway_are_one_station_of_the_line(tmp_path: Path) -> None:
    plcs = load(tmp_path / 'simulator.csv', Clock(), '1,PLC5,N7:0,,,,,10', '1,PLC5,F8:0,,,,,10',
                '2,SLC,N7:0,,,,,10', '3,SLC,N7:0,,,,,', '4,SLC,N7:0,,,,,11')
    direct, gateway, other = stations_of(plcs, Checksum.BCC)
    assert direct is plcs[2]
    for plc in plcs[:2]:
        identify = Packet(plc.station, 5, 0x06, 0, plc.station, b'\x03')
        plc.set_mode(Setting.PROGRAM)  # in which it answers
        frame = Frame(identify.encode(), 10)
        assert direct.handle(frame) == other.handle(frame) == b''
        assert gateway.handle(frame) == frames.ACK
        reply = plc.serve(identify)
        assert gateway.handle(Poll(10, True)) == frames.message_frame(reply.encode(), Checksum.BCC)
        gateway.handle(ACKNOWLEDGED)
    plcs[1].faults.silent = True
    for tns, (dst, cmd, data, answer, sts) in enumerate((
            (10, 6, b'\0\7', b'\7', 0), (10, 6, b'', b'', 0x10), (10, 15, b'\0\7', b'', 0x10),
            (10, 15, b'\3', b'', 0x10), (2, 6, b'', b'', 2), (4, 6, b'', b'', 2))):
        command = Packet(dst, 5, cmd, 0, tns, data)  # for itself, a silent PLC, one elsewhere
        gateway.handle(Frame(command.encode(), 10))
        assert gateway.handle(Poll(10, True)) == frames.message_frame(
            command.reply(answer, sts).encode(), Checksum.BCC)
        gateway.handle(ACKNOWLEDGED)


@for_all(('first', 'second', 'text'), [
    ('1,PLC5,N7:0,,,,', '1,SLC,N7:0,,,,', '3:2 (PLC_Type): station 1 is a PLC5 already'),
    ('1,SLC,N7:0,,,,,,5/03', '1,SLC,N9:0,,,,,,5/04', '3:9 (Processor): station 1 is 5/03 already'),
    ('1,PLC5,N7:0,,,,', '1,PLC5,F7:0,,,,', '3:3 (Address): file 7 is of type N already'),
    *(('1,PLC5,N7:0,,,,,10', second, f'3:8 (Via): {text}') for second, text in (
        ('1,PLC5,F8:0,,,,,11', 'station 1 is behind gateway 10 already'),
        ('1,PLC5,F8:0,,,,,', 'station 1 is behind gateway 10 already'),
        ('10,PLC5,F8:0,,,,,', 'station 10 is a PLC, it cannot be a gateway too'),
        ('2,PLC5,F8:0,,,,,1', 'station 1 is a PLC, it cannot be a gateway too'),
        ('5,PLC5,F8:0,,,,,5', 'station 5 is a PLC, it cannot be a gateway too'),
        ('2,PLC5,F8:0,,,,,0', 'Via = "0" should be a whole number from 1 to 254')))])
def test_rows_that_contradict_each_other(path: Path, first: str, second: str, text: str) -> None:
    assert faults(path, first, second) == [text]


def test_simulated_slc_may_be_another_processor(path: Path, clock: Clock) -> None:
    plc, = load(path, clock, *(f'1,SLC,{rest}' for rest in (
        'N7:0,,,,,,ML1400', 'B3:0,,,,,,', 'N9:0,,,,,,ML1400')))
    status = plc.serve(Packet(1, 5, 0x06, 0, 1, b'\x03')).data
    assert decode_identity(status).processor is Processor.ML1400
    fault, = faults(path, '1,SLC,N7:0,,,,,,5/99')
    assert fault.startswith('2:9 (Processor): Processor = "5/99" should be one of 5/01, 5/02')
    fault, = faults(path, '1,PLC5,N7:0,,,,,,5/03')
    assert fault.startswith('2:9 (Processor)')


# The commands that the simulator takes while it runs


@pytest.fixture
def plcs() -> list[SimulatedPlc]:
    return [simulated_plc(station, 'SLC', lambda: 0.0, ('N7:0', 1)) for station in (1, 12)]


@pytest.mark.parametrize('line, faults, text', [
    ('silent 12', InjectedFaults(silent=True), 'station 12: silent'),
    ('full 12', InjectedFaults(full=True), 'station 12: full'),
    ('  slow   12  3 \n', InjectedFaults(slow=3), 'station 12: slow 3'),
    ('delay 12 50', InjectedFaults(delay=0.05), 'station 12: delay 50'),
    ('noise 12 0.01', InjectedFaults(noise=0.01), 'station 12: noise 0.01'),
    ('noise 12 0', InjectedFaults(), 'station 12: noise 0'),
    ('slow 12 0', InjectedFaults(), 'station 12: slow 0'),
    ('noise 12 1', InjectedFaults(noise=1.0), 'station 12: noise 1'),
    ('delay 12 3600000', InjectedFaults(delay=3600.0), 'station 12: delay 3600000'),
    ('error 12 50', InjectedFaults(status=(0x50,)), 'station 12: error 50'),
    ('error 12 F0 0b', InjectedFaults(status=(0xF0, 0x0B)), 'station 12: error F0 0b'),
    ('normal 12', InjectedFaults(), 'station 12: normal')])
def test_command_changes_the_faults_of_its_station_alone(
        plcs: list[SimulatedPlc], line: str, faults: InjectedFaults, text: str) -> None:
    plcs[1].faults = InjectedFaults(silent=True, slow=9)
    assert execute(line, plcs) == text
    assert plcs[1].faults == faults
    assert plcs[0].faults == InjectedFaults()


def test_counters_are_told_and_served_as_those_of_the_port(plcs: list[SimulatedPlc]) -> None:
    plcs[1].faults = faults = InjectedFaults(slow=9)
    plcs[1].counters.messages_sent, plcs[1].counters.enq_retries = 3, 4
    text = execute('counters 12', plcs).removeprefix('station 12: ')
    told = dict(word.split('=') for word in text.split())
    assert {key: int(value) for key, value in told.items()} == plcs[1].counters.by_mnemonic()
    assert told['CNT_MSG_PACKETS_SENT'] == '3'
    assert plcs[1].faults is faults
    plcs[0].be_radio(Counters(messages_sent=7, unsent_messages=9))
    assert execute('counters 1', plcs).count('=7') == 1
    plcs[1].be_full_duplex()
    radio, peer = (plc.serve(Packet(plc.station, 5, 6, 0, 1, b'\1\0\0\xf4')).data for plc in plcs)
    assert (radio[2:8], peer[8:10]) == (b'\7\0\0\0\x09\0', b'\4\0')


@pytest.mark.parametrize('line, text', [
    ('silent', 'name a station (1, 12)'), ('silent 3', 'name a station (1, 12)'),
    ('silent 012', 'name a station (1, 12)'), *((line, f'"{line}" is not a command') for line in (
        'noise 1', 'silent 1 2', 'full 1 2', 'counters 1 2', 'power 1 2', 'run 1 2', 'slow 1',
        'delay 1', 'error 1', 'normal 1 x', 'scan 1', 'mode 1', 'msg 1 N7:0')),
    (' msg 1 N7:0 5', '"msg 1 N7:0 5" is not a command'),  # half duplex
    *((f'slow 1 {text}', f'slow 1 {text}: "{text}" should be a whole number from 0')
      for text in ('few', '-3', '1.5', '1_0', '\u0661')),
    *((f'delay 1 {text}', f'delay 1 {text}: "{text}" should be ms from 0 to 3600000')
      for text in ('long', '-5', 'nan', '1e9', '1_0')),
    *((f'noise 1 {text}', f'noise 1 {text}: "{text}" should be a share from 0 to 1')
      for text in ('much', '-0.1', '1.1', 'nan')),
    *((f'error 1 {text}', f'error 1 {text}: "{text}" should be a byte in hexadecimal such as 0B')
      for text in ('zz', '5', '500000', '\u0661\u0661')),
    ('mode 1 fast', 'mode 1 fast: the modes are run, program, remote, test, fault'),
    ('msg 1 N7:0 70000', 'msg N7:0: value 70000 at index 0 is not a valid int16')])
def test_command_that_is_wrong_changes_nothing(
        plcs: list[SimulatedPlc], line: str, text: str) -> None:
    plcs[0].faults = before = InjectedFaults(slow=2)
    if line.startswith('msg'):
        plcs[0].be_full_duplex()
    with pytest.raises(CommandError) as caught:
        execute(line, plcs)
    assert str(caught.value).startswith(text)
    assert plcs[0].faults is before


def test_fault_that_would_have_no_effect_is_refused(plcs: list[SimulatedPlc]) -> None:
    plcs[0].be_radio(plcs[0].counters)
    plcs[1].via = 10
    for line in ('full {}', 'noise {} 1', 'slow {} 3', 'delay {} 50'):
        for station, place in (('1', 'radio modem'), ('12', 'gateway')):
            with pytest.raises(CommandError, match=f'{station} is behind a {place}, where'):
                execute(line.format(station), plcs)
    assert plcs[0].faults == plcs[1].faults == InjectedFaults()
    plcs[1].be_full_duplex()
    with pytest.raises(CommandError, match='12 is on a full-duplex line, where "delay" has'):
        execute('delay 12 50', plcs)
    assert execute('full 12', plcs) == 'station 12: full'


@pytest.mark.parametrize('line', ['hush 1', 'silent 3'])
def test_bad_command_is_told_the_commands_and_no_more(plcs: list[SimulatedPlc], line: str) -> None:
    with pytest.raises(CommandError) as caught:
        execute(line, plcs)
    lines = str(caught.value).split('\n')
    assert lines[1] == 'commands, on standard input or with --at:'
    assert lines[-1].split() == ['quit', 'end', 'the', 'simulator']


@pytest.mark.parametrize('setting', Setting)
def test_mode_is_told_by_the_diagnostic_status(plcs: list[SimulatedPlc], setting: Setting) -> None:
    plcs[1].faults = before = InjectedFaults(slow=9)
    assert execute(f'mode 12 {setting.value}', plcs) == f'station 12: mode {setting.value}'
    assert plcs[1].processor.setting is setting
    assert plcs[0].processor.setting is Setting.REMOTE
    assert plcs[1].faults is before  # a mode is no fault of the line
    status = plcs[1].serve(Packet(12, 5, 0x06, 0, 1, STATUS_REQUEST)).data
    assert decode_identity(status) == decode_identity(
        FAMILIES[PlcType.SLC].encode_identity(EmulatedProcessor(setting)))


def test_message_is_queued_and_its_end_reported(plcs: list[SimulatedPlc]) -> None:
    told: list[str] = []
    plcs[1].be_full_duplex()
    assert execute('msg 12 n7:0 5 -6', plcs, told.append) == 'station 12: msg N7:0 5 -6'
    assert told == []
    sending = plcs[1].outbox.pop()
    assert (sending.command.dst, sending.command.src) == (5, 12)
    sending.fail(error := LinkError())
    assert told == [f'station 12: msg N7:0 {error}']
    assert not plcs[0].outbox


def test_modes_have_commands_of_their_own(
        plcs: list[SimulatedPlc], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedPlc, 'set_mode', set_mode := Mock())  # it sets more than a word
    for verb, mode in ('program', 'program'), ('test', 'test'), ('run', 'remote'):
        assert execute(f'{verb} 1', plcs) == f'station 1: mode {mode}'
        set_mode.assert_called_with(Setting(mode))


def test_download_power_and_reset() -> None:
    plc = simulated_plc(1, 'SLC', lambda: 0.0, ('N7:0', 4))
    with pytest.raises(CommandError, match='no ladder; start with --ladder 1'):
        execute('reset 1', [plc])
    plc.run_ladder(Ladder(plc.table))
    plc.lock = lock = MagicMock()
    plc.serve(Packet(1, 5, 0x06, 0, 1, STATUS_REQUEST))
    assert lock.__enter__.call_count == 2  # for its program, and for the command
    lock.reset_mock()
    for verb in ('normal', 'reset', 'power', 'download'):
        assert execute(f'{verb} 1', [plc]) == f'station 1: {verb}'
        assert lock.__enter__.called  # the thread of the link may be in the program
    assert plc.processor.setting is Setting.PROGRAM


def test_scan_time_of_a_ladder() -> None:
    clock = Clock()
    plc = simulated_plc(1, 'SLC', clock, ('N7:0', 4))
    with pytest.raises(CommandError, match='no ladder; start with --ladder 1'):
        execute('scan 1 60', [plc])
    plc.run_ladder(Ladder(plc.table))
    assert plc.ladder is not None
    clock.now += 2.0
    for scan in ('60', '1', '1000'):
        assert execute(f'scan 1 {scan}', [plc]) == f'station 1: scan {scan}'
        assert plc.ladder.scan_time == int(scan) / 1000
    assert plc.ladder.get(11, 3) > 10  # the scans of before had their own time
    for text in ('0', '1001', 'fast'):
        with pytest.raises(CommandError, match=f'"{text}" should be ms from 1 to 1000'):
            execute(f'scan 1 {text}', [plc])
