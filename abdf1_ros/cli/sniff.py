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
Decode the traffic on a DF1 line, live or from a recording.

Live: --port listens on a port that is wired to the line, and sends nothing. --tap connects two
ports and passes all bytes on at once. A file is one of these:

- a capture, from --save or from the parameter trace_file of the node
- pcap or pcapng: from --pcapng, of a device server (--tcp), of a USB adapter, from an SEL RTAC, or
  with PCCC in EtherNet/IP
- any text with the bytes: a dump, or the log of another program
- raw bytes, with --binary

An output line has the time in seconds, the direction, the station, the message or symbol, and the
verdict of its check. The direction is ">" if sent by the master, by the first port of the tap or
by the device that recorded it; "<" the other way; "?" if unknown. The summary comes at the end,
also after Ctrl-C.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import partial
import math
import os
from pathlib import Path
import signal
import sys
import time
from typing import TYPE_CHECKING

from abdf1_ros.cli.terminal import (
    command_parser,
    EXIT_FAILED,
    EXIT_USAGE,
    has_reader_left,
    is_port,
    new_file,
    NoPort,
    page_option,
    prepare_output,
    reason_of,
    run_command,
    seconds_option,
    tell,
    whole_option,
)
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.numbers import whole_number
from abdf1_ros.paths import expanded
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.tap import is_pty, Tap
from abdf1_ros.ports.trace import begun_now, Trace
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings import BAUD_RATES, PARITIES
from abdf1_ros.settings.hints import pasted
from abdf1_ros.settings.network import Network, URLS
from abdf1_ros.signals import limit_output, OUTPUTS
from abdf1_ros.sniffer.capture import Chunk, LOST
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.entries import Entry
from abdf1_ros.sniffer.ethernet_ip import DEVICE_SERVERS
from abdf1_ros.sniffer.pcapng import PcapngWriter
from abdf1_ros.sniffer.report import json_line, summary_json, summary_lines, text_line
from abdf1_ros.sniffer.sides import Heard, merged, two_sides
from abdf1_ros.sniffer.summary import MISSING, Summary
from abdf1_ros.sniffer.texts import TextProblem
from abdf1_ros.sniffer.traffic import TrafficDecoder
from abdf1_ros.text import counted, printable

if TYPE_CHECKING:
    from abdf1_ros.cli.sniff_picture import Timeline
    from abdf1_ros.cli.sniff_report import ReportBundle

_AUTO = 'auto'
_CHECKS = {check.value.lower(): check for check in Checksum}
_DUPLEX = {duplex.name.lower(): duplex for duplex in Duplex}
_DEFAULT_BAUD = Network().baud
PROGRESS_PERIOD = 2.0

_EPILOG = """\
exit status: 0 at the end, 1 if a port cannot be opened or is lost, 2 for bad options or files

examples:
  sniff --port /dev/ttyUSB0 --baud 19200
  sniff --tap /dev/ttyUSB0 /dev/ttyUSB1 --save line.cap
  sniff --tap pty:/tmp/plc /dev/ttyUSB0      the program that talks to the PLC opens /tmp/plc
  sniff line.cap.1 line.cap
  sniff --json line.cap | jq 'select(.latency_ms > 100)'
  sniff --summary --binary recorded.bin
  sniff --pcapng line.pcapng line.cap        for Wireshark, with share/abdf1_ros/wireshark
  sniff --html line.html line.cap            for a browser
  sniff --report line.zip line.cap --settings net.csv map.csv
"""


