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

import os
from pathlib import Path
import signal
import time

import pytest
from support.ros import EXAMPLE_FILES, PATIENCE, Process, ros_args, write_csv

# After SIGTERM all is over within so many seconds, and some for a busy host to see it; systemd
# waits for 10.
LIMIT, BUSY = 5.0, 2.0

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


@pytest.mark.parametrize('delay', [0.0, 0.1, 0.3, 1.0, None])
@pytest.mark.parametrize('name', RUNS)
def test_stream_of_signals_ends_it_as_one_does(
        tmp_path: Path, name: str, delay: float | None) -> None:
    with program(tmp_path, name) as process:
        process.wait_for('begins' if delay is not None else RUNS[name])
        time.sleep(delay or 0.0)
        begun = time.monotonic()
        while process.is_running and time.monotonic() - begun < PATIENCE:
            process.send(signal.SIGINT, signal.SIGTERM)
            time.sleep(0.002)  # the processor is for those who end
        assert process.result() == 0, process.text
        assert 'Traceback' not in process.text


@pytest.mark.parametrize('error', ['ValueError', 'RuntimeError'])
@pytest.mark.parametrize(('name', 'function'), [
    ('node', 'abdf1_ros.ros.node.BridgeNode.check'),
    ('lines', 'abdf1_ros.ros.lines.Lines._look')])
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
# wait for a busy host.
EARLY = 'import abdf1_ros.ros.process\nabdf1_ros.ros.process._DESTRUCTION_LIMIT = 2.0\n'
HANGS = {'held': 'ctypes.PyDLL(None).sleep(60)', 'slow': 'time.sleep(60)'}


@pytest.mark.parametrize(('where', 'how', 'status'), [
    ('destroy_node', 'slow', 0),  # PLCs and writes are done
    ('destroy_node', 'held', 1),  # with the interpreter lock: no code of ours runs any more
    ('check', 'slow', 1)])
@pytest.mark.parametrize('name', ['node', 'lines'])
def test_clock_ends_what_does_not_come_back(
        tmp_path: Path, name: str, where: str, how: str, status: int) -> None:
    patch = (f'{EARLY}from abdf1_ros.ros.node import BridgeNode\n'
             f'def hang(self, *arguments): print("hangs", flush=True); {HANGS[how]}\n'
             f'BridgeNode.{where} = hang')
    with program(tmp_path, name, patch) as process:
        process.wait_for('hangs' if where == 'check' else RUNS[name])
        process.send(signal.SIGTERM)
        begun = time.monotonic()
        assert process.result() == status, process.text
        assert time.monotonic() - begun < LIMIT + BUSY
        assert ('in hang' in process.text) is bool(status)  # it says where


def processor_time(number: int) -> float:
    """Return what the main thread of a process has used so far (s); others belong to DDS."""
    fields = Path(f'/proc/{number}/task/{number}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def many_rows(file: Path, count: int) -> Process:
    """Start the node of a file with so many rows."""
    folder = file.parent
    rows = (f'row_{number},{"Read" if number % 5 else "ReadWrite"},N{10 + number // 250}:'
            f'{number % 250},1,PLC5' for number in range(count))
    table = write_csv(folder / f'map_{count}.csv', 'Tag,Command,Address,Station,PLC_Type', rows)
    net = write_csv(folder / f'net_{count}.csv', 'Com_Port,Baud', [f'{folder}/none,19200'])
    return Process(file, *ros_args(f'net_file:={net}', f'map_file:={table}'),
                   '-r', f'__node:=rows_{count}')


@pytest.mark.timeout(300)  # what counts is the processor time of both, which a busy host changes
def test_time_to_start_grows_with_the_rows_and_thousands_end_in_time(
        tmp_path: Path) -> None:
    file = patched(tmp_path, 'node', EARLY)  # once: the other process may be reading it
    with many_rows(file, 1000) as small, many_rows(file, 5000) as large:
        took: dict[Process, float] = {}
        while len(took) < 2:
            for process in {small, large} - took.keys():
                assert process.is_running, process.text
                if RUNS['node'] in process.text:
                    took[process] = processor_time(process.number)
            time.sleep(0.05)
        print(f'{took[small]:.1f} s and {took[large]:.1f} s')
        assert took[large] < 15 * took[small]  # 25 times, if each had to do with each
        large.send(signal.SIGTERM)
        begun = time.monotonic()
        assert large.result() == 0, large.text
        assert time.monotonic() - begun < LIMIT + BUSY
