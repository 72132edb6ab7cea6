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

"""The commands that the simulator takes while it runs."""

from unittest.mock import Mock

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import LinkError
from abdf1_ros.pccc.diagnostics import STATUS_REQUEST
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import decode_identity, FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.simulator.commands import CommandError, execute
from abdf1_ros.simulator.ladder import Ladder
from abdf1_ros.simulator.simulated_plc import InjectedFaults, SimulatedPlc
import pytest
from support.clock import Clock
from support.driver_bench import simulated_plc


@pytest.fixture
def plcs() -> list[SimulatedPlc]:
    return [simulated_plc(station, 'SLC', lambda: 0.0, ('N7:0', 1)) for station in (1, 12)]


@pytest.mark.parametrize('line, faults, text', [
    ('silent 12', InjectedFaults(silent=True), 'station 12: silent'),
    ('full 12', InjectedFaults(full=True), 'station 12: full'),
    ('  slow   12  3 \n', InjectedFaults(slow=3), 'station 12: slow 3'),
    ('delay 12 50', InjectedFaults(delay=0.05), 'station 12: delay 50'),
    ('noise 12 0.01', InjectedFaults(noise=0.01), 'station 12: noise 0.01'),
    ('noise 12 0', InjectedFaults(), 'station 12: noise 0'),
    ('noise 12 1', InjectedFaults(noise=1.0), 'station 12: noise 1'),
    ('delay 12 3600000', InjectedFaults(delay=3600.0), 'station 12: delay 3600000'),
    ('error 12 50', InjectedFaults(status=(0x50,)), 'station 12: error 50'),
    ('error 12 F0 0b', InjectedFaults(status=(0xF0, 0x0B)), 'station 12: error F0 0b'),
    ('normal 12', InjectedFaults(), 'station 12: normal')])
def test_command_changes_the_faults_of_its_station_alone(
        plcs: list[SimulatedPlc], line: str, faults: InjectedFaults, text: str) -> None:
    plcs[1].faults = InjectedFaults(silent=True, slow=9)
    assert execute(line, plcs) == text
    assert plcs[1].faults == faults
    assert plcs[0].faults == InjectedFaults()


def test_counters_are_told(plcs: list[SimulatedPlc]) -> None:
    plcs[1].faults = faults = InjectedFaults(slow=9)
    plcs[1].counters.messages_sent, plcs[1].counters.chars_received = 3, 70
    name, _, counts = execute('counters 12', plcs).partition(': ')
    assert name == 'station 12'
    told = dict(word.split('=') for word in counts.split())
    assert {key: int(value) for key, value in told.items()} == plcs[1].counters.by_mnemonic()
    assert told['CNT_MSG_PACKETS_SENT'] == '3'
    assert plcs[1].faults is faults


@pytest.mark.parametrize('line, text', [
    ('silent', 'name a station (1, 12)'), ('silent 3', 'name a station (1, 12)'),
    ('silent one', 'name a station (1, 12)'), ('hush 1', '"hush 1" is not a command'),
    ('silent 1 2', '"silent 1 2" is not a command'), ('full 1 2', '"full 1 2" is not a command'),
    ('counters 1 2', '"counters 1 2" is not a command'),
    ('slow 1', '"slow 1" is not a command'),
    *((f'slow 1 {text}', f'slow 1 {text}: "{text}" should be a whole number from 0')
      for text in ('few', '-3', '1.5', '1_0', '\u0661')),
    ('delay 1', '"delay 1" is not a command'),
    *((f'delay 1 {text}', f'delay 1 {text}: "{text}" should be ms from 0 to 3600000')
      for text in ('long', '-5', 'nan', '1e9', '1_0')),
    *((f'noise 1 {text}', f'noise 1 {text}: "{text}" should be a share from 0 to 1')
      for text in ('much', '-0.1', '1.1', 'nan')),
    *((f'error 1 {text}', f'error 1 {text}: "{text}" should be a byte in hexadecimal such as 0B')
      for text in ('zz', '5', '500000', '\u0661\u0661')),
    ('msg 1 N7:0 70000', 'msg N7:0: value 70000 at index 0 is not a valid int16'),
    ('error 1', '"error 1" is not a command'), ('normal 1 x', '"normal 1 x" is not a command')])
