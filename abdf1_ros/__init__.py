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
Read and write Allen-Bradley PLCs over their DF1 serial port.

PLC-5, SLC 500, MicroLogix, PLC-2 and PLC-3; full duplex, half duplex and radio modem; Linux.

A program without ROS uses ``Client``. It opens the port, blocks until the PLC has replied, and
repeats messages that get lost on the line:

    from abdf1_ros import Client

    with Client('/dev/ttyUSB0', plc_type='SLC', station=1) as plc:
        speeds = plc.read('N7:0', 10)           # a list of ten int16
        plc.write('N7:0', [speeds[0] + 1])      # returns when the PLC has confirmed it
        plc.write('B3:0/1', True)
        print(plc.identify())

Its errors can be imported from here, too. ``Client.from_files`` reads the two CSV files of the
node; its client reads and writes by tag. For a machine use the node (``abdf1 node``, or ``ros2 run
abdf1_ros node``). The node makes topics of the rows of a map, polls the PLCs, and writes
heartbeats and fallback values.

Importing this package imports no other module: a name is looked up when it is used. Only
``abdf1_ros.ros`` and a few commands need ROS.

The rooms of the package, from the wire up. A room imports only from rooms above it in this list;
``driver``, ``ports`` and ``diagnosis`` also import from ``sniffer``. Each ``__init__`` describes
its room:

- ``df1``: the link. Its input is bytes and time, its output bytes and a deadline
- ``pccc``: commands, addresses, values, and a folder for each family of PLCs
- ``cip``: EtherNet/IP around a command, for programs that speak Ethernet alone
- ``diagnosis``: from what a line has shown to one cause and one next step
- ``settings``: both CSV files, every fault with its place
- ``plan``: which words are read together, and the times of the line
- ``driver``: which job has the line next, and its result
- ``ports``: serial ports, and the thread that runs a link on one
- ``share``: other programs on the same port
- ``simulator``, ``sniffer``, ``conform``: simulated PLCs, recorded bytes, cases of the manual
- ``client``: the library; ``ros``: the node; ``cli``: the commands
- ``testing``: fixtures of pytest
"""

from __future__ import annotations

TYPE_CHECKING = False  # mypy treats it as true; the import of the module typing is slow
if TYPE_CHECKING:
    from abdf1_ros.client import Client  # noqa: I300
    from abdf1_ros.errors import Abdf1Error, FormatError, LinkError, PortLost, RemoteError
    from abdf1_ros.problems import ConfigurationError
    from abdf1_ros.readings import Reading
    from abdf1_ros.tagged_client import TaggedClient

    __version__: str

__all__ = ['Abdf1Error', 'Client', 'ConfigurationError', 'FormatError', 'LinkError', 'PortLost',
           'Reading', 'RemoteError', 'TaggedClient', '__version__']

# The modules of these names; all other names are in ``errors``.
_HOMES = {'Client': 'client', 'ConfigurationError': 'problems', 'Reading': 'readings',
          'TaggedClient': 'tagged_client'}


def __getattr__(name: str) -> object:
    """Return a class, which imports pyserial, or the version: each only when it is used."""
    if name == '__version__':
        from abdf1_ros.paths import package_version
        return package_version()
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from importlib import import_module
    return getattr(import_module(f'{__name__}.{_HOMES.get(name, "errors")}'), name)


def __dir__() -> list[str]:
    """Return all names of the package, also names that have not been looked up yet."""
    return sorted({*globals(), *__all__})
