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

"""The column Share: places where other programs connect to share the line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import parse_qsl, urlsplit

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.line_names import address_of, device_of, host_and_port, link_of
from abdf1_ros.settings import BAUD_RATES, PARITIES
from abdf1_ros.text import shown

_MOST_PLACES = 16
_RIGHT = ('pty:/a/name, tcp:PORT, tcp:ADDRESS:PORT, or a serial device such as '
          '/dev/ttyUSB1?baud=19200&check=CRC&parity=Even')
_OPTIONS = {'baud': [*map(str, BAUD_RATES)], 'check': [check.value for check in Checksum],
            'parity': PARITIES}


@dataclass(frozen=True, slots=True)
class SharePlace:
    """
    A place: ``text`` as it is written, ``kind`` pty, tcp or serial, ``name`` of link or device.

    ``host`` and ``port`` belong to tcp. A setting that is None is the same as on the line.
    """

    text: str
    kind: str
    name: str = ''
    host: str = ''
    port: int = 0
    baud: int | None = None
    check: Checksum | None = None
    parity: str | None = None

    @property
    def line(self) -> str:
        """Return the same text for all ways to write this place."""
        if self.kind == 'tcp':
            return address_of(self.host, self.port)
        return link_of(self.name) if self.kind == 'pty' else device_of(self.name)

    def is_port(self, port: str) -> bool:
        """Tell whether this is the device path or URL of a port."""
        if '://' in port:
            url = urlsplit(port)
            return self.line == address_of(url.hostname or '', url.port or 0)
        return self.line in (device_of(port), link_of(port))

    @property
    def is_open_to_others(self) -> bool:
        """Tell whether other machines can connect."""
        return self.kind == 'tcp' and not ip_address(self.host).is_loopback


def share_places(text: str) -> list[SharePlace]:
    """Return the places of a cell, separated by blanks; ValueError gives the right form."""
    places = [_place(word) for word in text.split()]
    known: dict[str, str] = {}
    for place in places:
        name = place.text.partition('?')[0]
        if (other := known.setdefault(place.line, name)) is not name:
            same = '' if other == name else f', also as "{shown(other)}"'
            raise ValueError(
                f'"{shown(name)}" is there twice{same}; each guest has a place of its own')
    if len(places) > _MOST_PLACES:
        raise ValueError(f'{len(places)} places; the most are {_MOST_PLACES}')
    return places


def _place(text: str) -> SharePlace:
    where, _, query = text.partition('?')
    options = dict(parse_qsl(query, keep_blank_values=True))
    for name, value in options.items():
        if value not in _OPTIONS.get(name, ()):
            right = '; '.join(f'{option}={"|".join(values)}'
                              for option, values in _OPTIONS.items())
            raise ValueError(f'"{shown(text)}": after "?" may come {right}')
    kind, _, name = where.partition(':')
    if where.startswith('/'):
        kind, name = 'serial', where
    host, port = '', 0
    if kind == 'tcp':
        host, port = _host_and_port(name, text)
    elif kind not in ('pty', 'serial') or not name.startswith('/'):
        raise ValueError(f'"{shown(text)}" should be {_RIGHT}')
    if kind != 'serial' and {'baud', 'parity'} & set(options):
        raise ValueError(f'"{shown(text)}": only a serial device has baud and parity')
    baud, check = options.get('baud'), options.get('check')
    return SharePlace(text, kind, name, host, port, int(baud) if baud else None,
                      Checksum(check) if check else None, options.get('parity'))


def _host_and_port(name: str, text: str) -> tuple[str, int]:
    """
    Return address and port after "tcp:"; ValueError for a host name.

    A name may mean any interface.
    """
    with suppress(ValueError):
        host, port = host_and_port(name, '') if ':' in name else host_and_port(f':{name}')
        if port:
            return str(ip_address(host)), port
    raise ValueError(f'"{shown(text)}" should be tcp:PORT (for this machine only) or '
                     'tcp:ADDRESS:PORT, with the address of an interface')


def share_remarks(places: list[SharePlace]) -> Iterator[str]:
    """Yield which places are open to other machines."""
    for place in places:
        if place.is_open_to_others:
            yield (f'Share {shown(place.text)}: every program that reaches '
                   f'{place.host}:{place.port} over the network can send commands to the PLC, '
                   'without a password')
