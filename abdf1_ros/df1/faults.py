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

"""What to count and report for a frame that cannot be used; the same at every kind of node."""

from __future__ import annotations

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Fault, Frame, MAX_LINK_DATA
from abdf1_ros.df1.packet import HEADER_SIZE
from abdf1_ros.messages import Event, Message


def count_fault(frame: Frame, checksum: Checksum, counters: Counters,
                station: int | None = None) -> Event:
    """Count the fault of ``frame``, heard from ``station``; return the event that names it."""
    if frame.fault is Fault.BAD_CHECK:
        values = (*divmod(frame.received, 256), *divmod(frame.expected, 256))
        if checksum is Checksum.BCC:
            counters.bcc_errors += 1
            return Event(Message.ERR_BAD_BCC, values, station)
        counters.crc_errors += 1
        return Event(Message.ERR_BAD_CRC, values, station)
    counters.invalid_messages += 1
    if frame.fault is Fault.NO_ETX:
        return Event(Message.NTC_NO_ETX_RCVD, (), station)
    if frame.fault is Fault.TOO_SHORT:
        return Event(Message.NTC_RCVD_MSG_TOO_SHORT, (HEADER_SIZE,), station)
    return Event(Message.NTC_RCVD_MSG_TOO_LONG, (MAX_LINK_DATA,), station)