def test_command_that_is_wrong_changes_nothing(
        plcs: list[SimulatedPlc], line: str, text: str) -> None:
    plcs[0].faults = before = InjectedFaults(slow=2)
    with pytest.raises(CommandError) as caught:
        execute(line, plcs, line.startswith('msg'))
    assert str(caught.value).startswith(text)
    assert plcs[0].faults is before


@pytest.mark.parametrize('line', ['hush 1', 'silent 3'])
def test_bad_command_is_told_the_commands_and_no_more(plcs: list[SimulatedPlc], line: str) -> None:
    with pytest.raises(CommandError) as caught:
        execute(line, plcs)
    lines = str(caught.value).split('\n')
    assert lines[1] == 'commands, on standard input or with --at:'
    assert lines[-1].split() == ['quit', 'end', 'the', 'simulator']


@pytest.mark.parametrize('setting', Setting)
def test_mode_is_told_by_the_diagnostic_status(plcs: list[SimulatedPlc], setting: Setting) -> None:
    plcs[1].faults = before = InjectedFaults(slow=9)
    assert execute(f'mode 12 {setting.value}', plcs) == f'station 12: mode {setting.value}'
    assert plcs[1].processor.setting is setting
    assert plcs[0].processor.setting is Setting.REMOTE
    assert plcs[1].faults is before  # a mode is no fault of the line
    status = plcs[1].serve(Packet(12, 5, 0x06, 0, 1, STATUS_REQUEST)).data
    assert decode_identity(status) == decode_identity(
        FAMILIES[PlcType.SLC].encode_identity(EmulatedProcessor(setting)))


def test_message_is_queued_and_its_end_reported(plcs: list[SimulatedPlc]) -> None:
    told: list[str] = []
    assert execute('msg 12 N7:0 5 -6', plcs, True, told.append) == 'station 12: msg N7:0 5 -6'
    assert told == []
    sending = plcs[1].outbox.pop()
    assert (sending.command.dst, sending.command.src) == (5, 12)
    sending.fail(error := LinkError())
    assert told == [f'station 12: msg N7:0 {error}']
    assert not plcs[0].outbox


@pytest.mark.parametrize(('verb', 'setting'), [
    ('program', Setting.PROGRAM), ('test', Setting.TEST), ('run', Setting.REMOTE)])
def test_modes_have_commands_of_their_own(
        verb: str, setting: Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    plc = simulated_plc(1, 'SLC', lambda: 0.0, ('N7:0', 4))
    monkeypatch.setattr(SimulatedPlc, 'set_mode', set_mode := Mock())  # it sets more than a word
    assert execute(f'{verb} 1', [plc]) == f'station 1: mode {setting.value}'
    set_mode.assert_called_once_with(setting)


def test_download_power_and_reset() -> None:
    plc = simulated_plc(1, 'SLC', lambda: 0.0, ('N7:0', 4))
    with pytest.raises(CommandError, match='no ladder; start with --ladder 1'):
        execute('reset 1', [plc])
    plc.run_ladder(Ladder(plc.table))
    for verb in ('reset', 'power', 'download'):
        assert execute(f'{verb} 1', [plc]) == f'station 1: {verb}'
    assert plc.processor.setting is Setting.PROGRAM


def test_scan_time_of_a_ladder() -> None:
    clock = Clock()
    plc = simulated_plc(1, 'SLC', clock, ('N7:0', 4))
    with pytest.raises(CommandError, match='no ladder; start with --ladder 1'):
        execute('scan 1 60', [plc])
    plc.run_ladder(Ladder(plc.table))
    assert plc.ladder is not None
    clock.now += 2.0
    assert execute('scan 1 60', [plc]) == 'station 1: scan 60'
    assert plc.ladder.get(11, 3) > 10  # the scans of before had their own time
    assert plc.ladder.scan_time == 0.06
    for text in ('0', '1001', 'fast'):
        with pytest.raises(CommandError, match=f'"{text}" should be ms from 1 to 1000'):
            execute(f'scan 1 {text}', [plc])
