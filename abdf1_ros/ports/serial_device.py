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
Serial devices of this machine.

The properties of adapters are in docs/connect.md.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
import errno
import fcntl
import os
import struct
import termios
import time
from typing import TypeVar

from abdf1_ros.df1.frames import Damaged
from abdf1_ros.line_names import device_of, number_of
from abdf1_ros.ports import cure_of
from abdf1_ros.ports.descriptor import DescriptorPort, NO_DATA_TAKEN, WRITE_TIMEOUT
from abdf1_ros.ports.ownership import BUSY, own
from abdf1_ros.ports.repeated_ends import has_often_ended, OFTEN
from abdf1_ros.ports.settings import Lack, PortSettings

try:
    import serial
    from serial.serialutil import SerialException  # another package named serial lacks it
except ModuleNotFoundError as error:
    lacking = error.name or 'serial'
    raise ModuleNotFoundError(
        f'the Python module {lacking} is missing; {cure_of(lacking)}', name=lacking) from None

# Our own texts for errors whose system text says too little.
NOT_SERIAL = 'this is not a serial port'
_REASONS = {errno.EAGAIN: BUSY, errno.EBUSY: BUSY, errno.ENOTTY: NOT_SERIAL}

_PARITIES = {'None': serial.PARITY_NONE, 'Even': serial.PARITY_EVEN, 'Odd': serial.PARITY_ODD}

# struct serial_icounter_struct of Linux, <linux/serial.h>, and the indexes of its members.
_TIOCGICOUNT = 0x545D
_ICOUNTER = struct.Struct('20i')
_FRAME, _OVERRUN, _PARITY, _BUFFER_OVERRUN = 6, 7, 8, 10

# struct serial_rs485 of Linux, <linux/serial.h>: eight words, of which the first has flags.
_TIOCGRS485, _TIOCSRS485, _RS485_WORDS = 0x542E, 0x542F, 8
_ENABLED, _RTS_ON_SEND, _RTS_AFTER_SEND = 1, 2, 4

_PSEUDO_TERMINALS = '/dev/pts/'

Device = TypeVar('Device', bound='SerialDevice')

# Longest time (s) that ``close`` waits for the last bytes, and the time (s) between two looks.
LAST_BYTES = 1.0
_LOOK = 0.005

# Interval (s) at which we check whether another program has changed the settings.
SETTINGS_LOOK = 1.0

# Why an adapter comes and goes.
_ENDS_CAUSE = (
    f'{OFTEN}: does its USB port sleep (autosuspend), has it too little power, do motors disturb '
    'it, or does another program read the port?')

# The byte that the system puts before a damaged character, and doubles if it is data (PARMRK).
_MARK = 0xFF


def is_pseudo_terminal(name: str) -> bool:
    """Tell whether ``name``, or the target of its links, has no speed and no parity."""
    return os.path.realpath(name).startswith(_PSEUDO_TERMINALS)


def open_device(settings: PortSettings, tell: Callable[[Lack], None]) -> SerialDevice:
    """
    Open a device exclusively.

    ``tell`` is called with options that the port does not have, which is not an error. Raises
    OSError.
    """
    def opened(stack: ExitStack) -> int:
        port = _opened(settings)
        stack.callback(port.close)
        _set_options(port, settings, tell)
        return port.fileno()

    return hold_device(settings, opened, SerialDevice)


def hold_device(settings: PortSettings, opened: Callable[[ExitStack], int],
                kind: type[Device]) -> Device:
    """
    Keep other programs away from a device, whatever its name (rule 25 of docs/heartbeats.md).

    ``opened`` sets up the device, returns its descriptor and puts its closing on the stack. Raises
    OSError.
    """
    with ExitStack() as stack:
        number = device_of(settings.name)
        stack.callback(own(number).close)
        descriptor = opened(stack)
        if number_of(os.fstat(descriptor)) != number:
            raise OSError(f'{settings.name} leads to another device by now')
        name = '' if is_pseudo_terminal(settings.name) else settings.name
        if name:  # a pseudo-terminal lasts as long as its far end
            fcntl.ioctl(descriptor, termios.TIOCEXCL)
        has_parity = settings.parity != 'None'
        if has_parity:
            mark_damage(descriptor)
        return kind(descriptor, stack.pop_all().close, is_marked=has_parity, name=name)


