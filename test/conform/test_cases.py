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

"""Every case passes against our own link."""

from functools import cache

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import CaseResult, Permission, run_cases, Target, Verdict
from abdf1_ros.conform.cases import CASES
from abdf1_ros.conform.codec import BlockCheck
from abdf1_ros.conform.ends import MasterEnd
from abdf1_ros.conform.wire import Wire
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.describe import effect_of
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all, long_unless
from support.conformance import failures, plc_of, results_of
from support.conversations import Conversation, CONVERSATIONS
from support.driver_bench import Recorder
from support.mappings import make_mapping
from support.scripted_line import ScriptedLine

CHECKS = ['BCC', 'CRC']
ASKING = {Target.MASTER: 'Master', Target.CLIENT: 'Peer', Target.RADIO_CLIENT: 'Radio'}


def asking(check: str, mode: str, polling: str = 'Message',
           stations: tuple[int, ...] = (1,)) -> ScriptedLine:
    """Return a line with a driver at its end that reads the stations all the time."""
    network = Network(mode=mode, polling=polling, error_code=check, baud=115200, timeout=300,
                      cmd_timeout=2000, station=5)
    listener = Recorder(lambda: 0.0)
    rows = [make_mapping('N7:0', length=2, period=0, station=station) for station in stations]
    driver = Driver(network, rows, DriverSettings(
        processor_period=0, max_outstanding=len(stations)), listener)
    return ScriptedLine(driver.machine)


def _needed(result: CaseResult, target: Target) -> Permission:
    """Return the permission that the bytes sent by a case need."""
    sent = [bytes.fromhex(line.partition(' we ')[2]) for line in result.transcript
            if ' we ' in line]
    for raw in sent:
        body = raw.partition(b'\x10\x02')[2].rpartition(b'\x10\x03')[0]
        if len(body) > codec.HEADER_SIZE \
                and effect_of(Packet.decode(body.replace(b'\x10\x10', b'\x10'))) is Effect.WRITES:
            return Permission.WRITE
    return Permission.RESET if target.is_half_duplex and codec.NAK in sent else Permission.NOTHING


@pytest.mark.parametrize('check', CHECKS)
@pytest.mark.parametrize('family', ['SLC', 'PLC5'])
@pytest.mark.parametrize('target', [Target.SLAVE, Target.PEER, Target.RADIO])
def test_simulated_plc_conforms(target: Target, family: str, check: str) -> None:
    results = results_of(ScriptedLine(plc_of(target, check, family)), target, check, family)
    assert failures(results) == []
    assert [result.case.name for result in results
            if result.verdict is not Verdict.SKIP
            and result.case.permission is not _needed(result, target)] == []
    skipped = {result.case.name for result in results if result.verdict is Verdict.SKIP}
    assert skipped <= {
        'poll-stuffing', 'crc-covers-station', 'address-forms', 'address-forms-agree'}


@pytest.mark.parametrize('target, mode, polling, check', long_unless(
    lambda target, mode, polling, check: (polling, check) != ('Standard', 'BCC'),
    [(*line, check) for check in CHECKS for line in (
        *((*asked, 'Message') for asked in ASKING.items()),
        (Target.MASTER, 'Master', 'Standard'))]))
def test_our_driver_passes_every_case(
        target: Target, mode: str, polling: str, check: str) -> None:
    results = results_of(asking(check, mode, polling), target, check)
    assert failures(results) == []
    left_open = [result.case.name for result in results if result.verdict is not Verdict.PASS]
    # It ends the command as failed at once (2505).
    assert left_open == ['other-code-not-used']


def test_two_commands_under_way_are_no_fault() -> None:
    results = results_of(asking('CRC', 'Peer', stations=(1, 2)), Target.CLIENT, 'CRC')
    assert failures(results) == []
    assert [result.case.name for result in results if result.verdict is Verdict.SKIP] == [
        'other-reply-ignored', 'other-code-not-used', 'bad-reply-not-used']


@cache
def passed(target: Target) -> dict[str, str]:
    """Return the cases that our link passes, with their sources."""
    line = asking('CRC', ASKING[target]) if target in ASKING \
        else ScriptedLine(plc_of(target, 'CRC'))
    return {result.case.name: result.case.source for result in results_of(line, target, 'CRC')
            if result.verdict is Verdict.PASS}


@for_all('conversation', [entry for entry in CONVERSATIONS if 'case' in entry.entry])
def test_case_of_a_conversation_is_there_and_passes(conversation: Conversation) -> None:
    target, _, name = conversation.entry['case'].partition(' ')
    assert passed(Target(target))[name] == conversation.entry['source']


@for_all('name', ['read-words', 'write-and-read'])
@for_all(('family', 'outcome'), [
    ('SLC', (Verdict.FAIL, 'STS 00', 'STS 10')),
    ('', (Verdict.SKIP, '', 'needs --family PLC5 or SLC'))])
def test_other_family_refuses(family: str, outcome: tuple[Verdict, str, str], name: str) -> None:
    """A PLC-5 does not know the commands of an SLC, and says so."""
    line = ScriptedLine(plc_of(Target.SLAVE, 'CRC', 'PLC5'))
    result, = results_of(line, Target.SLAVE, 'CRC', family, only=name)
    assert (result.verdict, result.expected, result.got) == outcome


def test_case_that_needs_leave_or_comes_too_late_is_skipped() -> None:
    line = ScriptedLine(plc_of(Target.SLAVE, 'CRC'))
    wire = Wire(line, BlockCheck.CRC, line.clock, is_half_duplex=True)
    case, end = next(case for case in CASES if case.name == 'nak-resets'), MasterEnd(wire, 1, 5, 1)
    result, = run_cases([case], wire, end, frozenset((Permission.NOTHING,)))
    assert (result.verdict, result.got[:11]) == (Verdict.SKIP, 'needs --yes')
    assert line.read(600.0) == b''  # the target is asked for its identity before
    results = run_cases(2 * [case], wire, end, frozenset(Permission))
    assert [result.got for result in results] == 2 * ['not tried: the run has taken too long']


def test_every_case_cites_its_source() -> None:
    names = [(case.name, target) for case in CASES for target in case.targets]
    assert len({*names}) == len(names)
    assert {target: sum(target in case.targets for case in CASES) for target in Target} == {
        Target.SLAVE: 41, Target.MASTER: 21, Target.PEER: 39, Target.CLIENT: 25,
        Target.RADIO: 33, Target.RADIO_CLIENT: 16}
    assert all(case.source.startswith(('M ', 'KF2 ', 'SLC ', 'ML11 ')) for case in CASES)
