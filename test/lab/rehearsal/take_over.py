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
Measure how a spare takes lines over: each kind of device server, with each fault.

Two hosts have the same lines with ``standby``, one line for each kind of server and timer. The
first host takes all lines, then a fault strikes it for 30 s: its process is killed or stopped, or
its network is cut. The table, in Markdown, says when the values of a line came back, from the
spare or after the fault from whom, and how often the line went from host to host afterwards. A
value or command that is older than one before is counted: it must not be, but where a server gives
the line to two.

Needs root, for namespaces. All takes 8 minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from contextlib import ExitStack
from itertools import pairwise, product
import os
from pathlib import Path
import shutil
import sys
import tempfile
import time

import run

_HOSTS = 'A', 'B'
_PLACES = 'P', 'O'
# Hosts that fight for their lines make many topics, and disturb their neighbours: a plant each.
_ONE_CLIENT = {
    'refuse': 'refused', 'close': 'accepted and closed', 'queue': 'queued, its bytes are kept',
    'discard': 'accepted, its bytes are discarded'}
_SEVERAL = {'newest': 'throws the first one out', 'share': 'served as well'}
_KINDS = _ONE_CLIENT | _SEVERAL
_TIMERS = {'none': '0:0', 'inactivity time 5 s': '5:0', 'TCP alive check 5 s': '0:5'}
_LASTS, _AFTERWARDS = 30.0, 20.0


def measure(fault: str, kinds: Iterable[str], folder: Path, profile: str) -> None:
    """Let a fault strike the first host, and print a row for each line."""
    cells = [(kind, timer) for kind in kinds for timer in _TIMERS]
    with ExitStack() as stack:
        network = stack.enter_context(run.Network([*_HOSTS, *_PLACES], profile=profile))
        plant = run.Plant(network, folder, _HOSTS,
                          [f'{kind}:{_TIMERS[timer]}' for kind, timer in cells], stack)
        for host in _HOSTS:
            plant.assign(host, range(1, plant.count + 1))
        plant.boot(_HOSTS[0])
        judge = run.Judge(network, folder, plant.count, stack, is_quiet=True)
        if judge.wait(60.0) is None:
            sys.exit(f'take_over: the first host does not get all lines: {judge.state}')
        plant.boot(_HOSTS[1])
        while f'{plant.count} of {plant.count} lines run' not in (folder / 'B.log').read_text():
            time.sleep(0.5)
        time.sleep(5.0)
        begun = time.monotonic()
        run.begin(plant, fault, _HOSTS[0])
        time.sleep(_LASTS)
        ended = time.monotonic()
        before = [len(plant.owners(line)) for line in range(1, plant.count + 1)]
        run.undo(plant, fault, _HOSTS[0])
        time.sleep(_AFTERWARDS)
        for line, (kind, timer) in enumerate(cells, 1):
            flow = [(when, comes) for when, number, comes in judge.flow if number == line]
            owners = plant.owners(line)
            later = pairwise(owners[before[line - 1] - 1:])
            swaps = sum(one != other for one, other in later)
            broken = sum(f'/line_{line}/' in text for text in judge.broken)
            print(f'| {_KINDS[kind]} | {timer} | {fault} | {_gap(flow, begun, ended)} | '
                  f'{owners[-1]} | {swaps} | {broken} |', flush=True)


def _gap(flow: list[tuple[float, bool]], begun: float, ended: float) -> str:
    """Return after how long the values of a line came again, after its first gap in the fault."""
    quiet = next((when for when, comes in flow if begun < when < ended and not comes), None)
    if quiet is None:
        return 'less than 0.7 s'
    back = next((when for when, comes in flow if when > quiet and comes), None)
    if back is None:
        return 'never'
    after_end = f'the end of the fault + {back - ended:.1f} s'
    return f'{back - begun:.1f} s' if back < ended else after_end


def main() -> None:
    """Measure all faults, or those that are named."""
    if os.geteuid() or not shutil.which('ip'):
        print('take_over: not done, as namespaces need root and ip')
        return
    print('| second client | timer | fault of the first host | values are back after | '
          'then on host | swaps after the fault | broken |\n' + 7 * '| --- ' + '|', flush=True)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('faults', nargs='*', default=[*run.FAULTS], help='kill, stop, cut (all)')
    parser.add_argument('--only', action='append', choices=_KINDS, help='this kind of server')
    parser.add_argument('--profile', default='', help='of Fast DDS, for all programs')
    parser.add_argument('--work', type=Path, help='a folder for files and logs, which stays')
    options = parser.parse_args()
    chosen = [[kind for kind in group if kind in (options.only or _KINDS)] for group in (
        _ONE_CLIENT, _SEVERAL)]
    for fault, kinds in product(options.faults, filter(None, chosen)):
        with ExitStack() as stack:
            folder = Path(stack.enter_context(
                tempfile.TemporaryDirectory(prefix='abdf1_take_over')))
            if options.work:
                folder = options.work / f'{fault}_{kinds[0]}'
                folder.mkdir(parents=True, exist_ok=True)
            measure(fault, kinds, folder, options.profile)


if __name__ == '__main__':
    main()
