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

"""Commands of the package in this process, and the simulators that they talk to."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import signal

from abdf1_ros.cli.plc.exports.form import Wanted
from abdf1_ros.cli.plc.exports.imported import Import, import_map
from abdf1_ros.settings.map_file import load_mappings
import pytest
from support.ros import Process

FAST = ('--timeout', '250')  # ms; for who is silent
PATIENT = ('--timeout', '3000')  # for who is there, but may be late on a busy host

Output = pytest.CaptureFixture[str]


@dataclass(frozen=True, slots=True)
class Said:
    """What a command has said, and its exit status."""

    status: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        """Return the lines of its standard output, with single spaces."""
        return [' '.join(line.split()) for line in self.out.splitlines()]

    @property
    def good_lines(self) -> list[str]:
        """Return the lines of a command that has to have ended well, without a warning."""
        assert (self.status, self.err) == (0, '')
        return self.lines


Plc = Callable[..., Said]


def call(main: Callable[[Sequence[str]], int], capsys: Output, *args: str) -> Said:
    """Run a command; its signal handlers are taken away again, and options may be wrong."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    capsys.readouterr()
    try:
        status = main(args)
    except SystemExit as ending:
        assert isinstance(ending.code, int)
        status = ending.code
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    captured = capsys.readouterr()
    assert 'Traceback' not in captured.err
    return Said(status, captured.out, captured.err)


def made(folder: Path, text: str | bytes, wanted: Wanted | None = None,
         name: str = 'list.csv') -> Import:
    """Return what a list of another program becomes; its map.csv in the folder has to be good."""
    source, target = folder / name, folder / 'map.csv'
    source.write_bytes(text if isinstance(text, bytes) else text.encode())
    result = import_map(str(source), wanted or Wanted())
    target.write_text(result.text, encoding='utf-8')
    mappings, problems = load_mappings(str(target))
    assert problems == [] and len(mappings) == result.count
    return result


@contextmanager
def running_simulator(*options: str) -> Iterator[Process]:
    """Run a simulator until the end of the block."""
    with Process('simulator', *options) as simulator:
        simulator.wait_for('simulator: station')
        yield simulator
