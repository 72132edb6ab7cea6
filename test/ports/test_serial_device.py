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

"""Serial devices: how they are listed and opened, damaged characters, counts, and the end."""

from array import array
from collections.abc import Callable
from contextlib import ExitStack, suppress
import errno
import fcntl
from functools import partial
import os
from pathlib import Path
import stat
import struct
import termios
import time
import traceback
from types import SimpleNamespace
from typing import Any

from abdf1_ros.df1.frames import Damaged
from abdf1_ros.line_names import number_of
from abdf1_ros.ports import listing, repeated_ends, serial_device
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.ownership import own
from abdf1_ros.ports.serial_device import hold_device, mark_damage, SerialDevice
from abdf1_ros.ports.settings import Lack, PortSettings
import pytest
import serial
from support.cases import for_all
from support.ptys import PATIENCE, Pty


@for_all(('name', 'listens', 'text'), [
    *((name, listens, text) for listens in (False, True) for name, text in (
        ('/nowhere/tty', 'No such file or directory'), ('/dev/null', 'this is not a serial port'),
        ('socket://127.0.0.1:1', 'Connection refused'))),
    ('/tmp', False, 'Is a directory'), ('rfc2217://127.0.0.1:1', False, 'Connection refused')])
def test_port_that_cannot_be_opened(name: str, listens: bool, text: str) -> None:
    with pytest.raises(OSError) as caught:  # noqa: PT011
        open_port(PortSettings(name, listens=listens))
    assert (caught.value.strerror or str(caught.value)) == text
    assert 'SerialException' not in ''.join(traceback.format_exception(caught.value))


def test_port_that_another_program_has_asked_the_system_to_keep(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object) -> int:
        raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))

    monkeypatch.setattr(os, 'open', refuse)  # the system itself lets root in
    with pytest.raises(OSError, match='another program has it open'):
        open_port(PortSettings('/dev/ttyUSB0'))


def test_setting_that_the_device_does_not_have(pty: Pty) -> None:
    open_port(PortSettings(str(pty.name))).close()
    # A pty has no parity; the C library says so when there is nothing else to change.
    with pytest.raises(OSError, match='a pseudo-terminal has no parity'):
        open_port(PortSettings(str(pty.name), parity='Even'))


GONE = 'the far end is gone, or another program reads the port too'
OFTEN = (', 3 times within 10 s: does its USB port sleep (autosuspend), has it too little power, '
         'do motors disturb it, or does another program read the port?')


def loss_of(name: str, loses: str) -> str:
    """Return the error of a device that is ready and has no bytes, or takes none."""
    ours, theirs = os.pipe()
    os.close(theirs if loses == 'read' else ours)
    left = ours if loses == 'read' else theirs
    port = SerialDevice(left, partial(os.close, left), name=name)
    with pytest.raises(OSError) as caught:  # noqa: PT011
        port.read(PATIENCE, left) if loses == 'read' else port.write(b'x')
    port.close()
    return caught.value.strerror or str(caught.value)


def test_adapter_that_comes_and_goes_is_told_with_the_usual_causes(
        monkeypatch: pytest.MonkeyPatch) -> None:
    moments = iter([0.0, 0.5, 4.0, 9.0, 10.0, 30.0, 31.0])
    monkeypatch.setattr(repeated_ends, 'time', SimpleNamespace(monotonic=lambda: next(moments)))
    said = [loss_of(name, loses) for name, loses in (
        ('/dev/gone1', 'read'), ('/dev/gone2', 'read'), ('/dev/gone1', 'write'),
        ('/dev/gone1', 'read'), ('/dev/gone1', 'write'), ('/dev/gone1', 'read'),
        ('/dev/gone1', 'read'))]
    broken = os.strerror(errno.EPIPE)
    assert said == [GONE, GONE, broken, GONE + OFTEN, broken + OFTEN, GONE, GONE]


def test_pseudo_terminal_that_comes_and_goes_has_other_causes(pty: Pty) -> None:
    for _ in range(4):
        port = open_port(PortSettings(str(pty.name)))
        with pytest.MonkeyPatch.context() as patch, pytest.raises(OSError, match='it is gone$'):
            patch.setattr(os, 'write', raises(OSError(errno.EIO, 'it is gone')))
            port.write(b'x')
        port.close()


