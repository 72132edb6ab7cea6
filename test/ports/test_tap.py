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

"""Listening: to ports for reading alone, without a signal or byte, and between two ports."""

import errno
import fcntl
import math
import os
from pathlib import Path
import select
import termios
import threading
import time
from typing import Any
from unittest.mock import Mock

from abdf1_ros.df1.frames import Damaged
from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.ports import listening, serial_device
from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.serial_device import SerialDevice
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.tap import Tap
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.sniffer.capture import Chunk, Direction
import pytest
import serial
from support.counting import open_files
from support.driver_bench import ListeningBench
from support.mappings import make_mapping
from support.ptys import PATIENCE, Pty, read_exactly, wait_until

# What changes RTS, DTR or the line, of a terminal.
SIGNALS = {termios.TIOCMSET, termios.TIOCMBIS, termios.TIOCMBIC,
           0x5427, 0x5428, termios.TCSBRK, termios.TCSBRKP}  # also TIOCSBRK and TIOCCBRK
COMMAND = bytes.fromhex('10 01 02 10 02 02 00 0F 00 02 00 01 00 00 03 00 06 07 07 06 10 03 6E A0')
POLL = bytes.fromhex('10 05 02 FE')
REPLY = bytes.fromhex('10 02 00 02 4F 00 02 00 00 00 00 00 00 00 10 03 C5 73')


def listening_to(*ptys: Pty, **others: Any) -> PortSettings:
    first, *more = (str(pty.name) for pty in ptys)
    return PortSettings(first, listens=True, second=''.join(more), **others)


def test_bytes_and_signals_stay_as_they_are(ptys: list[Pty], monkeypatch: Any) -> None:
    """The bridge listens to a whole transaction; the far end gets nothing at all."""
    asked: list[int] = []
    flags: list[int] = []
    real_ioctl, real_open = fcntl.ioctl, os.open

    def ioctl(descriptor: int, request: int, *args: Any) -> Any:
        asked.append(request)
        return real_ioctl(descriptor, request, *args)

    def open_(name: Any, how: int, *args: Any, **others: Any) -> int:
        if str(name) == str(ptys[0].name):
            flags.append(how)
        return real_open(name, how, *args, **others)

    def refuse(*args: object, **others: object) -> None:
        raise AssertionError('pyserial sets RTS and DTR when it opens a port')

    monkeypatch.setattr(fcntl, 'ioctl', ioctl)
    monkeypatch.setattr(os, 'open', open_)
    monkeypatch.setattr(serial, 'Serial', refuse)
    mapping = make_mapping('N7:7', length=3, station=2, period=500)
    bench = ListeningBench([mapping])
    link = LinkThread(bench.machine, PortOpener(listening_to(ptys[0])).open)
    link.start()
    try:
        wait_until(lambda: link.state.is_open)
        give_up = time.monotonic() + PATIENCE
        while not bench.listener.reads:  # what comes in the half second after a stall is dropped
            assert time.monotonic() < give_up
            for byte in COMMAND + b'\x10\x06' + POLL + REPLY + b'\x10\x06':
                ptys[0].write(bytes((byte,)))
            time.sleep(0.1)
    finally:
        link.stop()
    assert bench.values(mapping)[:1] == [[0, 0, 0]]
    assert not select.select([ptys[0].fileno()], [], [], 0.3)[0], os.read(ptys[0].fileno(), 100)
    assert not SIGNALS.intersection(asked)
    assert flags == [os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK]
    assert bench.driver.counters.chars_sent == 0


