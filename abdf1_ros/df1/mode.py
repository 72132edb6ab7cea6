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

"""A mode of a line: how its link is made, and how long its transactions take."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.frames import Duplex, poll_frame
from abdf1_ros.df1.link import Link, quiet_time
from abdf1_ros.df1.machine import Background, Machine, MIN_RESPONSE_TIME, Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.messages import Event

Serve = Callable[[Packet], Packet]
"""Executes a command of another node, and returns the reply."""

Report = Callable[[Event], None]
"""Gets every numbered error and notice."""


class LinkMaker(Protocol):
    """A function that makes a link, or the class of the link itself."""

    def __call__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Serve, report: Report) -> Link: ...


class LineMode:
    """A mode, as the columns Mode and Polling of a net CSV name it; times are in seconds."""

    name: ClassVar[str]
    """The name of the mode in the column Mode."""

    link: ClassVar[LinkMaker]
    """Makes the link of the mode."""

    polling: ClassVar[str] = ''
    """The value of the column Polling, if the mode depends on this column."""

    other_words: ClassVar[Mapping[str, str]] = {}
    """Names that other products have for the mode, in lower case, each with the mode to advise."""

    duplex: ClassVar[Duplex] = Duplex.HALF
    """The duplex that decides the meaning of symbols."""

    is_master: ClassVar[bool] = False
    """
    True if we poll the stations of the line, and reach other stations through their gateways.
    """

    has_one_plc: ClassVar[bool] = False
    """True if the line has one far end only, whose number does not matter."""

    is_polled: ClassVar[bool] = False
    """True if another node is the master, which decides when we may send."""

    waits_for_acks: ClassVar[bool] = False
    """True if each message waits for its response, at most Timeout."""

    only_listens: ClassVar[bool] = False
    """True if we send nothing, and fill rows from the traffic of other nodes."""

    takes_turns: ClassVar[bool] = False
    """True if all stations are polled in turn, whether there is a command for them or not."""

    answers_by_itself: ClassVar[bool] = False
    """True if we answer commands of the far end even without Serve rows."""

    answers: ClassVar[int] = 2
    """
    Number of answers of the station in a transaction: mostly an ACK to the command, and the reply.
    """

    why_unshared: ClassVar[str] = ''
    """The reason why guests cannot share the line; empty if they can."""

    def make_machine(self, line: LinkSettings, run: Callable[[], Procedure], counters: Counters,
                     background: Background | None = None) -> Machine:
        """Return the machine for a line of this mode, with ``run`` as its procedure."""
        return Machine(
            lambda machine: run(), checksum=line.checksum, duplex=self.duplex, timing=line.timing,
            counters=counters, forget_on_send=self.is_master, background=background)

    def make_link(self, machine: Machine, line: LinkSettings, stations: ActiveStationList,
                  serve: Serve, report: Report) -> Link:
        """Return the link that runs on a machine of this mode."""
        return self.link(machine, line, stations, serve, report)

    def pause(self, line: LinkSettings) -> float:
        """Return how long a command usually waits for a quiet line."""
        return 0.0

    def idle_poll(self, line: LinkSettings) -> float:
        """Return the time of a poll without a reply where stations take turns, elsewhere 0."""
        return 0.0

    def most_under_way(self, line: LinkSettings) -> int:
        """Return how many stations may work on their replies at a time."""
        return 1

    def longest_transaction(self, line: LinkSettings, frames: float, others: float = 0.0,
                            stations: int = 0) -> float:
        """
        Return the longest time of a transaction that succeeds, with all retries.

        ``frames`` is the time that its frames take if each is sent once. ``others`` is the longest
        such time of any other transaction. ``stations`` is the number of stations on the line.
        """
        timeout = answer_time(line)
        # Cmd_Timeout runs from the beginning of the try that is acknowledged.
        tries = line.nak_retries + line.enq_retries + 1
        # The end of a frame that breaks off is only known after a pause.
        return tries * timeout + max(line.cmd_timeout, timeout) \
            + (max(line.nak_retries, line.enq_retries) + 1) \
            * (frames + quiet_time(line.timing.char_time))

    def undisturbed(self, line: LinkSettings, frames: float, response_time: float,
                    others: float = 0.0, stations: int = 0) -> float:
        """
        Return the longest time of a transaction in which no frame gets lost.

        Each answer begins after ``response_time``. The other parameters are those of
        ``longest_transaction``.
        """
        return frames + self.answers * response_time

    def longest_reply(self, line: LinkSettings, frames: float) -> float:
        """Return the longest time to send our own reply; our replies take turns with commands."""
        return (line.nak_retries + 1) * (answer_time(line) + frames)

    def last_tries(self, line: LinkSettings, frames: Sequence[float],
                   answer_within: float) -> float:
        """
        Return the time to send each of some commands once, if no station answers.

        ``frames`` has the time of each command. The wait for an answer is ``answer_within`` at
        most. A probe that is under way may have to end first.
        """
        wait = min(answer_time(line), answer_within)
        return self.longest_probe(line) + sum(frames) + len(frames) * wait

    def longest_probe(self, line: LinkSettings) -> float:
        """Return the time of a probe that a station does not answer."""
        return answer_time(line) + line.timing.tx_delay \
            + len(poll_frame(0)) * line.timing.char_time


def answer_time(line: LinkSettings) -> float:
    """Return the longest wait for an answer: Timeout, but at least MIN_RESPONSE_TIME."""
    return max(line.timeout, MIN_RESPONSE_TIME)
