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

"""Open a port of any kind."""

from __future__ import annotations

from collections.abc import Callable
from errno import EIO
from importlib import import_module

from abdf1_ros.ports import listening
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.serial_device import open_device
from abdf1_ros.ports.settings import Lack, PortSettings


def name_port(error: OSError, name: str) -> None:
    """Give an error the name of the port, if it has none, and leave its text as it is."""
    if error.errno is None:  # a file name alone would replace the text of the error
        error.errno, error.strerror = EIO, error.strerror or str(error)
    error.filename = error.filename or name


def open_port(settings: PortSettings, tell: Callable[[Lack], None] = lambda lack: None) -> Port:
    """
    Open a port; a serial device is opened exclusively.

    A URL is opened by the module of its scheme, if there is one. ``tell`` is called with options
    that the port does not have, which is not an error. Raises OSError.
    """
    if settings.listens:
        return listening.open_port(settings)
    scheme, separator, _ = settings.name.lower().partition('://')
    if not separator:
        return open_device(settings, tell)
    module = f'abdf1_ros.ports.{scheme}_port'
    try:
        opener = import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module:  # a module that the scheme needs is not installed
            raise
        return open_device(settings, tell)
    port: Port = opener.open_port(settings)
    if settings.rs485:
        tell(Lack('rs485', 'rs485 has no effect: only the device server can switch its '
                  'transmitter'))
    return port
