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

"""What is said to read, write and identify, one request and reply after the other, also long."""

from collections.abc import Sequence
from functools import partial
from itertools import product

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.packets import carry_out, REWRITTEN
from abdf1_ros.errors import CommandTimeout, LinkError, PortLost, RemoteError, StationInactive
from abdf1_ros.pccc.dialect import Request, Steps
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.slc.dialect import SlcDialect
from abdf1_ros.pccc.steps import identify, words_in
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench
from support.mappings import make_mapping

STATUS = bytes.fromhex('00ee34490535 2f3033202020202020200000060000001000'.replace(' ', ''))


def reply(data: bytes = b'', sts: int = 0) -> Packet:
    return Packet(5, 1, 0x4F, sts, 1, data)


def converse(steps: Steps[object],
             answers: Sequence[Packet | LinkError]) -> tuple[list[Request], object]:
    """Return the requests of steps that get these answers, and their result."""
    requests = [next(steps)]
    for answer in answers:
        try:
            requests.append(steps.throw(answer) if isinstance(answer, LinkError)
                            else steps.send(answer))
        except StopIteration as end:
            return requests, end.value
    raise AssertionError(f'it wants more: {requests}')


def unsent() -> LinkError:
    error = CommandTimeout()
    error.sent = False
    return error


@for_all(('answers', 'outcome'), [
    ([reply(), reply()], Outcome.WRITTEN),
    ([reply(sts=0x10)], Outcome.FAILED),
    ([reply(sts=0x02)], Outcome.UNKNOWN),  # a node on the way has lost it, or its reply
    ([CommandTimeout()], Outcome.UNKNOWN),
    ([unsent()], Outcome.NOT_SENT),
    ([reply(), CommandTimeout()], Outcome.PARTLY),
    ([reply(), reply(sts=0x10)], Outcome.PARTLY)])
def test_write_of_two_packets(answers: list[Packet | LinkError], outcome: Outcome) -> None:
    write = Write(make_mapping('N7:0', 'Write', plc='SLC', length=130), [7] * 130, 0.0)
    requests, result = converse(carry_out(write), answers)
    assert isinstance(result, WriteResult)
    assert requests == write.commands[:len(requests)]
    assert result.outcome is outcome
    assert (result.error is None) is (outcome is Outcome.WRITTEN)
    assert ('(after 1 of 2 packets were written)' in result.detail) is (outcome is Outcome.PARTLY)


@pytest.mark.parametrize('answers, outcome', [
    ([reply(), reply()], Outcome.WRITTEN), ([CommandTimeout(), reply()], Outcome.PARTLY),
    ([CommandTimeout(), CommandTimeout()], Outcome.UNKNOWN),
    ([reply(sts=0x10), CommandTimeout()], Outcome.UNKNOWN),  # the second may still land
    ([CommandTimeout(), reply(sts=0x10)], Outcome.UNKNOWN),
    ([reply(sts=0x10), reply()], Outcome.PARTLY),
    ([StationInactive(1), reply()], Outcome.PARTLY), ([PortLost('gone')], Outcome.UNKNOWN)])
def test_own_write_sends_each_packet(answers: list[Packet | LinkError], outcome: Outcome) -> None:
    mapping = make_mapping('N7:0', 'Write', plc='SLC', length=130)
    write = Write(mapping, [7] * 130, 0.0, is_own=True)
    requests, result = converse(carry_out(write), answers)
    assert isinstance(result, WriteResult)
    assert requests == write.commands[:len(answers)]
    assert result.outcome is outcome


@for_all(('answers', 'is_unconfirmed'), [
    ([reply(), reply()], False), ([reply(sts=0x10)], False), ([unsent()], False),
    ([reply(), reply(sts=0x10)], False), ([reply(), unsent()], False),
    ([reply(sts=0x02)], True), ([CommandTimeout()], True), ([reply(), CommandTimeout()], True)])
def test_what_a_read_has_to_show(answers: list[Packet | LinkError], is_unconfirmed: bool) -> None:
    write = Write(make_mapping('N7:0', 'Write', plc='SLC', length=130), [7] * 130, 0.0)
    _, result = converse(carry_out(write), answers)
    assert isinstance(result, WriteResult)
    assert result.is_unconfirmed is is_unconfirmed


def test_broadcast_is_confirmed_by_nobody() -> None:
    write = Write(make_mapping('N7:0', 'Write', station=255), [7], 0.0)
    _, result = converse(carry_out(write), [reply()])
    assert result == write.result(Outcome.BROADCAST)


def bit_write(processor: str | None = '5/01') -> Write:
    mapping = make_mapping('B3:4/8', 'Write', plc='SLC', length=2, processor=processor)
    return Write(mapping, [1, 0], 0.0)


REFUSED = reply(sts=0x10)
READ = (0x0F, bytes.fromhex('A2 02 03 85 04 00'))


def test_refused_bits_are_written_by_reading_their_word_and_writing_it_back() -> None:
    write = bit_write()
    requests, result = converse(carry_out(write), [REFUSED, reply(b'\xFF\xFE'), reply()])
    assert requests == [*write.commands, READ, (0x0F, bytes.fromhex('AA 02 03 85 04 00 FF FD'))]
    assert result == write.result(Outcome.WRITTEN, REWRITTEN)
    assert 'a change that the PLC made in between is lost' in REWRITTEN


