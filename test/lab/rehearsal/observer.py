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
Look at the lines of a plant from another host, write to them, and judge.

``observer.py LINES PERIOD`` writes to each line each PERIOD s, and expects values as often. With
``listen`` as a third word it writes nothing: another observer does. It says on standard output, a
line each: ``ill WHY`` while a line is not read or not written to, ``doubled WHY`` while the
endpoints of two bridges are seen, ``well`` otherwise, ``quiet NUMBER`` and ``back NUMBER`` when
values of a line end and come again, and ``BROKEN WHY`` for what must never be. Each line of its
input lets it count anew. At the end of its input it says what it has counted.
"""

from __future__ import annotations

from functools import partial
from queue import SimpleQueue
import sys
import threading
import time
from typing import Any

from abdf1_ros.ros.topics.messages import latched_qos
from diagnostic_msgs.msg import DiagnosticStatus
import rclpy
from rclpy.node import Node
from std_msgs.msg import Int16MultiArray, MultiArrayDimension, MultiArrayLayout

_FRESH = 2.0  # s
_GAP = 3.5  # Periods of a value
_LOOKS = 0.1
_RAMP = 1000  # where a ramp of the simulator begins again


class Line:
    """What is known of one line; its ramp and the commands go up, so an old one is seen."""

    def __init__(self, node: Node, name: str, period: float) -> None:
        self.name, self._node, self._gap = name, node, _GAP * period
        self.values = self.results = self.commands = self.fallbacks = self.late = 0
        self.number = 0
        self.broken: list[str] = []
        self._ramp = self._held = -1
        self._seen = self._written = -1e9
        self._requests: dict[str, int] = {}
        self._sent: dict[str, float] = {}
        self.slowest, self._is_quiet = 0.0, True
        if sys.argv[3:] != ['listen']:
            node.create_timer(period, self.write)
        self._publisher = node.create_publisher(Int16MultiArray, f'{name}/write/command', 10)
        for tag, take in (('ramp', self._take_ramp), ('held', self._take_held)):
            node.create_subscription(Int16MultiArray, f'{name}/read/{tag}', take, latched_qos())
        node.create_subscription(
            DiagnosticStatus, f'{name}/write_results', self._take_result, 1000)

    def count_anew(self) -> None:
        """Forget what was counted, not what was seen."""
        self.values = self.results = self.commands = self.fallbacks = self.late = 0
        self._sent.clear()
        self.slowest = 0.0

    def write(self) -> None:
        """Send the next command."""
        self.number += 1
        self.commands += 1
        label = f'{self.name} {self.number}'
        self._sent[str(self.number)] = time.monotonic()
        self._publisher.publish(Int16MultiArray(
            layout=MultiArrayLayout(dim=[MultiArrayDimension(label=label)]), data=[self.number]))

    def look(self, now: float) -> None:
        """Say when no more values come, and when they come again."""
        if self._is_quiet != (now - self._seen > self._gap):
            self._is_quiet = not self._is_quiet
            number = self.name.split('/')[1].removeprefix('line_')
            print('quiet' if self._is_quiet else 'back', number, flush=True)

    def ill(self, now: float) -> str:
        """Return why the line is not well, empty where it is."""
        if now - self._seen > _FRESH:
            return f'ill {self.name}: no value for {now - self._seen:.1f} s'
        if now - self._written > _FRESH:
            return f'ill {self.name}: nothing is written for {now - self._written:.1f} s'
        counts = (self._node.count_publishers(f'{self.name}/read/ramp'),
                  self._node.count_subscribers(f'{self.name}/write/command'))
        if counts != (1, 1):
            return f'doubled {self.name}: {counts[0]} bridges publish, {counts[1]} take commands'
        return ''

    def _take_ramp(self, message: Any) -> None:
        value = message.data[0]
        self.values += 1
        self._seen = time.monotonic()
        self.look(self._seen)
        if 0 < (self._ramp - value) % _RAMP < _RAMP // 2:
            self.broken.append(f'{self.name}: the value {value} came after {self._ramp}')
        self._ramp = value

    def _take_held(self, message: Any) -> None:
        value = message.data[0]
        if value and value < self._held:  # 0 is the fallback value
            self.broken.append(f'{self.name}: command {value} was written after {self._held}')
        self._held = max(self._held, value)

    def _take_result(self, result: Any) -> None:
        self.results += 1
        if result.message.startswith('fallback value written: '):
            self.fallbacks += result.message.endswith('timeout')
            return
        self.late += 'after it was published' in result.message or 'waited' in result.message
        request = next((pair.value for pair in result.values if pair.key == 'request'), '')
        self._requests[request] = self._requests.get(request, 0) + 1
        if self._requests[request] > 1:
            self.broken.append(
                f'{request} has {self._requests[request]} results: {result.message}')
        if request.startswith(f'{self.name} ') and request.split()[1] in self._sent:
            self.slowest = max(self.slowest, time.monotonic() - self._sent.pop(request.split()[1]))
        if result.message == 'written':
            self._written = time.monotonic()


def main() -> int:
    """Look until the input ends; return 1 where something was broken."""
    rclpy.init()
    node = Node('observer')
    lines = [Line(node, f'/line_{number}/abdf1', float(sys.argv[2]))
             for number in range(1, int(sys.argv[1]) + 1)]
    said = ['']

    def look() -> None:
        now = time.monotonic()
        states = [*filter(None, (line.ill(now) for line in lines))]
        text = max(states, default='well', key=lambda state: state.startswith('ill'))
        if text.split(':')[0] != said[0].split(':')[0]:
            print(text, flush=True)
        said[0] = text
        for line in lines:
            line.look(now)
            for reason in line.broken:
                print(f'BROKEN {reason}', flush=True)
            is_broken.extend(line.broken)
            line.broken.clear()

    is_broken: list[str] = []
    node.create_timer(_LOOKS, look)
    said_to_us: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=partial(_listen, said_to_us), daemon=True).start()
    while True:
        rclpy.spin_once(node, timeout_sec=0.1)
        if said_to_us.empty():
            continue
        if not said_to_us.get():
            break
        for line in lines:
            line.count_anew()
    print(f'{sum(line.values for line in lines)} values, '
          f'{sum(line.commands for line in lines)} commands, '
          f'{sum(line.results for line in lines)} results, '
          f'{sum(line.fallbacks for line in lines)} fallbacks by timeout, '
          f'{sum(line.late for line in lines)} writes too late, '
          f'the slowest result after {max(line.slowest for line in lines):.1f} s', flush=True)
    node.destroy_node()
    rclpy.try_shutdown()
    return int(bool(is_broken))


def _listen(said_to_us: SimpleQueue[str]) -> None:
    """Pass each line of the input on, and an empty text at its end."""
    for line in iter(sys.stdin.readline, ''):
        said_to_us.put(line)
    said_to_us.put('')


if __name__ == '__main__':
    sys.exit(main())
