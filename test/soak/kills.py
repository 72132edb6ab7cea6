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
Kill bridge, publisher and PLC program, as processes, and measure until the output has fallen back.

The PLC is a simulated SLC in this process, whose program is the ladder of the heartbeats; its own
clock tells when the machine's command (N11:2) is 0. Bridge and publisher are processes. Each kind
of death is repeated; a histogram of the times stands beside the bound of rule 16 of
docs/heartbeats.md: Fallback_After, the longest transaction and the writes of the Fallback for a
publisher, the preset of the watchdog and a period for a bridge.

    .venv/bin/python test/soak/kills.py --rounds 20
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

_HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(_HERE.parent.parent), str(_HERE.parent)]

from abdf1_ros.df1.checksum import Checksum  # noqa: E402
from abdf1_ros.df1.machine import Machine  # noqa: E402
from abdf1_ros.df1.slave import multidrop  # noqa: E402
from abdf1_ros.pccc.emulated import Setting  # noqa: E402
from abdf1_ros.ports.endpoints import PtyLine  # noqa: E402
from abdf1_ros.ports.link_thread import LinkThread  # noqa: E402
from abdf1_ros.simulator.ladder import Ladder, Lamp  # noqa: E402
from support.driver_bench import simulated_plc  # noqa: E402

PRESET = 3.0  # s, of the watchdog in the PLC
PERIOD = 0.5
FALLBACK_AFTER = 1.0
TRANSACTION = 1.3  # s: Timeout 200, Cmd_Timeout 500, one repetition
SLACK = 0.25  # s: two scans of the PLC, and a machine that does other things as well

NET = 'Station,Mode,Error_Code,Timeout,Cmd_Timeout,NAK_Retries,ENQ_Retries,Baud,Com_Port\n' \
      '5,Master,CRC,200,500,1,1,115200,{port}\n'
MAP = ('Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After,Requires,'
       'Requires_Timeout\n'
       f'beat,Heartbeat,N10:0,1,SLC,{PERIOD * 1000:.0f},,,speed,1500\n'
       f'speed,Write,N10:1,1,SLC,,0,{FALLBACK_AFTER * 1000:.0f},,\n')
PUBLISHER = """
import rclpy, sys, time
from std_msgs.msg import Int16MultiArray
rclpy.init()
node = rclpy.create_node('kills_publisher')
out = node.create_publisher(Int16MultiArray, '/abdf1/write/speed', 1)
end = time.monotonic() + float(sys.argv[1])
value = 0
begun = None
while time.monotonic() < end:
    out.publish(Int16MultiArray(data=[value]))
    if begun is None and out.get_subscription_count():
        begun = time.monotonic()
    if begun is not None and time.monotonic() - begun > float(sys.argv[2]):
        value = 800
    time.sleep(0.1)
"""


class Cell:
    """A PLC with its program, a bridge and a publisher."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.in_control: list[tuple[float, bool]] = []
        self.plc = simulated_plc(1, 'SLC', time.monotonic, ('S:0', 8), ('N7:0', 8))
        ladder = Ladder(self.plc.table, round(PRESET * 100), self._lamp)
        self.plc.run_ladder(ladder)
        self.ladder = ladder
        self.line = PtyLine(str(folder / 'plc'))
        self.link = LinkThread(
            Machine(multidrop([self.plc]), checksum=Checksum.CRC), self.line.open)
        self.link.start()
        (folder / 'net.csv').write_text(NET.format(port=self.line.name), encoding='utf-8')
        (folder / 'map.csv').write_text(MAP, encoding='utf-8')
        self.bridge: subprocess.Popen[bytes] | None = None
        self.publisher: subprocess.Popen[bytes] | None = None

    def _lamp(self, at: float, lamp: Lamp, is_on: bool) -> None:
        if lamp is Lamp.IN_CONTROL:
            self.in_control.append((at, is_on))

    def wait(self, condition: Callable[[], bool], what: str, seconds: float = 40.0) -> None:
        """Let the PLC run until something is so."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise SystemExit(f'kills: waited {seconds:g} s in vain for {what}')
            self.plc.advance()
            time.sleep(0.005)

    def rest(self, seconds: float) -> None:
        """Let so much time pass."""
        end = time.monotonic() + seconds
        self.wait(lambda: time.monotonic() >= end, 'time', seconds + 5)

    def used(self) -> int:
        """Return the command that the machine uses, N11:2."""
        return self.ladder._get(11, 2)

    def start_bridge(self) -> None:
        self.bridge = subprocess.Popen(
            [sys.executable, '-m', 'abdf1_ros', 'node', '--ros-args', '-p',
             f'net_file:={self._folder / "net.csv"}', '-p',
             f'map_file:={self._folder / "map.csv"}', '--log-level', 'fatal'],
            stderr=subprocess.DEVNULL)

    def start_publisher(self, seconds: float = 600.0) -> None:
        self.publisher = subprocess.Popen(
            [sys.executable, '-c', PUBLISHER, str(seconds), '4.5'], stderr=subprocess.DEVNULL)

    def take_control(self) -> None:
        """Bring all to work: bridge, publisher, a reset of the PLC, and a speed of 800."""
        if self.bridge is None or self.bridge.poll() is not None:
            self.start_bridge()
        if self.publisher is None or self.publisher.poll() is not None:
            self.start_publisher()
        self.wait(lambda: self.ladder.is_on(Lamp.ALIVE), 'a heartbeat')
        give_up = time.monotonic() + 60
        while not self.ladder.is_on(Lamp.IN_CONTROL) and time.monotonic() < give_up:
            self.ladder.press_reset()
            self.rest(0.3)
        self.wait(lambda: self.used() == 800, 'the speed')

    def until_fallen(self) -> float:
        """Return when the machine's command became 0."""
        self.wait(lambda: self.used() == 0, 'the output to fall back')
        return next(at for at, is_on in reversed(self.in_control) if not is_on)

    def stop_publisher(self) -> None:
        """End the publisher, so that the next round begins with a command at rest."""
        if self.publisher is not None and self.publisher.poll() is None:
            self.publisher.send_signal(signal.SIGCONT)
            self.publisher.kill()
            self.publisher.wait()

    def close(self) -> None:
        for process in (self.publisher, self.bridge):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait()
        self.link.stop()
        self.line.close()