def raises(error: Exception) -> Callable[..., int]:
    def fail(*args: object) -> int:
        raise error
    return fail


def told_by_open(settings: PortSettings) -> dict[str, str]:
    """Return the options that ``open_port`` tells of, each with its text."""
    told: list[Lack] = []
    open_port(settings, told.append).close()
    return dict(told)


def test_option_that_a_port_does_not_have_is_told_and_no_error(pty: Pty) -> None:
    told = told_by_open(PortSettings(str(pty.name), rs485=True))
    assert told.pop('low_latency').startswith('the port has no low-latency mode: ')
    assert told == {'rs485': 'rs485 has no effect: the port has no RS-485 mode: Inappropriate '
                             'ioctl for device'}
    assert told_by_open(PortSettings(str(pty.name), low_latency=False)) == {}


def test_low_latency_that_a_port_has_is_set(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(serial.Serial, 'set_low_latency_mode',
                        lambda port, mode: asked.append(mode))
    assert told_by_open(PortSettings(str(pty.name))) == {}
    assert asked == [True]


class Kernel:
    """
    The RS-485 state of a port in a kernel, as linux/serial.h has it: flags, two delays, padding.

    ``takes`` is what the driver of the port makes of the flags that it is asked for.
    """

    _ioctl = staticmethod(fcntl.ioctl)

    def __init__(self, flags: int, takes: Callable[[int], int] = lambda flags: flags) -> None:
        self.state = [flags, 7, 9, 0, 0, 0, 0, 0]
        self.asked: list[int] = []
        self._takes = takes

    def ioctl(self, descriptor: int, request: int, *arguments: Any) -> Any:
        if request == 0x542E:  # TIOCGRS485
            arguments[0][:] = array(arguments[0].typecode, self.state)
        elif request == 0x542F:  # TIOCSRS485
            self.asked.append(arguments[0][0])
            self.state = [self._takes(arguments[0][0]), *arguments[0][1:]]
        else:
            return self._ioctl(descriptor, request, *arguments)
        return 0


# Flags: enabled 1, RTS on while sending 2, RTS on after sending 4, receive while sending 16.
@pytest.mark.parametrize(('flags', 'asked'), [
    (0, [1 | 2]), (2, [1 | 2]), (4, [1 | 4]), (4 | 16, [1 | 4 | 16]),
    (1 | 2, []), (1 | 4, []), (1 | 2 | 16, [])])
def test_rs485_keeps_the_polarity_that_stands(
        pty: Pty, monkeypatch: pytest.MonkeyPatch, flags: int, asked: list[int]) -> None:
    kernel = Kernel(flags)
    monkeypatch.setattr(fcntl, 'ioctl', kernel.ioctl)
    name = str(pty.name)
    assert told_by_open(PortSettings(name, low_latency=False)) == {}
    assert kernel.state == [flags, 7, 9, 0, 0, 0, 0, 0]
    assert told_by_open(PortSettings(name, low_latency=False, rs485=True)) == {}
    assert (kernel.asked, kernel.state) == (asked, [*(asked or [flags]), 7, 9, 0, 0, 0, 0, 0])


@pytest.mark.parametrize(('takes', 'text'), [
    (lambda flags: 4, 'rs485 has no effect: the driver of the port accepts it and ignores it'),
    (lambda flags: 1 | 2, 'rs485: the driver of the port has changed the level of RTS; is the '
                          'transmitter off while it listens?')])
def test_rs485_that_a_driver_does_not_carry_out_is_told(
        pty: Pty, monkeypatch: pytest.MonkeyPatch, takes: Callable[[int], int],
        text: str) -> None:
    monkeypatch.setattr(fcntl, 'ioctl', Kernel(4, takes).ioctl)
    assert told_by_open(PortSettings(str(pty.name), low_latency=False, rs485=True)) == {
        'rs485': text}


@pytest.mark.parametrize(('listens', 'parity', 'flags'), [
    (False, 'Odd', termios.PARODD | termios.CRTSCTS), (True, 'Odd', termios.PARODD),
    (True, 'Even', 0)])
def test_format_of_characters_is_asked_of_the_system(
        pty: Pty, listens: bool, parity: str, flags: int, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(termios, 'tcsetattr', lambda port, when, flags: asked.append(flags[2]))
    with pytest.raises(OSError, match='this port has no such parity') if listens else suppress(
            OSError):  # a pty has no parity
        open_port(PortSettings(str(pty.name), 9600, 7, parity, 2, True, listens=listens)).close()
    always = termios.CREAD | termios.CLOCAL | termios.CSTOPB | termios.PARENB
    assert asked[0] & (always | termios.CSIZE | termios.PARODD | termios.CRTSCTS) == (
        always | termios.CS7 | flags)


# Damaged characters


class Fed(SerialDevice):
    """A device whose marked bytes the test gives."""

    def __init__(self, *chunks: bytes) -> None:
        self._ours, self._theirs = os.pipe()
        super().__init__(self._ours, lambda: None, is_marked=True)
        self.chunks = list(chunks)

    def all(self) -> list[bytes]:  # noqa: A003
        """Return what comes of all chunks."""
        found = []
        for chunk in self.chunks:
            os.write(self._theirs, chunk)
            while data := self.read(0, self._ours):
                found.append(data)
        os.close(self._ours)
        os.close(self._theirs)
        return found


@for_all(('marked', 'expected'), [
    (b'abc', [b'abc']),
    (b'a\xff\xffb', [b'a\xffb']),
    (b'\xff\xff\xff\xff', [b'\xff\xff']),
    (b'ab\xff\x00cd', [b'ab', b'c', b'd']),
    (b'\xff\x00\xff', [b'\xff']),
    (b'\xff\x00\x00', [b'\x00']),  # a break
    (b'\xff\xff\x00a', [b'\xff\x00a']),
    (b'\xff\x00a\xff\x00b', [b'a', b'b'])])
def test_marks_are_undone(marked: bytes, expected: list[bytes]) -> None:
    whole = Fed(marked).all()
    assert whole == expected
    byte_by_byte = Fed(*(marked[at:at + 1] for at in range(len(marked)))).all()
    assert b''.join(byte_by_byte) == b''.join(expected)
    damaged = [piece for piece in whole if isinstance(piece, Damaged)]
    assert [piece for piece in byte_by_byte if isinstance(piece, Damaged)] == damaged
    assert len(damaged) == marked.replace(b'\xff\xff', b'').count(b'\xff\x00')


def test_system_doubles_what_looks_like_a_mark(pty: Pty, wake: int) -> None:
    theirs = os.open(pty.name, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(theirs)
    attributes[0] = termios.IGNPAR | termios.ISTRIP | termios.BRKINT
    termios.tcsetattr(theirs, termios.TCSANOW, attributes)

    def opened(stack: ExitStack) -> int:
        stack.callback(os.close, theirs)
        return theirs
    port = hold_device(PortSettings(str(pty.name), parity='Even'), opened, SerialDevice)
    pty.write(b'\x01\xff\x02')
    data = b''
    while len(data) < 3:
        data += port.read(PATIENCE, wake)
    assert data == b'\x01\xff\x02'
    assert termios.tcgetattr(theirs)[0] == termios.INPCK | termios.PARMRK
    port.close()
    with pytest.raises(OSError, match='Bad file descriptor'):  # an adapter may go at any moment
        mark_damage(theirs)


# Counts of the UART, and the end


def test_counts_begin_when_the_port_is_opened(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = [0] * 20
    counts[6:9] = 5, 6, 7  # struct serial_icounter_struct: frame, overrun, parity

    def ioctl(descriptor: int, request: int, *args: Any) -> Any:
        return struct.pack('20i', *counts) if request == 0x545D and descriptor >= 0 else true(
            descriptor, request, *args)

    true = fcntl.ioctl
    monkeypatch.setattr(fcntl, 'ioctl', ioctl)
    port = open_port(PortSettings(str(pty.name)))
    assert isinstance(port, SerialDevice)
    assert port.errors() == {'parity errors': 0, 'framing errors': 0, 'overruns': 0}
    counts[6:11] = 6, 8, 10, 0, 4  # and buf_overrun
    assert port.errors() == {'parity errors': 3, 'framing errors': 1, 'overruns': 6}
    port.close()
    assert port.errors() == {}


def test_device_that_counts_nothing(pty: Pty) -> None:
    port = open_port(PortSettings(str(pty.name)))
    assert port.errors() == {}
    port.close()


@pytest.fixture
def close_with(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Return what closes a port while the system has so many bytes to send, look by look."""
    done: list[str] = []

    def close(*unsent: int) -> list[str]:
        left = list(unsent)

        def ioctl(descriptor: int, request: int, *args: Any) -> Any:
            if request != termios.TIOCOUTQ:
                return true(descriptor, request, *args)
            return struct.pack('i', left.pop(0) if len(left) > 1 else left[0])

        true = fcntl.ioctl
        descriptor = os.open(pty.name, os.O_RDWR | os.O_NOCTTY)
        attributes = termios.tcgetattr(descriptor)
        attributes[2] |= termios.CRTSCTS
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        port = SerialDevice(descriptor, lambda: done.append('closed'))
        monkeypatch.setattr(fcntl, 'ioctl', ioctl)
        monkeypatch.setattr(serial_device, 'LAST_BYTES', 0.05 if unsent[-1] else PATIENCE)
        monkeypatch.setattr(termios, 'tcflush', lambda descriptor, queue: done.append(
            'dropped' if queue == termios.TCOFLUSH else 'something else'))
        monkeypatch.setattr(termios, 'tcsetattr', lambda descriptor, when, attributes: done.append(
            'handshake' if attributes[2] & termios.CRTSCTS else 'no handshake'))
        port.close()
        os.close(descriptor)
        return done
    return close


def test_close_does_not_wait_for_what_cannot_leave(close_with: Callable[..., list[str]]) -> None:
    assert close_with(12) == ['dropped', 'no handshake', 'closed']


@pytest.mark.parametrize('unsent', [(0,), (12, 5, 2, 0)])
def test_last_bytes_leave_before_the_close(
        close_with: Callable[..., list[str]], unsent: tuple[int, ...]) -> None:
    assert close_with(*unsent) == ['closed']


# One master, and its settings


def status_of(major: int, minor: int, mount: int, inode: int) -> os.stat_result:
    return os.stat_result((stat.S_IFCHR | 0o660, inode, mount, 1, 0, 0, 0, 0, 0, 0),
                          {'st_rdev': os.makedev(major, minor)})


def test_all_nodes_of_a_device_are_one_line() -> None:
    """A container has a node of its own (--device); flock looks at the inode alone."""
    usb = number_of(status_of(188, 0, mount=6, inode=90))
    assert usb == number_of(status_of(188, 0, mount=41, inode=7))
    assert usb != number_of(status_of(188, 1, mount=6, inode=91))
    # A container has pseudo-terminals of its own with these numbers.
    assert number_of(status_of(143, 300, mount=24, inode=6)) != number_of(
        status_of(143, 300, mount=55, inode=6))
    assert not number_of(os.stat('/tmp'))


def test_line_is_ours_whatever_name_another_program_uses(pty: Pty) -> None:
    number = number_of(os.stat(pty.name))
    port = open_port(PortSettings(str(pty.name)))
    with pytest.raises(OSError, match='another program has it open'):
        own(number)
    port.close()
    lock = own(number)
    with pytest.raises(OSError, match='another program has it open'):
        open_port(PortSettings(str(pty.name)))
    lock.close()
    open_port(PortSettings(str(pty.name))).close()


def test_name_that_leads_elsewhere_while_it_is_opened_is_not_taken(
        pty: Pty, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other, link = Pty(tmp_path / 'other'), tmp_path / 'by-id'
    link.symlink_to(os.path.realpath(pty.name))
    begin = serial.Serial.__init__

    def swapped(port: serial.Serial, *args: Any, **options: Any) -> None:
        link.unlink()
        link.symlink_to(os.path.realpath(other.name))
        begin(port, *args, **options)

    monkeypatch.setattr(serial.Serial, '__init__', swapped)
    with pytest.raises(OSError, match='leads to another device by now'):
        open_port(PortSettings(str(link)))
    monkeypatch.undo()
    for line in (pty, other):
        open_port(PortSettings(str(line.name))).close()
    other.close()


def test_device_is_kept_from_other_users(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_device, 'is_pseudo_terminal', lambda name: False)
    asked = []
    ioctl = fcntl.ioctl

    def keep(descriptor: int, request: int, *args: Any) -> Any:
        asked.append(request)
        return ioctl(descriptor, request, *args)

    monkeypatch.setattr(fcntl, 'ioctl', keep)
    open_port(PortSettings(str(pty.name))).close()
    assert termios.TIOCEXCL in asked


def test_settings_that_another_program_changes_are_a_lost_port(
        pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_device, 'SETTINGS_LOOK', 0.0)
    port = open_port(PortSettings(str(pty.name)))
    port.write(b'\x01')
    assert pty.read(1) == b'\x01'
    theirs = os.open(pty.name, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(theirs)
    attributes[3] |= termios.ICANON | termios.ECHO  # as "stty sane" does
    termios.tcsetattr(theirs, termios.TCSANOW, attributes)
    with pytest.raises(OSError, match='another program has changed the settings of the port'):
        port.write(b'\x02')
    port.close()
    port = open_port(PortSettings(str(pty.name)))
    port.write(b'\x03')
    assert pty.read(1) == b'\x03'
    os.close(theirs)
    pty.close()
    with pytest.raises(OSError, match='Input/output error'):
        port.write(b'\x04')
    port.close()


def test_line_that_takes_no_byte_for_three_seconds_is_a_lost_port(
        pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    unsent, now, port = 0, time.monotonic(), open_port(PortSettings(str(pty.name)))
    monkeypatch.setattr(serial_device, 'time', SimpleNamespace(
        monotonic=lambda: now, sleep=time.sleep))
    monkeypatch.setattr(SerialDevice, 'unsent', lambda _: unsent)
    # Nothing waits for long; then what is written waits, until at last one byte leaves.
    for wait, left in ((9.0, 0), (1.1, 1), (1.1, 2), (1.0, 2), (2.9, 3)):
        now, unsent = now + wait, left
        port.write(b'y')
    now, unsent = now + 1.0, 4
    with pytest.raises(OSError, match='the line takes no data; is Handshake right?'):
        port.write(b'x')
    unsent = 0
    port.close()


def _port(device: str, description: str = 'n/a', hwid: str = 'n/a') -> SimpleNamespace:
    return SimpleNamespace(device=device, name=Path(device).name, description=description,
                           hwid=hwid)


def test_adapters_come_first_with_a_name_that_stays(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / 'ttyUSB0'
    monkeypatch.setattr(os, 'access', lambda *asked: asked == (str(device), os.R_OK | os.W_OK))
    (tmp_path / 'by-id').mkdir()
    link = tmp_path / 'by-id' / 'usb-adapter'
    link.symlink_to(device)
    for name, kind in (('ttyS0', '4\n'), ('ttyS31', '0\n')):  # as Linux writes it
        (tmp_path / name).mkdir()
        (tmp_path / name / 'type').write_text(kind)
    monkeypatch.setattr(listing, 'BY_ID', tmp_path / 'by-id')
    monkeypatch.setattr(listing, 'TTYS', tmp_path)
    monkeypatch.setattr(listing.list_ports, 'comports', lambda: [
        _port('/dev/ttyAMA0', 'ttyAMA0', 'PNP'), *map(_port, (
            '/dev/ttyS0', '/dev/ttyS31', '/dev/ttyS7')),
        _port(str(device), 'FT232R USB UART', 'USB VID:PID=0403:6001')])
    first, second, third = listing.serial_ports()
    assert (first.stable, first.adapter, first.may_open) == (str(link), 'FT232R USB UART', True)
    assert (second.device, second.adapter, second.may_open) == ('/dev/ttyAMA0', '', False)
    assert (third.device, third.adapter) == ('/dev/ttyS0', '')
