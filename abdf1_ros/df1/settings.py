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

"""The settings of links of all modes; each link uses some of them. Times are in seconds."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields, replace

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming


@dataclass(frozen=True, slots=True)
class PollingSettings:
    """
    How stations are polled.

    ``priority`` and ``normal`` are the poll lists; ``group_size`` stations of the normal list are
    polled in a scan, 0 for all. With ``multiple`` a station is polled until it has no more
    messages. With ``in_sequence`` commands wait until the scan reaches the master's own address.
    """

    normal: tuple[int, ...]
    priority: tuple[int, ...] = ()
    group_size: int = 0
    multiple: bool = False
    in_sequence: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkOptions:
    """Settings of a link that are not in the net CSV."""

    duplicate_detection: bool = True
    """Acknowledge a repeated message, but do not execute it again."""

    nak_on_command_timeout: bool | None = None
    """
    A master sends DLE NAK if a reply is overdue: then all slaves drop their messages (M 2-7).

    None: only while no second station of the line has been named.
    """

    accept_slave_messages: bool = True
    """A master serves commands of slaves or passes them on; otherwise it drops them."""

    polling: PollingSettings | None = None
    """The poll lists of standard polling; None for one list of all mapped stations."""

    max_outstanding: int = 1
    """Number of commands of a full-duplex peer that may wait for replies at the same time."""

    seed: int | None = None
    """The seed of a radio modem node's random times; None for other times at each start."""

    eot_suppression: bool = False
    """
    A slave without a message does not answer a poll. For the master it looks like a dead station.
    """

    poll_timeout: float = 60.0
    """Seconds without a poll after which the commands of a slave fail; 0 for never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings(LinkOptions):
    """Settings of a link, named as in S0, with the defaults of a net CSV."""

    station: int | None = 5
    """Our own number on the line; None for a peer that takes messages to any number."""

    checksum: Checksum = Checksum.CRC
    """The check of every message."""

    timing: LineTiming = LineTiming()
    """The time that characters take, and the pause before each transmission."""

    nak_retries: int = 3
    """Most repetitions of a message without ACK; by radio, of a message without a reply."""

    enq_retries: int = 3
    """Most repetitions of a poll, or of an ENQ for a response."""

    timeout: float = 1.0
    """Most seconds to wait for each answer of another node."""

    cmd_timeout: float = 1.0
    """Most seconds to wait for the reply to a command."""

    poll_pause: float = 0.005
    """Seconds that a master waits after an EOT, so that the station can finish its reply."""

    queue_size: int = 4
    """
    Most replies of a slave that wait for a poll. With this number it accepts no commands.
    """

    store_forward: Collection[int] = ()
    """A radio modem node forwards packets between these nodes; 255 stands for broadcasts."""

    also: Collection[int] = ()
    """
    Further numbers of a radio modem node, which may simulate several PLCs. They may change.
    """

    avoids_collisions: bool = False
    """The radios wait for a quiet line and buffer both directions, so we need not wait."""

    def having(self, options: LinkOptions) -> LinkSettings:
        """Return these settings with other options."""
        return replace(self, **{
            entry.name: getattr(options, entry.name) for entry in fields(LinkOptions)})
