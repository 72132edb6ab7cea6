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
The demo: simulated PLCs, the node as a process, and the view of a robot cell, step by step.

Everything stays on this machine: discovery is limited to localhost.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
import math
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

from abdf1_ros.cli.simulator import Cast, parse_options
from abdf1_ros.cli.terminal import (
    drop_output,
    ignore_further,
    prepare_output,
    run_command,
)
from abdf1_ros.cli.usage import parser_of
from abdf1_ros.driver.write import show
from abdf1_ros.paths import called, config_file
from abdf1_ros.pccc.values import Values
from abdf1_ros.ros.observer import claim_domain, ObservingNode
from abdf1_ros.ros.topics.messages import latched_qos, MESSAGES
from abdf1_ros.ros.untyped import RosMessage
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.simulator.ladder import Lamp
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.event_handler import QoSRequestedDeadlineMissedInfo, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

# The program of the node's process. A signal during its imports ends it quietly. If this process
# dies, the standard input of the node closes, and the node ends as after a signal. The node first
# removes the folder of the demo, because the name of the port there could soon lead to another
# program's terminal.
_NODE = """
import os, shutil, signal, sys, threading
from abdf1_ros.cli.main import node

folder = sys.argv.pop(1)

def end_with_the_demo():
    os.read(0, 1)
    shutil.rmtree(folder, ignore_errors=True)
    os.kill(os.getpid(), signal.SIGTERM)

threading.Thread(target=end_with_the_demo, daemon=True).start()
sys.exit(node())
"""

_PATIENCE = 30.0
_BRIDGE = 'abdf1: '
_RESETS = 5  # attempts: on a busy machine the heartbeat may stop for a moment
_OK = DiagnosticStatus.OK
_LOG_HEAD = re.compile(r'^\[(\w+)\] \[[\d.]+\] \[\w+\]: ')
_WRITTEN = (211, 222, 233, 244)
_TOO_LARGE = (1, 2, 3, 5000)


@dataclass(frozen=True, slots=True)
class Scene:
    """
    A scene: files, the simulated line, and the part of each PLC and row.

    ``guarded``: a row that is published only while the program of its PLC runs. A ladder program
    in that PLC supervises the bridge.
    """

    title: str
    net_file: str
    map_file: str
    simulator: tuple[str, ...]
    failing_station: int
    watched: str
    surviving: str | None = None
    guarded: str | None = None
    push: str | None = None


HALF_DUPLEX = Scene(
    'A PLC-5 (station 1) and an SLC 5/03 (station 2), simulated on one half-duplex DF1 line',
    'heartbeat_net.csv', 'heartbeat_map.csv', ('--ladder', '2'), 1, 'cell_interlocks',
    surviving='plc_alive', guarded='doors')
FULL_DUPLEX = Scene(
    'A PLC-5 (station 1), simulated on a full-duplex DF1 line',
    'peer_net.csv', 'peer_map.csv', ('--full-duplex', '1'), 1, 'line_speed',
    push='msg 1 N7:50 11 22 33 44')


class Missed(Exception):
    """A promised event has not happened; the text names the event."""


