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

"""The age of a message by clocks that are ahead, are set, or stand still with their process."""

from abdf1_ros.ages import Ages, HostClock, most_ahead, RecentMax
from abdf1_ros.errors import FormatError
from abdf1_ros.settings.heartbeats import Fallback, While
import pytest
from support.cases import for_all
from support.mappings import make_mapping

NEVER_SET = 1000.0  # how far the clock of the host is ahead of that of the line


class Host:
    """A host that takes messages of one topic, 0.5 s of age at most."""

    def __init__(self, allowed: float | None = 0.125, patience: float = 0.5) -> None:
        self.host_clock = HostClock(patience)
        self.ages = Ages(patience, self.host_clock, allowed)
        self.now, self.set_by = 0.0, 0.0

    def run(self, seconds: float) -> None:
        """Let time pass while the process runs."""
        end = self.now + seconds
        while self.now < end:
            self.host_clock.look(self.now, self.now + NEVER_SET + self.set_by)
            self.now = min(end, self.now + 0.1)

    def take(self, published: float, lead: float = 0.0) -> float | str:
        """Take a message of a publisher whose clock is ahead; return its age, or a reason."""
        wall = self.now + NEVER_SET + self.set_by
        try:
            return round(self.ages.of([wall, published + NEVER_SET + lead], wall, self.now), 3)
        except FormatError as error:
            return str(error).partition(';')[0]


AHEAD = ('time stamps of this topic were 1.90 s ahead of the clock here, 0.125 s are allowed '
         'where a fallback value or a heartbeat depends on it')


def test_age_is_that_of_the_stamp_and_never_below_nothing() -> None:
    host = Host()
    host.run(1.0)
    assert (host.ages.is_ahead, host.take(0.7)) == (False, 0.3)
    assert (host.take(1.0, lead=0.125), host.ages.is_ahead) == (0.0, False)
    assert host.take(0.5) == 'it came 0.5 s after it was published, write_timeout is 0.5 s'
    assert (str(host.take(1.0, lead=0.15))[:11], host.ages.is_ahead) == ('time stamps', True)


def test_clock_that_is_ahead_is_refused_also_when_its_messages_come_late() -> None:
    """Else a message of 2.1 s looked like one of 0.2 s, after the fallback."""
    host = Host()
    host.run(10.0)
    assert host.take(10.0, lead=1.9) == AHEAD
    host.run(30.0)  # without a message
    assert host.take(37.9, lead=1.9) == AHEAD
    host.run(4.9)
    assert host.take(host.now) == AHEAD  # its clock was set
    host.run(0.2)
    assert host.take(host.now) == 0.0
    assert not host.ages.is_ahead


@pytest.mark.parametrize('lead', [0.05, 1.95])
def test_message_that_came_while_the_process_stood_still_is_as_old_as_that(lead: float) -> None:
    host = Host()
    host.run(1.0)
    host.now += 2.0
    assert str(host.take(1.1, lead))[:9] in ('it came 1', 'it came 2')
    host.run(0.6)
    assert host.take(host.now) == 0.0


def test_message_of_a_short_standstill_counts_from_its_begin() -> None:
    host_clock = HostClock(0.5)
    for now, age in ((1.0, 0.0), (1.25, 0.0), (2.0, 0.75), (2.25, 0.75), (2.5, 0.0), (3.0, 0.5)):
        assert host_clock.least_age(now) == age


def test_shorter_standstill_does_not_hide_a_longer_one_before() -> None:
    host_clock = HostClock(0.5)
    for now, age in ((1.0, 0.0), (6.0, 5.0), (6.125, 5.0), (6.5, 5.0), (6.75, 5.0), (6.875, 0.375),
                     (7.0, 0.0)):
        assert host_clock.least_age(now) == age


def test_clock_here_that_is_set_back_makes_no_message_younger() -> None:
    host = Host()
    host.run(2.0)  # without a message
    host.set_by = -0.9
    host.run(0.4)
    # Published on this host before that, with a stamp of the clock before.
    assert host.take(host.now - 1.0).startswith('it came 1.0 s')
    host.run(1.0)  # without a message, so the clock before is forgotten
    assert host.take(host.now, lead=-0.9) == 0.0


def test_clock_here_that_is_set_forward_makes_no_message_younger() -> None:
    host = Host()
    host.run(1.0)
    assert host.take(1.0) == 0.0
    host.set_by = 0.9
    assert str(host.take(1.0)).startswith('it came 0.9 s')
    assert host.take(1.0, lead=0.9) == 0.0  # published after it


def test_rows_without_a_fallback_take_what_is_not_ahead_by_more_than_write_timeout() -> None:
    host = Host(allowed=None, patience=2.0)
    host.run(1.0)
    assert host.take(1.0, lead=2.0) == 0.0
    assert host.ages.is_ahead
    assert host.take(1.0, lead=2.5) == \
        'its time stamp is 2.5 s ahead of the clock here, write_timeout is 2 s'
    host.now += 1.0  # the process stood still
    assert host.take(1.5) == 0.5  # no other message has a guessed age


@for_all(('topic', 'expected'), [
    ('free', None), ('short', 0.05), ('long', 0.2), ('needed', 0.125)])
def test_what_is_allowed_is_a_quarter_of_the_time_that_depends_on_it(
        topic: str, expected: float | None) -> None:
    rows = [make_mapping('N7:0', 'Write', topic='free'),
            make_mapping(condition=While(('free',), 9)),
            make_mapping('N7:1', 'Write', topic='short', fallback=Fallback((0,), 200)),
            make_mapping('N7:2', 'Write', topic='long', fallback=Fallback((0,), 60_000)),
            make_mapping('N7:3', 'Write', topic='needed', fallback=Fallback((0,), 60_000)),
            make_mapping('N7:4', 'Heartbeat', condition=While(('needed',), 500))]
    assert most_ahead(topic, rows) == expected


def test_greatest_number_is_forgotten_by_newer_ones_only() -> None:
    recent = RecentMax(5.0)
    assert [recent.add(number, now) for number, now in (
        (3.0, 0.0), (1.0, 4.0), (1.0, 100.0), (0.0, 104.9), (0.0, 105.0), (0.0, 110.0))] == [
        3.0, 3.0, 3.0, 3.0, 1.0, 0.0]
