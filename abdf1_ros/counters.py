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
The status counters of the driver, in one table.

Source: S0 (see ``abdf1_ros.df1``), tables "Status Counters" and "Hardware Status Counters". The
description of each counter says which event it counts. These descriptions are our interpretation
of the names.
"""

from __future__ import annotations

from dataclasses import dataclass, Field, field, fields


def _counter(number: int, mnemonic: str, description: str) -> int:
    metadata = {'number': number, 'mnemonic': mnemonic, 'description': description}
    return field(default=0, metadata=metadata)


@dataclass(slots=True)
class Counters:
    """
    Counts since start.

    Only the thread that runs the link adds to them; any thread may read them.
    """

    messages_sent: int = _counter(
        2525, 'CNT_MSG_PACKETS_SENT', 'message frames transmitted, retries included')
    messages_received: int = _counter(
        2526, 'CNT_MSG_PACKETS_RCVD', 'message frames received with a good check')
    commands_sent: int = _counter(
        2527, 'CNT_CMD_MSGS_SENT', 'commands transmitted, retries not counted again')
    commands_received: int = _counter(2528, 'CNT_CMD_MSGS_RCVD', 'commands received')
    replies_sent: int = _counter(
        2529, 'CNT_REPLY_MSGS_SENT', 'replies transmitted, retries not counted again')
    replies_received: int = _counter(2530, 'CNT_REPLY_MSGS_RCVD', 'replies received')
    polls_sent: int = _counter(2531, 'CNT_POLL_MSGS_SENT', 'master polls transmitted')
    polls_received: int = _counter(
        2532, 'CNT_POLL_MSGS_RCVD', 'master polls received for our own address')
    naks_sent: int = _counter(2533, 'CNT_NAKS_SENT', 'DLE NAK transmitted')
    naks_received: int = _counter(2534, 'CNT_NAKS_RCVD', 'DLE NAK received')
    acks_sent: int = _counter(2535, 'CNT_ACKS_SENT', 'DLE ACK transmitted')
    acks_received: int = _counter(2536, 'CNT_ACKS_RCVD', 'DLE ACK received')
    eots_sent: int = _counter(2537, 'CNT_EOTS_SENT', 'DLE EOT transmitted')
    eots_received: int = _counter(2538, 'CNT_EOTS_RCVD', 'DLE EOT received')
    error_messages_sent: int = _counter(
        2539, 'CNT_ERROR_MSGS_SENT', 'replies transmitted with a nonzero STS')
    error_messages_received: int = _counter(
        2540, 'CNT_ERROR_MSGS_RCVD', 'replies received with a nonzero STS')
    nak_retries: int = _counter(
        2541, 'CNT_NAK_RETRIES', 'message frames transmitted again: no ACK, a NAK, or garbage')
    nak_limit_exceeded: int = _counter(
        2542, 'CNT_NAK_LIMIT_EXCEEDED', 'messages given up after the last NAK retry')
    enq_retries: int = _counter(
        2543, 'CNT_ENQ_RETRIES', 'polls transmitted again: no answer or a bad one')
    enq_limit_exceeded: int = _counter(
        2544, 'CNT_ENQ_LIMIT_EXCEEDED', 'messages given up after the last ENQ retry')
    command_timeouts: int = _counter(
        2545, 'CNT_COMMAND_TIMEOUTS', 'transactions that took longer than Cmd_Timeout')
    bcc_errors: int = _counter(2546, 'CNT_BCC_ERRORS', 'frames received with a wrong BCC')
    crc_errors: int = _counter(2547, 'CNT_CRC_ERRORS', 'frames received with a wrong CRC')
    stale_messages: int = _counter(
        2548, 'CNT_STALE_MSGS_RCVD', 'replies received to a transaction no longer outstanding')
    duplicate_messages: int = _counter(
        2549, 'CNT_DUPLICATE_MSGS_RCVD', 'messages received a second time')
    invalid_messages: int = _counter(
        2550, 'CNT_INVALID_MSGS_RCVD',
        'messages received too short, too long, incomplete, or wrongly addressed')
    read_errors: int = _counter(2551, 'CNT_COM_READ_ERRORS', 'failures to read from the port')
    chars_sent: int = _counter(2560, 'CRD_CHAR_SENT', 'characters transmitted')
    chars_received: int = _counter(2561, 'CRD_CHAR_RECV', 'characters received')
    # The specification has no numbers for these: a PLC's diagnostic counters show them (M 9-6).
    enqs_received: int = 0
    refused_for_memory: int = 0
    unsent_messages: int = 0  # by radio, when the port was lost

    @property
    def damaged_frames(self) -> int:
        """Return the number of frames that were received with a wrong check."""
        return self.bcc_errors + self.crc_errors

    def by_mnemonic(self) -> dict[str, int]:
        """Return every counter by its mnemonic, in the order of the numbers."""
        return {entry.metadata['mnemonic']: getattr(self, entry.name) for entry in numbered()}


def numbered() -> list[Field[int]]:
    """Return the counters of the specification, in the order of their numbers."""
    return [entry for entry in fields(Counters) if entry.metadata]
