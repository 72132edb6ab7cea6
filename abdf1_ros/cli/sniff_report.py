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
The bundle of ``sniff --report``: one ZIP file with all facts for a report about a line.

With ``is_anonymous`` the bundle has no values and no names: it has no data of messages, and
``sniff_anonymous`` removes names from the given files.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
import json
from pathlib import Path
import platform
from zipfile import is_zipfile, ZIP_DEFLATED, ZipFile

from abdf1_ros.cli.sniff_anonymous import anonymous_result, anonymous_settings
from abdf1_ros.df1.listener import LineKind
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import Abdf1Error
from abdf1_ros.paths import package_version
from abdf1_ros.pccc.families import decode_identity
from abdf1_ros.sniffer.entries import Entry, Kind
from abdf1_ros.sniffer.report import json_line, summary_json, summary_lines, text_line
from abdf1_ros.sniffer.summary import Summary

_STATUS_REQUEST = 0x06, b'\x03'  # CMD, and FNC as the first byte of its data

# A bundle must be small enough for mail: of a long recording it has only the last entries as
# text: the fault is usually there. The capture has all entries.
MOST_ENTRIES = 100_000

# The mark that identifies a bundle.
_COMMENT = b'abdf1_ros sniff --report'

_CONTENTS = {
    'summary.txt': 'counts of the traffic on the line',
    'summary.json': 'the same for programs',
    'processors.txt': 'the identity of each processor (its diagnostic status)',
    'entries.txt': 'every poll, command and reply in words',
    'entries.json': 'the same for programs, one per line, without the data of messages',
    'versions.json': 'the versions of abdf1_ros, Python and the operating system',
    'capture/': 'the bytes as they were recorded',
    'settings/': 'the files given with --settings',
    'conformance/': 'the files given with --conformance',
}


@dataclass(slots=True)
class ReportBundle:
    """
    Collects the decoded entries of ``sniff``, then writes the bundle.

    - ``captures``: the recordings.
    - ``settings``: net and map CSV.
    - ``conformance``: results of ``conform``.

    ``write`` raises OSError if a file cannot be read or written.
    """

    captures: Sequence[str]
    settings: Sequence[str] = ()
    conformance: Sequence[str] = ()
    is_anonymous: bool = False
    _entries: deque[Entry] = field(default_factory=lambda: deque(maxlen=MOST_ENTRIES))
    _count: int = 0
    _processors: dict[int, str] = field(default_factory=dict)

    def add(self, entry: Entry) -> None:
        """Add an entry."""
        self._entries.append(entry)
        self._count += 1
        reply, request = entry.packet, entry.request
        if reply and request and (request.cmd, request.data) == _STATUS_REQUEST:
            self._take_status(reply)

    def _take_status(self, reply: Packet) -> None:
        if reply.sts:
            return
        try:
            identity = decode_identity(reply.data)
        except Abdf1Error as error:
            self._processors[reply.src] = \
                str(error) if self.is_anonymous else f'{reply.data.hex(" ")} ({error})'
            return
        # An anonymous bundle leaves out the names of the program and of an unknown processor, both
        # of which are in the status.
        if self.is_anonymous and identity.plc_type is None and identity.name:
            identity = replace(identity, model='unknown gateway' if identity.has_no_processor
                               else 'unknown processor')
        who = str(identity).partition(' (')[0] if self.is_anonymous else str(identity)
        facts = [who, *identity.faults, *identity.remarks]
        if not self.is_anonymous:
            facts.append(f'status {reply.data.hex(" ")}')
        self._processors[reply.src] = '; '.join(facts)

    def write(self, path: str, summary: Summary, kind: LineKind) -> None:
        processors = [f'station {station}: {text}'
                      for station, text in sorted(self._processors.items())]
        texts: dict[str, str | Path] = {
            'summary.txt': '\n'.join(summary_lines(summary, kind)),
            'summary.json': summary_json(summary, kind),
            'processors.txt': '\n'.join(processors) or 'no diagnostic status was seen',
            'versions.json': json.dumps(_versions(), indent=1)}
        if self.is_anonymous:
            texts['entries.json'] = '\n'.join(map(json_line, map(without_data, self._entries)))
        else:
            texts['entries.txt'] = '\n'.join(map(text_line, self._entries))
            for name in self.captures:
                texts[_free_name('capture', name, texts)] = Path(name)
        for name in self.settings:
            given = name, _text(name)
            known, text = anonymous_settings(name) if self.is_anonymous else given
            texts[_free_name('settings', known, texts)] = text
        for name in self.conformance:
            known = 'result.json' if self.is_anonymous else name
            text = anonymous_result(_text(name)) if self.is_anonymous else _text(name)
            texts[_free_name('conformance', known, texts)] = text
        Path(path).touch(0o640)  # not for every user: it holds the values of a plant
        with ZipFile(path, 'w', ZIP_DEFLATED) as bundle:
            bundle.comment = _COMMENT
            bundle.writestr('README.txt', self._readme(texts))
            for name, content in texts.items():
                if isinstance(content, Path):  # it may be large
                    bundle.write(content, name)
                else:
                    bundle.writestr(name, f'{content}\n')

    def _readme(self, names: Iterable[str]) -> str:
        lines = ['A report about a DF1 line, made by "sniff --report" of abdf1_ros.', '',
                 'What it holds:']
        lines += [f'  {name:16} {text}' for name, text in _CONTENTS.items()
                  if any(entry.startswith(name) for entry in names)]
        lines.append('')
        if left_out := self._count - len(self._entries):
            lines.append('The entries are the last of the recording; '
                         f'{left_out} before them are only counted in the summary.')
        if self.is_anonymous:
            lines.append('This bundle was made with --anonymous, without the data of messages and '
                         'the bytes of the recording. Tags and topics are numbered. The files '
                         'have only columns without names; "?" is an unreadable cell.')
        else:
            lines.append('The recording shows values of the data tables. Heads of recordings and '
                         'the given files may have names of ports, hosts, users and tags. '
                         '--anonymous leaves all these out.')
        return '\n'.join([*lines, ''])


def is_bundle(path: Path) -> bool:
    """Return True if a file is a bundle, so that a new bundle may replace it."""
    if not is_zipfile(path):
        return False
    with ZipFile(path) as bundle:
        return bundle.comment == _COMMENT


def _free_name(folder: str, path: str, taken: Container[str]) -> str:
    """Return the name of a file in the bundle; files with the same name get numbers."""
    name = Path(path).name
    names = (f'{folder}/{number}_{name}' if number else f'{folder}/{name}' for number in count())
    return next(name for name in names if name not in taken)


def _text(path: str) -> str:
    return Path(path).read_text('utf-8-sig', 'replace')


def _versions() -> dict[str, str]:
    return {'abdf1_ros': package_version(), 'python': platform.python_version(),
            'system': f'{platform.system()} {_release()} {platform.machine()}'}


def _release() -> str:
    """Return the version of the kernel without the suffix of its builder, which may be a name."""
    return platform.release().partition('-')[0]


def without_data(entry: Entry) -> Entry:
    """Return an entry without its guest, its text, and the data of its message."""
    packet = entry.packet
    # The first byte of a command is its FNC.
    data = packet.data[:1] if packet and entry.kind is Kind.COMMAND else b''
    return replace(entry, packet=packet and packet._replace(data=data), text='', guest='')