def _opened(settings: PortSettings) -> serial.Serial:
    """Return the port with its speed and character format; raises OSError."""
    try:
        return serial.Serial(
            settings.name, baudrate=settings.baud, bytesize=settings.data_bits,
            parity=_PARITIES[settings.parity], stopbits=settings.stop_bits,
            rtscts=settings.handshake, exclusive=True)
    except (OSError, ValueError, termios.error) as error:  # termios.error: a device without parity
        if settings.parity != 'None' and is_pseudo_terminal(settings.name):
            raise OSError(errno.EINVAL, 'a pseudo-terminal has no parity: Parity None') from error
        raise OSError(*_plain(error)) from None  # three tracebacks would say no more


def _plain(error: Exception) -> tuple[object, ...]:
    """Return the text of the operating system, without the words that pyserial adds."""
    said = error.__context__ if isinstance(error, SerialException) else error
    args = said.args if isinstance(said, OSError | termios.error) else error.args
    return (args[0], _REASONS.get(args[0], args[1])) if len(args) > 1 else args


def _set_options(port: serial.Serial, settings: PortSettings,
                 tell: Callable[[Lack], None]) -> None:
    """Set the options of a device, apart from speed and character format."""
    if settings.low_latency:
        try:
            port.set_low_latency_mode(True)
        except (AttributeError, ValueError, OSError) as error:
            tell(Lack('low_latency', f'the port has no low-latency mode: {error}'))
    if settings.rs485:
        try:
            if text := _switch_transmitter(port.fileno()):
                tell(Lack('rs485', text))
        except OSError as error:
            tell(Lack('rs485', 'rs485 has no effect: the port has no RS-485 mode: '
                      f'{error.strerror}'))


def _switch_transmitter(descriptor: int) -> str:
    """
    Let the system switch an RS-485 transmitter with RTS; return what the driver does instead.

    The level of RTS stays as the device tree or another program has set it. If no level is set,
    RTS is on while sending, as newer kernels choose themselves. Raises OSError.
    """
    state = array('I', [0] * _RS485_WORDS)
    fcntl.ioctl(descriptor, _TIOCGRS485, state)
    if state[0] & _ENABLED:
        return ''
    if not state[0] & (_RTS_ON_SEND | _RTS_AFTER_SEND):
        state[0] |= _RTS_ON_SEND
    state[0] |= _ENABLED
    asked = state[0]
    fcntl.ioctl(descriptor, _TIOCSRS485, state)
    fcntl.ioctl(descriptor, _TIOCGRS485, state)
    if not state[0] & _ENABLED:
        return 'rs485 has no effect: the driver of the port accepts it and ignores it'
    if (state[0] ^ asked) & (_RTS_ON_SEND | _RTS_AFTER_SEND):
        return ('rs485: the driver of the port has changed the level of RTS; is the transmitter '
                'off while it listens?')
    return ''


def mark_damage(descriptor: int) -> None:
    """
    Let the system check parity, and mark characters whose parity or stop bit is wrong.

    pyserial lets the system send parity, but not check it. Raises OSError.
    """
    try:
        attributes = termios.tcgetattr(descriptor)
        attributes[0] |= termios.INPCK | termios.PARMRK
        attributes[0] &= ~(termios.IGNPAR | termios.ISTRIP | termios.BRKINT)
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
    except termios.error as error:  # the device has just gone
        raise OSError(*error.args) from None


