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

"""One text for all known ways to write the name of a device, a link, or an address."""

from __future__ import annotations

from contextlib import suppress
from ipaddress import ip_address, IPv6Address
from pathlib import Path
import stat
from typing import Any

from abdf1_ros.numbers import is_digits, whole_number

LOOPBACK = '127.0.0.1'
MOST_PORT = 65535


# Major numbers of pseudo-terminals (Linux, admin-guide/devices.txt). Each mount of devpts, for
# example in a container, counts minor numbers of its own.
_PSEUDO_TERMINALS = range(136, 144)


def device_of(path: str) -> str:
    """Return one text for all names of a device: its number, or its path if there is no device."""
    try:
        status = Path(path).stat()
    except OSError:
        return _resolved(Path(path))
    return number_of(status) or _resolved(Path(path))


def _resolved(path: Path) -> str:
    try:
        return str(path.resolve())
    except RuntimeError:  # before Python 3.13: the path leads to itself
        return str(path.absolute())


def number_of(status: Any) -> str:
    """Return the same text for all nodes of a device, empty for other files; see stat(2)."""
    if not stat.S_ISCHR(status.st_mode):
        return ''
    is_own = status.st_rdev >> 8 & 0xFFF in _PSEUDO_TERMINALS
    return f'device {status.st_rdev}' + (f' of {status.st_dev}' if is_own else '')


def link_of(path: str) -> str:
    """Return one text for all ways to write the name of a link; the link is not followed."""
    return str(Path(_resolved(Path(path).parent), Path(path).name))


def host_and_port(text: str, default: str = LOOPBACK) -> tuple[str, int]:
    """
    Return host and port of "HOST:PORT" or "[HOST]:PORT".

    If HOST is missing it is ``default``. Raises ValueError for any other text.
    """
    host, colon, port = text.rpartition(':')
    number = whole_number(port) if is_digits(port) else None
    with suppress(UnicodeError):
        host = host.removeprefix('[').removesuffix(']').encode('idna').decode()
        if colon and number is not None and 0 <= number <= MOST_PORT:
            return host or default, number
    raise ValueError(f'"{text}" should be HOST:PORT')


def address_of(host: str, port: int) -> str:
    """Return the same text for all ways to write a host's address, and its port."""
    try:
        address = ip_address(host)
    except ValueError:
        return f'{host.lower()}:{port}'
    if isinstance(address, IPv6Address) and address.ipv4_mapped:
        address = address.ipv4_mapped
    is_here = address.is_loopback and host in ('::1', LOOPBACK)
    return f'{LOOPBACK if is_here or address.is_unspecified else address}:{port}'
