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

"""The files of Fast DDS in /dev/shm: removed by logind, for example."""

from collections.abc import Iterable
import os
from pathlib import Path
import subprocess
import sys

from abdf1_ros.ros.diagnostics.dds import DdsWatch, lost_locks
from support.ros import PROFILES_VARIABLE

# A node that uses shared memory, as at the home of a user. It removes its own files.
NODE = """
import os
from abdf1_ros.ros.diagnostics.dds import DdsWatch
import rclpy
rclpy.init()
node = rclpy.create_node('lonely')
files = DdsWatch()
print(repr(files.look(1.0) + files.look(20.0)))
for name in os.listdir('/proc/self/fd'):
    try:
        path = os.readlink(f'/proc/self/fd/{name}')
    except OSError:
        continue
    if path.startswith('/dev/shm/') and path.endswith('_el'):
        os.remove(path)
        os.remove(path.removesuffix('_el'))
print(repr(files.look(40.0)))
print(files.look(60.0))
"""


def test_node_notices_that_its_files_are_gone() -> None:
    environment = os.environ | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    del environment[PROFILES_VARIABLE]
    done = subprocess.run([sys.executable, '-c', NODE], env=environment, capture_output=True,
                          text=True, check=True, timeout=60)
    before, once, twice = done.stdout.splitlines()
    assert (before, once) == ("''", "''")
    assert twice.startswith('the files of Fast DDS in /dev/shm are gone')


def test_lock_of_a_removed_file_counts_and_no_other() -> None:
    lock = Path(f'/dev/shm/fastrtps_test{os.getpid()}_el')
    with lock.open('w'):
        assert lost_locks() == frozenset()
        lock.unlink()
        assert lost_locks() == {f'{lock} (deleted)'}
    assert lost_locks() == frozenset()


def looks(*lost: Iterable[str]) -> list[bool]:
    """Return at which looks the files count as gone, if these locks are lost one after another."""
    found = iter(map(frozenset, lost))
    files = DdsWatch(lambda: next(found))
    return [bool(files.look(20.0 * number)) for number in range(1, len(lost) + 1)]


def test_port_that_fast_dds_makes_anew_is_no_fault() -> None:
    assert looks('', 'a', '', 'b', 'c', 'cd', 'cd', '') == [False] * 5 + [True, True, False]


def test_looks_are_five_seconds_apart() -> None:
    times: list[float] = []
    files = DdsWatch(lambda: frozenset(str(times.append(now))))
    for now in (1.0, 3.0, 5.9, 6.0, 7.0):
        files.look(now)
    assert times == [1.0, 6.0]