class Output:
    """
    Decode chunks and print the entries.

    If the output fails, or its reader leaves, all other files are written all the same.
    ``is_unread`` then tells that the reader has left, and ``has_failed`` that a file failed.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._session: TrafficDecoder | None = None
        self._line = '', ''  # check and duplex that the session was begun with
        self._baud = options.baud
        self._summary = Summary(options.baud)
        self._bundle = _bundle(options) if options.report else None
        self._timeline = _timeline(options) if options.html else None
        self._packets = PcapngWriter(options.pcapng) if options.pcapng else None
        if self._packets:
            OUTPUTS.add(self._packets.file)
        self.has_failed = False
        self.is_unread = False
        # A file that is asked for takes the place of the messages here; a live line shows both.
        has_picture = bool(options.files and (options.html or options.report))
        self._is_quiet = options.summary or has_picture and not options.json
        self._colour = sys.stdout.isatty() and 'NO_COLOR' not in os.environ
        self._shows_progress = sys.stderr.isatty() and (self._is_quiet or not sys.stdout.isatty())
        self._next_progress = time.monotonic() + PROGRESS_PERIOD

    def begin(self, settings: dict[str, str]) -> TrafficDecoder:
        """
        Return the decoder; without an option, settings come from the head of a capture.

        A capture with another check or duplex is of another line, or of other settings of it: then
        the traffic so far has ended. With several speeds the load of the line is not known.
        """
        options = self._options
        check, duplex = line = tuple(
            settings.get(name, '').lower() if chosen == _AUTO else chosen
            for name, chosen in (('check', options.check), ('duplex', options.duplex)))
        if self._session is not None and any(line) and settings and line != self._line:
            self._finish(self._session)
            self._session = None
        if self._session is None:
            self._line = check, duplex
            # The head of a capture has the settings of the node, which may be wrong.
            self._session = TrafficDecoder(_CHECKS.get(check), _DUPLEX.get(duplex),
                                           is_certain=options.check != _AUTO)
        speed = whole_number(settings.get('baud', ''))
        if options.baud is None and speed and speed > 0 and speed != self._baud:
            self._summary.baud = speed if self._baud is None else None
            self._baud = speed
        return self._session

    def _finish(self, session: TrafficDecoder) -> None:
        for entry in session.finish():
            self._print(entry)

    def take(self, chunk: Chunk, settings: dict[str, str]) -> None:
        """Print the entries of a chunk."""
        session = self.begin(settings)
        if self._packets:
            self._packets.begin(settings.get('begun', ''))
        self._summary.take(chunk)
        if self._timeline:
            self._timeline.take(chunk, self._baud, settings.get('begun', ''))
        for entry in session.feed(chunk):
            self._print(entry)

    @property
    def is_empty(self) -> bool:
        """Return True if there was nothing to decode."""
        return not self._summary.bytes.total()

    def show_progress(self, done: str) -> None:
        """Show the progress every two seconds on a terminal without other output."""
        if self._shows_progress and time.monotonic() >= self._next_progress:
            self._next_progress = time.monotonic() + PROGRESS_PERIOD
            _say(f'{done}, {self._summary.bytes.total()} bytes so far')

    def end(self) -> None:
        """Print the remaining entries, then the summary."""
        self._finish(self.begin({}))
        self._summary.end()
        if self._packets:
            self._packets.close()
        self.sum_up()
        if self._bundle and self._has_written(self._bundle, 'report'):
            _say(f'{self._options.report}: its README.txt lists the contents; look through the '
                 'bundle before you pass it on')
        if self._timeline and self._has_written(self._timeline, 'html'):
            for remark in self._timeline.remarks:
                _say(f'--curve: {remark}')

    def _has_written(self, picture: ReportBundle | Timeline, option: str) -> bool:
        """Write the file of an option; return True on success."""
        path = getattr(self._options, option)
        try:
            picture.write(path, self._summary, self.begin({}).kind)
        except OSError as error:
            self.has_failed = True
            _say(f'--{option}: {reason_of(error.filename or path, error)}')
            return False
        return True

    def sum_up(self) -> None:
        """Print the summary."""
        session = self.begin({})
        if self._options.json:
            self._write(summary_json(self._summary, session.kind))
        else:
            self._write('\n'.join(summary_lines(self._summary, session.kind)))
        self.flush()

    def flush(self) -> None:
        """Hand what has been printed to its reader."""
        self._try(sys.stdout.flush)

    def _write(self, text: str) -> None:
        self._try(partial(print, text))

    def _try(self, work: Callable[[], None]) -> None:
        """Print; drop all output from the first error on."""
        try:
            work()
        except OSError as error:
            self.is_unread = has_reader_left(error, _say)
            self.has_failed |= not self.is_unread

    def _print(self, entry: Entry) -> None:
        self._summary.add(entry)
        if entry.kind in MISSING and self._summary.is_one_sided:
            return  # it may have been said by the side that was not recorded
        for picture in (self._bundle, self._timeline):
            if picture:
                picture.add(entry)
        if self._packets:
            try:
                self._packets.write(entry)
            except OSError as error:
                self._packets = None
                self.has_failed = True
                _say(f'{reason_of(self._options.pcapng, error)}; no more packets are written')
        if self._is_quiet:
            return
        if self._options.json:
            self._write(json_line(entry))
        else:
            self._write(text_line(entry, self._colour))


# Modules that only a few calls need are imported there. Their import takes as long as all other
# imports.
def _bundle(options: argparse.Namespace) -> ReportBundle:
    from abdf1_ros.cli.sniff_report import ReportBundle
    return ReportBundle(options.files, options.settings, options.conformance, options.anonymous)


def _timeline(options: argparse.Namespace) -> Timeline:
    from abdf1_ros.cli.sniff_picture import Timeline
    return Timeline(', '.join(options.files or options.tap or [options.port]), options.anonymous,
                    options.curves)


def _bundle_option(path: str) -> str:
    from abdf1_ros.cli.sniff_report import is_bundle
    return new_file(path, '--report', is_bundle)


def main(args: Sequence[str] | None = None) -> int:
    """
    Decode until the end of the file, SIGINT, SIGTERM or --seconds.

    Returns one of the exit statuses that --help lists.
    """
    prepare_output()
    options = parse(args)
    return run_command('sniff', lambda: _decode(options))


def _decode(options: argparse.Namespace) -> int:
    try:
        output = Output(options)
    except OSError as error:
        raise ConfigurationError([Problem('--pcapng', reason_of(options.pcapng, error))]) from None
    return _decode_files(options, output) if options.files else _listen(options, output)


def parse(args: Sequence[str] | None) -> argparse.Namespace:
    parser = command_parser('sniff', __doc__, _EPILOG)
    parser.add_argument('files', metavar='FILE', nargs='*', type=expanded,
                        help='recordings of any kind, decoded in this order')
    parser.add_argument('--binary', action='store_true', help='the files are raw bytes')
    parser.add_argument('--tcp', metavar='PORT', type=whole_option, action='append',
                        help='TCP port of the device server in pcap and pcapng (default: '
                             f'{" and ".join(map(str, sorted(DEVICE_SERVERS)))})')
    parser.add_argument('--port', metavar='NAME', type=expanded,
                        help=f'listen on a serial port, {URLS}, pty, or pty:NAME')
    parser.add_argument('--tap', nargs=2, metavar=('PORT_A', 'PORT_B'), type=expanded,
                        help='connect two ports and listen; ">" is from A to B')
    parser.add_argument('--baud', type=whole_option, choices=BAUD_RATES,
                        help=f'baud rate of the ports (default: {_DEFAULT_BAUD}); for a file: '
                             'baud rate of the recorded line, to compute its load')
    parser.add_argument('--parity', type=str.capitalize, choices=PARITIES,
                        default='None', help='parity of the ports (default: %(default)s)')
    parser.add_argument('--check', type=str.lower, choices=(*_CHECKS, _AUTO), default=_AUTO,
                        help='check of messages (default: found from the traffic)')
    parser.add_argument('--duplex', type=str.lower, choices=(*_DUPLEX, _AUTO), default=_AUTO,
                        help='duplex of the line (default: found from the traffic)')
    parser.add_argument('--json', action='store_true',
                        help='print one JSON object per line, the summary last')
    parser.add_argument('--summary', action='store_true',
                        help='print the summary only, as --html and --report of files do')
    parser.add_argument('--save', metavar='FILE', type=expanded,
                        help='also write the traffic of a port or tap into a capture')
    parser.add_argument('--pcapng', metavar='FILE', type=expanded,
                        help='also write the traffic as packets, for Wireshark')
    parser.add_argument('--html', metavar='FILE', type=page_option,
                        help='also draw the line as a timeline with its faults, for a browser')
    parser.add_argument('--curve', metavar='ADDRESS', dest='curves', action='append', default=[],
                        help='for --html: also draw the values of an address, such as N7:0 or '
                             'B3:0/2, or of several with commas, in the replies of each station; '
                             'may be repeated')
    parser.add_argument('--report', metavar='ZIP', type=_bundle_option,
                        help='make a bundle of captures for a report: bytes, words, summary, '
                             'processors, versions')
    parser.add_argument('--settings', metavar='FILE', type=expanded, nargs='+', default=[],
                        help='net and map CSV for the bundle')
    parser.add_argument('--conformance', metavar='FILE', type=expanded, nargs='+', default=[],
                        help='results of conform for the bundle')
    parser.add_argument('--anonymous', action='store_true',
                        help='leave values and names out of the bundle and the timeline')
    parser.add_argument('--seconds', type=seconds_option, default=math.inf,
                        help='end after this number of seconds')
    options = parser.parse_args(args)
    if port := next(filter(is_port, options.files), None):
        parser.error(f'did you mean --port {port}? A FILE is a recording')
    if sum(map(bool, (options.files, options.port, options.tap))) != 1:
        parser.error('give files, or --port, or --tap')
    if options.tap and options.tap[0] == options.tap[1] != 'pty':
        parser.error('--tap needs two different ports')
    if options.files and options.save:
        parser.error('--save is for --port and --tap')
    if (options.binary or options.tcp) and not options.files:
        parser.error('--binary and --tcp are for files')
    if options.report and (not options.files or options.binary):
        parser.error('--report is for captures: record one with --save, or trace_file of the node')
    if not options.report and (options.settings or options.conformance):
        parser.error('--settings and --conformance are for --report')
    if options.anonymous and not (options.report or options.html):
        parser.error('--anonymous is for --report and --html')
    if options.curves and (not options.html or options.anonymous):
        parser.error('--curve is for --html, and not for --anonymous: it shows values')
    _check_outputs(parser, options)
    return options


def _check_outputs(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End the program if a file that will be written is also an input or another output."""
    others = [*options.files, *options.settings, *options.conformance]
    for path in filter(None, (options.save, options.pcapng, options.html, options.report)):
        if any(_is_same_file(path, other) for other in others):
            parser.error(f'{printable(path)} is named twice; give the output another name')
        others.append(path)


