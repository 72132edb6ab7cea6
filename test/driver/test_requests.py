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

"""Requests on a virtual line, one after the other; and what other threads hand to the link."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
import sys
import threading
from typing import Any

from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.radio import RADIO
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop, Responder
from abdf1_ros.df1.slave_link import SLAVE
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.requests import Requests
from abdf1_ros.errors import INTERNAL_ERROR, LinkError, PortLost, StationInactive
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.steps import echo, identify
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import simulated_plc
from support.virtual_line import VirtualLine

NETWORK = Network(baud=115200, timeout=200, nak_retries=2, enq_retries=2, cmd_timeout=500)
WRITE = 0x0F, bytes.fromhex('AA 02 07 89 00 00 34 12')


@dataclass
class Ends:
    """Who wants to know how requests end."""

    results: list[object] = field(default_factory=list)
    errors: list[Exception] = field(default_factory=list)

    def count(self) -> int:
        return len(self.results) + len(self.errors)


class Bench:
    """Requests at one end, an SLC that is station 1 at the other."""

    def __init__(self, absent: tuple[int, ...] = (), slave: Responder | None = None,
                 **options: bool) -> None:
        stations = ActiveStationList(absent)
        for number in absent:
            stations.lost(number, 0.0)
        self.requests = Requests(NETWORK.line_mode, NETWORK.line, stations, 7, **options)
        self.plc = simulated_plc(1, 'SLC', lambda: self.line.now, ('N7:0', 10))
        self.far = Machine(multidrop([slave or self.plc]), checksum=NETWORK.checksum)
        self.line = VirtualLine(self.requests.machine, self.far, baud=115200)
        self.ends = Ends()
        self.added = 0
        self.line.start()

    def add(self, station: int, steps: Steps[Any]) -> None:
        self.added += 1
        self.requests.add(station, steps, self.ends.results.append, self.ends.errors.append)

    def run(self) -> None:
        self.line.wake(self.requests.machine)
        self.line.run(lambda: self.ends.count() == self.added, 30.0)


def test_requests_are_carried_out_in_turn() -> None:
    bench = Bench()
    bench.add(1, identify())
    bench.add(1, echo(b'\1\2\3'))
    bench.run()
    identity, nothing = bench.ends.results
    assert str(identity).startswith('SLC')
    assert nothing is None
    assert bench.ends.errors == []
    assert bench.requests.counters.commands_sent == 2


def test_request_of_several_commands_is_not_interrupted() -> None:
    log = []

    def twice(name: str) -> Steps[None]:
        for number in range(2):
            yield diagnostics.CMD, bytes((diagnostics.ECHO,))
            log.append(f'{name}{number}')

    bench = Bench()
    bench.add(1, twice('a'))
    bench.add(1, twice('b'))
    bench.run()
    assert log == ['a0', 'a1', 'b0', 'b1']


def test_errors_end_only_their_own_request() -> None:
    def broken(at: int) -> Steps[None]:
        for _ in range(at):
            yield diagnostics.CMD, bytes((diagnostics.ECHO,))
        raise TypeError('a bug')

    bench = Bench(may_store=True)
    bench.add(9, identify())
    bench.add(1, broken(1))
    bench.add(1, broken(0))
    bench.add(1, (write for write in [WRITE]))
    bench.run()
    absent, *bugs = bench.ends.errors
    assert isinstance(absent, StationInactive)
    assert [str(bug) for bug in bugs] == ['a bug', 'a bug']
    assert bench.ends.results == [None]
    assert bench.requests.counters.commands_sent == 3  # no question, as the PLC has answered


@pytest.mark.parametrize(('may_store', 'commands'), [
    (True, [2, 1, 1, 2, 2]), (False, [1] * 5)])
def test_rule_26_port_that_may_store_gets_a_question_before_the_first_write_and_after_a_failure(
        may_store: bool, commands: list[int]) -> None:
    refuses = HalfDuplexSlave(LinkSettings(station=1), lambda command: command.reply(sts=0x10))
    bench, sent = Bench(slave=refuses, may_store=may_store), list[int]()
    for station in (1, 1, 9, 1, 1):
        if len(sent) == 4:
            bench.requests.machine.stop(PortLost('unplugged'), bench.line.now)
            bench.line.start()
        before = bench.requests.counters.commands_sent
        bench.add(station, (write for write in [WRITE]))
        bench.run()
        sent.append(bench.requests.counters.commands_sent - before)
    assert (sent, len(bench.ends.results)) == (commands, 4)


@pytest.mark.parametrize(('mode', 'cmd'), [
    (RADIO, diagnostics.CMD), (SLAVE, 0x0F)])  # the polls of a master show the connection
def test_rule_26_question_also_goes_before_the_next_packet_of_a_write(
        mode: LineMode, cmd: int) -> None:
    requests, ends = Requests(mode, NETWORK.line, ActiveStationList(), may_store=True), Ends()
    requests.add(1, (write for write in 2 * [WRITE]), ends.results.append, print)
    requests.add(2, echo(b''), ends.results.append, ends.errors.append)
    write, other = requests.next_task(0.0), requests.next_task(0.0)
    assert write and other
    write.reply(write.command.reply())
    other.fail(StationInactive(2))
    assert requests.next_task(0.0, (1,)) is None
    question = requests.next_task(0.0)
    assert question and (question.command.dst, question.command.cmd) == (1, cmd)


def test_present_station_gets_every_retry_and_an_absent_one_a_single_poll() -> None:
    bench = Bench()
    bench.add(9, identify())
    bench.run()
    assert bench.requests.counters.messages_sent == 3
    assert bench.requests.counters.polls_sent == 0

    bench = Bench(absent=(9, 1))
    bench.add(9, identify())
    bench.add(1, identify())
    bench.run()
    assert bench.requests.counters.messages_sent == 1  # to the one that has answered its poll
    assert len(bench.ends.results) == 1
    assert bench.requests.stations[1].active
    assert not bench.requests.stations[9].active


def test_lost_port_ends_all_requests() -> None:
    bench = Bench()
    bench.add(9, identify())
    bench.add(1, identify())
    bench.line.wake(bench.requests.machine)
    bench.line.run_for(0.1)
    bench.requests.machine.stop(PortLost('unplugged'), bench.line.now)
    first, second = bench.ends.errors
    assert str(first) == str(second) == 'port lost: unplugged'
    assert isinstance(first, LinkError) and first.sent
    assert isinstance(second, LinkError) and not second.sent

    bench.add(1, identify())  # nobody knows when the port comes back
    assert str(bench.ends.errors[2]) == 'port lost: unplugged'
    bench.line.start()
    bench.add(1, identify())
    bench.run()
    assert len(bench.ends.results) == 1
    bench.requests.close()
    bench.add(1, identify())
    assert str(bench.ends.errors[3]) == 'port lost: closed by this program'


def test_stray_reply_is_kept() -> None:
    bench = Bench(slave=HalfDuplexSlave(
        LinkSettings(station=1), lambda command: command.reply()._replace(src=9)))
    assert bench.requests.stray == ''
    bench.add(1, echo(b'x'))
    bench.run()
    assert str(bench.ends.errors[0]) == '2508 ERR_COMMAND_TIMEOUT: Command Timed Out'
    assert bench.requests.counters.naks_sent == 0  # others of a line in use would drop theirs
    assert bench.requests.stray == (
        '2510 ERR_WRONG_MESSAGE: Wrong Message Received Src:0x09, Dst:0x05, Tns:0x0008 '
        '[station 1]')


def test_request_without_a_command_ends_when_the_link_takes_commands() -> None:
    requests = Requests(PEER, Network(baud=115200).line, ActiveStationList())
    ends = Ends()
    nothing: Steps[None] = (step for step in ())
    requests.add(0, nothing, ends.results.append, ends.errors.append)
    requests.machine.start(0.0)
    requests.machine.handle_timeout(0.05)
    assert ends.count() == 0  # what comes now answers an earlier process
    requests.machine.handle_timeout(0.1)
    assert ends.results == [None]


def test_station_has_one_request_at_a_time_by_radio() -> None:
    """The second one took the place of the first, which then never ended."""
    requests = Requests(RADIO, replace(NETWORK.line, avoids_collisions=True),
                        ActiveStationList(), first_tns=7)
    machine, ends, now = requests.machine, Ends(), 0.0
    machine.start(now)
    for station in (1, 1, 2):
        requests.add(station, echo(b''), ends.results.append, ends.errors.append)
    machine.wake(now)
    asked = {machine.data_to_send()[2:3]}
    while ends.count() < 3 and now < 30.0:
        assert machine.next_call is not None
        now = max(now, machine.next_call)
        machine.handle_timeout(now)
        if not ends.count():
            asked.add(machine.data_to_send()[2:3])
    assert [type(error) for error in ends.errors] == [StationInactive] * 3
    assert {b'\x01', b'\x02'} <= asked  # another station does not wait for the first


@pytest.mark.parametrize('error', [PortLost('gone'), TypeError(INTERNAL_ERROR)])  # a bug
def test_request_that_waits_for_its_station_ends_with_the_port(error: Exception) -> None:
    requests = Requests(RADIO, replace(NETWORK.line, avoids_collisions=True),
                        ActiveStationList(), first_tns=7)
    ends = Ends()
    requests.machine.start(0.0)
    for _ in range(2):
        requests.add(1, echo(b''), ends.results.append, ends.errors.append)
    requests.machine.wake(0.0)
    requests.machine.stop(error, 0.5)
    requests.machine.start(1.0)
    assert [str(error) for error in ends.errors] == [f'port lost: {error.args[0]}'] * 2
    assert requests.machine.data_to_send() == b''


SENDERS, ITEMS = 4, 4000


class Emptied(deque[str]):
    """Items that another thread takes as soon as they come."""

    def append(self, item: str) -> None:
        """Keep nothing."""


@pytest.fixture
def restless() -> Iterator[None]:
    """Let threads take turns as often as Python can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_what_is_added_while_items_are_taken_comes_too() -> None:
    inbox: Inbox[int] = Inbox()
    inbox.put(0)
    seen = []
    for item in inbox.take():
        seen.append(item)
        if item < 3:
            inbox.put(item + 1)
    assert seen == [0, 1, 2, 3]


