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
Rehearse a plant: hosts that die, stand still and lose their network, and spares that take over.

Each host is a network namespace with a process of ``lines``. That has some lines of its own, and
the next host has the same lines too: both with ``standby``. Device servers take one client and let
a silent one go after 5 s. Faults strike the owner of a line that ``--seed`` draws. The observer on
a host of its own writes to every line and judges: no value and no command may be older than one
before, no message may have two results, and after each fault one bridge has each line, reads it
and writes to it. A second observer on another host judges the same results. The fault ``apart``
cuts the network of the first observer alone, for longer than DDS keeps it as a participant.

Needs root, for the namespaces; all of it ends with the program. Status 1 when a rule was broken.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
import math
import os
from pathlib import Path
import random
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

_NOTHING_LATE = ' 0 fallbacks by timeout, 0 writes too late,'
_HERE = Path(__file__).resolve().parent
_ROOT = _HERE.parents[2]
_SWITCH = 'switch'  # a link
_PLANT, _OBSERVER, _LISTENER = 'P', 'O', 'L'  # hosts of the device servers and the observers

_IDLE = 5.0
_PERIOD = 0.2  # s, of values and of commands
_FAULT_LASTS = 15.0
_APART_LASTS = 25.0
_LIMIT = 45.0  # s within which all lines have to be well; a killed node is seen for up to 20 s
FAULTS = ('kill', 'stop', 'cut', 'apart')
_PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'

# Wheels have the libraries of the discovery server in folders of their own.
_LIBRARIES = ':'.join(map(str, [Path(sys.prefix, 'lib'), *Path(sys.prefix).glob(
    'lib/python*/site-packages/ros_rmw_fastrtps_cpp.libs')]))

