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
Run the lines of many_lines.py without this package: the way "bare" of that program.

A node and a thread a line in one process, as in "lines", but a node has nothing except a publisher
for each mapping, with the quality of service that ours have, and a thread does nothing but
write, wait and read with frames made beforehand, and publish ten messages made beforehand. No
time-outs, no decoding, no diagnostics, nobody who could call: what is left is what the operating
system, Python, rclpy and DDS take.
"""

import os
from pathlib import Path
import signal
import sys
import threading
import tty

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.df1 import frames  # noqa: E402
from abdf1_ros.df1.packet import Packet  # noqa: E402
from abdf1_ros.pccc.slc.dialect import SlcDialect  # noqa: E402
from abdf1_ros.ros.topics.messages import encoder, MESSAGES, read_qos  # noqa: E402
from abdf1_ros.settings.map_file import load_mappings  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from paced_line import BareLine  # noqa: E402
import rclpy  # noqa: E402
from rclpy.event_handler import PublisherEventCallbacks  # noqa: E402
from rclpy.node import Node  # noqa: E402

_NETWORK = Network()
_STATION = 1
_TRANSACTIONS = range(1, 9)  # none needs a second DLE


class Line(threading.Thread):
    """A line and its node; it ends with the process."""

    def __init__(self, number: int, port: str, mappings: list[Mapping]) -> None:
        super().__init__(daemon=True)
        self._node = Node(f'line_{number}', namespace='/plant')
        self._descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._descriptor)
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        self._messages = []
        for mapping in mappings:
            publisher = self._node.create_publisher(
                MESSAGES[mapping.message_type], f'~/read/{mapping.topic}', read_qos(mapping, 3.0),
                event_callbacks=quiet)
            self._messages.append((publisher, encoder(mapping)(mapping.codec.decode(bytes(2)))))
        cmd, body = SlcDialect().read(mappings[0].address, len(mappings))
        packets = [Packet(_STATION, _NETWORK.station, cmd, 0, tns, body) for tns in _TRANSACTIONS]
        self._commands = [frames.master_frame(_STATION, packet.encode(), _NETWORK.checksum)
                          for packet in packets]
        self._size = len(frames.message_frame(
            packets[0].reply(bytes(2 * len(mappings))).encode(), _NETWORK.checksum))

    def run(self) -> None:
        """Read and publish for ever."""
        line, poll = BareLine(self._descriptor), frames.poll_frame(_STATION)
        while True:
            for command in self._commands:
                line.ask(command, len(frames.ACK))
                line.ask(poll, self._size)
                os.write(self._descriptor, frames.ACK)
                for publisher, message in self._messages:
                    publisher.publish(message)


def main() -> None:
    """Run until SIGINT; arguments are pairs of a port and a map."""
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(0))
    rclpy.init(args=[])
    pairs = list(zip(sys.argv[1::2], sys.argv[2::2], strict=True))
    lines = [Line(number, port, load_mappings(table)[0])
             for number, (port, table) in enumerate(pairs)]
    for line in lines:
        line.start()
    print(f'{len(lines)} of {len(lines)} lines run', flush=True)
    signal.pause()


if __name__ == '__main__':
    main()
