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

from contextlib import suppress
import os
from pathlib import Path
import re
import signal
import time
from typing import Any
from unittest.mock import Mock

from abdf1_ros.cli import demo
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from support.cases import for_all
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


@pytest.mark.long
def test_story_goes_on_after_stalls_of_the_bridge() -> None:
    def signal_bridge(number: int) -> None:
        children = Path(f'/proc/{story.number}/task/{story.number}/children').read_text()
        os.kill(int(children), number)

    with Process('demo', '--seconds', '1') as story:
        for title in ('4. ', '5. ', '6. ', '7. '):  # each has the patience of one wait
            line = story.wait_for(title)
            if title == '5. ':
                signal_bridge(signal.SIGSTOP)
                time.sleep(2.0)  # a new subscription has no value yet, and so no deadline
                signal_bridge(signal.SIGCONT)
        story.wait_for('in_control is [1]', after=story.lines.index(line))
        after = len(story.lines)
        signal_bridge(signal.SIGSTOP)
        story.wait_for('ROS in control off', after=after)
        signal_bridge(signal.SIGCONT)
        story.wait_for('used_speed is [800]', after=after)
    assert story.result() == 0, story.text


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
    *((end, True, 0, 'demo: all 7 steps were seen as they should be')
      for end in (None, KeyboardInterrupt())),
    (KeyboardInterrupt(), False, 0, 'demo: interrupted in step 7 of 7'),
    *((demo.Missed('waited 30 s for values, which did not come'), is_told, 1,
       'demo: step 3 of 7 was not seen as it should be: waited 30 s for values, which did '
       'not come') for is_told in (True, False))])  # also while it runs on after the story
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
