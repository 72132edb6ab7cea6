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

"""The log of a night in SQLite, with PLCs that fall silent and come back."""

from collections.abc import Iterator
import math
import os
from pathlib import Path
import signal
import sqlite3
import struct
import subprocess
import sys
import time

from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import simulated_plc, store
from support.plc_line import plc_line
from support.ptys import PATIENCE, wait_until
from support.ros_tools import SOURCE

ROWS = """\
Tag,Command,Address,Station,PLC_Type,Length
speed,Read,N7:0,1,SLC,
doors,ReadWrite,B3:0/0,2,PLC5,3
level,Read,F8:0,2,PLC5,
recipe,Write,N7:5,1,SLC,
name,Read,ST9:0,1,SLC,
lacking,Read,N7:250,1,SLC,
"""
FILES = (('N7:0', 10), ('B3:0', 4), ('F8:0', 8), ('ST9:0', 42))


@pytest.fixture
def plcs() -> list[SimulatedPlc]:
    found = [simulated_plc(1, 'SLC', time.monotonic, *FILES),
             simulated_plc(2, 'PLC5', time.monotonic, *FILES)]
    store(found[0], 'N7:0', [250])
    store(found[0], 'ST9:0', 'left')
    store(found[1], 'B3:0', [5])
    store(found[1], 'F8:0', [2.5])
    return found


@pytest.fixture
def files(tmp_path: Path, plcs: list[SimulatedPlc]) -> Iterator[list[str]]:
    with plc_line(tmp_path / 'line', *plcs) as port:
        (tmp_path / 'net.csv').write_text(f'Com_Port,Baud,Timeout\n{port},115200,100\n')
        (tmp_path / 'map.csv').write_text(ROWS)
        yield [str(tmp_path / name) for name in ('net.csv', 'map.csv', 'night.db')]


def begun(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, str(SOURCE / 'examples' / 'night.py'), *words],
                            stderr=subprocess.PIPE, text=True)


def logged(database: str, tag: str) -> list[tuple[object, str | None]]:
    """Return values and errors of a tag, each followed by another one."""
    if not os.path.exists(database):
        return []
    with sqlite3.connect(database) as base:
        try:
            found = base.execute(
                'SELECT value, error FROM readings WHERE tag = ? ORDER BY time', (tag,)).fetchall()
        except sqlite3.OperationalError:  # it is just being made
            return []
    return [pair for number, pair in enumerate(found) if not number or found[number - 1] != pair]


def test_silent_plc_is_a_gap_of_its_own_rows(files: list[str], plcs: list[SimulatedPlc]) -> None:
    start = time.time()
    with begun(*files, '--every', '0.05') as night:
        wait_until(lambda: logged(files[2], 'level') == [(2.5, None)])
        plcs[1].faults.silent = True
        wait_until(lambda: len(logged(files[2], 'level')) == 2)
        store(plcs[0], 'N7:0', [300])
        wait_until(lambda: len(logged(files[2], 'speed')) == 2)
        plcs[1].faults.silent = False
        wait_until(lambda: len(logged(files[2], 'level')) == 3)
        night.send_signal(signal.SIGTERM)
        assert (night.communicate(timeout=PATIENCE)[1], night.returncode) == ('', 0)
    silent = 'of station 2): 2509 ERR_INACTIVE_STATION: Slave Station (2) Inactive'
    tags = 'speed', 'doors', 'level', 'recipe', 'name'
    assert {tag: logged(files[2], tag) for tag in tags} == {
        'speed': [(250, None), (300, None)],
        'doors': [('[true, false, true]', None), (None, f'doors (B3:0/0 {silent}'),
                  ('[true, false, true]', None)],
        'level': [(2.5, None), (None, f'level (F8:0 {silent}'), (2.5, None)],
        'recipe': [], 'name': [('left', None)]}
    with sqlite3.connect(files[2]) as base:
        errors = base.execute('SELECT tag, COUNT(*) FROM readings WHERE error NOT NULL '
                              'GROUP BY tag ORDER BY tag').fetchall()
        first, last = base.execute('SELECT MIN(time), MAX(time) FROM readings').fetchone()
    assert errors == [('doors', 1), ('lacking', 1), ('level', 1)]  # a gap has one row
    assert start < first < last < time.time()


def test_float_that_is_no_number_is_a_text(files: list[str], plcs: list[SimulatedPlc]) -> None:
    Path(files[1]).write_text('Tag,Command,Address,Station,PLC_Type,Length\n'
                              'one,Read,F8:0,2,PLC5,\ntwo,Read,F8:0,2,PLC5,2\n')
    plcs[1].table.write(parse_address('F8:0', PlcType.PLC5),
                        struct.pack('<2f', math.nan, -math.inf))
    with begun(*files, '--seconds', '0.001') as night:
        assert (night.communicate(timeout=PATIENCE)[1], night.returncode) == ('', 0)
    assert logged(files[2], 'one') == [('nan', None)]
    assert logged(files[2], 'two') == [('["nan", "-inf"]', None)]


def test_end_and_failures_have_their_status(files: list[str], tmp_path: Path) -> None:
    write_only = str(tmp_path / 'writes.csv')
    Path(write_only).write_text('Tag,Command,Address,Station,PLC_Type\ncmd,Write,N7:1,1,SLC\n')
    for words, status, said in (
            ([*files, '--seconds', '0.001'], 0, ''),
            ([*files, '--seconds', 'nan'], 2, '"nan" should be a number of seconds above 0'),
            ([*files, '--every', '-1'], 2, '"-1" should be a number of seconds above 0'),
            ([*files[:2], str(tmp_path)], 1, f'{tmp_path}: unable to open database file'),
            ([files[0], files[0], files[2]], 2, 'net.csv:1'),
            ([files[0], write_only, files[2]], 2, 'writes.csv: no row reads: nothing to log'),
            (['none.csv', *files[1:]], 2, 'none.csv')):
        with begun(*words) as night:
            assert said in night.communicate(timeout=PATIENCE)[1]
        assert night.returncode == status