_DATA = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,PLC5,N7:0,16,,,
1,PLC5,N7:0,1,0,Ramp,100
"""
_MAP = """\
Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After
ramp,Read,N7:0,1,PLC5,PERIOD,,
held,Read,N7:4,1,PLC5,PERIOD,,
command,Write,N7:4,1,PLC5,,0,2000
"""


class Network:
    """
    Hosts as namespaces on one switch, which is in a namespace too.

    With ``fault``, the milliseconds and per cent of ``lossy_switch.py``, what hosts send to each
    other can become late and get lost, but not what device servers are sent.
    """

    def __init__(self, hosts: Sequence[str], *, has_server: bool = False,
                 fault: Sequence[float] = (), profile: str = '') -> None:
        self._prefix = f'ab{os.getpid() % 100_000}'
        self._hosts, self._fault = hosts, fault
        self._switch = ExitStack()
        self._lossy: subprocess.Popen[str] | None = None
        self._environment = {
            'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
            'ROS_DOMAIN_ID': '73', 'PYTHONPATH': str(_ROOT)}
        self._variables = dict.fromkeys(_PROFILES, profile)
        if has_server:
            self._environment |= {'ROS_DISCOVERY_SERVER': f'{self.address(_OBSERVER)}:11811',
                                  'ROS_SUPER_CLIENT': 'TRUE'}

    def __enter__(self) -> Network:
        try:
            self._make()
        except BaseException:
            self.__exit__()
            raise
        return self

    def _make(self) -> None:
        _ip('netns', 'add', self._name('sw'))
        if not self._fault:
            _ip('-n', self._name('sw'), 'link', 'add', 'name', _SWITCH, 'type', 'bridge')
            _ip('-n', self._name('sw'), 'link', 'set', _SWITCH, 'up')
        for host in self._hosts:
            _ip('netns', 'add', self._name(host))
            _ip('-n', self._name('sw'), 'link', 'add', host, 'type', 'veth', 'peer', 'name', 'eth',
                'netns', self._name(host))
            _ip('-n', self._name('sw'), 'link', 'set', host, *self._master(), 'up')
            _ip('-n', self._name(host), 'addr', 'add', f'{self.address(host)}/24', 'dev', 'eth')
            for link in ('lo', 'eth'):
                _ip('-n', self._name(host), 'link', 'set', link, 'up')
            # DDS finds others by multicast.
            _ip('-n', self._name(host), 'route', 'add', '224.0.0.0/4', 'dev', 'eth')
        if self._fault:
            self._lossy = self._switch.enter_context(_ending(self.start(
                'sw', Path(os.devnull), sys.executable, str(_HERE / 'lossy_switch.py'), _PLANT,
                *map(str, self._fault), *self._hosts)))

    def _master(self) -> Sequence[str]:
        return () if self._fault else ('master', _SWITCH)

    def __exit__(self, *exception: object) -> None:
        self._switch.close()
        for host in ('sw', *self._hosts):
            subprocess.run(['ip', 'netns', 'del', self._name(host)], check=False,
                           stderr=subprocess.DEVNULL)

    def _name(self, host: str) -> str:
        return f'{self._prefix}{host}'

    def address(self, host: str) -> str:
        """Return the address of a host."""
        return f'10.73.0.{1 + self._hosts.index(host)}'

    def connect(self, host: str, *, is_on: bool) -> None:
        """Plug the cable of a host in, or pull it."""
        _ip('-n', self._name('sw'), 'link', 'set', host, 'up' if is_on else 'down')

    def spoil(self) -> None:
        """Let packets be late and get lost from now on."""
        if self._lossy is not None:
            _say(self._lossy)

    def start(self, host: str, log: Path, *command: str) -> subprocess.Popen[str]:
        """Run a program on a host; its output goes to ``log``, or to us with ``-``."""
        environment = os.environ | self._environment | self._variables | {
            'ROS_LOG_DIR': str(log.parent)}
        if not self._variables[_PROFILES[0]]:
            for variable in _PROFILES:
                environment.pop(variable)
        is_ours = log.name == '-'
        return subprocess.Popen(
            ['ip', 'netns', 'exec', self._name(host), *command],
            env=environment, text=True, stdin=subprocess.PIPE, start_new_session=True,
            stdout=subprocess.PIPE if is_ours else log.open('a'),
            stderr=None if is_ours else subprocess.STDOUT)


def _ip(*words: str) -> None:
    subprocess.run(['ip', *words], check=True)


def _say(process: subprocess.Popen[str]) -> None:
    """Give a process a line."""
    assert process.stdin is not None
    process.stdin.write('\n')
    process.stdin.flush()


class Plant:
    """PLCs, a device server in front of each, and a process of lines on each host."""

    def __init__(self, network: Network, folder: Path, hosts: Sequence[str],
                 servers: Sequence[str], stack: ExitStack, period: float = _PERIOD) -> None:
        self.network, self._folder, self.hosts = network, folder, hosts
        self._stack = stack
        self._bridges: dict[str, subprocess.Popen[str]] = {}
        self.count = len(servers)
        (folder / 'plc.csv').write_text(_DATA, encoding='utf-8')
        (folder / 'map.csv').write_text(
            _MAP.replace('PERIOD', f'{1000 * period:.0f}'), encoding='utf-8')
        for number in range(1, self.count + 1):
            self._run(_PLANT, f'plc{number}', '-m', 'abdf1_ros', 'simulator', '--data',
                      str(folder / 'plc.csv'), '--tcp', f'127.0.0.1:{5000 + number}')
            (folder / f'net{number}.csv').write_text(
                'Station,Com_Port,Baud,Timeout,Cmd_Timeout,NAK_Retries,ENQ_Retries\n'
                f'5,socket://{network.address(_PLANT)}:{4000 + number},19200,200,500,1,1\n',
                encoding='utf-8')
        self._run(_PLANT, 'servers', str(_HERE / 'device_servers.py'), *(
            f'{4000 + number}:{5000 + number}:{server}'
            for number, server in enumerate(servers, 1)))

    def assign(self, host: str, lines: Sequence[int]) -> None:
        """Write the parameters of a host for the lines that it has or takes over."""
        folder = self._folder
        (folder / f'{host}.yaml').write_text(''.join(
            f'/line_{number}/abdf1:\n  ros__parameters:\n    standby: true\n'
            f'    net_file: {folder}/net{number}.csv\n    map_file: {folder}/map.csv\n'
            for number in lines), encoding='utf-8')

    def _run(self, host: str, name: str, *command: str) -> subprocess.Popen[str]:
        return self._stack.enter_context(_ending(self.network.start(
            host, self._folder / f'{name}.log', sys.executable, '-u', *command)))

    def boot(self, host: str) -> None:
        """Start the process of a host."""
        self._bridges[host] = self._run(
            host, host, '-m', 'abdf1_ros', 'lines', '--ros-args', '-r', f'lines:__node:={host}',
            '--params-file', str(self._folder / f'{host}.yaml'))

    def owners(self, line: int) -> list[str]:
        """Return the hosts that have had a line, in order."""
        by_address = {self.network.address(host): host for host in self.hosts}
        said = (self._folder / 'servers.log').read_text(encoding='utf-8').splitlines()
        return [by_address[words[1]] for words in map(str.split, said)
                if words[0] == str(4000 + line)]

    def send(self, host: str, number: signal.Signals) -> None:
        """Send a signal to the process of a host."""
        os.killpg(self._bridges[host].pid, number)


def populate(plant: Plant, lines: int, *, is_alone: bool = False) -> None:
    """Give each host some lines of its own, and those of the next host to take over."""
    for place, host in enumerate(plant.hosts):
        firsts = [place * lines + 1, (place + 1) % len(plant.hosts) * lines + 1]
        if is_alone:
            del firsts[1]
        plant.assign(host, [number for first in firsts for number in range(first, first + lines)])
        plant.boot(host)


@contextmanager
def _ending(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    try:
        yield process
    finally:
        for number in (signal.SIGCONT, signal.SIGKILL):
            try:
                os.killpg(process.pid, number)
            except ProcessLookupError:
                pass
        process.wait()


class Judge:
    """The observer as a process; ``broken`` has what must not be."""

    def __init__(self, network: Network, folder: Path, count: int, stack: ExitStack, *,
                 period: float = _PERIOD, is_quiet: bool = False,
                 only_listens: bool = False) -> None:
        self._is_quiet = is_quiet
        host, words = (_LISTENER, ['listen']) if only_listens else (_OBSERVER, [])
        self._process = stack.enter_context(_ending(network.start(
            host, folder / '-', sys.executable, '-u', str(_HERE / 'observer.py'),
            str(count), str(period), *words)))
        self.broken: list[str] = []
        self.flow: list[tuple[float, int, bool]] = []  # when the values of which line come or end
        self.state, self.since = 'ill: not looked yet', time.monotonic()
        self.flows_since = math.inf
        self.tried = ''
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in map(str.strip, self._process.stdout):
            if line.startswith('BROKEN'):
                self.broken.append(line)
                if not self._is_quiet:
                    print(line, flush=True)
            elif line.startswith(('quiet', 'back')):
                self.flow.append((time.monotonic(), int(line.split()[1]), line[0] == 'b'))
            elif line.startswith(('ill', 'doubled', 'well')):
                self.state, self.since = line, time.monotonic()
                if line.startswith('ill'):
                    self.flows_since = math.inf
                else:
                    self.flows_since = min(self.flows_since, self.since)
            else:
                self.tried = line

    def wait(self, seconds: float) -> float | None:
        """
        Wait until all lines are well for 2 s; None where that takes too long.

        Return after how long all of them were read and written to. A host that has died is seen
        for longer: by default up to 20 s.
        """
        begun = time.monotonic()
        while time.monotonic() - begun < seconds:
            time.sleep(0.05)
            if self.state == 'well' and time.monotonic() - max(self.since, begun) > 2.0:
                return max(0.0, self.flows_since - begun)
        return None

    def count_anew(self) -> None:
        """Let the observer count from now on."""
        _say(self._process)

    def end(self) -> str:
        """End the observer; return what it has judged."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._thread.join(10.0)
        return self.tried


