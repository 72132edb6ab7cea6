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
Programs as processes that need not import the package: forks of a server that has done so.

The imports of a node take 0.5 s of processor time, and the tests start hundreds of processes.
A fork has arguments, environment, folder, standard streams and an exit status of its own.
"""

from collections.abc import Sequence
from contextlib import suppress
import fcntl
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
import os
from pathlib import Path
import runpy
import signal
import subprocess
import sys
from typing import IO

_CONTEXT = get_context('forkserver')
_CONTEXT.set_forkserver_preload([
    'abdf1_ros.ros.node', 'abdf1_ros.ros.lines', 'abdf1_ros.cli.simulator', 'abdf1_ros.cli.sniff',
    'abdf1_ros.cli.plc.command', 'abdf1_ros.cli.monitor.command',
    # What rclpy imports only when a node is made:
    'rosidl_generator_py', 'service_msgs.msg', 'type_description_interfaces.msg'])


class Forked:
    """A program of Python without a new interpreter; as much of Popen as tests need."""

    def __init__(self, program: str | Path, args: Sequence[str],
                 descriptor: int | None = None) -> None:
        """
        Start a command of the package, or a file.

        Its standard streams are pipes, unless the ``descriptor`` of a terminal or a file is given.
        """
        if descriptor is not None:
            self._start(program, args, [Connection(os.dup(descriptor)) for _ in range(3)])
            return
        (stdin, to_it), (out, stdout), (errors, stderr) = (
            _CONTEXT.Pipe(duplex=False) for _ in range(3))
        self._start(program, args, (stdin, stdout, stderr))
        self.stdin = _opened(os.dup(to_it.fileno()), 'w')
        self.stdout = _opened(os.dup(out.fileno()), 'r')
        self.stderr = _opened(os.dup(errors.fileno()), 'r')

    def _start(self, program: str | Path, args: Sequence[str],
               streams: Sequence[Connection]) -> None:
        self._process = _CONTEXT.Process(target=_run, args=(
            program, args, dict(os.environ), os.getcwd(), streams))
        self._process.start()
        for end in streams:
            end.close()

    @property
    def pid(self) -> int:
        """Return the number that the operating system has for it."""
        assert self._process.pid is not None
        return self._process.pid

    def poll(self) -> int | None:
        """Return the exit status, the negative number of a signal, or None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status; raise subprocess.TimeoutExpired after ``timeout`` s."""
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):  # the server knows before we do
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _opened(descriptor: int, mode: str) -> IO[str]:
    return open(descriptor, mode, encoding='utf-8')


def _run(program: str | Path, args: Sequence[str], environment: dict[str, str], folder: str,
         streams: Sequence[Connection]) -> None:
    """Be the process, in the child."""
    # The tests hold the other end of this pipe: if they are killed, so are we.
    tests = parent_process().sentinel  # type: ignore[union-attr]
    fcntl.fcntl(tests, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(tests, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(tests, fcntl.F_SETFL, os.O_ASYNC)
    for number, stream in enumerate(streams):
        os.dup2(stream.fileno(), number)
        stream.close()
    sys.stdin, sys.stdout, sys.stderr = map(_opened, range(3), 'rww')
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the server ignores it
    if isinstance(program, Path):
        sys.argv = [str(program), *args]
        runpy.run_path(str(program), run_name='__main__')
    else:
        sys.argv = ['abdf1_ros', program, *args]
        runpy.run_module('abdf1_ros', run_name='__main__', alter_sys=True)
