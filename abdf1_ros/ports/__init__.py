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
Ports, and the thread that runs a link on a port. Only this package waits for bytes.

Begin with ``link_thread``. ``opening`` opens the port that a net file names: a ``serial_device``,
or the port of a device server (``socket_port``, ``rfc2217_port``). ``ownership`` allows one
program for each line. ``wake`` ends a wait from another thread. ``trace`` records bytes, ``tap``
listens, and ``endpoints`` makes ends of lines.

There is no protocol here: a machine of ``df1`` gets the bytes and the time.
"""

from __future__ import annotations

import sys


def cure_of(module: str) -> str:
    """Return how to get a missing module of pyserial."""
    if module == 'serial':
        return '"pip install pyserial", or "make setup" in a checkout'
    other = getattr(sys.modules.get('serial'), '__file__', None) or 'another package'
    return (f'{other} is imported as serial, and is not pyserial. Rename it if it is yours; else '
            '"pip uninstall serial", then "pip install pyserial"')
