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

"""Fuzz target: the loader of the net CSV."""

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import FIELDS, load_network
from fuzz.files import path_of


def one_input(data: bytes) -> None:
    """Check that a file becomes a network within its ranges, or is refused in visible lines."""
    try:
        network = load_network(path_of(data))
    except ConfigurationError as error:
        assert error.problems
        assert all(str(problem).isprintable() for problem in error.problems)
        return
    for name, cell in network.cells().items():
        value = getattr(network, name)
        assert type(value) is type(FIELDS[name].default)
        assert FIELDS[name].kind.read(str(cell)) == value
    assert network.timing.char_time > 0
    assert network.port
