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
The whole driver on a noisy line for some minutes in each mode; ``run.py`` does it for hours.

Nothing may go wrong that a check could have seen, and what it cannot see is as frequent as
theory says.
"""

from __future__ import annotations

from itertools import product

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, message_frame
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.write import Outcome
from noise.judge import Ear, Judge
from noise.rig import MODES, Rig
from noise.run import Case
from noise.theory import Theory
from noise.wire import Kind, LISTED, Wire
import pytest
from support.cases import long_unless
from support.mappings import make_mapping

# Seconds that a scan, a probe of a silent station and the rest of a command may take.
LONGEST_RECOVERY = 30.0

# A silent station gets an eighth of the line: it waits seven times what its last probe took.
PROBES_SHARE = 8


@pytest.mark.parametrize('mode, error_code', long_unless(
    lambda mode, error_code: [*MODES].index(mode) % 2 == (error_code == 'CRC'),
    product(MODES, ('CRC', 'BCC'))))
def test_noise_gives_no_wrong_value_that_a_check_could_see(
        mode: str, error_code: str) -> None:
    rig = Rig(mode, error_code, seed=50)
    rig.disturb(2e-2, 150.0)
    rig.settle()
    counts = rig.judge.counts
    assert rig.judge.faults == 0, counts
    assert counts['values'] > 100
    assert counts['WRITTEN'] > counts['writes'] / 4 > 0
    assert rig.wire.singles + rig.wire.several > 20
    assert 0 < rig.longest < rig.bound
    assert max(rig.recoveries) < max(LONGEST_RECOVERY, PROBES_SHARE * rig.longest)
    if error_code == 'CRC':
        assert not {name for name in counts if name.startswith('deceived')}


@pytest.mark.parametrize('kind', long_unless(
    lambda kind: kind is Kind.FLIPPED, ((kind,) for kind in Kind)))
def test_bcc_misses_as_many_as_theory_says(kind: Kind) -> None:
    case = Case('Message', 'BCC', (kind,), 1e-2, trials=1000)
    assert case.run(seed=5, hours=0.03) == 0
    assert case.theory is not None
    expected = case.theory.expected(
        case.sums['singles'], case.sums['several'], case.sums['refused'])
    deviation = 4 * max(expected, 1.0) ** 0.5
    assert abs(case.sums['unseen'] - expected) <= deviation
    row = case.row()
    assert row[:4] == ['Message', 'BCC', kind.value, '0.01']


def test_wire_without_errors_changes_nothing() -> None:
    rig = Rig('Message')
    rig.disturb(0.0, 60.0)
    rig.settle()
    assert (rig.wire.singles, rig.wire.several, rig.judge.unseen) == (0, 0, 0)
    assert rig.judge.counts['WRITTEN'] + rig.judge.counts['SUPERSEDED'] \
        == rig.judge.counts['writes']


def test_same_seed_gives_the_same_figures() -> None:
    figures = []
    for _ in range(2):
        rig = Rig('Peer', seed=4)
        rig.disturb(1e-2, 60.0)
        rig.settle()
        figures.append((rig.judge.counts, rig.wire.characters, rig.recoveries))
    assert figures[0] == figures[1]


def test_crc_does_not_see_a_zero_in_front() -> None:
    frame = message_frame(bytes((5, 1, 0x4F, 0, 1, 2)), Checksum.CRC)
    theory = Theory([frame], Checksum.CRC, Duplex.HALF, LISTED, 1e-3)
    assert theory.expected(4 * 256 * len(frame), 0, 0) == pytest.approx(1.0)
    assert theory.expected(0, 0, 65536) == pytest.approx(1.0)


def an_ear(wire: Wire) -> Ear:
    return Ear(Checksum.CRC, Duplex.HALF, wire)


def test_ear_knows_a_frame_that_nobody_has_sent() -> None:
    wire, random = Wire(), Rig('Message').random
    sent = message_frame(bytes((5, 1, 0x4F, 0, 1, 2)), Checksum.CRC)
    other = message_frame(bytes((0, 5, 1, 0x4F, 0, 1, 2)), Checksum.CRC)
    assert wire.damage(sent, random) == sent
    ear = an_ear(wire)
    for frame, is_deceived in ((sent, False), (other, True), (sent, False)):
        ear.feed(frame)
        symbol = ear.next_symbol()
        assert isinstance(symbol, Frame) and symbol.fault is None
        assert ear.is_deceived is is_deceived
    assert (ear.unseen, ear.refused) == (1, 0)


def test_ear_knows_a_forged_frame_that_is_passed_on() -> None:
    wire, random = Wire(), Rig('Message').random
    forged = message_frame(bytes((2, 1, 0x0F, 0, 1, 2)), Checksum.CRC)
    ear = an_ear(wire)
    ear.feed(forged)
    assert ear.next_symbol() is not None
    assert wire.damage(forged, random) == forged
    ear.is_deceived = False
    ear.feed(forged)
    assert ear.next_symbol() is not None
    assert ear.is_deceived
    assert ear.unseen == 1


@pytest.mark.parametrize(('outcome', 'detail', 'times', 'faults'), [
    (Outcome.WRITTEN, '', 1, 0), (Outcome.WRITTEN, '', 0, 1), (Outcome.WRITTEN, '', 2, 1),
    (Outcome.NOT_SENT, '', 0, 0), (Outcome.NOT_SENT, '', 1, 1),
    (Outcome.UNKNOWN, 'not read back within 2 s', 0, 0), (Outcome.UNKNOWN, '', 1, 0),
    (Outcome.UNKNOWN, '2508; read back: the PLC holds the value', 1, 0),
    (Outcome.UNKNOWN, '2508; read back: the PLC holds the value', 0, 1),
    (Outcome.UNKNOWN, '2508; read back: the PLC holds another value', 0, 0),
    (Outcome.UNKNOWN, '2508; read back: the PLC holds another value', 1, 1)])
def test_judge_knows_a_false_result(outcome: Outcome, detail: str, times: int,
                                    faults: int) -> None:
    judge = Judge()
    judge.asked(b'a')
    for _ in range(times):
        judge.written(b'a', an_ear(Wire()))
    judge.resulted(b'a', outcome, detail)
    judge.settle()
    assert judge.faults == faults


def test_judge_misses_a_result() -> None:
    judge = Judge()
    judge.asked(b'a')
    judge.settle()
    assert (judge.counts['results missing'], judge.faults) == (1, 1)


def test_judge_knows_what_was_held_and_when() -> None:
    judge, mapping, ear = Judge(), make_mapping(), an_ear(Wire())
    judge.holds(mapping, b'a', 1.0)
    judge.holds(mapping, b'b', 2.0)
    for content, since, wrong in ((b'b', 3.0, 0), (b'a', 1.5, 0), (b'a', 2.5, 1), (b'c', 0.0, 2)):
        judge.published(mapping, content, since, ear)
        assert judge.counts['wrong values'] == wrong
    ear.is_deceived = True
    judge.published(mapping, b'c', 0.0, ear)
    assert (judge.counts['deceived values'], judge.faults) == (1, 2)


def test_judge_excuses_what_a_forged_command_has_made_a_station_repeat() -> None:
    judge, ear = Judge(), an_ear(Wire())
    command = Packet(1, 5, 0x0F, 0, 7)
    for is_deceived in (False, True, False):
        ear.is_deceived = is_deceived
        judge.executed(1, command, ear)
    assert (judge.counts['deceived commands'], judge.faults) == (2, 0)
    judge.executed(1, command, ear)
    assert judge.faults == 0  # the forged one is still between it and the first
    judge.executed(2, command, ear)
    judge.executed(2, command, ear)
    assert judge.counts['twice'] == 1


def test_judge_excuses_a_second_execution_after_the_result() -> None:
    judge, ear = Judge(), an_ear(Wire())
    judge.ears.append(ear)
    judge.asked(b'a')
    judge.written(b'a', ear)
    judge.resulted(b'a', Outcome.WRITTEN)
    ear.unseen += 1
    judge.written(b'a', ear)
    judge.settle()
    assert (judge.counts['deceived results'], judge.faults) == (1, 0)
