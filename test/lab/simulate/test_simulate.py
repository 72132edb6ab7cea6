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

"""A few new plants in each run, and that a seed replays one."""

from contextlib import nullcontext, suppress
from dataclasses import replace
import secrets
from typing import Any
from unittest import mock

from abdf1_ros.df1.frames import ACK, ENQ
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.settings.heartbeats import HAND_OVER, LONGEST_END
from abdf1_ros.settings.mapping import Command
import pytest
from simulate.mistakes import Mistake, MISTAKES
from simulate.rules import (
    Answers,
    Broken,
    Foreign,
    Fresh,
    GuestAges,
    OnTheWire,
    Order,
    ReadBack,
    Repeats,
    Results,
    Stands,
    Taken,
    View,
)
from simulate.run import simulate, Story
from simulate.steady import Steady
from support.cases import long_unless
from support.devices import DEVICES
from support.losses import Losses, Lost
from support.world import (
    BEAT,
    Executed,
    GUESTS,
    MODES,
    OTHERS,
    OUTPUTS,
    Plant,
    SAFE,
    Said,
    Sent,
    STEP,
    World,
)


@pytest.mark.parametrize('mode', long_unless(lambda mode: 'ateway' not in mode, zip(MODES)))
def test_a_new_plant_keeps_all_rules(mode: str) -> None:
    # A rule that does not hold names the seed: run.py --mode ... --turns 1 --plants 1 ...
    simulate(secrets.randbelow(10**9), lambda totals: totals.plants == 1, mode, 1,
             is_steady=mode in ('Message', 'Standard'))


@pytest.mark.parametrize('mode', long_unless(lambda mode: mode in ('Slave', 'Peer'), zip(MODES)))
def test_seed_replays_a_plant_to_the_byte(mode: str) -> None:
    def bytes_of_a_run() -> str:
        story = Story(1, mode)
        story.wait(4.0)
        return story.world.wire.hexdigest()

    assert bytes_of_a_run() == bytes_of_a_run()


def test_line_full_of_beats_recovers_one_row_after_another(
        monkeypatch: pytest.MonkeyPatch) -> None:
    full = Plant('Radio', stations=3, rows=3, after=600, period=500, baud=9600, retries=1)
    monkeypatch.setattr(Plant, 'drawn', lambda dice, mode: full)
    Story(4, turns=1, is_steady=False).run()


def test_message_of_a_peer_that_is_damaged_ends_where_it_ended() -> None:
    losses = Losses(Lost('Peer', lost=1.0, lose_replies=False), lambda: 0.0)
    losses.is_due = True
    said = bytes.fromhex('10 02 01 C8 0F 00 42 01 A2 02 0A 89 00 00 10 03')
    assert losses.hear(said) == said[:-3] + b'\1' + said[-2:]


def test_plc_need_not_be_known_that_a_master_still_has_as_inactive() -> None:
    world = World(Plant('Slave'), seed=1)
    rule = View(world)
    world.run(6.0)
    rule.stand()
    assert world.master and world.driver.stations[1].replies_in_time
    world.driver.stations[1].overdue = 2  # it answers for the PLC, and that is no reply of it
    with pytest.raises(Broken):
        rule.stand()
    world.master.stations.lost(1, world.line.now)
    rule.stand()


@pytest.mark.parametrize('counter', ['polls_sent', 'acks_sent', 'messages_sent', 'chars_sent'])
@pytest.mark.parametrize('much', [2, -1])
def test_counter_that_is_not_what_is_on_the_wire_is_found(counter: str, much: int) -> None:
    world = World(Plant('Message'), seed=1)
    rule = OnTheWire(world)
    for _ in range(20):
        world.run(STEP)
        rule.stand()
    setattr(world.driver.counters, counter, getattr(world.driver.counters, counter) + much)
    with pytest.raises(Broken):
        for _ in range(20):
            world.run(STEP)
            rule.stand()


def test_command_of_a_guest_that_is_too_old_is_found() -> None:
    world = World(Plant('Message'), seed=1)
    rule = GuestAges(world)
    world.asked_at[GUESTS[0]] = 10.0
    rule.sent(Sent(10.4, 1, 'free_1', GUESTS[0], is_again=False))
    rule.sent(Sent(12.0, 1, 'free_1', GUESTS[0], is_again=True))
    with pytest.raises(Broken):
        rule.sent(Sent(10.6, 1, 'free_1', GUESTS[0], is_again=False))


def test_message_that_a_master_passes_on_is_none_of_ours() -> None:
    world = World(Plant('Message'), seed=1)
    device, = (each for each in DEVICES if each.name == 'messages_before_the_reply')
    world.behave_oddly(device)
    world.run(4.0)
    assert world.driver.counters.commands_received > 4
    assert {entry.tag for entry in world.sent} <= {*world.rows}


@pytest.mark.parametrize('mode', ['Standard', 'Slave'])
def test_long_reply_shows_before_timeout_that_it_comes(mode: str) -> None:
    world = World(Plant(mode, baud=4800), seed=1)
    assert max(world.line.chunks) * world.line.char_time < world.network.timeout / 1000


