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

The PLC is a simulated SLC in this process that runs the rungs of the tutorial from its text, with
the presets that ``check`` prints and a scan of 20, 60, 100 and 250 ms in turns; its own clock
tells when the machine's commands (N11:2, N11:4) are 0. Bridge and publisher are processes. Each
kind of death is repeated; a histogram of the times stands beside the bound: that of rule 16 of
docs/heartbeats.md for a publisher, a Period and the preset of the watchdog for a bridge. Where the
bridge lives on or ends in order, the time counts until the fallback values are in the PLC as well
(N10:1, N10:2). After each death whoever can comes back, and must not get control without a reset.

    .venv/bin/python test/lab/soak/kills.py --rounds 7 --processes 3

has three cells side by side, each with a seed and a ROS domain of its own, and adds up what they
have seen in the table of test/RESULTS.md. A process alone ends with a line of JSON.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
import json
import os
from pathlib import Path
from random import Random
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

_HERE = Path(__file__).resolve().parent
sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.cli.check import examine  # noqa: E402
from abdf1_ros.df1.checksum import Checksum  # noqa: E402
from abdf1_ros.df1.machine import Machine  # noqa: E402
from abdf1_ros.df1.slave import multidrop  # noqa: E402
from abdf1_ros.pccc.emulated import Setting  # noqa: E402
from abdf1_ros.plan.report import make_report  # noqa: E402
from abdf1_ros.ports.endpoints import PtyEndpoint  # noqa: E402
from abdf1_ros.ports.link_thread import LinkThread  # noqa: E402
from abdf1_ros.simulator.ladder import Lamp  # noqa: E402
from support.driver_bench import simulated_plc  # noqa: E402
from support.rungs import PageLadder  # noqa: E402

SCAN_TIMES = (0.02, 0.06, 0.1, 0.25)
PERIOD = 0.5
FALLBACK_AFTER = 1.0
SLACK = 0.25  # s: a machine that does other things as well

NET = 'Station,Mode,Error_Code,Timeout,Cmd_Timeout,NAK_Retries,ENQ_Retries,Baud,Com_Port\n' \
      '5,Master,CRC,100,500,1,1,115200,{port}\n'
MAP = ('Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After,While,'
       'While_Timeout\n'
       f'beat,Heartbeat,N10:0,1,SLC,{PERIOD * 1000:.0f},,,speed,1500\n'
       f'speed,Write,N10:1,1,SLC,,0,{FALLBACK_AFTER * 1000:.0f},,\n'
       f'gripper,Write,N10:2,1,SLC,,0,{FALLBACK_AFTER * 1000:.0f},,\n')
# It publishes 0 to both until it reads another value, and ends in order at SIGINT, with its last
# one.
PUBLISHER = """
import rclpy, select, signal, sys, time
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Int16MultiArray
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node('kills_publisher')
outs = [node.create_publisher(Int16MultiArray, f'/abdf1/write/{name}', 1)
        for name in ('speed', 'gripper')]
is_over = []
signal.signal(signal.SIGINT, lambda *_: is_over.append(True))
value = 0
while not is_over:
    for out in outs:
        out.publish(Int16MultiArray(data=[value]))
    if select.select([sys.stdin], [], [], 0.1)[0]:
        value = int(sys.stdin.readline())
node.destroy_node()
rclpy.shutdown()
"""


def _planned() -> tuple[int, float]:
    """Return the preset of the watchdog (10 ms) and the bound of the fallbacks (s)."""
    with tempfile.TemporaryDirectory() as folder:
        net, rows = Path(folder, 'net.csv'), Path(folder, 'map.csv')
        net.write_text(NET.format(port='1'), encoding='utf-8')
        rows.write_text(MAP, encoding='utf-8')
        found = examine(str(net), str(rows))
    assert found.network is not None
    beat, *fallbacks = make_report(found.network, found.mappings, 0.1).times.bounds()
    assert beat.presets is not None
    return beat.presets[0], max(fallback.seconds or 0.0 for fallback in fallbacks)


PRESET, BOUND = _planned()


