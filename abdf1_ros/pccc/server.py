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
Answer commands from a data table, as a PLC of the table's family does.

M 8-2..8-4 have only some of the answers of a real PLC to bad requests. All other answers come from
reports of drivers in the field.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from abdf1_ros.df1.packet import Packet, PRIORITY_BIT
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import diagnostics, status
from abdf1_ros.pccc.address import AddressRefusal
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange, Protected
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.serving import Commands, extended, Refusal


class Server:
    """Execute commands on ``table``; a link passes its commands to ``serve``."""

    def __init__(self, table: DataTable, processor: EmulatedProcessor | None = None,
                 counters: ServedCounters | None = None) -> None:
        family = FAMILIES[table.plc_type]
        processor = processor or EmulatedProcessor()
        self.family = family.commands(table, processor)
        self.commands: Commands = self.family.commands | _diagnostics(
            family, processor, counters)

    def serve(self, command: Packet) -> Packet:
        """Return the reply to ``command``; every command has one."""
        try:
            return command.reply(self._execute(command))
        except Refusal as refusal:
            data = b'' if refusal.ext_sts is None else bytes((refusal.ext_sts,))
            return command.reply(data, refusal.sts)

    def _execute(self, command: Packet) -> bytes:
        if not command.is_sound:
            raise Refusal(status.STS_ILLEGAL_COMMAND)
        reader = Reader(command.data)
        cmd = command.cmd & ~PRIORITY_BIT
        try:
            basic = self.family.basic_commands.get(cmd)
            if basic is not None:
                return basic(reader, command.src)
            function = self.commands.get((cmd, reader.byte()))
            if function is None:
                raise Refusal(status.STS_ILLEGAL_COMMAND)
            return function(reader)
        except NoSuchFile:
            raise Refusal(*self.family.no_such_file) from None
        except OutOfRange:
            raise Refusal(*self.family.out_of_range) from None
        except Protected:
            raise Refusal(*self.family.protected) from None
        except AddressRefusal as error:
            raise extended(error.ext_sts) from None
        except FormatError:
            raise Refusal(status.STS_ILLEGAL_COMMAND) from None


def _diagnostics(family: Family, processor: EmulatedProcessor,
                 counters: ServedCounters | None) -> Commands:
    """
    Return the diagnostic commands by CMD and FNC; they raise FormatError for a bad request.

    Without ``counters`` a read and a reset of counters are refused. Commands that set up a link
    (06/02, 04 to 06, 08) are not served: our settings come from a file, and must not be changed
    from the line.
    """
    cmd = diagnostics.CMD
    commands: Commands = {(cmd, diagnostics.ECHO): partial(_echo, family.max_echo),
                          (cmd, diagnostics.STATUS): partial(
                              _reply, partial(family.encode_identity, processor))}
    if counters is not None:
        commands[cmd, diagnostics.READ_COUNTERS] = partial(_counters, family, counters)
        commands[cmd, diagnostics.RESET_COUNTERS] = partial(_reply, counters.reset)
    return commands


def _echo(limit: int, reader: Reader) -> bytes:
    data = reader.rest()
    if len(data) > limit:
        raise FormatError(f'an echo of {len(data)} bytes, at most {limit}')
    return data


def _counters(family: Family, counters: ServedCounters, reader: Reader) -> bytes:
    request = diagnostics.ReadCounters.read(reader)
    if request.size > diagnostics.MAX_COUNTERS:
        raise FormatError(f'{request.size} bytes of counters, at most {diagnostics.MAX_COUNTERS}')
    if request.address and not family.counters_anywhere:
        raise FormatError(f'counters at address {request.address}; they are at 0')
    return counters.encode()[:request.size]


def _reply(carry_out: Callable[[], bytes], reader: Reader) -> bytes:
    """Carry out a command without parameters."""
    reader.end()
    return carry_out()
