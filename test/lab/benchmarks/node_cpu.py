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
Measure what part of a core a whole node needs on a line that it keeps busy.

Method. The node runs in a process of its own, with --mappings rows of one word, a hundred to a
block, all to be read as often as the line allows. At the other end of a pseudo-terminal that is
paced as a line of each speed is, a PLC in another process answers at once; 0 baud is a line that
takes no time. After --settle seconds the processor time of all threads of the node is taken for
--seconds, diagnostics included; "transactions" are those that the node tells of itself. The goal
is less than 3 % at 19200 baud.

Run it as "python test/lab/benchmarks/node_cpu.py"; it needs ROS, or the wheels of it.
"""

import argparse
import os
import time

from node_rig import files, plc_of, rows, running_node
from paced_line import answering_pty, BITS
from support.ros import details, find_status, Observer


def measure(baud: int, options: argparse.Namespace) -> tuple[float, float]:
    """Return the part of a core, and the transactions a second."""
    with files(rows(options.mappings, 0), baud or 115200) as (net, table, mappings), \
            answering_pty(plc_of(mappings), BITS / baud if baud else 0.0) as line, \
            Observer() as observer, running_node(net, table, os.ttyname(line)) as node:
        inbox = observer.diagnostics(os.ttyname(line))
        time.sleep(options.settle)
        used, begun = node.used(), time.monotonic()
        time.sleep(options.seconds)
        used, passed = node.used() - used, time.monotonic() - begun
        observer.until(lambda: len(inbox) > options.settle, 'diagnostics of the whole time')
        link = find_status(inbox[-1], 'link')
        return used / passed, float(details(link)['transactions per second'])


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--mappings', type=int, default=500)
    parser.add_argument('--baud', type=int, nargs='+', default=[9600, 19200, 115200, 0])
    parser.add_argument('--settle', type=float, default=3.0)
    parser.add_argument('--seconds', type=float, default=8.0)
    options = parser.parse_args()
    print(f'{options.mappings} mappings; load of the machine {os.getloadavg()[0]:.1f}')
    print('  baud  transactions/s  processor')
    for baud in options.baud:
        processor, transactions = measure(baud, options)
        print(f'{baud:6d}  {transactions:14.1f}  {100 * processor:7.1f} %', flush=True)


if __name__ == '__main__':
    main()
