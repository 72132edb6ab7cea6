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

"""A bridge in this process, its PLCs, and who looks at both."""

from pathlib import Path
import signal
from typing import Any

from abdf1_ros import testing
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.bridge.port_owners import PortOwners
from support.ros import Observer, ros_args


class BridgeCell(testing.SimulatedCell):
    """What ``abdf1_cell`` makes, with the bridge in the executor of ``ros``."""

    observer = Observer
    ros: Observer

    def __init__(self, folder: Path, data: str, rows: str, net: str, *assignments: str) -> None:
        super().__init__(folder, data, rows, net, parameters=assignments)
        self.net, self.map = folder / 'net.csv', folder / 'map.csv'

    def start(self) -> None:
        """Start the bridge; wait for its port."""
        self.results = self.ros.results()
        self.diagnostics = self.ros.diagnostics(self.plcs.port)
        self.port_owners = PortOwners()
        self.node = BridgeNode(context=self.ros.context, use_global_arguments=False,
                               port_owners=self.port_owners, cli_args=ros_args(*self.assignments))
        self.ros.run(self.node)
        self.ros.until(lambda: self.node.session.driver.is_online, 'the port')

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End the bridge in order, if it runs."""
        self.ros.end(self.node)
        return 0

    def call(self, kind: Any, name: str, request: Any) -> Any:
        return self.ros.call(kind, f'/abdf1/{name}', request)
