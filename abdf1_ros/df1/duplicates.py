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
Messages that come again in full duplex: which are repetitions, and which are new.

A message is sent again when its sender has not understood our response (M 4-5). So a repetition
comes within the time that the sender's retries take. If the sender has acknowledged our reply and
has not asked again, a repetition comes within the time of one retry. A later message with the same
TNS is a new message: some processors count from 0 after each power-up, and some programs always
send 0. A sender whose last two commands had different TNS gets a little more time: AdvancedHMI
repeats its commands 0.95 to 1.06 s later, also those that were acknowledged.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings

# The ACK time-out (s) and the number of ENQs in the default settings of the products.
_ACK_TIMEOUT = 1.0
_ENQ_LIMIT = 3

# Longest delay (s) of a repetition after the ACK time-out of a sender that counts its commands.
_LATE_REPETITION = 0.25


@dataclass(slots=True)
class _Accepted:
    """
    The last message accepted: its key (M 4-4), and when (clock value in s) it came.

    ``is_counted`` tells that the last command of its sender had another TNS, ``is_answered`` that
    our reply to it has been acknowledged. ``may_come_again`` tells that its sender has asked for a
    response again, or that we have sent a NAK.
    """

    key: tuple[int, int, int]
    when: float
    is_counted: bool
    is_answered: bool = False
    may_come_again: bool = False


class DuplicateDetection:
    """Remember the last message of a full-duplex line, and tell whether it comes again (M 4-8)."""

    def __init__(self, settings: LinkSettings) -> None:
        self._is_on = settings.duplicate_detection
        # Most seconds that the far end needs for its retries. Of our settings and the default
        # settings of the products, the larger value counts.
        self._ack_timeout = max(_ACK_TIMEOUT, settings.timeout)
        self._retry_time = (max(_ENQ_LIMIT, settings.enq_retries) + 1) * self._ack_timeout
        self._accepted: _Accepted | None = None
        self._last_command: Packet | None = None

    def accepted(self, packet: Packet, now: float) -> None:
        """Record a message that has been accepted."""
        self._accepted = _Accepted(packet.duplicate_key, now, self._is_counted(packet))

    def _is_counted(self, packet: Packet) -> bool:
        """Record a command; return True if the last command of its sender had another TNS."""
        if packet.is_reply:
            return False
        last, self._last_command = self._last_command, packet
        return last is not None and last.src == packet.src and last.tns != packet.tns

    def is_repetition(self, packet: Packet, now: float) -> bool:
        """Tell whether a message is a repetition of the last one."""
        last = self._accepted
        if last is None or last.key != packet.duplicate_key or not self._is_on:
            return False
        is_done = last.is_answered and not last.may_come_again
        return now - last.when < (
            self._ack_timeout + _LATE_REPETITION * last.is_counted if is_done
            else self._retry_time)

    def expect_repetition(self) -> None:
        """Record that the far end may send its last message again."""
        if self._accepted is not None:
            self._accepted.may_come_again = True

    def replied(self, reply: Packet, *, is_delivered: bool) -> None:
        """Record that our reply has been sent, and whether it has been acknowledged."""
        if self._accepted is not None and self._accepted.key == reply.key_of_command:
            self._accepted.is_answered = is_delivered

    def forget_message(self) -> None:
        """Take a message like the last one for a new one."""
        self._accepted = None
