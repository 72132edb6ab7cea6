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

"""What a line shows of its speed: from exchanges, and from long messages."""

from abdf1_ros.df1.line_rate import EXCHANGES, LineRate, LONG_MESSAGE, MESSAGES
from abdf1_ros.df1.master_line import MasterSettings
from abdf1_ros.df1.packet import Packet
import pytest
from support.multidrop import MasterBench
from support.virtual_line import char_time

SETTINGS = MasterSettings(station=5, timeout=0.5, cmd_timeout=1.0)
BAUD = 9600


def seen(real: int | None, *, words: int = 50, chunk: int = 1) -> float | None:
    """Return what a line set to 9600 baud shows when it has another rate (None: any)."""
    rig = MasterBench(7, settings=SETTINGS, baud=BAUD)
    setattr(rig[7], '_execute', lambda command: command.reply(bytes(2 * words)))
    rig.line.char_time = char_time(real) if real else 0.0
    rig.line.chunks = [chunk] * len(rig.line.chunks)
    rig.start()
    for _ in range(EXCHANGES):
        task = rig.ask(7)
        rig.line.run(lambda task=task: task.result is not None, 10.0)
        assert isinstance(task.result, Packet)
        rig.run(0.05)  # the line rests, which is no slowness
    return rig.master.machine.rate.seen


@pytest.mark.parametrize('chunk', [1, 8, 1000])
@pytest.mark.parametrize('words', [1, 50])
def test_nothing_speaks_against_the_right_speed(chunk: int, words: int) -> None:
    assert seen(BAUD, words=words, chunk=chunk) is None


@pytest.mark.parametrize('chunk', [1, 1000])
@pytest.mark.parametrize(('real', 'least'), [(19200, 1.9), (115200, 10.0), (None, 1000.0)])
def test_faster_line_shows_a_lower_limit(real: int | None, least: float, chunk: int) -> None:
    rate = seen(real, chunk=chunk)
    assert rate is not None and rate > least
    assert real is None or rate <= real / BAUD * 1.001


@pytest.mark.parametrize(('real', 'chunk'), [(4800, 1), (4800, 8), (2400, 1)])
def test_slower_line_shows_its_rate(real: int, chunk: int) -> None:
    assert seen(real, chunk=chunk) == pytest.approx(real / BAUD, rel=0.02)


def test_short_messages_do_not_show_that_a_line_is_slower() -> None:
    assert seen(4800, words=1) is None


def exchange(rate: LineRate, now: float, seconds: float) -> None:
    """Send 10 characters and hear 10, of 1 ms each at the set speed."""
    heard = round(now)  # any count: what is heard is a difference
    rate.sent(10, heard, now)
    rate.answered(heard + 10, now + seconds)


def test_few_late_answers_do_not_make_a_line_fast() -> None:
    rate = LineRate(0.001)
    for number in range(EXCHANGES):
        exchange(rate, number, 0.001 if number % 2 else 0.03)
    assert rate.seen is None


def test_repetition_counts_from_its_first_transmission() -> None:
    rate = LineRate(0.001)
    for number in range(EXCHANGES):
        rate.sent(10, 0, number)
        exchange(rate, number + 0.1, 0.001)  # the answer to the first comes after the second
    assert rate.seen is None


def test_rate_that_is_as_set_again_is_told_no_more() -> None:
    rate = LineRate(0.001)
    for number in range(EXCHANGES):
        exchange(rate, number, 0.01)
    assert rate.seen == pytest.approx(2.0)
    for _ in range(MESSAGES):
        rate.message(LONG_MESSAGE, 2 * LONG_MESSAGE * 0.001)
    assert rate.seen == pytest.approx(0.5)
    for _ in range(MESSAGES):
        rate.message(LONG_MESSAGE, LONG_MESSAGE * 0.001)
    assert rate.seen is None


def test_forgotten_rate_is_measured_anew() -> None:
    rate = LineRate(0.001)
    for number in range(EXCHANGES):
        exchange(rate, number, 0.01)
    rate.forget()
    for number in range(EXCHANGES - 1):
        exchange(rate, number, 0.01)
    assert rate.seen is None


def test_what_is_heard_in_full_duplex_may_pass_while_something_is_sent() -> None:
    rate = LineRate(0.001, is_half_duplex=False)
    for number in range(EXCHANGES):
        exchange(rate, number, 0.01)  # 10 characters each way at once, at the set speed
    assert rate.seen is None
