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

"""The commands that read, write and identify a PLC, and how they end."""

from __future__ import annotations

from abdf1_ros.driver.write import Outcome, outcome_of, Write, WriteResult
from abdf1_ros.errors import (
    CommandTimeout,
    FormatError,
    LinkError,
    NoWholeReply,
    RemoteError,
    ReplyHindered,
    StationInactive,
)
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.fields import word
from abdf1_ros.pccc.status import check_status, STS_ILLEGAL_COMMAND
from abdf1_ros.pccc.steps import data_of, written_before

# After these errors a station may execute the next packet.
_TAKEN_OR_NOT = RemoteError, CommandTimeout, StationInactive, NoWholeReply, ReplyHindered

REWRITTEN = ('by reading the word and writing it back; a change that the PLC made in between is '
             'lost')


def carry_out(write: Write) -> Steps[WriteResult]:
    """
    Send every packet of a write, as long as each is confirmed.

    A write of our own continues after a packet that was refused or not answered: the PLC may
    execute the remaining packets.
    """
    done, detail, failed, station = 0, '', None, write.mapping.station
    for packet in range(len(write.commands)):
        try:
            detail = (yield from _send(write, packet)) or detail
            done += 1
        except (RemoteError, LinkError) as error:
            if failed is None or outcome_of(station, error) is Outcome.UNKNOWN:
                failed = error  # it may still land
            if not write.is_own or not isinstance(error, _TAKEN_OR_NOT):
                break
    outcome = outcome_of(station, failed)
    if failed is not None:
        return _ended_early(write, outcome, done, failed)
    return write.result(outcome, detail)


def _send(write: Write, packet: int) -> Steps[str]:
    """Send one packet; return a remark for the result, empty for none."""
    try:
        data_of((yield write.commands[packet]), write.mapping.address)
    except RemoteError as error:
        if error.sts != STS_ILLEGAL_COMMAND or not write.mapping.may_rewrite:
            raise
        write.is_rewriting = True
        try:
            yield from _rewrite(write, packet, error)
        finally:
            write.is_rewriting = False
        return REWRITTEN
    return ''


def _rewrite(write: Write, packet: int,
             refusal: RemoteError) -> Steps[None]:
    """Replace a refused masked write: read the word and write it back changed."""
    dialect = write.mapping.dialect
    address, mask, bits = write.bit_change(packet)
    try:
        reply = check_status((yield dialect.read(address, 1)))
        old = int.from_bytes(dialect.read_data(address, 1, reply), 'little')
    except LinkError as error:
        error.sent = False  # the refused command and a read have changed nothing
        raise
    except (RemoteError, FormatError) as error:
        raise RemoteError(refusal.sts, refusal.ext_sts, f'{refusal}; its word cannot be read to '
                          f'be written back: {error}') from None
    check_status((yield dialect.write(address, word(old & ~mask | bits & mask))))


def _ended_early(write: Write, outcome: Outcome, done: int,
                 error: LinkError | RemoteError) -> WriteResult:
    if not done:
        return write.result(outcome, str(error), error)
    detail = f'{error}{written_before(done, len(write.commands))}'
    return write.result(Outcome.PARTLY, detail, error)
