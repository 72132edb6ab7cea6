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

"""STS and EXT STS of a reply, in words: M 8-2..8-4, and M 8-5..8-10 where a family differs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import RemoteError

EXTENDED = 0xF0

STS_ILLEGAL_COMMAND = 0x10
STS_ADDRESS = 0x50

EXT_ILLEGAL_FIELD = 0x01
EXT_TOO_FEW_LEVELS = 0x02
EXT_TOO_MANY_LEVELS = 0x03
EXT_NO_SUCH_SYMBOL = 0x04
EXT_BAD_SYMBOL = 0x05
EXT_BAD_ADDRESS = 0x06
EXT_WRONG_SIZE = 0x07
EXT_PAST_THE_END = 0x09
EXT_TOO_LARGE = 0x0A
EXT_NO_PRIVILEGE = 0x0B
EXT_OTHER_TYPE = 0x11
EXT_BAD_PARAMETER = 0x12
EXT_DELETED_AREA = 0x13
EXT_TYPE_MISMATCH = 0x17
EXT_PROTECTED = 0x1E

_ADDRESS_FAULTS = (
    EXT_ILLEGAL_FIELD, EXT_TOO_FEW_LEVELS, EXT_TOO_MANY_LEVELS, EXT_NO_SUCH_SYMBOL,
    EXT_BAD_SYMBOL, EXT_BAD_ADDRESS, EXT_WRONG_SIZE, EXT_PAST_THE_END, EXT_TOO_LARGE,
    EXT_DELETED_AREA, EXT_TYPE_MISMATCH, EXT_PROTECTED)

# After these codes the reply has the address of the node that owns the file or program (M 8-5).
_WITH_OWNER = (0x1A, 0x1B)

_LOCAL = {
    0x01: 'destination has no buffer space',
    0x02: 'destination does not acknowledge, delivery not guaranteed',
    0x03: 'duplicate token holder seen',
    0x04: 'local port is disconnected',
    0x05: 'no reply in time (application timeout)',
    0x06: 'duplicate node address',
    0x07: 'station is off line',
    0x08: 'hardware fault',
}

_REMOTE = {
    0x10: 'illegal command, format or length, or the file does not exist',
    0x20: 'host has a problem and does not communicate',
    0x30: 'remote host is missing, disconnected or shut down',
    0x40: 'hardware fault in the host',
    0x50: 'address not there, or memory protected',
    0x60: 'function disallowed by a protection setting',
    0x70: 'processor is in program mode',
    0x80: 'compatibility file missing, or communication zone problem',
    0x90: 'remote node cannot buffer the command',
    0xA0: 'wait for acknowledge (buffer full)',
    0xB0: 'problem because of a download',
    0xC0: 'wait for acknowledge (buffer full)',
    0xF0: 'extended status missing from the reply',
}

_EXTENDED = {
    0x01: 'a field has an illegal value',
    0x02: 'fewer address levels than this needs',
    0x03: 'more address levels than the system has',
    0x04: 'symbol not found',
    0x05: 'symbol is badly formed',
    0x06: 'address does not point to something usable',
    0x07: 'file has the wrong size',
    0x08: 'situation has changed since the transaction began',
    0x09: 'data or file too large',
    0x0A: 'transaction size plus word address too large',
    0x0B: 'no access: privilege missing',
    0x0C: 'condition cannot be produced, resource not available',
    0x0D: 'condition exists already, resource is already available',
    0x0E: 'command cannot be executed',
    0x0F: 'histogram overflow',
    0x10: 'no access',
    0x11: 'data type does not fit the request',
    0x12: 'bad parameter or data',
    0x13: 'address points into a deleted area',
    0x14: 'failed for an unknown reason',
    0x15: 'data conversion error',
    0x16: 'scanner cannot reach the rack adapter',
    0x17: 'type mismatch',
    0x18: 'bad response from the module',
    0x19: 'duplicate label',
    0x1A: 'file is open, owned by another node',
    0x1B: 'program is owned by another node',
    0x1E: 'data table element is protected',
    0x1F: 'temporary internal problem',
    0x22: 'remote rack fault',
    0x23: 'timeout on the way to the remote rack',
    0x24: 'unknown error',
}


@dataclass(frozen=True, slots=True)
class Meanings:
    """The meanings of a family's codes, where they differ from M 8-2..8-4."""

    sts: Mapping[int, str] = field(default_factory=dict)
    ext_sts: Mapping[int, str] = field(default_factory=dict)


USUAL_MEANINGS = Meanings()


def status_text(sts: int, ext_sts: int | None = None, meanings: Meanings = USUAL_MEANINGS) -> str:
    """
    Return codes and meaning, e.g. "STS 50: address not there, or memory protected".

    ``meanings`` belongs to the family of the station that has answered.
    """
    if sts & EXTENDED == EXTENDED and ext_sts is not None:
        known = {**_EXTENDED, **meanings.ext_sts}
        return f'STS {sts:02X} EXT STS {ext_sts:02X}: {known.get(ext_sts, "unknown code")}'
    remote = {**_REMOTE, **meanings.sts}
    parts = [remote.get(sts & 0xF0), _LOCAL.get(sts & 0x0F)]
    meaning = '; '.join(part for part in parts if part) or 'unknown code'
    return f'STS {sts:02X}: {meaning}'


def check_status(reply: Packet, meanings: Meanings = USUAL_MEANINGS) -> bytes:
    """
    Return the data of a reply that reports success.

    Raises RemoteError for any other reply, also if it ends before its EXT STS.
    """
    if reply.sts == 0:
        return reply.data
    extended = reply.sts & EXTENDED == EXTENDED and len(reply.data) > 0
    ext_sts = reply.data[0] if extended else None
    text = status_text(reply.sts, ext_sts, meanings)
    if ext_sts in _WITH_OWNER and len(reply.data) > 1:
        text += f' ({reply.data[1]})'
    raise RemoteError(reply.sts, ext_sts, text)


def is_address_fault(error: RemoteError) -> bool:
    """Tell whether the station refused the address or extent, not the time or the sender."""
    if error.ext_sts is not None:
        return error.ext_sts in _ADDRESS_FAULTS
    return error.sts in (STS_ILLEGAL_COMMAND, STS_ADDRESS)