def test_plc_that_has_replies_left_need_not_take_the_first_zero() -> None:
    world = World(Plant('Peer', rows=3, baud=38400), seed=1)
    rule = Order(world)
    world.run(4.0)
    world.break_wire()
    world.run(0.1)
    world.end()
    world.mend()
    world.begin()
    count = len(world.executed)
    world.run(2.0)
    assert world.executed[count].tag == 'w0_1'  # it answered the 0 with NAK
    for entry in world.executed[count:]:
        rule.executed(entry)
    world.heard_again = 0.0
    with pytest.raises(Broken):
        for entry in world.executed[count:]:
            Order(world).executed(entry)


def test_responses_that_go_out_together_are_no_command() -> None:
    world = World(Plant('Peer'), seed=1)
    world.run(2.0)
    count = len(world.sent)
    world.line.send(ENQ + 4 * ACK, world.line.now, 1)
    assert len(world.sent) == count


def test_value_that_is_not_what_the_plc_answered_last_is_found() -> None:
    world = World(Plant('Message', held=21), seed=1)
    world.run(20.0)
    rule = Answers(world)
    held = [entry for entry in world.reads if entry[1].tag == 'held_1']
    for when, row, values in held:  # they are judged after an end, which may take seconds
        kept = [int(value) for value in values]
        rule.read(when, row.tag, 1, kept)
    for late, wrong in ((0.0, [kept[0] ^ 1, *kept[1:]]), (0.0, kept[1:]), (9.0, kept)):
        with pytest.raises(Broken):
            rule.read(when + late, row.tag, 1, wrong)


def test_finding_of_a_read_that_is_not_true_is_found() -> None:
    world = World(Plant('Message', held=21), seed=1)
    world.run(4.0)
    world.plcs[1].swallows_replies = True
    world.publish(world.rows['w0_1'])
    world.run(0.9)
    world.mend()
    world.run(3.0)
    result = next(each for each in world.results if each.outcome is Outcome.UNKNOWN)
    assert result.detail.endswith('read back: the PLC holds the value')
    rule = ReadBack(world)
    entry, = {each.value: each for each in world.sent if each.tag == 'w0_1'
              and each.value == 1}.values()
    rule.sent(entry)
    rule.told(result)
    with pytest.raises(Broken):
        rule.told(replace(result, detail='read back: the PLC holds another value'))
    told = world.published['w0_1', 1] + result.latency
    rule.sent(entry._replace(when=told - 0.001))
    with pytest.raises(Broken):
        rule.told(result)


def _left_out() -> tuple[World, Executed, WriteResult]:
    """Return a world in which an equal message was left out, the word, and the result."""
    again: dict[str, Any] = {'command': Command.READ_WRITE, 'write_again': 900, 'period': 100}
    world = World(Plant('Peer', rows=1, baud=38400, after=2000), 1, lambda rows: [
        replace(row, **again) if row.tag == 'w0_1' else row for row in rows])
    world.run(1.0)
    world.publish(world.rows['w0_1'])
    world.run(0.5)
    world.publish(world.rows['w0_1'], is_equal=True)
    world.run(STEP)
    written, result = world.results[-2:]
    assert (written.outcome, result.outcome) == (Outcome.WRITTEN, Outcome.STANDS)
    return world, next(entry for entry in world.executed if entry.value == 1), result


@pytest.mark.parametrize(('seconds', 'value', 'is_right'), [
    (0.0, 1, True), (2.2, 1, False), (0.0, OTHERS, True), (0.9, OTHERS, True),
    (1.1, OTHERS, False)])
def test_value_that_is_left_out_too_long_after_it_stood_is_found(
        seconds: float, value: int, is_right: bool) -> None:
    world, entry, result = _left_out()
    rule = Stands(world)
    rule.executed(entry)
    rule.stand()
    world.plcs[1].set(OUTPUTS, value)
    world.run(seconds)
    if value == 1:
        rule.stand()
    with nullcontext() if is_right else pytest.raises(Broken):
        rule.told(result)


def test_value_that_is_left_out_after_a_guest_or_before_its_write_is_found() -> None:
    world, entry, result = _left_out()
    for last in ((), (entry, replace(entry, value=GUESTS[0]))):
        rule = Stands(world)
        for each in last:
            rule.executed(each)
        rule.stand()
        with pytest.raises(Broken):
            rule.told(result)


def test_equal_message_that_is_executed_or_written_too_often_is_found() -> None:
    world, entry, result = _left_out()
    rule = Results(world)
    rule.executed(entry)
    rule.executed(entry)  # of two messages
    with pytest.raises(Broken):
        rule.executed(entry)
    rule = Results(world)
    rule.executed(entry)
    rule.stand()
    rule.told(replace(result, outcome=Outcome.WRITTEN))
    rule = Results(world)
    with pytest.raises(Broken):
        rule.told(replace(result, outcome=Outcome.WRITTEN))


def test_command_that_is_executed_twice_is_found() -> None:
    world = World(Plant('Peer'), seed=1)
    rule = Repeats(world)
    world.run(4.0)
    rule.stand()
    world.commands.append(world.commands[-1])
    with pytest.raises(Broken):
        rule.stand()