def _is_same_file(one: str, other: str) -> bool:
    try:
        return os.path.samefile(one, other)
    except OSError:  # one of them is not there yet
        return os.path.realpath(one) == os.path.realpath(other)


def _decode_files(options: argparse.Namespace, output: Output) -> int:
    status = 0
    try:
        _take_files(options, output)
    except KeyboardInterrupt:  # also during a read of a pipe without a writer
        output.end()
    except Problem as problem:
        status = EXIT_USAGE
        _say(str(problem))
        if not output.is_empty and not isinstance(problem, TextProblem):
            output.end()
    else:
        output.end()
    return EXIT_USAGE if output.has_failed else status


def _take_files(options: argparse.Namespace, output: Output) -> None:
    """Take the bytes of all files, for ``seconds`` at most."""
    end = time.monotonic() + options.seconds
    for name, heard in _sources(options):
        known: set[str] = set()
        for recording, chunk in heard:
            if time.monotonic() >= end:
                return
            if recording.told and recording.name not in known:
                _say(f'{recording.name}: {recording.told}')
            known.add(recording.name)
            if lost := recording.settings.pop(LOST, ''):
                _say(f'{name}: the recorder has lost lines before {chunk.time} s: {lost}. '
                     'Faults of the line there may be no faults')
            output.take(chunk, recording.settings)
            if output.is_unread and not (options.html or options.report or options.pcapng):
                return
            output.show_progress(f'{name}: {recording.percent} %' if recording.has_size else name)
        if not known:
            _say(f'{name}: the file has no bytes')


