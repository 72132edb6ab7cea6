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
"""
Compare the time that a text ten times as long takes: no text may make a command slower than that.

Method. Each text is made with 20 kB, 200 kB and 2 MB, and given to "sniff", "plc import" or
"check" in this process. Only processor time counts, the best of --rounds. A ratio of two sizes
above 12 is marked, and the status is 1. Times below 20 ms are taken as 20 ms: there the start
counts most. A status of 2 means that the command refuses the text.

Run it as "python test/lab/benchmarks/any_texts.py"; it needs nothing but the package.
"""

import argparse
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
import os
from pathlib import Path
from random import Random
import sys
import tempfile
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.cli.check import main as check  # noqa: E402
from abdf1_ros.cli.plc.command import main as plc  # noqa: E402
from abdf1_ros.cli.sniff import main as sniff  # noqa: E402

SIZES = 20_000, 200_000, 2_000_000
MOST = 12  # times as long for ten times the size
LEAST = 0.02  # s
NET = 'Station,Mode,Com_Port,Baud,Timeout\n5,Master,/dev/null,19200,300\n'
LIST, MAP = 'Tag Name,Address\n', 'Tag,Command,Address,Station,PLC_Type'

Text = Callable[[int], str | bytes]
Command = Callable[[Path], int]


def sniffed(*options: str) -> Command:
    return lambda path: sniff(['--summary', *options, str(path)])


def reported(path: Path) -> int:
    """Make an anonymous bundle with the text as a result of conform, and as a map."""
    capture = path.with_suffix('.cap')
    capture.write_text('10 05 01 FF\n')
    return sniff(['--summary', '--report', str(path.with_suffix('.zip')), '--anonymous',
                  '--settings', str(path), '--conformance', str(path), '--', str(capture)])


def imported(path: Path) -> int:
    return plc(['import', str(path), '--into', tempfile.mkdtemp(dir=path.parent)])


def checked(path: Path) -> int:
    net = path.with_name('net.csv')
    net.write_text(NET)
    return check([str(net), str(path)])


