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

"""Every rule of vectors/conversations.json, played with a link of its mode, and single faults."""

from dataclasses import replace
from random import Random
import secrets

from abdf1_ros.df1 import radio
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.modes import mode_of
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
import pytest
from support.cases import for_all, long_unless
from support.conversations import (
    begun_again,
    Conversation,
    CONVERSATIONS,
    expected,
    played,
    Player,
)
from support.single_faults import CHECKS, Fault, KINDS, MODES, Tally


@for_all('conversation', CONVERSATIONS)
def test_node_does_exactly_what_the_conversation_says(conversation: Conversation) -> None:
    player = Player(conversation)
    player.play()
    assert player.story() == expected(conversation)
    assert player.numbers() == [tuple(message) for message in conversation.entry['messages']]
    assert player.counts() == conversation.entry['counters']
    counters = player.machine.counters
    assert (counters.chars_sent, counters.chars_received) == (
        conversation.size_of('we'), conversation.size_of('they'))


def test_node_keeps_nothing_of_an_earlier_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    # the pauses of a radio are drawn, and a poll list goes on where it was
    monkeypatch.setattr(radio.Random, 'uniform', lambda self, low, high: (low + high) / 2)
    for conversation in (each for each in CONVERSATIONS if not each.mode.takes_turns):
        for cut in (-(-len(conversation.lines) // 2), len(conversation.lines)):
            again = begun_again(conversation, cut)
            nodes = Player(again), Player(again, is_new=True)
            for node in nodes:
                node.play()
            assert nodes[0].done == nodes[1].done, (again.name, cut)


def test_station_keeps_what_was_heard_of_it() -> None:
    station = played('master_transaction').stations[17]
    assert (station.replies, station.last_tns, station.last_heard) == (1, 0x0102, 100.0)
    station = played('peer_transaction_2').stations[1]
    assert (station.replies, station.last_tns, station.last_heard) == (1, 0x1034, 100.3)
    station = played('slave_asks').stations[8]
    assert (station.replies, station.last_heard) == (1, 101.0)


def test_replies_that_are_late_in_a_row_are_counted_until_one_is_not() -> None:
    assert played('master_timeout_1').stations[17].overdue == 1
    assert played('master_timeouts').stations[17].overdue == 0


def test_gateway_and_the_station_behind_it_are_two() -> None:
    stations = played('master_gateway').stations
    assert (stations[99].replies, stations[17].replies) == (1, 0)
    stations = played('master_gateway_status').stations
    assert stations[17].last_heard is not None
    assert stations[99].last_heard is None


@for_all(('mode', 'times'), [  # computed by hand
    (('Master', 'Message'), (0.0, 10.65, 1.25, 7.5, 4.254, 0.274, 18.09, 9.504)),
    (('Master', 'Standard'), (0.0, 123.01, 8.512, 7.5, 5.762, 0.274, 138.45, 16.012)),
    (('Peer', ''), (0.0, 12.25, 1.25, 10.35, 4.554, 0.274, 18.19, 10.104)),
    (('Radio', ''), (0.187, 41.025, 2.145, 0.0, 9.561, 2.187, 26.57, 17.0))])
def test_times_of_a_mode_are_those_of_its_settings(
        mode: tuple[str, str], times: tuple[float, ...]) -> None:
    line = LinkSettings(timing=LineTiming(0.001, 0.25), nak_retries=4, enq_retries=2, timeout=0.5,
                        cmd_timeout=2.0, polling=PollingSettings((1,), in_sequence=True))
    of = mode_of(*mode)
    other = replace(line, nak_retries=1, timeout=3.0, polling=None, avoids_collisions=True)
    assert times == pytest.approx((
        of.pause(line), of.longest_transaction(line, 1.0, 3.0, 2),
        of.undisturbed(line, 1.0, 0.125, 3.0, 2), of.longest_reply(line, 1.0),
        of.last_tries(line, [1.0, 2.0], 0.25), of.longest_probe(replace(line, timeout=0.01)),
        of.longest_transaction(other, 1.0, 3.0, 2), of.last_tries(other, 5 * [1.0], 0.25)))


# Faults of one byte, or of two, in every mode, check and kind of transaction: a sample


# Of each kind of transaction; idle polls make a case of these modes many times as long.
CASES = dict.fromkeys(MODES, 5) | {'Standard': 1, 'Slave': 1}


@pytest.mark.parametrize('mode', long_unless(lambda mode: mode != 'Slave', zip(MODES)))
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