def begin(plant: Plant, fault: str, host: str) -> None:
    """Let a fault begin."""
    if fault == 'cut':
        plant.network.connect(host, is_on=False)
    else:
        plant.send(host, signal.SIGKILL if fault == 'kill' else signal.SIGSTOP)


def undo(plant: Plant, fault: str, host: str) -> None:
    """End a fault; a process that was killed starts again."""
    if fault == 'cut':
        plant.network.connect(host, is_on=True)
    elif fault == 'stop':
        plant.send(host, signal.SIGCONT)
    else:
        plant.boot(host)


def strike(plant: Plant, judge: Judge, fault: str, host: str) -> float | None:
    """Let a fault begin; return the seconds until all lines are well again, None for too long."""
    if fault == 'apart':
        plant.network.connect(_OBSERVER, is_on=False)
        time.sleep(_APART_LASTS)
        plant.network.connect(_OBSERVER, is_on=True)
        return judge.wait(_LIMIT)
    begin(plant, fault, host)
    time.sleep(1.0)  # until it shows
    took = judge.wait(_LIMIT)
    time.sleep(_FAULT_LASTS if fault != 'kill' else 1.0)
    undo(plant, fault, host)
    time.sleep(3.0)
    back = judge.wait(_LIMIT)
    return None if took is None or back is None else took + 1.0  # since it has begun


