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

"""The settings of a link, of all modes; each link takes those it needs. Times are in seconds."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import LineTiming


@dataclass(frozen=True, slots=True)
class PollingSettings:
    """
    How stations are polled.

    ``priority`` and ``normal`` are the poll lists; ``group_size`` normal stations are polled
    in a scan, 0 for all. With ``multiple`` a station is polled until it has no more messages. With
    ``in_sequence`` commands wait until the master's own address comes up.
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
    """A message that comes again is acknowledged, and not executed again."""

    nak_on_command_timeout: bool = True
    """A master sends DLE NAK when a reply is overdue: slaves then drop what they hold (M 2-7)."""

    accept_slave_messages: bool = True
    """A master serves commands of slaves or passes them on; otherwise they are dropped."""

    polling: PollingSettings | None = None
    """The poll lists of standard polling, None for one list of all mapped stations."""

    max_outstanding: int = 1
    """So many commands of a full-duplex peer may wait for their replies."""

    eot_suppression: bool = False
    """A slave answers a poll only with messages. The master sees no difference to a dead one."""

    poll_timeout: float = 60.0
    """After so long without a poll the commands of a slave fail; 0 for never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings(LinkOptions):
    """Settings of a link, named as in S0, with the defaults of a net CSV."""

    station: int | None = 5
    """Our own number on the line; None for a peer to which messages to any number go."""

    checksum: Checksum = Checksum.CRC
    """The check of every message."""

    timing: LineTiming = LineTiming()
    """How long characters take, and the pause before each transmission."""

    nak_retries: int = 3
    """A message that is not acknowledged is sent again so often; by radio one without a reply."""

    enq_retries: int = 3
    """A poll, or the question for a response, is sent again so often."""

    timeout: float = 1.0
    """How long each answer of another node is waited for."""

    cmd_timeout: float = 1.0
    """How long the reply to a command is waited for."""

    poll_pause: float = 0.005
    """A master waits so long after an EOT, so that the station can finish its reply."""

    queue_size: int = 4
    """So many replies of a slave may wait for a poll before its sink is full."""

    store_forward: Collection[int] = ()
    """A radio modem node sends packets between these on; 255 stands for broadcasts."""

    also: Collection[int] = ()
    """Further numbers of a radio modem node: several simulated PLCs may be one node."""

    avoids_collisions: bool = False
    """Radio modems wait for a quiet line and buffer both directions, so we need not wait."""

    @classmethod
    def of(cls, options: LinkOptions, **line: object) -> LinkSettings:
        """Return the settings of ``line`` with these options."""
        same = {entry.name: getattr(options, entry.name) for entry in fields(LinkOptions)}
        return cls(**same, **line)  # type: ignore[arg-type]