@pytest.mark.parametrize('processor, sts', [(None, 0x10), ('5/03', 0x10), ('5/01', 0x50)])
def test_other_refusals_of_bits_stay_failures(processor: str | None, sts: int) -> None:
    requests, result = converse(carry_out(bit_write(processor)), [reply(sts=sts)])
    assert isinstance(result, WriteResult)
    assert (len(requests), result.outcome) == (1, Outcome.FAILED)


@for_all(('answers', 'outcome'), [
    ([reply(sts=0x50)], Outcome.FAILED), ([reply(sts=0x02)], Outcome.FAILED),
    ([reply(b'\1')], Outcome.FAILED), ([CommandTimeout()], Outcome.NOT_SENT),
    ([reply(b'\1\2'), reply(sts=0x10)], Outcome.FAILED),
    ([reply(b'\1\2'), reply(sts=0x02)], Outcome.UNKNOWN),
    ([reply(b'\1\2'), CommandTimeout()], Outcome.UNKNOWN),
    ([reply(b'\1\2'), unsent()], Outcome.NOT_SENT)])
def test_writing_back_that_fails(answers: list[Packet | LinkError], outcome: Outcome) -> None:
    _, result = converse(carry_out(bit_write()), [REFUSED, *answers])
    assert isinstance(result, WriteResult)
    assert result.outcome is outcome
    assert result.error is not None


def test_reason_for_a_word_that_cannot_be_read_names_both_refusals() -> None:
    _, result = converse(carry_out(bit_write()), [REFUSED, reply(sts=0x50)])
    assert isinstance(result, WriteResult)
    assert result.detail == (
        'STS 10: illegal command, format or length, or the file does not exist; its word '
        'cannot be read to be written back: '
        'STS 50: address not there, or memory protected')


def test_bits_of_two_words_of_which_one_fails_are_partly_written() -> None:
    mapping = make_mapping('B3:4/15', 'Write', plc='SLC', length=2, processor='ML1000')
    write = Write(mapping, [1, 1], 0.0)
    requests, result = converse(carry_out(write), [
        REFUSED, reply(b'\0\0'), reply(), REFUSED, CommandTimeout()])
    assert requests[3:] == [write.commands[1], (0x0F, bytes.fromhex('A2 02 03 85 05 00'))]
    assert isinstance(result, WriteResult)
    assert result.outcome is Outcome.PARTLY
    assert result.detail.endswith('(after 1 of 2 packets were written)')


def test_identity_is_asked_for_with_a_diagnostic_status() -> None:
    requests, identity = converse(identify(), [reply(STATUS)])
    assert requests == [(0x06, b'\x03')]
    assert str(identity).startswith('SLC 5/03')


FAULTED_PLC5 = bytes((0x0A, 0xEB, 0x15)).ljust(36, b'\0')
FAULT_WORDS = (0x0F, bytes.fromhex('68 00 00 02 00 06 02 0B 02 00'))


@pytest.mark.parametrize(('answer', 'fault'), [
    (reply(bytes.fromhex('95 09 42 00 01 58 00')),
     'major processor fault: watchdog; fault code 88 (S:12)'),
    (reply(b'\x06', 0xF0), 'major processor fault (word S:11 says which)'),
    (reply(b'\0'), 'major processor fault (word S:11 says which)')])
def test_plc5_with_a_fault_is_asked_which(answer: Packet, fault: str) -> None:
    requests, identity = converse(identify(), [reply(FAULTED_PLC5), answer])
    assert requests == [(0x06, b'\x03'), FAULT_WORDS]
    assert isinstance(identity, Identity)
    assert identity.faults == (fault,)


def test_refusal_of_a_long_read_names_the_setting_that_makes_it_shorter() -> None:
    for length, hint in ((42, True), (41, False)):
        with pytest.raises(RemoteError) as caught:
            words_in(reply(sts=0x10), parse_address('N7:0', PlcType.SLC), length, SlcDialect())
        assert str(caught.value).endswith('give its name as Processor') is hint


MODES = {'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
         'Radio': {'mode': 'Radio'}}
BAUDS = 300, 600, 1200, 2400, 4800, 9600, 19200, 38400
TIMES = [*product((100, 300), (500, 1000))]  # Timeout and Cmd_Timeout
LONGEST = 30.0  # s of line time
REPLY_RECEIVED = 2523


# Each mode and each speed meets all of these times in the first quarter of all lines.
@pytest.mark.parametrize('quarter', [
    0, *(pytest.param(number, marks=pytest.mark.long) for number in range(1, 4))])
@pytest.mark.parametrize('mode', MODES)
def test_long_replies_are_heard(mode: str, quarter: int) -> None:
    lines = enumerate(BAUDS, [*MODES].index(mode) + quarter)
    for (at, baud), words in product(lines, (10, 25, 40, 60, 80, 117)):
        timeout, cmd_timeout = TIMES[at % 4]
        if mode == 'Radio' and baud < 1200:  # "check" names packets longer than Cmd_Timeout
            cmd_timeout = 5000
        row = make_mapping('N7:0', length=words)
        bench = DriverBench([row], chunk=1, network=Network(
            baud=baud, timeout=timeout, cmd_timeout=cmd_timeout, enq_retries=0, nak_retries=0,
            **MODES[mode]))
        bench.plc(1, 'PLC5', ('N7:0', words))
        bench.run_until(partial(bench.listener.values, row), LONGEST)
        # By radio a PLC waits for a quiet line, maybe for longer than Cmd_Timeout.
        assert mode == 'Radio' or bench.listener.numbers() <= {REPLY_RECEIVED}
