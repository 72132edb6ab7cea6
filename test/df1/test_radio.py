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

"""Radio modem nodes: what they send, take and drop, and what becomes of it on the air."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
import heapq
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, message_frame
from abdf1_ros.df1.machine import LineTiming, Machine
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.radio import MOST_UNDER_WAY, RADIO, RadioNode
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.errors import CommandExpired, PortLost, StationInactive
from abdf1_ros.messages import Event
import pytest
from support.multidrop import CommandTasks
from support.peers import CommandTask
from support.vectors import MESSAGES, Vector, vector
from support.virtual_line import char_time, VirtualLine, Wire

US, PLC, OTHER = 5, 1, 2
BAUD = 9600
CMD_TIMEOUT = 1.0
COMMAND = Packet(PLC, US, 0x0F, 0, 0x1034, b'\x68\x10\x02\x10')
THEIRS = Packet(US, PLC, 0x0F, 0, 0x7710, b'\x67\x01')


def framed(packet: Packet) -> bytes:
    """Return a packet as it stands on the line."""
    return message_frame(packet.encode(), Checksum.CRC)


class Node(CommandTasks):
    """A node with its machine, its commands, and what it has executed."""

    def __init__(self, settings: LinkSettings, clock: Callable[[], float], seed: int = 1) -> None:
        super().__init__(clock)
        self.settings = settings
        self.events: list[Event] = []
        self.most_under_way = 0
        self.executed: Counter[tuple[int, int]] = Counter()
        self.stations = ActiveStationList()
        self.machine = Machine(lambda machine: self.link.run(self), checksum=settings.checksum,
                               duplex=Duplex.FULL, timing=LineTiming(char_time(BAUD)))
        self.link = RadioNode(self.machine, replace(settings, seed=seed), self.stations,
                              self._serve, self.events.append)

    def _serve(self, command: Packet) -> Packet:
        self.executed[command.src, command.tns] += 1
        return command.reply(bytes((self.settings.station,)) + command.data)

    def next_task(self, now: float, busy: Container[int] = ()) -> CommandTask | None:
        """Return the next command for a station that is not busy; count those under way."""
        assert isinstance(busy, dict)
        task = super().next_task(now, busy)
        self.most_under_way = max(self.most_under_way, len(busy) + (task is not None))
        return task

    def numbers(self) -> list[int]:
        """Return the numbers of the events so far."""
        return [event.message.number for event in self.events]


class Bench(Node):
    """A node whose line says what the test tells it."""

    def __init__(self, **settings: object) -> None:
        self.now = 100.0
        super().__init__(LinkSettings(station=US, **settings), lambda: self.now)  # type: ignore
        self.stations.add((PLC, OTHER))
        self.machine.start(self.now)

    def begin(self, command: Packet) -> CommandTask:
        """Queue a command."""
        task = self.add(command)
        self.machine.wake(self.now)
        return task

    def hear(self, *data: bytes) -> None:
        """Let bytes come."""
        for part in data:
            self.machine.receive_data(part, self.now)

    def wait(self, seconds: float) -> list[bytes]:
        """Let time pass; return what goes out."""
        end, said = self.now + seconds, [data for data in [self.machine.data_to_send()] if data]
        while (call := self.machine.next_call) is not None and call <= end:
            self.now = max(self.now, call)
            self.machine.handle_timeout(self.now)
            if data := self.machine.data_to_send():
                said.append(data)
        self.now = end
        return said


def test_command_of_a_guest_without_reply_says_nothing_about_the_station(
        monkeypatch: pytest.MonkeyPatch) -> None:
    most: list[float] = []
    monkeypatch.setattr(Random, 'uniform', lambda self, low, high: most.append(high) or low)
    bench = Bench(nak_retries=5)
    task = bench.begin(COMMAND)
    task.blames = False
    assert bench.wait(30.0) == [framed(COMMAND)] * 6
    assert isinstance(task.result, StationInactive)
    assert [high / most[0] for high in most] == pytest.approx([1, 2, 4, 8, 8, 8])
    assert (bench.stations[PLC].active, bench.stations[PLC].unanswered) == (True, 0)
    assert bench.numbers() == [*5 * [2521], 2508, 2519]


def test_command_is_not_repeated_that_has_its_reply_before_the_line_is_quiet() -> None:
    bench = Bench()
    task = bench.begin(COMMAND)
    bench.hear(framed(COMMAND.reply()))  # to an earlier command
    assert bench.wait(0.3) == [framed(COMMAND)]
    while bench.machine.deadline and bench.machine.deadline - bench.now > 0.5:
        assert bench.wait(0.01) == []
    bench.now = bench.machine.deadline or 0.0
    bench.machine.handle_timeout(bench.now)
    assert task.result is None
    bench.hear(*2 * [framed(COMMAND.reply())])  # and a forwarded copy
    assert task.result == COMMAND.reply()
    assert bench.wait(60.0) == []
    counts = bench.machine.counters
    assert (counts.stale_messages, counts.duplicate_messages, counts.nak_retries) == (1, 1, 0)


def test_node_with_our_number_is_told_of_at_the_station_that_it_asks() -> None:
    bench, other = Bench(avoids_collisions=True), COMMAND._replace(dst=OTHER)
    bench.wait(11.0)  # until then it may be a packet of the last run
    task = bench.begin(COMMAND)
    bench.wait(0.3)
    bench.begin(other)
    assert bench.wait(0.06) == [framed(other)]  # it does not wait for a reply of the first
    bench.stations.lost(OTHER, bench.now)
    bench.hear(framed(other.reply(sts=0x02)))  # of a gateway
    bench.hear(*2 * [framed(COMMAND)])  # an echo, and a forwarded copy
    bench.hear(framed(COMMAND._replace(tns=9)), framed(COMMAND.reply()))
    assert (task.result, bench.stations[OTHER].active) == (COMMAND.reply(), False)
    bench.machine.start(bench.now)  # and just after the port was lost
    bench.hear(framed(COMMAND._replace(tns=9)))
    assert [(event.message.number, event.station) for event in bench.events] == [
        (2523, OTHER), (2510, PLC), (2523, PLC)]


def test_command_that_has_become_too_old_is_not_repeated() -> None:
    bench = Bench()
    task = bench.begin(COMMAND)
    task.expires = bench.now + 0.6
    assert len(bench.wait(30.0)) == 1
    assert isinstance(task.result, CommandExpired) and task.result.sent
    for dst in (PLC, BROADCAST):
        old = bench.add(COMMAND._replace(dst=dst, tns=8))
        old.expires = bench.now + 0.001
        bench.machine.wake(bench.now)
        assert bench.wait(30.0) == []
        assert isinstance(old.result, CommandExpired) and not (old.result.sent or old.sent)
    assert bench.machine.counters.commands_sent == bench.machine.counters.messages_sent == 1


def test_repetition_is_known_whatever_many_others_have_sent_since() -> None:
    bench = Bench()
    bench.hear(framed(THEIRS))
    for src in (PLC, 3):
        bench.wait(3.0)
        bench.hear(*(framed(THEIRS._replace(src=src, tns=tns)) for tns in range(30)))
    bench.wait(3.0)
    bench.hear(framed(THEIRS._replace(src=3)), framed(THEIRS))
    assert (bench.executed[PLC, THEIRS.tns], len(bench.executed)) == (1, 36)
    bench.wait(60.0)
    bench.hear(framed(THEIRS._replace(src=3)))
    assert bench.executed[3, THEIRS.tns] == 2


def test_sender_that_always_counts_zero_is_served_after_a_while() -> None:
    bench = Bench()
    for count in range(1, 64):
        bench.hear(framed(THEIRS._replace(tns=0)))
        bench.wait(1.0)
        assert bench.executed == {(PLC, 0): 1 + (count - 1) // 20}
    for data in (THEIRS.data, b'\x67\x02'):  # once more, and then another command
        bench.hear(framed(THEIRS._replace(tns=0, data=data)))
    assert bench.executed == {(PLC, 0): 5}
    for executed in (5, 6):  # at first it may be forwarded; then it is a new command
        bench.hear(framed(THEIRS._replace(tns=0)))
        assert bench.executed == {(PLC, 0): executed}
        bench.wait(3.0)


def test_command_that_may_have_waited_while_this_process_stood_still_has_to_come_again() -> None:
    bench = Bench()
    bench.now += 30.0
    bench.machine.handle_timeout(bench.now)
    for executed in (0, 0, 1):
        bench.hear(framed(THEIRS))
        assert (len(bench.wait(0.25)), len(bench.executed)) == (executed, executed)
    bench.machine.start(bench.now)  # and the other nodes, too
    bench.hear(framed(THEIRS), framed(THEIRS._replace(tns=9)))
    assert bench.executed[PLC, THEIRS.tns] == 2
    bench.machine.start(bench.now)  # replies do not outlive the port
    assert bench.wait(3.0) == []


def test_command_for_which_there_is_no_room_is_not_executed() -> None:
    for dst, executed in ((OTHER, 0), (7, 17), (US, 17)):
        bench = Bench(store_forward={PLC, OTHER}, also=(7,))
        commands = [framed(THEIRS._replace(dst=dst, tns=tns)) for tns in range(18)]
        bench.hear(*commands)
        assert (bench.machine.counters.refused_for_memory, len(bench.executed)) == (1, executed)
    bench.wait(10.0)
    bench.hear(commands[-1])
    assert bench.executed[PLC, 17] == 1


@pytest.mark.parametrize('unsent', [0, 3])
def test_what_has_not_left_when_the_port_is_lost_is_undelivered(unsent: int) -> None:
    bench = Bench()
    bench.begin(COMMAND)
    bench.wait(0.2)
    Wire(bench.machine, unsent=lambda: unsent).attach(bench.now)
    bench.machine.stop(PortLost('the line takes nothing'), bench.now)
    assert bench.machine.counters.unsent_messages == (unsent > 0)
    bench.machine.start(bench.now)
    bench.begin(COMMAND)
    assert bench.wait(0.2) == [framed(COMMAND)]


def test_line_that_is_not_quiet_is_waited_for_but_not_for_ever() -> None:
    for heard in (b'\x55' * 20, framed(COMMAND.reply()._replace(dst=OTHER))):
        bench = Bench()
        assert bench.machine.next_call == bench.now + 1.0  # to notice a pause of this process
        bench.begin(COMMAND)
        for _ in range(100):
            if bench.wait(0.03):
                break
            bench.hear(heard)
        assert 2.0 <= bench.now - 100.0 <= 2.2


def test_packet_is_sent_on_within_cmd_timeout_or_not_at_all() -> None:
    other = THEIRS._replace(dst=OTHER)
    for busy, said in ((0.9, [framed(other)]), (1.1, [])):
        bench = Bench(store_forward={PLC, OTHER})
        bench.hear(framed(other))
        end = bench.now + busy
        while bench.now < end - 0.1:
            bench.hear(b'\x55' * 20)
            assert bench.wait(0.03) == []
        assert bench.wait(3.0) == said
    for pause, said in ((5.0, []), (5.0, [framed(other)])):  # some always send the same
        bench.wait(pause)
        bench.hear(framed(other._replace(src=9)), framed(other))
        assert bench.wait(2.0) == said
    for numbers, said in ((range(19), []), ((19,), [framed(other)])):  # among the last 20 or not
        bench.hear(*(framed(other._replace(src=9, tns=tns)) for tns in numbers), framed(other))
        assert bench.wait(2.0) == said
    bench.now += 30.0  # this process stands still
    bench.machine.handle_timeout(bench.now)
    bench.hear(framed(other._replace(tns=9)))
    assert bench.wait(3.0) == []


@pytest.mark.parametrize('entry', [
    entry for entry in MESSAGES if entry.duplex is Duplex.RADIO], ids=lambda entry: entry.name)
def test_vectors_are_executed_answered_or_dropped_as_they_say(entry: Vector) -> None:
    bench = Bench(checksum=entry.checksum)
    bench.hear(entry.frame)
    replies = bench.wait(1.0)
    is_command = entry.valid and entry.header is not None and not entry.packet.is_reply
    assert sum(bench.executed.values()) == is_command
    assert len(replies) == (is_command and entry.packet.dst != BROADCAST)
    if entry.pair and is_command:  # up to the data
        assert replies[0][:8] == vector('radio_reply').frame[:8]
    bench.hear(entry.frame)
    assert bench.wait(1.0) == replies


# Many nodes on the air


@dataclass(slots=True)
class Signal:
    """What is on the air for one receiver."""

    begin: float
    end: float
    is_spoiled: bool = False

    def meets(self, begin: float, end: float) -> None:
        """Be spoiled by what is on the air at the same time."""
        self.is_spoiled |= self.begin < end and begin < self.end


class Part(bytes):
    """Bytes of a signal."""

    signal: Signal

    def __add__(self, other: bytes) -> bytes:
        """Stay what it is: nothing is handed over together."""
        assert not other
        return self


class Air(VirtualLine):
    """
    A line on which ``reach`` tells who hears whom; two signals at a time spoil each other.

    Nobody hears while he sends; with ``holds_back`` nobody sends while he hears. A share ``loss``
    of the signals is lost by itself.
    """

    def __init__(self, machines: Sequence[Machine], reach: Callable[[int, int], bool],
                 loss: float, seed: int, *, holds_back: bool = False) -> None:
        super().__init__(*machines, baud=BAUD, seed=seed)
        self._reach = reach
        self._loss = loss
        self._holds_back = holds_back
        self._signals: defaultdict[int, list[Signal]] = defaultdict(list)
        self.sent: list[bytes] = []
        for machine in machines:
            self._spoil(machine)

    def _spoil(self, machine: Machine) -> None:
        receive = machine.receive_data

        def receive_signal(data: bytes, now: float) -> None:
            assert isinstance(data, Part)
            receive(bytes(len(data)) if data.signal.is_spoiled else bytes(data), now)

        machine.receive_data = receive_signal  # type: ignore[method-assign]

    def _take(self, sender: int) -> None:
        data = self._machines[sender].data_to_send()
        self._look_at(sender)
        if not data:
            return
        self.sent.append(data)
        begin = max(self.now, self._free[sender])
        if self._holds_back:
            begin = max([begin, *(signal.end for signal in self._signals[sender])])
        end = self._free[sender] = begin + len(data) * self.char_time
        for receiver in range(len(self._machines)):
            if receiver == sender or self._reach(sender, receiver):
                signal = Signal(begin, end, self.random.random() < self._loss)
                for other in self._signals[receiver]:
                    other.meets(begin, end)
                    signal.meets(other.begin, other.end)
                self._signals[receiver] = [
                    other for other in self._signals[receiver] if other.end > self.now] + [signal]
                if receiver != sender:
                    self._arrive(data, signal, receiver)

    def _rest_for(self, receiver: int) -> bytes:
        return b''

    def _arrive(self, data: bytes, signal: Signal, receiver: int) -> None:
        """Let the first bytes be heard at once, so that others hold back, and the rest."""
        for first, last in ((0, 4), (4, len(data))):
            part = Part(data[first:last])
            part.signal = signal
            self._count += 1
            here = signal.begin + last * self.char_time
            heapq.heappush(self._arrivals, (here, self._count, receiver, part))


def chain(sender: int, receiver: int) -> bool:
    """Tell that only neighbours hear each other."""
    return abs(sender - receiver) == 1


def everybody(sender: int, receiver: int) -> bool:
    """Tell that all hear each other."""
    return True


@pytest.mark.parametrize('reach', [chain, everybody])
@pytest.mark.parametrize('count', [3, 5, 12])
@pytest.mark.parametrize('loss', [0.0, 0.2])
@pytest.mark.parametrize('avoids_collisions', [False, True])
@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.long)])
def test_nothing_is_executed_twice_nothing_is_wrong_and_everything_ends(
        reach: Callable[[int, int], bool], count: int, loss: float, avoids_collisions: bool,
        seed: int) -> None:
    most = MOST_UNDER_WAY if avoids_collisions else 1
    random = Random(f'{count} {loss} {seed}')
    retries = 3
    table = {*range(1, count + 1)} if reach is chain else set[int]()
    nodes = [Node(LinkSettings(station=number, nak_retries=retries, cmd_timeout=CMD_TIMEOUT,
                               store_forward=table, avoids_collisions=avoids_collisions),
                  lambda: air.now, seed + number) for number in range(1, count + 1)]
    holds_back = avoids_collisions and seed % 2 == 0  # or somebody has set what they cannot do
    air = Air([node.machine for node in nodes], reach, loss, seed, holds_back=holds_back)
    air.start()
    for node in nodes:
        numbers = [other for other in range(1, count + 1) if other != node.settings.station]
        node.stations.add(numbers)
    tasks: list[CommandTask] = []
    for number in range(20):
        if number % most == 0:
            air.run_for(random.uniform(0.0, 2.0))
            node = random.choice(nodes)
        dst = random.choice([other.settings.station for other in nodes if other is not node])
        command = Packet(dst, node.settings.station, 0x0F, 0, number, random.randbytes(8))
        tasks.append(node.add(command))
        air.wake(node.machine)
    air.run(lambda: all(task.result is not None for task in tasks), 600.0)
    air.run_for(30.0)
    executed = Counter[tuple[int, int]]()
    for node in nodes:
        executed += node.executed
    assert set(executed.values()) <= {1}
    assert {node.most_under_way for node in nodes} <= {*range(min(count, most + 1))}
    assert any(node.most_under_way > 1 for node in nodes) is (most > 1)
    good = 0
    for task in tasks:
        command = task.command
        if isinstance(task.result, Packet):
            good += 1
            assert task.result == command.reply(bytes((command.dst,)) + command.data)
            assert executed[command.src, command.tns] == 1
        # With more than 20 others in between, a node sends a repetition on as well.
        assert air.sent.count(framed(command)) <= count * (retries + 1)
        reply = command.reply(bytes((command.dst,)) + command.data)
        assert air.sent.count(framed(reply)) <= count * (retries + 1)
    if loss == 0.0 and (holds_back and reach is everybody or count == 3 and not avoids_collisions):
        assert good >= 15


@pytest.mark.parametrize('reach', [chain, everybody])
@pytest.mark.parametrize('avoids_collisions', [False, True])
@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.long)])
def test_transaction_ends_within_its_bound_whatever_the_others_send(
        reach: Callable[[int, int], bool], avoids_collisions: bool, seed: int) -> None:
    random, retries = Random(seed), 2
    table = {*range(1, 6)} if reach is chain else set[int]()
    settings = LinkSettings(
        timing=LineTiming(char_time(BAUD)), nak_retries=retries, cmd_timeout=CMD_TIMEOUT,
        store_forward=table, avoids_collisions=avoids_collisions)
    nodes = [Node(replace(settings, station=number), lambda: air.now, seed)
             for number in range(1, 6)]
    air = Air([node.machine for node in nodes], reach, 0.3, seed, holds_back=avoids_collisions)
    air.start()
    for node in nodes:
        node.stations.add(range(1, 6))
    ours = nodes[0]
    bound = RADIO.longest_transaction(settings)
    for tns in range(30):
        for src, node in enumerate(nodes[1:], 2):
            dst = random.choice([number for number in range(1, 6) if number != src])
            node.add(Packet(dst, src, 0x0F, 0, tns, random.randbytes(200)))
            air.wake(node.machine)
        task = ours.add(Packet(2, 1, 0x0F, 0, tns, random.randbytes(200)))
        ours.stations.heard(2, air.now)  # with all tries
        air.wake(ours.machine)
        air.run(lambda task=task: task.result is not None, 2 * bound)
        assert task.seconds <= bound
