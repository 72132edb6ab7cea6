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

"""The help of ``monitor`` and ``demo``, and the help of a program with ROS without ROS."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
import math

from abdf1_ros.cli.terminal import command_parser, number_option, seconds_option
from abdf1_ros.ros.process import usage

_MONITOR = """\
Show the state of a running bridge, or of all bridges, from their topics alone.

First comes the verdict. Then follows each topic with its age, its part of the line's time, a curve
of the last seconds, and its value. Then follow faults, writes, link, stations and counters. On a
terminal the picture is renewed in place; arrows, pages and the keys of its last line move it.
Without a terminal, or with --once, plain text is printed.

With --all there is a line for each bridge, the worst first; Return shows the marked bridge, q goes
back.

A value is fresh, or STALE if it is older than its topic promises. Topics that are published on
change, or when a PLC writes to us, promise nothing: their value may have any age. A blank in a
curve is a time without a fresh value.
"""

_MONITOR_STATUSES = """\
exit status: 0 at the end, 1 if the node is not found within --wait, 2 for bad options

examples:
  monitor
  monitor --node /cell/line_1
  monitor --all
  monitor --all --once | grep -v ' OK '
  monitor --once | grep -E 'STALE|no value'
  monitor --seconds 60 --period 10 > state.txt
"""

_DEMO = """\
The demo: simulated PLCs, the node as a process, and the view of a robot cell, step by step.

The demo needs no hardware. Everything stays on this machine: discovery is limited to localhost.
Without ROS_DOMAIN_ID the demo uses its own domain.
"""

_DEMO_STATUSES = """\
exit status: 0 when all was seen as it should be, or after Ctrl-C; 1 otherwise

examples:
  demo
  demo --seconds 0
  demo --peer
"""


def _monitor() -> argparse.ArgumentParser:
    parser = command_parser('monitor', _MONITOR, _MONITOR_STATUSES)
    parser.add_argument('--node', default='/abdf1',
                        help='name of the bridge with its namespace (default: %(default)s)')
    parser.add_argument('--all', action='store_true', help='show all bridges, each on one line')
    parser.add_argument('--once', action='store_true', help='print one picture and end')
    parser.add_argument('--seconds', type=seconds_option, default=math.inf,
                        help='end this number of seconds after the node is found; with '
                             '--all after the start')
    parser.add_argument('--period', type=seconds_option, default=1.0,
                        help='seconds between two printed pictures (default: %(default)g)')
    parser.add_argument('--wait', type=seconds_option, default=10.0,
                        help='seconds to look for the node at the start (default: %(default)g)')
    return parser


def _demo() -> argparse.ArgumentParser:
    parser = command_parser('demo', _DEMO, _DEMO_STATUSES)
    parser.add_argument('--seconds', default=30.0,
                        type=number_option('a number of seconds from 0', 0),
                        help='how long to run; 0 stays until Ctrl-C (default: %(default)g)')
    parser.add_argument('--peer', action='store_true',
                        help='show a full-duplex line, on which the PLC writes by itself')
    return parser


_PARSERS: dict[str, Callable[[], argparse.ArgumentParser]] = {
    'monitor': _monitor, 'demo': _demo,
    **{name: partial(usage.parser_of, name) for name in ('node', 'lines')}}


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of a program with ROS."""
    return _PARSERS[name]()


def show_help(name: str, words: Sequence[str]) -> None:
    """End the process with the help or the version of a program, if ``words`` ask for it."""
    if name in _PARSERS and {*words} & {'-h', '--help', '--version'}:
        parser_of(name).parse_known_args(words)
