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

"""Fuzz target: the simulator's CSV, and the PLCs that are made of it."""

import re

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.address_range import AddressRange
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_range
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.csv_table import read_rows
from abdf1_ros.simulator.simulated_plc import COLUMNS, load_plcs
from fuzz.files import path_of

# Seconds after which the values have moved: never, a little, days.
_TIMES = (0.0, 0.0004, 0.7, 10.0, 300_000.0)
_ECHO = Packet(0, 1, 0x06, 0, 0x0102, b'\x00data')


def one_input(data: bytes) -> None:
    """Check that PLCs can be made of a file and live, or that it is refused in visible lines."""
    now = 0.0
    path = path_of(data)
    try:
        plcs = load_plcs(path, Checksum.CRC, lambda: now)
    except ConfigurationError as error:
        assert error.problems
        for problem in error.problems:
            assert str(problem).isprintable()
            assert re.match(r':[1-9][0-9]*(:[1-9][0-9]*)?( \(\w+\))?: ',
                            str(problem).removeprefix(path))
        return
    tables = {plc.station: plc.table for plc in plcs}
    assert len(tables) == len(plcs) and all(0 <= station <= 254 for station in tables)
    for row in read_rows(path, COLUMNS):
        table = tables[int(row.get('Station'))]
        found = parse_range(row.get('Address'), table.plc_type)
        address = found.first if isinstance(found, AddressRange) else found
        assert address.offset < table.length(address.area) <= address.area_size
    for plc in plcs:
        sizes = _sizes(plc.table)
        for time in _TIMES:
            now = time
            assert plc.serve(_ECHO) == _ECHO.reply(b'data')
        assert _sizes(plc.table) == sizes


def _sizes(table: DataTable) -> dict[object, int]:
    return {area: table.length(area) for area in table}
