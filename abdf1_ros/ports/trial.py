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

"""Find out whether a port can be opened, before a line closes its present port for it."""

from __future__ import annotations

from collections.abc import Callable
import socket
import threading
from urllib.parse import urlsplit

from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings

# If a name server or a driver takes longer (s), this does not count as a refusal. The limit keeps
# heartbeats going: by rule 3 (c) the thread that asks may wait for 1 s.
_PATIENCE = 0.5


def why_not(settings: PortSettings, patience: float = _PATIENCE) -> str:
    """
    Return why a port cannot be opened, or an empty text.

    The text is empty if the port can be opened, or if this is not known in time. A serial device
    is opened and closed again. For a URL, only the name of the host is resolved: a connection
    could end the connection of another client of the device server.
    """
    attempt = _look_up if '://' in settings.name else try_port
    reasons: list[str] = []
    thread = threading.Thread(target=_note, args=(attempt, settings, reasons), daemon=True)
    thread.start()
    thread.join(patience)
    return ''.join(reasons)


def _note(attempt: Callable[[PortSettings], None], settings: PortSettings,
          reasons: list[str]) -> None:
    try:
        attempt(settings)
    except OSError as error:
        reasons.append(error.strerror or str(error))


def try_port(settings: PortSettings) -> None:
    open_port(settings).close()


def _look_up(settings: PortSettings) -> None:
    try:
        socket.getaddrinfo(urlsplit(settings.name).hostname, None)
    except socket.gaierror as error:
        if error.errno == socket.EAI_NONAME:  # other errors may be temporary
            raise
