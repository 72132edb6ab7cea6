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

"""The engine on a clock that the test moves, and messages that it gives out in portions."""

from collections.abc import Callable
from contextlib import nullcontext
import math
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import (
    ACK,
    Code,
    Control,
    Duplex,
    ENQ,
    EOT,
    Frame,
    FrameDecoder,
    master_frame,
    message_frame,
    NAK,
    STX,
    Symbol,
)
from abdf1_ros.df1.machine import (
    Background,
    Heard,
    LineTiming,
    Listen,
    LISTEN_ON,
    Machine,
    Procedure,
    Rest,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.outgoing import Outgoing
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import CommandExpired
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.virtual_line import Wire

FRAME = b'0123456789'
MESSAGE = message_frame(bytes(20), Checksum.CRC)
SAID_ACK, SAID_EOT = Control(Code.ACK), Control(Code.EOT)


class Bench:
    """A machine that carries out a list of steps and notes what each of them brought."""

    def __init__(self, *steps: Step, timing: LineTiming | None = None,
                 forget_on_send: bool = False, duplex: Duplex = Duplex.HALF,
                 start: float | None = 0.0, background: Background | None = None) -> None:
        self.got: list[Symbol | None] = []
        self.error: Exception | None = None
        self.machine = Machine(
            self._procedure, checksum=Checksum.CRC, duplex=duplex, timing=timing,
            forget_on_send=forget_on_send, background=background)
        self._steps = steps
        if start is not None:
            self.machine.start(start)

    def _procedure(self, machine: Machine) -> Procedure:
        assert machine is self.machine
        try:
            for step in self._steps:
                heard = yield step
                self.got.append(None if isinstance(heard, Silence) else heard)
        except OSError as error:
            self.error = error
            raise


def test_nothing_happens_before_start() -> None:
    bench = Bench(Send(FRAME, 1.0), start=None)
    bench.machine.receive_data(ACK, 1.0)
    bench.machine.handle_timeout(2.0)
    bench.machine.wake(3.0)
    assert (bench.got, bench.machine.data_to_send(), bench.machine.deadline) == ([], b'', None)


def test_line_time_never_runs_ahead_of_the_clock_where_the_line_is_faster_than_set() -> None:
    bench = Bench(*[Send(FRAME, 1.0)] * 101, timing=LineTiming(char_time=0.01))
    for count in range(1, 101):
        bench.machine.receive_data(EOT, 0.01 * count)
        assert bench.machine.deadline == pytest.approx(0.01 * count + 0.1 + 1.0)


def test_only_a_response_proves_in_full_duplex_that_a_frame_has_left() -> None:
    bench = Bench(*[Send(FRAME, 1.0)] * 5, timing=LineTiming(char_time=0.01), duplex=Duplex.FULL)
    # The other end sends messages whenever it likes.
    for heard, now, left in ((MESSAGE, 0.05, 0.1), (ENQ, 0.06, 0.2), (NAK, 0.07, 0.07),
                             (ACK, 0.08, 0.08)):
        bench.machine.data_to_send()
        bench.machine.receive_data(heard, now)
        assert bench.machine.deadline == pytest.approx(left + 0.1 + 1.0)


def test_response_proves_nothing_while_bytes_have_still_to_leave() -> None:
    for now, free in ((0.02, 0.05), (0.08, 0.1)):
        bench = Bench(Send(FRAME, 1.0), Listen(1.0), timing=LineTiming(char_time=0.01),
                      duplex=Duplex.FULL, start=None)
        bench.machine.start(0.0, Wire(bench.machine, unsent=lambda: 3))  # as fast as it is set
        bench.machine.data_to_send()
        bench.machine.receive_data(ACK, now)
        assert not bench.machine.sender.has_left(len(FRAME))
        assert bench.machine.sender.has_left(len(FRAME) - 3)
        assert bench.machine.deadline == pytest.approx(free + 1.0)


def test_timeout_ends_a_step_at_its_deadline_and_not_before() -> None:
    bench = Bench(Send(FRAME, 1.0), Listen(1.0))
    bench.machine.handle_timeout(0.999)
    assert (bench.got, bench.machine.now) == ([], 0.999)
    bench.machine.handle_timeout(1.0)
    assert bench.got == [None]
    assert bench.machine.deadline == 2.0


def test_frame_that_nothing_is_waited_for_is_sent_before_the_procedure_goes_on() -> None:
    bench = Bench(Send(ACK), Send(EOT), Send(FRAME, 1.0), start=None)
    sent: list[tuple[bytes, int]] = []
    bench.machine.start(0.0, Wire(bench.machine, lambda data: sent.append((data, len(bench.got)))))
    assert sent == [(ACK, 0), (EOT, 1)]
    assert bench.machine.data_to_send() == FRAME


def eot_on_ack(symbol: Symbol) -> bytes:
    """Answer an ACK."""
    return EOT if symbol is SAID_ACK else b''


def sends_of(bench: Bench) -> list[tuple[bytes, int]]:
    """Return a list that gets what is sent at once from now on, after so many symbols."""
    sent: list[tuple[bytes, int]] = []
    Wire(bench.machine, lambda data: sent.append((data, len(bench.got)))).attach(0.0)
    bench.machine.data_to_send()
    return sent


@pytest.mark.parametrize('step', [Send(FRAME, 1.0, reflex=eot_on_ack), Rest(1.0, eot_on_ack)])
def test_reflex_is_on_the_line_before_the_procedure_hears_of_the_symbol(step: Send | Rest) -> None:
    bench = Bench(step, Send(EOT, 1.0), timing=LineTiming(0.25))
    sent = sends_of(bench)
    machine = bench.machine
    machine.receive_data(ACK, 9.0)
    assert (sent, bench.got, machine.data_to_send()) == ([(EOT, 0)], [SAID_ACK], b'')
    assert machine.deadline == 9.0 + 2 * 0.25 + 1.0
    assert machine.counters.chars_sent == machine.sender.position == (
        12 if isinstance(step, Send) else 2)
    machine.receive_data(ACK, 9.5)
    assert sent == [(EOT, 0)]


@pytest.mark.parametrize(('tx_delay', 'heard'), [(0.0, EOT), (0.0, EOT + ACK), (0.5, ACK)])
def test_reflex_is_for_its_symbol_if_that_is_the_next_and_has_no_delay(
        tx_delay: float, heard: bytes) -> None:
    bench = Bench(Listen(1.0, reflex=eot_on_ack), LISTEN_ON, timing=LineTiming(tx_delay=tx_delay))
    sent = sends_of(bench)
    bench.machine.receive_data(heard, 0.5)
    assert (sent, bench.machine.data_to_send()) == ([], b'')


def test_reflex_does_not_overtake_what_still_has_to_go_out() -> None:
    bench = Bench(Listen(1.0), Send(FRAME, 1.0, reflex=eot_on_ack), Send(EOT), duplex=Duplex.FULL)
    sent = sends_of(bench)
    bench.machine.receive_data(ACK + ACK, 0.5)
    assert sent == [(FRAME + EOT, 2)]


def test_reflex_waits_for_the_rest_of_a_divided_message() -> None:
    def run(machine: Machine) -> Procedure:
        machine.sender.embeds = True
        yield Send(MESSAGE, 1.0, expires=30.0, reflex=eot_on_ack)
        yield Send(EOT, 1.0, expires=5.0)

    machine = Machine(run, checksum=Checksum.CRC, timing=LineTiming(0.01), duplex=Duplex.FULL)
    machine.start(0.0)
    sent = machine.data_to_send()
    assert machine.sender.still_here == len(MESSAGE) - len(sent) > 0
    assert machine.deadline == pytest.approx(0.01 * len(MESSAGE) + 1.0)
    machine.receive_data(ACK, 0.1)
    assert machine.sender.send_before == math.inf  # half a message is never taken back
    sent += machine.data_to_send()
    machine.handle_timeout(9.0)
    assert sent + machine.data_to_send() == MESSAGE + EOT
    machine.start(20.0)
    machine.stop(None, 20.0)  # nothing is left of the second message
    sender = machine.sender
    assert (machine.next_call, sender.still_here, sender.send_before) == (None, 0, math.inf)


def test_procedure_that_does_not_send_its_reflex_is_a_bug_until_the_next_start() -> None:
    for step, error in ((Send(NAK, 1.0), pytest.raises(AssertionError)),
                        (Rest(1.0), nullcontext())):
        bench = Bench(Send(FRAME, 1.0, reflex=eot_on_ack), step)
        bench.machine.data_to_send()
        with error:
            bench.machine.receive_data(ACK, 0.5)
        bench.machine.start(1.0)
        assert bench.machine.data_to_send() == FRAME


def test_nothing_is_sent_at_once_while_a_delay_passes() -> None:
    bench = Bench(Send(ACK), Send(EOT), Listen(0), Rest(1.0), timing=LineTiming(0.25, 0.5),
                  start=None)
    sent: list[bytes] = []
    bench.machine.start(0.0, Wire(bench.machine, sent.append))
    assert sent == []
    bench.machine.handle_timeout(0.5)
    assert (sent, bench.machine.deadline) == ([ACK], 1.5)  # it begins when the ACK has left
    bench.machine.handle_timeout(1.5)
    assert (sent, bench.got, bench.machine.deadline) == ([ACK, EOT], [None] * 3, 2.5)


def test_step_that_neither_sends_nor_waits_hears_what_is_here_already() -> None:
    bench = Bench(Rest(), Listen(0), Send(ACK), Listen(0), Listen(0))
    bench.machine.receive_data(ACK + EOT + EOT, 1.0)
    assert bench.got == [SAID_ACK, SAID_EOT, None, SAID_EOT, None]


def test_tx_delay_passes_before_each_transmission() -> None:
    bench = Bench(Send(FRAME, 1.0), Send(FRAME, 1.0), timing=LineTiming(tx_delay=0.25))
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (b'', 0.25)
    bench.machine.handle_timeout(0.2)
    assert (bench.machine.data_to_send(), bench.machine.counters.chars_sent) == (b'', 0)
    bench.machine.handle_timeout(0.25)
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (FRAME, 1.25)
    assert bench.machine.counters.chars_sent == 10
    bench.machine.receive_data(ACK, 0.5)
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (b'', 0.75)
    bench.machine.handle_timeout(0.75)
    assert (bench.machine.data_to_send(), bench.got) == (FRAME, [SAID_ACK])


def test_what_comes_during_a_delay_in_full_duplex_is_delivered_at_its_end() -> None:
    bench = Bench(Send(FRAME, 1.0), Listen(1.0), timing=LineTiming(tx_delay=0.25),
                  duplex=Duplex.FULL)
    for now in (0.1, 0.24):
        bench.machine.receive_data(ACK, now)
    assert bench.got == []
    bench.machine.handle_timeout(0.25)
    assert bench.got == [SAID_ACK, SAID_ACK]


@pytest.mark.parametrize(('tx_delay', 'delay', 'passes'), [
    (0.0, 0.25, 0.25), (0.5, 0.25, 0.5), (0.25, 0.5, 0.5)])
def test_longer_of_the_two_delays_counts(tx_delay: float, delay: float, passes: float) -> None:
    bench = Bench(Send(FRAME, 1.0, delay), timing=LineTiming(tx_delay=tx_delay))
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (b'', passes)


def test_what_was_heard_before_a_transmission_is_forgotten() -> None:
    bench = Bench(Send(FRAME, 1.0), Send(FRAME, 1.0), forget_on_send=True)
    assert bench.machine.data_to_send() == FRAME
    bench.machine.receive_data(ACK + EOT + NAK[:1], 0.5)
    assert bench.got == [SAID_ACK]
    assert bench.machine.data_to_send() == FRAME
    bench.machine.receive_data(NAK[1:], 0.6)
    assert bench.got == [SAID_ACK]


def test_what_has_come_before_a_frame_could_leave_is_no_answer_to_it() -> None:
    bench = Bench(Send(FRAME, 1.0), Send(FRAME, 1.0), forget_on_send=True)
    bench.machine.data_to_send()
    bench.machine.receive_data(b'\x55', 9.96)
    bench.machine.handle_timeout(10.0)  # after a pause of the process
    bench.machine.receive_data(EOT + b'\x10', 10.0)
    assert (bench.got, bench.machine.counters.eots_received) == ([None], 0)
    assert bench.machine.data_to_send() == FRAME
    bench.machine.receive_data(ACK, 10.04)
    assert bench.got == [None, SAID_ACK]


REPLY = Packet(1, 5, 0x0F, 0, 7).reply(bytes(94))  # with DLE STX, 102 bytes before DLE ETX


@for_all(('size', 'characters'), [
    (7, 0),  # of the header, a byte is missing
    (8, 78), (28, 58), (85, 1), (86, 0), (101, 0)])
def test_reply_of_known_size_need_not_be_looked_at_until_its_last_characters(
        size: int, characters: int) -> None:
    bench = Bench(Send(FRAME, 9.0, reply_size=94), Send(FRAME, 1.0),
                  timing=LineTiming(char_time=0.01))
    frame = message_frame(REPLY.encode(), Checksum.CRC)
    bench.machine.receive_data(frame[:size], 0.1 + 0.01 * size)  # as fast as the line goes
    assert bench.machine.spare_time == pytest.approx(0.01 * characters)
    bench.machine.receive_data(frame[size:], 2.0)
    assert isinstance(bench.got[0], Frame)
    assert bench.machine.spare_time == 0.0


def test_reply_is_looked_at_well_before_its_deadline() -> None:
    """Each byte puts that off: by 0.3 s at this speed."""
    bench = Bench(Send(FRAME, 0.2, reply_size=94), timing=LineTiming(char_time=0.01))
    bench.machine.receive_data(message_frame(REPLY.encode(), Checksum.CRC)[:8], 0.18)
    assert bench.machine.deadline == pytest.approx(0.48)
    assert bench.machine.spare_time == pytest.approx(0.15)


@pytest.mark.parametrize(('packet', 'reply_size'), [
    (REPLY, 0),  # a size that nobody knows
    (REPLY._replace(sts=0x10), 94),  # an error comes without data
    (REPLY._replace(cmd=0x0F), 94)])  # a command of the station's own
def test_any_other_message_is_heard_as_it_comes(packet: Packet, reply_size: int) -> None:
    bench = Bench(Send(FRAME, 1.0, reply_size=reply_size), timing=LineTiming(char_time=0.01))
    bench.machine.receive_data(message_frame(packet.encode(), Checksum.CRC)[:20], 0.5)
    assert bench.machine.receiver.decoder.in_message
    assert bench.machine.spare_time == 0.0


def test_silence_tells_what_was_heard_and_since_when() -> None:
    heard: list[Heard] = []

    def procedure(machine: Machine) -> Procedure:
        for _ in range(3):
            heard.append((yield Send(FRAME, 1.0)))

    machine = Machine(procedure, checksum=Checksum.CRC, timing=LineTiming(char_time=0.01))
    machine.start(0.0)
    machine.handle_timeout(1.1)
    machine.receive_data(b'\x55\x77', 1.5)
    machine.handle_timeout(2.2)
    machine.receive_data(STX, 3.25)
    machine.handle_timeout(3.55)
    assert [silence._replace(seconds=round(silence.seconds, 9)) for silence in heard
            if isinstance(silence, Silence)] == [
        Silence(0, False, math.inf), Silence(0x77, False, 0.7), Silence(0x02, True, 0.3)]


def test_listen_on_keeps_the_deadline() -> None:
    bench = Bench(Send(FRAME, 1.0), LISTEN_ON, LISTEN_ON, Listen(3.0))
    bench.machine.receive_data(NAK, 0.5)
    bench.machine.receive_data(EOT, 0.75)
    assert bench.machine.deadline == 1.0
    bench.machine.handle_timeout(1.0)
    assert bench.got == [Control(Code.NAK), SAID_EOT, None]


def test_answer_that_has_begun_extends_the_deadline() -> None:
    bench = Bench(Send(FRAME, 1.0), timing=LineTiming(char_time=0.01), forget_on_send=True)
    for number, byte in enumerate(MESSAGE):
        bench.machine.data_to_send()
        bench.machine.receive_data(bytes((byte,)), 0.9 + 0.04 * number)
        bench.machine.handle_timeout(0.9 + 0.04 * number)
    assert len(bench.got) == 1
    assert bench.got[0] is not None


@pytest.mark.parametrize('pause', [0.01, 0.08, 0.2])
def test_message_may_not_crawl_for_ever(pause: float) -> None:
    """A byte takes 0.01 s at the set speed; none of the pauses alone would end the message."""
    bench = Bench(Send(FRAME, 1.0), timing=LineTiming(char_time=0.01))
    now = 1.0
    bench.machine.receive_data(STX, now)
    while not bench.got and now < 99:
        now += pause
        bench.machine.handle_timeout(now)
        bench.machine.receive_data(bytes(1), now)
    assert bench.got == [None]
    longest = 0.6 / (1 - 0.04 / pause) if pause > 0.04 else 0.6 + 2 * 261 * 0.01
    assert longest - pause <= now - 1.0 < longest + 2 * pause


def test_message_that_begins_behind_the_time_limit_extends_nothing() -> None:
    bench = Bench(Send(FRAME, 1.0), LISTEN_ON, timing=LineTiming(char_time=0.01))
    bench.machine.receive_data(MESSAGE[:5], 1.0)
    bench.machine.receive_data(MESSAGE[5:], 1.2)  # heard out to its end
    assert isinstance(bench.got[0], Frame)
    deadline = bench.machine.deadline
    bench.machine.receive_data(MESSAGE[:5], 1.25)
    assert bench.machine.deadline == deadline


def test_pause_ends_an_answer_that_has_begun() -> None:
    bench = Bench(Send(FRAME, 1.0), timing=LineTiming(char_time=0.01))
    bench.machine.receive_data(MESSAGE[:5], 1.1)  # in time, just
    assert bench.machine.deadline == pytest.approx(1.1 + 20 * 0.01 + 0.1)
    bench.machine.handle_timeout(1.41)
    assert bench.got == [None]


@for_all(('broken', 'limit'), [
    (broken, limit) for broken in (b'\x10', b'\x10\x01', b'\x10\x05\x10', MESSAGE[:-1])
    for limit in (None, 9.0)])
@for_all(('pause', 'forgotten'), [(0.05, False), (0.31, True)])
def test_pause_ends_what_broke_off(broken: bytes, limit: float | None, pause: float,
                                   forgotten: bool) -> None:
    bench = Bench(*[Listen(limit)] * 3, timing=LineTiming(char_time=0.01))
    bench.machine.receive_data(broken, 1.0)
    bench.machine.receive_data(EOT, 1.0 + pause)
    is_heard_out = limit is not None and broken == MESSAGE[:-1]
    assert (bench.got[-1:] == [SAID_EOT]) is (
        forgotten and not is_heard_out or broken == b'\x10\x01')


def test_idle_master_counts_what_nobody_waits_for() -> None:
    reply, command = (message_frame(bytes((5, 1, cmd, 0, 1, 2)), Checksum.CRC)
                      for cmd in (0x4F, 0x0F))
    bench = Bench(Rest(10.0), Send(FRAME, 1.0), forget_on_send=True)
    bench.machine.receive_data(ACK + EOT + NAK + reply + command, 1.0)
    bench.machine.receive_data(reply[:-1] + bytes([reply[-1] ^ 1]), 2.0)
    bench.machine.receive_data(reply[:5], 3.0)  # does not begin what is heard later
    counters = bench.machine.counters
    assert (counters.acks_received, counters.eots_received, counters.naks_received) == (1, 1, 1)
    assert (counters.messages_received, counters.replies_received) == (2, 1)
    assert (counters.stale_messages, counters.crc_errors) == (1, 1)
    bench.machine.handle_timeout(10.0)
    assert bench.machine.data_to_send() == FRAME
    bench.machine.receive_data(EOT, 10.1)
    assert bench.got == [None, SAID_EOT]
    assert counters.eots_received == 1  # the master itself counts what it waits for


def test_wake_ends_a_rest() -> None:
    clockwork = Clockwork(math.inf)
    bench = Bench(Rest(10.0), Send(FRAME, 1.0), background=clockwork)
    clockwork.done = bench.got
    assert bench.machine.deadline == 10.0
    bench.machine.wake(3.0)
    assert bench.got == [3.0, None]  # what is new is looked at first
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (FRAME, 4.0)


@pytest.mark.parametrize('step', [Send(FRAME, 1.0), Listen(1.0), Send(FRAME, 1.0, 0.5)])
def test_wake_disturbs_no_transaction(step: Step) -> None:
    bench = Bench(step, background=(clockwork := Clockwork(math.inf)))
    deadline = bench.machine.deadline
    bench.machine.wake(0.25)
    assert (bench.got, bench.machine.deadline, clockwork.done) == ([], deadline, [0.25])


def test_stop_raises_its_error_inside_the_procedure() -> None:
    bench = Bench(Send(FRAME, 1.0))
    error = OSError('unplugged')
    bench.machine.stop(error, 0.5)
    assert bench.error is error
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (b'', None)
    bench.machine.receive_data(ACK, 1.0)
    assert bench.got == []


def test_start_begins_afresh() -> None:
    bench = Bench(Send(FRAME, 1.0), Send(FRAME, 1.0), timing=LineTiming(char_time=1.0))
    bench.machine.receive_data(ACK + b'\x10', 0.5)
    bench.machine.start(2.0)
    bench.machine.receive_data(b'\x06', 2.5)
    assert bench.got == [SAID_ACK]
    assert (bench.machine.data_to_send(), bench.machine.deadline) == (FRAME, 13.0)


@pytest.mark.parametrize('prepare', [
    lambda machine: machine.handle_timeout(0.0), lambda machine: machine.stop(None, 0.5)])
def test_characters_are_counted_in_both_directions(prepare: Callable[[Machine], None]) -> None:
    machine = Bench(Send(FRAME, None), Send(EOT, None), start=None).machine
    machine.start(0.0)
    assert machine.counters.chars_sent == 10
    machine.receive_data(ACK, 0.5)
    assert (machine.counters.chars_sent, machine.counters.chars_received) == (12, 2)
    prepare(machine)
    machine.receive_data(b'noise', 0.75)
    assert machine.counters.chars_received == 7


class Asked:
    """A procedure that sends a command which expires, and what it was told."""

    def __init__(self, expires: float, delay: float = 0.0) -> None:
        self.told: list[str] = []
        self._step = Send(FRAME, 1.0, delay, expires)
        self.machine = Machine(self.run, checksum=Checksum.CRC)

    def run(self, machine: Machine) -> Procedure:
        """Send until the command has expired."""
        try:
            while True:
                yield self._step
                self.told.append('silence')
        except CommandExpired:
            self.told.append('expired')
        yield Listen(0)
        yield Rest()


def test_command_that_has_expired_does_not_leave() -> None:
    asked = Asked(expires=4.0)
    asked.machine.start(5.0)
    assert (asked.told, asked.machine.data_to_send()) == (['expired'], b'')


def test_command_that_expires_before_its_repetition_is_not_repeated() -> None:
    asked = Asked(expires=5.5)
    asked.machine.start(5.0)
    assert asked.machine.data_to_send() == FRAME
    assert asked.machine.sender.send_before == math.inf  # it has gone out
    asked.machine.handle_timeout(6.0)
    assert (asked.told, asked.machine.data_to_send()) == (['silence', 'expired'], b'')


@pytest.mark.parametrize('embeds', [False, True])
def test_command_that_expires_before_it_is_given_to_the_port_is_taken_back(embeds: bool) -> None:
    told: list[str] = []

    def run(machine: Machine) -> Procedure:
        machine.sender.embeds = embeds
        yield Send(NAK)  # does not come back either
        try:
            yield Send(message_frame(bytes(200), Checksum.CRC), 1.0, expires=5.5)
        except CommandExpired:
            told.append('expired')
        told.append(type((yield Send(ACK, 1.0))).__name__)

    machine = Machine(run, checksum=Checksum.CRC, timing=LineTiming(0.01), duplex=Duplex.FULL)
    machine.start(5.0)
    assert machine.sender.send_before == 5.5
    machine.withdraw(6.0)
    assert (told, machine.data_to_send()) == (['expired'], NAK + ACK)
    assert machine.sender.send_before == math.inf
    sender = machine.sender
    assert (machine.counters.chars_sent, sender.position, sender.still_here) == (4, 4, 0)
    assert machine.next_call == pytest.approx(6.0 + 1.0 + 0.02)
    machine.handle_timeout(6.05)
    assert machine.data_to_send() == b''
    machine.receive_data(message_frame(bytes(200), Checksum.CRC), 6.1)  # not the echo of ours
    assert told == ['expired', 'Frame']


def test_command_that_is_taken_back_after_an_answer_to_another_ends_no_procedure() -> None:
    heard: list[Heard] = []

    def run(machine: Machine) -> Procedure:
        yield Rest()
        heard.append((yield Send(MESSAGE, 1.0, expires=5.5)))
        heard.append((yield Rest()))

    machine = Machine(run, checksum=Checksum.CRC, duplex=Duplex.FULL)
    machine.start(5.0)
    machine.receive_data(2 * ACK, 5.0)  # the second came before the command could leave
    machine.withdraw(9.0)
    assert machine.data_to_send() == b''
    machine.wake(9.0)
    assert heard == [Control.ACK, Silence()]


def test_lateness_is_what_the_machine_is_called_after_its_deadlines() -> None:
    bench = Bench(*4 * [Send(FRAME, 1.0)], Rest())
    bench.machine.handle_timeout(0.5)
    bench.machine.handle_timeout(1.25)
    bench.machine.receive_data(ACK, 2.0)
    assert bench.machine.late == 0.25
    bench.machine.handle_timeout(5.0)
    assert bench.machine.late == 2.25
    now = bench.machine.now
    took = [bench.machine.took(begun, begun + 5.0) for begun in (0.0, 1.25, now)]
    assert took == [2.75, 3.0, 5.0]  # two pauses, one, none
    inside = Bench(*2 * [Rest(1.0)], duplex=Duplex.FULL)
    inside.machine.receive_data(MESSAGE[:9], 0.5)
    inside.machine.handle_timeout(3.0)  # this message has stopped meanwhile
    assert (inside.machine.late, inside.machine.may_be_old) == (2.0, True)
    bench.machine.handle_timeout(6.125)  # no wait is exact
    assert bench.machine.late == 2.25


class Clockwork:
    """Something that has to be done at a time, whatever the line does."""

    def __init__(self, due: float) -> None:
        self.due = due
        self.done: list[Any] = []

    def expire(self, now: float) -> None:
        """Do it once."""
        self.done.append(now)
        self.due = math.inf

    def next_expiry(self) -> float:
        """Return when."""
        return self.due

    def ended(self, error: Exception | None) -> None:
        """Do nothing."""


@pytest.mark.parametrize('due, call', [(math.inf, 2.0), (1.5, 1.5), (3.0, 2.0)])
def test_background_has_its_time_while_a_step_waits(due: float, call: float) -> None:
    clockwork = Clockwork(due)
    bench = Bench(Send(FRAME, 1.0), Rest(), start=None, background=clockwork)
    bench.machine.start(1.0)
    assert bench.machine.next_call == call
    bench.machine.handle_timeout(1.75)
    assert clockwork.done == ([1.75] if due == 1.5 else [])
    assert bench.got == []


def test_rest_ends_with_work_of_the_background() -> None:
    """A message that has waited too long may have held up something that goes out at once."""
    for seconds in (5.0, None):
        bench = Bench(Rest(seconds), Send(FRAME, 1.0), start=None, background=Clockwork(1.5))
        bench.machine.start(1.0)
        bench.machine.handle_timeout(1.5)
        assert bench.machine.data_to_send() == FRAME


# echo


QUESTION = master_frame(3, bytes(8), Checksum.CRC)


def test_echo_of_an_ack_may_be_held_back_until_the_next_question() -> None:
    bench = Bench(Send(QUESTION, 1.0), Send(ACK), Rest(0.015), Send(QUESTION, 1.0),
                  forget_on_send=True, start=5.0)
    assert bench.machine.data_to_send() == QUESTION
    bench.machine.receive_data(QUESTION + EOT, 5.0)
    assert bench.machine.data_to_send() == ACK
    bench.machine.handle_timeout(5.015)
    assert bench.machine.data_to_send() == QUESTION
    bench.machine.receive_data(ACK + QUESTION + EOT, 6.0)
    assert bench.got == [SAID_EOT, None, None, SAID_EOT]


CHAR_TIME = 10 / 9600


def portions(frame: bytes, checksum: Checksum, response: bytes, at: int) -> list[bytes]:
    """Return what goes out of a message, with a response as soon as it may after ``at``."""
    outgoing = Outgoing(checksum, CHAR_TIME)
    said, now = [outgoing.put(frame, 0.0)], 0.0
    is_embedded = False
    while True:
        if len(said) > at and not is_embedded and outgoing.can_embed:
            said.append(response)
            is_embedded = True
        if outgoing.due is None:
            break
        assert outgoing.due >= now
        now = outgoing.due
        said.append(outgoing.next(now))
    assert outgoing.size == 0
    return said if is_embedded else [*said, response]


@given(st.lists(st.sampled_from((0x00, 0x03, 0x10, 0x55)), min_size=6, max_size=261),
       st.sampled_from(Checksum), st.sampled_from((ACK, NAK)), st.integers(0, 8))
def test_message_and_response_both_arrive(data: list[int], checksum: Checksum, response: bytes,
                                          at: int) -> None:
    decoder = FrameDecoder(checksum, Duplex.FULL)
    symbols: list[Symbol] = []
    for part in portions(message_frame(bytes(data), checksum), checksum, response, at):
        decoder.feed(part)
        symbols += iter(decoder.next_symbol, None)
    assert Frame in map(type, symbols)
    frame, = (symbol for symbol in symbols if isinstance(symbol, Frame))
    assert (frame.data, frame.fault) == (bytes(data), None)
    assert [symbol for symbol in symbols if isinstance(symbol, Control)] == [
        Control(response[1])]  # type: ignore[arg-type]
    assert decoder.noise == 0


@pytest.mark.parametrize('checksum', Checksum)
def test_line_never_waits_for_the_next_portion_nor_runs_far_ahead(checksum: Checksum) -> None:
    frame = message_frame(bytes(range(250)), checksum)
    outgoing = Outgoing(checksum, CHAR_TIME)
    busy_until = 5.0 + len(outgoing.put(frame, 5.0) + outgoing.put(frame, 5.0)) * CHAR_TIME
    assert busy_until < 5.04  # of the second frame, nothing goes out yet
    while outgoing.due is not None:
        now = outgoing.due
        assert 0.01 < busy_until - now < 0.02
        busy_until += len(outgoing.next(now)) * CHAR_TIME
        assert busy_until - now < 0.06
    assert (busy_until, outgoing.size) == (pytest.approx(5.0 + 2 * len(frame) * CHAR_TIME), 0)


def test_last_data_and_etx_with_its_check_are_not_divided() -> None:
    for size in range(6, 120):
        frame = message_frame(b'\x10' * size, Checksum.CRC)
        outgoing = Outgoing(Checksum.CRC, CHAR_TIME)
        last = outgoing.put(frame, 0.0)
        while outgoing.due is not None:
            last = outgoing.next(outgoing.due)
        assert last.endswith(frame[-6:])


@pytest.mark.parametrize('char_time', [0.0, 10 / 115200])
def test_message_that_is_gone_in_a_moment_goes_out_whole(char_time: float) -> None:
    frame = message_frame(bytes(200), Checksum.CRC)
    outgoing = Outgoing(Checksum.CRC, char_time)
    assert outgoing.put(frame, 0.0) == frame
    assert (outgoing.due, outgoing.can_embed) == (None, False)