def test_what_a_master_writes_is_taken_once() -> None:
    world = World(Plant('Slave', baud=38400), seed=1)
    rule = Taken(world)
    world.run(8.0)
    taken = [(when, [int(value) for value in values]) for when, row, values in world.reads
             if row.tag == 'taken']
    for when, values in taken:
        rule.read(when, 'taken', 200, values)
    rule.stand()
    assert len(taken) > 1 and {said.sts for said in world.taken
                               if isinstance(said, Said) and not said.is_right} - {0, None}
    with pytest.raises(Broken):
        rule.read(*taken[-1][:1], 'taken', 200, taken[-1][1])
    world.taken.append((taken[-1][1][0], 3))
    with pytest.raises(Broken):
        rule.stand()


def test_reload_may_bring_other_lengths() -> None:
    world = World(Plant('Message', held=21), seed=1)
    world.run(3.0)
    lengths = set()
    for _ in range(6):
        world.end()
        world.begin()
        count = len(world.reads)
        world.run(4.0)
        found = {len(values) for _, row, values in world.reads[count:] if row.tag == 'held_1'}
        assert found == {world.rows['held_1'].length}
        lengths |= found
    assert lengths == {10, 21}


def test_reload_replaces_driver_and_rows_and_keeps_what_may_land() -> None:
    world = World(Plant('Gateway', requires=800), seed=1)
    world.run(3.0)
    before, row = world.driver, world.rows['w0_1']
    world.publish(row)
    world.run(0.1)
    world.wind_down(HAND_OVER)
    assert (world.plcs[1].word(OUTPUTS), world.plcs[1].word(BEAT)) == (SAFE, 0)
    world.holds = 1.0
    world.run(0.6)  # the fallback is not due again, and 0 is not sent
    world.reload()
    world.mend()
    assert world.driver is not before and world.rows['w0_1'] is not row
    assert world.process == 0 and world.drivers == 1
    world.run(3.0)
    world.publish(world.rows['w0_1'])
    world.run(0.3)
    assert world.results[-1].outcome is Outcome.WRITTEN


def test_own_late_value_that_is_told_as_foreign_is_found() -> None:
    world = World(Plant('Gateway'), seed=1)
    world.run(2.0)
    rule, now = Foreign(world), world.line.now
    world.executed.append(Executed(now, 1, 'beat_1', 780, 0, 0, is_late=True))
    world.listener.foreign.append((now, '5 was read where 0 was written', False))
    rule.stand()
    world.listener.foreign.append((now, '780 was read where 0 was written', False))
    with pytest.raises(Broken):
        rule.stand()


@pytest.mark.parametrize('seconds', [0.5, 9.0])
def test_end_without_the_port_is_safe_or_names_what_is_not(seconds: float) -> None:
    story = Story(1, 'Message')
    world = story.world
    row = next(row for row in world.messages if row.tag == 'w0_1')
    story.wait(3.0)
    world.publish(row)
    world.run(0.3)
    world.unplug_for(seconds)
    world.end()
    named = world.driver.kernel.end.unconfirmed(world.line.now)
    assert ('w0_1' in named) is (seconds > LONGEST_END)
    assert (world.plcs[1].word(OUTPUTS) == SAFE) is (seconds < LONGEST_END)


def test_value_that_no_read_has_shown_does_not_stand() -> None:
    steady = Steady(104)
    assert not steady.fault()
    steady.rows['word'] = replace(steady.rows['word'], write_again=60_000)
    now, wanted = steady.held['word'][-1][0] + 0.2, steady.held['word'][-1][1]
    steady.shown['word'] = [(now - 0.1, wanted)]
    assert steady.why_unproven('word', wanted, now) == ''
    steady.shown['word'] = [(now - 9.0, wanted)]  # before it was confirmed
    assert steady.why_unproven('word', wanted, now).startswith('no read has shown it')
    assert 'another value' in steady.why_unproven('word', b'[9]', now)


def test_row_that_is_staler_than_promised_beside_odd_rows_is_found() -> None:
    world = World(Plant('Message'), seed=1)
    rule = Fresh(world)
    world.damage_rows(['counter_1'])
    world.run(20.0)
    world.odd_known = world.line.now
    count = len(world.reads)
    for _ in range(200):
        world.run(STEP)
        for when, row, _ in world.reads[count:]:
            rule.read(when, row.tag, 1, [])
        count = len(world.reads)
        rule.stand()
    assert 'counter_1' not in {row.tag for when, row, _ in world.reads if when > 1.0}
    world.fall_silent(1)
    with pytest.raises(Broken):
        for _ in range(200):
            world.run(STEP)
            rule.stand()


@pytest.mark.parametrize('mistake', MISTAKES)
def test_plant_with_a_mistake_begins(mistake: Mistake) -> None:
    with mock.patch.object(mistake.owner, mistake.name,
                           mistake.make(getattr(mistake.owner, mistake.name))), suppress(Broken):
        for mode in 'Message', 'Slave':  # a Slave serves rows with Fallback
            Story(1, mode).wait(0.5)
