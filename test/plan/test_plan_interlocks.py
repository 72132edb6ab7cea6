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

"""What heartbeats and fallbacks promise; the numbers in the names are those of the rules."""

from __future__ import annotations

from abdf1_ros.plan.forecast import line_model, longest_transaction
from abdf1_ros.plan.interlocks import bounds, guard_faults, own_load, remarks, write_time
from abdf1_ros.plan.planner import Planner
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, Heartbeat, PublishWhile
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.mappings import make_mapping

QUICK = Network(timeout=200, cmd_timeout=500, nak_retries=1, enq_retries=1, baud=19200)


def beat(period: int = 1000, tag: str = 'beat') -> Mapping:
    """Return a Heartbeat row."""
    return make_mapping('N10:0', 'Heartbeat', tag=tag, period=period, heartbeat=Heartbeat())


def speed(after: int = 3000, command: str = 'Write', station: int = 1) -> Mapping:
    """Return a row with Fallback."""
    return make_mapping('N7:0', command, tag='speed', station=station,
                        fallback=Fallback((0,), after))


@pytest.mark.parametrize('network, seconds', [
    (Network(), 9.0), (Network(timeout=300, cmd_timeout=500), 2.9), (QUICK, 1.3)])
def test_longest_transaction_is_that_of_the_settings(network: Network, seconds: float) -> None:
    assert longest_transaction(network) == pytest.approx(seconds)


def test_write_of_a_word_is_counted_by_its_frames() -> None:
    # DLE SOH STN DLE STX, 6 of the header, the body, DLE ETX CRC; ACK; poll; the reply, which is
    # its header only; ACK. Two answers of 10 ms.
    mapping = beat()
    size = len(mapping.dialect.write(mapping.address, bytes(2))[1])
    characters = 5 + 6 + size + 4 + 2 + 4 + 2 + 6 + 4 + 2
    assert write_time(QUICK, mapping, 0.01) == pytest.approx(characters * 10 / 19200 + 0.02)


def test_rule_16_bound_of_a_fallback() -> None:
    rows = [speed(), beat()]
    own = write_time(QUICK, rows[0])
    longest = 1.3 + max(own, write_time(QUICK, rows[1]))
    first, _ = bounds(QUICK, rows)
    assert first.seconds == pytest.approx(3.0 + longest + own)
    assert str(first).startswith('fallback of speed, station 1: written after 4')


def test_rule_16_standard_polling_adds_a_poll_scan_and_slave_has_no_bound() -> None:
    rows = [speed(), *(make_mapping('N7:9', station=station) for station in range(2, 12))]
    message, = bounds(QUICK, rows)
    standard, = bounds(Network(timeout=200, cmd_timeout=500, nak_retries=1, enq_retries=1,
                               baud=19200, polling='Standard'), rows)
    assert message.seconds and standard.seconds
    assert standard.seconds - message.seconds == pytest.approx(11 * (60 / 19200 + 0.01))
    slave, = bounds(Network(mode='Slave'), rows[:1])
    assert (slave.seconds, str(slave)) == (
        None, 'fallback of speed, station 1: no bound, its master decides')


def test_rule_16_fallback_of_our_own_table_needs_no_line() -> None:
    bound, = bounds(Network(), [speed(500, 'Serve', station=5)])
    assert bound.seconds == 0.5


@pytest.mark.parametrize('period, factor', [(100, None), (60_000, 3)])
def test_rule_16_preset_of_the_timer(period: int, factor: int | None) -> None:
    mapping = beat(period)
    bound, = bounds(QUICK, [mapping], 0.01)
    own = write_time(QUICK, mapping, 0.01)
    longer = period / 1000 + 2 * (1.3 + own) + own + 0.01
    assert bound.seconds == pytest.approx(factor * period / 1000 if factor else longer)
    assert str(bound).startswith('heartbeat beat, station 1: PLC timer preset ')


def test_rule_16_warnings() -> None:
    slow = list(remarks(Network(), [beat(), speed()]))
    assert len(slow) == 2
    assert 'one transaction may take 90' in slow[0]
    assert 'its Period is 1000 ms' in slow[0]
    assert 'Fallback_After 3000 ms is shorter than two transactions' in slow[1]
    assert list(remarks(QUICK, [beat(2000), speed()])) == []


def test_rule_14_timeout_is_three_planned_intervals() -> None:
    counter = make_mapping('N11:3', tag='alive', period=100)
    guarded = make_mapping('N7:0', tag='level', period=1000,
                           publish_while=PublishWhile('alive', 250))
    (mapping, text), = guard_faults([counter, guarded], Planner(line_model(QUICK), 0.1))
    assert mapping is guarded
    assert text == ('Heartbeat_Timeout 250 ms is shorter than 3 reads of alive on this line; '
                    '300 ms would do')


def test_heartbeats_and_questions_for_run_are_counted_in_the_load() -> None:
    plain = make_mapping('N7:0', period=1000)
    guarded = make_mapping('N7:0', period=1000, publish_while=PublishWhile(None, None))
    assert own_load(QUICK, [plain], 0.1) == 0
    often, seldom = own_load(QUICK, [beat(100)], 0.1), own_load(QUICK, [beat(1000)], 0.1)
    assert often - seldom == pytest.approx(9 * write_time(QUICK, beat()))
    assert 0.02 < own_load(QUICK, [guarded], 0.1) < 0.1
    assert make_report(QUICK, [guarded], 0.1).load > make_report(QUICK, [plain], 0.1).load
