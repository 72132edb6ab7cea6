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

import secrets

from abdf1_ros.df1.frames import ACK, ENQ
import pytest
from simulate.mistakes import MISTAKES
from simulate.rules import Broken, GuestAges, OnTheWire, Order, View
from simulate.run import simulate, Story
from support.world import GUESTS, MODES, Plant, POLLED, Sent, STEP, World


@pytest.mark.parametrize('mode', MODES)
def test_a_new_plant_keeps_all_rules(mode: str) -> None:
    # A rule that does not hold names the seed: run.py --mode ... --turns ... --plants 1 ...
    simulate(secrets.randbelow(10**9), lambda totals: totals.plants == 1, mode,
             1 if mode in POLLED else 2)


@pytest.mark.parametrize('mode', MODES)
def test_seed_replays_a_plant_to_the_byte(mode: str) -> None:
    def bytes_of_a_run() -> str:
        story = Story(1, mode)
        story.wait(4.0)
        return story.world.wire.hexdigest()

    assert bytes_of_a_run() == bytes_of_a_run()


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
    world.reload()
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
    world.line._send(ENQ + 4 * ACK, world.line.now, 1)
    assert len(world.sent) == count


def test_mistakes_are_made_where_something_is() -> None:
    assert [mistake.text for mistake in MISTAKES if not hasattr(mistake.owner, mistake.name)] == []
