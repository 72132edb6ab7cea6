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
Count the transactions that a program needs for 40 scattered tags: one by one, and by the plan.

Method. A client reads 40 addresses of an SLC, spread over the files of a machine as panels have
them, on a simulated half-duplex line. First each has a call of its own, then one ``read_many``
takes all. "line" is the time of their characters at 9600 and 19200 baud, after the model of the
planner; the answers of a PLC come on top of it, per transaction.

Run it as "python test/lab/benchmarks/client_reads.py"; it needs nothing but the package.
"""

from collections.abc import Sequence
from pathlib import Path
import sys
import tempfile
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.client import Client  # noqa: E402
from abdf1_ros.plan.forecast import line_model  # noqa: E402
from abdf1_ros.plan.planner import Block, Planner  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from support.driver_bench import simulated_plc  # noqa: E402
from support.mappings import make_mapping  # noqa: E402
from support.plc_line import plc_line  # noqa: E402

FILES = (('N7:0', 250), ('B3:0', 20), ('F8:0', 40), ('T4:0', 90), ('C5:0', 30), ('N10:0', 100))
TAGS = (
    *(f'N7:{word}' for word in (0, 1, 4, 9, 10, 25, 26, 60, 61, 120, 130, 200)),
    *(f'B3:{word}/{bit}' for word, bit in ((0, 0), (0, 5), (1, 3), (4, 15), (9, 0), (19, 7))),
    *(f'F8:{number}' for number in (0, 1, 7, 19)),
    *(f'T4:{timer}.ACC' for timer in (0, 3, 9, 20)), 'T4:5/DN', 'T4:6.PRE',
    *(f'C5:{counter}.ACC' for counter in (0, 1, 5, 9)),
    *(f'N10:{word}' for word in (0, 2, 3, 40, 41, 55, 90, 99)))


def main() -> None:
    """Print a table."""
    slc = simulated_plc(1, 'SLC', time.monotonic, *FILES)
    with tempfile.TemporaryDirectory() as folder, plc_line(Path(folder, 'line'), slc) as port, \
            Client(port, plc_type='SLC', duplex='half', baud=115200) as plc:
        one_by_one = {tag: plc.read(tag) for tag in TAGS}
        alone = plc.counters.commands_sent
        assert plc.read_many(TAGS) == one_by_one
        planned = plc.counters.commands_sent - alone
    print(f'{len(TAGS)} tags     transactions  line at 9600  at 19200 baud')
    for name, count, groups in (('one by one', alone, [[tag] for tag in TAGS]),
                                ('planned', planned, [list(TAGS)])):
        seconds = [sum(block.line_time for group in groups for block in blocks(baud, group))
                   for baud in (9600, 19200)]
        print(f'{name:12}{count:12}{seconds[0]:12.2f} s{seconds[1]:12.2f} s')


def blocks(baud: int, group: Sequence[str]) -> list[Block]:
    """Return the blocks of some tags."""
    rows = [make_mapping(tag, plc='SLC', item=item) for item, tag in enumerate(group, 1)]
    return Planner(line_model(Network(baud=baud)), 1.0).plan(rows)


if __name__ == '__main__':
    main()
