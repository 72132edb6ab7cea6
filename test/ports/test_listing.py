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

"""Serial ports as the operating system has them."""

from pathlib import Path
from types import SimpleNamespace

from abdf1_ros.ports import listing
import pytest


def _port(device: str, description: str = 'n/a', hwid: str = 'n/a') -> SimpleNamespace:
    return SimpleNamespace(device=device, name=Path(device).name, description=description,
                           hwid=hwid)


def test_adapters_come_first_with_a_name_that_stays(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / 'ttyUSB0'
    device.touch()
    (tmp_path / 'by-id').mkdir()
    link = tmp_path / 'by-id' / 'usb-adapter'
    link.symlink_to(device)
    monkeypatch.setattr(listing, 'BY_ID', tmp_path / 'by-id')
    monkeypatch.setattr(listing.list_ports, 'comports', lambda: [
        _port('/dev/ttyAMA0', 'ttyAMA0', 'PNP'), _port('/dev/ttyS31'),
        _port(str(device), 'FT232R USB UART', 'USB VID:PID=0403:6001')])
    first, second = listing.serial_ports()
    assert (first.stable, first.adapter, first.may_open) == (str(link), 'FT232R USB UART', True)
    assert (second.device, second.adapter, second.may_open) == ('/dev/ttyAMA0', '', False)
