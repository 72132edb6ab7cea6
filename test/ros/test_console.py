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

"""What a process says never holds it up, though its terminal, pipe or disk stands still."""

from contextlib import ExitStack
import errno
import os
from pathlib import Path
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from types import SimpleNamespace
from typing import Any

from abdf1_ros import console
from abdf1_ros.console import pass_on, Sink
from abdf1_ros.testing.cell import PATIENCE
from abdf1_ros.testing.plcs import Plcs
import pytest
from std_msgs.msg import Int16MultiArray
from support.ptys import full_pipe
from support.ros import Observer, ros_args, write_csv

ROWS = ('speed,Write,N7:0,1,PLC5,1,speed,-1,500', 'refused,Write,N7:99,1,PLC5,1,refused,,')
DATA = 'Station,PLC_Type,Address,Length,Values\n1,PLC5,N7:0,4,0 0 0 0\n'
NET = 'Com_Port,Baud,Timeout,Cmd_Timeout\n/dev/plc,115200,300,3000\n'
LOST = b'[WARN] abdf1_ros: lines lost here, as they were not taken: %d\n'


def unread_pipe(stack: ExitStack) -> int:
    """Return a pipe that nothing reads."""
    reader, writer = full_pipe()
    stack.callback(os.close, reader)
    return writer


def stopped_terminal(stack: ExitStack) -> int:
    """Return a terminal after Ctrl-S."""
    master, slave = pty.openpty()
    stack.callback(os.close, master)
    termios.tcflow(slave, termios.TCOOFF)
    return slave


def start(stack: ExitStack, folder: Path, said: int, port: str, *program: str,
          ) -> subprocess.Popen[bytes]:
    """Start a node in ``folder`` whose output goes to ``said``, which is closed here."""
    (folder / 'net.csv').write_text(NET)
    write_csv(folder / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Length,Topic,'
              'Fallback,Fallback_After', ROWS)
    arguments = ros_args(*(f'{name}_file:={folder}/{name}.csv' for name in ('net', 'map')),
                         f'port:={port}')
    node = subprocess.Popen([sys.executable, *program, *arguments], stdout=said, stderr=said,
                            env=os.environ | {'ROS_LOG_DIR': str(folder / 'log')})
    stack.callback(node.kill)
    os.close(said)
    return node


@pytest.mark.parametrize('make', [
    unread_pipe, pytest.param(stopped_terminal, marks=pytest.mark.long)])
def test_fallback_and_end_come_in_time_where_nothing_reads_the_log(
        make: Any, tmp_path: Path) -> None:
    with ExitStack() as stack:
        observer = stack.enter_context(Observer())
        (tmp_path / 'data.csv').write_text(DATA)
        plcs = stack.enter_context(Plcs(tmp_path / 'data.csv'))
        node = start(stack, tmp_path, make(stack), plcs.port, '-m', 'abdf1_ros', 'node')
        publisher = observer.publisher(Int16MultiArray, '/abdf1/write/speed')
        refused = observer.publisher(Int16MultiArray, '/abdf1/write/refused')
        for turn in range(20):
            publisher.publish(Int16MultiArray(data=[777]))
            refused.publish(Int16MultiArray(data=[turn]))  # each refusal is logged, ten a minute
            observer.wait(lambda: None, 0.05)

        def has_come() -> bool:
            publisher.publish(Int16MultiArray(data=[777]))  # it stands for 0.5 s
            return plcs.word('N7:0') == 777

        observer.until(has_come, 'the message')
        observer.node.destroy_publisher(publisher)
        observer.until(lambda: plcs.word('N7:0') == 0xFFFF, 'the fallback')
        node.send_signal(signal.SIGTERM)
        assert node.wait(PATIENCE) == 0
        (log,) = (tmp_path / 'log').iterdir()
        assert f'{plcs.port}: open' in log.read_text()  # a file of its own, and /rosout, have it


