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

"""The first net.csv and map.csv of a line, made from the replies of its PLCs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
import errno
import os
from pathlib import Path

from abdf1_ros.cli.plc import files
from abdf1_ros.cli.plc.data import processor_cell
from abdf1_ros.cli.plc.detect import Found
from abdf1_ros.cli.plc.line import free_station, MODES, unusual_bits
from abdf1_ros.cli.plc.presence import Presence
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import Network

_TIMEOUT = 300  # ms; shorter than the default of a net CSV, for a user who waits

_HEAD = """\
# One mapping per row: a PLC address that becomes a topic. A row that begins with # is not used:
# remove the #, and write the address and tag that you need.
# Command is Read, Write, ReadWrite, Serve or Heartbeat. With Fallback or Heartbeat use shorter
# times in net.csv, so that failures are noticed soon: Timeout 100, Cmd_Timeout 500,
# NAK_Retries 1, ENQ_Retries 1. "check" prints the resulting times, and those for PLC timers.
Tag,Command,Address,Station,PLC_Type,Processor,Length,Period,While,Fallback,Fallback_After
"""


class NewFiles:
    """
    New files in a folder, by their names.

    Raises ConfigurationError if a file exists already, or the folder cannot be made. ``write``
    makes the folder.
    """

    def __init__(self, folder: Path, *names: str) -> None:
        self.paths = [folder / name for name in names]
        there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        if not there.is_dir() or not os.access(there, os.W_OK):
            raise ConfigurationError([Problem(str(folder), (
                f'cannot be used: {there} is not a folder, or you may not write to it'))])
        for path in self.paths:
            if path.exists() and path.stat().st_size:  # a failed pipe leaves an empty file
                raise ConfigurationError([Problem(str(path), (
                    'exists already and is not changed; give another folder with --into'))])

    def write(self, *texts: str) -> None:
        """Write all files, or leave none of them and raise ConfigurationError."""
        path, begun = self.paths[0], list[Path]()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            for path, text in zip(self.paths, texts, strict=True):
                with path.open('a', encoding='utf-8') as file:
                    if file.tell():  # another program has written it meanwhile
                        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
                    begun.append(path)
                    file.write(text)
        except OSError as error:
            for written in begun:
                with suppress(OSError):
                    written.unlink()
            raise ConfigurationError([Problem(
                str(path), f'cannot be written: {error.strerror}')]) from None


def files_of(network: Network, found: Found, stations: Sequence[Presence],
             listed: Mapping[int, Sequence[DataFile]]) -> tuple[str, str]:
    """Return net and map CSV of a line, with the files that its stations list."""
    numbers = [presence.station for presence in stations]
    return (net_csv(network, found, numbers) + '\n',
            _HEAD + ''.join(map_rows(stations, listed, found.settings.mode)))


def nodes_of(gateway: int, mode: str) -> str:
    """Return the arguments of "plc scan" for the nodes behind a gateway."""
    return f'0-63 --via {gateway}' if mode == MODES['half'] else '0-63'


def net_csv(network: Network, found: Found, stations: Collection[int]) -> str:
    """Return a net CSV with the settings found; our own Station is not in ``stations``."""
    settings = found.settings
    return _csv({
        'Station': free_station(settings.on(network).station, stations), 'Mode': settings.mode,
        'Error_Code': settings.check, 'Com_Port': network.port, 'Baud': settings.baud,
        'Parity': network.parity, **unusual_bits(network), 'Timeout': _TIMEOUT})


def listening_csv(network: Network) -> str:
    """Return a net CSV for Mode Listen."""
    return _csv({
        'Mode': 'Listen', 'Error_Code': network.error_code, 'Com_Port': network.com_port,
        'Listen_Port': network.listen_port, 'Baud': network.baud, 'Parity': network.parity,
        **unusual_bits(network)}) + '\n'


def _csv(cells: Mapping[str, object]) -> str:
    """Return a net CSV with these cells by column, without the last line end."""
    return f'{",".join(cells)}\n{",".join(map(str, cells.values()))}'


def map_rows(stations: Iterable[Presence], listed: Mapping[int, Sequence[DataFile]],
             mode: str = MODES['half']) -> Iterable[str]:
    """Yield for each station one row that works, and rows for its files as comments."""
    for presence in stations:
        number, identity = presence.station, presence.identity
        family = identity.plc_type if identity else None
        yield f'# station {number}: {presence}\n'
        if presence.is_of_gateway:
            via = f' have Via {number}' if mode == MODES['half'] else ' have an empty Via'
            yield f'# a gateway: PLCs behind it{via} and their own numbers; to find them:\n' \
                  f'#   plc scan {nodes_of(number, mode)} --net net.csv\n'
            continue
        if family is None or identity is None:
            yield f'# the family of the PLC is not known: write PLC_Type yourself\n' \
                  f'# words_{number},Read,N7:0,{number},SLC,,10,1000,,,\n'
            continue
        tail = f'{number},{family.value},{processor_cell(identity.processor)}'
        guard = 'RUN' if identity.mode is not None else ''  # docs/heartbeats.md, rule 13
        there = FAMILIES[family].examples
        yield f'status_{number},Read,{there.status},{tail},4,1000,,,\n'
        yield f'# words_{number},Read,{there.words},{tail},10,1000,,,\n'
        yield f'# interlocks_{number},Read,{there.bits},{tail},8,250,{guard},,\n'
        yield f'# setpoint_{number},Write,{there.setpoint},{tail},1,,,0,2000\n'
        yield f'# ros_alive_{number},Heartbeat,{there.heartbeat},{tail},,1000,,,\n'
        for row in files.map_rows(listed.get(number, ()), number, family, identity.processor):
            yield f'{row}\n' if row.startswith('#') else \
                f'# {row.replace(",", f"_{number},", 1)},,,\n'
