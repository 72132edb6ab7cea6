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

"""The demo beside others on the network, and what it says at its end."""

from collections import Counter
from contextlib import suppress
from functools import partial
import os
from pathlib import Path
import re
import signal
from typing import Any
from unittest.mock import call, Mock

from abdf1_ros.cli import demo
from abdf1_ros.simulator.ladder import Lamp
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from support.cases import compare_stored, for_all
from support.ros import Observer, Process


@pytest.mark.long
def test_others_on_the_network_are_not_taken_for_the_bridge() -> None:
    with Observer() as observer, Process('demo', '--peer', '--seconds', '0') as story:
        diagnostics = observer.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        results = observer.node.create_publisher(DiagnosticStatus, '/abdf1/write_results', 10)

        def is_over() -> bool:
            diagnostics.publish(DiagnosticArray(status=[
                DiagnosticStatus(name=name, level=DiagnosticStatus.ERROR, hardware_id=name)
                for name in ('arm', 'nav: planner', 'abdf1: link', 'abdf1: pump')]))
            results.publish(DiagnosticStatus(name='recipe', message='written'))
            if 'Still running; Ctrl-C ends it' in story.text:
                story.send(signal.SIGINT)
            return not story.is_running

        observer.until(is_over, lambda: story.text)
    assert story.result() == 0, story.text
    assert story.lines[-1] == 'demo: all 5 steps were seen as they should be'
    told = [line for line in story.lines if not line.startswith('node: ')]  # at any moment
    refused = told.index(next(line for line in told if '5000] to' in line)) + 1
    assert 'result: not written: refused' in told[refused]
    assert 'pump' not in story.text


def test_demo_stays_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', '')  # so that it is restored
    monkeypatch.delenv('ROS_AUTOMATIC_DISCOVERY_RANGE')
    ours = os.environ['ROS_DOMAIN_ID']
    monkeypatch.delenv('ROS_DOMAIN_ID')
    monkeypatch.setattr(demo, 'Demo', lambda *_: Told(None))
    assert demo.main([]) == 0
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert os.environ['ROS_DOMAIN_ID'] != ours  # nobody else's
    monkeypatch.setenv('ROS_DOMAIN_ID', ours)
    assert (demo.main([]), os.environ['ROS_DOMAIN_ID']) == (0, ours)  # as the user has said


def test_bridge_and_folder_end_with_a_demo_that_is_killed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    with Observer() as observer, Process('demo', '--peer', '--seconds', '60') as story:
        story.wait_for('is notified')
        told = [re.sub(r' *-?[0-9.]+', '#', line) for line in story.lines
                if not line.startswith(('node: ', 'simulator: ')) and 'look on' not in line]
        assert [*told, ''] == Path(__file__).with_name('stored').joinpath(
            'demo.txt').read_text('utf-8').split('\n')
        assert any(re.fullmatch('node: INFO /.*/line: open', line) for line in story.lines)
        assert 'abdf1' in observer.node.get_node_names()
        children = Path(f'/proc/{story.number}/task/{story.number}/children')
        bridge = Path('/proc', children.read_text(encoding='ascii').split()[0], 'stat')

        def has_ended() -> bool:
            with suppress(OSError):
                return ') Z ' in bridge.read_text(encoding='utf-8')
            return True

        assert list(tmp_path.glob('abdf1_*'))
        story.send(signal.SIGKILL)
        observer.until(has_ended, 'its end')
    assert not list(tmp_path.glob('abdf1_*'))


class Told:
    """Stands in for a demo of 7 steps that stops."""

    last_step, is_told = 7, False

    def __init__(self, end: BaseException | None, *, is_told: bool = False) -> None:
        self._end, self._is_told = end, is_told or end is None
        self.step = 7 if isinstance(end, KeyboardInterrupt) else 3  # also in the last step

    def run(self, seconds: float) -> None:
        """End as told."""
        self.is_told = self._is_told
        if self._end:
            raise self._end

    def close(self) -> None:
        """Say something, as the processes do when they end."""
        print('node: INFO end')


@for_all(('end', 'is_told', 'status', 'text'), [
    (KeyboardInterrupt(), True, 0, 'demo: all 7 steps were seen as they should be'),
    (KeyboardInterrupt(), False, 0, 'demo: interrupted in step 7 of 7'),
    (demo.Missed('no values'), True, 1,  # while it runs on after the story
     'demo: step 3 of 7 was not seen as it should be: no values')])
def test_the_last_line_says_what_was_not_seen(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
        end: BaseException | None, is_told: bool, status: int, text: str) -> None:
    monkeypatch.setattr(demo, 'ignore_further', lambda: None)
    told: Any = Told(end, is_told=is_told)
    assert demo.tell_steps(told, 0.0) == status
    assert capsys.readouterr().out.splitlines()[-1] == text


def test_output_that_is_not_read_any_more_ends_it_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.terminal.drop', dropped := Mock())
    monkeypatch.setattr(demo, 'Demo', lambda *_: Told(BrokenPipeError()))
    assert (demo.main([]), dropped.call_count) == (0, 2)  # also before its processes end