class DemoBridge:
    """The node as a process; its output is printed between the lines of the story."""

    def __init__(self, folder: Path, *args: str) -> None:
        self._rest = b''
        # A session of its own: Ctrl-C reaches the demo only, which then ends the node.
        self.process = subprocess.Popen(
            [sys.executable, '-c', _NODE, str(folder), *args], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
        os.set_blocking(self._out, False)

    @property
    def _out(self) -> int:
        assert self.process.stdout is not None
        return self.process.stdout.fileno()

    def relay(self) -> None:
        """Print the output of the node since the last call."""
        with suppress(BlockingIOError):
            while data := os.read(self._out, 65536):
                *lines, self._rest = (self._rest + data).split(b'\n')
                for line in lines:
                    print(_LOG_HEAD.sub(r'node: \1 ', line.decode(errors='replace')), flush=True)

    def end(self) -> None:
        """End the node, and print the rest of its output."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.wait(_PATIENCE)
        self.relay()


class Watcher(ObservingNode):
    """
    The robot cell: subscribes to all topics.

    It keeps the last values and statuses, and all results.
    """

    def __init__(self, mappings: Sequence[Mapping], port: str) -> None:
        super().__init__('demo_watcher')
        self._port = port
        self.values: dict[str, Values] = {}
        self.results: list[DiagnosticStatus] = []
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.taken: Counter[str] = Counter()
        self.missed: Counter[str] = Counter()
        for mapping in mappings:
            if mapping.reads:
                self.node.create_subscription(
                    MESSAGES[mapping.message_type], f'/abdf1/read/{mapping.topic}',
                    self._taker(mapping), latched_qos())
        self.node.create_subscription(DiagnosticStatus, '/abdf1/write_results', self._result, 10)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnostics, 10)

    def expect(self, mapping: Mapping) -> float:
        """
        Count values and missed deadlines of a topic; return the promised deadline (s).

        DDS counts from the first value on.
        """
        topic = f'/abdf1/read/{mapping.topic}'
        deadline = self.node.get_publishers_info_by_topic(topic)[0].qos_profile.deadline

        def taken(message: RosMessage) -> None:
            self.taken[mapping.tag] += 1

        def missed(event: QoSRequestedDeadlineMissedInfo) -> None:
            self.missed[mapping.tag] += event.total_count_change

        self.node.create_subscription(
            MESSAGES[mapping.message_type], topic, taken,
            QoSProfile(depth=1, deadline=deadline),
            event_callbacks=SubscriptionEventCallbacks(deadline=missed))
        return float(deadline.nanoseconds / 1e9)

    def _taker(self, mapping: Mapping) -> Callable[[RosMessage], None]:
        def take(message: RosMessage) -> None:
            self.values[mapping.tag] = message.data
        return take

    def _result(self, message: DiagnosticStatus) -> None:
        if message.hardware_id == self._port:
            self.results.append(message)

    def _diagnostics(self, message: DiagnosticArray) -> None:
        """Keep the statuses of our bridge; other nodes publish statuses as well."""
        self.statuses.update({
            status.name.removeprefix(_BRIDGE): status for status in message.status
            if status.name.startswith(_BRIDGE) and status.hardware_id.startswith(self._port)})


class Speed:
    """The program that commands a speed: while it lives it publishes five times a second."""

    def __init__(self, node: Node, mapping: Mapping) -> None:
        self._message = MESSAGES[mapping.message_type]
        self._publisher = node.create_publisher(self._message, f'/abdf1/write/{mapping.topic}', 1)
        self._next = math.inf
        self._value = 0

    def command(self, value: int) -> None:
        """Live, and publish a value from now on."""
        self._value, self._next = value, time.monotonic()

    def die(self) -> None:
        """Publish nothing any more."""
        self._next = math.inf

    def run(self) -> None:
        """Publish if it is time."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + 0.2
            self._publisher.publish(self._message(data=[self._value]))


class Stage:
    """PLCs, bridge and watcher; prints the story line by line."""

    def __init__(self, scene: Scene, link: Path) -> None:
        net_file, map_file = config_file(scene.net_file), config_file(scene.map_file)
        mappings, _ = load_mappings(str(map_file))
        self._scene, self._folder = scene, link.parent
        self._mappings = {mapping.tag: mapping for mapping in mappings}
        self._begin = time.monotonic()
        self._bridge_args = ('--ros-args', '-p', f'port:={link}', '-p', f'net_file:={net_file}',
                             '-p', f'map_file:={map_file}')
        self._bridge: DemoBridge | None = None
        self._lamps: dict[Lamp, float] = {}  # lamps that are on, with the time of the change
        self.step = 0  # number of the present step
        self.last_step = 0
        self.is_told = False
        self._plcs = Cast(parse_options(['--pty', str(link), *scene.simulator]), self._lamp)
        self._watcher = Watcher(mappings, str(link))
        self._speed = Speed(self._watcher.node, self._mappings['speed']) if scene.guarded else None

    def close(self) -> None:
        """End the bridge, then the PLCs and the watcher."""
        try:
            if self._bridge is not None:
                self._bridge.end()
        finally:  # otherwise the thread of the PLCs keeps this process alive
            self._plcs.close()
            self._watcher.__exit__()

    def _start_bridge(self) -> None:
        self._bridge = DemoBridge(self._folder, *self._bridge_args)

    def _lamp(self, station: str, lamp: Lamp, is_on: bool) -> None:
        """Record the lamps that are on; called in the thread of the PLCs, too."""
        self._lamps.pop(lamp, None)
        if is_on:
            self._lamps[lamp] = time.monotonic()

    def _print_values(self) -> None:
        for tag, mapping in self._mappings.items():
            if tag in self._watcher.values:
                place = f'station {mapping.station}  {mapping.address!s:<9}'
                print(f'    {place} -> /abdf1/read/{mapping.topic:<16}'
                      f' {show(self._watcher.values[tag])}', flush=True)

    def _level(self, section: str) -> bytes | None:
        """Return the level of a status; None before the first message."""
        status = self._watcher.statuses.get(section)
        return status.level if status else None

    def _print_statuses(self, *sections: str) -> None:
        for section in sections:
            status = self._watcher.statuses[section]
            print(f'    {status.name:<18} {status.message}', flush=True)

    def _pause(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self._spin_until(lambda: time.monotonic() >= end, seconds + _PATIENCE)

    def _wait(self, what: str, condition: Callable[[], bool]) -> None:
        if not self._spin_until(condition, _PATIENCE):
            raise Missed(f'waited {_PATIENCE:g} s for {what}, which did not come')

    def _until_missed(self, tag: str, command: str, what: str) -> float:
        """Give the simulator a command that stops the values of a row; return the deadline (s)."""
        deadline = self._watcher.expect(self._mappings[tag])
        self._wait(f'a value of {tag}', lambda: self._watcher.taken[tag] > 0)
        self._watcher.missed.clear()
        self._plcs.carry_out(command)
        self._wait(what, lambda: self._watcher.missed[tag] > 0)
        return deadline

    def _spin_until(self, condition: Callable[[], bool], limit: float) -> bool:
        end = time.monotonic() + limit
        while time.monotonic() < end:
            if condition():
                return True
            if self._plcs.has_failed or self._bridge and self._bridge.process.poll() is not None:
                raise Missed('the node or the simulator has ended; see above')
            self._relay()
            self._plcs.advance()
            if self._speed:
                self._speed.run()
            self._watcher.spin_once(0.05)
        return condition()

    def _relay(self) -> None:
        if self._bridge is not None:
            self._bridge.relay()

    def _title(self, text: str) -> None:
        self._relay()
        print(f'\n{self.step}. {text}', flush=True)

    def _say(self, text: str) -> None:
        print(f'  [{time.monotonic() - self._begin:5.1f} s] {text}', flush=True)


class Demo(Stage):
    """Show all steps; each waits for its event, or raises Missed."""

    def run(self, seconds: float) -> None:
        """Run for ``seconds``, at least until the story is over; 0: until interrupted."""
        self._plcs.start()
        self._start_bridge()
        print(f'\n{self._scene.title}', flush=True)
        domain = os.environ['ROS_DOMAIN_ID']
        self._say(f'look on from another terminal with ROS_DOMAIN_ID={domain} {called("monitor")}')
        self._say('lines with "node:" and "simulator:" are what these two say meanwhile')
        if self._speed:
            self._say('a program publishes a speed; until its messages come, the node writes the '
                      'Fallback, 0')
            self._speed.command(0)
        steps = self._steps()
        self.last_step = len(steps)
        for self.step, tell in enumerate(steps, 1):
            tell()
        self.is_told = True
        while not seconds or time.monotonic() - self._begin < seconds:
            self._pause(5.0)
            print('\nStill running' + ('' if seconds else '; Ctrl-C ends it'), flush=True)
            self._print_values()

    def _steps(self) -> list[Callable[[], None]]:
        steps = [self._show_reads, self._show_writes, self._show_failure]
        if self._scene.push:
            steps.insert(2, self._show_push)
        if self._speed:
            steps += [self._show_death_of_publisher, self._show_death_of_program,
                      self._show_death_of_bridge]
        return [*steps, self._show_diagnostics]

    def _show_reads(self) -> None:
        polled = {tag for tag, mapping in self._mappings.items() if mapping.polls}
        self._wait('every mapped topic', lambda: polled <= self._watcher.values.keys())
        self._title(f'Reads: every row of config/{self._scene.map_file} is a topic')
        self._print_values()
        first = list(self._watcher.values.values())
        self._pause(2.0)
        self._wait('values that change', lambda: list(self._watcher.values.values()) != first)
        self._say('two seconds later:')
        self._print_values()

    def _show_writes(self) -> None:
        self._title('Writes: published to ~/write/<topic>, answered on ~/write_results')
        self._write('recipe', _WRITTEN, 'written')
        self._wait('the value to come back',
                   lambda: tuple(self._watcher.values['recipe']) == _WRITTEN)
        self._say(f'and /abdf1/read/recipe now shows {show(self._watcher.values["recipe"])}')
        self._write('recipe', _TOO_LARGE, 'not written: refused')

    def _write(self, tag: str, values: Sequence[int], expected: str) -> None:
        mapping = self._mappings[tag]
        publisher = self._watcher.node.create_publisher(
            MESSAGES[mapping.message_type], f'/abdf1/write/{mapping.topic}', 10)
        self._wait('the bridge to listen', lambda: publisher.get_subscription_count() > 0)
        self._watcher.results.clear()
        publisher.publish(MESSAGES[mapping.message_type](data=values))
        self._say(f'publish {list(values)} to /abdf1/write/{mapping.topic}')
        self._wait('the result', lambda: bool(self._results(tag)))
        result, = self._results(tag)
        latency = {pair.key: pair.value for pair in result.values}['latency_ms']
        self._say(f'result: {result.message} ({latency} ms)')
        if not result.message.startswith(expected):
            raise Missed(f'the result of {list(values)} should be "{expected}"')

    def _results(self, tag: str) -> list[DiagnosticStatus]:
        return [result for result in self._watcher.results if result.name == tag]

    def _show_push(self) -> None:
        self._title('Serve: the PLC writes to words of the bridge on its own')
        tag = next(tag for tag, mapping in self._mappings.items() if mapping.serves)
        self._plcs.carry_out(self._scene.push or '')
        self._wait('the values', lambda: tag in self._watcher.values)
        self._say(f'/abdf1/read/{tag} shows {show(self._watcher.values[tag])}')

    def _show_failure(self) -> None:
        station = f'station {self._scene.failing_station}'
        self._title(f'{station.capitalize()} loses its power')
        watched = self._mappings[self._scene.watched]
        deadline = self._until_missed(
            watched.tag, f'silent {self._scene.failing_station}', 'the loss to be noticed')
        self._say(f'a subscriber of /abdf1/read/{watched.topic} with a deadline of '
                  f'{deadline:.1f} s is notified: no more values')
        self._wait('the station to be inactive', lambda: self._level(station) != _OK)
        self._print_statuses('link', station, 'mappings')
        if self._scene.surviving:
            self._show_survivor(self._scene.surviving)
        print('\n   ... and gets it back', flush=True)
        self._plcs.carry_out(f'normal {self._scene.failing_station}')
        self._wait('the station to answer', lambda: self._level('mappings') == _OK)
        self._print_statuses('link', station, 'mappings')

    def _show_survivor(self, tag: str) -> None:
        before = list(self._watcher.values[tag])
        self._wait('new values', lambda: list(self._watcher.values[tag]) != before)
        self._say(f'station 2 goes on: /abdf1/read/{tag} {before} -> '
                  f'{show(self._watcher.values[tag])}')

    def _take_control(self) -> Speed:
        """
        Press reset at the PLC, and let the publisher command a speed.

        On a busy machine the bridge may lose the control again before the speed is used.
        """
        assert self._speed is not None
        for _ in range(_RESETS):
            self._speed.command(0)
            self._wait('a steady heartbeat', lambda: time.monotonic() > 4.5 + self._lamps.get(
                Lamp.ALIVE, math.inf))
            self._plcs.carry_out('reset 2')
            self._spin_until(lambda: Lamp.IN_CONTROL in self._lamps, 1.0)
            if not self._wait_in_control('ROS to know it', self._is_in_control):
                continue
            self._say('/abdf1/read/in_control is [1]: from now on the PLC uses what ROS writes')
            self._speed.command(800)
            if self._wait_in_control('the speed in the PLC', lambda: self._used() == 800):
                self._say('800 is published to /abdf1/write/speed, and the program uses it: '
                          'used_speed is [800]')
                return self._speed
        raise Missed('a reset of the PLC has not given ROS control')

    def _wait_in_control(self, what: str, condition: Callable[[], bool]) -> bool:
        """Wait for ``condition``; return False if ROS has no control any more."""
        self._wait(what, lambda: Lamp.IN_CONTROL not in self._lamps or condition())
        return Lamp.IN_CONTROL in self._lamps

    def _is_in_control(self) -> bool:
        return bool(self._watcher.values['in_control'][0])

    def _used(self) -> int:
        return int(self._watcher.values['used_speed'][0])

    def _show_death_of_publisher(self) -> None:
        self._title('The publisher of a command dies; first a person presses reset at the PLC')
        speed = self._take_control()
        died = time.monotonic()
        speed.die()
        self._say('it publishes nothing any more')
        self._wait('the fallback value', lambda: self._used() == 0 and not self._is_in_control())
        self._say(f'{time.monotonic() - died:.1f} s later the bridge has written the Fallback, '
                  'the program uses [0], and in_control is [0]')

    def _show_death_of_program(self) -> None:
        self._title('The program of the PLC stands still, while its port goes on answering')
        tag = self._scene.guarded or ''
        deadline = self._until_missed(tag, 'program 2', 'the silence to be noticed')
        self._say(f'/abdf1/read/{tag} is withheld; a subscriber with a deadline of '
                  f'{deadline:.1f} s is notified: no more values')
        self._wait('the diagnostics', lambda: self._level('mappings') != _OK)
        self._print_statuses('mappings')
        self._plcs.carry_out('run 2')
        self._wait('values', lambda: self._level('mappings') == _OK)
        self._print_statuses('mappings')

    def _show_death_of_bridge(self) -> None:
        self._title('The bridge dies (kill -9); first another reset, because ROS has lost control')
        self._take_control()
        assert self._bridge is not None
        self._bridge.process.kill()
        self._bridge.process.wait()
        self._bridge = None
        died = time.monotonic()
        self._wait('the watchdog', lambda: Lamp.IN_CONTROL not in self._lamps)
        self._say(f'{time.monotonic() - died:.1f} s later the watchdog of the PLC has taken the '
                  'speed away')
        print('\n   ... and comes back, but without a reset it gets no control', flush=True)
        self._watcher.values.clear()
        self._watcher.statuses.clear()
        self._start_bridge()
        self._wait('a heartbeat', lambda: Lamp.ALIVE in self._lamps)
        self._wait('values', lambda: {'used_speed', 'doors'} <= self._watcher.values.keys())
        self._wait('the diagnostics', lambda: self._level('mappings') == _OK)
        self._say(f'800 is still published, and the program uses [{self._used()}]')
        if self._used() or Lamp.IN_CONTROL in self._lamps:
            raise Missed('without a reset ROS should have no control')

    def _are_all_ok(self) -> bool:
        """Tell whether all statuses are OK except ``topics``: other nodes may publish there."""
        return all(status.level == _OK for name, status in self._watcher.statuses.items()
                   if name != 'topics')

    def _show_diagnostics(self) -> None:
        self._title('Diagnostics: what `ros2 topic echo /diagnostics` says, in short')
        if self._speed:  # the bridge came back, but reset was not pressed
            self._wait('the reset to be missed', lambda: 'does not confirm' in
                       self._watcher.statuses['interlocks'].message)
            self._print_statuses('interlocks')
            for _ in range(_RESETS):
                self._take_control()
                if self._wait_in_control('all statuses to be OK', self._are_all_ok):
                    break
        # If a busy machine has caused an unconfirmed write, a status is not OK for ten seconds.
        self._wait('all statuses to be OK', self._are_all_ok)
        self._print_statuses(*self._watcher.statuses)
        self._say('the counters of the line that are not 0:')
        for pair in self._watcher.statuses['counters'].values:
            if pair.value != '0':
                print(f'    {pair.key:<24} {pair.value:>7}', flush=True)


def main(args: Sequence[str] | None = None) -> int:
    """Run the demo; return 0, or 1 if a step failed."""
    prepare_output()
    options = parser_of('demo').parse_args(args)
    return run_command('demo', partial(_run, options))


def _run(options: argparse.Namespace) -> int:
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    domain, claim = claim_domain()
    os.environ.setdefault('ROS_DOMAIN_ID', str(domain))
    scene = FULL_DUPLEX if options.peer else HALF_DUPLEX
    with claim, tempfile.TemporaryDirectory(prefix='abdf1_') as folder:
        return tell_steps(Demo(scene, Path(folder) / 'line'), options.seconds)


def tell_steps(demo: Demo, seconds: float) -> int:
    """Run the demo and end it; print the verdict."""
    status, verdict = 0, ''
    try:
        demo.run(seconds)
    except KeyboardInterrupt:
        print()
        if not demo.is_told:
            verdict = f'demo: interrupted in step {demo.step} of {demo.last_step}'
    except Missed as reason:
        status = 1
        verdict = (f'demo: step {demo.step} of {demo.last_step} was not seen as it should be: '
                   f'{reason}')
    except OSError:
        drop_output()  # what ends prints as well
        raise
    finally:
        ignore_further()  # otherwise one of our processes may stay
        demo.close()
    print(verdict or f'demo: all {demo.last_step} steps were seen as they should be', flush=True)
    return status


if __name__ == '__main__':
    raise SystemExit(main())
