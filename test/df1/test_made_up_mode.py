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
A sixth mode in this file: what there is to a mode, and that everybody takes it from there.

It is a full-duplex line whose commands have a pause before them, as if on a slow modem.
"""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys
import tempfile

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import Listen, Procedure
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.modes import MODES
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.tasks import Task

PAUSE = 0.2
LONGEST = 7.0


class Modem(FullDuplexPeer):
    """A peer that pauses before each command."""

    def _send_command(self, task: Task) -> Procedure:
        yield Listen(PAUSE)
        yield from super()._send_command(task)


class ModemMode(LineMode):
    name = 'Modem'
    link = Modem
    other_words = {'dialup': 'Modem'}
    duplex = Duplex.FULL
    why_unshared = 'a modem has one caller'
    answers = 1

    def pause(self, line: LinkSettings) -> float:
        return PAUSE

    def longest_transaction(self, line: LinkSettings, frames: float, others: float = 0.0,
                            stations: int = 0) -> float:
        return LONGEST


def main() -> None:
    """See that everybody knows the mode."""
    MODES.append(ModemMode())  # the line

    from abdf1_ros.cli.check import examine
    from abdf1_ros.plan.report import make_report
    from support.driver_bench import DriverBench

    rows = 'Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After\n'
    with tempfile.TemporaryDirectory() as folder:
        net, plan = Path(folder, 'net.csv'), Path(folder, 'map.csv')
        plan.write_text(f'{rows}level,Read,N7:0,1,PLC5,0,,\nspeed,Write,N7:9,1,PLC5,,0,500\n',
                        encoding='utf-8')

        def faults(text: str) -> list[str]:
            net.write_text(text, encoding='utf-8')
            return [str(problem) for problem in examine(str(net), str(plan)).problems]

        fault, = faults('Mode,Com_Port\nDial-up,1\n')
        assert 'one of Master, Slave, Peer, Radio, Listen, or Modem; "Dial-up" is Modem' in fault
        fault, = faults('Mode,Com_Port,Share\nModem,1,tcp:6000\n')
        assert fault.endswith(': a modem has one caller')
        assert faults('Mode,Com_Port,Baud\nmodem,1,19200\n') == []
        found = examine(str(net), str(plan))
    assert found.network is not None
    report = make_report(found.network, found.mappings, 0.1)
    assert report.times.longest == LONGEST
    bound, = report.times.bounds()
    assert bound.seconds == 0.5 + 3 * LONGEST

    bench = DriverBench(found.mappings, network=found.network, start=False)
    bench.plc(1, 'PLC5', ('N7:0', 10))
    bench.open(run=10.0)
    level, speed = found.mappings
    bench.write(speed, [7], run=1.0)
    assert bench.listener.values(level)[-1] == [0]
    times = bench.listener.times(level)
    assert min(after - before for before, after in zip(times, times[1:], strict=False)) > PAUSE
    assert 35 < len(times) < 50


def test_everybody_knows_a_mode_that_one_line_registers() -> None:
    root = Path(__file__).resolve().parents[2]
    environment = os.environ | {'PYTHONPATH': os.pathsep.join((str(root), str(root / 'test')))}
    assert subprocess.call([sys.executable, __file__], env=environment, timeout=60) == 0


if __name__ == '__main__':
    main()
