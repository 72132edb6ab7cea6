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

"""A station that is not heard, but takes commands, gets its fallback and its 0 (rules 4, 11)."""

from itertools import product

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, Poll
from abdf1_ros.driver.write import Outcome
import pytest
from support.cases import long_unless
from support.deaths import Death, MODES, overdue, SAFE, STATION, with_broken_wire
from support.virtual_line import Noise

WIRES = pytest.mark.parametrize('mode, is_behind, dies_after', [
    pytest.param(*case, dies_after, marks=() if at % 2 == (dies_after > 0) else pytest.mark.long)
    for at, case in enumerate([*product(MODES, [False]), ('Master', True), ('Standard', True)])
    for dies_after in (0.0, 5.0)])


@WIRES
def test_plc_whose_replies_are_not_heard_holds_fallback_and_0(
        mode: str, dies_after: float, is_behind: bool) -> None:
    death = with_broken_wire(mode, dies_after, is_behind=is_behind)
    assert death.is_safe_after(death.bound)
    assert death.word(10) == 0


@pytest.mark.parametrize('mode, share', long_unless(
    lambda mode, share: mode == 'Peer' and share == 0.02,
    product(('Master', 'Peer'), (0.01, 0.02))))
def test_noise_that_no_long_reply_survives_does_not_keep_a_fallback_away(
        mode: str, share: float) -> None:
    assert overdue(mode, Noise(flipped=share), range(1, 5)) == []


@pytest.mark.parametrize('mode', MODES)
def test_output_of_a_plc_that_is_not_heard_does_not_flap_while_messages_come(mode: str) -> None:
    death = Death(mode)
    death.run(4.0)
    death.break_wire()
    death.run(death.bound)
    death.seen.clear()
    death.run(30.0)
    assert death.seen == [] and death.word(7) == SAFE
    results = [str(result) for result in death.listener.results[-100:]]
    assert set(results) == {f'{Outcome.NOT_SENT.value}: fallback'}


@WIRES
def test_end_writes_once_to_a_plc_that_is_not_heard(
        mode: str, dies_after: float, is_behind: bool) -> None:
    death = with_broken_wire(mode, dies_after, is_behind=is_behind)
    interlocks = death.driver.kernel
    interlocks.end.wind_down()
    death.line.wake(death.driver.machine)
    death.run_until(lambda: interlocks.end.is_over or death.clock() > dies_after + 6.0)
    assert (death.word(7), death.word(10)) == (SAFE, 0)
    assert sorted(interlocks.end.unconfirmed(0.0)) == ['beat', 'speed']


def test_0_and_fallback_go_out_without_a_poll_once_and_a_read_after_one() -> None:
    death = Death('Master')
    death.run(4.0)
    death.break_wire()
    decoder = FrameDecoder(Checksum.CRC, Duplex.HALF)
    spoken: list[str] = []

    def listen(data: bytes) -> bytes:
        decoder.feed(data)
        while (symbol := decoder.next_symbol()) is not None:
            if isinstance(symbol, Poll):
                spoken.append('poll')
            elif isinstance(symbol, Frame):
                spoken.append('fallback' if b'\xaa' in symbol.data else 'read')
        return data

    death.is_safe_after(death.bound)
    death.far.hear = listen
    death.run(30.0)
    # Each asks for itself, in turns: a poll that nothing answers is all of a read.
    assert spoken[:8] in (['poll', 'fallback'] * 4, ['fallback', 'poll'] * 4)
    assert not death.driver.stations[STATION].active


def test_refused_fallback_does_not_keep_the_reads_from_coming_back() -> None:
    death = Death('Master')
    say = death.far.say
    death.run(4.0)
    death.refuses = True
    death.break_wire()
    death.is_safe_after(death.bound)
    death.far.say = say
    death.run(2.0)
    assert death.driver.stations[STATION].active
    assert death.listener.reasons[-1][1].startswith('not written')


def test_all_packets_of_a_long_first_try_go_out() -> None:
    death = Death('Master', length=130)
    death.run(4.0)
    death.break_wire()
    assert death.is_safe_after(death.bound)
    assert death.word(7, 129) == SAFE
