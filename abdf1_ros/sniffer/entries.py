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

"""An entry: one symbol or event in the traffic of a line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Direction


class Kind(Enum):
    """The kind of an entry; the value is its name in text and JSON."""

    POLL = 'poll'
    COMMAND = 'command'
    REPLY = 'reply'
    ACK = 'ACK'
    NAK = 'NAK'
    EOT = 'EOT'
    ENQ = 'ENQ'
    DAMAGED = 'damaged'
    UNKNOWN = 'unknown'
    NOISE = 'noise'
    SILENCE = 'silence'
    UNANSWERED = 'no reply'


class Mark(Enum):
    """
    The role of a message in its conversation, if it is not a plain message.

    - Duplicate: it comes again after its acknowledgement; the receiver has to drop it (M 3-4).
    - Retransmission: it comes again before its acknowledgement.
    - Relayed: the master passes it on, unchanged, from a slave to a slave.
    - Forwarded: by radio modem, it comes again soon or from the opposite side, so a node has
      forwarded it.
    - Stray: it is a reply, but its command was not seen.
    - Wrong command code: it is a reply, but its code does not fit its command.
    """

    RETRANSMISSION = 'retransmission'
    DUPLICATE = 'duplicate'
    RELAYED = 'relayed'
    FORWARDED = 'forwarded'
    STRAY = 'stray'
    WRONG_COMMAND = 'wrong command code'


@dataclass(frozen=True, slots=True)
class Entry:
    """
    A symbol or event on the line, and the facts that are known about it.

    - ``time``: seconds, None if the recording has no times.
    - ``station``: the slave; on a full-duplex line the node that gets commands and sends replies.
    - ``valid``: verdict of the check of kind ``checksum``, None without a check.
    - ``latency``: seconds from a command to its reply.
    - ``size``: number of bytes of noise.
    - ``wire``: the bytes on the line, empty for silence, a missing reply and noise.
    - ``guest``: place of the guest (column Share) whose command the recording node has sent.
    - ``request``: the command that a reply answers.
    """

    time: float | None
    direction: Direction
    kind: Kind
    text: str = ''
    station: int | None = None
    checksum: Checksum | None = None
    valid: bool | None = None
    packet: Packet | None = None
    latency: float | None = None
    marks: tuple[Mark, ...] = ()
    size: int = 0
    wire: bytes = b''
    guest: str = ''
    request: Packet | None = None