HANGS = """
import sys, time
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.process import main
main._END_LIMIT = 2.0
BridgeNode.begin_end = lambda node: time.sleep(99)
from abdf1_ros.cli.main import run
sys.exit(run('node'))
"""


def test_process_that_hangs_is_ended_though_nothing_reads_its_log(tmp_path: Path) -> None:
    with ExitStack() as stack:
        observer = stack.enter_context(Observer())
        node = start(stack, tmp_path, unread_pipe(stack), f'{tmp_path}/none', '-c', HANGS)
        observer.meet('/abdf1')
        node.send_signal(signal.SIGTERM)
        assert node.wait(PATIENCE) == 1


def test_lines_that_nothing_takes_are_counted_and_told_when_they_are_taken_again() -> None:
    reader, writer = full_pipe()
    sink = Sink(writer, most=40)
    for number in range(10):
        sink.put(b'line %d\n' % number)  # 7 bytes: five fit
    sink.start()
    text = b''
    while b'lost' not in text:
        text += os.read(reader, 65536).replace(b'\0', b'')
    sink.put(b'again\n')  # there is room for it now
    while b'again' not in text:
        text += os.read(reader, 65536)
    sink.put(b'x' * 41)  # no line comes after it
    assert select.select([reader], [], [], PATIENCE)[0]
    sink.end()
    sink.join(PATIENCE)
    text += os.read(reader, 65536)
    assert text == b''.join(
        b'line %d\n' % number for number in range(5)) + LOST % 5 + b'again\n' + LOST % 1
    for descriptor in (reader, writer):
        os.close(descriptor)


def test_count_of_lost_lines_outlives_a_write_that_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk took the count of the lines before with it."""
    slept: list[float] = []
    monkeypatch.setattr(console, 'time', SimpleNamespace(sleep=slept.append))
    taken: list[bytes] = []
    answers: list[int | OSError] = [7, OSError(errno.ENOSPC, 'No space left on device')]

    def write(descriptor: int, data: bytes) -> int:
        answer = answers.pop(0) if answers else len(data)
        if isinstance(answer, OSError):
            raise answer
        taken.append(data[:answer])
        return answer

    monkeypatch.setattr(os, 'write', write)
    sink = Sink(-1, most=20)
    for number in range(6):
        sink.put(b'line %d\n' % number)  # two fit, four are lost
    sink.start()
    while answers or not taken[1:]:
        time.sleep(0.01)
    sink.end()
    sink.join(PATIENCE)
    assert (b''.join(taken), slept) == (b'line 0\n' + LOST % 5, [console.PAUSE])


def test_log_file_gets_no_colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name in ((os, '_exit'), (signal, 'signal')):
        monkeypatch.setattr(module, name, lambda *args: None)
    paths = source, out, log = [tmp_path / name for name in ('source', 'out', 'log')]
    source.write_bytes(b'\x1b[33mwarning\x1b[0m\nlast')  # a crash ends in a line
    with ExitStack() as stack:
        numbers = [stack.enter_context(path.open('ab+')).fileno() for path in paths]
        os.lseek(numbers[0], 0, os.SEEK_SET)
        console.relay(['{}:{},{}'.format(*numbers)])
    assert (out.read_bytes(), log.read_bytes()) == (source.read_bytes(), b'warning\nlast')


def test_line_that_is_too_long_is_counted(tmp_path: Path) -> None:
    text = tmp_path / 'text'
    for last in (b'after', b'after\n'):
        text.write_bytes(b'before\n' + b'x' * 2_500_000 + b'\n' + last)
        reader, writer = os.pipe()
        sink = Sink(writer)
        with text.open('rb') as source:
            pass_on(source.fileno(), [sink])
        sink.start()
        sink.join(PATIENCE)
        assert (os.read(reader, 1000), sink.is_alive()) == (b'before\n' + LOST % 2, False)
        for descriptor in (reader, writer):
            os.close(descriptor)
