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

"""The settings of a port: its name and, for a serial port, speed and character format."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, TYPE_CHECKING

from abdf1_ros.df1.machine import character_time

if TYPE_CHECKING:
    from abdf1_ros.settings.network import Network


class Lack(NamedTuple):
    """An option that was asked for and that a port does not have, with the reason."""

    option: str
    text: str


@dataclass(frozen=True, slots=True)
class PortSettings:
    """
    How to open the port ``name``: a device path, ``socket://host:port`` or ``rfc2217://...``.

    These are the columns of the net CSV about the port. With ``low_latency`` a USB adapter passes
    bytes on at once, instead of collecting them for up to 16 ms. ``rs485`` lets the system switch
    the transmitter of an RS-485 port with RTS. A port that does not support one of these
    options is opened without it. With ``listens`` the port is opened for reading only. ``second``
    is the second port of a line that is heard on two ports.
    """

    name: str
    baud: int = 9600
    data_bits: int = 8
    parity: str = 'None'
    stop_bits: int = 1
    handshake: bool = False
    low_latency: bool = True
    rs485: bool = False
    listens: bool = False
    second: str = ''

    @classmethod
    def of(cls, network: Network, name: str = '', *, low_latency: bool = True,
           rs485: bool = False) -> PortSettings:
        """Return the settings of a net CSV, with ``name`` in place of its Com_Port."""
        return cls(name or network.port, network.baud, network.data_bits, network.parity,
                   network.stop_bits, network.handshake, low_latency, rs485,
                   network.line_mode.only_listens, network.second_port)

    @property
    def each(self) -> tuple[PortSettings, ...]:
        """Return the settings of each port of the line."""
        names = (self.name, self.second) if self.second else (self.name,)
        return tuple(replace(self, name=name, second='') for name in names)

    @property
    def char_time(self) -> float:
        """Return the seconds that a character takes."""
        return character_time(self.baud, self.data_bits, self.parity, self.stop_bits)
