"""Account for replies, in the same way at every kind of node."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet, REPLY_BIT
from abdf1_ros.df1.stations import Station
from abdf1_ros.errors import WrongCommandCode
from abdf1_ros.messages import Event, Message

Report = Callable[[Event], None]


def check_reply(reply: Packet, command: Packet, station: Station, counters: Counters,
                report: Report) -> None:
    """Count the reply to ``command``; WrongCommandCode when it is another command's (S0)."""
    expected = command.cmd | REPLY_BIT
    if reply.cmd != expected:
        counters.invalid_messages += 1
        details = station.number, reply.cmd, expected
        report(Event(Message.ERR_BAD_FUNCTION_CODE, details, station.number))
        raise WrongCommandCode(*details)
    station.replies += 1
    station.overdue = 0
    station.last_tns = reply.tns
    report(Event(Message.NTC_REPLY_MSG_RCVD, (station.number,), station.number))


def wrong_message(packet: Packet, station: int) -> Event:
    """Return the event of a message from ``station`` that answers nothing outstanding."""
    return Event(Message.ERR_WRONG_MESSAGE, (packet.src, packet.dst, packet.tns), station)
