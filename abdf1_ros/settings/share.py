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

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import parse_qsl, urlsplit

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.line_names import address_of, device_of, host_and_port, link_of
from abdf1_ros.settings import BAUD_RATES, PARITIES
from abdf1_ros.text import shown

_MOST_PLACES = 16
_MOST_NAMED = 8  # stations in a text
_RIGHT = ('pty:/a/name, tcp:PORT, tcp:ADDRESS:PORT, eip:PORT?station=N, or a serial device '
          'such as /dev/ttyUSB1?baud=19200&check=CRC&parity=Even')
_ETHERNET = 'eip'
_LISTENING = 'tcp', _ETHERNET
_OPTIONS = {'baud': [*map(str, BAUD_RATES)], 'check': [check.value for check in Checksum],
            'parity': PARITIES}
_STATIONS = {'station': [*map(str, range(MAX_STATION + 1))]}
_STATION_RIGHT = f'station=N, the PLC that answers there, 0-{MAX_STATION}'


@dataclass(frozen=True, slots=True)
class SharePlace:
    """
    A place: ``text`` as it is written, ``kind`` pty, tcp, eip or serial, ``name`` of its file.

    ``host`` and ``port`` belong to tcp and eip, ``station`` to eip. A setting of the line that is
    None is the same as on the line.
    """

    text: str
    kind: str
    name: str = ''
    host: str = ''
    port: int = 0
    baud: int | None = None
    check: Checksum | None = None
    parity: str | None = None
    station: int | None = None

    @property
    def is_ethernet(self) -> bool:
        """Tell whether programs speak EtherNet/IP here, not DF1."""
        return self.kind == _ETHERNET

    @property
    def listens(self) -> bool:
        """Tell whether programs connect here over TCP."""
        return self.kind in _LISTENING

    @property
    def line(self) -> str:
        """Return the same text for all ways to write this place."""
        if self.listens:
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
        return self.listens and not ip_address(self.host).is_loopback


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
    kind, _, name = where.partition(':')
    _check_options(kind, options, text)
    if where.startswith('/'):
        kind, name = 'serial', where
    host, port = '', 0
    if kind in _LISTENING:
        host, port = _host_and_port(name, text)
    elif kind not in ('pty', 'serial') or not name.startswith('/'):
        raise ValueError(f'"{shown(text)}" should be {_RIGHT}')
    if kind != 'serial' and {'baud', 'parity'} & set(options):
        raise ValueError(f'"{shown(text)}": only a serial device has baud and parity')
    baud, check, station = (options.get(name) for name in ('baud', 'check', 'station'))
    return SharePlace(text, kind, name, host, port, int(baud) if baud else None,
                      Checksum(check) if check else None, options.get('parity'),
                      int(station) if station else None)


def _check_options(kind: str, options: dict[str, str], text: str) -> None:
    """Check what comes after "?"; ValueError gives the right form."""
    allowed = _STATIONS if kind == _ETHERNET else _OPTIONS
    for name, value in options.items():
        if value not in allowed.get(name, ()):
            right = _STATION_RIGHT if kind == _ETHERNET else '; '.join(
                f'{option}={"|".join(values)}' for option, values in _OPTIONS.items())
            raise ValueError(f'"{shown(text)}": after "?" may come {right}')


def station_of(place: SharePlace, stations: Sequence[int]) -> int:
    """
    Return the station that answers at an eip place, for a map with rows of these stations.

    ValueError if the map does not have the station, or has several and the place names none. A
    map without rows has any.
    """
    rows = f'the map has rows of {", ".join(map(str, stations[:_MOST_NAMED]))}' + (
        ', ...' if len(stations) > _MOST_NAMED else '') if stations else 'the map has no rows'
    if place.station is None and len(stations) != 1:
        raise ValueError(f'"{shown(place.text)}": which station answers there? {rows}; write '
                         f'{shown(place.text)}?station={[*stations, 1][0]}')
    station = stations[0] if place.station is None else place.station
    if stations and station not in stations:
        raise ValueError(f'"{shown(place.text)}": no row has station {station}; {rows}')
    return station


def _host_and_port(name: str, text: str) -> tuple[str, int]:
    """
    Return address and port after "tcp:" or "eip:"; ValueError for a host name.

    A name may mean any interface.
    """
    with suppress(ValueError):
        host, port = host_and_port(name, '') if ':' in name else host_and_port(f':{name}')
        if port:
            return str(ip_address(host)), port
    kind = text.partition(':')[0]
    raise ValueError(f'"{shown(text)}" should be {kind}:PORT (for this machine only) or '
                     f'{kind}:ADDRESS:PORT, with the address of an interface')


def share_remarks(places: list[SharePlace]) -> Iterator[str]:
    """Yield which places are open to other machines."""
    for place in places:
        if place.is_open_to_others:
            yield (f'Share {shown(place.text)}: every program that reaches '
                   f'{place.host}:{place.port} over the network can send commands to the PLC, '
                   'without a password')
