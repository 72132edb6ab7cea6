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
List serial ports and adapters.

  plc ports
"""

from __future__ import annotations

import argparse
import errno

from abdf1_ros.cli.plc.session import complain
from abdf1_ros.cli.terminal import ADVICE, EXIT_FAILED, table
from abdf1_ros.ports.listing import serial_ports


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add no argument."""


def run(options: argparse.Namespace) -> int:
    """Print the ports of this machine."""
    ports = serial_ports()
    rows = [(port.device, port.adapter, port.stable,
             '' if port.may_open else 'no access for this user') for port in ports]
    if not ports:
        complain('this machine has no serial port: is the adapter plugged in? In a virtual '
                 'machine or container the host must pass it through')
        return EXIT_FAILED
    print(table(('port', 'adapter', 'stable name', ''), rows))
    if not all(port.may_open for port in ports):
        complain(ADVICE[errno.EACCES])
    return 0
