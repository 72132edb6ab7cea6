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

"""A driver that only listens, and bytes that others have said."""

from collections.abc import Iterable, Sequence

from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.sniffer.capture import Chunk, Direction
from support.driver_bench import Recorder


class ListeningBench:
    """A driver in Mode Listen and its clock; ``has_two_ports``: the far side has its own."""

    def __init__(self, mappings: Sequence[Mapping], *, has_two_ports: bool = False,
                 check: str = 'CRC', cmd_timeout: int = 1000) -> None:
        self.now = 0.0
        self.has_two_ports = has_two_ports
        self.listener = Recorder(lambda: self.now)
        self.driver = Driver(
            Network(mode='Listen', error_code=check, cmd_timeout=cmd_timeout,
                    listen_port='/dev/second' if has_two_ports else ''),
            mappings, DriverSettings(), self.listener)
        self.machine = self.driver.machine
        self.machine.start(0.0)

    def run(self, seconds: float) -> None:
        """Let time pass; nothing is ever sent."""
        end = self.now + seconds
        while (due := self.machine.next_call) is not None and due <= end:
            self.now = max(self.now, due)
            self.machine.handle_timeout(self.now)
            assert self.machine.data_to_send() == b''
        self.now = max(self.now, end)

    def hear(self, data: bytes, *, from_far: bool = False, after: float = 0.001) -> None:
        """Let bytes come."""
        self.run(after)
        self.machine.receive_data(
            SecondPort(data) if from_far and self.has_two_ports else data, self.now)
        assert self.machine.data_to_send() == b''

    def play(self, chunks: Iterable[Chunk]) -> None:
        """Let a recording come, each chunk at its time."""
        begun: float | None = None
        for chunk in chunks:
            assert chunk.time is not None
            begun = chunk.time if begun is None else begun
            wait = max(0.0, 1.0 + chunk.time - begun - self.now)
            self.hear(chunk.data, from_far=chunk.direction is Direction.IN, after=wait)

    def values(self, mapping: Mapping) -> list[object]:
        """Return all that was published of a row."""
        return [*self.listener.values(mapping)]
