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

"""Ports that the lines of a process leave to each other."""

from pathlib import Path

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.bridge.port_owners import PortOwners
import pytest


def test_port_has_one_owner_until_he_leaves_it() -> None:
    owners = PortOwners()
    owners.hold('/a', 'socket://server:4001')
    with pytest.raises(ConfigurationError) as error:
        owners.hold('/b', 'SOCKET://Server:4001')
    assert str(error.value) == 'port: SOCKET://Server:4001 is the port of /a'
    owners.hold('/a', 'socket://server:4002')
    owners.hold('/b', 'socket://server:4001')
    owners.hold('/a')
    owners.hold('/b', 'socket://server:4002')


def test_refusal_leaves_a_line_what_it_has() -> None:
    owners = PortOwners()
    owners.hold('/a', '/dev/one')
    owners.hold('/b', '/dev/two')
    with pytest.raises(ConfigurationError):
        owners.hold('/b', '/dev/two', '/dev/one')
    owners.hold('/a', '/dev/one')
    with pytest.raises(ConfigurationError):
        owners.hold('/c', '/dev/two')


def test_device_is_one_port_under_all_its_names(tmp_path: Path) -> None:
    (tmp_path / 'device').touch()
    (tmp_path / 'link').symlink_to('device')
    owners = PortOwners()
    owners.hold('/a', str(tmp_path / 'device'))
    with pytest.raises(ConfigurationError, match=f'{tmp_path}/link is the port of /a'):
        owners.hold('/b', str(tmp_path / 'link'))


def test_place_is_that_of_one_line() -> None:
    owners = PortOwners()
    owners.hold('/a', '/dev/one', 'pty:/tmp/hmi', 'tcp:4501', '/dev/ttyS9?baud=9600')
    for place in 'pty:/tmp//hmi', 'tcp:127.0.0.1:4501':
        with pytest.raises(ConfigurationError, match=f'{place} is the place of /a'):
            owners.hold('/b', '/dev/two', place)
    for names in ('/dev/two', '/dev/one?check=BCC'), ('/dev/ttyS9',):
        with pytest.raises(ConfigurationError, match='is the port of /a'):
            owners.hold('/b', *names)
    owners.hold('/b', '/dev/two', 'pty:/tmp/hmi_2', 'tcp:4502')