def _sources(options: argparse.Namespace) -> Iterator[tuple[str, Iterator[Heard]]]:
    """Yield the name and the chunks of each file, or of two files with one side each."""
    opened = partial(_opened, options)
    pair = two_sides(options.files, opened)
    if pair:
        name = ' and '.join(pair)
        _say(f'{name}: one side of the line each, put together by their times')
        yield name, merged(pair, opened)
        return
    for name in options.files:
        yield name, _recorded(name, options)


def _opened(options: argparse.Namespace, name: str) -> Recording:
    return Recording(Path(name), options.binary, frozenset(options.tcp or DEVICE_SERVERS))


def _recorded(name: str, options: argparse.Namespace) -> Iterator[Heard]:
    """Yield the chunks of a file."""
    try:
        recording = _opened(options, name)
        for chunk in recording.chunks():
            yield recording, chunk
    except OSError as error:
        raise Problem(
            name, f'cannot be read: {error.strerror or error}{pasted(name)}') from None


def _listen(options: argparse.Namespace, output: Output) -> int:
    names = options.tap or [options.port]
    settings = {'begun': begun_now(), 'ports': ' '.join(names), 'check': options.check,
                'duplex': options.duplex}
    # A pseudo-terminal has no speed of its own.
    baud = options.baud or (None if all(map(is_pty, names)) else _DEFAULT_BAUD)
    if baud is not None:
        settings['baud'] = str(baud)
    try:
        tap = Tap(names, PortSettings('', baud or _DEFAULT_BAUD, parity=options.parity))
    except OSError as error:
        raise NoPort(error.filename or '', error) from None

    def end(*_: object) -> None:
        limit_output()
        tap.stop()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    with tap:
        try:
            trace = Trace(options.save, settings, _say) if options.save else None
        except OSError as error:
            raise ConfigurationError([Problem('--save', reason_of(
                error.filename or options.save, error))]) from None
        _say(f'listening on {" and ".join(tap.names)}; Ctrl-C ends')
        status = _print_heard(tap, trace, output, settings, options)
        output.end()
    return status or EXIT_USAGE * output.has_failed


