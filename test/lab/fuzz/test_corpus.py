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

"""The stored inputs of the fuzz targets, without a fuzzer (test/RESULTS.md)."""

import importlib

from fuzz import corpus
import pytest
from support.cases import long_unless


@pytest.mark.parametrize('target', long_unless(
    lambda target: target not in ('captures', 'links'), zip(corpus.TARGETS)))
def test_inputs_do_what_the_target_allows(target: str) -> None:
    one_input = importlib.import_module(f'fuzz.{target}').one_input
    inputs = [b'', *corpus.seeds(target), *corpus.stored(target)]
    for data in inputs:
        one_input(data)
    assert len(set(inputs)) > 15


def test_stored_inputs_stay_small() -> None:
    assert sum(len(data) for target in corpus.TARGETS for data in corpus.stored(target)) < 150_000