def _signal_bridge(number: signal.Signals) -> Callable[[Cell], None]:
    def kill(cell: Cell) -> None:
        assert cell.bridge is not None
        cell.bridge.send_signal(number)
    return kill


def _signal_publisher(number: signal.Signals) -> Callable[[Cell], None]:
    def kill(cell: Cell) -> None:
        assert cell.publisher is not None
        cell.publisher.send_signal(number)
    return kill


def _program(cell: Cell) -> None:
    cell.plc.set_mode(Setting.PROGRAM)
    cell.plc.set_mode(Setting.REMOTE)


def _download(cell: Cell) -> None:
    cell.plc.download()
    cell.plc.set_mode(Setting.REMOTE)


def _power(cell: Cell) -> None:
    cell.plc.cycle_power()


def _pull(cell: Cell) -> None:
    cell.plc.faults.silent = True


BY_PLC = PRESET + PERIOD + SLACK
BY_BRIDGE = FALLBACK_AFTER + TRANSACTION + SLACK
DEATHS: dict[str, tuple[Callable[[Cell], None], float]] = {
    'bridge SIGKILL': (_signal_bridge(signal.SIGKILL), BY_PLC),
    'bridge SIGSTOP': (_signal_bridge(signal.SIGSTOP), BY_PLC),
    'bridge SIGTERM': (_signal_bridge(signal.SIGTERM), 2.0 + SLACK),
    'bridge SIGHUP': (_signal_bridge(signal.SIGHUP), 2.0 + SLACK),
    'publisher SIGKILL': (_signal_publisher(signal.SIGKILL), BY_BRIDGE),
    'publisher SIGSTOP': (_signal_publisher(signal.SIGSTOP), BY_BRIDGE),
    'publisher SIGTERM': (_signal_publisher(signal.SIGTERM), BY_BRIDGE),
    'line dead': (_pull, BY_PLC),
    'PROGRAM and RUN': (_program, SLACK),
    'download': (_download, SLACK),
    'power cycle': (_power, SLACK),
}


def run(cell: Cell, name: str) -> float:
    """Kill once and return the seconds until the output was 0."""
    kill, _ = DEATHS[name]
    cell.take_control()
    died = time.monotonic()
    kill(cell)
    fallen = cell.until_fallen() - died
    # Whoever comes back must not take control by itself.
    cell.plc.faults.silent = False
    if cell.bridge is not None and cell.bridge.poll() is None:
        cell.bridge.send_signal(signal.SIGCONT)
    if cell.publisher is not None and cell.publisher.poll() is None:
        cell.publisher.send_signal(signal.SIGCONT)
    cell.rest(1.5)
    if cell.used() != 0:
        raise SystemExit(f'kills: after {name} the output came back without a reset')
    cell.stop_publisher()
    return fallen


def histogram(times: list[float]) -> str:
    """Return how many times lie in each tenth of the longest."""
    top = max(*times, 1e-9)
    counts = [0] * 10
    for value in times:
        counts[min(9, int(10 * value / top))] += 1
    return ' '.join(f'{count:2}' for count in counts)


def main() -> int:
    """Run all deaths; return 1 where one took longer than its bound."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rounds', type=int, default=20, help='of each death (default: 20)')
    parser.add_argument('--only', choices=tuple(DEATHS), action='append')
    options = parser.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ['PYTHONPATH'] = str(_HERE.parent.parent)
    print(f'{"death":18} rounds  median  longest  bound   ten steps up to the longest')
    is_late = False
    with tempfile.TemporaryDirectory(prefix='abdf1_') as folder:
        cell = Cell(Path(folder))
        try:
            for name in options.only or DEATHS:
                times = sorted(run(cell, name) for _ in range(options.rounds))
                bound = DEATHS[name][1]
                is_late |= times[-1] > bound
                print(f'{name:18} {len(times):6} {times[len(times) // 2]:7.2f} {times[-1]:8.2f} '
                      f'{bound:6.2f}   {histogram(times)}', flush=True)
        finally:
            cell.close()
    return int(is_late)


if __name__ == '__main__':
    sys.exit(main())
