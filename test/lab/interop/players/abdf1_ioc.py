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
The EPICS driver AbDf1 in an IOC of this process: records of a PLC-5, or words that it serves.

Arguments: its library, the port, its own station, the station of the records (the same: the
driver serves them), and the addresses.
"""

from __future__ import annotations

from collections.abc import Iterable
import ctypes
import os
from pathlib import Path
import re
import sys
import tempfile
import time

from epicscorelibs import ioc
from player import Cannot, play

DEVICES = """
driver(drvAbDf1)
variable(drvAbDf1SrcStationNumber, int)
variable(drvAbDf1Debug, int)
registrar(drvAbDf1CommandsRegister)
device(ai, INST_IO, devAiAbDf1_s16, "AB DF1 words")
device(ao, INST_IO, devAoAbDf1_s16, "AB DF1 words")
device(ai, INST_IO, devAiAbDf1, "AB DF1 floats")
device(ao, INST_IO, devAoAbDf1, "AB DF1 floats")
device(bi, INST_IO, devBiAbDf1, "AB DF1 bits")
device(bo, INST_IO, devBoAbDf1, "AB DF1 bits")
"""
SCAN = 400.0  # ms between reads
SETTLE = 1.0  # s: longer than a scan, with whatever is under way
WORDS = ('T', 'C', 'R')


def main() -> None:
    """Start the IOC and play."""
    library, port, own, station, *addresses = sys.argv[1:]
    ctypes.CDLL(library, ctypes.RTLD_GLOBAL)
    records = {place: f'R{number}' for number, place in enumerate(
        dict.fromkeys(place for address in addresses for place in places(address)))}
    with tempfile.TemporaryDirectory() as folder:
        database = Path(folder, 'records.db')
        database.write_text(''.join(record(name, place, port, station)
                                    for place, name in records.items()))
        Path(folder, 'abdf1.dbd').write_text(DEVICES)
        ctypes.c_int.in_dll(ctypes.CDLL(library), 'drvAbDf1SrcStationNumber').value = int(own)
        ctypes.c_double.in_dll(
            ctypes.CDLL(library), 'drvAbDf1DefaultScanPeriod_mS').value = SCAN
        ioc.start_ioc(dbs=[(str(database), '')], extra_dbd_load=[('abdf1.dbd', folder)])
    db = ioc.dbCore

    def field(name: str) -> ctypes.Array[ctypes.c_char]:
        address = ctypes.create_string_buffer(512)  # a struct dbAddr, which is smaller
        if db.dbNameToAddr(name.encode(), address):
            raise LookupError(name)
        return address

    def get(name: str) -> float:
        value = ctypes.c_double()
        one = ctypes.c_long(1)
        if db.dbGetField(field(name), DBR_DOUBLE, ctypes.byref(value), None, ctypes.byref(one),
                         None):
            raise OSError(f'dbGetField {name}')
        return value.value

    def fail_where_invalid(places: Iterable[str], way: str) -> None:
        for place in places:
            if get(f'{records[place]}{way}.SEVR') >= INVALID:
                raise OSError(f'{place}: STAT {get(f"{records[place]}{way}.STAT"):.0f}')

    written: set[str] = set()

    def read(address: str, count: int) -> object:
        values = []
        if not places(address, count):
            raise Cannot('no strings, no whole structures, and B files stay undefined')
        time.sleep(SETTLE)
        fail_where_invalid(written, 'O')  # a write may end after SETTLE
        for place in places(address, count):
            if place not in records:
                raise Cannot(f'there is no record for {place}')
            fail_where_invalid([place], 'I')
            values.append(get(f'{records[place]}I.VAL'))
        return values if address.startswith('F') else [int(value) for value in values]

    def write(address: str, values: object) -> None:
        if isinstance(values, str) or not places(address, len(values)):
            raise Cannot('no strings, no whole structures, and B files stay undefined')
        for place, value in zip(places(address, len(values)), values):
            if place not in records:
                raise Cannot(f'there is no record for {place}')
            number = ctypes.c_double(signed(value) if isinstance(value, int) else value)
            if db.dbPutField(field(f'{records[place]}O.VAL'), DBR_DOUBLE, ctypes.byref(number),
                             ctypes.c_long(1)):
                raise OSError(f'dbPutField {place}')
        time.sleep(SETTLE)
        written.update(places(address, len(values)))
        fail_where_invalid(written, 'O')

    time.sleep(SETTLE)
    play(read, write)
    os._exit(0)  # the driver's threads do not end


DBR_DOUBLE = 10
INVALID = 3


def signed(word: int) -> int:
    """Return a word as the signed number that a record has for it."""
    return (word & 0xFFFF ^ 0x8000) - 0x8000


def places(address: str, count: int | None = None) -> list[str]:
    """Return what the driver calls each value of an address, as "N7:3" of "N7:0 4"."""
    address, _, given = address.partition(' ')
    count = int(given or count or 1)
    match = re.fullmatch(r'([A-Z]+)(\d*):(\d+)(.*)', address)
    assert match, address
    letter, table, element, rest = match.groups()
    if letter in ('ST', 'B') or not rest and letter in WORDS:
        # It has no strings and no whole structures; it takes B3:1 for bit 1, and records of
        # B3:1/5 stay undefined in 4.1.13, on the line they are read.
        return []
    if letter == 'S':
        return [f'S{int(element) + number}' for number in range(count)]
    if rest:
        return [f'{letter}{table}:{element}{rest}']
    return [f'{letter}{table}:{int(element) + number}' for number in range(count)]


def record(name: str, place: str, port: str, station: str) -> str:
    """Return an input and an output record for one value."""
    is_bit = re.search(r'/\d+$', place)
    kind = 'bits' if is_bit else 'floats' if place.startswith('F') else 'words'
    prefix = 'b' if is_bit else 'a'
    return ''.join(
        f'record({prefix}{way}, "{name}{way.upper()}") {{\n'
        f'  field(DTYP, "AB DF1 {kind}") field({link}, "@ {port} {station} {place}")\n'
        f'  field(SCAN, "{scan}") {limits if prefix == "a" else ""}\n}}\n'
        for way, link, scan, limits in (
            ('i', 'INP', 'I/O Intr', ''), ('o', 'OUT', 'Passive', '')))


main()
