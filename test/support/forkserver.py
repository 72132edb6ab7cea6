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
Processes of the package that need not import it: a server that has done so forks them.

The imports of a node take 0.4 s of processor time, and the tests start some hundred nodes,
simulators and monitors. The server is this file, run as a program: single-threaded, without DDS.
A child has arguments, environment, folder and standard streams of its own, and ends as any
interpreter does. What is about the start of an interpreter starts one.
"""

from __future__ import annotations

import atexit
from collections.abc import Sequence
import gc
from importlib import import_module
import json
import os
from pathlib import Path
import runpy
import select
import signal
import socket
import subprocess
from subprocess import DEVNULL, PIPE, STDOUT
import sys
from threading import Thread
from typing import Any

PRELOADED = (
    'abdf1_ros.ros.node', 'abdf1_ros.ros.lines', 'abdf1_ros.cli.simulator', 'abdf1_ros.cli.sniff',
    'abdf1_ros.cli.monitor.command', 'abdf1_ros.cli.plc.command')

_MOST_BYTES = 1 << 17  # of a request


class Forked:
    """A child of the server; has what the tests use of ``subprocess.Popen``."""

    def __init__(self, args: Sequence[str], streams: Sequence[int],
                 environment: dict[str, str] | None = None) -> None:
        """
        Run ``-m MODULE ...`` or ``FILE ...`` with these three descriptors as standard streams.

        The descriptors stay open here.
        """
        self.returncode: int | None = None
        self.stdin: Any = None
        self.stdout: Any = None
        self.stderr: Any = None
        server = _server()
        self._status, theirs = os.pipe()
        request = {'args': list(args), 'cwd': os.getcwd(),
                   'environment': dict(os.environ) if environment is None else environment}
        socket.send_fds(server, [json.dumps(request).encode()], [*streams, theirs])
        os.close(theirs)
        self.pid = int(server.recv(100))

    def poll(self) -> int | None:
        """Return the exit status, a negative signal number, or None while it runs."""
        return self._look(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; raise subprocess.TimeoutExpired (s)."""
        status = self._look(timeout)
        if status is None:
            raise subprocess.TimeoutExpired('a forked child', timeout or 0.0)
        return status

    def _look(self, timeout: float | None) -> int | None:
        if self.returncode is None and select.select([self._status], [], [], timeout)[0]:
            self.returncode = int(os.read(self._status, 100))
            os.close(self._status)
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[Any, Any]:
        """Wait for the end; return what is left of its output and of its errors."""
        said: list[Any] = [None, None]

        def read(number: int, stream: Any) -> None:
            with stream:
                said[number] = stream.read()

        if self.stdin is not None:
            self.stdin.close()
        readers = [Thread(target=read, args=(number, stream)) for number, stream in enumerate(
            (self.stdout, self.stderr)) if stream is not None and not stream.closed]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join()
        return said[0], said[1]

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


enabled = False
"""Whether ``start`` forks, as in all tests; what measures starts an interpreter."""


def start(*args: str, stdin: int = PIPE, stdout: int = PIPE, stderr: int = PIPE,
          text: bool = True, env: dict[str, str] | None = None, forks: bool = True) -> Any:
    """Run ``-m MODULE ...`` or ``FILE ...``; the rest as for ``subprocess.Popen``."""
    if not (enabled and forks) or args[0] != '-m' and not args[0].endswith('.py'):
        return subprocess.Popen([sys.executable, *args], text=text, env=env,
                                stdin=stdin, stdout=stdout, stderr=stderr)
    theirs: list[int] = []
    ours: list[Any] = [None, None, None]
    to_close = []
    for number, stream in enumerate((stdin, stdout, stderr)):
        if stream == PIPE:
            ends = os.pipe() if number == 0 else os.pipe()[::-1]
            theirs.append(ends[0])
            mode = ('w' if number == 0 else 'r') + ('' if text else 'b')
            ours[number] = open(ends[1], mode)  # noqa: SIM115
        elif stream == DEVNULL:
            theirs.append(os.open(os.devnull, os.O_RDWR))
        else:
            theirs.append(theirs[1] if stream == STDOUT else stream)
            continue
        to_close.append(theirs[-1])
    child = Forked(args, theirs, env)
    child.stdin, child.stdout, child.stderr = ours
    for descriptor in to_close:
        os.close(descriptor)
    return child


_running: list[socket.socket] = []


def _server() -> socket.socket:
    """Return the connection to the server of this process; it ends when that is closed."""
    if not _running:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        server = subprocess.Popen([sys.executable, '-P', __file__, str(theirs.fileno())],
                                  stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()])
        theirs.close()
        _running.append(ours)

        @atexit.register
        def end() -> None:
            ours.close()
            server.wait()

    return _running[0]


# In the server


def _serve(connection: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Fork a child for every request; return its request and its descriptors in the child."""
    statuses: dict[int, int] = {}
    woken, wakes = os.pipe()
    os.set_blocking(wakes, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the tests
    signal.set_wakeup_fd(wakes)
    while True:
        ready, _, _ = select.select([connection, woken], [], [])
        if woken in ready:
            os.read(woken, 1000)
            _reap(statuses)
        if connection not in ready:
            continue
        data, descriptors, _, _ = socket.recv_fds(connection, _MOST_BYTES, 4)
        if not data:
            os._exit(0)
        child = os.fork()
        if not child:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            for descriptor in (woken, wakes, descriptors.pop(), *statuses.values()):
                os.close(descriptor)
            return json.loads(data), descriptors
        statuses[child] = descriptors.pop()
        for descriptor in descriptors:
            os.close(descriptor)


def _reap(statuses: dict[int, int]) -> None:
    """Tell the exit status of every child that has ended."""
    while statuses:
        child, status = os.waitpid(-1, os.WNOHANG)
        if not child:
            return
        descriptor = statuses.pop(child)
        try:
            os.write(descriptor, b'%d' % os.waitstatus_to_exitcode(status))
        except BrokenPipeError:
            pass
        os.close(descriptor)


def _take_place(request: dict[str, Any], streams: list[int]) -> None:
    """Give this process its own streams, environment, folder and arguments."""
    for number, descriptor in enumerate(streams):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.chdir(request['cwd'])
    os.environ.clear()
    os.environ.update(request['environment'])
    sys.stdin = sys.__stdin__ = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = sys.__stdout__ = open(1, 'w', closefd=False)  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(  # noqa: SIM115
        2, 'w', buffering=1, errors='backslashreplace', closefd=False)


def _run(args: list[str]) -> None:
    if args[0] == '-m':
        sys.path.insert(0, os.getcwd())
        sys.argv = args[1:]
        runpy.run_module(args[1], run_name='__main__', alter_sys=True)
    else:
        sys.path.insert(0, str(Path(args[0]).parent))
        sys.argv = args
        runpy.run_path(args[0], run_name='__main__')


def _main() -> None:
    connection = socket.socket(fileno=int(sys.argv[1]))
    for module in PRELOADED:
        import_module(module)
    gc.collect()
    gc.freeze()
    request, streams = _serve(connection)
    _take_place(request, streams)
    connection.send(b'%d' % os.getpid())
    connection.close()
    _run(request['args'])


if __name__ == '__main__':
    _main()