class Cell:
    """PLCs, bridge and watcher of the half-duplex demo, in virtual time; ``fault`` goes wrong."""

    def __init__(self, fault: str) -> None:
        self.fault, self.now, self.node, self.has_failed = fault, 1000.0, self, False
        self.values: dict[str, Any] = {'recipe': [0]}
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.results: list[DiagnosticStatus] = []
        self.taken, self.missed = Counter[str](), Counter[str]()
        self.off, self.lit, self.starts, self.is_up = '', set[Lamp](), 0, False
        self.is_in_control, self.speed, self.spoken, self.heard = False, 0, 0.0, -9.0
        self.process = Mock(poll=lambda: None if self.is_up else 1, kill=partial(self.put, False))
        self.start, self.advance, self.relay, self.ended = Mock(), Mock(), Mock(), Mock()
        self.end, self.close, self.__exit__ = self.ended.end, self.ended.close, self.ended.leave

    def put(self, is_up: bool, *_: Any) -> 'Cell':
        self.is_up, self.starts, self.started = is_up, self.starts + is_up, self.now
        return self

    def cast(self, options: object, on_lamp: Any) -> 'Cell':
        self.on_lamp = on_lamp
        return self

    def expect(self, mapping: Any) -> float:
        self.taken.clear()
        return 1.5

    def create_publisher(self, kind: type, topic: str, depth: int) -> Any:
        return Mock(publish=partial(self.publish, topic), get_subscription_count=lambda: 1)

    def publish(self, topic: str, message: Any) -> None:
        if topic == '/abdf1/write/speed':
            self.speed, self.spoken = message.data[0], self.now
            return
        is_good = max(message.data) < 1000 or self.fault == 'takes all'
        self.values['recipe'] = message.data if is_good else self.values['recipe']
        self.results.append(DiagnosticStatus(
            name='recipe', message='written' if is_good else 'not written: refused: too large',
            values=[KeyValue(key='latency_ms', value='5')]))

    def carry_out(self, command: str) -> None:
        print(f'simulator: {command}')
        self.off = command
        self.is_up &= command != self.fault
        if command == 'reset 2':
            self.is_in_control = self.fault != 'no control'

    def spin_once(self, seconds: float) -> None:
        self.now += 5 * seconds
        is_stalled = self.fault == f'stalls at {self.off}, {self.speed}' and self.now < 1015
        self.heard = self.now if self.is_up and not is_stalled else self.heard
        is_alive, is_spoken = self.now - self.heard < 3, self.now - self.spoken < 2.2
        self.is_in_control &= self.off != 'program 2' and (
            is_alive and is_spoken or self.fault == ('no loss' if is_alive else 'no watchdog'))
        is_back = self.starts > 1 and not self.is_in_control
        for lamp, is_on in ((Lamp.ALIVE, is_alive), (Lamp.IN_CONTROL, self.is_in_control or (
                is_back and self.fault == 'comes back in control'))):
            if is_on != (lamp in self.lit):
                self.lit ^= {lamp}
                self.on_lamp('2', lamp, is_on)
        if not self.is_up or is_stalled:
            return
        tags = {'cell_interlocks', 'line_speed', 'tank_levels', 'plc_alive', 'doors'} - (
            {'cell_interlocks', 'line_speed', 'tank_levels'} if self.off == 'silent 1' else
            {'doors'} if self.off == 'program 2' else set())
        is_used = self.is_in_control or is_back and self.fault == 'comes back with a speed'
        self.values |= dict.fromkeys(tags, [int(self.now)]) | {
            'in_control': [int(self.is_in_control)],
            'used_speed': [self.speed * (is_used and is_spoken)]}
        self.taken.update(tags)
        self.missed.update({'cell_interlocks', 'doors'} - tags)
        if self.now < self.started + 1:
            return
        self.statuses = {name: DiagnosticStatus(
            name=f'abdf1: {name}', message=f'does not confirm: {is_bad}' if is_bad else 'good',
            level=DiagnosticStatus.ERROR if is_bad else DiagnosticStatus.OK,
            values=[KeyValue(key='polls', value='7'), KeyValue(key='naks', value='0')])
            for name, is_bad in (
                ('link', self.fault == 'never good'), ('station 1', self.off == 'silent 1'),
                ('mappings', self.off in ('silent 1', 'program 2')), ('counters', False),
                ('interlocks', not self.is_in_control))}


@for_all(('fault', 'status', 'verdict'), [
    *((fault, 0, 'all 7 steps were seen as they should be') for fault in (
        '', 'stalls at reset 2, 0', 'stalls at reset 2, 800')),
    *((fault, 1, f'step {step} of 7 was not seen as it should be: {reason}')
      for fault, step, reason in (
          ('takes all', 2, 'the result of [1, 2, 3, 5000] should be "not written: refused"'),
          ('silent 1', 3, 'the node or the simulator has ended; see above'),
          ('no control', 4, 'a reset of the PLC has not given ROS control'),
          ('no loss', 4, 'waited 30 s for the fallback value, which did not come'),
          ('no watchdog', 6, 'waited 30 s for the watchdog, which did not come'),
          ('comes back in control', 6, 'without a reset ROS should have no control'),
          ('comes back with a speed', 6, 'without a reset ROS should have no control'),
          ('never good', 7, 'waited 30 s for all statuses to be OK, which did not come')))])
def test_story_of_the_half_duplex_line_is_told_as_stored_and_judged(
        fault: str, status: int, verdict: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Cell(fault)
    for name, part in (('Cast', cell.cast), ('Watcher', lambda *_: cell), ('called', str),
                       ('DemoBridge', partial(cell.put, True)), ('ignore_further', Mock()),
                       ('time', Mock(monotonic=lambda: cell.now))):
        monkeypatch.setattr(demo, name, part)
    monkeypatch.setenv('ROS_DOMAIN_ID', '7')
    story = demo.Demo(demo.HALF_DUPLEX, tmp_path / 'line')
    assert demo.tell_steps(story, 20.0) == status
    told = capsys.readouterr().out
    assert told.endswith(f'\ndemo: {verdict}\n')
    assert cell.ended.method_calls == [
        call.end()] * (fault != 'no watchdog') + [call.close(), call.leave()]
    if not fault:
        compare_stored(Path(__file__).with_name('stored') / 'demo_half.txt', told)
