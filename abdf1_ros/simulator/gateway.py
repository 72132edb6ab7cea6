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

"""A simulated gateway: one station of the line, and the PLCs behind it."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Symbol
from abdf1_ros.df1.packet import Packet, STS_NOT_DELIVERED
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, Responder
from abdf1_ros.pccc.diagnostics import CMD, ECHO, STATUS
from abdf1_ros.pccc.status import STS_ILLEGAL_COMMAND
from abdf1_ros.simulator.simulated_plc import SimulatedPlc

# Its identity, as pccc/gateways.py reads it: a module with its name.
_IDENTITY = (bytes((0x00, 0xFE, 0x2C, 0x00, 0x00)) + b'1770-KF3'.ljust(11)).ljust(24, b'\0')


class SimulatedGateway:
    """
    A 1770-KF3 and the ``plcs`` behind it.

    The gateway answers as its own station on the line, and passes a command on by DST (M 3-7). It
    keeps the reply of the PLC until a poll, and replies itself for a missing or silent PLC.
    """

    def __init__(self, station: int, plcs: Sequence[SimulatedPlc], checksum: Checksum) -> None:
        self.slave = HalfDuplexSlave(LinkSettings(station=station, checksum=checksum), self._serve)
        self._station = station
        self._plcs = {plc.station: plc for plc in plcs}

    def handle(self, symbol: Symbol) -> bytes:
        """Answer a symbol."""
        return self.slave.handle(symbol)

    def _serve(self, command: Packet) -> Packet:
        if command.dst == self._station:
            return _answer_for_itself(command)
        plc = self._plcs.get(command.dst)
        if plc is None or plc.faults.silent:
            return command.reply(sts=STS_NOT_DELIVERED)
        return plc.serve(command)


def _answer_for_itself(command: Packet) -> Packet:
    """Return the reply to a command for the module itself: an echo, or its identity."""
    function = (command.cmd, command.data[0]) if command.data else None
    if function == (CMD, ECHO):
        return command.reply(command.data[1:])
    if function == (CMD, STATUS):
        return command.reply(_IDENTITY)
    return command.reply(sts=STS_ILLEGAL_COMMAND)


def stations_of(plcs: Sequence[SimulatedPlc], checksum: Checksum) -> list[Responder]:
    """Return the stations of a line: PLCs without a gateway, and gateways of all other PLCs."""
    gateways = dict.fromkeys(plc.via for plc in plcs if plc.via is not None)
    return [*(plc for plc in plcs if plc.via is None),
            *(SimulatedGateway(via, [plc for plc in plcs if plc.via == via], checksum)
              for via in gateways)]
