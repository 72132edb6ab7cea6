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

"""The diagnostic commands as a server answers them."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.diagnostics import (
    CMD,
    ECHO,
    Echo,
    MAX_COUNTERS,
    max_echo,
    READ_COUNTERS,
    ReadCounters,
    RESET_COUNTERS,
    STATUS,
)
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.serving import Commands


def served_diagnostics(processor: EmulatedProcessor,
                       counters: ServedCounters | None) -> Commands:
    """
    Return what executes each command, by CMD and FNC; FormatError for a bad request.

    Without ``counters`` a read of them is refused. Commands that set up a link (06/02, 04 to 06,
    08) are not served: our settings come from a file, and must not be changed from the line.
    """
    commands: Commands = {
        (CMD, ECHO): lambda reader: _echo(reader, max_echo(processor.plc_type)),
        (CMD, STATUS): lambda reader: _without_parameters(reader, processor.encode()),
    }
    if counters is not None:
        commands[CMD, READ_COUNTERS] = lambda reader: _counters(
            reader, processor.plc_type, counters.encode())
        commands[CMD, RESET_COUNTERS] = lambda reader: _reset(reader, counters)
    return commands


def _echo(reader: Reader, limit: int) -> bytes:
    data = Echo.read(reader).data
    if len(data) > limit:
        raise FormatError(f'an echo of {len(data)} bytes, at most {limit}')
    return data


def _counters(reader: Reader, plc_type: PlcType, block: bytes) -> bytes:
    request = ReadCounters.read(reader)
    if request.size > MAX_COUNTERS:
        raise FormatError(f'{request.size} bytes of counters, at most {MAX_COUNTERS}')
    if request.address and plc_type is not PlcType.PLC5:  # which ignores it
        raise FormatError(f'counters at address {request.address}; they are at 0')
    return block[:request.size]


def _reset(reader: Reader, counters: ServedCounters) -> bytes:
    reader.end()
    counters.reset()
    return b''


def _without_parameters(reader: Reader, reply: bytes) -> bytes:
    reader.end()
    return reply
