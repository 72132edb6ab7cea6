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

"""How ``node``, ``lines`` and ``simulator`` end: by signals, by bugs, and by the clock."""

from pathlib import Path
import signal
import time
from types import SimpleNamespace
from typing import Any

from abdf1_ros.ros.process.main import destroy
import pytest
import rclpy
from support.ros import EXAMPLE_FILES, PATIENCE, Process, ros_args, write_csv

# Before the program sets its own handlers a signal ends it like this.
PROGRAM = """
import ctypes, os, signal, sys, time
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: os._exit(0))
print('begins', flush=True)
from abdf1_ros.cli.main import run
{patch}
sys.exit(run('{name}'))
"""


def patched(folder: Path, name: str, patch: str) -> Path:
    """Return a file that runs a command with a patch."""
    file = folder / f'{name}.py'
    file.write_text(PROGRAM.format(name=name, patch=patch))
    return file


def program(folder: Path, name: str, patch: str = '') -> Process:
    """Start a command with a patch that breaks it."""
    file = patched(folder, name, patch)
    port = f'port:={folder}/none'
    if name == 'simulator':
        return Process(file, '--pty', str(folder / 'plc'))
    if name == 'node':
        return Process(file, *ros_args(*EXAMPLE_FILES, port))
    files = '\n'.join(f'    {text.replace(":=", ": ")}' for text in (*EXAMPLE_FILES, port))
    (folder / 'lines.yaml').write_text(f'/hall/a:\n  ros__parameters:\n{files}\n')
    return Process(file, '--ros-args', '--params-file', str(folder / 'lines.yaml'))


RUNS = {'node': 'cannot open the port', 'lines': 'cannot open the port', 'simulator': 'stations 1'}


@pytest.mark.parametrize('is_early', [True, False])
@pytest.mark.parametrize('name', RUNS)
def test_stream_of_signals_ends_it_as_one_does(tmp_path: Path, name: str, is_early: bool) -> None:
    with program(tmp_path, name) as process:
        process.wait_for('begins' if is_early else RUNS[name])
        time.sleep(0.1 * is_early)  # to a moment in its imports
        begun = time.monotonic()
        while process.is_running and time.monotonic() - begun < PATIENCE:
            process.send(signal.SIGINT, signal.SIGTERM)
            time.sleep(0.002)  # the processor is for those who end
        assert process.result() == 0, process.text
        assert 'Traceback' not in process.text


@pytest.mark.parametrize(('name', 'function', 'error'), [
    ('node', 'abdf1_ros.ros.bridge.node.BridgeNode.check', 'ValueError'),
    ('lines', 'abdf1_ros.ros.lines.Lines._look', 'RuntimeError')])
def test_bug_ends_it_with_a_traceback(
        tmp_path: Path, name: str, function: str, error: str) -> None:
    patch = (f'import {function.rpartition(".")[0].rpartition(".")[0]}\n'
             f'def broken(self): raise {error}("a bug")\n{function} = broken')
    with program(tmp_path, name, patch) as process:
        assert process.result() == 1, process.text
        assert 'Traceback' in process.text
        assert f'{error}' in process.lines[-1] and 'a bug' in process.lines[-1]
        assert 'bad arguments' not in process.text
        assert 'does not start' not in process.text


# Nodes get less time to be taken off the network, as what ends the process by the clock does not
# wait for a busy host; and where the clock ends it, that comes sooner.
EARLY = 'import abdf1_ros.ros.process.main\nabdf1_ros.ros.process.main._DESTRUCTION_LIMIT = 0.5\n'
SOON = 'import abdf1_ros.ros.process.main\nabdf1_ros.ros.process.main._END_LIMIT = 1.0\n'
LIMITS = {'early': EARLY, 'soon': SOON, 'usual': ''}
HANGS = {'held': 'ctypes.PyDLL(None).sleep(60)', 'slow': 'time.sleep(60)'}


