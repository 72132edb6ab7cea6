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

"""Output of the commands: tables, colours, progress, and errors."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import errno
from functools import partial
import io
import math
import os
from pathlib import Path
import re
import signal
import sys
import time
from types import FrameType
from typing import Any, NoReturn, TextIO

from abdf1_ros.errors import PortLost
from abdf1_ros.numbers import decimal_number, whole_number
from abdf1_ros.paths import as_called, expanded, ShowVersion
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.hints import pasted
from abdf1_ros.signals import drop, has_no_reader, limit_output
from abdf1_ros.text import alike, printable

RED, YELLOW, GREEN = 31, 33, 32

# Exit statuses of all commands: 1 for failures of a port or a run, 2 for bad files or arguments.
EXIT_FAILED = 1
EXIT_USAGE = 2
EXIT_UNKNOWN = 3  # of "plc write" and "plc clock"
EXIT_INTERRUPTED = 130

_ENDING = (signal.SIGINT, signal.SIGTERM)

ADVICE: dict[int | None, str] = {
    errno.EACCES: 'serial ports belong to a group: "sudo usermod -aG dialout $USER", then log in '
                  'again',
    errno.ENOENT: '"plc ports" lists the ports of this machine'}
"""Advice by the number of an operating system error of a serial port."""

_PROGRESS_DELAY = 2.0  # s; shorter work shows no progress


class NoPort(OSError):
    """A port that cannot be opened; the text names the port and gives advice."""

    def __init__(self, name: str, error: OSError) -> None:
        super().__init__(reason_of(name, error))


def tell(name: str, text: str, code: int | None = None) -> None:
    """Print ``text`` on standard error, after the name of a command, in the colour ``code``."""
    line = f'{name}: {printable(text)}'
    _print_aside(colour(line, code, sys.stderr) if code else line)


def _print_aside(text: str, end: str = '\n') -> None:
    """Print on standard error; a reader that has left or a full disk does not end the work."""
    try:
        print(text, end=end, file=sys.stderr, flush=True)
    except OSError:
        drop_output(sys.stderr)


def is_wanted(question: str) -> bool:
    """Ask the user on a terminal; print the question and return False without a terminal."""
    if not sys.stdin.isatty():
        print(f'would {printable(question)}')
        return False
    try:
        return input(f'{printable(question)}? [y/N] ').strip().lower() in ('y', 'yes')
    except EOFError:
        return False


def run_command(name: str, work: Callable[[], int], interrupted: int = 0, unread: int = 0) -> int:
    """
    Carry out a command and print its failures; return the exit status.

    The status is ``interrupted`` after a SIGINT or SIGTERM that ``work`` has not handled. It is
    ``unread`` if the reader of the output has left.
    """
    complain = partial(tell, name, code=RED)
    try:
        with interruptible():
            status = work()
            sys.stdout.flush()
            return status
    except KeyboardInterrupt:
        return interrupted
    except ConfigurationError as error:
        for problem in error.problems:
            complain(_with_hint(str(problem)))
        return EXIT_USAGE
    except (NoPort, PortLost) as error:
        complain(str(error))
        return EXIT_FAILED
    except OSError as error:
        return unread if has_reader_left(error, complain) else EXIT_USAGE


def _with_hint(fault: str, words: Sequence[str] = ()) -> str:
    """Return a fault with the name of a character that looks like another; ``words`` are given."""
    return fault if 'U+' in fault else fault + (
        pasted(fault) or pasted(''.join(word for word in words if repr(word) in fault)))


def is_terminal(stream: TextIO) -> bool:
    """Return True if ``stream`` is a terminal, on which output may move the cursor."""
    return stream.isatty() and os.environ.get('TERM') != 'dumb'


def colour(text: str, code: int, stream: TextIO) -> str:
    """Return ``text`` in a colour if ``stream`` is a terminal and NO_COLOR is not set."""
    if is_terminal(stream) and 'NO_COLOR' not in os.environ:
        return f'\x1b[{code}m{text}\x1b[0m'
    return text


def prepare_output() -> None:
    """
    Prepare printing for any kind of output, once at the start of a command.

    The null device replaces a closed stream. An escape replaces a character that a stream cannot
    show.
    """
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), 'w'))
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')


@contextmanager
def interruptible() -> Iterator[None]:
    """
    Let the first SIGINT or SIGTERM in the block raise KeyboardInterrupt.

    Further signals have no effect, also after the block. So a second Ctrl-C, or a signal to a
    process group, does not disturb the end or the exit status.
    """
    for number in _ENDING:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        ignore_further()


def _interrupt(number: int, frame: FrameType | None) -> None:
    ignore_further()
    limit_output()
    raise KeyboardInterrupt


def ignore_further() -> None:
    """Make further signals have no effect while the process ends."""
    for number in _ENDING:  # not SIG_IGN: Python reports a signal that comes at that moment
        signal.signal(number, lambda number, frame: None)


def drop_output(stream: TextIO | None = None) -> None:
    """Drop all further standard output, or ``stream``: its reader has left, or a write failed."""
    drop((stream or sys.stdout).fileno())


def has_reader_left(error: OSError, tell: Callable[[str], None]) -> bool:
    """
    Return True if the reader of the output has left; ``tell`` any other error.

    An error without the name of a file is one of the output, such as a full disk.
    """
    drop_output()
    if isinstance(error, BrokenPipeError):
        return True
    tell(reason_of(str(error.filename or 'cannot print'), error))
    return False


def check_reader() -> None:
    """Raise BrokenPipeError if the reader of standard output has left, also before a write."""
    if has_no_reader(sys.stdout):
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


_SETTINGS_AFTER = re.compile(r'/dev/[^:,@]+[:,@](\d{3,6})(?:[,:]\w+)*')  # as some programs have it


def reason_of(name: str, error: OSError) -> str:
    """Return why ``name`` cannot be used, with advice; the text has the name once."""
    from abdf1_ros.ports.ownership import BUSY  # a help needs no port
    text = error.strerror or str(error)
    settings = _SETTINGS_AFTER.fullmatch(name)
    advice = f'a speed is given as --baud {settings[1]}' if settings else \
        f'"fuser -v {name}" shows the program; end it, or let a bridge release the port by ' \
        '~/polling with false' if text == BUSY and '://' not in name else \
        ADVICE.get(error.errno, '') if name.startswith('/dev/') else \
        f'a device path is /dev/{name}' if name.startswith('tty') else ''
    return (text if name in text else f'{name}: {text}') + (
        f'; {advice}' if advice else '') + pasted(name)


def may_replace(path: str, is_ours: Callable[[Path], bool]) -> bool:
    """Return True if a file is new, empty, not a file, or made by this command."""
    place = Path(path)
    try:
        return not place.is_file() or not place.stat().st_size or is_ours(place)
    except OSError:
        return False


def new_file(path: str, maker: str, is_ours: Callable[[Path], bool]) -> str:
    """
    Return the path of a file that will be written, for an option of argparse.

    Bad places are found here, before the work: raises ArgumentTypeError if the file exists and
    ``maker`` has not made it, or if it cannot be written.
    """
    path, place = expanded(path), Path(expanded(path))
    if not may_replace(path, is_ours):
        raise argparse.ArgumentTypeError(
            f'{path} exists and was not made by {maker}; give another name')
    error = errno.EISDIR if place.is_dir() else \
        errno.ENOENT if not place.parent.exists() else \
        errno.ENOTDIR if not place.parent.is_dir() else \
        errno.EACCES if not os.access(place if place.exists() else place.parent, os.W_OK) else 0
    if error:
        raise argparse.ArgumentTypeError(f'{path}: {os.strerror(error)}')
    return path


def page_option(path: str) -> str:
    """Return the path of a page that will be written; see ``new_file``."""
    from abdf1_ros.cli.lanes import is_page
    return new_file(path, '--html', is_page)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Return rows below a head, in columns; the columns in ``right`` are aligned right."""
    cells = [list(head), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for row in cells:
        padded = [cell.rjust(width) if number in right else cell.ljust(width)
                  for number, (cell, width) in enumerate(zip(row, widths, strict=True))]
        lines.append('  '.join(padded).rstrip())
    return '\n'.join(lines)


class _Parser(argparse.ArgumentParser):
    """
    A parser that prints an error in two lines: a list of all options would hide the fault.

    The parser of the command reports an unknown option, with similar options.
    """

    def __init__(self, *args: Any, complete: Callable[[argparse.ArgumentParser], None]
                 = lambda parser: None, **details: Any) -> None:
        """Make a parser; ``complete`` adds its arguments when the parser is used."""
        super().__init__(*args, **details)
        self._complete = complete
        self._words: Sequence[str] = ()
        # Python's own pattern has no exponent, so -1.5e3 would be an option.
        self._negative_number_matcher = re.compile(r'-\d*\.?\d+(?:e[+-]?\d+)?', re.IGNORECASE)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse arguments, once; an unknown argument is an error."""
        self._complete(self)
        self._words = sys.argv[1:] if args is None else args
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            option = next((text for text in unknown if text.startswith('-')), '')
            hint = self._meant(option) if option else self._surplus(unknown)
            self.error(f'unrecognized arguments: {" ".join(unknown)}{hint}')
        return found, unknown

    def format_help(self) -> str:
        """Return the help, with examples that start this command here."""
        return as_called(self.prog.partition(' ')[0], super().format_help())

    def _meant(self, option: str) -> str:
        """Return which options an unknown option may mean."""
        written = option.partition('=')[0]
        word = written.strip('-').lower()
        options = [name for name in self._option_string_actions if name.startswith('--')]
        meant = [f'{action.metavar} without {written}' for action in self._actions
                 if not action.option_strings and action.dest in (word, f'{word}s')] \
            or alike(word, options)
        return f'; did you mean {" or ".join(meant)}?' if meant else ''

    def _surplus(self, words: Sequence[str]) -> str:
        """Return advice about surplus words that are not options."""
        if words[0].startswith('/dev/') or is_port(words[0]):
            return f'; did you mean --port {words[0]}?'
        after = self._after_option(words[0])
        places = [action for action in self._actions if not action.option_strings]
        for place in places:
            if place.nargs in ('+', '*'):
                return (f'{after}; each {place.metavar} stands beside the others, before or '
                        'after all options')
        if after:
            return after
        wanted = ' and '.join(str(action.metavar) for action in places)
        listed = '; a list has commas, as in 1,2,3' if wanted == 'STATIONS' else ''
        return f'; it takes one {wanted}{listed}' if wanted else '; it takes only options'

    def _unknown(self) -> str:
        """Return a remark on the first option that is not known; Python tells what is missing."""
        for word in self._words:
            if word == '--':
                break
            name = word.partition('=')[0]
            if word.startswith('--') and name not in self._option_string_actions:
                return f'; {name} is not an option{self._meant(word)}'
        return ''

    def _after_option(self, word: str) -> str:
        """Return a remark if a word follows an option that is complete, or empty text."""
        at = self._words.index(word)
        for option, nargs, takes in ((self._words[at - 1:at], 0, 'no value'),
                                     (self._words[at - 2:at - 1], None, 'one value')):
            name = ''.join(option)
            action = self._option_string_actions.get(name)
            if action is not None and action.nargs == nargs:
                return f'; {name} takes {takes}'
        return ''

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        if message.startswith('the following arguments are required'):
            message += self._unknown()
        self.exit(2, f'{self.prog}: error: {printable(_with_hint(message, self._words))}\n'
                     f'"{self.prog} --help" lists the arguments\n')


def is_port(word: str) -> bool:
    """Return True if a word is most likely the name of a port."""
    is_device = word.startswith(('/dev/tty', '/dev/serial/', 'tty')) and not Path(word).is_file()
    return is_device or '://' in word


def command_parser(name: str, description: str | None,
                   epilog: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of a command, with --version; the help keeps the line ends of texts."""
    parser = _Parser(
        prog=name, description=description, epilog=epilog, allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--version', action=ShowVersion)
    return parser


class Progress:
    """
    Show the progress of work of more than two seconds on standard error.

    A terminal shows one line that changes; elsewhere a new line comes every two seconds.
    """

    def __init__(self) -> None:
        self._live = is_terminal(sys.stderr)
        self._next = time.monotonic() + _PROGRESS_DELAY
        self._is_shown = False

    def show(self, text: str) -> None:
        """Show ``text`` when it is time."""
        now = time.monotonic()
        if now < self._next:
            return
        if self._live:
            _print_aside(f'\r\x1b[K{text}', end='')
            self._is_shown = True
        else:
            _print_aside(text)
            self._next = now + _PROGRESS_DELAY

    def clear(self) -> None:
        """Remove the progress line before other output."""
        if self._is_shown:
            _print_aside('\r\x1b[K', end='')
            self._is_shown = False


def number_option(right: str, low: float, high: float = math.inf,
                  parse: Callable[[str], float | None] = decimal_number,
                  ) -> Callable[[str], float]:
    """Return an argparse type for a number; ``right`` describes a good number."""
    def read(text: str) -> float:
        value = parse(text)
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f'"{text}" should be {right}')
        return value
    return read


seconds_option = number_option('a number of seconds above 0', math.ulp(0.0))
whole_option = number_option('a whole number', -math.inf, parse=whole_number)
