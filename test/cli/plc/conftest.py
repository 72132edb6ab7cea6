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

"""What tests of a search for settings have in common."""

from dataclasses import replace

from abdf1_ros.cli.plc.detect import LineSettings
from abdf1_ros.settings.network import Network
import pytest


@pytest.fixture
def half_duplex_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let searches wait for a short time where nobody answers: in full duplex."""
    settled = LineSettings.on

    def brief(settings: LineSettings, line: Network) -> Network:
        network = settled(settings, line)
        return replace(network, timeout=50, cmd_timeout=50) if settings.mode == 'Peer' else network

    monkeypatch.setattr(LineSettings, 'on', brief)