def repeated(begin: str, part: str, end: str = '') -> Text:
    """Return a text that repeats a part."""
    return lambda size: begin + part * (size // len(part)) + end


def rows(head: str, row: Callable[[int], str]) -> Text:
    """Return a table with numbered rows."""
    return lambda size: '\n'.join([head, *map(row, range(size // len(row(1000))))])


def noise(size: int) -> bytes:
    return Random(1).randbytes(size)


LOG = '12:00:01 RX '
TEXTS: dict[str, tuple[Command, Text]] = {
    'log with dashes': (sniffed(), repeated(LOG, '-', ' 10 06')),
    'log with arrows': (sniffed(), repeated('12:00:01 ', '<', ' x 10 06')),
    'log with gaps': (sniffed(), repeated(LOG, 'AA  ', 'zz')),
    'log with blanks': (sniffed(), repeated(LOG, '20  ', 'zz')),
    'log with backslashes': (sniffed(), repeated(f"{LOG}b'", '\\')),
    'log with carets': (sniffed(), repeated('TX ', 'A^')),
    'log with quotes': (sniffed(), repeated('TX ', "\\'")),
    'log with marks': (sniffed(), rows('', lambda row: f'm{row}: 10 05 01 FF')),
    'log in decimal': (sniffed(), repeated('TX ', '16 5 1 255 ')),
    'table': (sniffed(), rows('Time,Way,Data', lambda row: f'{row / 1000:.3f},TX,10 05 01 FF')),
    'dump with characters': (sniffed(), rows('', lambda row: (
        f'{16 * row:08x}  {"10 05 01 FF " * 4} |{4 * "...."}|'))),
    'log': (sniffed(), repeated('', f'{LOG}10 02 01 05 0F 00 12 34 A2 02 07 89 00 00 10 03\n')),
    'dump of words': (sniffed(), rows(f'0000000{" 1234" * 8}', lambda row: (
        f'{16 * (row + 1):07x}{" 1234" * 8}'))),
    'capture': (sniffed(), rows('# abdf1_ros capture 1', lambda row: f'{row / 100:.6f} > 10 02')),
    'capture with heads': (sniffed(), rows(
        '# abdf1_ros capture 1', lambda row: f'# name{row}: x\n{row / 100:.6f} > 10 05')),
    'bytes: noise': (sniffed('--binary'), noise),
    'bytes: DLE STX': (sniffed('--binary'), lambda size: b'\x10\x02' * (size // 2)),
    'bytes: DLE ENQ': (sniffed('--binary'), lambda size: b'\x10\x05' * (size // 2)),
    'report with brackets': (reported, repeated('', '[')),
    'report of a map': (reported, rows(f'{MAP},Topic', lambda row:
                                       f't{row},Read,N7:{row % 900},1,SLC,u{row}')),
    'list with one name': (imported, rows(LIST, lambda row: 'x,N7:0')),
    'list with names': (imported, rows(LIST, lambda row: f'x{row},N7:{row % 255}')),
    'list with a long name': (imported, repeated(f'{LIST}', 'a', ',N7:0')),
    'list with digits': (imported, repeated(f'{LIST}x,N7:', '9')),
    'list with blanks': (imported, repeated(f'{LIST}x,N7:0', ' ', 'x')),
    'address with digits': (checked, lambda size:
                            f'{MAP}\nx,Read,N7:{"9" * min(size, 100_000)}a-5,1,PLC5'),
    'address with blanks': (checked, lambda size:
                            f'{MAP}\nx,Read,N7:0{" " * min(size, 100_000)}x,1,PLC5'),
    'reads of one topic': (checked, rows(f'{MAP},Topic', lambda row:
                                         f't{row},Read,N7:{row % 900},1,PLC5,same')),
    'writes of one word': (checked, rows(MAP, lambda row: f't{row},Write,N7:0,1,PLC5')),
    'fallbacks': (checked, rows(f'{MAP},Fallback,Fallback_After', lambda row: (
        f't{row},Write,N{row // 999 % 900 + 7}:{row % 999},1,PLC5,0,5000'))),
    'reads of many files': (checked, rows(MAP, lambda row: (
        f't{row},Read,N{row % 900 + 7}:{row // 900},{row % 254},PLC5'))),
    'unknown counters': (checked, rows(f'{MAP},While,While_Timeout', lambda row: (
        f't{row},Read,N7:{row % 900},1,PLC5,zz{row},9000'))),
    'many columns': (checked, lambda size:
                     MAP + ',' * min(size // 2, 60_000) + '\n' + 'a\n' * (size // 4)),
}


def measure(command: Command, path: Path, rounds: int) -> tuple[float, int]:
    """Return the least processor time (s) of a command, and its exit status."""
    best, status = float('inf'), 0
    for _ in range(rounds):
        path.with_suffix('.zip').unlink(missing_ok=True)
        begun = time.process_time()
        with Path(os.devnull).open('w') as nowhere, redirect_stdout(nowhere), \
                redirect_stderr(nowhere):
            status = command(path)
        best = min(best, time.process_time() - begun)
    return best, status


def main() -> int:
    """Print the times; return 1 if one of them grows too fast."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--rounds', type=int, default=1)
    parser.add_argument('--only', default='', help='texts whose name has this')
    options = parser.parse_args()
    print(f'{"s for":22}' + ''.join(f'{size // 1000:>9} kB' for size in SIZES) + '   statuses')
    has_failed = False
    for name, (command, text) in TEXTS.items():
        if options.only not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            times, statuses = [], []
            for size in SIZES:
                path = Path(folder, f'{size}.csv')
                content = text(size)
                path.write_bytes(content if isinstance(content, bytes) else content.encode())
                seconds, status = measure(command, path, options.rounds)
                times.append(seconds)
                statuses.append(status)
        is_slow = any(more > MOST * max(less, LEAST) for less, more in zip(times, times[1:]))
        has_failed |= is_slow
        print(f'{name:22}' + ''.join(f'{seconds:12.2f}' for seconds in times)
              + f'   {statuses}{"  TOO SLOW" if is_slow else ""}', flush=True)
    return int(has_failed)


if __name__ == '__main__':
    sys.exit(main())
