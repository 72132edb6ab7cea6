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

"""The serial ports of this machine, and the adapters plugged in."""

from __future__ import annotations

from dataclasses import dataclass
import os
from pathlib import Path

from serial.tools import list_ports

BY_ID = Path('/dev/serial/by-id')
TTYS = Path('/sys/class/tty')


@dataclass(frozen=True, slots=True)
class SerialPortInfo:
    """
    A serial port.

    ``stable`` is a name that stays the same when adapters change places, empty if there is none.
    ``adapter`` is the description that the adapter gives. ``may_open`` tells whether this user may
    open the port.
    """

    device: str
    stable: str
    adapter: str
    may_open: bool


def serial_ports() -> list[SerialPortInfo]:
    """Return the ports that have hardware, adapters first."""
    found = [port for port in list_ports.comports()
             if port.hwid != 'n/a' or _has_uart(port.device)]
    stable = _stable_names()
    return sorted(
        (SerialPortInfo(
            port.device, stable.get(os.path.realpath(port.device), ''),
            '' if port.description in ('n/a', port.name) else port.description,
            os.access(port.device, os.R_OK | os.W_OK)) for port in found),
        key=lambda port: (not port.stable, port.device))


def _stable_names() -> dict[str, str]:
    """Return the names that udev has made, by the device that they point to."""
    if not BY_ID.is_dir():
        return {}
    return {os.path.realpath(link): str(link) for link in sorted(BY_ID.iterdir())}


def _has_uart(device: str) -> bool:
    """Tell whether a port has hardware: Linux has names for 32 ports that may not exist."""
    try:
        return (TTYS / Path(device).name / 'type').read_text(encoding='ascii').strip() != '0'
    except (OSError, UnicodeError):
        return False
