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

"""Each reply that begins in time is heard to its end, on a healthy line of any speed."""

from functools import partial
from itertools import product

from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import DriverBench
from support.mappings import make_mapping

MODES = {'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
         'Radio': {'mode': 'Radio'}}
BAUDS = 1200, 2400, 4800, 9600, 19200, 38400
TIMES = [*product((100, 300), (500, 1000))]  # Timeout and Cmd_Timeout
LONGEST = 30.0  # s of line time
REPLY_RECEIVED = 2523


# Each mode and each speed meets all of these times in the first quarter of all lines.
@pytest.mark.parametrize('quarter', [
    0, *(pytest.param(number, marks=pytest.mark.long) for number in range(1, 4))])
@pytest.mark.parametrize('mode', MODES)
def test_long_replies_are_heard(mode: str, quarter: int) -> None:
    lines = enumerate(BAUDS, [*MODES].index(mode) + quarter)
    for (at, baud), words in product(lines, (10, 25, 40, 60, 80, 117)):
        timeout, cmd_timeout = TIMES[at % 4]
        row = make_mapping('N7:0', length=words)
        bench = DriverBench([row], chunk=1, network=Network(
            baud=baud, timeout=timeout, cmd_timeout=cmd_timeout, enq_retries=0, nak_retries=0,
            **MODES[mode]))
        bench.plc(1, 'PLC5', ('N7:0', words))
        bench.run_until(partial(bench.listener.values, row), LONGEST)
        # By radio a PLC waits for a quiet line, maybe for longer than Cmd_Timeout.
        assert mode == 'Radio' or bench.listener.numbers() <= {REPLY_RECEIVED}