def test_port_for_reading_takes_no_byte(ptys: list[Pty]) -> None:
    port = open_port(listening_to(ptys[0]))
    with pytest.raises(OSError, match='only listens to this port'):
        port.write(b'A')
    assert isinstance(port, listening.ListeningDevice)
    with pytest.raises(OSError) as caught:  # nor does the system
        os.write(port.fileno(), b'A')
    assert caught.value.errno == errno.EBADF
    assert fcntl.fcntl(port.fileno(), fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY
    port.close()


def test_what_a_program_leaves_at_its_end_is_not_changed(ptys: list[Pty]) -> None:
    descriptor = os.open(ptys[0].name, os.O_RDWR | os.O_NOCTTY)
    for hangs_up in (termios.HUPCL, 0):
        attributes = termios.tcgetattr(descriptor)
        attributes[:3] = [termios.ICRNL | termios.IXON, termios.OPOST,
                          attributes[2] & ~termios.HUPCL | hangs_up]
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        open_port(listening_to(ptys[0], baud=19200)).close()
        after = termios.tcgetattr(descriptor)
        assert after[2] & termios.HUPCL == hangs_up
        assert not after[2] & termios.CRTSCTS
        assert after[4:6] == [termios.B19200, termios.B19200]
        assert after[0] == after[1] == after[3] == 0  # raw: nothing is changed or echoed
    os.close(descriptor)


def test_two_ports_are_told_apart(ptys: list[Pty], pipe: tuple[int, int]) -> None:
    ptys[0].write(b'from before\n')
    port = open_port(listening_to(*ptys))
    wake, end = pipe
    ptys[0].write(b'first')
    assert (data := port.read(5.0, wake)) == b'first'
    assert not isinstance(data, SecondPort)
    ptys[1].write(b'second')
    assert (data := port.read(5.0, wake)) == b'second'
    assert isinstance(data, SecondPort)
    assert port.read(0.01, wake) == b''
    os.write(end, b'!')
    assert port.read(None, wake) == b''
    port.close()


@pytest.mark.parametrize('count', [1, 2])
def test_changed_speed_is_noticed_on_a_line_where_nobody_writes(
        ptys: list[Pty], wake: int, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_device, 'SETTINGS_LOOK', 0.1)
    port = open_port(listening_to(*ptys[:count], baud=19200))
    assert port.read(0, wake) == b''
    theirs = os.open(ptys[count - 1].name, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(theirs)
    attributes[4:6] = termios.B9600, termios.B9600  # as "stty 9600" does
    termios.tcsetattr(theirs, termios.TCSANOW, attributes)
    with pytest.raises(OSError, match='another program has changed the settings of the port'):
        for _ in range(100):  # a read ends with the next look at either port
            assert port.read(3600.0, wake) == b''
    port.close()
    os.close(theirs)


def test_both_ports_are_for_one_program(ptys: list[Pty]) -> None:
    port = open_port(listening_to(*ptys))
    for pty in ptys:
        with pytest.raises(OSError, match='another program has it open'):
            open_port(listening_to(pty))
        with pytest.raises(OSError, match='another program has it open'):
            open_port(PortSettings(str(pty.name)))
    port.close()
    open_port(listening_to(ptys[1])).close()
    # Where the second is not there, the first is given back.
    with pytest.raises(OSError, match='No such file'):
        open_port(PortSettings(str(ptys[0].name), listens=True, second='/nowhere/tty'))
    open_port(listening_to(ptys[0])).close()
    other = os.open(ptys[0].name, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX)  # as other programs reserve a device
    with pytest.raises(OSError, match='another program has it open'):
        open_port(listening_to(ptys[0]))
    os.close(other)


def test_damaged_characters_of_either_port_are_damaged(
        ptys: list[Pty], wake: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_device, 'SETTINGS_LOOK', 1e5)
    opened = [listening.open_device(listening_to(pty)) for pty in ptys]
    ports = [listening.ListeningDevice(port.fileno(), port.close, is_marked=True)
             for port in opened]  # a pty has no parity
    for pty in ptys:
        pair = listening.TwoPorts(ports[0], ports[1])
        pty.write(b'a\xFF\x00Ab')
        pieces = [pair.read(None, wake) for _ in range(3)]  # none waits for what comes next
        assert pieces == [b'a', b'A', b'b']
        assert isinstance(pieces[1], Damaged)
        assert isinstance(pieces[2], SecondPort) is (pty is ptys[1])
    for port in ports:
        port.close()


def test_errors_of_both_ports_are_counted(
        ptys: list[Pty], monkeypatch: pytest.MonkeyPatch) -> None:
    """They were not counted at all."""
    opener = PortOpener(listening_to(*ptys))
    port = opener.open()
    monkeypatch.setattr(SerialDevice, 'errors', lambda self: {'parity errors': 2, 'overruns': 1})
    assert opener.errors() == {'parity errors': 4, 'overruns': 2}
    port.close()


# Between two ports


def tap(*names: object) -> Tap:
    return Tap([str(name) for name in names], PortSettings(''))


def hear(listening: Tap, count: int) -> list[Chunk]:
    """Return chunks until they have ``count`` bytes, the bytes of one direction joined."""
    found: dict[Direction, bytes] = {}
    for chunk in listening.chunks(PATIENCE, PATIENCE, lambda: None):
        assert chunk.time is not None and chunk.time == round(chunk.time, 6)
        assert 0 < chunk.time < PATIENCE
        found[chunk.direction] = found.get(chunk.direction, b'') + chunk.data
        if sum(map(len, found.values())) >= count:
            break
    return [Chunk(None, direction, data) for direction, data in found.items()]


def test_one_port_is_listened_to(ptys: list[Pty]) -> None:
    with Tap([str(ptys[0].name)], PortSettings('', 1200)) as listening:
        assert termios.tcgetattr(ptys[0].fileno())[4] == termios.B1200
        for said in (b'\x10\x04', b'\x10\x06'):
            ptys[0].write(said)
            assert hear(listening, 2) == [Chunk(None, Direction.UNKNOWN, said)]
    open_port(PortSettings(str(ptys[0].name))).close()  # it is free again


def test_everything_is_passed_on_both_ways(ptys: list[Pty]) -> None:
    one, other = ptys
    every, files = bytes(range(256)), open_files()
    with tap(one.name, other.name) as listening:
        one.write(every)
        assert other.read(256) == every
        other.write(every[::-1])
        assert one.read(256) == every[::-1]
        assert hear(listening, 512) == [
            Chunk(None, Direction.OUT, every), Chunk(None, Direction.IN, every[::-1])]
    assert not open_files() - files
    assert not [thread for thread in threading.enumerate() if thread.name[:4] == 'tap ']


def test_new_pseudo_terminal_takes_its_name_away(ptys: list[Pty], tmp_path: Path) -> None:
    name = tmp_path / 'new'
    with tap(f'pty:{name}', ptys[1].name) as listening:
        assert listening.names == [str(name), str(ptys[1].name)]
        for _ in range(10):
            ptys[1].write(bytes(4000))
            assert hear(listening, 4000), 'it goes on while no program reads'
        descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)
        os.write(descriptor, b'\x10\x05')
        assert ptys[1].read(2) == b'\x10\x05'
        ptys[1].write(b'\x10\x04')
        while read_exactly(descriptor, 1) != b'\x10':  # perhaps the last of those bytes
            pass
        assert read_exactly(descriptor, 1) == b'\x04'
        os.close(descriptor)
    assert not name.is_symlink()


def test_port_that_cannot_be_opened(ptys: list[Pty], tmp_path: Path) -> None:
    first = tmp_path / 'first'
    with pytest.raises(OSError, match='No such file') as error:
        tap(f'pty:{first}', tmp_path / 'none')
    assert error.value.filename == str(tmp_path / 'none')
    assert not first.is_symlink()  # the first has been closed again


def test_lost_port_ends_it_with_an_error(
        ptys: list[Pty], monkeypatch: pytest.MonkeyPatch) -> None:
    with tap(ptys[0].name, ptys[1].name) as listening:
        ptys[1].close()
        with pytest.raises(OSError, match='^(Input/output error|the far end is gone)'):
            list(listening.chunks(PATIENCE, PATIENCE, lambda: None))
    gone = BrokenPipeError(errno.EPIPE, 'it is gone')  # this error of stdout ends a program
    monkeypatch.setattr(DescriptorPort, 'read', Mock(side_effect=gone))
    with tap(ptys[0].name) as listening, pytest.raises(OSError, match='^it is gone$') as caught:
        list(listening.chunks(PATIENCE, PATIENCE, lambda: None))
    assert caught.type is OSError


def test_it_ends_when_told_or_when_the_time_is_up(ptys: list[Pty]) -> None:
    with tap(ptys[0].name) as listening:
        listening.stop()
        assert list(listening.chunks(math.inf, PATIENCE, lambda: None)) == []
        assert list(listening.chunks(0.01, math.inf, lambda: None)) == []


def test_silence_is_told(ptys: list[Pty]) -> None:
    told: list[int] = []
    with tap(ptys[0].name) as listening:
        def idle() -> None:
            told.append(1)
            if len(told) == 3:
                listening.stop()

        assert list(listening.chunks(PATIENCE, 0.01, idle)) == []
    assert len(told) == 3


def test_what_nothing_takes_is_passed_on_and_counted(
        ptys: list[Pty], monkeypatch: pytest.MonkeyPatch) -> None:
    """After Ctrl-S it was all kept, without a bound."""
    monkeypatch.setattr('abdf1_ros.ports.tap.MOST_WAITING', 3)
    with tap(ptys[0].name, ptys[1].name) as listening:
        for number in range(8):
            ptys[0].write(bytes([number]))
            assert ptys[1].read(1) == bytes([number])
        chunks = listening.chunks(PATIENCE, PATIENCE, list)
        found = []
        for number in (0, 1, 2, 8, 9):
            if number > 2:
                ptys[0].write(bytes([number]))
            found.append((next(chunks).data[0], listening.new_losses(), listening.new_losses()))
        assert found == [(0, 0, 0), (1, 0, 0), (2, 0, 0), (8, 5, 0), (9, 0, 0)]
