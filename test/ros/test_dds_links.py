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

"""A process that began before its host had a network: Fast DDS does not look for one again."""

from pathlib import Path
import subprocess
import sys

from abdf1_ros.ros.diagnostics.dds import BEGAN_EARLY, DdsWatch
import pytest
from test_rehearsal import NEEDS_NAMESPACES

UNSET = ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY')
PROGRAM = """
import subprocess
from abdf1_ros.ros.diagnostics.dds import has_network
def ip(*words): subprocess.run(['ip', *words], check=True)
print(has_network())
ip('link', 'set', 'lo', 'up')
ip('link', 'add', 'here', 'type', 'veth', 'peer', 'name', 'there')
ip('addr', 'add', '10.74.0.1/24', 'dev', 'here')
print(has_network())
ip('link', 'set', 'here', 'up')
print(has_network())  # the other end is down: no carrier
ip('link', 'set', 'there', 'up')
print(has_network())
ip('addr', 'flush', 'dev', 'here')
print(has_network())
"""


@pytest.fixture(autouse=True)
def _reaches_other_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in UNSET:
        monkeypatch.delenv(name, raising=False)


def looks(*found: bool) -> list[str]:
    """Return what looks say, 6 s apart, that find a network or none; the first is the start."""
    finds = iter(found)
    links = DdsWatch(has_links=lambda: next(finds))
    return [links.look(6.0 * number) for number in range(1, len(found))]


def test_network_that_comes_after_the_start_is_told_of_from_then_on() -> None:
    assert looks(False, False, True) == ['', BEGAN_EARLY]
    links = DdsWatch(has_links=iter([False, True, False]).__next__)
    assert [links.look(0.0), links.look(2.0), links.look(60.0)] == [BEGAN_EARLY] * 3


def test_network_that_was_there_at_the_start_may_come_and_go() -> None:
    links = DdsWatch(has_links=iter([True]).__next__)
    assert [links.look(1.0), links.look(60.0)] == ['', '']


@pytest.mark.parametrize(('name', 'value'), [
    ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST'), ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'off'),
    ('ROS_LOCALHOST_ONLY', '1')])
def test_process_for_this_host_needs_no_network(
        monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    links = DdsWatch(has_links=iter([False, True]).__next__)
    assert links.look(1.0) == ''


@NEEDS_NAMESPACES
def test_network_is_a_link_that_is_up_with_a_carrier_and_an_address() -> None:
    done = subprocess.run(['unshare', '--net', sys.executable, '-c', PROGRAM], check=False,
                          capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.stdout.split() == ['False', 'False', 'False', 'True', 'False'], done.stderr
