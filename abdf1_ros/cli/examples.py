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
The examples as ROS executables.

An example is not a module of the package: each is one file for copying.
"""

from __future__ import annotations

from functools import partial
import runpy

from abdf1_ros.paths import example_file


def _run(name: str) -> None:
    runpy.run_path(str(example_file(f'{name}.py')), run_name='__main__')


command_writer = partial(_run, 'command_writer')
handshake = partial(_run, 'handshake')
interlock_consumer = partial(_run, 'interlock_consumer')
night = partial(_run, 'night')
recorder = partial(_run, 'recorder')