def test_closed_inbox_takes_nothing_and_gives_what_waited() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.put('a')
    assert list(inbox.close()) == ['a']
    assert not inbox.put('b')
    inbox.open()
    assert list(inbox.take()) == []
    assert inbox.put('c')
    assert list(inbox.take()) == ['c']
    inbox.close()
    inbox.items = Emptied()
    assert inbox.put('d')  # it was taken


def test_no_item_is_lost_or_taken_twice_under_stress(restless: None) -> None:
    inbox: Inbox[tuple[int, int]] = Inbox()
    accepted: list[list[tuple[int, int]]] = [[] for _ in range(SENDERS)]

    def send(sender: int) -> None:
        for number in range(ITEMS):
            item = sender, number
            if inbox.put(item):
                accepted[sender].append(item)

    senders = [threading.Thread(target=send, args=(number,)) for number in range(SENDERS)]
    for sender in senders:
        sender.start()
    taken: list[tuple[int, int]] = []
    while any(sender.is_alive() for sender in senders):
        taken += inbox.take()
        taken += inbox.close()  # the port is lost, and comes back
        inbox.open()
    taken += inbox.take()
    assert len(taken) == len(set(taken))
    for sender, items in enumerate(accepted):
        assert [item for item in taken if item[0] == sender] == items