@pytest.mark.parametrize(('name', 'where', 'how', 'limit', 'status'), [
    ('node', '__init__', 'slow', 'usual', 0),  # no port is open yet
    ('node', 'destroy_node', 'slow', 'early', 0),  # PLCs and writes are done
    ('node', 'destroy_node', 'held', 'soon', 1),  # with the interpreter lock: no code of ours runs
    pytest.param('node', 'check', 'slow', 'usual', 1, marks=pytest.mark.long),
    ('lines', 'check', 'slow', 'soon', 1)])
def test_clock_ends_what_does_not_come_back(
        tmp_path: Path, name: str, where: str, how: str, limit: str, status: int) -> None:
    patch = (f'{LIMITS[limit]}from abdf1_ros.ros.bridge.node import BridgeNode\n'
             f'def hang(self, *arguments, **named): print("hangs", flush=True); {HANGS[how]}\n'
             f'BridgeNode.{where} = hang')
    with program(tmp_path, name, patch) as process:
        process.wait_for(RUNS[name] if where == 'destroy_node' else 'hangs')
        process.send(signal.SIGTERM)
        assert process.result() == status, process.text  # it hangs for longer than this waits
        assert ('in hang' in process.text) is bool(status)  # it says where


def test_nodes_have_their_time_to_leave_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    monkeypatch.setattr(rclpy, 'try_shutdown', lambda: done.append('shut down'))
    program: Any = SimpleNamespace(destroy=lambda: (time.sleep(0.1), done.append('destroyed')))
    destroy(program, time.monotonic() + PATIENCE)
    assert done == ['destroyed', 'shut down']


# What the node takes to be made, without what DDS does for its publishers and subscriptions: that
# grows with the square of their number.
COSTS = """
from abdf1_ros.ros.process import main as process
from rclpy.node import Node
costs_of_dds = []
def timed(function, costs):
    def run(*arguments, **options):
        begun = time.thread_time()
        try:
            return function(*arguments, **options)
        finally:
            costs.append(time.thread_time() - begun)
    return run
Node.create_publisher = timed(Node.create_publisher, costs_of_dds)
Node.create_subscription = timed(Node.create_subscription, costs_of_dds)
make = timed(process._made, costs := [])
def made(*arguments):
    program = make(*arguments)
    print(f'endpoints {len(costs_of_dds)} cost {costs[0] - sum(costs_of_dds)}', flush=True)
    return program
process._made = made
"""


def many_rows(file: Path, count: int) -> Process:
    """Start the node of a file with so many rows."""
    folder = file.parent
    rows = (f'row_{number},{"Read" if number % 5 else "ReadWrite"},N{10 + number // 250}:'
            f'{number % 250},1,PLC5' for number in range(count))
    table = write_csv(folder / f'map_{count}.csv', 'Tag,Command,Address,Station,PLC_Type', rows)
    net = write_csv(folder / f'net_{count}.csv', 'Com_Port,Baud', [f'{folder}/none,19200'])
    return Process(file, *ros_args(f'net_file:={net}', f'map_file:={table}'),
                   '-r', f'__node:=rows_{count}')


def cost_to_make(process: Process, count: int) -> float:
    """Return the processor time (s) that the node of so many rows itself took to be made."""
    while not (line := next((line for line in process.lines if line.startswith('endpoints')), '')):
        assert process.is_running, process.text
        time.sleep(0.05)
    _, endpoints, _, seconds = line.split()
    assert int(endpoints) > count
    return float(seconds)


@pytest.mark.long
@pytest.mark.timeout(300)  # two of them begin at once, on a busy host
def test_time_to_start_grows_with_the_rows_and_a_thousand_end_in_time(tmp_path: Path) -> None:
    file = patched(tmp_path, 'node', EARLY + COSTS)  # once: the other process may be reading it
    with many_rows(file, 200) as small, many_rows(file, 1000) as large:
        took = {count: cost_to_make(process, count)
                for process, count in ((small, 200), (large, 1000))}
        print(took)
        assert took[1000] < 10 * took[200]  # 25 times, if each had to do with each
        large.wait_for(RUNS['node'])
        large.send(signal.SIGTERM)
        assert large.result() == 0, large.text
