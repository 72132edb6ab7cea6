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

"""The blocks of the documentation that are marked to run do what they show."""

from collections.abc import Iterator
from importlib import import_module
import os
from pathlib import Path
import re
import shlex
import socket
import subprocess
import sys
import time

from abdf1_ros.cli.main import COMMANDS
import pytest
from support import documents
from support.commands import call, Output, PATIENT
from support.device_server import OWN_HOST
from support.ptys import PATIENCE
from support.ros import Process, ros_args

PORT = '/tmp/plc'
PAGES = [name for name in documents.NAMES if documents.blocks(documents.text(name), only_run=True)]


@pytest.fixture(scope='module')
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Run the simulator that the pages start in another terminal."""
    name = tmp_path_factory.mktemp('line') / 'plc'
    with Process('simulator', '--pty', str(name)) as simulator:
        simulator.wait_for('stations 1 (PLC5), 2 (SLC) on')
        yield name


def plain(line: str) -> str:
    """Return a line without what may differ: numbers, blanks, and that a reply came late."""
    return ' '.join(re.sub(r'\d+(\.\d+)?', '0', re.sub(r', asked \d+ times$', '', line)).split())


def expect(shown: list[str], said: list[str]) -> None:
    """Fail unless all lines of a page have been said, in their order; "..." is anything."""
    rest = iter([plain(line) for line in said])
    for line in shown:
        if line != '...':
            assert plain(line) in rest, f'{line!r} is not in {said}'


@pytest.mark.usefixtures('half_duplex_only')
@pytest.mark.parametrize('name', PAGES)
def test_marked_blocks_do_what_they_show(name: str, port: Path, tmp_path: Path,
                                         monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    monkeypatch.chdir(tmp_path)
    script = tmp_path / 'plc'  # where the command has its short name
    script.write_text('#!/bin/sh\n# of abdf1_ros\n')
    script.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path), prepend=os.pathsep)
    for block in documents.blocks(documents.text(name), only_run=True):
        for part in block.replace(PORT, str(port)).split('$ ')[1:]:
            line, *shown = part.splitlines()
            command, *args = shlex.split(line.removeprefix('abdf1 '))
            if command in COMMANDS:
                if {'detect', 'read', 'log'} & {*args}:  # a scan would wait for 6 silent stations
                    args += PATIENT
                said = call(import_module(COMMANDS[command][0]).main, capsys, *args)
                assert said.status == 0, f'{line}: {said}'
                expect(shown, [*said.err.splitlines(), *said.out.splitlines()])
            else:
                subprocess.run(['bash', '-c', line], timeout=60, check=True)
                assert shown == []


def test_ethernet_page_reaches_a_simulated_plc(port: Path, tmp_path: Path) -> None:
    pytest.importorskip('pycomm3')
    page = documents.text('docs/ethernet.md').partition('## Without a PLC')[2]
    with socket.create_server((OWN_HOST, 0)) as free:
        number = free.getsockname()[1]
    page = page.replace(PORT, str(port)).replace('eip:44818', f'eip:{OWN_HOST}:{number}').replace(
        '127.0.0.1:44818', f'{OWN_HOST}:{number}')
    files, program, *_ = documents.blocks(page)
    for line in re.findall(r'^\$ (printf .*)$', files, re.MULTILINE):
        subprocess.run(['bash', '-c', line], cwd=tmp_path, check=True)
    with Process('node', *ros_args(f'net_file:={tmp_path}/net.csv',
                                   f'map_file:={tmp_path}/map.csv')) as node:
        node.wait_for(': open')
        end = time.monotonic() + PATIENCE
        while (told := subprocess.run([sys.executable, '-c', program], text=True, check=False,
                                      capture_output=True)).returncode:
            assert time.monotonic() < end, told.stderr
        node.end()
    assert told.stdout == '[[101, 102, 103, 104], 21.5]\n'


def test_both_tutorials_at_the_line_are_run() -> None:
    assert {'docs/tutorials/panel.md', 'docs/tutorials/interlocks.md'} <= set(PAGES)


def test_lines_have_to_come_in_their_order() -> None:
    expect(['a 1', '...', 'c'], ['a 22', 'b', 'c'])
    with pytest.raises(AssertionError):
        expect(['c', 'a 1'], ['a 1', 'c'])
