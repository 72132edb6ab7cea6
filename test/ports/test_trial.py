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

"""Ports that are tried before a line gives up its own."""

import os
import pty
import socket
import threading

from abdf1_ros.ports import trial
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trial import why_not
import pytest


def test_device_that_opens_is_left_free() -> None:
    master, slave = pty.openpty()
    settings = PortSettings(os.ttyname(slave))
    assert why_not(settings, 10.0) == ''
    port = open_port(settings)
    assert why_not(settings, 10.0) == 'another program has it open'
    port.close()
    os.close(slave)
    os.close(master)


def test_device_that_is_not_there_is_a_reason() -> None:
    assert why_not(PortSettings('/dev/ttyS_none'), 10.0) == 'No such file or directory'


@pytest.mark.parametrize(('error', 'expected'), [
    (socket.gaierror(socket.EAI_NONAME, 'Name or service not known'), 'Name or service not known'),
    (socket.gaierror(socket.EAI_AGAIN, 'Temporary failure in name resolution'), '')])
def test_host_is_looked_up_and_not_connected_to(
        monkeypatch: pytest.MonkeyPatch, error: OSError, expected: str) -> None:
    asked = []

    def look_up(*arguments: object) -> None:
        asked.append(arguments)
        raise error

    monkeypatch.setattr(trial.socket, 'getaddrinfo', look_up)
    monkeypatch.setattr(trial.socket.socket, 'connect', lambda *arguments: pytest.fail('connects'))
    assert why_not(PortSettings('socket://plc-gate:4001'), 10.0) == expected
    assert asked == [('plc-gate', None)]


def test_port_that_does_not_say_in_time_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()
    monkeypatch.setattr(trial, 'try_port', lambda settings: ended.wait())
    assert why_not(PortSettings('/dev/ttyS0'), 0.0) == ''
    ended.set()