class SerialDevice(DescriptorPort):
    """
    A serial port; with ``is_marked`` a damaged character is returned alone, as ``Damaged``.

    ``mark_damage`` lets the system make the marks. ``name``: if it is given, the error of a lost
    device names the usual causes if the device is lost again and again.
    """

    no_bytes = 'the far end is gone, or another program reads the port too'

    def __init__(self, descriptor: int, close: Callable[[], None], *,
                 is_marked: bool = False, name: str = '') -> None:
        super().__init__(descriptor, close)
        self._name = name
        self._is_marked = is_marked
        self._held = b''  # the beginning of an incomplete mark
        self._pieces: deque[bytes] = deque()
        self._origin = self._counts()
        self._settings = self._current_settings()
        self._next_look = 0.0
        self._written = self._left = 0  # bytes; those that have left are counted at each look
        self._left_at = time.monotonic()  # when bytes left last, or none waited

    def _current_settings(self) -> list[object]:
        try:
            return termios.tcgetattr(self._descriptor)
        except (OSError, termios.error):  # the device is gone; the next read or write reports it
            return []

    def look(self) -> float:
        """
        Check the port if a check is due; return the seconds until the next check.

        Raises OSError if another program has changed the settings, so that we open the port again.
        Raises OSError also if no byte leaves, as without CTS: ``close`` drops the bytes, so that
        no command leaves long after it has ended.
        """
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + SETTINGS_LOOK
            if self._current_settings() not in ([], self._settings):
                raise OSError('another program has changed the settings of the port')
            unsent = self.unsent()
            if not unsent or self._written - unsent != self._left:
                self._left, self._left_at = self._written - unsent, now
            elif now - self._left_at > WRITE_TIMEOUT + SETTINGS_LOOK:
                raise OSError(NO_DATA_TAKEN)
        return self._next_look - now

    def write(self, data: bytes) -> None:
        self.look()
        try:
            super().write(data)
        except OSError as error:
            raise self._lost(error) from None
        self._written += len(data)

    def _take(self) -> bytes:
        try:
            return super()._take()
        except OSError as error:
            raise self._lost(error) from None

    def _lost(self, error: OSError) -> OSError:
        """Record the loss of a device; return the error, with the usual causes if it repeats."""
        text = error.strerror or str(error)
        if text == NO_DATA_TAKEN or not self._name or not has_often_ended(self._name):
            return error
        return OSError(f'{text}, {_ENDS_CAUSE}')

    @property
    def has_pieces(self) -> bool:
        """Return True if the next ``read`` returns bytes that the system has given already."""
        return bool(self._pieces)

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait at most until the next look at the settings: a line may be silent for hours."""
        longest = self.look()
        if self._pieces:
            return self._pieces.popleft()
        data = super().read(longest if timeout is None else min(timeout, longest), wake)
        if not self._is_marked or (not self._held and _MARK not in data):
            return data
        self._divide(self._held + data)
        return self._pieces.popleft() if self._pieces else b''

    def _divide(self, data: bytes) -> None:
        """Undo the marks of termios(3), PARMRK: FF 00 c is a damaged c, FF FF is FF."""
        sound = bytearray()
        at, size = 0, len(data)
        while (mark := data.find(_MARK, at)) >= 0:
            sound += data[at:mark]
            kind = data[mark + 1:mark + 2]
            if not kind or (kind == b'\0' and mark + 2 == size):
                at = mark
                break
            if kind == b'\0':
                self._put(bytes(sound))
                self._put(Damaged(data[mark + 2:mark + 3]))
                sound.clear()
                at = mark + 3
            else:
                sound.append(_MARK)
                at = mark + 2
        else:
            sound += data[at:]
            at = size
        self._held = data[at:]
        self._put(bytes(sound))

    def _put(self, piece: bytes) -> None:
        if piece:
            self._pieces.append(piece)

    def errors(self) -> dict[str, int]:
        """Return the UART's counts since the port was opened; empty if it does not count."""
        return {name: count - self._origin.get(name, 0) for name, count in self._counts().items()}

    def _counts(self) -> dict[str, int]:
        try:
            raw = fcntl.ioctl(self._descriptor, _TIOCGICOUNT, bytes(_ICOUNTER.size))
        except (OSError, ValueError):  # ValueError: closed, so there is no descriptor
            return {}
        counts = _ICOUNTER.unpack(raw)
        return {'parity errors': counts[_PARITY], 'framing errors': counts[_FRAME],
                'overruns': counts[_OVERRUN] + counts[_BUFFER_OVERRUN]}

    def close(self) -> None:
        """Close the device; drop bytes that cannot be sent within 1 s, as without CTS."""
        give_up = time.monotonic() + LAST_BYTES
        with suppress(OSError, termios.error):  # the device is gone
            while self.unsent() and time.monotonic() < give_up:
                time.sleep(_LOOK)
            if self.unsent():  # the system would wait for these bytes up to 30 s
                termios.tcflush(self._descriptor, termios.TCOFLUSH)
                attributes = termios.tcgetattr(self._descriptor)
                attributes[2] &= ~termios.CRTSCTS  # for drivers that cannot drop their bytes
                termios.tcsetattr(self._descriptor, termios.TCSANOW, attributes)
        self._descriptor = -1
        super().close()