def parse() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--hosts', type=int, default=3, help='hosts (3)')
    parser.add_argument('--lines', type=int, default=2, help='lines of each host (2)')
    parser.add_argument('--seconds', type=float, default=600.0, help='of faults (600)')
    parser.add_argument('--faults', type=int, help='this many, instead of --seconds')
    parser.add_argument('--only', action='append', choices=FAULTS, help='this fault')
    parser.add_argument('--work', type=Path, help='a folder for files and logs, which stays')
    parser.add_argument('--discovery-server', action='store_true',
                        help='let the hosts find each other by a server, not by multicast')
    parser.add_argument('--lossy', type=float, nargs=2, metavar=('MS', 'PERCENT'),
                        help='delay and loss of all that hosts send to each other, once all '
                             'lines are well')
    parser.add_argument('--alone', action='store_true',
                        help='each line on one host, without a spare; with --faults 0')
    parser.add_argument('--period', type=float, default=_PERIOD,
                        help='s between two values, and two commands, of a line (0.2)')
    parser.add_argument('--profile', default='', help='of Fast DDS, for all programs')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(1 << 31))
    options = parser.parse_args()
    if options.alone and options.faults != 0:
        parser.error('--alone needs --faults 0, as nothing takes lines over')
    return options


class Rehearsal:
    """A plant with its observers; ``failed`` has what was wrong, ``took`` the times of faults."""

    def __init__(self, options: argparse.Namespace, stack: ExitStack) -> None:
        self._options = options
        self._hosts = [f'h{n}' for n in range(1, options.hosts + 1)]
        self.failed: list[str] = []
        self.took: dict[str, list[float]] = {fault: [] for fault in FAULTS}
        self._folder = options.work or Path(stack.enter_context(
            tempfile.TemporaryDirectory(prefix='abdf1_rehearsal')))
        self._folder.mkdir(parents=True, exist_ok=True)
        self._network = stack.enter_context(Network(
            [*self._hosts, _PLANT, _OBSERVER, _LISTENER], has_server=options.discovery_server,
            fault=options.lossy or (), profile=options.profile))
        if options.discovery_server:
            self._serve_discovery(stack)
        self._plant = Plant(
            self._network, self._folder, self._hosts,
            [f'close:{_IDLE}:0'] * options.hosts * options.lines, stack, options.period)
        populate(self._plant, options.lines, is_alone=options.alone)
        self._judge, self._other = (
            Judge(self._network, self._folder, self._plant.count, stack, period=options.period,
                  only_listens=only_listens) for only_listens in (False, True))

    def _serve_discovery(self, stack: ExitStack) -> None:
        stack.enter_context(_ending(self._network.start(
            _OBSERVER, self._folder / 'discovery.log', 'env', f'LD_LIBRARY_PATH={_LIBRARIES}',
            str(Path(sys.executable).with_name('fast-discovery-server')), '-i', '0', '-l',
            self._network.address(_OBSERVER), '-p', '11811')))
        time.sleep(1.0)

    def run(self) -> str:
        """Let all faults happen; return what the observer has counted."""
        options, dice = self._options, random.Random(self._options.seed)
        if self._judge.wait(60.0) is None:
            self.failed.append(f'start: {self._judge.state}')
        self._network.spoil()
        self._judge.count_anew()
        if options.faults == 0 and not self.failed:
            time.sleep(options.seconds)
        faults, end, done = options.only or FAULTS, time.monotonic() + options.seconds, 0
        while not self.failed and (done < options.faults if options.faults is not None
                                   else time.monotonic() < end):
            host = self._plant.owners(dice.randint(1, self._plant.count))[-1]
            self._strike(faults[done % len(faults)], host)
            done += 1
        tried = self._judge.end()
        self._other.end()
        self.failed += self._judge.broken + self._other.broken
        if options.faults == 0 and _NOTHING_LATE not in tried:
            self.failed.append('messages did not arrive in time')
        return tried

    def _strike(self, fault: str, host: str) -> None:
        seconds = strike(self._plant, self._judge, fault, host)
        if seconds is None:
            self.failed.append(f'{fault} of {host}: {self._judge.state}')
            print((self._folder / f'{host}.log').read_text()[-3000:])
        else:
            self.took[fault].append(seconds)
        print(f'{fault} of {host}: ' + (
            'never well again' if seconds is None else f'{seconds:.1f} s'), flush=True)


def main() -> int:
    """Rehearse; return the exit status."""
    options = parse()
    if os.geteuid() or not shutil.which('ip'):
        print('rehearsal: not done, as namespaces need root and ip')
        return 0
    print(f'rehearsal: {options.hosts} hosts of {options.lines} lines, --seed {options.seed}',
          flush=True)
    with ExitStack() as stack:
        rehearsal = Rehearsal(options, stack)
        tried = rehearsal.run()
    for fault, times in rehearsal.took.items():
        if times:
            print(f'{fault:<6}{len(times):>4} times, all lines read and written to after '
                  f'{max(times):.1f} s at most')
    print(tried)
    for text in rehearsal.failed:
        print(f'FAILED {text}')
    return int(bool(rehearsal.failed))


if __name__ == '__main__':
    sys.exit(main())
