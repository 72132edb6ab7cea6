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

"""The death of a publisher while a station takes short commands and its long replies get lost."""

from collections.abc import Iterable
import math

from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.network import Network
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import Answer, OddDevice, Wiring
from support.virtual_line import Noise

SAFE, RUNNING, AFTER = 0, 777, 2.0
STATION, GATEWAY = 1, 7
MODES: dict[str, dict[str, str]] = {
    'Master': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
    'Radio': {'mode': 'Radio'}}
_WIRING = {'Peer': Wiring.FULL, 'Radio': Wiring.RADIO}


class Death(DriverBench):
    """
    A PLC with a speed and a read of so many ``words``, maybe a heartbeat; its publisher may die.

    ``bound`` is what is printed for the fallback (s), ``seen`` what the PLC has executed as speed.
    """

    def __init__(self, mode: str, seed: int = 1, *, words: int = 100, is_behind: bool = False,
                 has_beat: bool = False, length: int = 1) -> None:
        via = GATEWAY if is_behind else None
        self.speed = make_mapping('N7:0', 'Write', plc='SLC', tag='speed', via=via, length=length,
                                  fallback=Fallback(length * (SAFE,), int(AFTER * 1000)))
        beat = make_mapping('N10:0', 'Heartbeat', plc='SLC', tag='beat', via=via, period=500,
                            condition=While(('speed',), 1500))
        self.read = make_mapping('N9:0', plc='SLC', length=words, period=200, via=via)
        rows = [self.speed, self.read, *([beat] if has_beat else [])]
        network = Network(station=200, baud=19200, timeout=100, cmd_timeout=500, nak_retries=1,
                          enq_retries=1, **MODES[mode])  # type: ignore[arg-type]
        self.device = OddDevice(_WIRING.get(mode, Wiring.HALF), via or STATION, (STATION,))
        self.device.takes = self._watch
        super().__init__(rows, network=network, start=False, chunk=1, far=self.device,
                         settings=DriverSettings(processor_period=0.0, first_tns=seed))
        self.bound = next(bound.seconds or 0.0
                          for bound in make_report(network, rows, 0.2).times.bounds()
                          if bound.mapping is self.speed)
        self.seen: list[int] = []
        self.refuses = False  # each write
        self.line.random.seed(seed)
        self.breathe()
        self.publish_for(math.inf)
        self.open()

    def _watch(self, data: bytes) -> Answer:
        if data[6:7] != b'\xAA':
            return Answer.ACK
        if data[8] == 7 and not self.refuses:
            value = int.from_bytes(data[-2:], 'little')
            self.seen += [value] if value != self.word(7) else []
        return Answer.REFUSES if self.refuses else Answer.ACK

    def publish_for(self, seconds: float) -> None:
        """Let the publisher live for so long from now on, and then die."""
        self._dies = self.clock() + seconds
        if seconds == math.inf:
            self._publish()

    def _publish(self) -> None:
        if self.clock() < self._dies:
            self.write(self.speed, [RUNNING] * self.speed.length)
            self.at(self.clock() + 0.1, self._publish)

    def word(self, file: int, element: int = 0) -> int:
        return self.device.words.get((STATION, file, element), 0)

    def break_wire(self) -> None:
        """Let nothing reach us any more, while all of ours reaches the PLC."""
        self.far.say = lambda data: b''

    def is_safe_after(self, seconds: float) -> bool:
        """Let the publisher die; tell whether the speed is safe after so long, and stays it."""
        self.publish_for(0.0)
        self.run(seconds)
        return {SAFE} == {self.word(7), *self._values_within(10.0)}

    def _values_within(self, seconds: float) -> list[int]:
        self.seen.clear()
        self.run(seconds)
        return self.seen


def overdue(mode: str, noise: Noise, seeds: Iterable[int]) -> list[int]:
    """Return the seeds of deaths after which the fallback was not there within its bound."""
    found = []
    for seed in seeds:
        death = Death(mode, seed)
        death.run(3.0)
        death.line.noise = noise
        death.run(3.0 + 0.37 * (seed % 11))
        if not death.is_safe_after(death.bound):
            found.append(seed)
    return found


def with_broken_wire(mode: str, dies_after: float, *, is_behind: bool = False) -> Death:
    """Return a plant whose wire to us broke; the publisher died so long (s) later."""
    death = Death(mode, is_behind=is_behind, has_beat=True)
    death.run(4.0)
    assert (death.word(7), death.word(10) > 0) == (RUNNING, True)
    death.break_wire()
    death.run(dies_after)
    return death
