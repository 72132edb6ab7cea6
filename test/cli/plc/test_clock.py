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

"""The clock of simulated PLCs: shown, set, and what stands in the way."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
import re
import time
from types import SimpleNamespace
from typing import cast
from unittest.mock import Mock

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.plc.verbs.clock import Clock, told
from abdf1_ros.errors import FormatError, PortLost
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import for_all
from support.commands import call, Output
from support.driver_bench import simulated_plc, store, stored
from support.plc_line import plc_line

WORDS = {1: 'S:37', 2: 'S:18'}


@pytest.fixture
def plcs() -> tuple[SimulatedPlc, ...]:
    return (simulated_plc(1, 'SLC', time.monotonic, ('S:0', 64)),
            simulated_plc(2, 'PLC5', time.monotonic, ('S:0', 32)),
            simulated_plc(3, 'PLC2', time.monotonic, ('000', 32)),
            simulated_plc(4, 'SLC', time.monotonic, ('S:0', 30)))


@pytest.fixture
def port(tmp_path: Path, plcs: tuple[SimulatedPlc, ...]) -> Iterator[str]:
    with plc_line(tmp_path / 'line', *plcs) as name:
        yield name


def set_clock(plc: SimulatedPlc, when: datetime) -> None:
    store(plc, WORDS[plc.station], [*when.timetuple()[:6]])


@pytest.mark.parametrize('station', [1, 2])
def test_clock_is_told_with_its_drift(
        port: str, plcs: tuple[SimulatedPlc, ...], station: int, capsys: Output) -> None:
    set_clock(plcs[station - 1], datetime.now() - timedelta(days=1, hours=2))
    said = call(main, capsys, 'clock', str(station), '--port', port)
    assert said.status == 0
    assert ' 1 day, 2:00:0' in said.lines[0] and 'behind this computer' in said.lines[0]


@pytest.mark.parametrize('station', [1, 2])
def test_clock_is_set_when_that_is_wanted(
        port: str, plcs: tuple[SimulatedPlc, ...], station: int, capsys: Output,
        monkeypatch: pytest.MonkeyPatch) -> None:
    before = datetime(2001, 2, 3, 4, 5, 6)
    set_clock(plcs[station - 1], before)
    args = ('clock', str(station), '--set', '--port', port)
    said = call(main, capsys, *args)
    assert said.status == 2 and re.fullmatch((
        rf'would set the clock of station {station} \({WORDS[station]}\) to \d{{4}}-\d\d-\d\d '
        r"\d\d:\d\d:\d\d, this computer's time").replace('S:', 'S2:'), *said.lines)
    assert str(before) in call(main, capsys, 'clock', str(station), '--port', port).lines[0]
    said = call(main, capsys, *args, '--yes')
    assert said.status == 0, said
    # The clock has whole seconds, and a busy host may take some more.
    assert re.search('(as|0:00:0[23] behind) this computer$', said.lines[0])
    monkeypatch.setattr(Clock, 'write', lambda self: 0)  # these words are not the clock
    set_clock(plcs[station - 1], before)
    said = call(main, capsys, *args, '--yes')
    assert (said.status, 'its clock has not changed' in said.err) == (1, True)
    for error, status, err in (
            (KeyboardInterrupt(), 0, ''), (FormatError('no date'), 1, ': no date\n'),
            (PortLost('gone'), 0, 'plc: cannot be read back: port lost: gone\n')):
        monkeypatch.setattr(Clock, 'read', Mock(side_effect=error))
        said = call(main, capsys, *args, '--yes')
        assert (said.status, said.err.endswith(err)) == (status, True)


def test_drift_counts_from_the_middle_of_the_read(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = datetime(2026, 3, 1, 12, 0, 0)
    moments = iter([begun, begun + timedelta(seconds=4)])

    class Moments(datetime):
        """A computer whose clock is read twice."""

        @classmethod
        def now(cls, tz: object = None) -> datetime:  # type: ignore[override]
            return next(moments)

    monkeypatch.setattr('abdf1_ros.cli.plc.verbs.clock.datetime', Moments)
    session = cast(Session, SimpleNamespace(ask=lambda station, steps: (2026, 3, 1, 12, 0, 2)))
    assert Clock(session, 1, PlcType.PLC5, None).read()[1] == timedelta(0)


@pytest.mark.parametrize(('args', 'status', 'text'), [
    (('1',), 1,
     'S2:37 of station 1: holds no date and time: 0 0 0 0 0 0; is its clock switched off?\n'),
    (('3',), 1, 'station 3: is a PLC-2, whose clock is not known\n'),
    (('4', '--set', '--yes'), 1,
     'S2:37 of station 4: not written: the PLC refused it: STS 50: address not there'),
    (('3', '--set', '--yes', '--plc-type', 'SLC'), 1, 'S2:37 of station 3: not written: the PLC '
     'refused it: STS 10: illegal command, format or length, or the file does not exist\n'
     'plc: station 3 is PLC-2 at 1771-KG series A'),
    (('--set', '--yes'), 2, '--station: give the station to write to: ')])
def test_clock_that_cannot_be_had_is_told(
        port: str, capsys: Output, args: tuple[str, ...], status: int, text: str) -> None:
    said = call(main, capsys, 'clock', *args, '--port', port)
    assert (said.status, said.err.startswith(f'plc: {text}')) == (status, True), said.err


def test_files_are_not_offered_of_a_plc_that_cannot_list_them(port: str, capsys: Output) -> None:
    for station, address, count in (('3', '0777', 0), ('4', 'S:40', 1)):
        said = call(main, capsys, 'read', address, '--station', station, '--port', port)
        assert (said.status, said.err.count('"plc files ')) == (1, count), said.err


@pytest.mark.parametrize(('processor', 'text'), [
    (Processor.ML1400, 'is a ML1400: S:37 to S:42 are the clock of an SLC 5/03, 5/04 or 5/05. '
     'The clock of a MicroLogix is its function file RTC, whose type code is not known; let the '
     'program copy it into an N file'),
    (Processor.SLC_5_02, 'is an SLC 5/02, which has no clock')])
def test_status_words_of_other_processors_are_no_clock(
        port: str, plcs: tuple[SimulatedPlc, ...], processor: Processor, text: str,
        capsys: Output) -> None:
    plcs[0].processor.processor = processor
    set_clock(plcs[0], datetime(2001, 2, 3, 4, 5, 6))
    for options in ((), ('--set', '--yes')):
        said = call(main, capsys, 'clock', '1', *options, '--port', port)
        assert (said.status, said.err) == (1, f'plc: station 1: {text}\n')
    assert stored(plcs[0], 'S:37') == (2001).to_bytes(2, 'little')


@for_all(('seconds', 'text'), [
    (1.4, 'as this computer'), (-1.4, 'as this computer'), (1.6, '0:00:02 ahead of this computer'),
    (90, '0:01:30 ahead of this computer'), (-3600.4, '1:00:00 behind this computer')])
def test_drift_is_told_in_words(seconds: float, text: str) -> None:
    assert told(datetime(2026, 1, 2, 3, 4, 5), timedelta(seconds=seconds)) == \
        f'2026-01-02 03:04:05, {text}'
