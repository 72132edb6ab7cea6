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

"""Faults of one byte, or of two, in every mode, check and kind of transaction: a sample."""

from random import Random
import secrets

import pytest
from support.single_faults import CHECKS, Fault, KINDS, MODES, Tally

# Of each kind of transaction; idle polls make a case of these modes many times as long.
CASES = dict.fromkeys(MODES, 5) | {'Standard': 1, 'Slave': 1}


@pytest.mark.parametrize('mode', MODES)
def test_no_fault_of_one_or_two_bytes_does_harm(mode: str) -> None:
    seed = secrets.randbelow(1 << 31)
    random = Random(seed)
    for kind in KINDS:
        tally = Tally(mode, random.choice(CHECKS), kind)
        count = max(1, CASES[mode] // (5 if kind == 'two packets' else 1))
        for fault in random.sample(tally.all_singles(), count):
            tally.carry_out(fault)
        for _ in range(count):
            tally.carry_out(*tally.pair(random))
        assert not tally.wrong, f'seed {seed}, {tally}'


def test_slave_that_executes_repetitions_is_found() -> None:
    tally = Tally('Master', 'CRC', 'write', detects_duplicates=False)
    tally.carry_out(Fault(0, 0, 'lost'))  # of the ACK
    assert [why.split(': ')[-1] for why in tally.wrong] == ['Outcome.WRITTEN, executed 2 times']
