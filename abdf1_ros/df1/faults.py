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
