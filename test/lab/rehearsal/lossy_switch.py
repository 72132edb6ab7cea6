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
A switch that delays and loses packets, for kernels without netem.

``lossy_switch.py SPARED DELAY LOSS LINK...`` passes frames on between the links of its network
namespace at once. From the first line of its input on, they are DELAY ms late, and LOSS % of them
get lost, but not those from and to the link SPARED. It runs until it is ended. Where it may, it
goes before other programs: with one that waits for a processor, all frames would come late.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
import os
import random
import select
import socket
import sys
import time

_ALL = 0x0003  # ETH_P_ALL
_SOL_PACKET, _VNET_HEADER = 263, 15
_HEADER = 10  # struct virtio_net_hdr: what the sender has left to do, such as the checksum
_LARGEST = 1 << 17


def links_of(names: list[str]) -> dict[str, socket.socket]:
    """Return a socket for the frames of each link."""
    links = {}
    for name in names:
        link = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ALL))
        link.setsockopt(_SOL_PACKET, _VNET_HEADER, 1)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 23)
        link.bind((name, 0))
        link.setblocking(False)
        links[name] = link
    return links


def main() -> None:
    """Pass frames on until the process is ended."""
    spared, names = sys.argv[1], sys.argv[4:]
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    delay = loss = 0.0
    links, said_to_us = links_of(names), [sys.stdin]
    homes: dict[bytes, str] = {}
    late: deque[tuple[float, str, bytes]] = deque()

    def send(name: str, data: bytes) -> None:
        try:
            links[name].send(data)
        except OSError:  # the link is down, or full
            pass

    while True:
        wait = max(0.0, late[0][0] - time.monotonic()) if late else None
        readable, _, _ = select.select([*links.values(), *said_to_us], [], [], wait)
        if sys.stdin in readable:
            delay, loss = float(sys.argv[2]) / 1000, float(sys.argv[3]) / 100
            said_to_us.clear()
        while late and late[0][0] <= time.monotonic():
            send(*late.popleft()[1:])
        for name, link in links.items():
            if link not in readable:
                continue
            try:
                data, address = link.recvfrom(_LARGEST)
            except OSError:  # the link went down
                continue
            if address[2] == socket.PACKET_OUTGOING:
                continue
            destination = data[_HEADER:_HEADER + 6]
            homes[data[_HEADER + 6:_HEADER + 12]] = name
            for other in [homes[destination]] if destination in homes else names:
                if other == name:
                    continue
                if spared in (name, other):
                    send(other, data)
                elif random.random() >= loss:
                    late.append((time.monotonic() + delay, other, data))


if __name__ == '__main__':
    main()