def _print_heard(tap: Tap, trace: Trace | None, output: Output, settings: dict[str, str],
                 options: argparse.Namespace) -> int:
    """
    Print the traffic of the tap until the time is up, a signal comes, or a port is lost.

    A failed output never ends a tap: that would disconnect program and PLC.
    """
    def idle() -> None:
        output.show_progress('listening')

    status = 0
    chunks = tap.chunks(options.seconds, PROGRESS_PERIOD, idle)
    while True:
        try:
            chunk = next(chunks, None)
        except OSError as error:
            _say(f'a port was lost: {error}')
            status = EXIT_FAILED
            break
        if chunk is None:
            break
        _tell_lost(tap, trace)
        if trace:
            trace.write(chunk)
        was_unread = output.is_unread
        output.take(chunk, settings)
        output.flush()
        if output.is_unread and not was_unread:
            if not options.tap:
                break
            _say('this output is no longer read; the bytes are passed on until Ctrl-C')
        idle()
    _tell_lost(tap, trace)
    if trace:
        trace.close()
        output.has_failed |= trace.has_failed
    return status


def _tell_lost(tap: Tap, trace: Trace | None) -> None:
    """Report the pieces that were lost here."""
    if lost := tap.new_losses():
        text = f'{counted(lost, "piece")} of traffic lost: this output was too slow'
        _say(text)
        if trace:
            trace.write(f'# {LOST}: {text}')


_say = partial(tell, 'sniff')


if __name__ == '__main__':
    raise SystemExit(main())
