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

"""The one way to open a port: devices, and a module for each scheme of URLs."""

from collections.abc import Iterator
import sys
from types import ModuleType

from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.opening import name_port, open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings import network
import pytest


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[PortSettings]]:
    """Add a scheme: its module, and its name in the settings; yield what it is asked to open."""
    asked: list[PortSettings] = []
    module = ModuleType('abdf1_ros.ports.pigeon_port')
    module.open_port = lambda settings: (  # type: ignore[attr-defined]
        asked.append(settings), DescriptorPort(0, lambda: None))[1]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(network, 'DEVICE_SERVERS', (*network.DEVICE_SERVERS, 'pigeon'))
    yield asked


def test_scheme_is_a_file_and_a_word(made_up: list[PortSettings]) -> None:
    url = 'pigeon://loft:7'
    checked = network.make_network({'com_port': (url, 'test')})
    settings = PortSettings.of(checked)
    open_port(settings).close()
    assert made_up == [settings]


@pytest.mark.parametrize('name', ['spy://loft:7', 'pigeon://loft:7'])
def test_scheme_that_nobody_knows_is_no_port(name: str) -> None:
    with pytest.raises(ConfigurationError):
        network.make_network({'com_port': (name, 'test')})
    with pytest.raises(OSError, match='No such file'):
        open_port(PortSettings(name))


@pytest.mark.parametrize(('error', 'text'), [
    (OSError('the device server refuses RFC 2217'),
     "[Errno 5] the device server refuses RFC 2217: 'rfc2217://loft:7'"),
    (OSError(2, 'No such file'), "[Errno 2] No such file: 'rfc2217://loft:7'")])
def test_error_that_gets_the_name_of_the_port_keeps_its_text(error: OSError, text: str) -> None:
    name_port(error, 'rfc2217://loft:7')
    assert str(error) == text


def test_scheme_that_lacks_what_it_needs_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, 'abdf1_ros.ports.rfc2217_port', raising=False)
    monkeypatch.setitem(sys.modules, 'struct', None)
    with pytest.raises(ModuleNotFoundError, match='struct'):
        open_port(PortSettings('rfc2217://host:1'))