class Cell:
    """
    A PLC with its program, a bridge and a publisher.

    ``died`` is when (clock, s) the last death was.
    """

    def __init__(self, folder: Path, dice: Random) -> None:
        self._folder = folder
        self.dice = dice
        self.died = 0.0
        self.in_control: list[tuple[float, bool]] = []
        self.plc = simulated_plc(1, 'SLC', time.monotonic, ('S:0', 8), ('N7:0', 8))
        self.plc.lock = threading.RLock()  # the link's thread lets its program run as well
        ladder = PageLadder(self.plc.table, PRESET, self._lamp)
        self.plc.run_ladder(ladder)
        self.ladder = ladder
        self.plug_in()
        (folder / 'net.csv').write_text(NET.format(port=self.line.name), encoding='utf-8')
        (folder / 'map.csv').write_text(MAP, encoding='utf-8')
        self.bridge: subprocess.Popen[bytes] | None = None
        self.publisher: subprocess.Popen[bytes] | None = None

    def _lamp(self, at: float, lamp: Lamp, is_on: bool) -> None:
        if lamp is Lamp.IN_CONTROL:
            self.in_control.append((at, is_on))

    def plug_in(self) -> None:
        """Give the bridge a port, with the PLC at its other end."""
        self.line = PtyEndpoint(str(self._folder / 'plc'))
        self.link = LinkThread(
            Machine(multidrop([self.plc]), checksum=Checksum.CRC), self.line.open)
        self.link.start()

    def pull(self) -> None:
        """Take the port away; the PLC runs on."""
        self.link.stop()
        self.line.close()

    def wait(self, condition: Callable[[], bool], what: str, seconds: float = 40.0) -> None:
        """Let the PLC run until something is so."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise SystemExit(f'kills: waited {seconds:g} s for {what}, which did not come')
            self.plc.advance()
            time.sleep(0.005)

    def rest(self, seconds: float) -> None:
        """Let so much time pass."""
        end = time.monotonic() + seconds
        self.wait(lambda: time.monotonic() >= end, 'time', seconds + 5)

    def used(self) -> set[int]:
        """Return the commands that the machine uses, N11:2 and N11:4."""
        return {self.ladder.get(11, 2), self.ladder.get(11, 4)}

    def written(self) -> set[int]:
        """Return the commands that the bridge has written, N10:1 and N10:2."""
        return {self.ladder.get(10, 1), self.ladder.get(10, 2)}

    def start_bridge(self) -> None:
        self.bridge = subprocess.Popen(
            [sys.executable, '-m', 'abdf1_ros', 'node', '--ros-args', '-p',
             f'net_file:={self._folder / "net.csv"}', '-p',
             f'map_file:={self._folder / "map.csv"}', '--log-level', 'fatal'],
            stderr=subprocess.DEVNULL)

    def crash_bridge(self) -> None:
        """Kill the bridge, and start it again at once, as a supervisor does."""
        self.signal_bridge(signal.SIGKILL)
        assert self.bridge is not None
        self.bridge.wait()
        self.start_bridge()

    def signal_bridge(self, number: signal.Signals) -> None:
        """Send a signal to the bridge, if there is one."""
        if self.bridge is not None:
            self.bridge.send_signal(number)

    def start_publisher(self) -> None:
        self.publisher = subprocess.Popen(
            [sys.executable, '-c', PUBLISHER], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def signal_publisher(self, number: signal.Signals) -> None:
        """Send a signal to the publisher, if there is one."""
        if self.publisher is not None:
            self.publisher.send_signal(number)

    def publish(self, value: int) -> None:
        """Have the publisher publish another value."""
        assert self.publisher is not None
        assert self.publisher.stdin is not None
        self.publisher.stdin.write(f'{value}\n'.encode())
        self.publisher.stdin.flush()

    def take_control(self) -> None:
        """
        Bring all to work: bridge, publisher, a reset of the PLC, and commands of 800.

        A busy machine may take control away at once, as nobody answers for longer than Timeout.
        """
        if self.bridge is None or self.bridge.poll() is not None:
            self.start_bridge()
        if self.publisher is None or self.publisher.poll() is not None:
            self.start_publisher()
        self.wait(lambda: self.ladder.is_on(Lamp.ALIVE), 'a heartbeat')
        give_up = time.monotonic() + 60
        while self.used() != {800} and time.monotonic() < give_up:
            self.publish(800 * self.ladder.is_on(Lamp.IN_CONTROL))
            self.ladder.press_reset()
            self.rest(0.3)
        self.wait(lambda: self.used() == {800}, 'the commands', 1.0)

    def until_fallen(self, is_written: bool) -> float:
        """
        Return when the machine's commands became 0.

        ``is_written``: not before the bridge has written the fallback values.
        """
        # The lamp is told at the end of the scan in which the outputs fall.
        self.wait(lambda: not self.in_control[-1][1] and self.used() == {0},
                  'the outputs to fall back')
        if not is_written or self.written() == {0}:
            return self.in_control[-1][0]
        self.wait(lambda: self.written() == {0}, 'the fallback values')
        return time.monotonic()

    def recover(self) -> None:
        """Bring back who can come back, and see that nobody has control by itself."""
        self.plc.faults.silent = False
        for process in (self.bridge, self.publisher):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
        self.rest(1.5)

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
        with suppress(OSError):
            self.pull()


@dataclass(frozen=True, slots=True)
class Death:
    """
    How something dies, and within how many seconds the output has to have fallen back.

    ``is_written`` tells that the fallback value has to be in the PLC by then. ``after`` goes on
    with it, and brings back what it took.
    """

    kill: Callable[[Cell], None]
    bound: float
    is_written: bool = False
    after: Callable[[Cell], None] = Cell.recover


def _bridge(number: signal.Signals, bound: float, is_written: bool = False) -> Death:
    return Death(lambda cell: cell.signal_bridge(number), bound, is_written)


def _publisher(number: signal.Signals) -> Death:
    return Death(lambda cell: cell.signal_publisher(number), BY_BRIDGE, is_written=True)


def _crash_on(cell: Cell) -> None:
    """Crash twice more, each time when the PLC has heard of it; press reset all along."""
    for _ in range(2):
        cell.wait(lambda: cell.ladder.is_on(Lamp.ALIVE), 'a heartbeat after a crash')
        cell.ladder.press_reset()
        cell.rest(0.5)
        cell.crash_bridge()
        cell.ladder.press_reset()
        cell.rest(0.5)
    cell.recover()


def _program(cell: Cell) -> None:
    cell.plc.set_mode(Setting.PROGRAM)
    cell.plc.set_mode(Setting.REMOTE)


def _download(cell: Cell) -> None:
    """Load the program; it dies when it runs again. The bridge sees that it did not (rule 19)."""
    cell.plc.download()
    cell.rest(3.0)
    cell.died = time.monotonic()
    cell.plc.set_mode(Setting.REMOTE)


def _download_commands(cell: Cell) -> None:
    """While fallbacks stand load a program with commands, too soon for the bridge to see it."""
    cell.signal_publisher(signal.SIGKILL)
    cell.wait(lambda: cell.written() == {0}, 'the fallback values')
    cell.rest(cell.dice.uniform(0.5, 5.5))
    cell.plc.download()
    for word in (1, 2):
        cell.ladder.put(10, word, 888)
    cell.rest(cell.dice.choice([0.6, 0.9]))
    cell.died = time.monotonic()
    cell.plc.set_mode(Setting.REMOTE)


def _plug_in(cell: Cell) -> None:
    cell.plug_in()
    cell.recover()


def _fall_silent(cell: Cell) -> None:
    cell.plc.faults.silent = True


# The PLC sees a word once in a scan, and its timer starts in the scan after that.
SCANS = 2 * max(SCAN_TIMES)
BY_PLC = PRESET / 100 + PERIOD + SCANS + SLACK
BY_BRIDGE = BOUND + SCANS + SLACK
IN_ORDER = 2.0 + SCANS + SLACK
AGAIN = 5.0 + BOUND - FALLBACK_AFTER + SLACK  # a fallback that stands is written every 5 s
DEATHS = {
    'bridge SIGKILL': _bridge(signal.SIGKILL, BY_PLC),
    'bridge SIGSTOP': _bridge(signal.SIGSTOP, BY_PLC),
    'bridge SIGTERM': _bridge(signal.SIGTERM, IN_ORDER, is_written=True),
    'bridge SIGHUP': _bridge(signal.SIGHUP, IN_ORDER, is_written=True),
    'bridge crash loop': Death(Cell.crash_bridge, BY_PLC, after=_crash_on),
    'publisher SIGKILL': _publisher(signal.SIGKILL),
    'publisher SIGSTOP': _publisher(signal.SIGSTOP),
    'publisher SIGTERM': _publisher(signal.SIGTERM),
    'publisher clean exit': _publisher(signal.SIGINT),
    'port pulled': Death(Cell.pull, BY_PLC, after=_plug_in),
    'station silent': Death(_fall_silent, BY_PLC),
    'PROGRAM and RUN': Death(_program, SCANS + SLACK),
    'download': Death(_download, SCANS + SLACK),
    'download of 888': Death(_download_commands, AGAIN, is_written=True),
    'power cycle': Death(lambda cell: cell.plc.cycle_power(), SCANS + SLACK),
}


@dataclass(slots=True)
class Seen:
    """What was seen of one death: times (s), and controls regained without a reset."""

    times: list[float]
    regained: int = 0

    def row(self, name: str) -> str:
        """Return it as a row of a table, with how many times lie in each tenth of the bound."""
        times, bound = sorted(self.times), DEATHS[name].bound
        counts = [0] * 11
        for value in times:
            counts[min(10, int(10 * value / bound))] += 1
        tenths = ' '.join(f'{count or ".":>2}' for count in counts)
        return f'{name:20} {len(times):6} {times[len(times) // 2]:6.2f} {times[-1]:7.2f} ' \
            f'{bound:5.2f}   {tenths}'


def run(cell: Cell, name: str, scan_time: float, seen: Seen) -> None:
    """Kill once and keep the seconds until the outputs were 0."""
    death = DEATHS[name]
    cell.ladder.scan_time = scan_time
    cell.take_control()
    cell.rest(cell.dice.uniform(0.0, PERIOD))
    if cell.used() != {800}:
        cell.take_control()
    cell.died = time.monotonic()
    death.kill(cell)
    seen.times.append(round(max(0.0, cell.until_fallen(death.is_written) - cell.died), 3))
    changes = len(cell.in_control)
    death.after(cell)
    seen.regained += len(cell.in_control) != changes
    cell.stop_publisher()


def run_all(names: list[str], rounds: int, seed: int) -> tuple[dict[str, Seen], str]:
    """Run deaths, each in a cell; return what was seen, and what went wrong, empty for nothing."""
    found, wrong, dice = {name: Seen([]) for name in names}, [], Random(seed)
    for name, seen in found.items():
        with tempfile.TemporaryDirectory(prefix='abdf1_') as folder:
            cell = Cell(Path(folder), dice)
            try:
                for number in range(rounds):
                    run(cell, name, SCAN_TIMES[(seed + number) % len(SCAN_TIMES)], seen)
            except SystemExit as error:
                wrong.append(f'seed {seed}, {name}: {error}')
            finally:
                cell.close()
        if seen.times:
            print(seen.row(name), file=sys.stderr, flush=True)
    return found, '; '.join(wrong)


def run_side_by_side(arguments: list[str], processes: int, seed: int
                     ) -> tuple[dict[str, Seen], str]:
    """Run this program several times at once; return what all have seen."""
    children = [subprocess.Popen([sys.executable, __file__, *arguments, f'--seed={seed + number}'],
                                 stdout=subprocess.PIPE, text=True) for number in range(processes)]
    found: dict[str, Seen] = {}
    wrong: list[str] = []
    for child in children:
        said = child.communicate()[0].splitlines()
        told: dict[str, Any] = json.loads(said[-1]) if said else {
            'wrong': f'a process ended with status {child.returncode}', 'seen': {}}
        wrong += [told['wrong']] if told['wrong'] else []
        for name, (times, regained) in told['seen'].items():
            seen = found.setdefault(name, Seen([]))
            seen.times += times
            seen.regained += regained
    return found, '; '.join(wrong)


def main() -> int:
    """Run all deaths; return 1 where one took longer than its bound, or something went wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rounds', type=int, default=20,
                        help='of each death, in each process (default: 20)')
    parser.add_argument('--only', choices=tuple(DEATHS), action='append', default=[])
    parser.add_argument('--processes', type=int, default=1, help='side by side (default: 1)')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(1 << 31),
                        help='of the moments, the first scan time and the ROS domain (by chance); '
                             'each process has the next one')
    options = parser.parse_args()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(1 + options.seed % 100)
    os.environ['PYTHONPATH'] = str(_HERE.parents[2])
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # or, under nohup, the bridge ignores it as well
    head = f'{"death":20} rounds median longest bound   in each tenth of the bound, and beyond'
    print(head, file=sys.stderr, flush=True)
    if options.processes == 1:
        found, wrong = run_all(options.only or [*DEATHS], options.rounds, options.seed)
        print(json.dumps({'wrong': wrong, 'seen': {
            name: (seen.times, seen.regained) for name, seen in found.items()}}))
    else:
        arguments = [f'--rounds={options.rounds}', *(f'--only={name}' for name in options.only)]
        found, wrong = run_side_by_side(arguments, options.processes, options.seed)
        print('| what dies | rounds | median | longest | bound |\n|---|---|---|---|---|')
        for name, seen in found.items():
            times, bound = sorted(seen.times), DEATHS[name].bound
            if times:
                print(f'| {name} | {len(times)} | {times[len(times) // 2]:.2f} | {times[-1]:.2f} '
                      f'| {bound:.2f} |')
    late = sum(value > DEATHS[name].bound for name, seen in found.items() for value in seen.times)
    regained = sum(seen.regained for seen in found.values())
    print(f'seed {options.seed}: {sum(len(seen.times) for seen in found.values())} deaths, '
          f'{late} later than their bound, {regained} controls regained without a reset'
          + (f'; WRONG: {wrong}' if wrong else ''), file=sys.stderr)
    return int(bool(late or regained or wrong))


if __name__ == '__main__':
    sys.exit(main())
