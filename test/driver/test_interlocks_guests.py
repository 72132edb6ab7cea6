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

"""Guests and gateways that hold commands, beside heartbeats and fallback values."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count
import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.kernel.fallback import FallbackState
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.network import POLLING_MODES
import pytest
from support.driver_bench import store
from support.interlocks import (
    beat_row,
    Cell,
    end,
    FALLBACK,
    GuestCell,
    hold,
    speed_row,
    START,
    WORDS,
)
from support.mappings import make_mapping


@pytest.mark.parametrize('dst', [1, 255])
@pytest.mark.parametrize('polling', POLLING_MODES)
@pytest.mark.parametrize('text', WORDS)
def test_rule_5_write_of_a_guest_on_the_line_when_the_end_begins_does_not_stay(
        text: str, polling: str, dst: int) -> None:
    # Alone: nothing else keeps the end waiting.
    row = speed_row() if text == 'N7:0' else beat_row(requires=('speed',), timeout=300)
    cell = GuestCell(row, polling=polling)
    cell.ask(text, 99, dst)
    cell.bench.run_until(lambda: cell.word(text) == 99)  # its reply is not here yet
    end(cell)
    assert cell.word(text) == (7 if text == 'N7:0' else 0)


@pytest.mark.parametrize('text', WORDS)
@pytest.mark.parametrize('held', [0.3, 0.9])
def test_rule_5_write_of_a_guest_that_a_gateway_holds_does_not_stay(
        text: str, held: float) -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=200, via=7)
    cell = GuestCell(beat, speed, start=False)
    cell.put_behind_gateway(run=4.0)
    cell.hold_guests(held)
    cell.ask(text, 99)
    cell.run(0.02)
    assert cell.replies == [0x02]
    end(cell)
    assert [cell.word(name) for name in WORDS] == [7, 0]


def test_rule_5_what_may_still_land_after_the_end_is_named() -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = GuestCell(speed, start=False, cmd_timeout=10_000)
    cell.put_behind_gateway(run=30.0)
    cell.hold_guests(1.9)
    cell.ask('N7:0', 99)
    cell.run(0.02)
    end(cell)
    unconfirmed, = cell.bench.driver.kernel.end.unconfirmed(cell.now)
    what, _, left = unconfirmed.partition(' for ')
    assert what == 'speed (a gateway may hold a write to it'
    assert 0.0 < float(left.removesuffix(' s)')) <= 20.0


@pytest.mark.parametrize(('shown_by', 'when'), [
    ('the first try', 0.9), ('a guest', 0.3), ('a guest', 3.0), ('nothing', 0.9)])
def test_rule_10_gateway_that_shows_itself_after_the_port_was_opened_may_hold_an_earlier_command(
        shown_by: str, when: float) -> None:
    cell = GuestCell(speed_row(Fallback((7,), 60_000)), beat_row(60_000, ('speed',), 300),
                     start=False)
    tries = count(shown_by != 'the first try')
    cell.is_undelivered = lambda command: (
        command.data.endswith(b'\x63\0') or command.data.endswith(b'\7\0') and not next(tries))
    cell.bench.open(run=when)  # both are confirmed before
    assert cell.results() == [START]
    for text in WORDS:
        store(cell.plc, text, [800])  # it has let it go
    if shown_by == 'a guest':
        cell.ask('N11:0', 99)
    cell.run(0.9)
    expected = [800, 800] if shown_by == 'nothing' else [7, 0]
    assert [cell.word(text) for text in WORDS] == expected


@pytest.mark.parametrize('dst', [1, 255])
def test_rule_8_guests_write_over_a_fallback_is_written_over_at_once(dst: int) -> None:
    cell = GuestCell(beat_row(), speed_row())
    row, = cell.bench.driver.kernel.rows.fallbacks
    cell.run(1.0)
    since = cell.now
    cell.ask('N7:0', 99, dst)
    cell.bench.run_until(lambda: cell.word('N7:0') == 99)
    cell.bench.run_until(lambda: not row.stands)
    assert (row.state, row.is_confirmed) == (FallbackState.OVERWRITTEN, False)
    cell.run(0.1)
    assert row.stands
    assert cell.written('N7:0', since)[-1:] == [7]
    assert cell.written('N10:0', since)[-1:] == [0]  # rule 3 b
    cell.run(2.0)
    assert cell.word('N10:0') > 0
    assert cell.results() == [START]


@pytest.mark.parametrize('held', [0.5, 0.7, 0.9])
@pytest.mark.parametrize('count', [1, 2, 3])
def test_rule_19_own_heartbeats_that_a_gateway_holds_are_no_other_program(
        held: float, count: int) -> None:
    cell = Cell(make_mapping('N10:0', 'Heartbeat', tag='beat', period=200, via=7), start=False)
    cell.put_behind_gateway(run=5.0)
    left = [count]

    def is_meant(command: Packet) -> bool:
        left[0] -= command.data[-2:] != b'\0\0' and 'N10:0' in cell.named(command)
        return 0 <= left[0] < count

    hold(cell, held, is_meant)
    cell.run(5.0)
    assert left[0] < 0
    assert cell.bench.listener.foreign == []
    assert cell.bench.driver.kernel.rows.heartbeats[0].why_not(cell.now) == ''


@pytest.mark.parametrize('has_speed', [True, False])  # in the new files
def test_rule_19_own_0_of_an_end_that_lands_after_a_reload_is_no_other_program(
        has_speed: bool) -> None:
    """The heartbeat counts by then, and a read finds the 0."""
    beat, speed = (make_mapping(address, command, tag=tag, period=period, fallback=fallback, via=7)
                   for address, command, tag, period, fallback in (
                       ('N10:0', 'Heartbeat', 'beat', 300, None),
                       ('N7:0', 'Write', 'speed', None, FALLBACK)))
    cell = Cell(beat, speed, start=False)
    cell.put_behind_gateway(run=5.0)
    left = [1]

    def is_meant(command: Packet) -> bool:
        is_zero = command.data[:1] == b'\x67' and command.data[-2:] == b'\0\0'
        left[0] -= is_zero
        return is_zero and left[0] == 0

    hold(cell, 0.95, is_meant)
    interlocks = cell.bench.driver.kernel
    interlocks.end.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    while not interlocks.end.is_over:
        cell.run(0.01)
    assert left[0] < 0
    cell.bench.hand_over([replace(row) for row in (beat, speed)[:1 + has_speed]])
    seen = list[int]()
    for _ in range(300):
        cell.run(0.01)
        seen += [cell.word('N10:0')] * (seen[-1:] != [cell.word('N10:0')])
    assert seen[:4] == [0, 1, 0, 2]  # the second 0 is the one of the end
    assert cell.bench.listener.foreign == []


@pytest.mark.parametrize('outcome', [Outcome.WRITTEN, Outcome.PARTLY, Outcome.FAILED])
def test_rule_2_plc_behind_a_gateway_that_answers_at_all_is_a_first_contact(
        outcome: Outcome) -> None:
    cell = Cell(make_mapping('N10:0', 'Heartbeat', tag='beat', period=200, via=7), start=False)
    cell.put_behind_gateway(run=3.0)
    plc = cell.bench.driver.kernel.rows.plcs[1]
    beat, = plc.heartbeats
    assert not beat.wants_zero
    plc.failures = 1
    ours = Flight(1, [beat.mapping.extent], beat.take(cell.now), cell.now - 0.5)
    beat.trial = ours
    ours.end(Outcome.UNKNOWN, cell.now, 1.0)
    plc.write_ended(ours, cell.now)
    plc.look_again()
    assert plc.pause_end == pytest.approx(cell.now + 7 * 0.5)
    assert plc.ready({}, cell.now + 0.3) == [beat]  # for its gateway answers
    flight = Flight(1, [beat.mapping.extent])
    flight.end(outcome, cell.now, -math.inf)
    plc.write_ended(flight, cell.now)
    assert (plc.failures, beat.wants_zero) == (0, True)


@pytest.mark.parametrize('times', [0, 20])
def test_rule_8_guests_write_over_a_0_is_written_over_at_once(times: int) -> None:
    speed = speed_row(None)
    cell = GuestCell(beat_row(2000, requires=('speed',), timeout=300), speed)
    cell.publish(speed, 5, 20, run=2.5)
    cell.publish(speed, 5, times, run=0.2)  # it may count again, when the 0 has stood long enough
    cell.ask('N10:0', 99)
    cell.bench.run_until(lambda: cell.word('N10:0') == 99)
    cell.run(0.1)
    assert cell.word('N10:0') == 0
    assert cell.bench.listener.foreign == []


@pytest.mark.parametrize('is_refused', [True, False])  # else it is carried out, unseen by us
def test_rule_8_guests_write_over_the_0_before_a_number_that_is_not_confirmed_is_written_over(
        is_refused: bool) -> None:
    cell = GuestCell(beat_row(1000), start=False)
    numbers = list[int]()
    serve = cell.plc.serve

    def leave_out(command: Packet) -> Packet:
        is_first = command.data[:1] == b'\x67' and command.data[-2:] != b'\0\0' and not numbers
        if not is_first:
            return serve(command)
        numbers.append(command.data[-2])
        reply = command.reply(sts=0x10) if is_refused else serve(command)
        return reply if is_refused else reply._replace(tns=reply.tns ^ 0x8000)

    cell.plc.serve = leave_out  # type: ignore[method-assign]
    cell.bench.open()
    while not numbers:
        cell.run(0.01)
    cell.run(0.7)  # the number is repeated after a Period
    asked = cell.now
    cell.ask('N10:0', 99)
    cell.run(4.0)
    since = [value for when, name, value in cell.writes if name == 'N10:0' and when >= asked]
    assert since[:2] == [99, 0]
    assert [value for value in since if value][1] == numbers[0]


def test_rule_8_command_that_nobody_knows_refreshes_and_holds_no_heartbeat() -> None:
    cell = GuestCell(beat_row(), speed_row())
    cell.run(1.0)
    since = cell.now
    store(cell.plc, 'N7:0', [99])
    cell.bench.driver.guests.put(GuestCommand(
        Guest('pty:hmi', ShareAccess.ALL), Packet(1, 9, 0x0F, 0, 1, b'\x3A'), cell.now,
        lambda reply: None))
    cell.plc.serve = partial(_confirm_3a, cell.plc.serve)  # type: ignore[method-assign]
    cell.run(0.3)
    assert cell.word('N7:0') == 7
    assert 0 not in cell.written('N10:0', since)


def _confirm_3a(serve: Callable[[Packet], Packet], command: Packet) -> Packet:
    return command.reply() if command.data == b'\x3A' else serve(command)


def test_rule_5_commands_of_guests_are_not_sent_while_the_bridge_ends() -> None:
    cell = Cell(speed_row(), run=1.0)
    driver, sts = cell.bench.driver, []
    cell.refused = {'N7:0'}  # so that the end lasts
    driver.kernel.end.wind_down()
    command = Packet(1, 9, 0x0F, 0, 1, bytes.fromhex('67 00 00 01 00 07 00 07 00 42 2A 00'))
    driver.guests.put(GuestCommand(Guest('pty:hmi', ShareAccess.ALL), command, cell.now,
                                   lambda reply: sts.append(reply.sts)))
    cell.bench.line.wake(driver.machine)
    cell.run(1.0)
    assert sts == [0x01]  # no room; the PLC would have answered 10


def test_rule_11_plc_is_not_left_alone_any_more_once_it_answers_a_write_of_anybody() -> None:
    cell = GuestCell(speed_row(), start=False)
    cell.is_undelivered = lambda command: command.data.endswith(b'\7\0')
    cell.bench.open()
    plc = cell.bench.driver.kernel.rows.plcs[1]
    cell.bench.run_until(lambda: plc.is_lost)
    cell.is_undelivered = lambda command: False
    assert cell.now < 0.2 < plc.pause_end
    cell.ask('N7:0', 99)
    cell.bench.run_until(lambda: cell.word('N7:0') == 99)
    cell.run(0.1)
    assert cell.word('N7:0') == 7
