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

"""The program ``monitor``: it shows a running bridge, or all bridges, from their topics alone."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
import curses
from functools import partial
import locale
import math
import os
import shutil
import signal
import sys
import time
from types import FrameType

from abdf1_ros.cli.monitor.curves import ASCII
from abdf1_ros.cli.monitor.node import full_name, NodeWatch
from abdf1_ros.cli.monitor.plant import PlantWatch, render_plant
from abdf1_ros.cli.monitor.view import render, Style, TextLine
from abdf1_ros.cli.terminal import (
    colour,
    EXIT_FAILED,
    EXIT_USAGE,
    has_reader_left,
    prepare_output,
    tell,
)
from abdf1_ros.cli.usage import parser_of
from abdf1_ros.errors import FormatError
from abdf1_ros.ros.observer import graph_hint
from abdf1_ros.ros.process.refusals import refusal, REFUSALS
from abdf1_ros.signals import limit_output
from abdf1_ros.text import BARS
from rclpy.utilities import remove_ros_args

_say = partial(tell, 'monitor')

# Period (s) of the picture on a terminal that shows it in place.
_RENEWAL = 0.25

# Longest wait (s) of a single picture for promised values, after the node is found.
_COMPLETION = 3.0

PROGRESS_PERIOD = 2.0

# This key draws the whole picture again, after another program wrote to the terminal.
_CONTROL_L = 12

_RETURN = (curses.KEY_ENTER, ord('\n'), ord('\r'))

_SECTION_KEYS = {ord('l'): 'link', ord('s'): 'stations', ord('v'): 'values',
                 ord('r'): 'reasons', ord('w'): 'writes', ord('c'): 'counters'}
_PLANT_KEYS = 'q end  arrows, pages  Return shows a line'
_KEYS = 'q:end v:values r:reasons w:writes l:link s:stations c:counters'

# Colours by ANSI codes; curses has the same numbers.
_COLOURS = {Style.GOOD: 2, Style.WARNING: 3, Style.BAD: 1}


class _Ending:
    """Callable: True after a signal (``is_signalled``), or when the time is up."""

    def __init__(self) -> None:
        self._end = math.inf
        self.is_signalled = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._signal)

    def __call__(self) -> bool:
        return self.is_signalled or time.monotonic() >= self._end

    def limit(self, seconds: float) -> None:
        """End ``seconds`` from now."""
        self._end = time.monotonic() + seconds

    def _signal(self, number: int, frame: FrameType | None) -> None:
        self.is_signalled = True
        limit_output()


class Screen:
    """A terminal that shows lines in place, for curses.wrapper."""

    def __init__(self, window: curses.window, keys: str = _KEYS, marked: str = '') -> None:
        self._window = window
        self._top = 0
        self._marked = marked
        self._step = 0
        self._page = 1  # rows, with one of the page before
        self._chosen = ''
        self.chosen = ''
        self._sections: dict[str, int] = {}
        self._keys = keys
        self._colours: dict[Style, int] = {}
        window.nodelay(True)
        with suppress(curses.error):  # a terminal that cannot hide the cursor
            curses.curs_set(0)
        if curses.has_colors() and 'NO_COLOR' not in os.environ:
            curses.use_default_colors()
            for style, number in _COLOURS.items():
                curses.init_pair(number, number, -1)
                self._colours[style] = curses.color_pair(number)

    @property
    def width(self) -> int:
        return self._window.getmaxyx()[1] - 1  # a write into the last corner is an error

    def show(self, lines: Sequence[TextLine], heading: int = 0) -> None:
        """Show the lines that fit, from the scroll position on, and the keys below."""
        height = self._window.getmaxyx()[0] - 1 - heading
        self._page = max(1, height - 1)
        self._sections = {line.section: row for row, line in enumerate(lines) if line.section}
        count = len(lines) - heading
        self._top = max(0, min(self._top, count - height))
        last = min(self._top + height, count)
        self._window.erase()
        shown = [*lines[:heading], *lines[heading + self._top:heading + last]]
        for row, line in enumerate(shown):
            attributes = self._colours.get(line.style, 0)
            if line.style is Style.TITLE:
                attributes = curses.A_BOLD
            if line.section and line.section == self._chosen:
                attributes |= curses.A_REVERSE
            with suppress(curses.error):  # letters of double width, or a window just made smaller
                self._window.addnstr(row, 0, line.text, self.width, attributes)
        self._bottom(f'{min(self._top + 1, last)}-{last} of {count}  {self._keys}')
        self._window.refresh()

    def _bottom(self, text: str) -> None:
        with suppress(curses.error):  # a window just made smaller
            self._window.addnstr(
                self._window.getmaxyx()[0] - 1, 0, text, self.width, curses.A_REVERSE)

    def show_list(self, lines: Sequence[TextLine]) -> None:
        """Show lines with a marked line; each line is identified by its ``section``."""
        rows = [row for row, line in enumerate(lines) if line.section] or [0]
        at = next((row for row in rows if lines[row].section == self._marked), rows[0])
        if self._step:  # until a key moves the mark, it stays on the first line
            at = min(max(at + self._step, rows[0]), rows[-1])
            self._marked, self._step = lines[at].section, 0
        self._chosen = lines[at].section
        height = self._window.getmaxyx()[0] - 1 - rows[0]
        self._top = max(min(self._top, at - rows[0]), at - rows[0] - height + 1)
        self.show(lines, rows[0])

    def wants_other_list(self) -> bool:
        """Read the pressed keys; return True if a key ends the list or chooses a line."""
        for key, rows in self._pressed():
            if key == ord('q'):
                return True
            if key in _RETURN and self._chosen:
                self.chosen = self._chosen
                return True
            self._step += rows
        return False

    def _pressed(self) -> Iterator[tuple[int, int]]:
        """Yield the pressed keys, each with the number of rows that it moves down."""
        rows = {curses.KEY_UP: -1, curses.KEY_DOWN: 1, curses.KEY_PPAGE: -self._page,
                curses.KEY_NPAGE: self._page, ord(' '): self._page, curses.KEY_HOME: -1_000_000,
                curses.KEY_END: 1_000_000}
        while (key := self._window.getch()) != -1:
            if key in (_CONTROL_L, curses.KEY_RESIZE):
                self._window.clearok(True)
            yield key, rows.get(key, 0)

    def wants_end(self) -> bool:
        """Read the pressed keys; return True if a key ends the picture."""
        for key, rows in self._pressed():
            if key == ord('q'):
                return True
            if (section := _SECTION_KEYS.get(key)) in self._sections:
                self._top = self._sections[section]
            self._top = max(0, self._top + rows)
        return False


def main(args: Sequence[str] | None = None) -> int:
    """
    Show the node until SIGINT, SIGTERM, q or --seconds.

    Returns 0; 1 if there is no such node; 2 for bad options.
    """
    words = list(sys.argv if args is None else ['monitor', *args])
    prepare_output()
    try:
        return _run(parser_of('monitor').parse_args(remove_ros_args(words)[1:]), words)
    except REFUSALS as error:  # of rclpy, for --ros-args
        _say(refusal(error)[1])
        return EXIT_USAGE
    except (FormatError, RuntimeError, ValueError) as error:
        _say(' '.join(str(error).split()))
        return EXIT_USAGE
    except OSError as error:
        return 0 if has_reader_left(error, _say) else EXIT_USAGE


def _run(options: argparse.Namespace, words: list[str]) -> int:
    has_ended = _Ending()
    if options.all:
        return _run_all(options, words, has_ended)
    with NodeWatch(full_name(options.node), words) as watch:
        if _find(watch, options.wait, has_ended):
            has_ended.limit(options.seconds)
            _show(watch, options, has_ended)
        elif not has_ended():
            _say(_not_found(watch, options.wait))
            return EXIT_FAILED
    return 0


def _run_all(options: argparse.Namespace, words: list[str], has_ended: _Ending) -> int:
    """Show all bridges, and each chosen bridge."""
    has_ended.limit(options.seconds)
    marked = ''
    while True:
        with PlantWatch(words) as plant:
            if options.once or not is_screen():
                return _print_all(plant, options, has_ended)
            marked = curses.wrapper(_draw_all, plant, has_ended, marked)
        if not marked:
            return 0
        with NodeWatch(marked, words) as watch:
            curses.wrapper(_draw, watch, has_ended)


def _print_all(plant: PlantWatch, options: argparse.Namespace, has_ended: _Ending) -> int:
    plant.wait(lambda: has_ended() or bool(plant.lines()), options.wait)
    plant.wait(has_ended, _COMPLETION)  # usually diagnostics come every second
    if options.once:
        plant.wait(lambda: has_ended() or plant.is_complete, options.wait)
    _print_pictures(plant, lambda width: render_plant(plant.lines(), time.monotonic(), width),
                    options, has_ended)
    return 0 if plant.lines() or has_ended.is_signalled else EXIT_FAILED


def _draw_all(window: curses.window, plant: PlantWatch, has_ended: _Ending, marked: str) -> str:
    screen = Screen(window, _PLANT_KEYS, marked)
    while not has_ended() and not screen.wants_other_list():
        screen.show_list(render_plant(plant.lines(), time.monotonic(), screen.width))
        plant.wait(has_ended, _RENEWAL)
    return screen.chosen


def _find(watch: NodeWatch, seconds: float, has_ended: _Ending) -> bool:
    """Listen until the node is found."""
    end = time.monotonic() + seconds
    said = time.monotonic()
    while not watch.is_there and not has_ended() and time.monotonic() < end:
        watch.wait(has_ended, 0.1)
        if time.monotonic() - said >= PROGRESS_PERIOD:
            said = time.monotonic()
            _say(f'looking for {watch.name}, {max(0.0, end - said):.0f} s more')
    return watch.is_there


def _not_found(watch: NodeWatch, seconds: float) -> str:
    if watch.stopped:
        return f'{watch.name} {watch.stopped}'
    bridges = watch.bridges()
    if watch.name in bridges:
        return (f'{watch.name} is visible, but sent no message within {seconds:g} s: programs on '
                'one machine must run as the same user')
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    hint = f'--node may be one of {", ".join(bridges)}' if bridges else (
        f'no bridge is heard with ROS_DOMAIN_ID {domain}; ROS_DOMAIN_ID and '
        'ROS_AUTOMATIC_DISCOVERY_RANGE must be the same as for the bridge')
    return f'there is no node {watch.name} within {seconds:g} s: {hint}{graph_hint()}'


def _show(watch: NodeWatch, options: argparse.Namespace, has_ended: _Ending) -> None:
    if not options.once and is_screen():
        curses.wrapper(_draw, watch, has_ended)
        return
    # Time for the values that topics promise.
    watch.wait(lambda: has_ended() or watch.is_complete, _COMPLETION)
    _print_pictures(watch, partial(_picture, watch), options, has_ended)


def _picture(watch: NodeWatch, width: int) -> list[TextLine]:
    # Characters that the C library cannot write would spoil a curses screen. The Linux console can
    # show few characters.
    has_blocks = locale.getencoding() == 'UTF-8' and os.environ.get('TERM') != 'linux'
    return render(watch.snapshot(), time.monotonic(), width, BARS if has_blocks else ASCII)


def is_screen() -> bool:
    """Return True if a picture can be renewed in place; prepare curses for that."""
    if not sys.stdout.isatty():
        return False
    try:
        curses.setupterm()
    except curses.error:  # TERM names an unknown terminal
        return False
    locale.setlocale(locale.LC_ALL, '')  # otherwise curses shows letters of other languages wrong
    return True


def _draw(window: curses.window, watch: NodeWatch, has_ended: _Ending) -> None:
    screen = Screen(window)
    while not has_ended() and not screen.wants_end():
        screen.show(_picture(watch, screen.width))
        watch.wait(has_ended, _RENEWAL)


def _print_pictures(watch: NodeWatch | PlantWatch, picture: Callable[[int], list[TextLine]],
                    options: argparse.Namespace, has_ended: _Ending) -> None:
    """Print a picture, then another after each period until the end; only one with --once."""
    _print(picture)
    while not options.once and not has_ended():
        watch.wait(has_ended, options.period)
        if not has_ended():
            _print(picture)


def _print(picture: Callable[[int], list[TextLine]]) -> None:
    width = shutil.get_terminal_size((100, 24)).columns if sys.stdout.isatty() else 200
    for line in picture(width):
        number = _COLOURS.get(line.style)
        print(colour(line.text, 30 + number, sys.stdout) if number else line.text)
    print(flush=True)


if __name__ == '__main__':
    raise SystemExit(main())
