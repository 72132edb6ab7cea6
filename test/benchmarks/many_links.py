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
Measure the links of many lines in one process: a thread a line, or one thread for all.

Method. The lines are those of many_lines.py, with their PLCs in another process; here are drivers
without ROS, which drop what they read. "threads" runs a LinkThread for each line, as "node" and
"lines" do; "epoll" runs all machines in one thread, which waits for all ports at once. Processor
time is that of all threads as part of one core, also for each transaction; "ACK" is the time from
the end of a reply to its ACK, for 50, 99 and 99.9 % of them, "switches" are context switches a
transaction.

Run it as "python test/benchmarks/many_links.py".
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
from resource import getrusage, RUSAGE_SELF
import select
import sys
import threading
import time

from abdf1_ros.df1.machine import Machine
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.links import DriverSettings
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import load_network
from many_lines import Rig, rigged
from paced_line import Listener


def machines(rig: Rig) -> list[Machine]:
    """Return the machine of each line."""
    made = []
    for number in range(len(rig.ports)):
        net, table = rig.files(number)
        mappings, _ = load_mappings(str(table))
        made.append(Driver(
            load_network(str(net)), mappings, DriverSettings(), Listener()).machine)
    return made


@contextmanager
def with_threads(rig: Rig) -> Iterator[None]:
    """Run a thread a line."""
    links = [LinkThread(machine, _opener(name))
             for machine, name in zip(machines(rig), rig.ports, strict=True)]
    for link in links:
        link.start()
    yield
    for link in links:
        link.ask_to_stop()
    for link in links:
        link.stop()


def _opener(name: str) -> Callable[[], Port]:
    return lambda: open_port(PortSettings(name, 19200))


@contextmanager
def with_epoll(rig: Rig) -> Iterator[None]:
    """Run one thread for all lines."""
    ended = threading.Event()
    thread = threading.Thread(target=_serve, args=(rig.ports, machines(rig), ended))
    thread.start()
    yield
    ended.set()
    thread.join()


def _serve(names: Sequence[str], all_machines: Sequence[Machine], ended: threading.Event) -> None:
    poll = select.epoll()
    lines: dict[int, tuple[Machine, int]] = {}
    for name, machine in zip(names, all_machines, strict=True):
        descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        poll.register(descriptor, select.EPOLLIN)
        lines[descriptor] = machine, descriptor
        machine.send_at_once = _writer(descriptor)
        machine.start(time.monotonic())
        os.write(descriptor, machine.data_to_send())
    while not ended.is_set():
        now = time.monotonic()
        calls = [machine.next_call for machine, _ in lines.values()]
        next_call = min((call for call in calls if call is not None), default=now + 0.1)
        ready = poll.poll(min(max(0.0, next_call - now), 0.1))
        now = time.monotonic()
        for descriptor, _ in ready:
            machine = lines[descriptor][0]
            data = os.read(descriptor, 4096)
            machine.handle_timeout(now)
            machine.receive_data(data, now)
            if answer := machine.data_to_send():
                os.write(descriptor, answer)
        for machine, descriptor in lines.values():
            if machine.next_call is not None and machine.next_call <= now:
                machine.handle_timeout(now)
                if answer := machine.data_to_send():
                    os.write(descriptor, answer)
    for descriptor in lines:
        os.close(descriptor)


def _writer(descriptor: int) -> Callable[[bytes], None]:
    def write(data: bytes) -> None:
        os.write(descriptor, data)
    return write


def _used() -> tuple[float, int]:
    usage = getrusage(RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime, usage.ru_nvcsw + usage.ru_nivcsw


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--lines', type=int, nargs='+', default=[1, 10, 30, 100])
    parser.add_argument('--baud', type=int, default=19200)
    parser.add_argument('--seconds', type=float, default=8.0)
    parser.add_argument('--switch-interval', type=float, default=0.005, metavar='S')
    options = parser.parse_args()
    sys.setswitchinterval(options.switch_interval)
    print(f'load of the machine before {os.getloadavg()[0]:.1f}')
    print('way      lines  trans/s  processor  us a trans.  switches  ACK 50 / 99 / 99.9 %')
    for count in options.lines:
        for name, way in (('threads', with_threads), ('epoll', with_epoll)):
            with rigged(count, options.baud) as rig, way(rig):
                time.sleep(2.0)
                rig.pipe.send('reset')
                used, switches = _used()
                begun = time.monotonic()
                time.sleep(options.seconds)
                rig.pipe.send('tell')
                told = rig.pipe.recv()
                passed = time.monotonic() - begun
                used, switches = (after - before for after, before in zip(
                    _used(), (used, switches), strict=True))
            replies = max(1, sum(number for _, number in told))
            acks = sorted(latency for latencies, _ in told for latency in latencies)
            text = ' / '.join(f'{acks[int(share * (len(acks) - 1))] * 1000:.2f}'
                              for share in (0.5, 0.99, 0.999) if acks)
            print(f'{name:8}{count:6d} {replies / passed:8.0f} {used / passed:9.1%} '
                  f'{used / replies * 1e6:12.0f} {switches / replies:9.1f}  {text} ms', flush=True)


if __name__ == '__main__':
    main()
