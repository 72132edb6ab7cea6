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

"""Fuzz target: the loader of the map CSV, and all that is made of its rows."""

import re

from abdf1_ros.plan.usable_rows import line_problems
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from fuzz.files import path_of
from support.driver_bench import DriverBench

# What rcl takes as a relative topic name.
_NAME = re.compile(r'[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


def one_input(data: bytes) -> None:
    """Check that a driver can be made of the good rows, and that the bad ones are told."""
    try:
        mappings, problems = load_mappings(path_of(data))
    except ConfigurationError as error:
        problems = error.problems
        assert problems
        mappings = []
    bad = line_problems(mappings, Network())
    problems += [problem for _, problem in bad]
    assert all(str(problem).isprintable() for problem in problems)
    left_out = [mapping for mapping, _ in bad]
    good = [mapping for mapping in mappings if mapping not in left_out]
    for mapping in good:
        _check(mapping)
    assert len({mapping.name for mapping in good}) == len(good)
    bench = DriverBench(good, start=False)
    planned = [mapping for block in bench.driver.readings.blocks for mapping in block.mappings]
    assert sorted(mapping.item for mapping in planned) == sorted(
        mapping.item for mapping in good if mapping.polls)


def _check(mapping: Mapping) -> None:
    assert _NAME.fullmatch(mapping.name) and _NAME.fullmatch(mapping.topic)
    assert mapping.minimum <= mapping.maximum
    assert mapping.address.offset + mapping.codec.words <= mapping.address.area_size
